"""Where a film would be full if each of its lines were a film by itself, by sums alone: a start for direct steps.

A film along a line has just these fronts, but for rounding; one in the plane has them near if its lines exchange little.

Steady, a line passes one flow q everywhere, none if an end is closed. Full up to point j the film has p_j = p_W + A_j - q B_j,
with A and B the sums of couette/k and of 1/k over the faces up to j: that no pressure is below 0 means q <= (p_W + A_j)/B_j
for all points and for the other end, where p_E stands beside p_W. The least of these is the flow. From the east end back p_j
is the larger of p_{j+1} + (q - couette)/k and 0: a film that ends where the wall carries q reaches back to where its pressure
is gone, and before that lies a cavity. `film.line` has the same of one line's integrals, and the front inside its cell.
"""

import numpy as np
from numpy.typing import NDArray

from ..base.parallel import Array
from ..problems.film.cavity import followed
from ..problems.film.lubrication import LubricationProblem
from ..problems.grid import Grid

ROUNDING = 1e-12  # of the largest sum: pressures below that are none
ALIKE = 0.05  # of the lines' mean flow: a standard deviation up to which they exchange little


def full_along(problem: LubricationProblem) -> NDArray[np.bool_] | None:
    """Owned points where the film is full; None if its lines end at no given pressures or exchange much, or if nothing presses
    them. Collective."""
    s, grid = problem.scheme, problem.grid
    west, east = grid.ends[0]
    if {west, east} not in ({"open"}, {"open", "closed"}) or s.storage is not None or problem.held is not None:
        return None
    if grid.dim == 2:
        long = grid.ends[1].count("open") * grid.lengths[0] > 2.0 * grid.lengths[1]  # much leaves through the sides
        if long or grid.box[1] < grid.shape[0] or east == "closed":
            return None
    if east == "closed":  # what the wall brings stays
        return np.ones(grid.local_size, dtype=bool)
    p_W, p_E = (side / problem.p_unit for side in problem.p_sides[:2])
    couette, k = (_at_faces(grid, *sides) for sides in ((s.couette_W, s.couette_E), (s.k_W, s.k_E)))
    with np.errstate(all="ignore"):  # conductances that are no numbers are refused elsewhere
        F, J = (np.cumsum(np.where(k > 0.0, of / k, 0.0), axis=1) for of in (couette, np.ones_like(k)))
        q = np.zeros((len(k), 1))
        if west == "open":
            q = np.minimum(((p_W + F) / J)[:, :-1].min(axis=1), (p_W - p_E + F[:, -1]) / J[:, -1])[:, None]
        if grid.dim == 2 and not _alike(problem, q):
            return None
        Z = F - q * J
        own = slice(grid.x_start, grid.x_end)
        pressed = followed(Z, p_E)[:, own] > ROUNDING * problem.reduce.largest(Z - Z[:, -1:] + p_E)
    return pressed.ravel() if problem.reduce.max(pressed.astype(float)) else None


def _at_faces(grid: Grid, west: Array, east: Array) -> Array:
    """What whole lines have at their faces from one end to the other; of a line that ranks share all of them have all."""
    own = np.concatenate([west, east[:, -1:]], axis=1)
    if grid.box[1] == grid.shape[0]:
        return own
    return np.concatenate(grid.comm.allgather(own if grid.x_end == grid.shape[0] else west), axis=1)


def _alike(problem: LubricationProblem, q: Array) -> bool:
    """Whether the flows of all lines are so nearly one that a film is as if no line knew of the others. Collective."""
    reduce, ny = problem.reduce, problem.grid.shape[1]
    mean = reduce.sum(q) / ny
    return reduce.sum((q - mean) ** 2) <= ny * (ALIKE * mean) ** 2
