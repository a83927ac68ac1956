"""Principal pivoting on the full cells: small films of any ratio of heights, right to the last digits (`film.graded`)."""

import numpy as np

from ..linear.krylov import LinearSolverError
from ..problems.film.graded import Pivots
from ..problems.solution import Fields, Step
from .job import Job
from .method import Method
from .method_options import MethodOptions


class PivotingOptions(MethodOptions):
    """There are none."""

    method = "pivoting"


class Pivoting(Pivots, Method):
    """`newton.iterate` runs it, always from a full film: signs that rounding has made elsewhere are a poor start.

    `norm` is the share of cells whose sign is wrong.
    """

    Options = PivotingOptions
    state = ("p", "r", "full", "norm", "_fewest", "_patience")

    def __init__(self, job: Job):
        Method.__init__(self, job)
        ones = np.ones(job.problem.grid.local_size)
        Pivots.__init__(self, job.problem, ones, 0.0 * ones)
        self.norm = 1.0

    @property
    def fields(self) -> Fields:
        return {"p": self.p, "r": self.r}

    def advance(self) -> Step:
        """One set of full cells."""
        try:
            with self.stages("KSP"):
                moved = self.step()
        except ZeroDivisionError as error:
            raise LinearSolverError(str(error)) from None
        self.norm = self.wrong / self.problem.size
        return Step(self.norm, moved, 1.0, enough=not self.wrong)
