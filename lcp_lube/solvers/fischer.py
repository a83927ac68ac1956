"""Fischer-Burmeister Newton (FBN-A, FBN-I): a semismooth Newton method for F~(p, r) = (A p + B r - c, phi(p, r)) = 0.

phi(p, r) = sqrt(p^2 + r^2) - p - r vanishes exactly where p >= 0, r >= 0 and p r = 0, so the iterates may have any sign.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ..base.parallel import Array
from ..problems.solution import Step
from .job import Job
from .method import PairMethod
from .method_options import MethodOptions, option, part
from .steplength import StepLengthError, armijo, halve_until, inexact_decrease

SMALL = np.finfo(float).tiny / np.finfo(float).eps

Trial = tuple[Array, Array, Array, Array]  # p, r, F1, F2
Direction = tuple[Array, Array, Array]  # dp, dr, and the change of F2 along them


def fischer_burmeister(p: Array, r: Array) -> Array:
    """phi = sqrt(p^2 + r^2) - p - r, subtracted as printed.

    The equivalent -2 p r/(sqrt(p^2 + r^2) + p + r) would be exact for |p| << r, and then the residue of p in the cavity
    that the paper's table 7 shows (some 1e-18, of either sign) would not be there.
    """
    return np.hypot(p, r) - p - r


def derivatives(p: Array, r: Array) -> tuple[Array, Array]:
    """D_p = p/s - 1 and D_r = r/s - 1 with s = sqrt(p^2 + r^2).

    Where p = r = 0, phi has no derivative; (1/sqrt 2 - 1, 1/sqrt 2 - 1) is the element of its generalised Jacobian
    {(a - 1, b - 1): a^2 + b^2 <= 1} that the approach along p = r gives. Numbers too small for s to have its digits count as 0.
    """
    s = np.hypot(p, r)
    origin = s < SMALL
    s = np.where(origin, 1.0, s)
    return np.where(origin, np.sqrt(0.5), p / s) - 1.0, np.where(origin, np.sqrt(0.5), r / s) - 1.0


@dataclass(frozen=True)
class FischerOptions(MethodOptions):
    """Parameters of FBN; the defaults are the paper's where it has them.

    p0 (in the problem's pressure unit) and r0 start every point. beta is the share of the predicted decrease that a step
    must reach, theta the factor that cuts it. Iterative inner solves stop at the relative residual
    delta_k = max(tol_min, min(delta_max, delta_factor ||F~||)): quadratic convergence down to tol_min.
    """

    method = "fbn-i"
    p0: float = option(1.0, np.isfinite, "a finite number is needed", "--p0")
    r0: float = option(0.1, np.isfinite, "a finite number is needed", "--r0")
    beta: float = part(1e-4)
    theta: float = part(0.5)
    delta_max: float = part(0.1)
    delta_factor: float = part(0.01)
    tol_min: float = part(1e-8)


class ArmijoOptions(FischerOptions):
    method = "fbn-a"


class FischerNewton(PairMethod):
    """The iterates and steps of FBN; `newton.iterate` runs it.

    A step is halved until a merit function falls enough: ||F~|| as an inexact Newton step must make it (FBN-I).
    """

    Options: type[MethodOptions] = FischerOptions
    state: tuple[str, ...] = ("p", "r", "F1", "F2", "norm")

    def __init__(self, job: Job):
        super().__init__(job)
        self.F2 = fischer_burmeister(self.p, self.r)
        self.norm = self.problem.reduce.norm(self.F1, self.F2)

    def advance(self) -> Step:
        """One step: the Newton direction of F~, then alpha = 1 halved until the merit function falls enough."""
        o, reduce = self.options, self.problem.reduce
        delta = 0.0 if self.system.direct else max(o.tol_min, min(o.delta_max, o.delta_factor * self.norm))
        D_p, D_r = derivatives(self.p, self.r)
        dp, dr, linear_iterations = self.system.solve(D_p, D_r, -self.F1, -self.F2, delta)

        with self.system.stages("step length"):

            @lru_cache(maxsize=1)  # the test and the step itself ask for the same point
            def trial(alpha: float) -> Trial:
                p, r = self.p + alpha * dp, self.r + alpha * dr
                return p, r, self.problem.flow(p, r), fischer_burmeister(p, r)

            decreases = self._decrease(trial, (dp, dr, D_p * dp + D_r * dr), delta)
            alpha, backtracking = halve_until(decreases, 1.0, o.theta)
            self.p, self.r, self.F1, self.F2 = trial(alpha)
            self.norm = reduce.norm(self.F1, self.F2)
            step_norm = alpha * reduce.norm(dp, dr)
        return Step(self.norm, step_norm, alpha, linear_iterations, backtracking=backtracking, rtol=delta)

    def _decrease(self, trial: Callable[[float], Trial], d: Direction, delta: float) -> Callable[[float], bool]:
        """The test of a trial alpha."""
        reduce, norm, beta = self.problem.reduce, self.norm, self.options.beta
        return lambda alpha: inexact_decrease(norm, reduce.norm(*trial(alpha)[2:]), alpha, delta, beta)


class ArmijoNewton(FischerNewton):
    """FBN-A: the Armijo rule on ||F~||^2/2."""

    Options = ArmijoOptions

    def _decrease(self, trial: Callable[[float], Trial], d: Direction, delta: float) -> Callable[[float], bool]:
        """The test; raises StepLengthError where the inner solver's direction does not reduce the merit function."""
        reduce, norm, beta, slope = self.problem.reduce, self.norm, self.options.beta, self._slope(*d)
        if slope >= 0.0 and norm > 0.0:
            raise StepLengthError(f"the inexact direction is not one of descent: slope {slope:.1e}")
        return lambda alpha: armijo(0.5 * norm**2, 0.5 * reduce.norm(*trial(alpha)[2:]) ** 2, alpha, slope, beta)

    def _slope(self, dp: Array, dr: Array, change2: Array) -> float:
        """Derivative of Phi = ||F~||^2/2 along d, F~ . F~' d: -2 Phi for an exact step."""
        problem = self.problem
        if self.system.direct:
            return -(self.norm**2)
        change1 = problem.multiply(problem.A, dp) + problem.multiply(problem.B, dr)
        return problem.reduce.dot(self.F1, change1) + problem.reduce.dot(self.F2, change2)
