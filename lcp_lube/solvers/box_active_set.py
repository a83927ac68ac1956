"""Primal-dual active set for l <= v <= u and f(v): the semismooth Newton method for the natural residual.

    R(v) = mid(v - u, D^-1 f(v), v - l) = 0,   D = diag f' at the start (1 where that is not positive).

Points where the middle value is v - l or v - u are held at the bound, the others take a Newton step for f. Where the
bounds in contact come out as they went in, this is Newton's method and converges as fast. The start is a coarser grid's
answer where there is one (nested iteration): on one grid alone the contact area moves by a few cells a step.

Where no part of a step makes ||R|| smaller, as before a turning point, an obstacle problem goes on along the flow
D v' = -f(v) between the bounds by implicit steps (pseudo-transient continuation: Kelley and Keyes 1998), down to a solution.
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
from .steplength import StepLengthError, halve_until, inexact_decrease

Trial = tuple[Array, Array, Array]  # v, f(v), R(v)
HALVINGS = 12  # to 2.4e-4 of a step: what decreases no sooner is left to the next signs
ROUNDING = 1e-13  # ||R|| so small, as a start that is the answer may have, decreases no more
STRIDE, SHORTEST = (
    0.5,
    1e-9,
)  # of a flow: a step's part of the largest |v| so far, and the step, in times of D, that is taken whatever it does
TINY = float(np.finfo(float).tiny)
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
    state = ("v", "D", "f", "R", "_scale", "norm", "pace", "reach")

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
        self.norm, self.pace, self.reach = self._norm(), 0.0, problem.reduce.max(np.abs(self.v))

    @property
    def fields(self) -> Fields:
        return {"v": self.v}

    def _norm(self) -> float:
        if not np.isfinite(self._scale):  # f has overflowed, where R may still be the distance to a bound
            return float("inf")
        return self.problem.reduce.max(np.abs(self.D * self.R)) / (self._scale or 1.0)

    def advance(self) -> Step:
        """A Newton step on the points that touch no bound, halved until ||R|| decreases, or one along the flow. Collective."""
        # Superlinear: an inner solve need not be better than the linearisation, which errs by the square.
        rtol = min(self.options.rtol, max(0.1 * self.norm, 1e-3 * self.options.rtol))
        self.system.linearise(self.v)
        if self.pace == 0.0:
            try:
                return self._newton(rtol)
            except StepLengthError:
                if self.problem.kind != "box":
                    raise
                self.pace = 1.0
        return self._flow(rtol)

    def _direction(self, rtol: float, pace: float = np.inf) -> tuple[Array, int, float]:
        """d, the number of linear iterations, and the slope of f along d where no bound is touched. Collective."""
        problem, step = self.problem, min(pace, 1.0) * self.f / self.D
        low, high = step >= self.v - problem.lower, step <= self.v - problem.upper
        held = low | high
        rhs = -np.where(low, self.v - problem.lower, np.where(high, self.v - problem.upper, self.f))
        d, iterations = self.system.solve(rhs, rtol, None if pace == np.inf else self.D / pace, held)
        d = np.where(held, rhs, d)  # to the bit
        return d, iterations, problem.reduce.dot(np.where(held, 0.0, self.f), d)

    def _newton(self, rtol: float) -> Step:
        d, iterations, _ = self._direction(rtol)
        with self.system.stages("step length"):
            reduce = self.problem.reduce
            before, trial = reduce.norm(self.R), lru_cache(maxsize=1)(lambda alpha: self._at(self.v + alpha * d))

            def decreases(alpha: float) -> bool:
                return self.norm <= ROUNDING or inexact_decrease(
                    before, reduce.norm(trial(alpha)[2]), alpha, 0.0, self.options.beta
                )

            alpha, cuts = halve_until(decreases, 1.0, most=HALVINGS)
            return self._go(trial(alpha), alpha, iterations, cuts, rtol)

    def _flow(self, rtol: float) -> Step:
        """An implicit step of length `pace` along D v' = -f(v) between the bounds: where f is the slope of an energy that goes
        down to a solution. Long steps are Newton's."""
        reduce, cuts, total = self.problem.reduce, 0, 0
        self.reach = max(self.reach, reduce.max(np.abs(self.v)))
        while True:
            d, iterations, slope = self._direction(rtol, self.pace)
            new, total = self._at(self.v + d), total + iterations
            moved = reduce.max(np.abs(new[0] - self.v)) / max(self.reach, reduce.max(np.abs(new[0])), TINY)
            if self.pace < SHORTEST or (slope <= 0.0 and (moved <= STRIDE or self.reach == 0.0)):
                break
            self.pace, cuts = 0.25 * self.pace, cuts + 1
        alpha = min(self.pace, 1.0)
        self.pace *= min(4.0, STRIDE / max(moved, TINY))
        return self._go(new, alpha, total, cuts, rtol)

    def _at(self, v: Array) -> Trial:
        v = np.clip(v, self.problem.lower, self.problem.upper)
        f = self.problem.residual(v)
        return v, f, self.problem.natural_residual(v, f, f_scale=self.D)

    def _go(self, to: Trial, alpha: float, iterations: int, cuts: int, rtol: float) -> Step:
        """Move, and tell of it. Collective."""
        problem, reduce, v = self.problem, self.problem.reduce, self.v
        self.v, self.f, self.R = to
        step_norm = reduce.max(np.abs(self.v - v)) / (max(reduce.max(np.abs(self.v)), problem.idle[0]) or 1.0)
        if step_norm > NEAR:
            self._scale = problem.scales(self.v)[1]
        self.norm = self._norm()
        return Step(self.norm, step_norm, alpha, iterations, backtracking=cuts, rtol=rtol)
