"""Where the error of a number comes from: cell by cell, by its adjoint and the answer on a grid of half the spacing.

With R z' the finer grid's answer at the points of the coarse one, whose equations G it does not quite meet,

    Q(z) - Q' = sum over the points of -lambda G(R z')  +  Q(R z') - Q' :

what the coarse equations get wrong in every cell, weighted by what it does to Q, and what reading Q off fewer points adds. A
fault of second order is four thirds of that. (The finer equations at the interpolated coarse answer, which need no finer
solve, say nothing: at fronts and edges they are a difference of large parts; docs/gradients.md has figures.)
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base.parallel import Array, Reduce
from ...errors import InputError
from ...problems.film.turned import TurnedProblem
from ...problems.film.turning import ahead
from ...problems.solution import Solution
from ...problems.transfer import Transfer
from ...scenes.scene import Scene
from .adjoint import Adjoint
from .implicit import Implicit

BISECTIONS = 60  # more than a double has digits: the interval is then one number
SECOND = 4.0 / 3.0  # error over the difference from half the spacing, where it is of second order


@dataclass(frozen=True)
class GoalError:
    """A number's error, and where it comes from.

    Attributes
    ----------
    value, finer : Q on the solution's grid and at half the spacing, SI. error : estimate of value - (Q of ever finer grids).
    cells : the part of it that comes from the cells' equations; the rest is from reading Q off the points. worst : the least
        share of the points that makes half of the sum of the cells' sizes.
    field : its density at the points, unit of Q per m2; the sum over the points times a cell's area is `cells`.
    """

    quantity: str
    value: float
    finer: float
    error: float
    cells: float
    worst: float
    field: Array


def finer_shape(solution: Solution) -> tuple[int, ...]:
    """The grid of half the spacing.

    Raises
    ------
    InputError : no film in the plane, one that moves to smaller x, or one with supplies.
    """
    problem: Any = solution.problem
    if isinstance(problem, TurnedProblem) or getattr(problem, "held", None) is not None or problem.grid.dim == 1:
        raise InputError("--errors: of films in the plane that move to larger x, without supplies; a line's numbers have none")
    return tuple(int(n + m) for n, m in zip(problem.grid.shape, problem.grid.meshes, strict=True))


def goal_error(scene: Scene, solution: Solution, finer: Solution, quantity: str) -> GoalError:
    """The error of a number of a converged solution, by one of `finer_shape`. Collective.

    Raises
    ------
    InputError : a scene or a number without derivatives, a number that was found.
    """
    finer_scene: Any = scene.with_shape(finer.problem.grid.shape)
    adjoint, other = Adjoint(scene, solution, [quantity]), Adjoint(finer_scene, finer, [])
    try:
        if quantity in adjoint.found:
            raise InputError(f"quantity {quantity}: it was found; errors by cells are of numbers of the film")
        value, best = (one.equations.report(one.numbers)[quantity] for one in (adjoint, other))
        grid, reduce = adjoint.equations.grid, adjoint.equations.grid.reduce
        transfer = Transfer(other.equations.grid, grid, ahead=ahead(solution.problem, finer.problem))
        G = adjoint.equations.balance(transfer(other.p), transfer(other.r)) / adjoint.flow_unit
        transfer.destroy()
        if (held := adjoint.equations.held) is not None:  # points in a groove have its pressure on any grid
            G = np.where(held, 0.0, G)
        implicit = Implicit.of(adjoint)
        row = -implicit.by_found[quantity] @ implicit.inverse
        lam = adjoint.lambdas[quantity] + sum(w * adjoint.lambdas[c] for c, w in zip(implicit.conditions, row, strict=True))
        parts = -SECOND * lam * G
        worst = _half(np.abs(parts), reduce) / grid.size
        return GoalError(quantity, value, best, SECOND * (value - best), reduce.sum(parts), worst, parts / grid.cell)
    finally:
        adjoint.destroy()
        other.destroy()


def _half(sizes: Array, reduce: Reduce) -> float:
    """How many of the largest make half of the sum, of all ranks' points: by bisection for the least of them. Collective."""
    half, low, high = 0.5 * reduce.sum(sizes), 0.0, reduce.max(sizes)
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if reduce.sum(np.where(sizes > middle, sizes, 0.0)) >= half else (low, middle)
    return max(reduce.sum((sizes > low).astype(float)), 1.0)
