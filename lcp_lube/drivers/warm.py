"""A scene solved from a neighbouring one's answer; from the beginning where that leads nowhere."""

from contextlib import suppress
from dataclasses import replace
from types import SimpleNamespace

from ..errors import InputError
from ..problems.solution import Solution
from ..registry import DRIVERS
from ..scenes.scene import Solvable
from .ask import Ask
from .chain import added
from .compose import Inner

SEEKING = ("pads", "position", "balance", "attitude")  # drivers


def applies(scene: Solvable, ask: Ask) -> bool:
    return ask.start is not None


def solve(scene: Solvable, ask: Ask, inner: Inner) -> Solution:
    """Settings['start'] of the solution is 'warm' or 'cold'. Collective."""
    assert ask.start is not None
    times: dict[str, float] = {}
    if ask.start.problem.grid.dim == len(scene.shape):
        with suppress(InputError):  # a neighbour's pads may leave no film here
            solution = inner(scene, ask)
            solution.settings["start"] = "warm"
            if solution.converged:
                return solution
            times = solution.times
            solution.destroy()
    solution = inner(scene, replace(ask, start=None))
    solution.settings["start"] = "cold"
    solution.because("solved from the beginning: the start was of no use")
    solution.times = added(times, solution.times)
    return solution


def seeks(scene: Solvable, ask: Ask) -> bool:
    """Whether a place, a value or an attitude is sought."""
    drivers = (DRIVERS[name] for name in SEEKING)
    return any(not one.idle(scene) and one.load().applies(scene, ask) for one in drivers)


def _seeks_near(scene: Solvable, ask: Ask) -> bool:
    """Whether it is, and there is a neighbour's."""
    return applies(scene, ask) and seeks(scene, ask)


anew = SimpleNamespace(applies=_seeks_near, solve=solve)  # a driver: as above, all solves of a search together
