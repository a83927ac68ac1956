"""Faces of films near a solution, made for its cavities: at the side that it comes in by (`inlets`), and about corners
(`recesses`)."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base.parallel import Array
from .cavity import Inlet, ruptured
from .edges import Around
from .face_lines import NONE, FaceLines, Rows
from .inlets import made_at_inlet
from .lubrication import LubricationProblem
from .recesses import Faces, faces_about


@dataclass(frozen=True)
class MadeFaces:
    """Of one film; None: it has no such faces."""

    film: Around
    inlet: Inlet | None = None
    about: tuple[Faces, Faces] | None = None

    @classmethod
    def of(cls, problem: LubricationProblem, film: Around, kind: Any = float) -> "MadeFaces":
        """What the cavities of a problem ask of a film on its points, or on the same ones elsewhere. Collective.

        kind : dtype of the film, complex where it is differentiated."""
        if not problem.remade or problem.dry is None:
            return cls(film)
        driven = problem.p_sides[0] / (6.0 * float(problem.mu) * problem.U) if problem.U else 0.0
        inlet = ruptured(problem.grid, problem.dry, driven) if problem.U else None
        about = faces_about(film.grid, film, problem.dry, kind) if problem.cornered else None
        return cls(film, inlet if inlet is not None and inlet.rows.any() else None, about)

    @property
    def apart(self) -> tuple[Rows, Rows]:
        """Lines of points with such faces, and lines of y faces: they are like no others."""
        x, y = (NONE, NONE) if self.about is None else (np.unique(one.rows) for one in self.about)
        return (x if self.inlet is None else np.union1d(x, np.flatnonzero(self.inlet.rows))), y

    def along(self, at: FaceLines, rows: Rows, C: Array, H: Array) -> tuple[Array, Array]:
        """C and H of the x faces of some lines, these among them."""
        if self.inlet is not None:
            C, H = made_at_inlet(self.film, at.x_places[0], at.y[rows], self.inlet.of(rows), C, H)
        if self.about is None:
            return C, H
        (C, H), (own, *here) = (np.array(a) for a in (C, H)), self.about[0].among(rows)
        H[*here] += self.about[0].drags[own] * C[*here]
        C[*here] *= self.about[0].more[own]
        return C, H

    def over(self, rows: Rows, C: Array) -> Array:
        """C of some lines of y faces, these among them."""
        if self.about is None:
            return C
        C, (own, *here) = np.array(C), self.about[1].among(rows)
        C[*here] *= self.about[1].more[own]
        return C
