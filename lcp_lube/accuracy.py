"""Accuracy asked for: grids from coarse to fine, until the estimated relative error of a quantity is below a tolerance.

On grids whose spacing halves, a quantity's error falls by 2^q. Two things spoil the textbook estimate |d_k|/(2^q - 1) from
the last difference d_k = v_k - v_(k-1): a front moves within its cell from grid to grid, so that errors of second order on
average come with any factor and sign, and one small difference proves nothing; and a jump of the film stays where it is
within a cell, so that differences can vanish on several grids while the error does not. So the estimate is the greater of

- Richardson's, SAFETY times the largest of the last differences carried to the newest grid, with the lowest order seen among
  them, between 1 and 2;
- the film's: the share of Int h^-3 that the jumps of the film inside a cell misplace on this grid, times how strongly the
  quantity was seen to answer to it.

Its constants are chosen on random films with exact solutions (tests/test_accuracy.py).
"""

import os
from collections.abc import Sequence
from math import ceil, inf, isfinite, prod
from time import perf_counter
from typing import Any

import numpy as np
from petsc4py import PETSc

from .api import solve
from .auto import SMALL
from .errors import InputError, nearest
from .problems.problem import LubricationProblem
from .problems.solution import Fields, Outcome, Problem, Solution
from .registry import METHODS
from .scene import Scene
from .solvers.newton import Stopping

SAFETY = 2.0  # of both estimates
DIFFERENCES = 3  # that Richardson's estimate heeds: a front moves, and one difference can be small by chance
ANSWER = (1.0, 10.0)  # least and greatest answer to a misplaced jump: relative change over share of Int h^-3
COARSEST = {1: 12, 2: 4}  # points a side at least on the first grid
LINES, PARTS = 17, 16  # lines of a 2D grid on which the film is looked at, and looks between two points
# Looks, in spacings from the left one of two points: just inside of both, where a film that jumps at a point has its own side.
_LOOKS = np.clip(np.linspace(0.0, 1.0, PARTS + 1), 1e-7, 1.0 - 1e-7)
_WEIGHTS = np.array([0.5, *[1.0] * (PARTS - 1), 0.5]) / PARTS
ALGEBRAIC = 1e-3  # ||F|| relative to the tolerance: what is left of it must not show
ALLOWED = (1e-10, 0.5)  # tolerances
HOPELESS = 1_000_000  # points on which an estimate that has not come down is taken to stay up
PATIENCE = 4  # grids without a better estimate: rounding has the word
ASYMPTOTIC = 0.1  # an estimate below it falls by second order at best
BYTES, BYTES_DENSE = {1: 900, 2: 1200}, 24  # memory by points, measured (`auto`'s choices)
RELATIVE_NORM = ("active-set",)  # methods that measure ||F|| relative to the data
DEFAULT_QUANTITY = ("load", "sum_v", "k", "sigma")


def solve_to_accuracy(
    scene: Scene,
    tol: float,
    quantity: str | None = None,
    *,
    finest: tuple[int, ...] | None = None,
    stopping: Stopping | dict[str, Any] | None = None,
    nested: bool | None = None,
    comm: PETSc.Comm | None = None,
    **how: Any,
) -> Solution:
    """Solve a scene on finer and finer grids until a quantity is good to a tolerance, and no further. Collective.

    Parameters
    ----------
    tol : relative error allowed, 1e-10 to 0.5.
    quantity : which number of `Problem.quantities` it is about; default 'load', of other scenes 'sum_v', 'k', 'sigma'.
    finest : points a side that no grid may exceed; default: what memory holds.
    stopping : tolerances of the nonlinear iteration; by default no tighter than `tol` needs.
    nested : False: no grid starts from the answer on the one before.
    how : method, system, recipe_name, options, monitor, certify of `solve`.

    Returns
    -------
    Solution : on the last grid. settings['accuracy_estimate'] is the estimated relative error, `levels` has every grid with its
        value and estimate. Where grids end before the estimate is below `tol`: outcome ACCURACY.

    Raises
    ------
    InputError : no such quantity, a tolerance out of range or that no memory can hold; and what `solve` raises.
    """
    if not ALLOWED[0] <= tol <= ALLOWED[1]:
        raise InputError(f"--accuracy {tol:g}: allowed are relative errors from {ALLOWED[0]:g} to {ALLOWED[1]:g}")
    begin = perf_counter()
    shape = first_shape(scene.shape, (comm or PETSc.COMM_WORLD).getSize())
    solution: Solution | None = None
    values: list[float] = []
    misplaced: list[float] = []
    levels: list[dict[str, Any]] = []
    times: dict[str, float] = {}
    end = ""
    while not end:
        level_begin, before = perf_counter(), solution
        solution = solve(
            scene.with_shape(shape),
            stopping=_stopping(stopping, tol, before),
            start=_start(before, prod(shape)) if nested is not False else None,
            nested=False,
            comm=comm,
            **how,
        )
        if before is not None:
            before.destroy()
        problem = solution.problem
        found = problem.quantities(solution.fields)
        quantity = quantity or next((name for name in DEFAULT_QUANTITY if name in found), "")
        values.append(_value(found, quantity, scene) if solution.converged else np.nan)
        misplaced.append(misplaced_film(problem))
        estimate = relative_error(values, misplaced)
        levels.append(
            {
                **dict(zip(("nx", "ny"), problem.grid.shape, strict=False)),
                "iterations": solution.iterations,
                "linear_iterations": solution.total("linear_iterations"),
                "time_s": perf_counter() - level_begin,
                "value": values[-1],
                "estimate": estimate,
            }
        )
        times = {name: times.get(name, 0.0) + seconds for name, seconds in solution.times.items()}
        shape = tuple(2 * n + 1 for n in shape)
        end = _end([level["estimate"] for level in levels], values, tol, problem.grid.size) or _no_room(
            problem, shape, finest, estimate, tol
        )
    assert solution is not None and quantity is not None  # for the type checker: there is a first grid
    if solution.converged and not estimate <= tol:
        solution.outcome = Outcome.ACCURACY
        solution.message = f"{quantity} to {estimate:.1e} only, {tol:g} was asked for: {end}"
    solution.settings |= {"accuracy": tol, "accuracy_quantity": quantity, "accuracy_estimate": estimate}
    solution.settings["why"] = [*solution.settings["why"], *ladder(levels, quantity, tol)]
    solution.levels = levels
    solution.times = {**times, "total": perf_counter() - begin}
    return solution


def relative_error(values: Sequence[float], misplaced: Sequence[float]) -> float:
    """Estimated relative error of the last of a quantity's values on grids whose spacing halves; inf where they are too few.

    Parameters
    ----------
    values : coarse to fine; NaN where a grid gave none.
    misplaced : `misplaced_film` on the same grids.
    """
    steps = np.abs(np.diff(values))[-DIFFERENCES:]
    usable = np.flatnonzero(np.isnan(steps))
    steps = steps[usable[-1] + 1 :] if usable.size else steps
    if len(steps) < 2:
        return inf
    if not steps.any() and not misplaced[-1]:
        return 0.0
    if not values[-1]:
        return inf
    age = np.arange(len(steps))[::-1]
    tiny = np.finfo(float).tiny
    logs = np.log2(steps + tiny)
    order = float(np.clip(np.min((logs[:-1] - logs[-1]) / age[:-1]), 1.0, 2.0))
    richardson = SAFETY * np.max(steps / 2.0 ** (order * age)) / (2.0**order - 1.0) / abs(values[-1])
    if not misplaced[-1]:
        return float(richardson)
    shares = (np.array(misplaced[:-1]) + misplaced[1:])[-len(steps) :]
    answers = steps[shares > 0] / shares[shares > 0] / abs(values[-1])
    answer = np.clip(np.max(answers, initial=0.0), *ANSWER)
    return float(max(richardson, SAFETY * answer * misplaced[-1]))


def misplaced_film(problem: Problem) -> float:
    """Share of Int h^-3 that a grid misplaces where the film jumps between two of its points, or has detail unseen there.

    The scheme takes the film between two points as it is at the face. Elsewhere that is of second order, which values show;
    a jump is moved by up to half a spacing, by the same length on grids that halve. Each rank computes all of it, from some
    lines of the film.
    """
    if not isinstance(problem, LubricationProblem):
        return 0.0
    grid = problem.grid
    share = 0.0
    for side in range(grid.dim):
        n, spacing, start = grid.shape[side], grid.spacing[side], grid.origin[side]
        fine = (start + (np.arange(n + 1)[:, None] + _LOOKS) * spacing).ravel()
        face = start + (np.arange(n + 1) + 0.5) * spacing
        across = 1 - side
        if grid.dim == 1:
            lines = np.zeros(1)
        else:
            picked = np.unique(np.linspace(1, grid.shape[across], min(LINES, grid.shape[across])).round())
            lines = grid.origin[across] + picked * grid.spacing[across]
        film = [
            np.broadcast_to(problem.film(*((at[None, :], lines[:, None])[:: 1 - 2 * side])), (lines.size, at.size))
            for at in (fine, face)
        ]
        share += _misplaced(film[0].reshape(lines.size, n + 1, PARTS + 1), film[1])
    return share


def _misplaced(looks: np.ndarray, face: np.ndarray) -> float:
    """`misplaced_film` from the film at the looks, shape (lines, n + 1, PARTS + 1), and at the faces, shape (lines, n + 1)."""
    weight = looks**-3.0
    mean = weight @ _WEIGHTS
    off = np.abs(face**-3.0 - mean)
    spread = looks.max(axis=-1) - looks.min(axis=-1)
    jump = np.abs(np.diff(looks, axis=-1)).max(axis=-1) > 0.5 * spread
    seen = jump & (spread > 1e-9 * looks.mean(axis=-1)) | (off > 0.5 * mean)
    return float(np.sum(off[seen]) / np.sum(mean))


def first_shape(shape: tuple[int, ...], ranks: int = 1) -> tuple[int, ...]:
    """The coarsest grid, of the scene's own proportions, from which doubling leads on; every rank gets two lines at least."""

    def enough(n: tuple[int, ...]) -> bool:
        return min(n) >= COARSEST[len(n)] and (ranks == 1 or n[-1] >= 2 * ranks)

    while enough(half := tuple((n - 1) // 2 for n in shape)):
        shape = half
    return shape


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
    if len(values) > 1 and np.isnan(values[-2:]).all():
        return "no value on the last two grids"
    best = int(np.argmin(estimates))
    # A film with a layer thinner than these grids stays far off for long, and then converges.
    settled = estimates[best] < ASYMPTOTIC or points > HOPELESS
    if settled and len(estimates) - best > PATIENCE:
        return f"{PATIENCE} finer grids gave no better estimate than {estimates[best]:.1e}"
    return ""


def _stopping(given: Stopping | dict[str, Any] | None, tol: float, before: Solution | None) -> Stopping | dict[str, Any] | None:
    """The tolerances given, filled up for a method whose ||F|| is relative to the data: no tighter than `tol` needs."""
    if isinstance(given, Stopping) or before is None or before.problem.kind != "lubrication":
        return given
    if before.settings["method"] not in RELATIVE_NORM:
        return given
    return {"eps1": float(np.clip(ALGEBRAIC * tol, 1e-12, 1e-4)), "eps2": inf, **(given or {})}


def _start(before: Solution | None, points: int) -> tuple[Problem, Fields] | None:
    """What the next grid starts from, where that pays: a small film is solved sooner than sweeps are compiled."""
    if before is None or before.outcome in (Outcome.NOT_FINITE, Outcome.LINEAR_SOLVER):
        return None
    if before.problem.kind == "lubrication" and points <= SMALL:
        return None
    entry = METHODS[before.settings["method"]].of(before.problem.kind)
    return (before.problem, before.fields) if entry.nested else None


def _value(found: dict[str, Any], quantity: str, scene: Scene) -> float:
    """The quantity among those found; NaN where it has no value on this grid, a front that is not there, say."""
    numbers = [name for name, value in found.items() if isinstance(value, int | float) and not isinstance(value, bool)]
    if quantity not in found or not (found[quantity] is None or quantity in numbers):
        near = nearest(quantity, numbers)
        raise InputError(
            f"--quantity {quantity}: scene {scene.name} has no such number{near}; allowed are {', '.join(numbers)}"
        )
    return np.nan if found[quantity] is None else float(found[quantity])


def _no_room(problem: Problem, shape: tuple[int, ...], finest: tuple[int, ...] | None, estimate: float, tol: float) -> str:
    """Why the next grid cannot be; empty if it can.

    Raises
    ------
    InputError : even with second order from here on, the tolerance is out of memory's reach.
    """
    name = " x ".join(map(str, shape))
    if finest and any(n > most for n, most in zip(shape, finest, strict=True)):
        return f"a finer grid than {' x '.join(map(str, finest))} is not allowed"
    dense = bool(getattr(problem, "dense", False))
    ranks, memory = problem.grid.comm.size, os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")

    def needed(points: float) -> float:
        """Bytes a rank."""
        return (BYTES_DENSE * points**2 if dense else BYTES[len(shape)] * points) / ranks

    factor = max(1.0, 0.5 * (estimate / tol) ** 0.5) if estimate < ASYMPTOTIC else 1.0
    points = prod(factor * n for n in shape)
    if factor > 1.0 and not finest and (needed(points) > memory or points > np.iinfo(PETSc.IntType).max // 2):
        side = ceil(factor * shape[0])
        raise InputError(
            f"--accuracy {tol:g}: takes some {side} points along x ({estimate:.1e} is reached with {problem.grid.shape[0]}), "
            f"{needed(points) / 1e9:.0f} GB a rank; this machine has {memory / 1e9:.0f}"
        )
    if needed(prod(shape)) > memory:
        return f"a grid of {name} needs {needed(prod(shape)) / 1e9:.0f} GB a rank, this machine has {memory / 1e9:.0f}"
    return ""
