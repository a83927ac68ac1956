"""Where a film would be full if each of its lines were a film by itself, by sums alone: a start for direct steps.

A film along a line has just these fronts, but for rounding; one in the plane has them near if its lines exchange little.

Steady, a line passes one flow q everywhere, none if an end is closed. Full up to point j the film has p_j = p_W + A_j - q B_j,
with A and B the sums of couette/k and of 1/k over the faces up to j: that no pressure is below 0 means q <= (p_W + A_j)/B_j
for all points and for the other end, where p_E stands beside p_W. The least of these is the flow. From the east end back p_j
is the larger of p_{j+1} + (q - couette)/k and 0: a film that ends where the wall carries q reaches back to where its pressure
is gone, and before that lies a cavity.
"""

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from ..base.parallel import Array
from ..problems.film.lubrication import LubricationProblem

ROUNDING = 1e-12  # of the largest sum: pressures below that are none
ALIKE = 0.05  # of the lines' mean flow: a standard deviation up to which they exchange little


def full_along(problem: LubricationProblem) -> NDArray[np.bool_] | None:
    """Owned points where the film is full; None if its lines end at no given pressures or exchange much, or if nothing presses
    them. Collective."""
    s, grid = problem.scheme, problem.grid
    west, east = grid.ends[0]
    if {west, east} not in ({"open"}, {"open", "closed"}) or s.storage is not None or problem.held is not None:
        return None
    nx, shared = grid.shape[0], grid.box[1] < grid.shape[0]
    if grid.dim == 2:
        long = grid.ends[1].count("open") * grid.lengths[0] > 2.0 * grid.lengths[1]  # much leaves through the sides
        if long or shared or east == "closed":
            return None
    if east == "closed":  # what the wall brings stays
        return np.ones(grid.local_size, dtype=bool)
    ranks, last = grid.comm if shared else MPI.COMM_SELF, grid.x_end == nx
    p_W, p_E = (side / problem.p_unit for side in problem.p_sides[:2])
    q = np.zeros((grid.box[0], 1))
    with np.errstate(all="ignore"):  # conductances that are no numbers are refused elsewhere
        if west == "open":
            A, B = (_sums(ranks, a) for a in (s.couette_W / s.k_W, 1.0 / s.k_W))
            end = (p_W - p_E + A + s.couette_E / s.k_E) / (B + 1.0 / s.k_E)
            least = np.minimum(((p_W + A) / B).min(axis=1), end[:, -1] if last else np.inf)
            q = _of_all(ranks, least).min(axis=0)[:, None]
            if grid.dim == 2 and not _alike(problem, q):
                return None
        rises = (q - s.couette_E) / s.k_E
        up_to = _sums(ranks, rises)
        full = p_E + _of_all(ranks, up_to[:, -1])[-1][:, None] - (up_to - rises)  # p, were all of it full to the east end
        lowest = np.minimum.accumulate(full[:, ::-1], axis=1)[:, ::-1]
        beyond = _of_all(ranks, lowest[:, 0])[ranks.rank + 1 :].min(axis=0, initial=0.0)[:, None]
        p = full - np.minimum(lowest, beyond)
        pressed = p > ROUNDING * problem.reduce.largest(full)
    return pressed.ravel() if problem.reduce.max(pressed.astype(float)) else None


def _alike(problem: LubricationProblem, q: Array) -> bool:
    """Whether the flows of all lines are so nearly one that a film is as if no line knew of the others. Collective."""
    reduce, ny = problem.reduce, problem.grid.shape[1]
    mean = reduce.sum(q) / ny
    return reduce.sum((q - mean) ** 2) <= ny * (ALIKE * mean) ** 2


def _of_all(ranks: MPI.Comm, values: NDArray) -> NDArray:
    """What each rank has of its part of the lines, rank by rank."""
    return np.array(ranks.allgather(values)) if ranks.size > 1 else values[None]


def _sums(ranks: MPI.Comm, a: Array) -> Array:
    """Running sums along the lines, over the ranks before this one too."""
    own = np.cumsum(a, axis=1)
    return own + _of_all(ranks, own[:, -1])[: ranks.rank].sum(axis=0)[:, None]
