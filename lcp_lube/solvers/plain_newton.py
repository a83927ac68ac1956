"""Newton's method for f(v) = 0, exact or inexact: no complementarity, the same outer loop and KSP.

When the source is convex above v0 <= 0 (`SemilinearProblem.climbs`), full steps need no damping and tell when there is no
solution. f is then order-concave with symmetric f' whose off-diagonal entries are <= 0, and a smallest solution v* >= v0, if
there is one, has f'(v*) positive semidefinite. While v_k <= v*, f'(v_k) >= f'(v*) is a positive definite M-matrix, so

    d_k = -f'(v_k)^-1 f(v_k) >= 0,   f(v_{k+1}) <= 0   and   v_{k+1} <= v*:

the iterates climb to v* (Ortega and Rheinboldt, Iterative Solution of Nonlinear Equations, 13.3). A vector d with
d' f'(v_k) d < 0 therefore shows that no solution exists. Tried are each step, since beyond the turning point the climb goes on
until f' has a negative eigenvalue, and the first eigenvector of A. (With inexact steps all this holds up to their errors.)
"""

from dataclasses import dataclass

import numpy as np
from petsc4py import PETSc

from ..base.parallel import Array
from ..linear.krylov import LinearSolverError
from ..linear.system import OneMatrix
from ..problems.fold import whole_lengths
from ..problems.semilinear import SemilinearProblem
from ..problems.solution import Fields, Step
from .job import Job
from .method import Method
from .method_options import MethodOptions, option, part
from .newton import NoSolutionError
from .steplength import halve_until, inexact_decrease

LOOSEST = 0.1  # true relative residual of an inner solve that a proof may still lean on


@dataclass(frozen=True)
class NewtonOptions(MethodOptions):
    """Parameters of Newton's method.

    eta: relative tolerance of an iterative inner solver; beta: of the decrease test; relative: the run ends also where
    ||f|| <= relative ||f(v0)||, as table 3 of Bergamaschi and Zilli was stopped; 0 switches that off.
    """

    method = "newton"
    eta: float = part(1e-3)
    beta: float = part(1e-4)
    relative: float = option(0.0, lambda part: 0 <= part < 1, "allowed are numbers from 0 to below 1")


class PlainNewton(Method):
    """The iterates of v + alpha d, f'(v) d = -f(v) to a relative tolerance eta; `newton.iterate` runs it.

    alpha = 1 for a convex source from below; else it is halved until ||f|| decreases as an inexact Newton step must.
    """

    Options = NewtonOptions
    problem: SemilinearProblem
    state = ("v", "f", "climbing", "norm", "enough")

    def __init__(self, job: Job):
        super().__init__(job)
        problem, start, stages = self.problem, job.start, self.stages
        self.v = start["v"].copy() if start else np.full(problem.grid.local_size, problem.v0)
        self.climbing = start is None and problem.climbs
        grid = problem.grid
        x, y = ((points - o) / side for points, o, side in zip((grid.x, grid.y), grid.origin, whole_lengths(grid), strict=True))
        self._bump = (np.sin(np.pi * x) * np.sin(np.pi * y)).ravel()  # A's first eigenvector
        with stages("assembly"):
            mat = problem.A.duplicate(copy=True)
            for option in (PETSc.Mat.Option.SYMMETRIC, PETSc.Mat.Option.SYMMETRY_ETERNAL):
                mat.setOption(option, True)
            self.system = OneMatrix(problem, stages, mat)
        self.f = problem.residual(self.v)
        self.norm = problem.reduce.norm(self.f)
        self.enough = self.options.relative * self.norm  # of ||f||

    @property
    def fields(self) -> Fields:
        return {"v": self.v}

    def direction(self) -> tuple[Array, int]:
        """d and the number of linear iterations. Collective.

        Raises
        ------
        LinearSolverError : breakdown, a failed factorisation, or a result that is not finite.
        NoSolutionError : climbing, and f' is not positive definite, as d or a direction inside the KSP shows.
        """
        mat, x, b, krylov = self.system.mat, self.system.x, self.system.b, self.system.krylov
        with self.stages("Jacobian"):
            x.setArray(self.problem.jacobian_diagonal(self.v))
            mat.setDiagonal(x)
            mat.assemble()
            b.setArray(-self.f)
        with self.stages("KSP"):
            try:
                iterations = krylov.solve(b, x, self.options.eta)
            except LinearSolverError:
                indefinite = PETSc.KSP.ConvergedReason.DIVERGED_INDEFINITE_MAT
                if self.climbing and krylov.ksp.getConvergedReason() == indefinite:
                    raise self._no_solution() from None
                raise
        d = x.array_r.copy()
        # A KSP that stopped early gives no d that proves anything, even if it reports success.
        self.climbing = self.climbing and krylov.ksp.getConvergedReason() > 0 and self._solves(d)
        if self.climbing and min(self._curvature(d), self._curvature(self._bump)) < 0:
            raise self._no_solution()
        return d, iterations

    def _solves(self, d: Array) -> bool:
        """Whether f'(v) d + f is small against f: the KSP may have tested another norm, or lie. Collective."""
        return self.problem.reduce.norm(self._times(d) + self.f) <= LOOSEST * self.norm

    def _curvature(self, d: Array) -> float:
        """d' f'(v) d. Collective."""
        return self.problem.reduce.dot(self._times(d), d)

    def _times(self, d: Array) -> Array:
        """f'(v) d. Collective."""
        self.system.x.setArray(d)
        self.system.mat.mult(self.system.x, self.system.b)
        return self.system.b.array_r

    def _no_solution(self) -> NoSolutionError:
        return NoSolutionError(f"{self.problem.source.no_solution}: f' lost its definiteness on Newton's climb from below")

    def advance(self) -> Step:
        """One step. Collective."""
        problem, reduce, norm = self.problem, self.problem.reduce, self.norm
        d, iterations = self.direction()
        alpha, cuts = 1.0, 0
        if not self.climbing:
            eta = 0.0 if self.system.direct else self.options.eta
            # f itself is no more accurate than this: below it nothing can be asked to decrease.
            rounding = float(np.finfo(float).eps) * problem.largest_diagonal * reduce.norm(self.v)

            def decreases(alpha: float) -> bool:
                trial = reduce.norm(problem.residual(self.v + alpha * d))
                return trial <= rounding or inexact_decrease(norm, trial, alpha, eta, self.options.beta)

            with self.stages("step length"):
                alpha, cuts = halve_until(decreases, alpha)
        self.v = self.v + alpha * d
        self.f = problem.residual(self.v)
        self.norm = reduce.norm(self.f)
        enough = self.options.relative > 0 and self.norm <= self.enough
        return Step(self.norm, alpha * reduce.norm(d), alpha, iterations, 0, cuts, 0.0, self.options.eta, enough)
