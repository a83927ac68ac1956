"""The largest pressure of a film between its points: of second order in height and place, wherever the points lie.

From the largest of all points on, a parabola along x and one along y, with the mixed derivative. Pressures have kinks where
films jump, and a line of points lies on each straight edge: so each side of the point has a parabola of its own, whose
curvature is the lesser one of those at the point and at its neighbour there, the one without a kink (as ENO schemes choose).
A top that is a kink stays what it is, and so does a point that a supply holds.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.parallel import Array
from ..grid import Grid

NONE, FIRST_SIDE, LAST_SIDE = -1, -2, -3  # numbers of what is no point
TINY = 1e-30  # a complex step, which has no rounding


class Window:
    """The pressures around the point at `place` that has the largest of all. Collective.

    Parameters
    ----------
    p : owned points. p_sides : west, east, south, north, in the unit of p; read where the end is open.
    held : owned points whose pressure a supply holds: one of them is the top, as oil flows from it to all sides.
    """

    def __init__(
        self, grid: Grid, p: Array, place: Sequence[float], p_sides: Sequence[float], held: NDArray[np.bool_] | None = None
    ):
        (self._x, columns), (self._y, rows) = (_around(grid, axis, place) for axis in (0, 1))
        self._dim = grid.dim
        self._mine = [  # row and column of the window, number of the owned point
            (n, m, (row - grid.y_start) * grid.box[1] + column - grid.x_start)
            for n, row in enumerate(rows)
            for m, column in enumerate(columns)
            if grid.y_start <= row < grid.y_end and grid.x_start <= column < grid.x_end
        ]
        own = np.zeros((5, 5))
        for n, m, k in self._mine:
            own[n, m] += p[k]
            if n == m == 2 and held is not None and held.ravel()[k]:
                own += np.where(np.arange(25).reshape(5, 5) == 12, 0.0, np.nan)  # nothing beside it has a say
        self._p = grid.comm.allreduce(own)
        for side, (numbers, across) in enumerate(((columns, self._p.T), (rows, self._p))):
            across[numbers == FIRST_SIDE], across[numbers == LAST_SIDE] = p_sides[2 * side : 2 * side + 2]
            across[numbers == NONE] = np.nan

    def top(self) -> tuple[float, list[float]]:
        """The largest pressure, and its x (and y), m."""
        rise, step = _rise(self._x, self._y, self._p)
        return float(self._p[2, 2] + rise), [float(self._x[2] + step[0]), float(self._y[2] + step[1])][: self._dim]

    def slopes(self, size: int) -> Array:
        """Derivatives of the largest pressure by those of this rank's points, so many of them."""
        out = np.zeros(size)
        for n, m, k in self._mine:
            moved = self._p.astype(complex)
            moved[n, m] += 1j * TINY
            out[k] += _rise(self._x, self._y, moved)[0].imag / TINY + float(n == m == 2)
        return out


def _around(grid: Grid, axis: int, place: Sequence[float]) -> tuple[Array, NDArray[np.int64]]:
    """Places, m, and numbers of a point and of two to either side: points, their mirror images, a side, or nothing."""
    places, numbers = np.full(5, np.nan), np.full(5, NONE)
    if axis == grid.dim:
        places[2] = numbers[2] = 0
        return places, numbers
    n, line, (low, length) = grid.shape[axis], grid.lines[axis], (grid.origin[axis], grid.lengths[axis])
    at = int(np.argmin(np.abs(line - place[axis])))
    for m, k in enumerate(range(at - 2, at + 3)):
        end = grid.ends[axis][int(k >= n)]
        edge, outside = (low, -1 - k) if k < 0 else (low + length, k - n)
        number = k if 0 <= k < n else NONE
        x = 0.0
        if number != NONE:
            x = line[number]
        elif end == "periodic":
            number = k % n
            x = line[number] + (k // n) * length
        elif end == "open":
            x, number = edge, (FIRST_SIDE if k < 0 else LAST_SIDE) if outside == 0 else NONE
        else:
            inside = outside + (end == "mirror")
            if inside < n:
                number = inside if k < 0 else n - 1 - inside
                x = 2.0 * edge - line[number]
        if number != NONE:
            places[m], numbers[m] = x, number
    return places, numbers


@np.errstate(invalid="ignore")  # of what lies beyond
def _rise(x: Array, y: Array, p: NDArray[Any]) -> tuple[Any, tuple[float, float]]:
    """By how much the top lies above the middle of the window, and how far away from it, m."""
    (s, a), (t, b) = _along(x, p[2]), _along(y, p[:, 2])  # slopes and curvatures
    step: tuple[Any, Any] = (-s / a if a else 0.0, -t / b if b else 0.0)
    if a and b:
        mixed = (p[3, 3] - p[3, 1] - p[1, 3] + p[1, 1]) / ((x[3] - x[1]) * (y[3] - y[1]))
        det = a * b - mixed * mixed
        if np.real(det) > 0.5 * np.real(a * b):
            step = ((mixed * t - b * s) / det, (mixed * s - a * t) / det)
    return 0.5 * (s * step[0] + t * step[1]), (float(np.real(step[0])), float(np.real(step[1])))


def _along(x: Array, p: NDArray[Any]) -> tuple[Any, Any]:
    """Slope at the middle of five points and curvature of the parabola whose top lies beside it; 0, 0 where none does."""
    d = np.diff(x)
    slopes = np.diff(p) / d
    curvatures = np.diff(slopes) / (0.5 * (d[:-1] + d[1:]))
    found: tuple[Any, Any] = (0.0, 0.0)
    highest = 0.0
    for beside, face, sign in ((2, 2, 1.0), (0, 1, -1.0)):
        c = min((curvatures[k] for k in (1, beside) if np.isfinite(curvatures[k])), key=abs, default=0.0)
        s = slopes[face] - 0.5 * sign * c * d[face]  # of the parabola between the middle and its neighbour
        away = sign * np.real(s)
        if np.real(c) < 0 and 0 < away <= -np.real(c) * d[face] and (rise := away * away / -np.real(c)) > highest:
            found, highest = (s, c), rise
    return found
