"""The forces on a line as its film has them (`known`), for its stiffness: no grid's error is in them."""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from ...base.parallel import Array
from ...problems.film.borne import by_fields
from ...problems.film.forces import antiderivative, weights
from ...problems.film.known import known_of
from ...problems.film.lubrication import LubricationProblem

TOLD = ("load", "force_x", "force_y")
NEAR = 1e-9  # relative: how far a motion may be from a sum of those that these numbers belong to


def carried_by(problem: LubricationProblem, p: Array, r: Array, cavity: Any, by_borne: Array) -> Array:
    """By what answers z, p in the full film and -r in the cavity, are multiplied for the change of a force. Collective.

    p : owned points, in p_unit. by_borne : of the force with the pressure that counts there.
    """
    by_p, by_r = by_fields(problem, p * problem.p_unit, r, by_borne)
    return np.where(cavity, -by_r, by_p)


def line_forces(problem: LubricationProblem, changes: Sequence[Array]) -> Array | None:
    """Int (p - p_ambient) dh/de for each motion, N/m; None of what is no line, or of other motions. Collective.

    changes : dh/de at the owned points.
    """
    grid, of = problem.grid, weights(problem)
    names = [name for name in TOLD if name in of]
    if (known := known_of(problem)) is None:
        return None
    modes = [np.broadcast_to(of[name](grid.x, np.zeros(1)), grid.box).ravel() for name in names]
    at, motions = (np.concatenate(grid.comm.allgather(np.stack(some, axis=1))) for some in (modes, changes))
    parts = np.linalg.lstsq(at, motions, rcond=None)[0]
    if np.abs(at @ parts - motions).max() > NEAR * np.abs(motions).max():
        return None
    above = known.ambient(problem)
    found: Array = parts.T @ np.array([known.line.integral(antiderivative(problem, name), above) for name in names])
    return found


def stiffness_of(forces: Sequence[Array | None], steps: Sequence[float]) -> Array | None:
    """-dF/de, shape (motions, motions), from the forces with a step of each motion, and one back; None where any is None."""
    found = [one for one in forces if one is not None]
    if not found or len(found) < len(forces):
        return None
    return np.stack([(back - on) / (2.0 * e) for on, back, e in zip(found[::2], found[1::2], steps, strict=True)], axis=1)


class OfLine:
    """What all linearised films share: their stiffness; for a line that of its own, exact numbers."""

    _line: Array | None  # -dF/de of a line, as `stiffness_of` tells; None: of no line
    _fronts: Any = 0.0  # -dF/de, fields held: as fronts lie elsewhere in their cells (`film.borne`)
    _slow: Any  # the answers to motions without an end

    def _forces(self, found: Any) -> Any:
        """-F of each motion's answer, shape (motions, motions)."""
        raise NotImplementedError

    @cached_property
    def _of_grid(self) -> Array:
        """-dF/de of the discrete equations."""
        return self._forces(self._slow).real + self._fronts

    def stiffness(self) -> Array:
        """-dF/de with nothing but e changed, shape (motions, motions)."""
        return self._of_grid if self._line is None else self._line

    @property
    def _misplaced(self) -> Any:
        """What the answers' forces lack of the stiffness, at any frequency: what the grid gets wrong of a line's, and what
        comes of fronts in their cells."""
        return self._fronts if self._line is None else self._line - self._of_grid + self._fronts
