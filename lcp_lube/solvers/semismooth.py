"""Semismooth Newton on the Fischer-Burmeister function for l <= x <= u and F(x), with proximal steps where it stalls.

    Phi_i = phi(x_i - l_i, -phi(u_i - x_i, -F_i)),   phi(a, b) = a + b - sqrt(a^2 + b^2)

(Billups 1995; without a bound its phi drops out, a free unknown has Phi_i = F_i; where l = u, Phi_i = x_i - l_i). Newton
with an element V = D_x + D_F F' of the generalised Jacobian and the Armijo rule on ||Phi||^2/2, whose gradient V' Phi takes
over where V is singular or d no descent (De Luca, Facchinei and Kanzow 1996).

Such a method may end in a local minimum of the merit function. It then goes back to the centre c, its start, and solves
F(x) + rho (x - c) instead, for which a large rho makes the problem monotone; the answer becomes the next centre and rho
falls, or rises again where that fails, until F alone is solved (proximal perturbations: Billups and Ferris 1997).
"""

from dataclasses import dataclass

import numpy as np

from ..base.parallel import Array
from ..linear.krylov import LinearSolverError
from ..linear.system import OneMatrix
from ..problems.box import BoxProblem
from ..problems.solution import Fields, Step
from .fischer import derivatives
from .job import Job
from .method import Method
from .method_options import MethodOptions, least, option, part
from .newton import StalledError
from .steplength import StepLengthError, armijo, halve_until

DESCENT = 1e-10  # d is a direction of descent if its slope is below -DESCENT ||d||^2.1


@dataclass(frozen=True)
class SemismoothOptions(MethodOptions):
    """rtol: of the inner solves. beta, halvings: Armijo's. patience: steps within which ||Phi|| has to halve. solved: the part
    of its first ||Phi|| that ends a perturbed problem. fall, rise: factors of rho after a success and a failure.
    rho_max: rho, in parts of its first, beyond which it is taken to have stalled."""

    method = "semismooth"
    rtol: float = part(1e-8)
    beta: float = part(1e-4)
    halvings: int = least(1, 30)
    patience: int = least(1, 40)
    solved: float = part(1e-3)
    fall: float = part(0.3)
    rise: float = option(10.0, lambda rise: 1 < rise < np.inf, "a number above 1 is needed")
    rho_max: float = least(1, 1e12)


def fischer(a: Array, b: Array) -> tuple[Array, Array, Array]:
    """phi(a, b) without cancellation, and the two derivatives; the other sign than `fischer.fischer_burmeister`."""
    r = np.hypot(a, b)
    total = a + b
    with np.errstate(invalid="ignore", divide="ignore"):
        by_a, by_b = derivatives(a, b)
        return np.where(total > 0, 2.0 * a * (b / (total + r)), total - r), -by_a, -by_b


class Semismooth(Method):
    """The iterates x; `newton.iterate` runs it. `norm` is the largest |mid(x - u, F, x - l)| at x moved into the bounds."""

    Options = SemismoothOptions
    problem: BoxProblem
    state = ("x", "centre", "rho", "_rho0", "_first", "_mark", "_since", "norm")

    def __init__(self, job: Job):
        super().__init__(job)
        problem, start, stages = self.problem, job.start, self.stages
        l, u = problem.lower, problem.upper
        self._has_l, self._has_u, self._fixed = np.isfinite(l), np.isfinite(u), l == u
        self.x = np.clip(start["v"], l, u) if start else problem.v0.copy()
        self.centre, self.rho = self.x, 0.0
        with stages("assembly"):
            jacobian = problem.jacobian(self.x)
            self.system = OneMatrix(problem, stages, jacobian.duplicate(copy=True))
            jacobian.getDiagonal(self.system.x)
            size = problem.reduce.sum(np.abs(self.system.x.array_r)) / problem.unknowns
            self._rho0 = size if 0 < size < np.inf else 1.0
        self._begin()
        self.norm = self._natural()

    @property
    def fields(self) -> Fields:
        return {"v": np.clip(self.x, self.problem.lower, self.problem.upper)}

    def _natural(self) -> float:
        x = self.fields["v"]
        return self.problem.reduce.max(np.abs(self.problem.natural_residual(x, self.problem.residual(x))))

    def _begin(self) -> None:
        """Start on the problem with the present rho, from x."""
        self._first = self._mark = self.problem.reduce.norm(self._phi(self.x)[0])
        self._since = 0

    def _phi(self, x: Array) -> tuple[Array, Array, Array]:
        """Phi and the diagonals D_x, D_F at x, F being perturbed by rho (x - centre). Collective."""
        problem = self.problem
        w = problem.residual(x) + self.rho * (x - self.centre)
        D_x, D_F = np.zeros_like(x), np.ones_like(x)
        with np.errstate(invalid="ignore"):  # infinite distances are those of absent bounds
            upper, by_distance, by_w = fischer(problem.upper - x, -w)
            w = np.where(self._has_u, -upper, w)
            D_x, D_F = np.where(self._has_u, by_distance, D_x), np.where(self._has_u, by_w, D_F)
            lower, by_distance, by_w = fischer(x - problem.lower, w)
            D_x = np.where(self._has_l, by_distance + by_w * D_x, D_x)
            D_F = np.where(self._has_l, by_w * D_F, D_F)
            phi = np.where(self._fixed, x - problem.lower, np.where(self._has_l, lower, w))
        return phi, np.where(self._fixed, 1.0, D_x), np.where(self._fixed, 0.0, D_F)

    def _direction(self, phi: Array, D_x: Array, D_F: Array) -> tuple[Array, float, int]:
        """d, the slope of ||Phi||^2/2 along it, and the number of linear iterations. Collective."""
        reduce, mat, x, b = self.problem.reduce, self.system.mat, self.system.x, self.system.b
        with self.stages("Jacobian"):
            self.problem.jacobian(self.x).copy(mat, structure=mat.Structure.SAME_NONZERO_PATTERN)
            x.setArray(D_F)
            mat.diagonalScale(x, None)
            mat.getDiagonal(b)
            b.setArray(b.array_r + D_x + self.rho * D_F)
            mat.setDiagonal(b)
            mat.assemble()
            b.setArray(phi)
            mat.multTranspose(b, x)
            gradient = x.array_r.copy()
        with self.stages("KSP"):
            try:
                b.setArray(-phi)
                iterations = self.system.krylov.solve(b, x, self.options.rtol)
                d = x.array_r.copy()
                slope = reduce.dot(gradient, d)
                if slope <= -DESCENT * reduce.norm(d) ** 2.1:
                    return d, slope, iterations
            except LinearSolverError:
                iterations = 0  # V is singular
        return -gradient, -reduce.dot(gradient, gradient), iterations

    def advance(self) -> Step:
        """One Newton or gradient step on the present problem, or the change to the next one. Collective."""
        o, reduce, before = self.options, self.problem.reduce, self.x
        phi, D_x, D_F = self._phi(self.x)
        merit = 0.5 * reduce.dot(phi, phi)
        d, slope, iterations = self._direction(phi, D_x, D_F)

        def decreases(alpha: float) -> bool:
            new = self._phi(self.x + alpha * d)[0]
            return armijo(merit, 0.5 * reduce.dot(new, new), alpha, slope, o.beta)

        alpha, cuts = 0.0, o.halvings
        with self.stages("step length"):
            try:
                alpha, cuts = halve_until(decreases, 1.0, most=o.halvings)
                self.x = self.x + alpha * d
            except StepLengthError:
                self._since = o.patience
            self.norm = self._natural()
            self._judge()
        step_norm = reduce.norm(self.x - before)
        return Step(self.norm, step_norm, alpha, iterations, 0, cuts, self.rho, o.rtol)

    def _judge(self) -> None:
        """Whether to go on, to take x as the next centre, or to go back to the last one with a larger rho. Collective."""
        o = self.options
        size = self.problem.reduce.norm(self._phi(self.x)[0])
        if size <= 0.5 * self._mark:
            self._mark, self._since = size, 0
        self._since += 1
        if self.rho > 0 and size <= o.solved * self._first:
            self.centre, self.rho = self.x, o.fall * self.rho
            if self.rho < o.solved * self._rho0:
                self.rho = 0.0
            self._begin()
        elif self._since > o.patience:
            self.x, self.rho = self.centre, max(self._rho0, o.rise * self.rho)
            if self.rho > o.rho_max * self._rho0:
                raise StalledError(
                    f"residual {self.norm:.1e}, and rho has risen by more than {o.rho_max:g} (semismooth.rho_max)"
                )
            self._begin()
