"""Damped inexact Newton (DIN) of Mezzadri and Galligani: an interior method for F(p, r) = (A p + B r - c, P R e) = 0."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ..base.parallel import Array
from ..problems.solution import Step
from .job import Job
from .method import PairMethod
from .method_options import MethodOptions, one_of, option, part, positive
from .steplength import Centrality, feasible, halve_until, inexact_decrease, reduction

Trial = tuple[Array, Array, Array]  # p, r, F1


# mu by gap = p'r, ||F|| and n: the average complementarity; what never vanishes before F does, so that a start near zero can
# leave the boundary; the first while p'r > 0.1, then the second.
MU_RULES: dict[str, Callable[[float, float, int], float]] = {
    "mu1": lambda gap, norm, n: gap / n,
    "mu2": lambda gap, norm, n: norm / np.sqrt(n),
    "adaptive": lambda gap, norm, n: gap / n if gap > 0.1 else norm / np.sqrt(n),
}
INSIDE = " (the method starts inside p, r > 0)"


def _subset(letters: str) -> bool:
    return set(letters) <= set("FRCB") and len(set(letters)) == len(letters)


@dataclass(frozen=True)
class DinOptions(MethodOptions):
    """Parameters of DIN; the defaults are the paper's.

    p0 (in the problem's pressure unit) and r0 start every point. conditions is any combination of F (feasibility),
    R (reduction), C (centrality), B (backtracking). inner: iterative inner solves stop at the relative tolerance
    max(tol_min, delta_k ||F||) ('relative'), or where the residual is at most delta_k ||F||, without a floor ('residual'; the
    KSP must test the true residual for that, -ksp_pc_side right).
    """

    method = "din"
    p0: float = positive(1.0, "--p0", INSIDE)
    r0: float = positive(0.1, "--r0", INSIDE)
    mu: str = one_of("mu2", MU_RULES, "--mu")
    conditions: str = option("FCB", _subset, "any combination of the letters F, R, C, B, each once", "--conditions")
    sigma_max: float = part(0.9)
    sigma_factor: float = part(0.01)
    gamma: float = part(0.5)
    theta: float = part(0.5)
    beta: float = part(1e-4)
    tol_min: float = part(1e-8)
    inner: str = one_of("relative", ("relative", "residual"))


class DIN(PairMethod):
    """The iterates and steps of DIN; `newton.iterate` runs it."""

    Options: type[MethodOptions] = DinOptions
    state: tuple[str, ...] = ("p", "r", "F1", "norm", "central.tau1", "central.tau2")  # what a step starts from

    def __init__(self, job: Job):
        super().__init__(job)
        reduce, products = self.problem.reduce, self.p * self.r
        self.central = Centrality(reduce, products, self.problem.size, reduce.norm(self.F1), self.options.gamma)
        self.norm = reduce.norm(self.F1, products)

    def forcing(self, sigma: float) -> float:
        """delta_k of the inner solves, at most 0.1 and small enough for (31), sigma_k > delta_k max(...)."""
        n, c, gamma = self.problem.size, self.central, self.options.gamma
        worst = max(
            (np.sqrt(n) + c.tau1 * gamma) / (1.0 - c.tau1 * gamma),
            (np.sqrt(n) + c.tau2 * gamma) / np.sqrt(n),
        )
        return min(0.1, sigma / n / worst)

    def advance(self) -> Step:
        """One step: perturbed Newton direction, then alpha by the conditions in the order F, R, C, B."""
        o, n, reduce = self.options, self.problem.size, self.problem.reduce
        p, r, norm = self.p, self.r, self.norm
        products = p * r
        gap = reduce.sum(products)
        sigma = min(o.sigma_max, o.sigma_factor * norm)
        mu = MU_RULES[o.mu](gap, norm, n)
        delta = 0.0 if self.system.direct else self.forcing(sigma)
        rtol, rhs2 = max(o.tol_min, delta * norm), sigma * mu - products
        if o.inner == "residual" and not self.system.direct:
            rtol = float(np.clip(delta * norm / reduce.norm(self.F1, rhs2), 1e-15, 0.1))
        dp, dr, linear_iterations = self.system.solve(r, p, -self.F1, rhs2, rtol)

        with self.system.stages("step length"):
            alpha, centrality, backtracking, trial = self._step_length(dp, dr, gap, sigma + delta)
            self.p, self.r, self.F1 = trial
            self.norm = reduce.norm(self.F1, self.p * self.r)
            step_norm = alpha * reduce.norm(dp, dr)
        return Step(self.norm, step_norm, alpha, linear_iterations, centrality, backtracking, sigma, rtol)

    def _step_length(self, dp: Array, dr: Array, gap: float, forcing: float) -> tuple[float, int, int, Trial]:
        """alpha, the cuts that centrality and backtracking made, and p, r, F1 at the new point."""
        o, reduce = self.options, self.problem.reduce
        alpha, centrality, backtracking = 1.0, 0, 0

        @lru_cache(maxsize=1)  # C, B and the step itself ask for the same point
        def trial(alpha: float) -> Trial:
            # F1 is affine, but its value at the trial point is what the paper tests: at rounding level they differ.
            p, r = self.p + alpha * dp, self.r + alpha * dr
            return p, r, self.problem.flow(p, r)

        def central(alpha: float) -> bool:
            p, r, F1 = trial(alpha)
            return self.central.holds(p * r, reduce.norm(F1))

        def decreases(alpha: float) -> bool:
            p, r, F1 = trial(alpha)
            return inexact_decrease(self.norm, reduce.norm(F1, p * r), alpha, forcing, o.beta)

        if "F" in o.conditions:
            alpha = feasible(reduce, (self.p, dp), (self.r, dr))
        if "R" in o.conditions:
            alpha = reduction(alpha, gap)
        if "C" in o.conditions:
            alpha, centrality = halve_until(central, alpha, o.theta)
        if "B" in o.conditions:
            alpha, backtracking = halve_until(decreases, alpha, o.theta)
        return alpha, centrality, backtracking, trial(alpha)
