"""A scene solved from a neighbouring one's answer; from the beginning where that leads nowhere."""

from dataclasses import replace

from ..problems.solution import Solution
from ..scenes.scene import Solvable
from .ask import Ask
from .chain import added
from .compose import Inner


def applies(scene: Solvable, ask: Ask) -> bool:
    return ask.start is not None


def solve(scene: Solvable, ask: Ask, inner: Inner) -> Solution:
    """Settings['start'] of the solution is 'warm' or 'cold'. Collective."""
    assert ask.start is not None
    times: dict[str, float] = {}
    if ask.start.problem.grid.dim == len(scene.shape):
        solution = inner(scene, ask)
        solution.settings["start"] = "warm"
        if solution.converged:
            return solution
        times = solution.times
        solution.destroy()
    solution = inner(scene, replace(ask, start=None))
    solution.settings["start"] = "cold"
    solution.times = added(times, solution.times)
    return solution
