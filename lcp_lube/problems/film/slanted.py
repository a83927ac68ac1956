"""Grooves whose edges run across the lines of points, spirals and herringbones: parts of a film as those of `shapes`."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ...base.parallel import Array
from .shapes import EDGE, within


@dataclass(frozen=True)
class Slanted:
    """Distance (m) from the slanted edges of grooves, negative inside them, as a function of x and y."""

    grooves: "Grooves"

    @property
    def depth(self) -> float:
        return self.grooves.depth

    def __call__(self, x: Array, y: Array) -> Array:
        phase, period, there = self.grooves.laid(x, y)
        inside, outside = np.maximum(-phase, phase - self.grooves.ratio), np.minimum(phase - self.grooves.ratio, 1.0 - phase)
        return np.where(there, np.where(phase < self.grooves.ratio, inside, outside) * period, np.inf)


@dataclass(frozen=True)
class Grooves:
    """`count` grooves of a depth, inclined by `angle` (rad) against the motion.

    ratio : width of a groove over groove and land.
    """

    depth: float
    count: int
    angle: float
    ratio: float

    oblique: ClassVar[bool] = True

    def __call__(self, x: Array, y: Array) -> Array:
        phase, _, there = self.laid(x, y)
        return np.where((phase < self.ratio) & there, self.depth, 0.0)

    @property
    def slanted(self) -> Slanted:
        """Distance from its slanted edges, m."""
        return Slanted(self)

    def laid(self, x: Array, y: Array) -> tuple[Array, Any, Any]:
        """How far on from an edge that opens a groove to the next one, from 0 to 1; their distance, m; where grooves are."""
        raise NotImplementedError


@dataclass(frozen=True)
class SpiralGrooves(Grooves):
    """Logarithmic spirals on a full turn, between two radii; they pump inwards, and outwards where the angle is negative.

    polar : radius at y = 0 (there a groove begins at x = 0), and that on which x is measured, m.
    """

    between: tuple[float, float]
    polar: tuple[float, float]

    def laid(self, x: Array, y: Array) -> tuple[Array, Any, Any]:
        theta, r = x / self.polar[1], self.polar[0] + y
        turns = (theta + np.log(r / self.polar[0]) / np.tan(self.angle)) / (2.0 * np.pi)
        phase = np.remainder((turns + EDGE) * self.count, 1.0)
        return phase, 2.0 * np.pi / self.count * abs(np.sin(self.angle)) * r, within(r, *self.between)

    def jumps(self, axis: str) -> tuple[float, ...]:
        return tuple(r - self.polar[0] for r in self.between) if axis == "y" else ()


@dataclass(frozen=True)
class Herringbone(Grooves):
    """Grooves that meet in the middle of the width.

    land : share of the width in the middle that has none. The grooves pump towards the middle where the wall runs from the ends
    of their V to its point; a negative angle turns them round.
    """

    land: float
    lengths: tuple[float, float]

    def laid(self, x: Array, y: Array) -> tuple[Array, Any, Any]:
        L, width = self.lengths
        off = np.abs(y - 0.5 * width)
        phase = np.remainder(((x + off / np.tan(self.angle)) / L + EDGE) * self.count, 1.0)
        return phase, L / self.count * abs(np.sin(self.angle)), off >= 0.5 * self.land * width

    def jumps(self, axis: str) -> tuple[float, ...]:
        width, land = self.lengths[1], self.land
        return (0.5 * width * (1.0 - land), 0.5 * width * (1.0 + land)) if axis == "y" and land else ()
