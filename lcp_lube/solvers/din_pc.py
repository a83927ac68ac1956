"""DIN with a predictor-corrector step (Mehrotra): two solves with one factorisation, and far fewer iterations.

The predictor is the pure Newton direction; how far it gets before the boundary tells how much centring the corrector needs,
sigma = (mu_affine/mu)^3, and its second-order term dp dr is put right. Where the centrality conditions would cut that step,
more centring (one more solve with the same matrix) goes further than a shorter step. Convergence is tested as in DIN.
"""

from dataclasses import dataclass

import numpy as np

from ..base.parallel import Array
from ..problems.solution import Step
from .din import DIN, INSIDE
from .method_options import MethodOptions, part, positive
from .steplength import feasible, halve_until

CENTRING = (0.0, 0.01, 0.1)  # sigma at least; the next where the step would leave the central path's neighbourhood


@dataclass(frozen=True)
class DinPcOptions(MethodOptions):
    """p0 (in p_unit), r0: start; boundary: part of the way to p = 0 or r = 0 that a step may go, at least; tol_min: relative
    tolerance of iterative inner solves; gamma: of the centrality conditions (28), (29)."""

    method = "din-pc"
    p0: float = positive(1.0, "--p0", INSIDE)
    r0: float = positive(0.1, "--r0", INSIDE)
    boundary: float = part(0.9995)
    tol_min: float = part(1e-8)
    gamma: float = part(0.5)


class DinPc(DIN):
    """The iterates of DIN by predictor-corrector steps."""

    Options = DinPcOptions

    def advance(self) -> Step:
        """One predictor, a corrector, or up to three; alpha as close to the boundary as the centrality conditions allow."""
        reduce, n, rtol = self.problem.reduce, self.problem.size, self.options.tol_min
        p, r = self.p, self.r
        products = p * r
        mu = reduce.sum(products) / n
        dp, dr, its = self.system.solve(r, p, -self.F1, -products, rtol)
        alpha = feasible(reduce, (p, dp), (r, dr))
        mu_affine = reduce.dot(p + alpha * dp, r + alpha * dr) / n
        sigma = float(np.clip(mu_affine / mu, 0.0, 1.0)) ** 3 if mu > 0.0 else 0.0  # products below 1e-308 are none
        second_order = dp * dr

        def central(alpha: float) -> bool:
            trial: tuple[Array, Array] = (p + alpha * dp, r + alpha * dr)
            return self.central.holds(trial[0] * trial[1], reduce.norm(self.problem.flow(*trial)))

        # Towards a full step near the solution, where the products vanish: superlinear convergence needs it.
        near = max(self.options.boundary, 1.0 - mu)
        for floor in CENTRING:
            sigma = max(sigma, floor)
            dp, dr, more = self.system.resolve(-self.F1, sigma * mu - products - second_order, rtol)
            its += more
            alpha = feasible(reduce, (p, dp / near), (r, dr / near))  # near times the step to the boundary, at most 1
            if central(alpha):
                break
        with self.system.stages("step length"):
            alpha, cuts = halve_until(central, alpha)
            self.p, self.r = p + alpha * dp, r + alpha * dr
            self.F1 = self.problem.flow(self.p, self.r)
            self.norm = reduce.norm(self.F1, self.p * self.r)
            step_norm = alpha * reduce.norm(dp, dr)
        return Step(self.norm, step_norm, alpha, its, cuts, 0, sigma, rtol)
