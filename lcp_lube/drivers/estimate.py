"""Estimated error of a quantity from its values on grids whose spacing halves, and from the film.

The quantity's error falls by 2^q from grid to grid. Two things spoil the textbook estimate |d_k|/(2^q - 1) from the last
difference d_k = v_k - v_(k-1): a front moves within its cell from grid to grid, so that errors of second order on average
come with any factor and sign, and one small difference proves nothing; and a jump of the film stays where it is within a
cell, so that differences can vanish on several grids while the error does not. So the estimate is the greater of

- Richardson's, SAFETY times the largest of the last differences, each carried to the newest grid at second order, over
  2^q - 1 with the order q seen over all of them, between 1 and 2; where the film has edges inside cells, whose error is of
  first order and has any sign, at first order, and q = 1;
- the film's: the share of Int h^-3 that the jumps of the film inside a cell misplace on this grid, times how strongly the
  quantity was seen to answer to it.

Its constants are chosen on random films with exact solutions (tests/drivers/test_accuracy.py).
"""

from collections.abc import Sequence
from math import inf

import numpy as np

from ..problems.film.lubrication import LubricationProblem
from ..problems.solution import Problem

SAFETY = 2.0  # of both estimates
DIFFERENCES = 4  # that Richardson's estimate heeds: a front moves, and one difference can be small by chance
ANSWER = (1.0, 10.0)  # least and greatest answer to a misplaced jump: relative change over share of Int h^-3
UNSEEN = 0.05  # share of its h^-3 that the face must miss for a cell without a jump to count: a steep ramp, a narrow ridge
LINES, PARTS = 17, 16  # lines of a 2D grid on which the film is looked at, and looks between two points
# Looks, in spacings from the left one of two points: just inside of both, where a film that jumps at a point has its own side.
_LOOKS = np.clip(np.linspace(0.0, 1.0, PARTS + 1), 1e-7, 1.0 - 1e-7)
_WEIGHTS = np.array([0.5, *[1.0] * (PARTS - 1), 0.5]) / PARTS


def relative_error(values: Sequence[float], misplaced: Sequence[float]) -> float:
    """Estimated relative error of the last of a quantity's values on grids whose spacing halves; inf where they are too few.

    Parameters
    ----------
    values : coarse to fine; NaN where a grid gave none.
    misplaced : `misplaced_film` on the same grids.
    """
    steps = np.abs(np.diff(values))[-DIFFERENCES:]
    usable = np.flatnonzero(np.isnan(steps))
    steps = steps[usable[-1] + 1 :] if usable.size else steps
    if len(steps) < 2:
        return inf
    if not steps.any() and not misplaced[-1]:
        return 0.0
    if not values[-1]:
        return inf
    age = np.arange(len(steps))[::-1]
    logs = np.log2(steps + np.finfo(float).tiny)
    edges = misplaced[-1] > 0
    order = 1.0 if edges else float(np.clip((logs[0] - logs[-1]) / age[0], 1.0, 2.0))
    fall = 2.0 if edges else 4.0
    richardson = SAFETY * np.max(steps / fall**age) / (2.0**order - 1.0) / abs(values[-1])
    if not misplaced[-1]:
        return float(richardson)
    shares = (np.array(misplaced[:-1]) + misplaced[1:])[-len(steps) :]
    answers = steps[shares > 0] / shares[shares > 0] / abs(values[-1])
    answer = np.clip(np.max(answers, initial=0.0), *ANSWER)
    return float(max(richardson, SAFETY * answer * misplaced[-1]))


def misplaced_film(problem: Problem) -> float:
    """Share of Int h^-3 that a grid misplaces where the film jumps between two of its points, or has detail unseen there.

    The scheme takes the film between two points as it is at the face. Elsewhere that is of second order, which values show;
    a jump is moved by up to half a spacing, by the same length on grids that halve. Each rank computes all of it, from some
    lines of the film.
    """
    if not isinstance(problem, LubricationProblem):
        return 0.0
    grid = problem.grid
    share = 0.0
    for side in range(grid.dim):
        n, around = grid.shape[side], grid.with_neighbours(side)  # points, on the boundary and beyond it
        meshes = np.diff(around)
        fine = (around[:-1, None] + _LOOKS * meshes[:, None]).ravel()
        face = around[:-1] + 0.5 * meshes
        across = 1 - side
        if grid.dim == 1:
            lines = np.zeros(1)
        else:
            picked = np.unique(np.linspace(0, grid.shape[across] - 1, min(LINES, grid.shape[across])).round())
            lines = grid.lines[across][picked.astype(int)]
        film = [
            np.broadcast_to(problem.film(*((at[None, :], lines[:, None])[:: 1 - 2 * side])), (lines.size, at.size))
            for at in (fine, face)
        ]
        share += _misplaced(film[0].reshape(lines.size, n + 1, PARTS + 1), film[1])
    return share


def _misplaced(looks: np.ndarray, face: np.ndarray) -> float:
    """`misplaced_film` from the film at the looks, shape (lines, n + 1, PARTS + 1), and at the faces, shape (lines, n + 1)."""
    if not (looks.min() > 0 and face.min() > 0):
        return inf  # what the grid's own points do not show
    weight = looks**-3.0
    mean = weight @ _WEIGHTS
    off = np.abs(face**-3.0 - mean)
    spread = looks.max(axis=-1) - looks.min(axis=-1)
    jump = np.abs(np.diff(looks, axis=-1)).max(axis=-1) > 0.5 * spread
    seen = jump & (spread > 1e-9 * looks.mean(axis=-1)) | (off > UNSEEN * mean)
    return float(np.sum(off[seen]) / np.sum(mean))
