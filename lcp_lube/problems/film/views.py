"""Films seen otherwise: mirrored, moved along, with something added. Edges, rims and kinks are seen with them."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...base.parallel import Array
from .edges import jumps_of, marks_of


@dataclass(frozen=True)
class View:
    """h(own(x), y) of a film h(x, y); `back` is the inverse of `own`."""

    film: Any

    def own(self, x: Array) -> Array:
        """The film's own x."""
        return x

    def back(self, x: float) -> float:
        """Where its x is seen."""
        return x

    def __call__(self, x: ArrayLike, y: ArrayLike | None = None, /) -> Array:
        """h (m) at x and y (m)."""
        return np.asarray(self.film(self.own(np.asarray(x, dtype=float)), np.asarray(0.0 if y is None else y, dtype=float)))

    def jumps(self, axis: str) -> tuple[float, ...]:
        """x or y (m) of the straight lines across which it jumps."""
        found = jumps_of(self.film, axis)
        return tuple(sorted(map(self.back, found))) if axis == "x" else found

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

    def own(self, x: Array) -> Array:
        turned = self.L - x
        # The wall lies at 0, not beyond it by the last bit of L: sqrt(x) is a film.
        return np.where((turned < 0) & (turned > -1e-12 * self.L), 0.0, turned)

    def back(self, x: float) -> float:
        return self.L - x


@dataclass(frozen=True)
class Travelling(View):
    """A film that the wall has carried along x by `travel`; it goes on periodically over L."""

    travel: float
    L: float

    def own(self, x: Array) -> Array:
        return (x - self.travel) % self.L

    def back(self, x: float) -> float:
        return (x + self.travel) % self.L


@dataclass(frozen=True)
class FromHere(View):
    """A film round a ring of this length, x counted from `start` on."""

    start: float
    period: float

    def own(self, x: Array) -> Array:
        return x + self.start

    def back(self, x: float) -> float:
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
