"""The pressure as integrals count it in a film whose recesses have corners: behind a cavity it begins at the front.

Where a film reforms between two points, dW apart, flow pressed back, k p, and what void goes by, b r, add up to the void that
comes in, so that the front lies dW k p/(k p + b r) before the full point, and p rises from there in a straight line. A
trapezoid from the cavitated point on counts dW p b r/(k p + b r)/2 too much: by it the point's pressure is lessened,

    p - (dW/2w) p b r/(k p + b r),

w its cell's width. Before the wall of a dimple the full strip is thinner than a cell: there this is 3 % of a load. k and b
are the film's own, at no pressure, as at the front. It follows p and r without a step, grows with p and falls with r, so that
bands hold of it. Other films keep the trapezoid, whose error is neither more nor less than that of their pressures.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...base.parallel import Array
from ..grid import Grid
from .strip import stream_weights

if TYPE_CHECKING:
    from .forces import Weight
    from .lubrication import LubricationProblem


class Begun(NamedTuple):
    """Of the points behind a cavity. at : their flat numbers. part : dW/2w. pressed, void : k p and b r. by_void : b."""

    at: NDArray[np.intp]
    part: Array
    pressed: Array
    void: Array
    by_void: Array


def borne(problem: LubricationProblem, p_pa: Any, r: Array) -> Any:
    """The pressure that integrals count (`fronts.counted`). Collective.

    Parameters
    ----------
    p_pa : owned points, Pa above p_c. r : owned points.
    """
    found = begun(problem, p_pa, r)
    if found is None or not found.at.size:
        return p_pa
    out = np.array(p_pa[:]).ravel()
    out[found.at] *= 1.0 - found.part * found.void / (found.pressed + found.void)
    return out


def by_fields(problem: LubricationProblem, p_pa: Array, r: Array, by_borne: Array) -> tuple[Array, Array | float]:
    """Derivatives by p and by r of the sum of `borne` pressures times `by_borne`, of owned points; 0: by any r. Collective."""
    found = begun(problem, p_pa, r)
    if found is None:
        return by_borne, 0.0
    grid, by_p = problem.grid, np.array(by_borne, dtype=float).ravel()
    all_ = found.pressed + found.void
    more = np.zeros(grid.local_size)
    p = np.ravel(p_pa)[found.at] / problem.p_unit
    more[found.at] = -by_p[found.at] * found.part * p * found.by_void * found.pressed / all_**2
    by_p[found.at] *= 1.0 - found.part * (found.void / all_) ** 2
    return by_p, grid.ghosted(more, outside=0.0)[1:-1, 2:].ravel()


def by_coefficients(problem: LubricationProblem, p_pa: Array, r: Array, by_borne: Array) -> tuple[Array, Array]:
    """Its derivatives by k_W and by b_W, shape `grid.box`, fields held. Collective."""
    by_k, by_b = np.zeros((2, problem.grid.local_size))
    if (found := begun(problem, p_pa, r)) is not None:
        p, k, void = np.ravel(p_pa)[found.at] / problem.p_unit, found.pressed, found.void
        more = np.ravel(by_borne)[found.at] * found.part * p / (k + void) ** 2
        by_k[found.at], by_b[found.at] = more * void * p, -more * k * void / found.by_void
    return by_k.reshape(problem.grid.box), by_b.reshape(problem.grid.box)


def less(grid: Grid, found: Begun, p_pa: Array, wanted: Sequence[Weight]) -> Array:
    """By what integrals with these weights are less for fronts that were found, their points being here now. Collective."""
    j, i = np.divmod(found.at, grid.box[1])
    lost = _part(grid, i) * grid.cell * grid.widths(0)[i] * stream_weights(grid)[j, 0]
    lost *= np.ravel(p_pa)[found.at] * found.void / (found.pressed + found.void)
    own = np.array([np.sum(weight(grid.x[0, i], grid.y[j, 0]) * lost) for weight in wanted])
    return np.asarray(grid.comm.allreduce(own))


def _part(grid: Grid, i: Any) -> Array:
    """dW/2w of columns."""
    return np.asarray(grid.steps(0)[i] / (2.0 * grid.spacing[0] * grid.widths(0)[i]))


def begun(problem: LubricationProblem, p_pa: Any, r: Array) -> Begun | None:
    """None of a film whose integrals know no fronts. Collective."""
    if not problem.cornered:
        return None
    grid, s = problem.grid, problem.bare or problem.scheme
    before = grid.ghosted(np.ravel(r), outside=0.0)[1:-1, :-2]
    p = p_pa.reshape(grid.box)
    j, i = np.nonzero((before > 0.0) & (p[:] > 0.0))
    pressed, b = s.k_W[j, i] * p[j, i] / problem.p_unit, s.b_W_at(j, i)
    return Begun(j * grid.box[1] + i, _part(grid, i), pressed, b * before[j, i], b)
