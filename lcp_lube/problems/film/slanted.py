"""Grooves along spirals, a part of a film as those of `shapes`; their edges run across the lines of points."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ...base.parallel import Array
from .shapes import EDGE, within


@dataclass(frozen=True)
class Slanted:
    """Distance (m) from the slanted edges of grooves, negative inside them, as a function of x and y."""

    grooves: "SpiralGrooves"

    @property
    def depth(self) -> float:
        return self.grooves.depth

    def __call__(self, x: Array, y: Array) -> Array:
        phase, period, there = self.grooves.laid(x, y)
        inside, outside = np.maximum(-phase, phase - self.grooves.ratio), np.minimum(phase - self.grooves.ratio, 1.0 - phase)
        return np.where(there, np.where(phase < self.grooves.ratio, inside, outside) * period, np.inf)


@dataclass(frozen=True)
class SpiralGrooves:
    """`count` logarithmic spirals on a full turn, of a depth, between two radii; inclined by `angle` (rad) against the motion.

    They pump inwards, and outwards where the angle is negative. polar : radius at y = 0 (there a groove begins at x = 0), and
    that on which x is measured, m.
    """

    depth: float
    count: int
    angle: float
    ratio: float
    between: tuple[float, float]
    polar: tuple[float, float]

    oblique: ClassVar[bool] = True

    def __call__(self, x: Array, y: Array) -> Array:
        phase, _, there = self.laid(x, y)
        return np.where((phase < self.ratio) & there, self.depth, 0.0)

    @property
    def slanted(self) -> Slanted:
        """Distance from its spirals, m."""
        return Slanted(self)

    def laid(self, x: Array, y: Array) -> tuple[Array, Any, Any]:
        """How far on from an edge that opens a groove to the next one, from 0 to 1; their distance, m; where grooves are."""
        theta, r = x / self.polar[1], self.polar[0] + y
        turns = (theta + np.log(r / self.polar[0]) / np.tan(self.angle)) / (2.0 * np.pi)
        phase = np.remainder((turns + EDGE) * self.count, 1.0)
        return phase, 2.0 * np.pi / self.count * abs(np.sin(self.angle)) * r, within(r, *self.between)

    def jumps(self, axis: str) -> tuple[float, ...]:
        return tuple(r - self.polar[0] for r in self.between) if axis == "y" else ()
