"""Gap shapes: the film thickness h(x, y), NumPy in and out, metres."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...errors import InputError
from .edges import marks_of

Array = NDArray[np.float64]


class Film(Protocol):
    """What the discretisation and the exact solution ask of a film."""

    def __call__(self, x: ArrayLike, y: ArrayLike | None = None, /) -> Array:
        """Return h (m) at x and y (m), with the broadcast shape of both."""

    def breakpoints(self) -> tuple[float, ...]:
        """Return the x (m) of all jumps, kinks and extrema: in between, h is smooth and monotone."""


# The film of one wave, 0 = h_min and 1 = h_max, over s in [0, 1]. Squares and products, not K + a cos(2 pi s) and
# 1 - f(s): next to h_min those lose as many digits as h_max/h_min has.
_UNIT: dict[tuple[str, str], Callable[[Array], Array]] = {
    ("sinusoid", "convergent-divergent"): lambda s: np.cos(np.pi * s) ** 2,
    ("sinusoid", "divergent-convergent"): lambda s: np.sin(np.pi * s) ** 2,
    ("parabola", "convergent-divergent"): lambda s: (2 * s - 1) ** 2,
    ("parabola", "divergent-convergent"): lambda s: 4 * s * (1 - s),
}
SHAPES = ("sinusoid", "parabola")
FORMS = ("convergent-divergent", "divergent-convergent")


@dataclass(frozen=True)
class Wave:
    """One full wave between x = start and x = start + length; beyond it the film keeps its wave-end value.

    With s = (x - start)/length, the convergent-divergent film is ::

        sinusoid:  h = K + a cos(2 pi s),  K = (h_max + h_min)/2,  a = (h_max - h_min)/2
        parabola:  h = h_min + (h_max - h_min) (2 s - 1)^2

    and the divergent-convergent one is the same upside down, h_min + h_max - h. These are the films of problems 1 to 4
    of Mezzadri and Galligani (2018); problem 4 has start = 3L/8 and length = L/4.

    Parameters
    ----------
    shape : 'sinusoid' or 'parabola'
    form : 'convergent-divergent' or 'divergent-convergent'
    h_min, h_max : float
        Least and greatest film thickness (m), 0 < h_min <= h_max.
    start, length : float
        Beginning and length of the wave (m), length > 0.

    Raises
    ------
    InputError
        If one of them is not as said.
    """

    shape: str
    form: str
    h_min: float
    h_max: float
    start: float
    length: float

    def __post_init__(self) -> None:
        if self.shape not in SHAPES:
            raise InputError(f"shape = {self.shape!r}: must be one of {', '.join(SHAPES)}")
        if self.form not in FORMS:
            raise InputError(f"form = {self.form!r}: must be one of {', '.join(FORMS)}")
        if not 0 < self.h_min < math.inf:
            raise InputError(f"h_min = {self.h_min}: must be positive and finite (m)")
        if not self.h_min <= self.h_max < math.inf:
            raise InputError(f"h_max = {self.h_max}: must be finite and at least h_min = {self.h_min} (m)")
        if not math.isfinite(self.start):
            raise InputError(f"start = {self.start}: must be finite (m)")
        if not 0 < self.length < math.inf:
            raise InputError(f"length = {self.length}: must be positive and finite (m)")

    def __call__(self, x: ArrayLike, y: ArrayLike | None = None, /) -> Array:
        """Return h (m) at x and y (m), with the broadcast shape of both; the film does not depend on y."""
        s = np.clip((np.asarray(x, dtype=float) - self.start) / self.length, 0, 1)
        h = np.asarray(self.h_min + (self.h_max - self.h_min) * _UNIT[self.shape, self.form](s))
        return h if y is None or np.shape(y) == h.shape else np.broadcast_arrays(h, np.asarray(y))[0].copy()

    def breakpoints(self) -> tuple[float, ...]:
        """Return the two ends (kinks) and the middle (extremum) of the wave, x in m."""
        return (self.start, self.start + self.length / 2, self.start + self.length)


@dataclass(frozen=True)
class JournalGap:
    """h = c (1 + eccentricity cos phi), phi = 2 pi x/L: a journal's gap, unwrapped from its widest place.

    Parameters
    ----------
    c : radial clearance (m). eccentricity : 0 <= eccentricity < 1. L : circumference (m).
    """

    c: float
    eccentricity: float
    L: float

    def __call__(self, x: ArrayLike, y: ArrayLike | None = None, /) -> Array:
        """Return h (m) at x and y (m), with the broadcast shape of both; the film does not depend on y."""
        # 1 + e cos phi = (1 - e) + 2 e cos^2(phi/2) keeps its digits next to h_min.
        half = np.cos(np.pi * np.asarray(x, dtype=float) / self.L)
        h = self.c * ((1.0 - self.eccentricity) + 2.0 * self.eccentricity * half**2)
        return h if y is None or np.shape(y) == h.shape else np.broadcast_arrays(h, np.asarray(y))[0].copy()

    def breakpoints(self) -> tuple[float, ...]:
        """Return the two ends and the narrowest place, x in m."""
        return (0.0, 0.5 * self.L, self.L)


@dataclass(frozen=True)
class Raised:
    """A film with its level changed: `offset` (m) is added everywhere."""

    film: Film
    offset: float

    def __call__(self, x: ArrayLike, y: ArrayLike | None = None, /) -> Array:
        """Return h (m) at x and y (m), with the broadcast shape of both."""
        return self.film(x, y) + self.offset

    def marks(self) -> tuple[float, ...]:
        """Return those of the film."""
        return marks_of(self.film)

    def breakpoints(self) -> tuple[float, ...]:
        """Return those of the film."""
        return self.film.breakpoints()
