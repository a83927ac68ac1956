"""What nonlinear multigrid for films and for obstacles share: the order of cycles, full multigrid, and when it stalls."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from time import perf_counter
from typing import Any

import numpy as np

from ...base.compiled import has_numba
from ...errors import InputError
from ...problems.grid import Grid
from ...problems.solution import Step
from ..job import Job
from ..method import Method
from ..method_options import MethodOptions, least, one_of, option

WINDOW = 3  # cycles over which the fall of the norm is judged


@dataclass(frozen=True)
class CycleOptions(MethodOptions):
    """cycle: V, F or W; pre, post: sweeps before and after the coarse grid; front: sweeps over the points within `width`
    cells of a front after each correction; stall: give up where the norm has not fallen below this part of itself in three
    cycles."""

    method = "fas"
    cycle: str = one_of("F", ("V", "F", "W"))
    pre: int = least(0, 3)
    post: int = least(0, 3)
    front: int = least(0, 10)
    width: int = least(0, 3)
    stall: float = option(0.3, lambda stall: 0 < stall <= 1, "allowed are numbers above 0, up to 1")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.pre + self.post == 0:
            raise InputError("fas.pre = fas.post = 0: at least one sweep is needed")


class Cycles(Method):
    """A multigrid method: the first step is full multigrid, unless there is a start, the others are cycles.

    The class that fills this in makes `_levels`, finest first.
    """

    _levels: list[Any]

    def __init__(self, job: Job):
        super().__init__(job)
        if not has_numba():
            raise InputError("--method fas: its loops need numba, which is not installed (pip install numba)")

    def _begin(self, started: bool) -> None:
        self._depth = len(self._levels)  # levels in use
        self._recent: tuple[float, ...] = (inf,) * WINDOW
        self._taken, self._first = int(started), inf

    @property
    def details(self) -> dict[str, Any]:
        """What the JSON tells of a run, see `record`. Collective."""
        return record(self._levels, self.problem.grid, self._taken - 1, self._first, self.norm)

    @property
    def _stalled(self) -> bool:
        return self.norm > self.options.stall * self._recent[0]

    def _count(self) -> None:
        """A step has been taken from `norm`."""
        self._taken += 1
        self._recent = (*self._recent[1:], self.norm if self._taken > 1 else inf)

    def _full_multigrid(self) -> None:
        """From the coarsest grid up, one V cycle on each: more is lost beside the grid's own error. Collective."""
        for k in reversed(range(self._depth)):
            self._rise_to(k)
            self._cycle(k, "V")

    def _cycle(self, k: int, kind: str) -> None:
        """One cycle from level k down and back. Collective."""
        level = self._levels[k]
        level.visits += 1
        begin = perf_counter()
        if k + 1 == self._depth:
            self._solve_coarsest(k)
        else:
            self._descend(k)
            level.seconds += perf_counter() - begin
            self._cycle(k + 1, kind)
            if kind != "V" and k + 2 < self._depth:
                self._cycle(k + 1, "V" if kind == "F" else kind)
            begin = perf_counter()
            self._ascend(k)
        level.seconds += perf_counter() - begin

    def _rise_to(self, k: int) -> None:
        """Level k's first guess, from the coarser one's answer if there is one."""
        raise NotImplementedError

    def _solve_coarsest(self, k: int) -> None:
        raise NotImplementedError

    def _descend(self, k: int) -> None:
        """Sweeps on level k, and the coarser level's right-hand side and start."""
        raise NotImplementedError

    def _ascend(self, k: int) -> None:
        """The coarser level's correction on level k, and sweeps."""
        raise NotImplementedError

    def advance(self) -> Step:
        raise NotImplementedError


def record(levels: Sequence[Any], grid: Grid, cycles: int, first: float, last: float) -> dict[str, Any]:
    """What the JSON tells of a run. Collective.

    levels: coarse to fine, their visits and own seconds; cycles: after full multigrid; work_units: relaxed points over points;
    convergence_factor: geometric mean of the cycles', which have taken the norm from `first` to `last`.
    """
    apart = grid.reduce.sum(np.array([sum(level.work for level in levels if level.split)]))
    measured = cycles > 0 and 0 < last < inf and 0 < first < inf
    return {
        "levels": [
            {"nx": v.nx, "ny": v.ny, "iterations": v.visits, "linear_iterations": 0, "time_s": v.seconds}
            for v in reversed(levels)
        ],
        "cycles": max(cycles, 0),
        "work_units": (sum(level.work for level in levels if not level.split) + apart) / grid.size,
        "convergence_factor": (last / first) ** (1.0 / cycles) if measured else None,
    }
