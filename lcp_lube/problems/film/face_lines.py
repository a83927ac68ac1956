"""Lines of a grid along which a film is alike, and what its faces there conduct and drag."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.parallel import Array
from ..grid import Grid
from .edges import Around, face_film, pairs
from .flows import held, linear, sheared_lines
from .strip import line_weights, stream_weights

NEAR = 1e-6  # of a cell: an edge so near it counts as inside
Rows = NDArray[np.int64]
NONE: Rows = np.zeros(0, dtype=np.int64)


@dataclass(frozen=True)
class FaceLines:
    """Places of a grid's lines and of the faces between them, and the first of each run of those that are alike."""

    grid: Grid
    x_places: tuple[Array, Array]
    y_places: tuple[Array, Array]
    steps: Array
    y: Array
    across: Array
    lines: Rows
    faces: Rows

    @classmethod
    def of(cls, grid: Grid, level: bool, cut: Sequence[float], apart: Sequence[Rows] = (NONE, NONE)) -> "FaceLines":
        """level : the film is the same along y between the edges y = const that `cut` tells. apart : of the lines, and of those
        of the faces between them, such as are like no other."""
        y_nodes, y_faces = grid.nodes_and_faces(1)
        y, across = grid.y[:, 0], pairs(grid.steps(1))
        lines, faces = np.arange(y.size), np.arange(y_faces.size)
        if level:
            lines = _alike(cut, apart[0], y - 0.5 * across[0], y + 0.5 * across[1])
            faces = _alike(cut, apart[1], *pairs(y_nodes))
        return cls(grid, grid.nodes_and_faces(0), (y_nodes, y_faces), grid.steps(0), y, across, lines, faces)

    def along(self, film: Around, rows: Rows, cut: Sequence[Any]) -> tuple[Array, Array, Array]:
        """C and H of the x faces of some lines, and the film at the points before them (`strip.coefficients_of`)."""
        (nodes, faces), grid, y = self.x_places, self.grid, self.y[rows]
        shape = y.size, faces.size
        before = np.broadcast_to(film(nodes[None, :-1], y[:, None]), shape)
        if cut[0] or cut[1]:
            period = grid.lengths[0] if grid.periodic[0] else 0.0
            return *face_film(film, pairs(nodes), faces, y, cut[0], cut[1], self.across[:, rows], period), before
        h = np.broadcast_to(film(faces[None, :], y[:, None]), shape)
        return h * h * h, h, before

    def over(self, film: Around, rows: Rows, cut: Sequence[Any]) -> Array:
        """C of some lines of y faces."""
        x, grid = self.x_places[0][1:-1], self.grid
        nodes, faces = pairs(self.y_places[0])[:, rows], self.y_places[1][rows]
        if cut[0] or cut[1]:
            period = grid.lengths[1] if grid.periodic[1] else 0.0
            turned = face_film(lambda t, s: film(s, t), nodes, faces, x, cut[1], cut[0], pairs(self.steps), period)
            return turned[0].T
        h = np.broadcast_to(film(x[None, :], faces[:, None]), (faces.size, x.size))
        return np.asarray(h * h * h)

    def sheared(self, film: Around, rows: Rows, liquid: Array, layers: Array | None = None) -> tuple[Array, Array, Array]:
        """The film of the x faces of some lines, and what shears them per mu U, a + liquid/b: a and b (`flows.linear`).

        liquid : of each face; lines that are alike have one pair, whatever it is. layers : `flows.layers` to hold."""
        places, steps = self.grid.x[0], self.steps
        x = np.append(places[0] - steps[0] / 2, places + steps[1:] / 2)[None]
        x = x % self.grid.lengths[0] if self.grid.periodic[0] else x  # of a seam the side that `model.film` has
        h, *lengths = sheared_lines(film, x, self.y[rows][:, None], self.across[:, rows])
        return h, *linear(np.where, liquid, *held(layers, *lengths))


def _alike(jumps: Sequence[float], apart: Rows, low: Array, high: Array) -> Rows:
    """The first of each run of intervals with no jump in or between them, and none that is `apart`."""
    places, slack = np.unique(np.asarray(jumps, dtype=float)), NEAR * np.abs(high - low)
    below = np.searchsorted(places, low - slack)
    alone = (np.searchsorted(places, high + slack) > below) | (high <= low)
    alone[apart] = True
    new = np.append(True, alone[1:] | alone[:-1] | (below[1:] != below[:-1]))
    return np.flatnonzero(new)


def runs(first: Rows, start: int, stop: int) -> tuple[Rows, Rows]:
    """Of the lines from start to stop - 1 those that stand for all, and which of these each one is like."""
    some = np.union1d([start], first[(first > start) & (first < stop)])
    return some, np.searchsorted(some, np.arange(start, stop), side="right") - 1


def line_factors(grid: Grid) -> tuple[Array, Array, Array]:
    """What conductances at mu = 1 have of the lines, and of the faces between them; and what the wall drags at U = 1."""
    faces = grid.spacing[0] * grid.stretch(grid.nodes_and_faces(1)[1]) / (6.0 * grid.steps(1) * grid.spacing[1])
    return (line_weights(grid) / grid.stretch(grid.y) / 6.0)[:, 0], faces, stream_weights(grid)[:, 0]
