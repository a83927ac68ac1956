"""The grids of a run to an accuracy, coarse to fine, until the estimated relative error of a quantity is below a tolerance."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import count
from math import inf, isfinite, prod
from time import perf_counter
from typing import Any

import numpy as np

from ...base.progress import of_ladder
from ...problems.film.model import Model
from ...problems.film.rims import depth_of
from ...problems.grid import OFFSET
from ...problems.solution import Outcome, Solution
from ...registry import ELIMINATED, METHODS
from ...scenes.moving import film_of, motion_of
from ...scenes.scene import Solvable
from ...solvers.newton import Stopping
from ..ask import Ask
from ..chain import added
from ..compose import Inner
from ..plan import FEW, SMALL
from ..warm import seeks
from .accuracy import DEFAULT_QUANTITY, WHOLE, find_value
from .estimate import INTEGRALS, given_film, is_known
from .room import no_room
from .rungs import ASYMPTOTIC, finer, first_rung, first_shape, round_ring, rungs_up
from .values import Values, carried, sought

FEW_KNOWN = 128  # points of the first grid of a line whose number is known: no coarser grid is cheaper
FEW_PAIRS = 200  # of a film whose load is estimated from each two grids: these are solved by elimination
FEW_SLANTED = 1000  # of one with edges across the lines: coarser grids have strips of a cell or two
SHARE = 0.2  # of the scene's points that the first grid of a march has at least: its steps, in proportion, see what moves it
ALGEBRAIC = 1e-3  # ||F|| relative to the tolerance: with many small cavities it leaves up to 60 times itself in a load
CAVITIES = 1e-2  # ||F|| at which cavities are known well enough for round edges: of 46 loads 9 in 10 move by 1e-6 at most
FIRST = 1e-2  # the same of a first grid that tells nothing by itself
SOON = 3e-3  # a tolerance below which most films in 2D end on grids for multigrid
TWICE = 20_000  # as `WHOLE`, by multigrid, of a film that is solved twice
HOPELESS = 1_000_000  # points on which an estimate that has not come down is taken to stay up
PATIENCE = 6  # grids without a better estimate: rounding dominates
BLANK = 3  # grids without a value: a finer one is not expected to have it
RELATIVE_NORM = ("active-set", "fas")  # methods that measure ||F|| relative to the data


def solve(scene: Solvable, ask: Ask, inner: Inner) -> Solution:
    """Solve a scene on finer and finer grids until a quantity is good to a tolerance, and no further. Collective.

    The tolerances of the nonlinear iteration are by default no tighter than that needs.

    Returns
    -------
    Solution : on the last grid. The quantity among its numbers is the best value: this grid's, or the one extrapolated from all
        (settings['accuracy_extrapolated']; 'accuracy_grid_value' is the grid's own). settings['accuracy_estimate'] is its
        estimated relative error, `estimates` has value, error (in its unit) and extrapolated of all numbers, `levels` every
        grid with its own value and the estimate. Where grids end before the estimate is below the tolerance: outcome ACCURACY.

    Raises
    ------
    InputError : no such quantity, a tolerance that no memory can hold; and what the inner solves raise.
    """
    tol, quantity, finest = ask.accuracy, ask.quantity, ask.finest
    assert tol is not None
    begin = perf_counter()
    fewest = model.fewest_meshes() if (model := film_of(scene)) is not None else ()
    line = is_known(scene)
    in_time = motion_of(scene)
    first_order = model is not None and (model.scheme == "upwind" or model.mean_cubes)
    order = 1.0 if first_order or (in_time is not None and in_time.scheme == "euler") else 2.0
    # Of the load in the plane each two grids give an estimate (`estimate.of_pair`).
    pairs = quantity in (None, *INTEGRALS) and len(scene.shape) == 2 and order > 1.0 and given_film(scene) is not None
    rims, corners = (model.cut, model.cornered) if model is not None else (False, False)
    if slanted := rims and any(map(depth_of, model.gap.rims)):  # type: ignore[union-attr]
        pairs = False  # two grids that agree on where edges lie say nothing of others
    if line or pairs:
        few: int | None = FEW_KNOWN if line else FEW_PAIRS
    else:
        few = int(SHARE * prod(scene.shape)) if in_time is not None else FEW_SLANTED if slanted else None
    first = first_shape(scene.shape, fewest, finest, few)
    pairs = pairs and first == first_shape(scene.shape, (), finest, few)  # else its cells are as wide as what they show
    first, unit = round_ring(scene, first, finest)
    kinds = [model.sides[2 * k : 2 * k + 2] if isinstance(model, Model) else () for k in range(len(first))]
    meshes = [n + 1.0 - sum(1.0 - OFFSET[side.kind] for side in ends) for n, ends in zip(first, kinds, strict=True)]
    ring = any(side.kind == "periodic" for ends in kinds for side in ends)
    ranks = ask.mpi.size
    rung = next(k for k in count() if ranks == 1 or finer(first, meshes, k, unit)[-1] >= 2 * ranks)
    if line and first[0] < FEW_KNOWN and (finest is None or finer(first, meshes, rung + 1, unit)[0] <= finest[0]):
        rung += 1
    narrow = any(n + 1 < 2 * least for n, least in zip(first, fewest, strict=False))
    later = first_rung(tol, narrow) if pairs else 0
    most = finest or (inf,) * len(first)
    if all(n <= end for n, end in zip(finer(first, meshes, rung + later + 2, unit), most, strict=True)):
        rung += later
    shape = finer(first, meshes, rung, unit)
    solution: Solution | None = None
    before: Solution | None = None
    told = Values(line, pairs, ALGEBRAIC * tol, rims, corners, slanted, order)
    levels: list[dict[str, Any]] = []
    times: dict[str, float] = {}
    # A program that goes on loads multigrid's loops once; for one run they pay where its last grid will be one for multigrid
    # (second order: points as 1/error), and serve those before it too.
    plane, seeking = len(first) == 2, seeks(scene, ask)
    end, loops = "", ask.direct_below is None or (plane and tol < SOON)
    while not end:
        level_begin, before, earlier = perf_counter(), solution, before
        near = ask.start if before is None else _start(before, prod(shape), seeking) if ask.nested is not False else None
        stopping = _stopping(ask, tol, before) if before is not None or (pairs and not ring) else ask.stopping
        least = WHOLE[loops if before is None else before.asked == "fas"]
        halved = ask.reduction and (not plane or prod(shape) > (min(least, TWICE) if rims or corners else least))
        loose = CAVITIES if stopping is not ask.stopping else None
        enough = {"stopping": stopping, "cavities": loose, "digits": ALGEBRAIC * tol}
        this = replace(ask, accuracy=None, start=near, nested=False, reduction=halved, **enough)  # type: ignore[arg-type]
        by_loops = loops and (plane or (line and shape[0] <= ELIMINATED))
        solution = inner(scene.refined(shape), replace(this, direct_below=0) if by_loops else this)
        problem = solution.problem
        sure = quantity or (DEFAULT_QUANTITY[0] if pairs or line else "")
        value = carried(problem, solution.fields, sure)
        if value is not None:
            quantity = sure
        else:
            found = {**sought(solution), **solution.numbers}  # what is sought is the number where the load is given
            quantity = quantity or next((name for name in (*sought(solution), *DEFAULT_QUANTITY) if name in found), "")
            value = find_value(found, quantity, scene)
        told.add(solution, before, earlier, prod(problem.grid.meshes) ** (1.0 / len(first)), quantity, value)
        if earlier is not None:
            earlier.destroy()
        loops = loops or (plane and inf > told.relative > 3 * FEW / problem.grid.size * tol)
        levels.append(
            {
                **dict(zip(("nx", "ny"), problem.grid.shape, strict=False)),
                "iterations": solution.iterations,
                "linear_iterations": solution.total("linear_iterations"),
                "time_s": perf_counter() - level_begin,
                "value": value if solution.converged else np.nan,
                "estimate": told.relative,
            }
        )
        values, estimates, seconds = ([level[name] for level in levels] for name in ("value", "estimate", "time_s"))
        ask.tell("accuracy", f"{quantity} to {told.relative:.0e}", of_ladder(seconds, told.relative, tol, 2.0 ** len(shape)))
        times = added(times, solution.times)
        end = _end(estimates, values, tol, problem.grid.size)
        rounding = _rounding(solution) if problem.kind == "lubrication" and quantity in INTEGRALS else 0.0
        if not end and len(values) > 1 and max(*map(abs, values), told.largest) <= rounding:  # NaN is not
            noise = f"below {rounding:.0e} N, which is rounding beside what wall and sides could carry"
            end = f"it is {noise if rounding else 0}"
        ups = 0 if end else rungs_up(estimates, tol, told.line is not None, len(first), pairs)
        for up in range(ups, 0, -1):
            shape = finer(first, meshes, rung + up, unit)
            if not (end := no_room(solution, shape, finest, told.relative, tol)):
                rung += up
                break
    if before is not None:
        before.destroy()
    assert solution is not None and quantity is not None  # for the type checker: there is a first grid
    if solution.converged and not told.relative <= tol:
        solution.outcome = Outcome.ACCURACY
        known = f"{quantity} to {told.relative:.1e} only" if isfinite(told.relative) else f"{quantity}'s error is not known"
        solution.message = f"{known}, {tol:g} was asked for: {end}"
    solution.settings |= {
        "accuracy": tol,
        "accuracy_quantity": quantity,
        "accuracy_estimate": told.relative,
        "accuracy_extrapolated": told.best.extrapolated,
        "accuracy_grid_value": value if solution.converged or solution.outcome is Outcome.ACCURACY else None,
    }
    solution.told_by = told
    if "numbers" in vars(solution):
        told.tell(solution, solution.numbers)
    solution.because(*ladder(levels, quantity, tol), after=True)
    solution.levels = levels
    solution.times = {**times, "total": perf_counter() - begin}
    return solution


def ladder(levels: list[dict[str, Any]], quantity: str, tol: float) -> list[str]:
    """The grids as lines of text: grid, value, estimate, seconds."""
    lines = [f"accuracy: {quantity} to {tol:g}", f"{'grid':>12}  {quantity:>16}  estimate  seconds"]
    for level in levels:
        grid = " x ".join(str(level[side]) for side in ("nx", "ny") if side in level)
        estimate = f"{level['estimate']:.1e}" if isfinite(level["estimate"]) else "-"
        lines.append(f"{grid:>12}  {level['value']:16.9g}  {estimate:>8}  {level['time_s']:7.3f}")
    return lines


def _end(estimates: Sequence[float], values: Sequence[float], tol: float, points: int) -> str:
    """Why this grid is the last one; empty if it is not."""
    if estimates[-1] <= tol:
        return "reached"
    if len(values) >= BLANK and np.isnan(values[-BLANK:]).all():
        return f"no value on the last {BLANK} grids"
    best = int(np.argmin(estimates))
    # A film with a layer thinner than these grids stays far off for long, and then converges.
    settled = estimates[best] < ASYMPTOTIC or points > HOPELESS
    if settled and len(estimates) - best > PATIENCE:
        return f"{PATIENCE} finer grids gave no better estimate than {estimates[best]:.1e}"
    return ""


def _rounding(solution: Solution) -> float:
    """What rounding of the flows may make of an integral of the pressure, N: all that some films carry. Collective.

    A line's oil settles with its pressures, which leaves some more.
    """
    problem: Any = solution.problem
    mu, least = float(np.max(problem.mu)), problem.reduce.min(problem.scheme.h.ravel())
    wall = 6.0 * mu * abs(problem.U) * problem.grid.lengths[0] / least**2
    inside = problem.reduce.largest(solution.fields["p"])  # a supply may hold more than the sides do
    share = 1e-13 if problem.grid.dim == 1 else 30.0 * np.finfo(float).eps
    return float(share * max(wall, inside, *problem.p_sides) * prod(problem.grid.lengths))


def _stopping(ask: Ask, tol: float, before: Solution | None) -> Stopping | Mapping[str, Any] | None:
    """The tolerances given, filled up for a method whose ||F|| is relative to the data: no tighter than `tol` needs."""
    given = ask.stopping
    if isinstance(given, Stopping) or (before.asked if before is not None else ask.method) not in ("auto", *RELATIVE_NORM):
        return given
    if before is not None and (before.problem.kind != "lubrication" or any(before.problem.grid.periodic)):
        return given  # what feeds a ring is a small part of what goes round: its balance needs digits
    part = ALGEBRAIC if before is not None else FIRST
    return {"eps1": float(np.clip(part * tol, 1e-12, 1e-4)), "eps2": inf, **(given or {})}


def _start(before: Solution | None, points: int, seeking: bool) -> Solution | None:
    """What the next grid starts from, where that pays: a small film is solved as soon from nothing; a search goes on."""
    if before is None or before.outcome in (Outcome.NOT_FINITE, Outcome.LINEAR_SOLVER):
        return None
    if seeking and before.converged:
        return before
    if before.problem.kind == "lubrication" and points <= SMALL:
        return None
    entry = METHODS.get(before.asked)  # a film in which nothing happens is solved by no method
    return before if entry is not None and entry.of(before.problem.kind).nested else None
