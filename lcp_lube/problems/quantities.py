"""What an engineer reads off the fields: load, friction, largest pressure, cavitated area, fronts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..parallel import Array

if TYPE_CHECKING:
    from .problem import LubricationProblem


def quantities(problem: LubricationProblem, p: Array, r: Array) -> dict[str, float | None]:
    """Integrals and extrema of the fields. Collective.

    Parameters
    ----------
    p, r : owned points; p in units of p_unit above the cavitation pressure.

    Returns
    -------
    p_max : Pa, absolute. load : N (N/m in 1D), integral of the absolute pressure. friction : drag on the moving wall, N
    (N/m in 1D). cavitated_fraction : share of the points. rupture, reformation : m, first ones in 1D, None where absent.
    """
    grid, red = problem.grid, problem.reduce
    p_pa = p * problem.p_unit
    z = cavity_sign(problem, p, r)
    out: dict[str, float | None] = {
        "p_max": max(red.max(p_pa), *problem.p_sides[: 2 * grid.dim]) + problem.p_c,
        "load": _load(problem, p_pa),
        "friction": _friction(problem, p_pa, r),
        "p_unit": problem.p_unit,
        "cavitated_fraction": red.sum((z < 0).astype(float)) / grid.size,
    }
    if grid.dim == 1:
        out["rupture"], out["reformation"] = fronts(problem, p, r)
    return out


def cavity_sign(problem: LubricationProblem, p: Array, r: Array) -> Array:
    """p / max|p| - r: positive in the full film, negative in the cavity; no threshold to choose. Collective."""
    p_max = problem.reduce.max(np.abs(p))
    return (p / p_max if p_max > 0 else p) - r


def _load(problem: LubricationProblem, p_pa: Array) -> float:
    """Trapezoidal rule, boundary included; a corner has the mean of its two sides."""
    grid = problem.grid
    p_W, p_E, p_S, p_N = problem.p_sides
    inside = problem.reduce.sum(p_pa)
    if grid.dim == 1:
        return grid.cell * (inside + 0.5 * (p_W + p_E)) + problem.p_c * grid.lengths[0]
    nx, ny = grid.shape
    edges = 0.5 * (ny * (p_W + p_E) + nx * (p_S + p_N)) + 0.25 * (p_W + p_E + p_S + p_N)
    return grid.cell * (inside + edges) + problem.p_c * grid.lengths[0] * grid.lengths[1]


def _friction(problem: LubricationProblem, p_pa: Array, r: Array) -> float:
    """Integral of mu U (1 - r)/h + (h/2) dp/dx: shear on the wall that moves, the void carrying none.

    Shear by the trapezoidal rule over the points and the two ends (no void at the inlet; at the outlet the last point's);
    the pressure term as sums of h_face (p_E - p_W)/2 over the x faces.
    """
    grid = problem.grid
    dx = grid.spacing[0]
    h, box = problem.scheme.h, grid.box
    p2, r2 = p_pa.reshape(box), r.reshape(box)
    x, y = (np.array(a) for a in np.broadcast_arrays(grid.x, grid.y))
    framed = grid.ghosted(p_pa)
    p_W = np.where(x < 1.5 * dx, problem.p_sides[0], framed[1:-1, :-2])
    last = x > grid.lengths[0] - 1.5 * dx
    muU = problem.mu * problem.U
    total = muU * (1.0 - r2) / h * dx + 0.5 * problem.film(x - dx / 2, y) * (p2 - p_W)
    first_end = np.where(x < 1.5 * dx, 0.5 * muU / problem.film(np.zeros_like(x), y) * dx, 0.0)
    h_end = problem.film(np.full_like(x, grid.lengths[0]), y)
    last_end = 0.5 * muU * (1.0 - r2) / h_end * dx + 0.5 * problem.film(x + dx / 2, y) * (problem.p_sides[1] - p2)
    per_width = problem.reduce.sum(total + first_end + np.where(last, last_end, 0.0))
    return per_width * (grid.spacing[1] if grid.dim == 2 else 1.0)


def fronts(problem: LubricationProblem, p: Array, r: Array) -> tuple[float | None, float | None]:
    """First rupture and first reformation behind it in 1D, in metres; None where there is none. Collective.

    Each front is found to its cell from the sign of p/max|p| - r and placed inside it. Rupture: where U h = Q, the one flow
    of the discrete solution (p = p' = 0 there), h taken linear over the cell (and one beyond: the discrete front
    may be late). Reformation: where the pressure behind it, extrapolated linearly, is zero.
    """
    grid, film = problem.grid, problem.film
    dx, L = grid.spacing[0], grid.lengths[0]
    x = grid.x[0]
    z = grid.ghosted(cavity_sign(problem, p, r))[1]
    z[0] = 1.0 if grid.x_start == 0 else z[0]  # the inflow boundary is full
    cavity = z < 0
    west, east = film(x - dx, 0 * x), film(x, 0 * x)
    Q = problem.boundary_flows(p, r)[0]
    front = cavity[1:-1] & ~cavity[:-2]
    slope = np.where(east > west, east - west, np.inf)  # a step up in the film: rupture at its edge, the cell's start
    rupture = problem.reduce.min(np.where(front, x - dx + dx * np.clip((Q / problem.U - west) / slope, -1.0, 2.0), np.inf))
    if not np.isfinite(rupture):
        return None, None
    p_line = grid.ghosted(p)[1]
    if grid.x_end == grid.shape[0]:
        p_line[-1] = problem.p_sides[1] / problem.p_unit
    rise = p_line[2:] - p_line[1:-1]
    back = np.where(rise > 0, np.clip(p_line[1:-1] / np.where(rise > 0, rise, 1.0), 0.0, 1.0), 0.5)
    full_again = ~cavity[1:-1] & cavity[:-2] & (x > rupture)
    reformation = problem.reduce.min(np.where(full_again, x - back * dx, np.inf))
    if not np.isfinite(reformation) and problem.p_sides[1] > 0:
        reformation = L - 0.5 * dx  # in the last cell, before a boundary above the cavitation pressure
    return rupture, reformation if np.isfinite(reformation) else None
