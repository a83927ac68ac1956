"""Where a journal lies under a load of given size and direction: Newton's method with the film's exact stiffness.

Unknowns are t = log(e/(1 - e)) of the eccentricity e, in which the logarithm of the load is nearly linear, and the attitude;
the equations are log(W/load) = 0 and that the force lies in the load's line. The stiffness matrix of the film
(`coefficients`) gives their derivatives, so a handful of solves do, each started from the last; coarse grids come first.
"""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from ..problems.solution import Outcome, Solution
from ..scenes.effects.named import named, without
from ..scenes.grooved import GroovedJournalScene
from ..scenes.scene import Solvable
from .ask import Ask
from .attitude import half_film_attitude
from .chain import Chain
from .coefficients import coefficients
from .compose import Inner

MOST_SOLVES = 25  # on a grid
COARSEST, COARSE_TOL = 120, 1e-2  # points around on the first grid, and how well its journal's place is worth knowing
LONGEST = (2.0, 0.4)  # of a step in t and in the attitude (rad)
WIDEST = 14.0  # of t: eccentricities from 1e-6 to 1 - 1e-6


def applies(scene: Solvable, ask: Ask) -> bool:
    """Whether it is a journal of which load and direction are given, and its place is sought."""
    return isinstance(scene, GroovedJournalScene) and scene.balance is not None


def solve(scene: Solvable, ask: Ask, inner: Inner) -> Solution:
    """The solution at the place where the film's force is opposite to the load. Collective.

    Returns
    -------
    Solution : settings['balance'] as of any balance; where no place carries the load, outcome LOAD_NOT_CARRIED.
    """
    assert isinstance(scene, GroovedJournalScene) and scene.balance is not None  # as `applies` found
    table, known = scene.balance, ask.start.settings if ask.start is not None else {}
    touches = scene.preload or scene.tilt or scene.tilt_across  # the wall, at some eccentricity below 1
    guess = scene.eccentricity if touches else half_film_eccentricity(scene, table.load)
    e = known.get("balance", {}).get("value", guess)
    phi = math.radians(known["attitude_deg"]) if "attitude_deg" in known else half_film_attitude(e)
    free = scene.model_copy(update={"balance": None})
    shapes = [scene.shape]
    while ask.nested is not False and not known and shapes[0][0] >= 2 * COARSEST and shapes[0][1] >= 7:
        shapes.insert(0, (shapes[0][0] // 2, shapes[0][1] // 2 | 1))
    near, solves = ask.start, 0
    t = math.log(max(e, 1e-3) / (1.0 - max(e, 1e-3)))
    for shape in shapes:
        tol = table.tol if shape == shapes[-1] else max(table.tol, COARSE_TOL)
        solution, t, phi, count, found = _on_grid(
            free.with_shape(shape), replace(ask, start=near), inner, t, phi, table.load, tol
        )
        if near is not None and near is not ask.start:
            near.destroy()  # type: ignore[union-attr]
        near, solves = solution, solves + count
    carried = solution.problem.quantities(solution.fields)["load"]
    value = 1.0 / (1.0 + math.exp(-t))
    answer = f"eccentricity = {value:.8g} at {math.degrees(phi):.6g} degrees carries {carried:.8g}"
    if solution.converged and not found:
        solution.outcome, solution.message = Outcome.LOAD_NOT_CARRIED, f"{table.load:g} asked for; the nearest: {answer}"
    record = {
        "vary": "eccentricity",
        "value": value,
        "load": table.load,
        "carried": carried,
        "iterations": count,
        "solves": solves,
    }
    solution.settings |= {
        "balance": record,
        "attitude_deg": math.degrees(phi),
        "why": [*solution.settings["why"], f"balance: {answer}, found in {count} solves on this grid, {solves} in all"],
    }
    return solution


def half_film_eccentricity(scene: GroovedJournalScene, load: float) -> float:
    """The eccentricity at which a journal with half a film carries the load, as a start.

    1/W = 1/W_short + 1/W_long, of Ocvirk's short and Sommerfeld's long bearing: between them for every L/D, and near both.
    """
    e = 1.0 / (1.0 + np.exp(-np.linspace(-0.5 * WIDEST, 0.5 * WIDEST, 561)))
    round_, ratio = 1.0 - e * e, 4.0 * scene.L_over_D**2  # (B/R)^2
    short = 0.25 * ratio * e / round_**2 * np.sqrt(16.0 * e * e + np.pi**2 * round_)
    long = 6.0 * e / ((2.0 + e * e) * round_) * np.sqrt(4.0 * e * e + np.pi**2 * round_)
    turning = scene.turning
    unit = scene.mu_0 * turning.omega * turning.R * turning.B * (turning.R / turning.c) ** 2
    return float(np.interp(math.log(load / unit), -np.log(1.0 / short + 1.0 / long), e))


def _on_grid(
    scene: Any, ask: Ask, inner: Inner, t: float, phi: float, load: float, tol: float
) -> tuple[Solution, float, float, int, bool]:
    """Newton's method on one grid: solution, t, attitude, number of solves, whether the place was found. Collective."""
    chain = Chain(ask, inner)
    inverse, before = None, None  # of effects: the place's secant method, and (residual, step) before
    for count in range(1, MOST_SOLVES + 1):
        e = 1.0 / (1.0 + math.exp(-t))
        at = scene.model_copy(update={"eccentricity": e, "attitude_deg": math.degrees(phi)})
        solution = chain.solve(at)
        if not solution.converged:
            return solution, t, phi, count, False
        force = np.array(solution.problem.quantities(solution.fields)["force"])
        W = float(np.hypot(*force))
        off = math.atan2(-force[1], -force[0])
        short = math.log(W / load) if W > 0 else -math.inf
        if abs(short) <= tol and abs(off) <= tol:
            return solution, t, phi, count, True
        if count == MOST_SOLVES or (abs(t) >= WIDEST and short * t < 0):
            return solution, t, phi, count, False
        if not W > 0:
            step = np.array([LONGEST[0], 0.0])
        elif not at.model.effects:
            step = _newton(at, solution, force, (short, off), e, phi)
        else:
            inverse = (
                _secant(inverse, before, np.array([short, off]))
                if before is not None
                else _first(at, solution, force, off, e, phi)
            )
            step = -inverse @ [short, off]
        step = np.clip(step, [-LONGEST[0], -LONGEST[1]], LONGEST)
        before = (np.array([short, off]), step)
        t = min(max(t + float(step[0]), -WIDEST), WIDEST)
        phi += float(step[1])
    raise AssertionError("the loop returns")


def _first(at: Any, solution: Solution, force: Any, off: float, e: float, phi: float) -> Any:
    """The inverse derivative where effects act, to begin with: that of the film without them. Collective."""
    jacobian = _jacobian(without(at, named(at)), solution, force, off, e, phi)
    return np.linalg.inv(jacobian) if abs(np.linalg.det(jacobian)) > 1e-12 else np.diag([1.0 / max(1.0 + e, 1.0), 1.0])


def _secant(inverse: Any, before: Any, residual: Any) -> Any:
    """Broyden's update of the inverse derivative with what the last step changed."""
    old, step = before
    moved = inverse @ (residual - old)
    along = step @ moved
    return inverse if not abs(along) > 1e-30 else inverse + np.outer(step - moved, step @ inverse) / along


def _newton(at: Any, solution: Solution, force: Any, residual: tuple[float, float], e: float, phi: float) -> Any:
    """Steps in t and in the attitude, from the exact derivative of the force. Collective."""
    try:
        return np.linalg.solve(_jacobian(at, solution, force, residual[1], e, phi), [-residual[0], -residual[1]])
    except np.linalg.LinAlgError:
        return np.array([math.copysign(0.5, -residual[0]), 0.0])


def _jacobian(at: Any, solution: Solution, force: Any, along: float, e: float, phi: float) -> Any:
    """Derivatives of log W and of the force's angle (its rows) in t and in the attitude. Collective."""
    (one,) = coefficients(at, solution)
    turn = np.array([[math.cos(along), -math.sin(along)], [math.sin(along), math.cos(along)]])
    K = turn @ one.K @ turn.T  # back from the axes along the force
    c = at.clearance
    towards, across = np.array([math.cos(phi), math.sin(phi)]), np.array([-math.sin(phi), math.cos(phi)])
    moves = np.stack([c * e * (1.0 - e) * towards, c * e * across], axis=1)  # of the journal with t and with the attitude
    change = -K @ moves
    square = float(force @ force)
    return np.stack([force @ change, force[0] * change[1] - force[1] * change[0]]) / square
