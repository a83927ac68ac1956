"""Work on a few lines of a grid at a time: temporary arrays then fit the cache, and take no memory."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.crew import FEWEST, crew
from .grid import Grid, Places, Polar

STRIP, LARGEST = 16_384, 262_144  # points: of the strips of a small grid; and of a large one, which has PARTS at least
PARTS = 8  # as many for each of two threads or four; each costs Python some 1 ms in a whole run
# Points of a grid from which compiled loops over its strips are worth being loaded; and where others are loaded for it anyway.
MANY, LOADED = 250_000, 2_000


def in_strips(grid: Grid) -> Iterator[slice]:
    """This rank's lines, a strip at a time."""
    ny, nx = grid.box
    lines = max(1, max(STRIP, min(LARGEST, nx * ny // PARTS)) // nx)
    return (slice(j, min(j + lines, ny)) for j in range(0, ny, lines))


def each_strip(grid: Grid, task: Callable[[slice], Any]) -> list[Any]:
    """What a task returns for each of them, in their order; several threads work on a large grid's."""
    strips = list(in_strips(grid))
    if grid.local_size < FEWEST:
        return [task(rows) for rows in strips]
    return crew().run(lambda k: task(strips[k]), len(strips))


def places_of(grid: Grid, rows: slice) -> Grid:
    """A strip as a grid that knows its points' places and sides; no ghosts, and no matrix."""
    part = object.__new__(Grid)
    part.__dict__ |= grid.__dict__
    part.y_start, part.y_end = grid.y_start + rows.start, grid.y_start + rows.stop
    part._owned, part.box = [grid._owned[0], (part.y_start, part.y_end)], (rows.stop - rows.start, grid.box[1])
    return part


def moved(grid: Grid, lengths: Sequence[float], places: Places, polar: Polar | None) -> Grid:
    """A grid's points, on their ranks, elsewhere, as `places_of` has some of them."""
    other = places_of(grid, slice(0, grid.box[0]))
    other.lengths, other.places, other.polar = tuple(map(float, lengths)), places, polar
    other.spacing = tuple(length / meshes for length, meshes in zip(other.lengths, grid.meshes, strict=True))
    other._around = tuple(other._with_neighbours(side) for side in range(grid.dim))
    return other


def ghosted(grid: Grid, owned: NDArray, outside: float) -> Callable[[slice], NDArray]:
    """`Grid.ghosted` strip by strip: of one rank, without an array of them all. Collective."""
    if grid.comm.size > 1 or grid.dim == 1:
        whole = grid.ghosted(owned, outside)
        return lambda rows: whole[rows.start : rows.stop + 2]
    (ny, _), a = grid.box, owned.reshape(grid.box)

    def framed(rows: slice) -> NDArray:
        first, last = rows.start - 1, rows.stop
        out = np.empty((last - first + 1, a.shape[1] + 2), dtype=a.dtype)
        out[1:-1, 1:-1] = a[rows]
        out[:, 0], out[:, -1] = (out[:, -2], out[:, 1]) if grid.periodic[0] else (outside, outside)
        for line, row in ((first, out[0]), (last, out[-1])):
            row[1:-1] = a[line % ny] if 0 <= line < ny or grid.periodic[1] else outside
        return out

    return framed


class Scaled:
    """An array times a positive number, of which parts are made when they are asked for."""

    def __init__(self, a: NDArray, by: float):
        self.a, self.by, self.shape = a, by, a.shape

    def __getitem__(self, part: Any) -> Any:
        return self.a[part] * self.by

    def reshape(self, shape: tuple[int, ...]) -> "Scaled":
        return Scaled(self.a.reshape(shape), self.by)

    def ravel(self) -> NDArray:
        return np.asarray(self[:].ravel())


def apart(a: Any) -> tuple[NDArray, float]:
    """An array and by what it is multiplied."""
    return (a.a, a.by) if isinstance(a, Scaled) else (a, 1.0)
