"""What the pressure of a film carries: the load of a flat film, the force of one that is wrapped round a shaft, the moments."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from math import hypot, inf
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.parallel import Array
from ..strips import apart, each_strip, places_of
from .flows import volume_unit
from .fronts import counted
from .reynolds import sides
from .strip import line_weights, stream_weights

if TYPE_CHECKING:
    from ..grid import Grid
    from .known import Known
    from .lubrication import LubricationProblem

Weight = Callable[[Array, Array], Array]
PIVOT = "pivot_moment_"
LOOKS = 16  # places of a cell at a side, for the part of it that a supply fills


def open_pressures(problem: LubricationProblem) -> list[float | None]:
    """Pressures above p_c at west, east (south, north) in Pa; None where the side has none, being closed or periodic."""
    kinds = [kind for pair in problem.grid.ends for kind in pair]
    return [p if kind == "open" else None for p, kind in zip(problem.p_sides, kinds, strict=False)]


def ambient(problem: LubricationProblem) -> float:
    """The smallest pressure at a side, or of a supply where no side has one, Pa above p_c."""
    at_sides = [p for p in open_pressures(problem) if p is not None]
    held = problem.held.supplies if problem.held is not None else []
    return min(at_sides or [supply.p for supply in held] or [0.0])  # p_c of a film that nothing opens


def forces(problem: LubricationProblem, p_pa: Array, r: Array, known: Known | None = None) -> dict[str, Any]:
    """Load, force and moment, N and N m (1D: N/m and N): the keys of `docs/numbers.md`. Collective.

    A flat film: `load`, the integral of p - p_ambient, and `moment` about the middle of the film, [about x, about y], of that
    pressure on the wall (the force points to +z). One round a shaft: `force` of the film on the shaft, minus the
    integral of (p - p_ambient) (cos phi, sin phi), `load` its magnitude, `attitude_deg` the angle from the load, which is
    its opposite, to the narrowest gap, positive in the sense of rotation, `moment` of the force about the middle of the width:
    its two parts times the distance along the axis (2D), 0 where the shaft lies straight between alike ends. A sector: `load`,
    `moment` about the axes through the centre, and `pressure_centre`, the radius and angle at which the load acts.

    Parameters
    ----------
    p_pa : owned points, Pa above p_c. r : owned points. known : of a line, from which follows what the grid gets wrong.
    """
    shaft, found = problem.shaft, totals(problem, p_pa, r, known)
    out: dict[str, Any] = {"pressure_integral": found["pressure_integral"]}
    if shaft is None:
        out["load"] = found["load"]
    else:
        force = [found["force_x"], found["force_y"]]
        out |= {"load": hypot(*force), "force": force, "attitude_deg": None}
        if shaft.widest is not None and 0 < out["load"] < inf:
            out["attitude_deg"] = attitude(shaft.widest, force, problem.U)
    if "moment" in found:
        out["moment"] = found["moment"]
    elif "moment_x" in found:
        out["moment"] = moment = [found["moment_x"], found["moment_y"]]
        if shaft is None and problem.grid.polar is not None:
            degrees = float(np.degrees(np.arctan2(moment[0], -moment[1])))
            out["pressure_centre"] = [hypot(*moment) / out["load"], degrees] if out["load"] > 0 else None
    return out


def totals(
    problem: LubricationProblem,
    p_pa: Array,
    r: Array,
    known: Known | None = None,
    wanted: Collection[str] | None = None,
    columns: dict[bytes, Array] | None = None,
) -> dict[str, float]:
    """Integrals of the pressure (`borne`) by its `weights`, above ambient, with contact. Collective.

    `pressure_integral` counts from the cavitation pressure. wanted : those alone, the others are NaN; None: all.
    columns : as `integrals` takes them.
    """
    every, contact = weights(problem), problem.contact
    by = {name: weight for name, weight in every.items() if wanted is None or name in wanted}
    asked = [(_above(problem, name, weight), weight) for name, weight in by.items()]
    carries = counted(problem, p_pa, r) if by else p_pa
    out = dict.fromkeys(every, np.nan) | dict(zip(by, integrals(problem, carries, asked, columns), strict=True))
    for name, weight in by.items() if contact is not None else ():
        if name != "pressure_integral":
            out[name] += contact.total(problem, weight)
    if known is not None:
        for (name, told), discrete in zip(
            of_line(problem, known, by).items(), integrals(problem, known.p_pa, asked), strict=True
        ):
            out[name] += told - discrete
    return out


def of_line(problem: LubricationProblem, known: Known, wanted: Collection[str]) -> dict[str, float]:
    """`totals` of these names as the film of a line has them."""
    outside, every = known.ambient(problem), weights(problem)
    above = {name: 0.0 if name == "pressure_integral" else getattr(every[name], "above", outside) for name in wanted}
    return {name: known.line.integral(antiderivative(problem, name), one) for name, one in above.items()}


def _above(problem: LubricationProblem, name: str, weight: Weight) -> float:
    """The pressure above which an integral counts, Pa above p_c."""
    return 0.0 if name == "pressure_integral" else weight.above if hasattr(weight, "above") else ambient(problem)


def weights(problem: LubricationProblem) -> dict[str, Weight]:
    """By what the pressure is multiplied in its integrals, functions of x and y.

    Moments of a sector are about its centre, x along the edge where it begins, y a quarter of a turn ahead; those about the
    pivots of pads are `pivot_moment_1` and so on.
    """
    grid, shaft = problem.grid, problem.shaft
    middle = [start + 0.5 * length for start, length in zip(grid.origin, grid.lengths, strict=False)]
    found: dict[str, Weight] = {"pressure_integral": lambda x, y: np.ones(1)}
    found |= {f"{PIVOT}{k}": lever for k, lever in enumerate(problem.levers, start=1)}
    if shaft is not None:
        phi = shaft.theta
        found |= {"force_x": lambda x, y: -np.cos(phi(x)), "force_y": lambda x, y: -np.sin(phi(x))}
        if grid.dim == 2:
            found["moment_x"] = lambda x, y: -(y - middle[1]) * np.cos(phi(x))
            found["moment_y"] = lambda x, y: -(y - middle[1]) * np.sin(phi(x))
        return found
    found["load"] = found["pressure_integral"]
    if grid.polar is not None:
        inner, on = grid.polar
        found["moment_x"] = lambda x, y: (inner + y) * np.sin(x / on)
        found["moment_y"] = lambda x, y: -(inner + y) * np.cos(x / on)
    elif grid.dim == 2:
        found |= {"moment_x": lambda x, y: y - middle[1], "moment_y": lambda x, y: -(x - middle[0])}
    else:
        found["moment"] = lambda x, y: -(x - middle[0])
    return found


def antiderivative(problem: LubricationProblem, name: str) -> Callable[[Array], Array]:
    """Of a line's weight, by x."""
    if problem.shaft is not None and name != "pressure_integral":
        R, phi = problem.shaft.R, problem.shaft.theta
        return (lambda x: -R * np.sin(phi(x))) if name == "force_x" else lambda x: R * np.cos(phi(x))
    middle = problem.grid.origin[0] + 0.5 * problem.grid.lengths[0]
    return (lambda x: -0.5 * (x - middle) ** 2) if name == "moment" else np.asarray


def attitude(widest: float, force: Sequence[float], U: float) -> float:
    """Angle from the load to the narrowest gap, degrees, positive in the sense of rotation."""
    behind = np.exp(1j * widest) / complex(*force)  # of the opposites of both
    return float(np.degrees(np.angle(behind if U >= 0 else np.conj(behind))))


def integrals(
    problem: LubricationProblem,
    p_pa: Array,
    asked: Sequence[tuple[float, Weight]],
    known: dict[bytes, Array] | None = None,
) -> list[float]:
    """Integrals of (p - above) weight(x, y), in one pass: trapezoidal to the open sides, a corner having the mean of its two;
    cells end at the others. Collective.

    known : keeps the sums of p's columns by the weights of their lines, for integrals of the same p on other grids.
    """
    grid, p = problem.grid, p_pa.reshape(problem.grid.box)
    if known is not None and all(np.atleast_2d(weight(grid.x, grid.y[[0, -1]])).shape[0] == 1 for _, weight in asked):
        of_lines, along = stream_weights(grid)[:, 0], grid.widths(0)
        if (key := of_lines.tobytes()) not in known:
            known[key] = np.einsum("i,ij->j", of_lines, p)
        sums = [(known[key] - above * of_lines.sum()) @ (np.atleast_2d(w(grid.x, grid.y))[0] * along) for above, w in asked]
        parts = zip(sums, asked, strict=True)
        return [float(grid.cell * (problem.reduce.sum(np.array([a])) + _in_rims(problem, *one))) for a, one in parts]

    values, unit = apart(p)

    def add_up(rows: slice) -> Array:
        part, inside = places_of(grid, rows), np.zeros(len(asked))
        x, y, along, lines = part.x, part.y, part.widths(0), stream_weights(part)[:, 0]
        columns: dict[float, Array] = {}  # sums of each one
        for k, (above, weight) in enumerate(asked):
            w = np.atleast_2d(weight(x, y))
            if w.shape[0] == 1 and above in columns:
                inside[k] += columns[above] @ (w[0] * along)
                continue
            own, by = (p[rows] - above, 1.0) if above else (values[rows], unit)
            # Columns first, and no BLAS: row by row it takes ten times as long, and it may have threads of its own.
            if w.shape[0] == 1:
                columns[above] = np.einsum("i,ij->j", by * lines, own)
                inside[k] += columns[above] @ (w[0] * along)
            elif w.shape[1] == 1:  # of y alone
                inside[k] += np.einsum("i,ij->j", by * lines * w[:, 0], own) @ along
            else:
                inside[k] += np.einsum("i,ij->j", by * lines, own * w) @ along
        return inside

    cells = lambda: stream_weights(grid) * grid.widths(0)  # noqa: E731
    inside: Array = sum(each_strip(grid, add_up))
    total = lambda part, above, weight: problem.reduce.summed(  # noqa: E731
        float(part), lambda: (p[:] - above) * weight(grid.x, grid.y) * cells()
    )
    return [float(grid.cell * (total(part, *one) + _in_rims(problem, *one))) for part, one in zip(inside, asked, strict=True)]


def _in_rims(problem: LubricationProblem, above: float, weight: Weight) -> float:
    """What the strips along the open sides add to an integral, in mean cells; on every rank."""
    grid, total = problem.grid, 0.0
    pressures = open_pressures(problem)
    coordinates = grid.lines  # of all points, on every rank
    for k, p_side in enumerate(pressures):
        if p_side is None:
            continue
        axis, across = k // 2, 1 - k // 2
        at = grid.origin[axis] + (k % 2) * grid.lengths[axis]
        strip = 0.5 * grid.rims(axis)[k % 2]
        if grid.dim == 1:
            end = np.array([at]), np.zeros(1)
            total += strip * (_at_side(problem, p_side, *end)[0] - above) * weight(*end)[0]
            continue
        along = coordinates[across]
        share = strip * grid.widths(across, everywhere=True)
        corners = [j for j in (0, 1) if pressures[2 * across + j] is not None]
        ends = [grid.origin[across] + j * grid.lengths[across] for j in corners]
        corner_shares = [0.5 * strip * 0.5 * grid.rims(across)[j] for j in corners]
        places, shares = np.concatenate([along, ends]), np.concatenate([share, corner_shares])
        x, y = (np.full_like(places, at), places) if axis == 0 else (places, np.full_like(places, at))
        p_at: float | Array = p_side
        if problem.held is not None or hasattr(problem, "grooves"):
            looks = _looks(grid, across, corners)
            at_side = np.full_like(looks, at)
            p_at = np.mean(_at_side(problem, p_side, *((at_side, looks) if axis == 0 else (looks, at_side))), axis=1)
        total += np.sum((p_at - above) * shares * grid.stretch(y) * weight(x, y))
    return total


def _at_side(problem: LubricationProblem, p_side: float, x: Array, y: Array) -> Array:
    """Pressure at places of an open side, Pa above p_c: its own, or that of a supply which comes up to it."""
    p, L = np.full(x.shape, p_side), problem.grid.lengths[0]
    for groove in getattr(problem, "grooves", ()):
        p = np.where(np.remainder(x - groove.start, L) <= (groove.end - groove.start) % L, groove.p, p)
    for supply in reversed(problem.held.supplies if problem.held is not None else ()):  # where two lie, the first one counts
        p = np.where(supply.region.inside(x, y), supply.p, p)
    return p


def _looks(grid: Grid, side: int, corners: Sequence[int]) -> Array:
    """LOOKS places side by side in each cell along a side, and between the outermost ones and these corners, m."""
    low, high = grid.origin[side], grid.origin[side] + grid.lengths[side]
    around = grid.with_neighbours(side)
    faces = 0.5 * (around[1:] + around[:-1])
    if not grid.periodic[side]:
        faces = np.clip(faces, low, high)  # cells end at a wall
    ends = [(low, faces[0]) if j == 0 else (faces[-1], high) for j in corners]
    start, end = np.concatenate([np.column_stack([faces[:-1], faces[1:]]), np.reshape(ends, (-1, 2))]).T
    places = start[:, None] + (np.arange(LOOKS) + 0.5) / LOOKS * (end - start)[:, None]
    return low + np.remainder(places - low, high - low) if grid.periodic[side] else places


def flow_growth(problem: LubricationProblem) -> dict[str, float] | None:
    """By how much the flow out of each side grows when the spacings are halved, m3/s; None if it does not. Collective.

    At a corner of two sides whose pressures differ by dp, the flow from the one to the other is without bound: a distance r
    from the corner h^3/(12 mu) 2 dp/(pi r) passes, so that every halving adds h^3/(12 mu) (2 dp/pi) log 2. A supply that
    reaches a side of another pressure gives to it twice as much with every halving.
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
    for side, (name, p_side) in enumerate(zip(names, pressures, strict=True)):
        if problem.held is not None and p_side is not None:
            growth[name] += volume_unit(problem) * _reaching(problem, side, p_side)
    return growth if any(growth.values()) else None


def _reaching(problem: LubricationProblem, side: int, p_side: float) -> float:
    """What supplies that reach an open side, at p_side, give to it, in the scheme's units of flow. Collective."""
    grid, s, held = problem.grid, problem.scheme, problem.held
    assert held is not None  # as its caller asks for no others
    axis, place, conductance = side // 2, [grid.x, grid.y], (s.k_W, s.k_E, s.k_S, s.k_N)[side]
    place[axis] = np.full_like(place[axis], grid.origin[axis] + side % 2 * grid.lengths[axis])
    inside = [(held.owner == number) & supply.region.inside(*place) for number, supply in enumerate(held.supplies)]
    driven = sum(np.where(there, supply.p - p_side, 0.0) for there, supply in zip(inside, held.supplies, strict=True))
    return problem.reduce.sum(np.where(sides(grid)[side], conductance * driven / problem.p_unit, 0.0))
