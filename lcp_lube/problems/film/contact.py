"""What asperities that touch carry, and how they drag."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.parallel import Array
from ..grid import Grid
from .reynolds import sides

if TYPE_CHECKING:
    from .lubrication import LubricationProblem


@dataclass(frozen=True)
class Contact:
    """Pressure of the asperities at the owned points, Pa, and their coefficient of friction."""

    p_a: Array
    friction: float

    def total(self, problem: LubricationProblem, weight: Callable[[Array, Array], Any]) -> float:
        """Integral of p_a weight(x, y), N for a weight of 1 (1D: N/m). Collective."""
        grid = problem.grid
        found = self.p_a.reshape(grid.box) * areas(grid) * weight(grid.x, grid.y)
        return float(problem.reduce.sum(found))

    def drag(self, problem: LubricationProblem, lever: Array | float = 1.0) -> float:
        """Friction on the moving wall, N (1D: N/m), times a lever of each line. Collective."""
        return float(np.sign(problem.U)) * self.friction * self.total(problem, lambda x, y: lever + 0.0 * x)


def areas(grid: Grid) -> Array:
    """What each owned point stands for up to the open sides, shape grid.box, m2 (1D: m)."""
    west, east, south, north = sides(grid)
    first, last = grid.rims(0)
    along = grid.widths(0) + 0.5 * (first * west + last * east)
    across: Any = 1.0
    if grid.dim == 2:
        first, last = grid.rims(1)
        across = (grid.widths(1)[:, None] + 0.5 * (first * south + last * north)) * grid.stretch(grid.y)
    return np.broadcast_to(grid.cell * along * across, grid.box)
