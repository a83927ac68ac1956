"""Named parts of a film, each h(x, y) in metres, to be added up: what a scene file's [[film]] tables become."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...base.parallel import Array
from .edges import corners_of, level, marks_of, rectangles

Shape = Callable[[Array, Array], Array]
EDGE = 1e-12  # relative: a point so near an edge is on it, whatever its coordinate's rounding; edges belong to the recess
MEAN_SQUARE = 151 / 315  # integral of the squared cubic B-spline: variance of a spline through random numbers, along a line


@dataclass(frozen=True)
class Along:
    """A course along one axis between start and end; beyond them it keeps its end values.

    With s from 0 to 1 between start and end: linear, h_start + (h_end - h_start) s; parabola, h_min at the middle and h_max at
    the ends; sinusoid, h_max at s = 0 and so many full waves. h_0, h_1 are the values of linear, else h_min and h_max, or these
    two exchanged. The films of problems 1 to 4 of Mezzadri and Galligani (2018) are such.
    """

    course: str
    h_0: float
    h_1: float
    start: float
    end: float
    axis: str = "x"
    waves: float = 1.0

    def __call__(self, x: Array, y: Array) -> Array:
        s = np.clip(((x if self.axis == "x" else y) - self.start) / (self.end - self.start), 0.0, 1.0)
        if self.course == "linear":
            return self.h_0 + (self.h_1 - self.h_0) * s
        # From the thinnest film up, by squares and products: K + a cos(2 pi s) and 1 - s^2 lose digits next to it.
        down = self.h_0 > self.h_1
        if self.course == "parabola":
            rise = 4.0 * s * (1.0 - s) if down else (2.0 * s - 1.0) ** 2
        else:
            rise = (np.sin if down else np.cos)(np.pi * self.waves * s) ** 2
        return min(self.h_0, self.h_1) + abs(self.h_1 - self.h_0) * rise

    def breakpoints(self) -> tuple[float, ...]:
        """The x of its kinks and extrema, m."""
        if self.axis != "x":
            return ()
        extrema = {"linear": 1.0, "parabola": 2.0, "sinusoid": 2.0 * self.waves}[self.course]
        parts = np.append(np.arange(np.ceil(extrema)) / extrema, 1.0)
        return tuple(self.start + (self.end - self.start) * parts)

    def kinks(self, axis: str) -> tuple[float, ...]:
        """x or y (m) of the lines at which it ends."""
        return (self.start, self.end) if axis == self.axis else ()

    @property
    def level(self) -> bool:
        """Whether it is the same along y from jump to jump, as all `level`s tell."""
        return self.axis == "x"


@dataclass(frozen=True)
class Block:
    """height within a rectangle, 0 outside; an infinite side leaves that direction open. A step, a pocket, a groove."""

    height: float
    x: tuple[float, float]
    y: tuple[float, float]

    level: ClassVar[bool] = True

    def __call__(self, x: Array, y: Array) -> Array:
        return np.where(within(x, *self.x) & within(y, *self.y), self.height, 0.0)

    def breakpoints(self) -> tuple[float, ...]:
        return tuple(x for x in self.x if np.isfinite(x))

    def jumps(self, axis: str) -> tuple[float, ...]:
        return tuple(t for t in (self.x if axis == "x" else self.y) if np.isfinite(t))

    @cached_property
    def corners(self) -> Array:
        """As `edges.corners_of` has them."""
        return rectangles(self.x, self.y) if np.isfinite([*self.x, *self.y]).all() and self.height else np.zeros((0, 4))


@dataclass(frozen=True)
class DimpleArray:
    """columns x rows of equal recesses, one in the middle of each cell of the rectangle x, y.

    form : 'square' of side `size`, 'round' of diameter `size`, both with a flat bottom, or 'dome', a round one whose depth
    falls off as a parabola. One row of infinite width in 1D: grooves across.
    """

    form: str
    depth: float
    size: float
    columns: int
    rows: int
    x: tuple[float, float]
    y: tuple[float, float]

    def __call__(self, x: Array, y: Array) -> Array:
        across = _distance(x, *self.x, self.columns)
        along = _distance(y, *self.y, self.rows) if np.isfinite(self.y).all() else 0.0 * y
        half = 0.5 * self.size * (1.0 + EDGE)
        if self.form == "square":
            return np.where((across <= half) & (along <= half), self.depth, 0.0)
        part = across**2 + along**2
        return np.where(part <= half**2, self.depth * (1.0 - part / half**2 if self.form == "dome" else 1.0), 0.0)

    def breakpoints(self) -> tuple[float, ...]:
        start, end = self.x
        centres = start + (end - start) * (np.arange(self.columns) + 0.5) / self.columns
        return tuple(np.concatenate([centres + k * self.size for k in (-0.5, 0.0, 0.5)]))

    @property
    def oblique(self) -> bool:
        """Whether edges run across the lines of points (`edges.oblique`)."""
        return self.form == "round"

    def rim(self, x: Array, y: Array) -> Array:
        """Distance (m) from the rim of the nearest round recess, negative inside it."""
        across, along = _distance(x, *self.x, self.columns), _distance(y, *self.y, self.rows)
        return np.hypot(across, along) - 0.5 * self.size

    def jumps(self, axis: str) -> tuple[float, ...]:
        (start, end), count = (self.x, self.columns) if axis == "x" else (self.y, self.rows)
        if self.form != "square" or not np.isfinite([start, end]).all():
            return ()  # the edge of a round one is nowhere a line
        centres = start + (end - start) * (np.arange(count) + 0.5) / count
        return tuple(np.concatenate([centres - 0.5 * self.size, centres + 0.5 * self.size]))

    @cached_property
    def corners(self) -> Array:
        """As `edges.corners_of` has them."""
        x, y = (np.reshape(self.jumps(axis), (2, -1)) for axis in "xy")
        return rectangles(x[:, :, None], y[:, None, :]) if x.size and y.size and self.depth else np.zeros((0, 4))

    @property
    def level(self) -> bool:
        return self.form == "square" or not np.isfinite(self.y).all()


@dataclass(frozen=True)
class Journal:
    """c (1 + eccentricity cos(2 pi (x - widest)/L)): the gap of a journal, unwrapped."""

    c: float
    eccentricity: float
    L: float
    widest: float = 0.0

    level: ClassVar[bool] = True

    def __call__(self, x: Array, y: Array) -> Array:
        half = np.cos(np.pi * (x - self.widest) / self.L)  # keeps its digits next to h_min
        return self.c * ((1.0 - self.eccentricity) + 2.0 * self.eccentricity * half**2) + 0.0 * y

    def breakpoints(self) -> tuple[float, ...]:
        return tuple((self.widest + 0.5 * k * self.L) % self.L for k in (0, 1))


@dataclass(frozen=True)
class RandomSurface:
    """Cubic B-spline through normal numbers on a lattice of `cells` meshes a side: the same surface on every grid.

    sigma : standard deviation of the surface, m, in the mean over places and seeds.
    """

    sigma: float
    seed: int
    cells: int
    lengths: tuple[float, float]

    @cached_property
    def _lattice(self) -> Array:
        return np.random.default_rng(self.seed).standard_normal((self.cells + 4, self.cells + 4))

    def __call__(self, x: Array, y: Array) -> Array:
        x, y = np.broadcast_arrays(x, y)
        from scipy.ndimage import map_coordinates  # here: few films need it, and scipy takes a while

        at = [1.5 + y * (self.cells / self.lengths[1]), 1.5 + x * (self.cells / self.lengths[0])]
        return self.sigma / MEAN_SQUARE * map_coordinates(self._lattice, at, order=3, prefilter=False, mode="nearest")


@dataclass(frozen=True)
class Sum:
    """The film: parts added up, and cut from below at `floor` where that is given."""

    parts: Sequence[Shape]
    floor: float | None = None

    def __call__(self, x: ArrayLike, y: ArrayLike | None = None, /) -> Array:
        """h (m) at x and y (m), with the broadcast shape of both."""
        x_, y_ = (np.asarray(a, dtype=float) for a in (x, 0.0 if y is None else y))
        h, whole = sum((part(x_, y_) for part in self.parts[1:]), self.parts[0](x_, y_)), np.broadcast(x_, y_).shape
        h = h if self.floor is None else np.maximum(h, self.floor)
        return h if h.shape == whole and len(self.parts) > 1 else h + np.zeros(whole)  # a new array

    @property
    def smooth_between(self) -> bool:
        """Whether the film's jumps and kinks are known, which an exact solution needs."""
        return self.floor is None and all(hasattr(part, "breakpoints") for part in self.parts)

    @property
    def level(self) -> bool:
        return all(map(level, self.parts))

    @cached_property
    def corners(self) -> Array:
        """As `edges.corners_of` has them; what is cut off is not looked for."""
        return np.concatenate([corners_of(part) for part in self.parts])

    @property
    def rims(self) -> tuple[Shape, ...]:
        """Distances (m) from its edges that are curved or slanted."""
        return rims_of(self.parts)

    def marks(self) -> tuple[float, ...]:
        return tuple(t for part in self.parts for t in marks_of(part))

    def breakpoints(self) -> tuple[float, ...]:
        """x (m) of all jumps, kinks and extrema at y = 0; those extrema that no part has by itself are searched for."""
        known = sorted({float(x) for part in self.parts for x in part.breakpoints()})  # type: ignore[attr-defined]
        if len(self.parts) == 1:
            return tuple(known)
        found = [x for a, b in pairwise(known) if b - a > 1e-9 * (known[-1] - known[0]) for x in self._extrema(a, b)]
        return tuple(sorted([*known, *found]))

    def _extrema(self, a: float, b: float, points: int = 201) -> list[float]:
        """Inner extrema between neighbouring breakpoints, to some 1e-8 of their distance."""
        x = a + (b - a) * (np.arange(points) + 0.5) / points
        rise = np.sign(np.round(np.diff(self(x)) / np.max(np.abs(self(x))), 13))
        turns = np.flatnonzero(rise[:-1] * rise[1:] < 0) + 1
        out = []
        for low, high in zip(x[turns - 1], x[turns + 1], strict=True):
            for _ in range(40):  # sections: the three points around the extremum closer and closer
                t = np.linspace(low, high, 5)
                h = self(t)
                k = 1 + int(np.argmax(np.abs(h[1:-1] - 0.5 * (h[0] + h[-1]))))
                low, high = t[k - 1], t[k + 1]
            out.append(0.5 * (low + high))
        return out


def rims_of(parts: Sequence[Shape]) -> tuple[Shape, ...]:
    """Distances (m) from edges of parts that are curved or slanted, as functions of x and y; negative inside."""
    found = (part for part in parts if isinstance(part, DimpleArray) and part.form != "square")
    slanted = (part.slanted for part in parts if hasattr(part, "slanted"))
    return *(part.rim for part in found if np.isfinite(part.y).all()), *slanted


def within(t: Array, start: float, end: float) -> NDArray[np.bool_] | np.bool_:
    if start == -np.inf and end == np.inf:
        return np.True_
    slack = EDGE * max(abs(v) for v in (start, end, 0.0) if np.isfinite(v))
    return (t >= start - slack) & (t <= end + slack)


def _distance(t: Array, start: float, end: float, count: int) -> Array:
    """Distance to the nearest of `count` centres, one in the middle of each equal part of [start, end]."""
    pitch = (end - start) / count
    nearest = np.clip(np.floor((t - start) / pitch), 0, count - 1)
    return np.abs(t - (start + (nearest + 0.5) * pitch))
