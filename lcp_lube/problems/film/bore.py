"""The gap between a journal and its bore: lobes, a pressure dam, a barrel-shaped journal, a tilted axis, and shapes on top."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...base.parallel import Array
from .shapes import Shape
from .turning import Turning


@dataclass(frozen=True)
class Dam:
    """A recess of the bore between two angles (rad, in the sense of rotation) and over a width (m) about the middle."""

    start: float
    end: float
    width: float
    depth: float

    def inside(self, theta: Array, y: Array) -> NDArray[np.bool_]:
        """Whether points are in it; y from the middle, m."""
        return (np.remainder(theta - self.start, 2.0 * math.pi) <= self.end - self.start) & (np.abs(y) <= 0.5 * self.width)


@dataclass(frozen=True)
class Bore:
    """h(x, y) of a journal in its bore, m; angles are counted from the load, in the sense of rotation.

    eccentricity : relative; attitude : angle of the thinnest film, rad. lobes : middles of the lobes, rad, each moved inwards
    by preload times the clearance. tilt, tilt_across : slopes of the axis. barrel : by how much the film is larger at both ends
    than in the middle, growing as a parabola, m. parts : shapes that are added.
    """

    turning: Turning
    eccentricity: float
    attitude: float
    preload: float = 0.0
    lobes: tuple[float, ...] = ()
    tilt: float = 0.0
    tilt_across: float = 0.0
    barrel: float = 0.0
    dam: Dam | None = None
    parts: Sequence[Shape] = ()

    def __call__(self, x: Array, y: Array | None = None, /) -> Array:
        """The film at x and y (m), with the broadcast shape of both; the round bore by a square, which keeps its digits."""
        turning, x = self.turning, np.asarray(x, dtype=float)
        theta, along = turning.theta(x), np.asarray(0.5 * turning.B if y is None else y, dtype=float)
        from_middle = along - 0.5 * turning.B
        h = turning.c * ((1.0 - self.eccentricity) + 2.0 * self.eccentricity * np.sin(0.5 * (theta - self.attitude)) ** 2)
        if self.preload:
            off = np.remainder(theta[..., None] - np.array(self.lobes) + math.pi, 2.0 * math.pi) - math.pi
            h = h - self.preload * turning.c * np.cos(np.abs(off).min(axis=-1))
        if self.tilt or self.tilt_across:
            h = h - from_middle * (self.tilt * np.cos(theta) + self.tilt_across * np.sin(theta))
        if self.barrel:
            h = h + self.barrel * (2.0 * from_middle / turning.B) ** 2
        if self.dam is not None:
            h = h + np.where(self.dam.inside(theta, from_middle), self.dam.depth, 0.0)
        for part in self.parts:
            h = h + part(np.remainder(x, turning.length), along)
        return np.array(np.broadcast_to(h, np.broadcast_shapes(x.shape, along.shape)))

    def jumps(self, axis: str) -> tuple[float, ...]:
        """x or y (m) of the straight lines across which the film jumps."""
        found = [t for part in self.parts if hasattr(part, "jumps") for t in part.jumps(axis)]
        if self.dam is not None and axis == "x":
            angles = np.remainder(np.array([self.dam.start, self.dam.end]) - self.turning.start, 2.0 * math.pi)
            found += [*(angles * self.turning.R)]
        if self.dam is not None and axis == "y":
            found += [0.5 * (self.turning.B - self.dam.width), 0.5 * (self.turning.B + self.dam.width)]
        return tuple(float(t) for t in found)
