"""Textured and rough films: square dimples on a flat slider, and a random surface on a wave."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...base.parallel import Array
from .gaps import Wave


@dataclass(frozen=True)
class Dimples:
    """Square dimples of constant depth in K x K cells of a square of side L (benchmark of the FBNS codes).

    With xi = x (30 K + 1)/L the node number, a cell has 30 nodes; those numbered 6 to 25 in both directions lie at full
    depth, 5 and 26 (the rim) at half. Between nodes the film is that of the nearest one, so that coarser grids see it too.
    edged : whether it tells its edges, half-way between nodes; the reference's scheme knows none.
    """

    h: float
    depth: float
    L: float
    K: int
    edged: bool = True

    def _profile(self, x: Array) -> Array:
        """2 in a dimple, 1 on its rim, 0 outside."""
        node = np.rint(x * ((30 * self.K + 1) / self.L))
        inside = (node >= 1) & (node <= 30 * self.K)
        node = (node - 1) % 30 + 1
        return np.where(inside, (abs(node - 15.5) < 10).astype(float) + (abs(node - 15.5) < 11), 0.0)

    def __call__(self, x: Array, y: Array) -> Array:
        """h (m) at x and y (m)."""
        return self.h + 0.5 * self.depth * np.minimum(self._profile(x), self._profile(y))

    def jumps(self, axis: str) -> tuple[float, ...]:
        """x or y (m) of the rims' edges, half-way between nodes."""
        if not self.edged:
            return ()
        nodes = 30.0 * np.arange(self.K)[:, None] + np.array([4.5, 5.5, 25.5, 26.5])
        return tuple((nodes * (self.L / (30 * self.K + 1))).ravel())


@dataclass(frozen=True)
class Rough:
    """A wave with a random surface on it: cubic B-spline through normal numbers on a lattice, cut at h_floor.

    The surface depends on the seed, not on the grid: amplitude is the standard deviation of the lattice's numbers in m (the
    surface's own is `shapes.MEAN_SQUARE` = 0.479 of it), `cells` how many of its meshes lie along a side.
    """

    wave: Wave
    amplitude: float
    seed: int
    cells: int
    lengths: tuple[float, float]
    h_floor: float

    @cached_property
    def _lattice(self) -> Array:
        return np.random.default_rng(self.seed).standard_normal((self.cells + 4, self.cells + 4))

    def __call__(self, x: Array, y: Array) -> Array:
        """h (m) at x and y (m)."""
        x, y = np.broadcast_arrays(x, y)
        from scipy.ndimage import map_coordinates  # here: few films need it, and scipy takes a while

        at = [1.5 + y * (self.cells / self.lengths[1]), 1.5 + x * (self.cells / self.lengths[0])]
        surface = map_coordinates(self._lattice, at, order=3, prefilter=False, mode="nearest")
        return np.maximum(self.wave(x, y) + self.amplitude * surface, self.h_floor)
