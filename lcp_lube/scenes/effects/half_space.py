"""[half_space]: walls that are elastic half spaces: h = h_rigid + u, the deflection by all of the pressure.

    2D  u(x, y) = 1/(pi E') Int p/r dA                     rectangles of constant pressure (Love 1929)
    1D  u(x) = -2/(pi E') Int p log(|x - s|/reference) ds  strips of constant pressure (Johnson 1985)

E' = 1/((1 - nu_1^2)/E_1 + (1 - nu_2^2)/E_2), half of what some call so. The sum over all points is a convolution, by FFT; under
several ranks their blocks of points go round, so that no rank ever holds the whole field.
"""

from dataclasses import dataclass, field
from functools import partial
from math import pi
from typing import Any

import numpy as np

from ...base.parallel import Array
from ...errors import InputError
from ...problems.film.effects import Answer, Cells
from ...problems.grid import Grid
from ..scene import Positive
from ..units import measured, metres
from .elastic import GivingWay
from .table import EffectTable


class HalfSpace(EffectTable):
    """Elastic half spaces on both sides of a flat film with pressures at its sides."""

    E_reduced: Positive = measured("Pa", ..., "E' = 1/((1 - nu_1^2)/E_1 + (1 - nu_2^2)/E_2)")
    reference: Positive | None = metres(None, "distance at which nothing moves (1D); default L")

    def effect(self, scene: Any) -> "Deflection":
        if self.E_reduced < 1e4:
            raise InputError(f"half_space.E_reduced = {self.E_reduced:g}: at least 10 kPa is needed (SI units?)")
        return Deflection(self.E_reduced, self.reference)


@dataclass(frozen=True)
class Deflection(GivingWay):
    """E : E', Pa. reference : m. kernels : transforms of the kernel between two blocks, as they were needed."""

    E: float
    reference: float | None
    even_lines = True
    kernels: dict[Any, Any] = field(default_factory=dict, compare=False, repr=False)

    def yields(self, grid: Grid) -> Array:
        return np.maximum(self.of(grid, np.ones(grid.local_size)), 0.0)

    def apply(self, at: Answer, out: Cells) -> None:
        of = at.problem.reduce.through(partial(self.of, at.grid))  # symmetric: its kernel is even
        out["lift"] += of(at.p + out.get("contact", 0.0))

    def of(self, grid: Grid, p: Array) -> Array:
        """Deflection at the owned points, m. Collective.

        Raises
        ------
        InputError : a grid that is a sector, uneven or closed somewhere: the kernel is of a plane.
        """
        if grid.polar is not None or not grid.even or {end for pair in grid.ends for end in pair} != {"open"}:
            raise InputError("half_space: a flat film whose sides all have a pressure is needed; others have [elastic]")
        own = ((grid.y_start, grid.y_end), (grid.x_start, grid.x_end))
        total, comm = np.zeros(grid.box), grid.comm
        for rank in range(comm.size):
            other, values = comm.bcast((own, p.reshape(grid.box)) if comm.rank == rank else None, root=rank)
            size = tuple(a + b - 1 for a, b in zip(grid.box, values.shape, strict=True))
            if (grid.shape, rank) not in self.kernels:
                away = [np.arange(a[0] - b[1] + 1, a[1] - b[0]) for a, b in zip(own, other, strict=True)]
                self.kernels[grid.shape, rank] = np.fft.rfft2(self.kernel(grid, *away))
            product = self.kernels[grid.shape, rank] * np.fft.rfft2(values, size)
            total += np.fft.irfft2(product, size)[values.shape[0] - 1 :, values.shape[1] - 1 :]
        return total.ravel()

    def kernel(self, grid: Grid, j: Array, i: Array) -> Array:
        """Deflection per pressure of a cell j lines and i columns away, m/Pa."""
        if grid.dim == 1:
            edges = (np.concatenate([i - 0.5, i[-1:] + 0.5])) * grid.spacing[0]
            inside = edges * (np.log(np.abs(edges) / (self.reference or grid.lengths[0])) - 1.0)
            return -2.0 / (pi * self.E) * np.diff(inside)[None, :]
        x, y = ((np.concatenate([k - 0.5, k[-1:] + 0.5])) * step for k, step in zip((i, j), grid.spacing, strict=True))
        x, y = x[None, :], y[:, None]
        corner = x * np.arcsinh(y / np.abs(x)) + y * np.arcsinh(x / np.abs(y))
        return np.diff(np.diff(corner, axis=0), axis=1) / (pi * self.E)
