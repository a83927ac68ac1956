"""Where the fronts of the cavity lie, from the discrete fields."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...base.parallel import Array
from .cavity import cavity_sign
from .flows import point_weights
from .reynolds import Film

if TYPE_CHECKING:
    from .lubrication import LubricationProblem


def fronts(problem: LubricationProblem, p: Array, r: Array) -> tuple[float | None, float | None]:
    """First rupture and first reformation behind it, in metres, in 2D along `middle_row`; None where absent. Collective.

    Each front is found to its cell (`cavity.cavity_sign`) and placed inside it. Rupture: where U h = Q, Q being the
    flow along the line (p = p' = 0 there; in 1D the one flow of the discrete solution, in 2D what leaves the first cell of the
    cavity), within the cell or one beside it: the discrete front may be late. Reformation: where the pressure behind it,
    extrapolated linearly, is zero.
    """
    grid, film, scheme = problem.grid, problem.film, problem.scheme
    dx, L = grid.spacing[0], grid.lengths[0]
    x, row = grid.x[0], middle_row(problem) - grid.y_start
    here = 0 <= row < grid.box[0]
    row = row if here else 0
    y = np.full_like(x, grid.y[row, 0])
    z = grid.ghosted(cavity_sign(problem.reduce, p, r))[row + 1]
    opens = [kind == "open" for kind in grid.ends[0]]
    z[0] = 1.0 if grid.x_start == 0 and opens[0] else z[0]  # the inflow boundary is full
    cavity = z < 0
    if grid.dim == 1 and opens[0]:
        Q = np.full_like(x, problem.boundary_flows(p, r)[0])
    else:
        leaves = scheme.couette_E + scheme.b_C * r.reshape(grid.box)
        Q = leaves[row] / point_weights(grid).reshape(grid.box)[row]
    front = cavity[1:-1] & ~cavity[:-2] & here
    ruptures = _rises_through(film, Q[front] / problem.U, x[front] - 2.0 * dx, x[front] + dx, y[front])
    rupture = problem.reduce.min(ruptures)
    if not np.isfinite(rupture):
        return None, None
    p_line = grid.ghosted(p)[row + 1]
    if grid.x_end == grid.shape[0] and opens[1]:
        p_line[-1] = problem.p_sides[1] / problem.p_unit
    rise = p_line[2:] - p_line[1:-1]
    back = np.where(rise > 0, np.clip(p_line[1:-1] / np.where(rise > 0, rise, 1.0), 0.0, 1.0), 0.5)
    behind = x + np.where((x <= rupture) & grid.periodic[0], L, 0.0)  # round the end
    full_again = ~cavity[1:-1] & cavity[:-2] & (behind > rupture) & here
    reformation = problem.reduce.min(np.where(full_again, behind - back * dx, np.inf))
    if np.isfinite(reformation) and reformation >= grid.origin[0] + L and grid.periodic[0]:
        reformation -= L
    if not np.isfinite(reformation) and problem.p_sides[1] > 0:
        reformation = grid.origin[0] + L - 0.5 * dx  # in the last cell, before a boundary above the cavitation pressure
    return rupture, reformation if np.isfinite(reformation) else None


def _rises_through(film: Film, level: Array, a: Array, b: Array, y: Array) -> Array:
    """Where the film grows beyond a level between a and b, by bisection: at a jump too; a or b where it does not."""
    for _ in range(50):
        middle = 0.5 * (a + b)
        thin = film(middle, y) < level
        a, b = np.where(thin, middle, a), np.where(thin, b, middle)
    return b


def middle_row(problem: LubricationProblem) -> int:
    """Number of the line of points on y = width/2, or next below it, or on a mirror line; 0 in 1D."""
    grid = problem.grid
    if grid.dim == 1:
        return 0
    return grid.shape[1] - 1 if "mirror" in grid.ends[1] else (grid.shape[1] - 1) // 2
