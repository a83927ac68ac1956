"""The grids of a run to an accuracy, coarse to fine, until the estimated relative error of a quantity is below a tolerance."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import inf, isfinite, prod
from time import perf_counter
from typing import Any

import numpy as np

from ...base.progress import of_ladder
from ...problems.solution import Outcome, Solution
from ...registry import ELIMINATED, METHODS
from ...scenes.scene import Solvable
from ...solvers.newton import Stopping
from ..ask import Ask
from ..chain import added
from ..compose import Inner
from ..plan import FEW, SMALL
from .accuracy import DEFAULT_QUANTITY, WHOLE, find_value
from .course import Course, course_of
from .estimate import INTEGRALS
from .room import no_room
from .rungs import ASYMPTOTIC, rungs_up
from .values import Values, carried, sought

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
    tol, begin = ask.accuracy, perf_counter()
    assert tol is not None
    course = course_of(scene, ask)
    told, quantity, rung, end = Values(course.film, ALGEBRAIC * tol), ask.quantity, course.begin, ""
    solution: Solution | None = None
    before: Solution | None = None
    levels: list[dict[str, Any]] = []
    times: dict[str, float] = {}
    # A program that goes on loads multigrid's loops once; for one run they pay where its last grid will be one for multigrid
    # (second order: points as 1/error), and serve those before it too.
    loops = ask.direct_below is None or (course.plane and tol < SOON)
    while not end:
        level_begin, before, earlier = perf_counter(), solution, before
        shape = course.shape(rung)
        solution = inner(scene.refined(shape), _ask(ask, course, shape, before, loops))
        problem, times = solution.problem, added(times, solution.times)
        quantity, value = _value(solution, quantity, course, scene)
        told.add(solution, before, earlier, prod(problem.grid.meshes) ** (1.0 / problem.grid.dim), quantity, value)
        if earlier is not None:
            earlier.destroy()
        loops = loops or (course.plane and inf > told.relative > 3 * FEW / problem.grid.size * tol)
        levels.append(_level(solution, value, told.relative, perf_counter() - level_begin))
        values, estimates, seconds = ([level[name] for level in levels] for name in ("value", "estimate", "time_s"))
        ask.tell("accuracy", f"{quantity} to {told.relative:.0e}", of_ladder(seconds, told.relative, tol, 2.0 ** len(shape)))
        end = _end(estimates, values, tol, problem.grid.size) or _lost(solution, quantity, values, told.largest)
        ups = 0 if end else rungs_up(estimates, tol, told.line is not None, len(shape), course.film.pairs)
        for up in range(ups, 0, -1):
            if not (end := no_room(solution, course.shape(rung + up), ask.finest, told.relative, tol)):
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


def _ask(ask: Ask, course: Course, shape: tuple[int, ...], before: Solution | None, loops: bool) -> Ask:
    """What the grid of this shape is asked for; before : the last one's answer. loops : whether multigrid's are loaded."""
    tol, film = ask.accuracy or 0.0, course.film
    near = ask.start if before is None else _start(before, prod(shape), course.seeking) if ask.nested is not False else None
    told_soon = film.pairs and not course.ring  # the first grid is not the last, and need not be solved far
    stopping = _stopping(ask, tol, before) if before is not None or told_soon else ask.stopping
    least = WHOLE[loops if before is None else before.asked == "fas"]
    halved = ask.reduction and not (course.plane and prod(shape) <= (min(least, TWICE) if film.rims or film.corners else least))
    this = replace(ask, accuracy=None, start=near, nested=False, reduction=halved, stopping=stopping)
    this = replace(this, cavities=CAVITIES if stopping is not ask.stopping else None, digits=ALGEBRAIC * tol)
    by_loops = loops and (course.plane or (film.line and shape[0] <= ELIMINATED))
    return replace(this, direct_below=0) if by_loops else this


def _value(solution: Solution, quantity: str | None, course: Course, scene: Solvable) -> tuple[str, float]:
    """The quantity's name, and its value on this grid. Collective."""
    sure = quantity or (DEFAULT_QUANTITY[0] if course.film.pairs or course.film.line else "")
    if (value := carried(solution.problem, solution.fields, sure)) is not None:
        return sure, value
    found = {**sought(solution), **solution.numbers}  # what is sought is the number where the load is given
    name = quantity or next((name for name in (*sought(solution), *DEFAULT_QUANTITY) if name in found), "")
    return name, find_value(found, name, scene)


def _level(solution: Solution, value: float, estimate: float, seconds: float) -> dict[str, Any]:
    """One of `Solution.levels`."""
    return {
        **dict(zip(("nx", "ny"), solution.problem.grid.shape, strict=False)),
        "iterations": solution.iterations,
        "linear_iterations": solution.total("linear_iterations"),
        "time_s": seconds,
        "value": value if solution.converged else np.nan,
        "estimate": estimate,
    }


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


def _lost(solution: Solution, quantity: str, values: Sequence[float], largest: float) -> str:
    """Why no grid will tell more of a load: it is rounding. Empty where it is not. Collective."""
    rounding = _rounding(solution) if solution.problem.kind == "lubrication" and quantity in INTEGRALS else 0.0
    if len(values) < 2 or not max(*map(abs, values), largest) <= rounding:  # NaN is not
        return ""
    return f"it is {f'below {rounding:.0e} N, which is rounding beside what wall and sides could carry' if rounding else 0}"


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
