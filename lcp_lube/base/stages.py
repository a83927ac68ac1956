"""Named stages: seconds for the results, and the same names in PETSc's -log_view."""

from time import perf_counter
from typing import Any

from petsc4py import PETSc


class Stages:
    """Accumulates the seconds spent in each named stage; `with stages("KSP"): ...`."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    def __call__(self, name: str) -> "_Stage":
        return _Stage(self.seconds, name)


class _Stage:
    """One time that a stage is entered; no generator, as small solves enter dozens."""

    def __init__(self, seconds: dict[str, float], name: str):
        self._seconds, self._name, self._stage = seconds, name, PETSc.Log.Stage(name)

    def __enter__(self) -> None:
        self._start = perf_counter()
        self._stage.push()

    def __exit__(self, *failure: Any) -> None:
        self._stage.pop()
        self._seconds[self._name] = self._seconds.get(self._name, 0.0) + perf_counter() - self._start
