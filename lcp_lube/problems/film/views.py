"""Films seen otherwise: mirrored, moved along, with something added. Edges, rims and kinks are seen with them."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...base.parallel import Array
from ..grid import Grid
from .edges import corners_of, jumps_of, kinks_of, level, marks_of


@dataclass(frozen=True)
class View:
    """h(own(x), y) of a film h(x, y); `back` is the inverse of `own`."""

    film: Any

    def own(self, x: Array) -> Array:
        """The film's own x."""
        return x

    def back(self, x: Any) -> Any:
        """Where its x, a number or an array of them, is seen."""
        return x

    def __call__(self, x: ArrayLike, y: ArrayLike | None = None, /) -> Array:
        """h (m) at x and y (m)."""
        return np.asarray(self.film(self.own(np.asarray(x, dtype=float)), np.asarray(0.0 if y is None else y, dtype=float)))

    def jumps(self, axis: str) -> tuple[float, ...]:
        """x or y (m) of the straight lines across which it jumps."""
        found = jumps_of(self.film, axis)
        return tuple(sorted(map(self.back, found))) if axis == "x" else found

    def kinks(self, axis: str) -> tuple[float, ...]:
        """x or y (m) of the straight lines across which its slope jumps."""
        found = kinks_of(self.film, axis)
        return tuple(sorted(map(self.back, found))) if axis == "x" else found

    @property
    def corners(self) -> Array:
        """Of its rectangles, as `edges.corners_of` has them."""
        found = np.array(corners_of(self.film))
        found[:, 0] = self.back(found[:, 0])
        return found

    @property
    def rims(self) -> tuple[Any, ...]:
        """Distances (m) from its curved edges, as functions of x and y."""
        return tuple(replace(self, film=rim) for rim in getattr(self.film, "rims", ()))

    def marks(self) -> tuple[float, ...]:
        """x (m) where it, or a part of it, jumps or has a kink, as far as it tells."""
        return tuple(sorted(map(self.back, marks_of(self.film))))

    def breakpoints(self) -> tuple[float, ...]:
        """x (m) of all jumps, kinks and extrema."""
        return tuple(sorted(map(self.back, self.film.breakpoints())))


@dataclass(frozen=True)
class MirroredFilm(View):
    """h(L - x, y) of a film over [0, L]."""

    L: float

    @property
    def level(self) -> bool:
        return level(self.film)

    def own(self, x: Array) -> Array:
        turned = self.L - x
        # The wall lies at 0, not beyond it by the last bit of L: sqrt(x) is a film.
        return np.where((turned < 0) & (turned > -1e-12 * self.L), 0.0, turned)

    @property
    def corners(self) -> Array:
        return super().corners * np.array([1.0, 1.0, -1.0, 1.0])

    def back(self, x: Any) -> Any:
        return self.L - x


@dataclass(frozen=True)
class Travelling(View):
    """A film that the wall has carried along x by `travel`; it goes on periodically over L."""

    travel: float
    L: float

    @property
    def corners(self) -> Array:
        """None that grids could follow: faces would change in steps whenever a corner passes a point."""
        return np.zeros((0, 4))

    def own(self, x: Array) -> Array:
        return (x - self.travel) % self.L

    def back(self, x: Any) -> Any:
        return (x + self.travel) % self.L


@dataclass(frozen=True)
class FromHere(View):
    """A film round a ring of this length, x counted from `start` on."""

    start: float
    period: float

    def own(self, x: Array) -> Array:
        return x + self.start

    def back(self, x: Any) -> Any:
        return (x - self.start) % self.period


@dataclass(frozen=True)
class Inside(View):
    """A film that goes on periodically, or keeps its value, beyond [0, length] of either axis."""

    lengths: tuple[float, ...]
    periodic: tuple[bool, ...]

    def __call__(self, x: ArrayLike, y: ArrayLike | None = None, /) -> Array:
        places = [np.asarray(a, dtype=float) for a in (x, 0.0 if y is None else y)]
        for side, (length, periodic) in enumerate(zip(self.lengths, self.periodic, strict=True)):
            places[side] = places[side] % length if periodic else np.clip(places[side], 0.0, length)
        return np.asarray(self.film(*places))


@dataclass(frozen=True)
class Raised(View):
    """A film with a number added, a complex one for derivatives."""

    by: complex

    def __call__(self, x: ArrayLike, y: ArrayLike | None = None, /) -> Array:
        return super().__call__(x, y) + self.by  # type: ignore[return-value]


@dataclass(frozen=True)
class Scaled:
    """A function of x, y in metres and t in seconds, in other units than metres: a formula."""

    function: Callable[[Array, Array, float], Array]
    unit: float
    t: float = 0.0

    def __call__(self, x: Array, y: Array) -> Array:
        return self.unit * self.function(x, y, self.t)


@dataclass(frozen=True)
class LiftedFilm(View):
    """h(x, y) + lift, the lift bilinear between this rank's points and those beside them, constant beyond.

    x, y : coordinates of the points with their neighbours, m. lift : there, shape (y.size, x.size), m.
    """

    x: Array
    y: Array
    lift: Array

    @property
    def rims(self) -> tuple[Any, ...]:
        return tuple(getattr(self.film, "rims", ()))

    @classmethod
    def of(cls, film: Any, grid: Grid, lift: Array) -> "LiftedFilm":
        """From the lift at the owned points. Collective."""
        framed = grid.ghosted(lift)
        framed[[0, 0, -1, -1], [0, -1, 0, -1]] = np.nan
        for beyond, inside in ((0, 1), (-1, -2)):
            framed[beyond] = np.where(np.isnan(framed[beyond]), framed[inside], framed[beyond])
            framed[:, beyond] = np.where(np.isnan(framed[:, beyond]), framed[:, inside], framed[:, beyond])
        x = grid.with_neighbours(0)[grid.x_start : grid.x_end + 2]
        y = grid.with_neighbours(1)[grid.y_start : grid.y_end + 2] if grid.dim == 2 else np.array([-1.0, 0.0, 1.0])
        return cls(film, x, y, framed)

    def __call__(self, x: ArrayLike, y: ArrayLike | None = None, /) -> Array:
        x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(0.0 if y is None else y, dtype=float))
        i, a = _place(self.x, x)
        j, b = _place(self.y, y)
        f = self.lift
        lift = (1 - b) * ((1 - a) * f[j, i] + a * f[j, i + 1]) + b * ((1 - a) * f[j + 1, i] + a * f[j + 1, i + 1])
        return self.film(x, y) + lift


def _place(lines: Array, at: Array) -> tuple[Any, Array]:
    """Which interval of the lines, and how far into it, from 0 to 1."""
    k = np.clip(np.searchsorted(lines, at) - 1, 0, lines.size - 2)
    return k, np.clip((at - lines[k]) / (lines[k + 1] - lines[k]), 0.0, 1.0)
