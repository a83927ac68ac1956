"""A scene solved from the answer of a neighbouring one, with a load to balance or without."""

from collections.abc import Callable
from typing import Any

from ..api import solve
from ..problems.solution import Solution
from ..scenes.scene import Scene
from .balance import balanced


def solve_near(scene: Scene, near: Solution | None, **how: Any) -> Solution:
    """`api.solve` from a neighbour's answer; from the beginning without one, or where it leads nowhere. Collective.

    Parameters
    ----------
    near : a solution of a scene of the same family, on any grid.
    how : the other arguments of `solve`.

    Returns
    -------
    Solution : settings['start'] is 'warm' or 'cold'.
    """
    if getattr(scene, "balance", None) is not None:  # one trial of its search
        scene = scene.model_copy(update={"balance": None})
    if near is not None and near.problem.grid.dim == len(scene.shape):
        solution = solve(scene, start=(near.problem, near.fields), **how)
        solution.settings["start"] = "warm"
        if solution.converged:
            return solution
        solution.destroy()
    solution = solve(scene, **how)
    solution.settings["start"] = "cold"
    return solution


def solve_or_balance(scene_at: Callable[[dict[str, Any]], Scene], near: Solution | None = None, **how: Any) -> Solution:
    """The solution of a scene, or if it has a [balance] table the one that carries its load. Collective.

    Parameters
    ----------
    scene_at : the scene with some of its values changed, by key.
    near, how : as `solve_near` takes them.
    """
    scene = scene_at({})
    if getattr(scene, "balance", None) is None:
        return solve_near(scene, near, **how)
    return balanced(scene_at, lambda scene, near: solve_near(scene, near, **how), near, how.get("nested"))
