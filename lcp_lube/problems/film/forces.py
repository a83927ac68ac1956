"""What the pressure of a film carries: the load of a flat film, the force of one that is wrapped round a shaft, the moments."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import hypot, inf
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.parallel import Array
from .flows import line_weights, point_weights
from .reynolds import sides

if TYPE_CHECKING:
    from .line import Known
    from .lubrication import LubricationProblem

Weight = Callable[[Array, Array], Array]


def open_pressures(problem: LubricationProblem) -> list[float | None]:
    """Pressures above p_c at west, east (south, north) in Pa; None where the side has none, being closed or periodic."""
    kinds = [kind for pair in problem.grid.ends for kind in pair]
    return [p if kind == "open" else None for p, kind in zip(problem.p_sides, kinds, strict=False)]


def ambient(problem: LubricationProblem) -> float:
    """The smallest pressure at a side, or of a supply where no side has one, Pa above p_c."""
    at_sides = [p for p in open_pressures(problem) if p is not None]
    return min(at_sides or [supply.p for supply in problem.held.supplies])  # type: ignore[union-attr]


def forces(problem: LubricationProblem, p_pa: Array, known: Known | None = None) -> dict[str, Any]:
    """Load, force and moment, N and N m (1D: N/m and N): the keys of `docs/numbers.md`. Collective.

    A flat film: `load`, the integral of p - p_ambient, and `moment` about the middle of the film, [about x, about y], of that
    pressure on the wall (the force points to +z). One round a shaft: `force` of the film on the shaft, minus the
    integral of (p - p_ambient) (cos phi, sin phi), `load` its magnitude, `attitude_deg` the angle from the load, which is
    its opposite, to the narrowest gap, positive in the sense of rotation, `moment` of the force about the middle of the width:
    its two parts times the distance along the axis (2D), 0 where the shaft lies straight between alike ends. A sector: `load`,
    `moment` about the axes through the centre, and `pressure_centre` (`_of_sector`).

    Parameters
    ----------
    p_pa : owned points, Pa above p_c. known : of a line, from which follows what the grid gets wrong.
    """
    grid, shaft, reference = problem.grid, problem.shaft, ambient(problem)
    middle = [start + 0.5 * length for start, length in zip(grid.origin, grid.lengths, strict=False)]

    def over(
        weight: Weight, whole: Callable[[Array], Array] = np.asarray, above: float = reference, touching: Any = problem.contact
    ) -> float:
        """Of a weight; on a line `whole` is its antiderivative."""
        found = integral(problem, p_pa, above, weight)
        found += touching.total(problem, weight) if touching else 0.0
        if known is None:
            return found
        return found + (known.line.integral(whole, above) - integral(problem, known.p_pa, above, weight))

    out: dict[str, Any] = {"pressure_integral": over(lambda x, y: np.ones(1), above=0.0, touching=None)}
    if shaft is None and grid.polar is not None:
        return out | _of_sector(grid.polar, over)
    if shaft is None:
        out["load"] = over(lambda x, y: np.ones(1))
        about_y = -over(lambda x, y: x - middle[0], lambda x: 0.5 * (x - middle[0]) ** 2)
        out["moment"] = [over(lambda x, y: y - middle[1]), about_y] if grid.dim == 2 else about_y
        return out

    R, phi = shaft.R, shaft.theta
    force = [
        -over(lambda x, y: np.cos(phi(x)), lambda x: R * np.sin(phi(x))),
        -over(lambda x, y: np.sin(phi(x)), lambda x: -R * np.cos(phi(x))),
    ]
    out |= {"load": hypot(*force), "force": force, "attitude_deg": None}
    if shaft.widest is not None and 0 < out["load"] < inf:
        out["attitude_deg"] = attitude(shaft.widest, force, problem.U)
    if grid.dim == 2:
        out["moment"] = [
            -over(lambda x, y: (y - middle[1]) * np.cos(phi(x))),
            -over(lambda x, y: (y - middle[1]) * np.sin(phi(x))),
        ]
    return out


def attitude(widest: float, force: Sequence[float], U: float) -> float:
    """Angle from the load to the narrowest gap, degrees, positive in the sense of rotation."""
    behind = np.exp(1j * widest) / complex(*force)  # of the opposites of both
    return float(np.degrees(np.angle(behind if U >= 0 else np.conj(behind))))


def _of_sector(polar: tuple[float, float], integral: Callable[..., float]) -> dict[str, Any]:
    """Load of a sector, its moment about the axes through the centre, x along the edge where it begins, y a quarter of a turn
    ahead, and the radius and angle at which the load acts."""
    inner, on = polar
    load = integral(lambda x, y: np.ones(1))
    moment = [integral(lambda x, y: (inner + y) * np.sin(x / on)), -integral(lambda x, y: (inner + y) * np.cos(x / on))]
    centre = None
    if load > 0:
        centre = [hypot(*moment) / load, float(np.degrees(np.arctan2(moment[0], -moment[1])))]
    return {"load": load, "moment": moment, "pressure_centre": centre}


def integral(problem: LubricationProblem, p_pa: Array, above: float, weight: Weight) -> float:
    """Integral of (p - above) weight(x, y): trapezoidal to the open sides, a corner having the mean of its two; cells end at
    the others. Collective."""
    grid = problem.grid
    inside = (p_pa - above) * np.broadcast_to(weight(grid.x, grid.y), grid.box).ravel()
    total = problem.reduce.sum(inside * point_weights(grid))
    pressures = open_pressures(problem)
    coordinates = grid.lines  # of all points, on every rank
    for k, p_side in enumerate(pressures):
        if p_side is None:
            continue
        axis, across = k // 2, 1 - k // 2
        at = grid.origin[axis] + (k % 2) * grid.lengths[axis]
        strip = 0.5 * grid.rims(axis)[k % 2]
        if grid.dim == 1:
            total += strip * (p_side - above) * weight(np.array([at]), np.zeros(1))[0]
            continue
        along = coordinates[across]
        share = strip * grid.widths(across, everywhere=True)
        corners = [j for j in (0, 1) if pressures[2 * across + j] is not None]
        ends = [grid.origin[across] + j * grid.lengths[across] for j in corners]
        corner_shares = [0.5 * strip * 0.5 * grid.rims(across)[j] for j in corners]
        places, shares = np.concatenate([along, ends]), np.concatenate([share, corner_shares])
        x, y = (np.full_like(places, at), places) if axis == 0 else (places, np.full_like(places, at))
        total += (p_side - above) * float(np.sum(shares * grid.stretch(y) * weight(x, y)))
    return float(grid.cell * total)


def corner_flows(problem: LubricationProblem) -> dict[str, float] | None:
    """By how much the flow out of each side grows when the spacings are halved, m3/s; None if it does not. Collective.

    At a corner of two sides whose pressures differ by dp, the flow from the one to the other is without bound: a distance r
    from the corner h^3/(12 mu) 2 dp/(pi r) passes, so that every halving adds h^3/(12 mu) (2 dp/pi) log 2.
    """
    grid, s, pressures = problem.grid, problem.scheme, open_pressures(problem)
    if grid.dim == 1:
        return None
    at = sides(grid)
    names = ("west", "east", "south", "north")
    growth = dict.fromkeys(names, 0.0)
    for i in (0, 1):
        for j in (2, 3):
            p_i, p_j = pressures[i], pressures[j]
            if p_i is None or p_j is None or p_i == p_j:
                continue
            k = (s.k_W, s.k_E)[i] * (0.5 * grid.rims(0)[i] * grid.spacing[0] / problem.p_unit)  # h^3/(12 mu)
            k = k / line_weights(grid) * grid.stretch(grid.y)
            passing = problem.reduce.sum(np.where(at[i] & at[j], k, 0.0)) * 2.0 * np.log(2.0) / np.pi * (p_i - p_j)
            growth[names[j]] += passing
            growth[names[i]] -= passing
    return growth if any(growth.values()) else None
