"""What an engineer reads off the fields: load, friction, flows, power, largest pressure, thinnest film, cavity."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from mpi4py import MPI

from ...base.parallel import Array
from .cavity import cavity_sign
from .flows import friction, point_weights, side_flows
from .fronts import fronts

if TYPE_CHECKING:
    from .lubrication import LubricationProblem


def quantities(problem: LubricationProblem, p: Array, r: Array) -> dict[str, Any]:
    """Integrals and extrema of the fields, and the scene's own numbers (`problem.extras`). Collective.

    In 1D forces, powers and areas are per unit width (N/m, W/m, m), flows too (m2/s).

    Parameters
    ----------
    p, r : owned points; p in units of p_unit above the cavitation pressure.

    Returns
    -------
    p_max : largest pressure, absolute, Pa; p_max_at : its [x] or [x, y], m (of a side: its middle).
    load : integral of the absolute pressure, N. load_above_ambient : that of p - p_ambient, p_ambient (Pa, absolute) being the
    smallest pressure at a side.
    friction : drag on the moving wall, N (`flows.friction`). friction_coefficient : friction over the load carried, which is
    the scene's bearing_load, else load_above_ambient; None unless that is positive. power_loss : friction U, W.
    flow : out of each side, m3/s (`flows.side_flows`). side_leakage : south and north together (2D).
    min_h, min_h_at : thinnest film and where, m, sides included.
    cavitated_fraction : share of the points (`cavity.cavity_sign`); cavitated_area : theirs, m2.
    rupture, reformation : x of the first ones, m, None where absent; in 2D on the middle line (`fronts.fronts`).
    p_unit : Pa.
    """
    grid, reduce = problem.grid, problem.reduce
    p_pa = p * problem.p_unit
    cavity = (cavity_sign(reduce, p, r) < 0).astype(float)
    weight = point_weights(grid)
    load, ambient = _load(problem, p_pa), min(p for p in open_pressures(problem) if p is not None)
    flow = side_flows(problem, p, r)
    p_max, p_max_at = _largest_pressure(problem, p_pa)
    min_h, min_h_at = _thinnest(problem)
    rupture, reformation = fronts(problem, p, r)
    out: dict[str, Any] = {
        "p_max": p_max + problem.p_c,
        "p_max_at": p_max_at,
        "load": load + problem.p_c * _area(problem),
        "p_ambient": ambient + problem.p_c,
        "load_above_ambient": load - ambient * _area(problem),
        "friction": friction(problem, p_pa, r),
        "p_unit": problem.p_unit,
        "cavitated_fraction": reduce.sum(cavity) / grid.size,
        "cavitated_area": reduce.sum(cavity * weight) * grid.cell,
        "rupture": rupture,
        "reformation": reformation,
        "min_h": min_h,
        "min_h_at": min_h_at,
        "flow": flow,
    }
    if grid.dim == 2:
        out["side_leakage"] = flow["south"] + flow["north"]
    out |= problem.extras(problem, p, r) if problem.extras else {}
    carried = out.get("bearing_load", out["load_above_ambient"])
    out["friction_coefficient"] = out["friction"] / carried if carried > 0 else None
    out["power_loss"] = out["friction"] * problem.U
    return out


def _area(problem: LubricationProblem) -> float:
    return float(np.prod(problem.grid.lengths))


def open_pressures(problem: LubricationProblem) -> list[float | None]:
    """Pressures above p_c at west, east (south, north) in Pa; None where the side has none, being closed or periodic."""
    kinds = [kind for pair in problem.grid.ends for kind in pair]
    return [p if kind == "open" else None for p, kind in zip(problem.p_sides, kinds, strict=False)]


def _load(problem: LubricationProblem, p_pa: Array) -> float:
    """Integral of p - p_c: trapezoidal to the open sides, a corner having the mean of its two; cells end at the others."""
    grid = problem.grid
    along = [n - 0.5 * pair.count("mirror") for n, pair in zip(grid.shape, grid.ends, strict=True)]
    total = problem.reduce.sum(p_pa * point_weights(grid))
    pressures = open_pressures(problem)
    for k, p_side in enumerate(pressures):
        if p_side is not None:
            corners = sum(other is not None for other in pressures[2 - k // 2 * 2 :][:2])
            total += 0.5 * p_side * (along[1 - k // 2] if grid.dim == 2 else 1.0) + 0.125 * p_side * corners
    return grid.cell * total


def _largest_pressure(problem: LubricationProblem, p_pa: Array) -> tuple[float, list[float] | None]:
    """p - p_c in Pa at the points and sides, and where. Collective."""
    grid = problem.grid
    largest, place = _largest(problem, p_pa.reshape(grid.box), grid.x[0], grid.y[:, 0])
    low = [*grid.origin[: grid.dim]]
    middle = [a + 0.5 * length for a, length in zip(low, grid.lengths, strict=True)]
    for k, p_side in enumerate(open_pressures(problem)):
        if p_side is not None and p_side > largest:
            largest, place = p_side, list(middle)
            place[k // 2] = low[k // 2] + (k % 2) * grid.lengths[k // 2]
    return largest, place


def _thinnest(problem: LubricationProblem) -> tuple[float, list[float] | None]:
    """Smallest film over the points and the points of the boundary, and where, m. Collective."""
    grid, film = problem.grid, problem.film
    x, y = grid.x[0], grid.y[:, 0]
    ends = [np.array([start, start + length]) for start, length in zip(grid.origin, grid.lengths, strict=False)]
    places = [(ends[0], y)] + ([(x, ends[1]), (ends[0], ends[1])] if grid.dim == 2 else [])
    films = [(problem.scheme.h, x, y)] + [(film(a[None, :], b[:, None]), a, b) for a, b in places]
    thickness, place = max((_largest(problem, -h, a, b) for h, a, b in films), key=lambda found: found[0])
    return -thickness, place


def _largest(problem: LubricationProblem, values: Array, x: Array, y: Array) -> tuple[float, list[float] | None]:
    """Largest of values over y (rows) and x (columns) and its place; NaN: nowhere. Collective.

    Of equals, to within the tolerance of a solve, the first in x and then y, whatever the ranks.
    """
    largest = problem.reduce.max(values)
    if not np.isfinite(largest):
        return largest, None
    near = values >= largest - 1e-9 * abs(largest)
    column = int(np.argmax(near.any(axis=0)))
    row = int(np.argmax(near[:, column]))
    own = (float(x[column]), float(y[row])) if near.any() else (np.inf, np.inf)
    return largest, [*problem.grid.comm.allreduce(own, MPI.MIN)][: problem.grid.dim]
