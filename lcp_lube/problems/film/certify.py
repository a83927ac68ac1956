"""What certifies a film's answer: how far it is from balance in every cell, from complementarity, from flow in = flow out."""

from collections.abc import Sequence
from copy import copy
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...base.compiled import has_numba
from ...base.parallel import Array
from ..certificate import Certificate, certificate_tol
from ..strips import each_strip, ghosted
from .flows import volume_unit
from .graded import Pivots, within_reach
from .reynolds import side_points
from .stored import storing
from .strip import by_lines, frames
from .supplies import pressed, supply_flows

if TYPE_CHECKING:
    from .lubrication import LubricationProblem

UNIT = 2.0**-53  # largest relative error of one operation
IDLE = 1e-8  # share of what the pressures alone would drive through the sides, below which a flow is none
ROUNDINGS = 64  # of 2^-53 in a supply's flows
UNEVEN = 1e-4  # part of the flow that the rounding of pressures inside may make of a mass defect, at most
BLOCK = 16_384  # cells of a line that are looked at together
LEAST = 1e-200  # below any void or pressure
FINE = 1e-7  # of p_max: rounding that may leave less than this in p needs no closer look
CHECKS = 30  # sets of full cells that the closer look may try


class Misfits(NamedTuple):
    """What `misfits` reads off all cells in one pass.

    pressure, void, residual, diagonal : ||A p||, ||B r||, ||A p + B r - c|| and ||diag(A) p||, rows of A p as the sums of their
        face flows. dragged : ||b_C||. worst : the worst cell. gap : the complementarity. inside : sum of diag(A) (|p| + above).
    least : void that a cell hands on to the east, at least.
    """

    pressure: float
    void: float
    residual: float
    diagonal: float
    dragged: float
    worst: float
    gap: float
    inside: float
    least: float


def certify(problem: "LubricationProblem", p: Array, r: Array, eps1: float, closely: bool = True) -> Certificate:
    """Certificate of p (in p_unit) and r for a run whose tolerance was eps1. Collective.

    residual: ||A p + B r - c||, beyond what rounding of p and c makes of it, over ||A p|| + ||B r|| + ||c||; or, where that is
    more, the largest balance of one cell in parts of what would move its own pressure by max|p|, or its void by 1 (`worst`), or
    what a supply's restrictor and its film disagree by (`supply_defects`);
    complementarity: max_i |min(p_i / max|p|, r_i)|, which bounds negative p, negative r and products alike; where the wall
    drags more than the pressures could push, r counts as the pressure that would push as much (`pushed`);
    mass_defect: |flow in - flow out| / flow, over the open sides (`mass_defect`);
    p_error: max|p - p*| / max p* where rounding may dominate what the others see (`p_error`); NaN there if not `closely`, as it
    may take seconds.
    """
    problem = filled(problem, p)
    red, s = problem.reduce, problem.scheme
    # The ends' pressure is the scale where a cavity leaves no point full.
    (low, high), driven = red.extremes(p), red.norm(s.c)
    p_max = max(float(np.maximum(-low, high)), max(problem.p_sides) / problem.p_unit)
    if not driven and not any(problem.p_sides):  # p = 0: what is left of it is measured by its unit
        p_max = max(p_max, 1.0)
    found, supplied = misfits(problem, p, r, p_max, 0.0 if driven else 1.0), supply_flows(problem, p, r)
    # Of p itself, which in a deep pocket is more than all that flows, and of c as a difference of the wall's flows.
    rounding = 2 * UNIT * (found.diagonal + found.dragged)
    scale = found.pressure + found.void + driven
    if not driven:
        scale += red.norm(s.diagonal.ravel())
    over_all = np.maximum(found.residual - rounding, 0.0) / scale if scale != 0 else 0.0  # NaN stays NaN
    measures = {
        "residual": float(np.max([over_all, found.worst, *supply_defects(problem, supplied)])),
        "complementarity": found.gap,
        "mass_defect": mass_defect(problem, p, r, supplied, found, driven > 0.0),
    }
    if within_reach(problem.grid) and rounding_may_dominate(problem, p_max):
        measures["p_error"] = p_error(problem, p, r) if closely else np.nan
    return Certificate(
        measures,
        tol=certificate_tol(eps1),
        extremes={"min_p": low * problem.p_unit, "min_r": red.min(r)},
    )


def filled(problem: "LubricationProblem", p: Array) -> "LubricationProblem":
    """The problem whose cells store what they do at p, whatever the pressure: it has the same answer."""
    s = problem.scheme
    if s.gives is None or s.storage is None:
        return problem
    more = s.gives * p.reshape(problem.grid.box)
    other = copy(problem)
    other.scheme = s.changed(storage=s.storage + more, b_C=s.b_C - more, c=s.c - more, gives=None)
    if problem.held is not None:
        other.scheme = pressed(other.scheme, problem.held, problem.p_unit)
    return other


def rounding_may_dominate(problem: "LubricationProblem", p_max: float) -> bool:
    """Whether rounding of the largest flows, in every cell, may move pressures behind the weakest film by FINE of p_max."""
    reduce, grid = problem.reduce, problem.grid
    ways = 2 if "open" in grid.ends[0] or not problem.scheme.k_S.any() else 4

    def look_at(rows: slice) -> tuple[Any, ...]:
        s = problem.scheme.rows(rows)
        k = s.k_W, s.k_E, s.k_S, s.k_N
        weakest = np.min([np.where(one > 0, one, np.inf).min() for one in k[:ways]])
        return weakest, np.max([np.max(one) for one in k[: 2 * grid.dim]]), -np.min(s.b_C)

    weakest, most, dragged = (np.array(found) for found in zip(*each_strip(grid, look_at), strict=True))
    largest = reduce.max(most) * p_max + reduce.max(dragged)
    return not UNIT * problem.size * largest <= FINE * reduce.min(weakest) * p_max


def p_error(problem: "LubricationProblem", p: Array, r: Array) -> float:
    """How far p is from the solution's, in parts of the largest, beyond what the wall's flow rounded makes of it. Collective.

    A deep pocket may hang on flows that are 1e-16 of those in it: no sum over its cells sees that its pressure is wrong. The
    solution is what `Pivots` make of this answer. Films and voids are known to one rounding, and so is what the wall drags:
    where pressures are far below what it could build up, that may be all that they are.
    """
    if surely_empty(problem, p, r):
        return 0.0
    reduce = problem.reduce
    try:
        pivots = Pivots(problem, p, r, noisy=True)
        for _ in range(CHECKS):
            pivots.step()
            if not pivots.wrong:
                break
        else:
            return np.inf
    except ZeroDivisionError:
        return np.inf
    off = float(np.maximum(reduce.max(np.abs(p - pivots.p)) - reduce.max(pivots.noise), 0.0))  # NaN stays NaN
    largest = max(reduce.max(pivots.p), max(problem.p_sides) / problem.p_unit) or 1.0
    return off / largest


def surely_empty(problem: "LubricationProblem", p: Array, r: Array) -> bool:
    """Whether p = 0, and no void is so small that the balance's defects, all carried to it, would fill it: then the exact voids
    are positive, too, and no pressure anywhere is the solution. Collective.

    By columns of B, b_i |r_i - r*_i| is at most the sum of the defects upstream; on a ring there is no upstream.
    """
    if problem.grid.periodic[0] or problem.reduce.largest(p):
        return False
    s = problem.scheme
    stored = -s.b_C.ravel() * r
    rounding = 4 * UNIT * (stored + np.abs(s.couette_W).ravel() + np.abs(s.couette_E).ravel())
    return problem.reduce.sum(np.abs(problem.balance(p, r)) + rounding) < problem.reduce.min(stored)


def misfits(problem: "LubricationProblem", p: Array, r: Array, p_max: float, above: float = 0.0) -> Misfits:
    """Sums and extremes over all cells. Collective."""
    reduce, grid, nx, nothing = problem.reduce, problem.grid, problem.grid.box[1], np.zeros((0, 0), dtype=bool)
    framed = [ghosted(grid, field, 0.0) for field in (p, r)]
    many = problem.held is None and grid.size >= problem.many and has_numba()
    if many:
        from .cell_loops import loop_misfits

        s = problem.scheme
        whole = frames(s.k_W, s.k_E, s.k_S, s.k_N, s.c)
    sums, most, least = np.zeros(6), np.zeros(2), np.inf

    def look_at(rows: slice) -> list[tuple[Any, ...]]:
        s = problem.scheme.rows(rows)
        fields = [frame(rows) for frame in framed]  # numbers side by side, as loops want them
        if many:
            kx, ky, c = whole
            given = (*fields, kx, ky, by_lines(s, "b_C"), by_lines(s, "b_W"), c, p_max, above, rows.start)
            found = [loop_misfits(*given, i, min(i + BLOCK, nx)) for i in range(0, nx, BLOCK)]  # type: ignore[call-arg, arg-type]
        else:
            owned = (s.k_W, s.k_E, s.k_S, s.k_N, s.b_C, s.entering, s.c, nothing if s.held is None else s.held)
            parts = (
                [*(a[:, i : i + BLOCK + 2] for a in fields), *(a[:, i : i + BLOCK] for a in owned)] for i in range(0, nx, BLOCK)
            )
            found = [cell_misfits(*arrays, p_max, above) for arrays in parts]  # type: ignore[arg-type, call-arg]
        return list(found) if s.storage is None else [(*own, -np.max(s.b_C + s.storage)) for *own, _ in found]

    for found in each_strip(grid, look_at):  # so that what lies between is no more than the cache holds
        for own, largest, low in found:
            sums, most, least = sums + own, np.maximum(most, largest), np.minimum(least, low)  # NaN stays NaN
    *squares, inside = (reduce.sum(np.array([part])) for part in sums)
    worst, gap = (reduce.max(np.array([part])) for part in most)
    pressure, void, residual, diagonal, dragged = np.sqrt(squares).tolist()
    return Misfits(pressure, void, residual, diagonal, dragged, worst, gap, inside, reduce.min(np.array([least])))


def cell_misfits(p: Array, r: Array, *given: Any) -> tuple[Array, Array, float]:
    """Of some cells the sums of the squares of A p, B r, A p + B r - c, diag(A) p and b_C, and of diag(A) (|p| + above), the
    largest of `worst` and `gap`, and the least -b_C. p and r have a frame; given : as to `cell_loops.loop_misfits`."""
    *owned, held, p_max, above = given
    here, void = p[1:-1, 1:-1], r[1:-1, 1:-1]
    around = (p[1:-1, :-2], p[1:-1, 2:], p[:-2, 1:-1], p[2:, 1:-1])
    if held.size:
        around = tuple(np.where(held, 0.0, beside) for beside in around)  # type: ignore[assignment]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        found = cell_misfit(np.where, here, *around, void, r[1:-1, :-2], *owned, p_max, above)  # type: ignore[call-arg]
    *squared, inside, worst, gap = found
    sums = [float(np.sum(np.square(term))) for term in squared]
    most = np.array([np.max(worst, initial=0.0), np.max(gap, initial=0.0)])
    return np.array([*sums, float(np.sum(inside))]), most, -np.max(owned[4])


def cell_misfit(
    where: Any, here: Any, west: Any, east: Any, south: Any, north: Any, void: Any, void_west: Any,
    k_W: Any, k_E: Any, k_S: Any, k_N: Any, b_C: Any, b_W: Any, c: Any, p_max: float, above: float,
) -> tuple[Any, ...]:  # fmt: skip
    """Of arrays, or in `cell_loops` of one cell: A p, B r, A p + B r - c, diag(A) p, b_C, diag(A) (|p| + above), worst and gap.

    A cell's misfit, beyond the rounding of its own terms, is at least its diagonal times the change of p that mends it: `worst`
    tells it in parts of that for p_max, and where the cell is cavitated, of b_C if that is less. The norms cannot see a film
    that is thin, or pressures next to nothing, beside flows that are large. gap : as `certify` tells of complementarity.
    """
    k, entering = k_W + k_E + k_S + k_N, b_W * void_west
    a = k_W * (here - west) + k_E * (here - east) + k_S * (here - south) + k_N * (here - north)
    b = b_C * void + entering
    left, size = a + b - c, k * np.abs(here)
    beside = k_W * np.abs(west) + k_E * np.abs(east) + k_S * np.abs(south) + k_N * np.abs(north)
    excess = np.abs(left) - 8 * UNIT * (size + beside + np.abs(b_C) + np.abs(b_W) + np.abs(c))
    moved = where(here < void * p_max, np.minimum(k * p_max, -b_C), k * p_max if p_max > 0 else -b_C)
    worst = where(excess > 0, where(moved > 0, excess / moved, np.inf), 0.0)
    # The void that carries as much through a cell as p_max could push there: 1, unless the pressures are far below what the
    # wall could build up. Beside such pressures a void of 1e-10, nothing to the wall's flow, may be all that they drive.
    pushed = np.minimum(np.maximum(k * p_max / -b_C, LEAST), 1.0)
    gap = np.abs(np.minimum(here / (p_max or 1.0), void / pushed))
    return a, b, left, k * here, b_C, size + k * above, worst, gap


def supply_defects(problem: "LubricationProblem", flows: Sequence[float]) -> list[float]:
    """What each source gives and the film takes differ by, as `Supply.defect` tells; 0 where p is given. Collective.

    flows : of `supply_flows`. A part of what the pressures drive through a supply's own faces is next to nothing.
    """
    held, s = problem.held, problem.scheme
    if held is None or not any(one.open for one in held.supplies):
        return []
    unit, P = volume_unit(problem), np.array([one.p for one in held.supplies])
    P = P if held.law is None else held.law.pressure(P)
    moved = unit * (s.diagonal * held.pressures(problem.p_unit) + np.abs(s.couette_W) + np.abs(s.couette_E))
    pressed = [problem.reduce.sum(np.where(held.owner == k, moved, 0.0)) for k in range(len(flows))]
    largest = max(map(abs, [*flows, *(one.flow or 0.0 for one in held.supplies)]))
    return [
        one.defect(p, flow, largest, IDLE * by, ROUNDINGS * UNIT * by) if one.open else 0.0
        for one, p, flow, by in zip(held.supplies, P.tolist(), flows, pressed, strict=True)
    ]


def mass_defect(
    problem: "LubricationProblem", p: Array, r: Array, supplies: Sequence[float], found: Misfits, driven: bool
) -> float:
    """|flow in - flow out| over the open sides, beyond what rounding makes of it, in parts of the flow. Collective.

    The flow is the largest of what comes in, of what the wall drags through every cross-section of the film, also if
    nothing comes in, and of IDLE times what the pressures would drive through the sides' and supplies' cells alone: below
    this the flows are differences of pressures that are equal to as many digits as a solve has. Rounding is that of the sums
    here, and of p inside, where the conductances may be 1e9 times the sides' (up to UNEVEN parts of the flow).
    """
    s, reduce, grid = problem.scheme, problem.reduce, problem.grid
    flows = west, east, south, north = problem.boundary_flows(p, r)
    # Halves of these in m3/s, as are the supplies' flows.
    supplied = [2.0 * flow / (grid.spacing[1] if grid.dim == 2 else 1.0) for flow in supplies]
    net = abs(west - east + south - north + sum(supplied) - storing(problem, p, r))
    inflow = max(west, 0.0) + max(-east, 0.0) + max(south, 0.0) + max(-north, 0.0) + sum(max(q, 0.0) for q in supplied)
    own, above = p.reshape(grid.box), 0.0 if driven else 1.0  # without c p = 0, and p_unit measures what is left of it
    dragged = s.flow_unit * (found.least if problem.U else 0.0) * (grid.shape[1] if grid.dim == 2 else 1)
    pressed = 0.0
    for k, points, side in zip((s.k_W, s.k_E, s.k_S, s.k_N), side_points(grid), problem.p_sides, strict=True):
        pressed += s.flow_unit * reduce.sum(k[points] * (np.abs(own[points]) + above + side / problem.p_unit))
    if s.held is not None:
        pressed += s.flow_unit * reduce.sum(np.where(s.held, s.diagonal * (np.abs(own) + above), 0.0))
    flow = max(inflow, dragged, IDLE * pressed if driven else pressed)
    if s.storage is not None:  # in the middle of a stroke nothing flows: rounding is measured by what is stored
        held = s.flow_unit * reduce.sum(s.storage)
        flow = max(flow, abs(storing(problem, p, r)), certificate_tol(0.0) * held)
        pressed += held
    rounding = 8 * UNIT * (pressed + sum(map(abs, [*flows, *supplied]))) + min(UNIT * s.flow_unit * found.inside, UNEVEN * flow)
    excess = net - rounding  # NaN stays NaN
    return 0.0 if excess <= 0 else excess / flow if flow != 0 else np.inf
