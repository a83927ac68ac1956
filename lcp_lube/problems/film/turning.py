"""A journal that turns in its bush: where its film lies around it.

Angles theta are counted from the line of the load, in the sense of rotation; axes are x along the load and y a quarter of a
turn ahead. An eccentricity (ex, ey) makes the film h = c - ex cos(theta) - ey sin(theta).
"""

import math
from dataclasses import dataclass
from typing import Any

from ...base.parallel import Array


@dataclass(frozen=True)
class Shaft:
    """What a film is wrapped round, y along the axis. R : radius, m; start : theta at x = 0, rad.

    widest : theta of the widest gap that the shaft's eccentricity makes, rad; None for a concentric one.
    """

    R: float
    start: float = 0.0
    widest: float | None = None

    def theta(self, x: Array) -> Array:
        """Angle of the places x (m) of the unwrapped film."""
        return self.start + x / self.R


@dataclass(frozen=True, kw_only=True)
class Turning(Shaft):
    """A journal. c : clearance, m; B : width, m (1D: 1); omega : rad/s."""

    c: float
    B: float
    omega: float

    @property
    def length(self) -> float:
        """Of the unwrapped film, m."""
        return 2.0 * math.pi * self.R

    def numbers(self, load: float, mu: float, eccentricity: float) -> dict[str, Any]:
        """What a bearing's sheet lists: Sommerfeld numbers. eccentricity : relative."""
        D = 2.0 * self.R
        psi = self.c / self.R
        N = self.omega / (2.0 * math.pi)
        return {
            "eccentricity": eccentricity,
            "sommerfeld": load * psi**2 / (self.B * D * mu * self.omega),
            "S": mu * N * self.B * D / (load * psi**2) if load > 0 else None,
        }


def ahead(problem: Any, other: Any) -> float:
    """How far the place where this ring's x is 0 lies beyond the other's, m; 0 of films that are no rings round a shaft.

    Each has a point on the same edge, half a mesh of its own behind x = 0 (`scenes.shaft`): rings of two sizes differ by that.
    """
    own, its = (getattr(one, "shaft", None) for one in (problem, other))
    return 0.0 if own is None or its is None or not problem.grid.periodic[0] else (own.start - its.start) * own.R
