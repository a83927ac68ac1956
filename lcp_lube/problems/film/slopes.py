"""Derivatives of what an engineer reads off a film by its fields: dQ/dp and dQ/dr at every point, at the signs of the solution.

Load, force, moments, friction and flows are linear in p and r as long as no cell changes from full to cavitated; the largest
pressure is that of one point. Whatever else is asked for is a function of these numbers (`drivers.gradient`).
"""

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.parallel import Array
from ...registry import SMALL
from .borne import by_fields
from .cavity import cavity_sign
from .effects import around
from .flows import SIDES, drag_sum, friction, linear, runs, sheared_faces, side_flows, volume_unit
from .forces import Weight, open_pressures, totals, weights
from .grooves import GroovedProblem
from .lubrication import LubricationProblem
from .peak import Window
from .quantities import largest_of, largest_pressure, thinnest
from .reynolds import sides
from .rim_tops import rim_top
from .strip import line_weights, stream_weights
from .supplies import supply_flows
from .tangent import Tangent

TIE = 1e-9  # relative: pressures so near the largest one are as large


@dataclass(frozen=True)
class Slope:
    """dQ/dp, p in p_unit, flat or on the grid's box, and dQ/dr (0: at all) of a number at the owned points.

    ties : points that could as well have it. value : the number itself, where one pass has both, else NaN. film : of the
    largest pressure, dQ/dh at the points, p and r held, per m.
    """

    p: Array
    r: Array | float
    ties: int = 0
    value: float = np.nan
    film: Array | float = 0.0


def numbers(problem: LubricationProblem, p_pa: Array, r: Array, wanted: Collection[str] | None = None) -> dict[str, float]:
    """The numbers that have slopes, SI units; vectors by their parts, force_x, flow_west. Collective.

    p_pa : Pa above p_c. wanted : the others that take time, what is an integral, flows and the largest pressure, are NaN;
        None: all.
    """

    def asked(start: str) -> bool:
        return wanted is None or any(name.startswith(start) for name in wanted)

    out = totals(problem, p_pa, r, wanted=wanted)
    out["friction"] = friction(problem, p_pa, r) if asked("friction") else np.nan
    if problem.grid.polar is not None:
        lever = problem.grid.polar[0] + problem.grid.y
        out["friction_torque"] = friction(problem, p_pa, r, lever) if asked("friction_torque") else np.nan
    out["p_max"] = largest_pressure(problem, p_pa)[0] + problem.p_c if asked("p_max") else np.nan
    out["min_h"] = thinnest(problem)[0] if asked("min_h") else np.nan
    kinds = [kind for pair in problem.grid.ends for kind in pair]
    grooved = isinstance(problem, GroovedProblem) and asked("groove_flow")
    p = p_pa / problem.p_unit if asked("flow_") or grooved or problem.held is not None else p_pa
    flows = side_flows(problem, p, r) if asked("flow_") else dict.fromkeys(SIDES, np.nan)
    out |= {f"flow_{name}": flows[name] for name, kind in zip(SIDES, kinds, strict=False) if kind == "open"}
    if isinstance(problem, GroovedProblem) and grooved:
        out |= {f"groove_flow_{k}": flow for k, flow in enumerate(problem.groove_flows(p, r), start=1)}
    out |= {f"supply_flow_{k}": flow for k, flow in enumerate(supply_flows(problem, p, r), start=1)}
    return out


def by_points(problem: LubricationProblem, weight: Weight) -> Array:
    """What an integral of the pressure with this weight changes by with p at each point, in p_unit, shape `grid.box`."""
    grid = problem.grid
    lines = grid.cell * problem.p_unit * stream_weights(grid)
    return np.broadcast_to(weight(grid.x, grid.y) * grid.widths(0) * lines, grid.box)


def giving_points(problem: LubricationProblem, name: str) -> NDArray[np.bool_]:
    """The owned points of the groove or supply whose flow this is."""
    which = int(name.rpartition("_")[2])
    if isinstance(problem, GroovedProblem):
        return problem.columns[which - 1]
    assert problem.held is not None  # as the name says
    return (problem.held.owner == which - 1).ravel()


def slope(problem: LubricationProblem, tangent: Tangent | None, p_pa: Array, r: Array, name: str, last: bool = False) -> Slope:
    """dQ/dp and dQ/dr of one of `numbers`. Collective.

    Parameters
    ----------
    tangent : the film's equations linearised in p, which know how a fluid's coefficients change with it; flows need it, and
        drags of a fluid with a law.
    last : of points that tie for the largest pressure the last one has it, not the first.
    """
    if (weight := weights(problem).get(name)) is not None:
        return Slope(*by_fields(problem, p_pa, r, by_points(problem, weight)))
    if name == "p_max":
        return _largest(problem, p_pa / problem.p_unit, last)
    if name == "min_h":
        return Slope(np.zeros(p_pa.size), 0.0)
    if name in ("friction", "friction_torque"):
        lever = problem.grid.polar[0] + problem.grid.y if name == "friction_torque" and problem.grid.polar else 1.0
        return _friction(problem, tangent, p_pa / problem.p_unit, r, lever)
    assert tangent is not None  # as flows need it
    if name.startswith("flow_"):
        return _flow(problem, tangent, name.removeprefix("flow_"))
    return _given(problem, tangent, giving_points(problem, name))


def _friction(problem: LubricationProblem, tangent: Tangent | None, p: Array, r: Array, lever: Any) -> Slope:
    """Of `flows.drag`, term by term."""
    grid, s = problem.grid, problem.scheme
    if runs(problem, SMALL) and (tangent is None or tangent.viscosity is None):
        by = np.empty((2, *grid.box))
        value = drag_sum(problem, p.reshape(grid.box), problem.p_unit, r.reshape(grid.box), lever, by)
        return Slope(by[0].ravel(), by[1].ravel(), value=value)
    before, behind = grid.steps(0)[:-1], grid.steps(0)[1:]
    dy, unit = grid.spacing[1] if grid.dim == 2 else 1.0, problem.p_unit
    weight, rims = line_weights(grid), grid.rims(1) if grid.dim == 2 else (0.0, 0.0)
    first, last, south, north = sides(grid)
    walls = sides(grid, ("closed",))[:2]
    h_east, *lengths = sheared_faces(problem, grid.x + behind / 2)
    full = (cavity_sign(problem.reduce, p, r) >= 0).reshape(grid.box) if "closed" in grid.ends[0] else np.ones(1, dtype=bool)
    void, passes = r.reshape(grid.box), ~walls[1]
    share = np.zeros(grid.box)  # the liquid's share of a face is 1 + share r
    np.divide(s.b_E, s.couette_E, out=share, where=passes & (s.couette_E != 0.0))
    resting, moving = linear(np.where, 1.0 + share * void, *lengths)
    sheared = share / np.where(passes, moving, 1.0)
    parts: list[tuple[NDArray[np.bool_], Any]] = list(zip(walls, (0.5 * before / behind, 0.5), strict=True))
    parts = [(wall, part) for wall, part in parts if wall.any()]
    for wall, part in parts:
        sheared -= np.where(wall & ~full, part / s.h, 0.0)
    arcs = grid.stretch(grid.y) ** 2 * lever
    lines = problem.U * arcs * (weight + 0.5 * (rims[0] * south + rims[1] * north)) * dy
    pull = 0.5 * weight * lever * dy * unit  # of p_east - p, times the film
    towards = np.where(passes, h_east, 0.0) * pull
    dp = grid.ghosted(np.where(last, 0.0, towards).ravel(), outside=0.0)[1:-1, :-2] - towards
    if first.any():
        h_west, *west, _ = sheared_faces(problem, grid.x[:, :1] - before[:1] / 2)
        dp[:, :1] += h_west * pull
    if tangent is not None and tangent.viscosity is not None:  # that of a face follows the mean of its two points' pressures
        own, other = tangent.viscosity  # d log(mu)/dp at the west and the east point of the east face
        by_wall = np.where(passes, resting + (1.0 + share * void) / moving, 0.0)
        if first.any():
            by_wall[:, :1] += before[0] / behind[0] * (west[0] + 1.0 / west[1])
        for wall, part in parts:
            by_wall = by_wall + np.where(wall, part * np.where(full, 4.0, 1.0 - void) / s.h, 0.0)
        drag = problem.mu * behind * lines * by_wall
        dp = dp + drag * own + grid.ghosted((drag * other).ravel(), outside=0.0)[1:-1, :-2]
    return Slope(dp.ravel(), (problem.mu * behind * lines * sheared).ravel())


def _largest(problem: LubricationProblem, p: Array, last: bool) -> Slope:
    """The point with the largest pressure, the first or last of equals, or those around the top; none where a side has it."""
    grid, reduce = problem.grid, problem.reduce
    largest, p_sides = reduce.max(p), [q / problem.p_unit for q in problem.p_sides]
    near = p >= largest - TIE * abs(largest)
    index = grid.first + np.arange(p.size)
    way = 1.0 if last else -1.0
    chosen = way * reduce.max(np.where(near, way * index.astype(float), -np.inf))
    ties = int(reduce.sum(near.astype(float))) - 1
    by_p, by_film = np.where(index == chosen, 1.0, 0.0), np.zeros(p.size)
    if problem.tops:
        seen = np.where(near & (index != chosen), 0.0, p)
        place = largest_of(problem, seen.reshape(grid.box), grid.x[0], grid.y[:, 0])[1]
        assert place is not None  # a solution's pressures are numbers
        window = Window(grid, p, place, p_sides, problem.scheme.held)
        by_p, largest = window.slopes(p.size), window.top()[0]
        if (top := rim_top(problem, p, problem.p_unit, largest)) is not None:
            west, east = (np.where(index == one, 1.0, 0.0) for one in top.points)
            by_p, by_film, largest = top.shares[0] * west + top.shares[1] * east, 0.5 * top.by_film * (west + east), top.value
    at_side = max((q / problem.p_unit for q in open_pressures(problem) if q), default=0.0) > largest
    by = 0.0 if at_side else problem.p_unit
    return Slope(by_p * by, 0.0, 0 if at_side else ties, film=(by_film * by).reshape(grid.box))


def _flow(problem: LubricationProblem, tangent: Tangent, side: str) -> Slope:
    """Of `flows.side_flows`: what leaves through the outer faces, and what the strips along the other sides carry."""
    grid, s = problem.grid, problem.scheme
    at = {name: np.broadcast_to(mask, grid.box) for name, mask in zip(SIDES, sides(grid), strict=True)}
    own = dict(zip(SIDES, tangent.own, strict=True))
    dp, dr = np.where(at[side], own[side], 0.0), np.zeros(grid.box)
    if side == "east":
        dr = np.where(at[side], s.b_E, 0.0)
    if grid.dim == 2:
        lines = line_weights(grid)
        for end, rim in zip(("south", "north"), grid.rims(1), strict=True):
            if side in ("west", "east"):
                leaves, enters = float(side == "east"), float(side == "west")
            else:
                leaves = enters = -1.0 if side == end else 0.0
            strip = 0.5 * rim / lines
            carried, entered = (np.where(at[way] & at[end], strip, 0.0) for way in ("east", "west"))
            dp = dp + leaves * carried * tangent.carried + enters * entered * tangent.entering
            dr = dr + leaves * carried * s.b_E
    size = volume_unit(problem)
    return Slope((size * dp).ravel(), (size * dr).ravel())


def _given(problem: LubricationProblem, tangent: Tangent, cells: NDArray[np.bool_]) -> Slope:
    """Of what some cells give to the film: the sum of their balances, were they not held."""
    grid, s = problem.grid, problem.scheme
    size = volume_unit(problem)
    rows = np.where(cells.reshape(grid.box), size, 0.0)
    dp = rows * (sum(tangent.own) + tangent.stored)
    east, west, north, south = 1, 0, 3, 2  # of `around`: a row's part by its neighbour's p is that neighbour's
    for other, from_there in zip(tangent.other, (east, west, north, south), strict=True):
        dp = dp + np.nan_to_num(around(grid.ghosted((rows * other).ravel()))[from_there])
    dr = rows * s.b_C + np.nan_to_num(grid.ghosted((rows * s.b_W).ravel())[1:-1, 2:])
    return Slope(dp.ravel(), dr.ravel())
