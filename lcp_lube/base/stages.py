"""Named stages: seconds for the results, and the same names in PETSc's -log_view."""

from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter

from petsc4py import PETSc


class Stages:
    """Accumulates the seconds spent in each named stage; `with stages("KSP"): ...`."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        stage = PETSc.Log.Stage(name)
        start = perf_counter()
        stage.push()
        try:
            yield
        finally:
            stage.pop()
            self.seconds[name] = self.seconds.get(name, 0.0) + perf_counter() - start
