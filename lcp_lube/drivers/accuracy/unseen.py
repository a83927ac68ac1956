"""What of a film a grid does not see: jumps between its points, and detail inside cells."""

from math import inf

import numpy as np

from ...problems.film.edges import jumps_of, level
from ...problems.film.lubrication import LubricationProblem
from ...problems.solution import Problem

UNSEEN = 0.05  # share of its h^-3 that the face must miss for a cell without a jump to count: a steep ramp, a narrow ridge
ON_LINE = 1e-9  # of a side: a jump so near a line of points, or of looks, is on it
LINES, PARTS = 65, 16  # lines across a 2D film on which it is looked at, and looks between two points
# Looks, in spacings from the left one of two points: just inside of both, where a film that jumps at a point has its own side.
_LOOKS = np.clip(np.linspace(0.0, 1.0, PARTS + 1), 1e-7, 1.0 - 1e-7)
_WEIGHTS = np.array([0.5, *[1.0] * (PARTS - 1), 0.5]) / PARTS


def misplaced_film(problem: Problem) -> float:
    """Share of Int h^-3 that a grid misplaces where the film jumps between two of its points, or has detail unseen there.

    The scheme takes the film between two points as it is at the face. Elsewhere that is of second order, which values show;
    a jump is moved by up to half a spacing, by the same length on grids that halve. Where faces are made for the rims that cut
    them (`rims`) jumps are seen. Each rank computes all of it, from lines of the film that do not depend on the grid.
    """
    if not isinstance(problem, LubricationProblem) or problem.integrals is not None:  # a line of which nothing is misplaced
        return 0.0
    grid = problem.grid
    share, alike, jumps = 0.0, level(problem.film), np.array(jumps_of(problem.film, "y"))
    for side in range(grid.dim):
        n, around = grid.shape[side], grid.with_neighbours(side)  # points, on the boundary and beyond it
        near = ON_LINE * (around[-1] - around[0])
        if side == 1 and alike:  # it changes at its jumps alone
            inside = jumps[(jumps > around[0]) & (jumps < around[-1])]
            if np.all(np.abs(inside[:, None] - around).min(axis=1, initial=np.inf) <= near):
                continue
        meshes = np.diff(around)
        fine = (around[:-1] + _LOOKS[:, None] * meshes).ravel()
        face = around[:-1] + 0.5 * meshes
        across = 1 - side
        many = (np.arange(LINES) + 0.5) / LINES
        lines = np.zeros(1) if grid.dim == 1 else grid.origin[across] + many * grid.lengths[across]
        between = np.arange(lines.size)
        if side == 0 and alike:  # of those between two jumps one is as good as all
            between = np.searchsorted(np.sort(np.concatenate([jumps - near, jumps + near])), lines)
        _, first, counts = np.unique(between, return_index=True, return_counts=True)
        lines = lines[first]
        film = [
            np.broadcast_to(problem.film(*((at[None, :], lines[:, None])[:: 1 - 2 * side])), (lines.size, at.size))
            for at in (fine, face)
        ]
        told = getattr(problem, "moving", problem).tops and bool(getattr(problem.film, "rims", ()))
        share += _misplaced(film[0].reshape(lines.size, PARTS + 1, n + 1), film[1], told, counts)
    return share


def _misplaced(looks: np.ndarray, face: np.ndarray, told: bool, counts: np.ndarray) -> float:
    """`misplaced_film` from the film at the looks, shape (lines, PARTS + 1, n + 1), and at the faces, shape (lines, n + 1).

    told : the scheme knows where the film jumps. counts : how many lines each one stands for.
    """
    if not (looks.min() > 0 and face.min() > 0):
        return inf  # what the grid's own points do not show
    mean = _WEIGHTS @ (1.0 / (looks * looks * looks))
    off = np.abs(1.0 / face**3 - mean)
    most = looks.max(axis=1)
    spread = most - looks.min(axis=1)
    jump = np.abs(np.diff(looks, axis=1)).max(axis=1) > 0.5 * spread
    seen = jump & (spread > 1e-9 * most)
    seen = ~seen & (off > UNSEEN * mean) if told else seen | (off > UNSEEN * mean)
    return float(np.sum(counts @ np.where(seen, off, 0.0)) / np.sum(counts @ mean))
