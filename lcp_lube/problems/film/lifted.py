"""A film that is thicker than its shapes say: what bends under the pressure is added to them."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...base.parallel import Array
from ..grid import Grid
from .views import View


@dataclass(frozen=True)
class LiftedFilm(View):
    """h(x, y) + lift, the lift bilinear between this rank's points and those beside them, constant beyond.

    x, y : coordinates of the points with their neighbours, m. lift : there, shape (y.size, x.size), m.
    """

    x: Array
    y: Array
    lift: Array
    rims = ()  # what bends them is not known between points

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
