"""Solves of one driver, one after another: each starts from the last one, which is then freed; their seconds add up."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from ..problems.solution import Fields, Solution, Step
from ..scenes.scene import Solvable
from .ask import Ask, Start
from .compose import Inner


def added(times: Mapping[str, float], more: Mapping[str, float]) -> dict[str, float]:
    """Seconds by stage of two solves together."""
    return {name: times.get(name, 0.0) + more.get(name, 0.0) for name in {**times, **more}}


class Chain:
    """Attributes: steps, of all solves. Collective.

    Parameters
    ----------
    ask : its `start` is where the first one starts.
    """

    def __init__(self, ask: Ask, inner: Inner):
        self._ask, self._inner = replace(ask, alone=False), inner
        self._last: Solution | None = None
        self.steps: list[Step] = []
        self._times: dict[str, float] = {}

    def solve(self, scene: Solvable, near: Fields | None = None, **changes: Any) -> Solution:
        """near : fields nearer than the last one's. changes : of the ask."""
        last = self._last
        start = last if last is None or near is None else Start(last.problem, near, last.settings)
        new = self._inner(scene, replace(self._ask, start=start or self._ask.start, **changes))
        if self._last is not None:
            self._last.destroy()
        self._last, self.steps = new, [*self.steps, *new.steps]
        self._times = new.times = added(self._times, new.times)
        return new

    def forget(self) -> None:
        """The next one starts as the first."""
        if self._last is not None:
            self._last.destroy()
        self._last = None
