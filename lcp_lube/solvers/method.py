"""What the outer loop and its caller need of a method: ||F|| at the start, one step at a time, and the fields it reached."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..linear.krylov import Krylov
from ..linear.system import System, make_system
from ..problems.certificate import Certificate
from ..problems.solution import Fields, Step
from .method_options import MethodOptions, make_options

if TYPE_CHECKING:
    from ..problems.film.lubrication import LubricationProblem
    from .job import Job


class Method:
    """Base of all methods: a job's problem, clocks, tolerances and options.

    Raises
    ------
    InputError : an unknown option, or a value out of range.

    Attributes
    ----------
    Options : the dataclass of its options.
    state : the attributes that a step starts from: numbers, arrays of this rank's points, or tuples and dataclasses of these.
        A checkpoint keeps them, all else is made anew; a method without any cannot be taken up again.
    norm : ||F|| at the present fields, in the method's own measure.
    certificate : of the present fields, where a step has needed it.
    system : the matrix behind the steps and its KSP; None for a method without one.
    """

    Options: type[MethodOptions] = MethodOptions
    state: tuple[str, ...] = ()
    norm: float
    certificate: Certificate | None = None
    system: Any = None

    def __init__(self, job: Job, **defaults: Any):
        self.problem: Any = job.problem
        self.stages, self.eps1 = job.stages, job.stopping.eps1
        self.options: Any = make_options(self.Options, {**defaults, **job.options})

    @property
    def fields(self) -> Fields:
        raise NotImplementedError

    @property
    def krylov(self) -> Krylov | None:
        """The KSP behind the steps, for the record."""
        return self.system and self.system.krylov

    def advance(self) -> Step:
        """One step. Collective."""
        raise NotImplementedError

    def destroy(self) -> None:
        """Free the PETSc objects that the method made; a python PC must not outlive this."""
        if self.system is not None:
            self.system.destroy()


class PairMethod(Method):
    """A method for films whose iterates are p and r, by a linear system: from a start, or from p0 and r0 at every point."""

    problem: LubricationProblem
    system: System

    def __init__(self, job: Job):
        super().__init__(job, tol_min=job.inner_floor)
        problem, start, n = self.problem, job.start, self.problem.grid.local_size
        self.system = make_system(job.system, problem, self.stages)
        self.p = start["p"].copy() if start else np.full(n, self.options.p0)
        self.r = start["r"].copy() if start else np.full(n, self.options.r0)
        self.F1 = problem.flow(self.p, self.r)

    @property
    def fields(self) -> Fields:
        return {"p": self.p, "r": self.r}
