"""Primal-dual active set for l <= v <= u and f(v): the semismooth Newton method for the natural residual.

    R(v) = mid(v - u, D^-1 f(v), v - l) = 0,   D = diag f' at the start (1 where that is not positive).

Points where the middle value is v - l or v - u are held at the bound, the others take a Newton step for f. Where the
bounds in contact come out as they went in, this is Newton's method and converges as fast. The start is a coarser grid's
answer where there is one (nested iteration): on one grid alone the contact area moves by a few cells a step.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ..base.parallel import Array
from ..linear.box import BoxSystem
from ..problems.box import BoxProblem
from ..problems.solution import Fields, Step
from .job import Job
from .method import Method
from .method_options import MethodOptions, part
from .steplength import halve_until, inexact_decrease

Trial = tuple[Array, Array, Array]  # v, f(v), R(v)
HALVINGS = 12  # to 2.4e-4 of a step: what decreases no sooner is left to the next signs
NEAR = 1e-2  # steps below this part of max |v| leave the size of f's terms as it is


@dataclass(frozen=True)
class BoxActiveSetOptions(MethodOptions):
    """rtol: relative tolerance of the first inner solves, which falls with ||R|| to 0.1 % of it; beta: of the decrease test."""

    method = "active-set"
    rtol: float = part(1e-2)
    beta: float = part(1e-4)


class BoxActiveSet(Method):
    """The iterates v; `newton.iterate` runs it.

    `norm` is max |D R(v)| against the mean size of the terms of f; steps are measured against max |v|. D is that of the start.
    """

    Options = BoxActiveSetOptions
    problem: BoxProblem
    system: BoxSystem
    state = ("v", "D", "f", "R", "_scale", "norm")

    def __init__(self, job: Job):
        super().__init__(job)
        problem, start = self.problem, job.start
        self.system = system = BoxSystem(problem, self.stages)
        self.v = np.clip(start["v"], problem.lower, problem.upper) if start else problem.v0
        diagonal = system.linearise(self.v)
        self.D = np.where(diagonal > 0, diagonal, 1.0)
        self.f = problem.residual(self.v)
        self.R = problem.natural_residual(self.v, self.f, f_scale=self.D)
        self._scale = problem.scales(self.v)[1]
        self.norm = self._norm()

    @property
    def fields(self) -> Fields:
        return {"v": self.v}

    def _norm(self) -> float:
        if not np.isfinite(self._scale):  # f has overflowed, where R may still be the distance to a bound
            return float("inf")
        return self.problem.reduce.max(np.abs(self.D * self.R)) / (self._scale or 1.0)

    def advance(self) -> Step:
        """One Newton step on the points that touch no bound, halved until ||R|| decreases. Collective."""
        problem, reduce, o = self.problem, self.problem.reduce, self.options
        v, newton = self.v, self.f / self.D
        held = (newton >= v - problem.lower) | (newton <= v - problem.upper)
        # Superlinear: an inner solve need not be better than the linearisation, which errs by the square.
        rtol = min(o.rtol, max(0.1 * self.norm, 1e-3 * o.rtol))
        self.system.linearise(v)
        d, iterations = self.system.solve(-np.where(held, self.R, self.f), rtol, held=held)

        @lru_cache(maxsize=1)
        def trial(alpha: float) -> Trial:
            at = np.clip(v + alpha * d, problem.lower, problem.upper)
            f = problem.residual(at)
            return at, f, problem.natural_residual(at, f, f_scale=self.D)

        with self.system.stages("step length"):
            before = reduce.norm(self.R)
            alpha, cuts = halve_until(
                lambda alpha: inexact_decrease(before, reduce.norm(trial(alpha)[2]), alpha, 0.0, o.beta), 1.0, most=HALVINGS
            )
            self.v, self.f, self.R = trial(alpha)
            step_norm = reduce.max(np.abs(self.v - v)) / (max(reduce.max(np.abs(self.v)), problem.idle[0]) or 1.0)
            if step_norm > NEAR:
                self._scale = problem.scales(self.v)[1]
            self.norm = self._norm()
        return Step(self.norm, step_norm, alpha, iterations, backtracking=cuts, rtol=rtol)
