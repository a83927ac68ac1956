"""A film that closes on itself, with axial grooves that hold a pressure: films between the grooves, each a problem of its own.

The points in a groove have its pressure and no void. They are Dirichlet points of the films on both sides, so those are
solved one by one; this file has the whole: its certificate, what leaves the grooves, its quantities.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.parallel import Array
from ..certificate import Certificate, certificate_tol
from ..solution import Fields
from .flows import volume_unit
from .lubrication import LubricationProblem


@dataclass(frozen=True)
class Groove:
    """Columns first to first + count - 1 of the grid, counted round, hold the pressure p (Pa above p_c)."""

    first: int
    count: int
    p: float


@dataclass(frozen=True)
class Pad:
    """The film between two grooves: n columns from `first` on, and the pressures at its west and east side."""

    first: int
    n: int
    west: float
    east: float


def pads_between(nx: int, grooves: tuple[Groove, ...]) -> list[Pad]:
    """The films between the grooves of a ring of nx columns, one behind the other; ValueError where none is left."""
    ordered = sorted(grooves, key=lambda groove: groove.first)
    pads = []
    for k, groove in enumerate(ordered):
        behind = ordered[(k + 1) % len(ordered)]
        start = groove.first + groove.count
        n = (behind.first - start) % nx if len(ordered) > 1 else nx - groove.count
        if n < 1 or groove.count < 1 or sum(g.count for g in ordered) >= nx:
            raise ValueError("grooves that overlap, or leave no point of the grid between them")
        pads.append(Pad(start % nx, n, groove.p, behind.p))
    return pads


class GroovedProblem(LubricationProblem):
    """The whole ring; solved by way of its pads (`drivers.grooves`), never as it stands here."""

    grooves: tuple[Groove, ...] = ()

    @property
    def columns(self) -> list[NDArray[np.bool_]]:
        """For each groove, whether an owned point lies in it."""
        grid = self.grid
        number = np.broadcast_to(np.arange(grid.x_start, grid.x_end)[None, :], grid.box).ravel()
        return [(number - groove.first) % grid.shape[0] < groove.count for groove in self.grooves]

    def groove_flows(self, p: Array, r: Array) -> list[float]:
        """Volume flow that each groove gives to the film, m3/s (1D: m2/s). Collective."""
        balance, unit = self.face_flows(p, r), volume_unit(self)
        return [unit * self.reduce.sum(np.where(inside, balance, 0.0)) for inside in self.columns]

    def certify(self, fields: Fields, eps1: float) -> Certificate:
        """As for any film, over the points outside the grooves; inside, that they hold their pressure. Collective."""
        red, p, r = self.reduce, fields["p"], fields["r"]
        columns = self.columns
        free = ~np.logical_or.reduce(columns)
        Ap, Br = (np.where(free, self.multiply(*pair), 0.0) for pair in ((self.A, p), (self.B, r)))
        c = np.where(free, self.c, 0.0)
        F = Ap + Br - c
        scale = red.norm(Ap) + red.norm(Br) + red.norm(c)
        p_max = red.max(np.abs(p))
        off = sum(
            red.max(np.where(inside, np.abs(p - groove.p / self.p_unit) / (p_max or 1.0) + r, 0.0))
            for inside, groove in zip(columns, self.grooves, strict=True)
        )
        gaps = red.max(np.abs(np.minimum(p / p_max if p_max > 0 else p, r)))
        # What the wall drags round is the scale of all that flows.
        dragged = red.sum(np.where(free, np.abs(self.scheme.b_C.ravel()), 0.0)) / self.grid.shape[0]
        return Certificate(
            measures={
                "residual": red.norm(F) / scale if scale != 0 else 0.0,
                "complementarity": max(gaps, off),
                "mass_defect": abs(red.sum(F)) / dragged if dragged > 0 else 0.0,
                **self.more_measures,
            },
            tol=certificate_tol(eps1),
            extremes={"min_p": red.min(p) * self.p_unit, "min_r": red.min(r)},
        )

    def quantities(self, fields: Fields) -> dict[str, Any]:
        """Those of any film, and `groove_flow`: what each groove gives, m3/s. Collective."""
        return {**super().quantities(fields), "groove_flow": self.groove_flows(fields["p"], fields["r"])}
