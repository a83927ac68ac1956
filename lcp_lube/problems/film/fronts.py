"""Where the fronts of the cavity lie, from the discrete fields."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...base.parallel import Array
from ..grid import Grid
from .cavity import cavity_sign
from .flows import stream_weights
from .reynolds import Film

if TYPE_CHECKING:
    from .lubrication import LubricationProblem


def fronts(problem: LubricationProblem, p: Array, r: Array) -> tuple[list[float], list[float]]:
    """x of all ruptures and of all reformations, m, in ascending order, in 2D along `middle_row`. Collective.

    Each front is found to its cell (`cavity.cavity_sign`) and placed inside it. Rupture: where U h = Q, Q being the
    flow along the line (p = p' = 0 there; in 1D the one flow of the discrete solution, in 2D what leaves the first cell of the
    cavity), within the cell or one beside it: the discrete front may be late. Reformation: where the pressure behind it,
    extrapolated linearly, is zero. A cavity that begins with the void that enters at the west has no rupture.
    """
    if not problem.U:
        return [], []  # at rest a film does not cavitate
    grid, film, scheme = problem.grid, problem.film, problem.scheme
    start, L, steps = grid.origin[0], grid.lengths[0], grid.steps(0)
    behind, ahead = steps[:-1], steps[1:]
    x, row = grid.x[0], middle_row(problem) - grid.y_start
    here = 0 <= row < grid.box[0]
    row = row if here else 0
    y = np.full_like(x, grid.y[row, 0])
    z = grid.ghosted(cavity_sign(problem.reduce, p, r))[row + 1]
    opens = [kind == "open" for kind in grid.ends[0]]
    if grid.x_start == 0 and opens[0]:
        z[0] = -1.0 if problem.r_in > 0 else 1.0
    cavity = z < 0
    if grid.dim == 1 and opens[0]:
        Q = np.full_like(x, problem.boundary_flows(p, r)[0])
    else:
        leaves = scheme.couette_E + scheme.b_C * r.reshape(grid.box)
        Q = scheme.flow_unit * leaves[row] / stream_weights(grid)[row]
    front = cavity[1:-1] & ~cavity[:-2] & here
    before = (x - 2.0 * behind)[front]
    before = before if grid.periodic[0] else np.maximum(before, start)
    ruptures = _rises_through(film, Q[front] / problem.U, before, (x + ahead)[front], y[front])
    p_line = grid.ghosted(p)[row + 1]
    last = grid.x_end == grid.shape[0] and opens[1]
    if last:
        p_line[-1] = problem.p_sides[1] / problem.p_unit
    rise = p_line[2:] - p_line[1:-1]
    back = np.where(rise > 0, np.clip(p_line[1:-1] / np.where(rise > 0, rise, 1.0), 0.0, 1.0), 0.5)
    full_again = ~cavity[1:-1] & cavity[:-2] & here
    reformations = (x - back * behind)[full_again]
    if last and here and cavity[-2] and problem.p_sides[1] > 0:
        reformations = np.append(reformations, start + L - 0.5 * steps[-1])  # before a side above the cavitation pressure
    parts = grid.comm.allgather((ruptures.tolist(), reformations.tolist()))
    found = ([place for part in parts for place in part[k]] for k in (0, 1))
    if grid.periodic[0]:
        found = ([start + (place - start) % L for place in places] for places in found)
    first, second = (sorted(places) for places in found)
    return first, second


def first_cavity(grid: Grid, ruptures: list[float], reformations: list[float]) -> tuple[float | None, float | None]:
    """The first rupture, and the first reformation behind it; without a rupture the first reformation. None where absent."""
    if not ruptures:
        return None, min(reformations, default=None)
    rupture = ruptures[0]
    if grid.periodic[0]:
        return rupture, min(reformations, key=lambda x: (x - rupture) % grid.lengths[0], default=None)
    return rupture, min((x for x in reformations if x > rupture), default=None)


def _rises_through(film: Film, level: Array, a: Array, b: Array, y: Array) -> Array:
    """Where the film first grows to a level between a and b, by sections in 32: at a jump too; a or b where it does not."""
    parts = np.arange(1, 32) / 32
    for _ in range(10 if a.size else 0):
        width = (b - a)[:, None]
        thick = film(a[:, None] + width * parts, y[:, None]) >= level[:, None]
        first = np.where(thick.any(axis=1), thick.argmax(axis=1), 31)  # the part at whose end the film has grown so far
        a, b = a + width[:, 0] * (first / 32), np.where(first < 31, a + width[:, 0] * ((first + 1) / 32), b)
    return b


def middle_row(problem: LubricationProblem) -> int:
    """Number of the line of points on y = width/2, or next below it, or on a mirror line; 0 in 1D."""
    grid = problem.grid
    if grid.dim == 1:
        return 0
    return grid.shape[1] - 1 if "mirror" in grid.ends[1] else (grid.shape[1] - 1) // 2
