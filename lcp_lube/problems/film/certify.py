"""What certifies a film's answer: how far it is from balance in every cell, from complementarity, from flow in = flow out."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...base.parallel import Array
from ..certificate import Certificate, certificate_tol
from ..strips import ghosted
from .graded import GradedJacobian, Pivots, within_reach
from .reynolds import BoxScheme, side_points
from .stored import storing
from .supplies import supply_defects, supply_flows

if TYPE_CHECKING:
    from .lubrication import LubricationProblem

UNIT = 2.0**-53  # largest relative error of one operation
IDLE = 1e-8  # share of what the pressures alone would drive through the sides, below which a flow is none
UNEVEN = 1e-4  # part of the flow that the rounding of pressures inside may make of a mass defect, at most
BLOCK = 16_384  # cells of a line that are looked at together
LEAST = 1e-200  # below any void or pressure
FINE = 1e-7  # of p_max: rounding that may leave less than this in p needs no closer look
CHECKS = 30  # sets of full cells that the closer look may try


def certify(problem: "LubricationProblem", p: Array, r: Array, eps1: float) -> Certificate:
    """Certificate of p (in p_unit) and r for a run whose tolerance was eps1. Collective.

    residual: ||A p + B r - c||, beyond what rounding of p and c makes of it, over ||A p|| + ||B r|| + ||c||; or, where that is
    more, the largest balance of one cell in parts of what would move its own pressure by max|p|, or its void by 1 (`worst`), or
    what a supply's restrictor and its film disagree by (`supply_defects`);
    complementarity: max_i |min(p_i / max|p|, r_i)|, which bounds negative p, negative r and products alike; where the wall
    drags more than the pressures could push, r counts as the pressure that would push as much (`void_scale`);
    mass_defect: |flow in - flow out| / flow, over the open sides (`mass_defect`);
    p_error: max|p - p*| / max p* where rounding may dominate what the others see (`p_error`).
    """
    red, s = problem.reduce, problem.scheme
    # The ends' pressure is the scale where a cavity leaves no point full.
    p_max, driven = max(red.largest(p), max(problem.p_sides) / problem.p_unit), red.norm(s.c)
    if not driven and not any(problem.p_sides):  # p = 0: what is left of it is measured by its unit
        p_max = max(p_max, 1.0)
    pressure, void, residual, diagonal, worst = misfits(problem, p, r, p_max)
    # Of p itself, which in a deep pocket is more than all that flows, and of c as a difference of the wall's flows.
    dragged = np.sqrt(red.sum(np.array([np.sum(np.square(part.b_C)) for _, part in problem.scheme.in_strips(problem.grid)])))
    rounding = 2 * UNIT * (diagonal + dragged)
    scale = pressure + void + driven
    if not driven:
        scale += red.norm(s.diagonal.ravel())
    over_all = np.maximum(residual - rounding, 0.0) / scale if scale != 0 else 0.0  # NaN stays NaN
    measures = {
        "residual": float(np.max([over_all, worst, *supply_defects(problem, supply_flows(problem, p, r))])),
        "complementarity": complementarity(problem, p, r, p_max),
        "mass_defect": mass_defect(problem, p, r),
    }
    if within_reach(problem.grid) and rounding_may_dominate(problem, p_max):
        measures["p_error"] = p_error(problem, p, r)
    return Certificate(
        measures,
        tol=certificate_tol(eps1),
        extremes={"min_p": red.min(p) * problem.p_unit, "min_r": red.min(r)},
    )


def complementarity(problem: "LubricationProblem", p: Array, r: Array, p_max: float) -> float:
    """As `certify` tells. Collective."""
    p, r = p.reshape(problem.grid.box), r.reshape(problem.grid.box)
    found = [
        np.max(np.abs(np.minimum(p[rows] / (p_max or 1.0), r[rows] / void_scale(s, p_max))))
        for rows, s in problem.scheme.in_strips(problem.grid)
    ]
    return problem.reduce.max(np.array(found))


def rounding_may_dominate(problem: "LubricationProblem", p_max: float) -> bool:
    """Whether rounding of the largest flows, in every cell, may move pressures behind the weakest film by FINE of p_max."""
    s, reduce, ends = problem.scheme, problem.reduce, problem.grid.ends
    along, across = (s.k_W, s.k_E), (s.k_S, s.k_N)
    ways = along if "open" in ends[0] or not across[0].any() else along + across
    weakest = reduce.min(np.array([np.min(k, where=k > 0, initial=np.inf) for k in ways]))
    wall = np.array([-np.min(part.b_C) for _, part in problem.scheme.in_strips(problem.grid)])
    largest = max(reduce.max(k) for k in along + across) * p_max + reduce.max(wall)
    return not UNIT * problem.size * largest <= FINE * weakest * p_max


def p_error(problem: "LubricationProblem", p: Array, r: Array) -> float:
    """How far p is from the solution's, in parts of the largest, beyond what the wall's flow rounded makes of it. Collective.

    A deep pocket may hang on flows that are 1e-16 of those in it: no sum over its cells sees that its pressure is wrong. The
    solution is what `Pivots` make of this answer. Films and voids are known to one rounding, and so is what the wall drags:
    where pressures are far below what it could build up, that may be all that they are.
    """
    reduce, scheme = problem.reduce, problem.scheme
    try:
        pivots = Pivots(problem, p, r)
        for _ in range(CHECKS):
            pivots.step()
            if not pivots.wrong:
                break
        else:
            return np.inf
        void = ~pivots.full * 1.0
        from_west = problem.grid.ghosted(void, outside=0.0)[1:-1, :-2]
        carried = -scheme.b_C.ravel() * void + (scheme.entering * from_west).ravel()
        rounded = 4 * UNIT * (2 * carried + (np.abs(scheme.couette_W) + np.abs(scheme.couette_E)).ravel())
        allowed = reduce.max(np.where(pivots.full, GradedJacobian(problem, pivots.full).solve(rounded), 0.0))
    except ZeroDivisionError:
        return np.inf
    off = float(np.maximum(reduce.max(np.abs(p - pivots.p)) - allowed, 0.0))  # NaN stays NaN
    largest = max(reduce.max(pivots.p), max(problem.p_sides) / problem.p_unit) or 1.0
    return off / largest


def void_scale(s: BoxScheme, p_max: float) -> Array:
    """The void that carries as much through a cell as p_max could push there, at most 1.

    It is 1 unless the pressures are far below what the wall could build up: beside such pressures a void of 1e-10, which is
    nothing to the wall's flow, may be all the flow that they drive.
    """
    with np.errstate(divide="ignore", over="ignore"):
        pushed = s.diagonal * p_max / -s.b_C
    return np.clip(pushed, LEAST, 1.0)


def misfits(problem: "LubricationProblem", p: Array, r: Array, p_max: float) -> tuple[float, float, float, float, float]:
    """||A p||, ||B r||, ||A p + B r - c|| and ||diag(A) p||, rows of A p as the sums of their face flows, and the worst cell.

    Collective.
    """
    reduce, nx, nothing = problem.reduce, problem.grid.box[1], np.zeros((0, 0), dtype=bool)
    framed = [ghosted(problem.grid, field, 0.0) for field in (p, r)]
    squares, worst = np.zeros(4), 0.0
    for rows, s in problem.scheme.in_strips(problem.grid):  # so that what lies between is no more than the cache holds
        frames = [frame(rows) for frame in framed]
        owned = (s.k_W, s.k_E, s.k_S, s.k_N, s.b_C, s.entering, s.c, nothing if s.held is None else s.held)
        for i in range(0, nx, BLOCK):
            arrays = [*(a[:, i : i + BLOCK + 2] for a in frames), *(a[:, i : i + BLOCK] for a in owned)]
            *sums, off = cell_misfits(*arrays, p_max)  # type: ignore[arg-type, call-arg]
            squares, worst = squares + sums, np.maximum(worst, off)  # NaN stays NaN
    norms = [float(np.sqrt(reduce.sum(np.array([square])))) for square in squares]
    return *norms, reduce.max(np.array([worst]))  # type: ignore[return-value]


def cell_misfits(
    p: Array,
    r: Array,
    k_W: Array,
    k_E: Array,
    k_S: Array,
    k_N: Array,
    b_C: Array,
    b_W: Array,
    c: Array,
    held: NDArray[np.bool_],
    p_max: float,
) -> tuple[float, float, float, float, float]:
    """Sums of the squares of A p, B r, A p + B r - c and diag(A) p over some cells, and the worst one.

    p and r have a frame of neighbours. A cell's misfit, beyond the rounding of its own terms, is at least its diagonal times
    the change of p that mends it: it is told in parts of that for p_max, and where the cell is cavitated, of b_C if that is
    less. The norms cannot see a film that is thin, or pressures next to nothing, beside flows that are large.
    """
    here, void_here, entering = p[1:-1, 1:-1], r[1:-1, 1:-1], b_W * r[1:-1, :-2]
    around = (p[1:-1, :-2], p[1:-1, 2:], p[:-2, 1:-1], p[2:, 1:-1])
    if held.size:
        around = tuple(np.where(held, 0.0, beside) for beside in around)  # type: ignore[assignment]
    pairs = tuple(zip((k_W, k_E, k_S, k_N), around, strict=True))
    a, k, own = sum(k * (here - beside) for k, beside in pairs), k_W + k_E + k_S + k_N, b_C * void_here
    b, left = own + entering, a + own + entering - c
    terms = k * np.abs(here) + sum(k * np.abs(beside) for k, beside in pairs)
    excess = np.abs(left) - 8 * UNIT * (terms + np.abs(b_C) + np.abs(b_W) + np.abs(c))
    moved = np.where(here < void_here * p_max, np.minimum(k * p_max, -b_C), k * p_max if p_max > 0 else -b_C)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        worst = np.where(excess > 0, np.where(moved > 0, excess / moved, np.inf), 0.0)
    squares = [float(np.sum(np.square(term))) for term in (a, b, left, k * here)]
    return *squares, float(np.max(worst, initial=0.0))  # type: ignore[return-value]


def mass_defect(problem: "LubricationProblem", p: Array, r: Array) -> float:
    """|flow in - flow out| over the open sides, beyond what rounding makes of it, in parts of the flow. Collective.

    The flow is the largest of what comes in, of what the wall drags through every cross-section of the film, also if
    nothing comes in, and of IDLE times what the pressures would drive through the sides' and supplies' cells alone: below
    this the flows are differences of pressures that are equal to as many digits as a solve has. Rounding is that of the sums
    here, and of p inside, where the conductances may be 1e9 times the sides' (up to UNEVEN parts of the flow).
    """
    s, reduce, grid = problem.scheme, problem.reduce, problem.grid
    flows = west, east, south, north = problem.boundary_flows(p, r)
    # Halves of these in m3/s, as are the supplies' flows.
    supplied = [2.0 * flow / (grid.spacing[1] if grid.dim == 2 else 1.0) for flow in supply_flows(problem, p, r)]
    net = abs(west - east + south - north + sum(supplied) - storing(problem, r))
    inflow = max(west, 0.0) + max(-east, 0.0) + max(south, 0.0) + max(-north, 0.0) + sum(max(q, 0.0) for q in supplied)
    driven = reduce.norm(s.c) > 0  # or else p = 0, and p_unit measures what is left of it
    own, above = p.reshape(grid.box), 0.0 if driven else 1.0
    least, inside, in_held = np.inf, 0.0, 0.0
    for rows, part in problem.scheme.in_strips(problem.grid):
        least, terms = np.minimum(least, -np.max(part.b_E)), part.diagonal * (np.abs(own[rows]) + above)
        inside += float(np.sum(terms))
        in_held += 0.0 if part.held is None else float(np.sum(terms[part.held]))
    dragged = s.flow_unit * (reduce.min(np.array([least])) if problem.U else 0.0) * (grid.shape[1] if grid.dim == 2 else 1)
    pressed = 0.0
    for k, points, side in zip((s.k_W, s.k_E, s.k_S, s.k_N), side_points(grid), problem.p_sides, strict=True):
        pressed += s.flow_unit * reduce.sum(k[points] * (np.abs(own[points]) + above + side / problem.p_unit))
    pressed += s.flow_unit * reduce.sum(np.array([in_held]))
    flow = max(inflow, dragged, IDLE * pressed if driven else pressed)
    if s.storage is not None:  # in the middle of a stroke nothing flows: rounding is measured by what is stored
        held = s.flow_unit * reduce.sum(s.storage)
        flow = max(flow, abs(storing(problem, r)), certificate_tol(0.0) * held)
        pressed += held
    inside = UNIT * s.flow_unit * reduce.sum(np.array([inside]))
    rounding = 8 * UNIT * (pressed + sum(map(abs, [*flows, *supplied]))) + min(inside, UNEVEN * flow)
    excess = net - rounding  # NaN stays NaN
    return 0.0 if excess <= 0 else excess / flow if flow != 0 else np.inf
