"""The gap between a journal and its bore: lobes, a pressure dam, a barrel-shaped journal, a tilted axis, and shapes on top."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...base.parallel import Array
from .edges import jumps_of, level
from .lines import SAME
from .shapes import Shape, rims_of
from .turning import Turning
from .views import Travelling


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
        found = [t for part in self.parts for t in jumps_of(part, axis)]
        if self.dam is not None and axis == "x":
            angles = np.remainder(np.array([self.dam.start, self.dam.end]) - self.turning.start, 2.0 * math.pi)
            found += [*(angles * self.turning.R)]
        if self.dam is not None and axis == "y":
            found += [0.5 * (self.turning.B - self.dam.width), 0.5 * (self.turning.B + self.dam.width)]
        return tuple(float(t) for t in found)

    @property
    def rims(self) -> tuple[Shape, ...]:
        """Distances (m) from edges of its shapes that are curved or slanted."""
        return tuple(Travelling(rim, 0.0, self.turning.length) for rim in rims_of(self.parts))

    @property
    def level(self) -> bool:
        return not (self.tilt or self.tilt_across or self.barrel) and all(map(level, self.parts))


@dataclass(frozen=True)
class PadBore:
    """h(x, y) between a journal and pads around it, m: each pad's own bore, tilted about its pivot.

    On the pad about the middle angle m_k, with its pivot at q_k, clearance c_p of its bore and c at the pivot,

        h = c_p - (c_p - c) cos(theta - q_k) - c e cos(theta - attitude) - tilt_k R sin(theta - q_k) :

    a positive tilt (rad) opens the edge at which the journal enters. eccentricity e is relative to c, half: of a pad's extent,
    rad. Between pads, where a pressure is held and only the drag counts it, the film is straight from edge to edge.
    """

    turning: Turning
    eccentricity: float
    attitude: float
    c_pad: float
    half: float
    middles: tuple[float, ...]
    pivots: tuple[float, ...]
    tilts: tuple[float, ...]

    def __call__(self, x: Array, y: Array | None = None, /) -> Array:
        """The film at x and y (m), with the broadcast shape of both."""
        x = np.asarray(x, dtype=float)
        inlets = np.array(self.middles) - self.half
        passed = np.remainder(self.turning.theta(x)[..., None] - inlets, 2.0 * math.pi)
        pad = passed.argmin(axis=-1)  # whose inlet lies behind
        on = passed.min(axis=-1)
        turn = np.remainder(np.diff(inlets, append=inlets[:1]), 2.0 * math.pi)
        gaps = np.where(turn == 0.0, 2.0 * math.pi, turn) - 2.0 * self.half  # of one pad the way to itself is a turn
        beyond = np.maximum(on - 2.0 * self.half, 0.0) / gaps[pad]
        h = self._on(pad, np.minimum(on, 2.0 * self.half))
        h = h + beyond * (self._on((pad + 1) % inlets.size, 0.0) - h)
        return np.array(np.broadcast_to(h, np.broadcast_shapes(x.shape, np.shape(0.0 if y is None else y))))

    def _on(self, pad: NDArray[np.intp], on: Array | float) -> Array:
        """The film of pads at this angle behind their inlets, m."""
        from_pivot = (np.array(self.middles) - np.array(self.pivots))[pad] - self.half + on
        theta = np.array(self.pivots)[pad] + from_pivot
        h = self.turning.c * (1.0 - self.eccentricity * np.cos(theta - self.attitude))
        h = h + 2.0 * (self.c_pad - self.turning.c) * np.sin(0.5 * from_pivot) ** 2
        return np.asarray(h - np.array(self.tilts)[pad] * self.turning.R * np.sin(from_pivot))


@dataclass(frozen=True)
class PadLever:
    """Rise of the film by a pad's tilt about its pivot (rad), for its moment: on the pad alone.

    start, length : of the pad, m; points on its two edges are in the grooves. shares : the parts of their cells that are the
    pad's. above : the pressure on the back of the pad, Pa above p_c.
    """

    turning: Turning
    pivot: float
    start: float
    length: float
    shares: tuple[float, float]
    above: float

    def __call__(self, x: Array, y: Array) -> Array:
        L, slack = self.turning.length, SAME * self.turning.length
        way = np.remainder(x - self.start + slack, L) - slack
        share = np.where(way <= slack, self.shares[0], np.where(way < self.length - slack, 1.0, self.shares[1]))
        share = np.where(way > self.length + slack, 0.0, share)
        return -share * self.turning.R * np.sin(self.turning.theta(x) - self.pivot)
