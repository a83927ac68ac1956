"""Load balance: the eccentricity, film level or other value at which a film carries the load that is asked for.

With t = log(e/(1 - e)) for an eccentricity e, the logarithm of the thinnest film for a film level, and that of any other value,
the load W follows powers of e^t over wide ranges, so log(W/load) is nearly linear in t: Newton's method with the film's exact
stiffness, for other values a secant iteration, kept inside the bracket once there is one, finds its root in a handful of
solves, each started from the nearest answer. On large grids the search begins on coarse ones.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from math import atan2, copysign, cos, exp, inf, log, prod, sin
from typing import Any

import numpy as np

from ...errors import InputError, NotFound
from ...problems.film.integrals import thinnest
from ...problems.film.quantities import shaft_force
from ...problems.solution import Outcome, Solution
from ...scenes.balance import BalanceTable
from ...scenes.moving import film_of
from ...scenes.scene import Scene, Solvable, as_scene
from ..ask import Ask
from ..chain import added
from ..compose import Inner
from ..levels import level_shapes
from ..turned import Mirrored, as_solved
from .root import Search

MOST_SOLVES = 30  # on a grid
RANGE = {"eccentricity": 1e4, "h_offset": 100.0}  # unless one is given: of e/(1 - e) about 1, of the film about the scene's
STEP = 1e-4  # in t, of a difference
COARSE_TOL = 1e-3  # a coarse grid's load is no better
FEWEST, NARROWEST = 25, 3  # points of a coarse grid, and across
MOST_FAILED, LIGHTER = 4, 3.0  # solves that may fail before the first answer; twice the step in t from each towards less load
ONE_GRID = 1_000  # points up to which a coarser grid saves no time


def carried(values: dict[str, Any]) -> float:
    """The load that a balance is about, of `Problem.quantities`: N (1D: N/m)."""
    return float(values["load"])


@dataclass(frozen=True)
class Variable:
    """A key of the scene and the variable t that stands for its value.

    start, low, high : of t; slope : d log W/dt to begin with.
    """

    key: str
    to_value: Callable[[float], float]
    start: float
    low: float
    high: float
    slope: float


def variable(scene: Scene, table: BalanceTable, begin: float | None, shapes: Sequence[tuple[int, ...]]) -> Variable:
    """What is to be found. Collective.

    Parameters
    ----------
    begin : value where the search begins; default the scene's, or the middle of the range.
    shapes : grids on which the film is to be positive.

    Raises
    ------
    InputError : a key without a range, a range that leaves the key's domain.
    """
    fields = type(scene).model_fields
    key = table.vary or ("eccentricity" if "eccentricity" in fields else "h_offset")
    value: Any = getattr(scene, key, None) if begin is None else begin
    shift, upper = 0.0, inf
    to_t: Callable[[float], float] = log
    to_value: Callable[[float], float] = exp
    slope = 1.0
    if key.rpartition(".")[2] == "eccentricity":
        to_t, to_value, upper = (lambda e: log(e / (1.0 - e))), (lambda t: 1.0 / (1.0 + exp(-t))), 1.0
        turning = getattr(scene, "turning", None)
        if turning is not None and begin is None:
            from .place import half_film_eccentricity  # here: with it come families of scenes

            value = half_film_eccentricity(turning, scene.mu_0, table.load, len(scene.shape) == 1)  # type: ignore[attr-defined]
        value = 0.5 if value is None else min(max(value, 1e-3), 0.999)
    elif key == "h_offset":
        problems: list[Any] = [scene.with_shape(shape).build() for shape in shapes]
        shift = min(thinnest(one.grid, one.film)[0] for one in problems) - getattr(scene, key)  # the film less h_offset
        for one in problems:
            one.destroy()
        value = value if value + shift > 0 else getattr(scene, key)  # a neighbour's, whose film was thicker
        to_t, to_value, slope = (lambda v: log(v + shift)), (lambda t: exp(t) - shift), -2.0
    elif table.range is None:
        raise InputError(f"{scene.name}: balance.range is needed for balance.vary = {key}: smallest and largest value")
    if table.range is not None:
        smallest, largest = table.range
        if not (smallest + shift > 0 and largest < upper):
            raise InputError(f"{scene.name}: balance.range = {list(table.range)}: allowed for {key} is {-shift:g} to {upper:g}")
        low, high = to_t(smallest), to_t(largest)
        start = 0.5 * (low + high) if value is None or not smallest <= value <= largest else to_t(value)
    else:
        start = to_t(value)
        about = 0.0 if upper == 1.0 else start
        wide = log(RANGE["eccentricity" if upper == 1.0 else "h_offset"])
        low, high = about - wide, about + wide
    return Variable(key, to_value, start, low, high, slope)


def applies(scene: Solvable, ask: Ask) -> bool:
    """Whether the scene has a load to carry; `pads` and `position` come first, for theirs."""
    return getattr(scene, "balance", None) is not None


def solve(scene: Solvable, ask: Ask, inner: Inner) -> Solution:
    """The solution of the scene that carries the load of its [balance] table. Collective.

    `nested` = False: no search on coarser grids. A start that is a balance as well gives the value where the search begins.

    Returns
    -------
    Solution : settings['balance'] has vary, value, load (asked for), carried, iterations (solves on this grid) and solves (on
        all grids). Where no value carries the load: the one that comes nearest, with the outcome LOAD_NOT_CARRIED; where a
        solve failed and no other could stand in for it, that one with its own outcome.

    Raises
    ------
    InputError : what `variable` and the inner solves raise.
    """
    assert isinstance(scene, Scene)  # as `applies` found: no other has a table
    table: BalanceTable = scene.balance  # type: ignore[attr-defined]
    nested, near = ask.nested, ask.start
    shapes = [scene.shape]
    if nested is not False:
        shapes = [shape for shape in level_shapes(scene.shape) if shape == scene.shape or prod(shape) > ONE_GRID]
    # A small grid's, from a cold start, unless the closed forms of a groove at the widest gap know the place.
    if shapes == [scene.shape] and near is None and nested is not False and getattr(scene, "round", None) != "groove":
        half = tuple((n - 1) // 2 for n in scene.shape)
        shapes = [half, scene.shape] if min(half) >= NARROWEST and prod(half) >= FEWEST else shapes
    known = near.settings.get("balance", {}).get("value") if near is not None else None
    unknown = variable(scene, table, known, shapes)
    t, slope, solves, work, found = unknown.start, unknown.slope, 0, 0.0, False
    start: Any = near
    steep: float | None = None  # slope of log W at what was found
    times: dict[str, float] = {}
    refused: dict[float, str] = {}  # where there was no answer on this grid, and why
    for shape in shapes:
        last = shape == shapes[-1]
        refused.clear()
        search = Search(unknown.low, unknown.high, slope, least=Search.least if last else 1e-2 * COARSE_TOL)
        tol = table.tol if last else max(table.tol, COARSE_TOL)

        def solve_at(t: float, near: Any, shape: tuple[int, ...] = shape) -> tuple[Solution, Callable[[float], float | None]]:
            trial = as_scene(scene, {unknown.key: unknown.to_value(t)}).with_shape(shape).model_copy(update={"balance": None})
            solution = inner(trial, replace(ask, start=near, alone=False))
            times.update(added(times, solution.times))
            refused.update({} if solution.converged else {t: solution.message})
            return solution, lambda W: exact_slope(trial, solution, unknown, t, W)

        solution, t, count, found = _on_grid(solve_at, search, t, start, table.load, tol)
        work += count * prod(shape) / prod(scene.shape)
        if start is not None and start is not near:
            start.destroy()
        start, slope, solves = solution, search.slope, solves + count
        steep = (search.slope_at(t) if found else None) or steep
    value, load = unknown.to_value(t), carried(solution.problem.quantities(solution.fields))
    answer = f"{unknown.key} = {value:.8g} carries {load:.8g}"
    if solution.converged and not found:
        solution.outcome = Outcome.LOAD_NOT_CARRIED
        looked = " to ".join(f"{end:.8g}" for end in sorted(map(unknown.to_value, (unknown.low, unknown.high))))
        solution.message = f"{table.load:g} asked for; the nearest of {count} tried: {answer}; balance.range was {looked}"
        if refused:
            beside = min(refused, key=lambda one: abs(one - t))
            solution.message += f"; {unknown.key} = {unknown.to_value(beside):.8g} has no answer: {refused[beside]}"
    solution.times = times
    by_t = (unknown.to_value(t + STEP) - unknown.to_value(t - STEP)) / (2.0 * STEP)
    solution.settings["load_slope"] = None if steep is None else steep * load / by_t  # dW/dvalue, a few digits of it
    record = {"vary": unknown.key, "value": value, "load": table.load, "carried": load}
    solution.settings["balance"] = record | {"iterations": count, "solves": solves, "work": work}
    solution.because(f"balance: {answer}, found in {count} solves on this grid, {solves} in all", after=True)
    return solution


def exact_slope(scene: Any, solution: Solution, unknown: Variable, t: float, W: float) -> float | None:
    """d log W/dt by the stiffness of a film that carries W, if t displaces a journal, or a flat wall and no effects but a
    fluid's law act; else None. Collective."""
    model, turning = film_of(scene), getattr(scene, "turning", None)
    if model is None or (model.effects and turning is None):
        return None
    from ...scenes.thrust import ThrustScene  # here, as above
    from ..motions.coefficients import coefficients

    key = unknown.key.rpartition(".")[2]
    if key == "eccentricity" and turning is not None and turning.widest is not None and model.U >= 0:
        fx, fy = shaft_force(solution.problem, solution.fields)
        e, along = unknown.to_value(t), atan2(-fy, -fx) - turning.widest
        move = turning.c * e * (1.0 - e) * np.array([-cos(along), sin(along)])  # away from the widest gap, in the load's axes
        with suppress(NotFound):
            (one,) = coefficients(scene, solution, damped=False)
            return float(one.K[0] @ move) / W
    if turning is None and (key == "h_offset" or (key == "h_min" and isinstance(scene, ThrustScene))):
        alike = 1
        if model.U < 0:
            alike = scene.pads if isinstance(scene, ThrustScene) else 1
            scene, solution = Mirrored(scene), as_solved(solution)
        with suppress(NotFound):
            (one,) = coefficients(scene, solution, damped=False)
            return -alike * float(one.K[0, 0]) * exp(t) / W
    return None


def _on_grid(
    solve_at: Callable[[float, Any], tuple[Solution, Callable[[float], float | None]]],
    search: Search,
    t: float,
    near: Any,
    load: float,
    tol: float,
) -> tuple[Solution, float, int, bool]:
    """The solution whose load comes nearest, its t, the number of solves, and whether it is the one sought. Collective."""
    best: Solution | None = None
    best_t, best_g = t, inf
    for count in range(1, MOST_SOLVES + 1):
        solution, slope = solve_at(t, best or near)
        if not solution.converged:
            if best is None and count > MOST_FAILED:
                return solution, t, count, False
            back = best_t if best is not None else t - copysign(LIGHTER, search.slope)
            solution.destroy()
            search.leave(t, back)
            t = 0.5 * (t + back)  # towards what could be solved, or has less pressure
            continue
        W = carried(solution.problem.quantities(solution.fields))
        g = log(W / load) if W / load > 0 else -inf
        search.add(t, g, None if abs(g) <= tol or g == -inf else slope(W))
        if best is None or abs(g) < abs(best_g):
            best, solution, best_t, best_g = solution, best, t, g
        if solution is not None:
            solution.destroy()
        target = None if abs(best_g) <= tol else search.next()
        if target is None:
            break
        t = target
    assert best is not None  # for the type checker: the first solve gave one, or was returned
    return best, best_t, count, abs(best_g) <= tol
