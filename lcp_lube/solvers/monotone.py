"""Monotone iteration that ends for every film: policy iteration on G from above, each policy's model solved from below.

In scaled unknowns (s = diag A/diag(-B), so that both kinds of columns have A's diagonal d) a cell's balance reads

    G(z)_i = d_i z_i - f_w(z_west) - sum over east, south, north of k max(z_j, 0) - c_i,    f_w(z) = min(k z, d_west z):

what arrives from the west is concave, what arrives from the others convex. Replace f_w by one of its two branches, k z where
the cell to the west is not known to be cavitated, d z where it is (the policy X): as f_w is the smaller one, the solution of
this model is a supersolution of G, and every cell where it is negative is cavitated in the solution itself. So X only grows,
at most n times, and where it does not the model is G. The model is a convex problem: Newton's method (Howard's policy
iteration) solves it in finitely many steps, from below. Proofs: docs/theory/monotone.md. Neither a line search nor a good
start is needed; sweeps of nonlinear Gauss-Seidel keep supersolutions and carry the void downstream, which saves steps.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base.parallel import Array
from ..base.stages import Stages
from ..linear.reduced import ReducedSystem
from ..problems.film.lubrication import LubricationProblem
from ..problems.solution import Fields, Step
from .job import Job
from .method import Method
from .method_options import MethodOptions, least, part
from .relaxation import relaxation
from .zform import ZForm

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class MonotoneOptions(MethodOptions):
    """sweeps: of relaxation from each supersolution, 0: none; rtol: relative tolerance of iterative inner solves."""

    method = "monotone"
    sweeps: int = least(0, 32)
    rtol: float = part(1e-10)


class ModelSystem(ReducedSystem):
    """The models' Newton matrices: column j hands k to the east or, if cavitated, d; to the other sides k or nothing."""

    def __init__(self, problem: LubricationProblem, stages: Stages):
        super().__init__(problem, stages)
        self._carried = self._b_entries != 0.0  # the diagonal and what a cell receives from the west
        self._s = self._diagonal_A / self._diagonal_B

    def solve_model(self, cavity: Mask, full: Mask, rtol: float) -> tuple[Array, int]:
        """z with (model's Jacobian) z = c for these policies, and the number of linear iterations. Collective."""
        grid = self.problem.grid
        with self.stages("Jacobian"):
            east, others, void = (
                grid.ghosted(a).ravel()[self._neighbour] for a in (~cavity * 1.0, full * 1.0, cavity * self._s)
            )
            values = self._a * np.where(self._carried, east, others) - self._b_entries * void
            self._unit = 1.0 / self._diagonal_A if self.direct else np.ones_like(self._diagonal_A)
            self.mat.setValuesCSR(self._pointers, self._columns, values * grid.ghosted(self._unit).ravel()[self._neighbour])
            self.mat.assemble()
        return self.solve_again(self.problem.c, rtol)

    def solve_again(self, f: Array, rtol: float) -> tuple[Array, int]:
        """z with the last matrix for another right-hand side: a factorisation is not repeated. Collective."""
        self._b.setArray(f)
        with self.stages("KSP"):
            iterations = self.krylov.solve(self._b, self._x, rtol)
        return self._unit * self._x.array_r, iterations


class Monotone(Method):
    """The supersolutions z; `newton.iterate` runs it. `norm` is ||G(z)|| / ||c||, as the active set's.

    A start's cavity is the first policy; cells of it that turn out positive leave it again. Without one there is none.
    """

    Options = MonotoneOptions
    problem: LubricationProblem
    system: ModelSystem
    state = ("z", "cavity", "_above", "norm")

    def __init__(self, job: Job):
        super().__init__(job)
        problem, options, start = self.problem, self.options, job.start
        self.system = ModelSystem(problem, self.stages)
        self.form = ZForm(problem)
        n = problem.grid.local_size
        z = self.form.z(start) if start else np.ones(n)
        self.z = z if np.isfinite(problem.reduce.norm(z)) else np.ones(n)
        self.cavity: Mask = self.z < 0
        if problem.grid.periodic[0]:  # no ring of a solution is empty all round
            lines = self.cavity.reshape(problem.grid.box)
            lines[lines.all(axis=1)] = False
        self._above = False  # whether z is known to be a supersolution
        self._relaxation = relaxation(problem) if options.sweeps else None
        self.norm = self._norm()

    @property
    def fields(self) -> Fields:
        return self.form.fields(self.z)

    def _norm(self) -> float:
        return self.form.norm(self.z, self.form.residual(self.z), self.eps1)

    def _any(self, mask: Mask) -> bool:
        return bool(self.problem.reduce.sum(mask.astype(float)))

    def _solve_policy(self) -> tuple[Array, int]:
        """The model's solution for the present policy and the number of linear iterations. Collective.

        After the first solve the iterates are subsolutions of the model and only rise: no full cell is given up again.
        """
        full, rising, total = (self.z > 0) & ~self.cavity, False, 0
        while True:
            z, iterations = self.system.solve_model(self.cavity, full, self.options.rtol)
            total += iterations
            positive = (z > 0) & ~self.cavity
            if rising:
                positive |= full
            if not self._any(positive != full):
                return z, total
            full, rising = positive, True

    def advance(self) -> Step:
        """Solve one policy's model, and let the policy grow, or shrink where the start was wrong.

        The step's norm counts as zero when the policy stays as it is: the model is G then, and solved.
        """
        before = self.z
        self.z, iterations = self._solve_policy()
        with self.system.stages("step length"):
            self.norm = self._norm()
            wrong = self.cavity & (self.z > 0)
            # Once no cell of it is positive, z is a supersolution, and the policy only grows; rounding must not undo that.
            self._above = self._above or not self._any(wrong)
            cavity = self.cavity | (self.z < 0) if self._above else self.cavity & ~wrong
        if self._above and self._relaxation is not None and self.norm > self.eps1:
            with self.system.stages("relaxation"):
                cavity |= self.form.z(self._relaxation(self.fields, self.options.sweeps)) < 0
        changed = self._any(cavity != self.cavity)
        if not changed and self.system.direct:
            G = self.form.residual(self.z)
            self.z = self.form.refine(self.z, G, self.z > 0, lambda f: self.system.solve_again(f, self.options.rtol)[0])
            self.norm = self._norm()
        self.cavity = cavity
        step_norm = self.problem.reduce.norm(self.z - before) if changed else 0.0
        return Step(self.norm, step_norm, 1.0, iterations, rtol=self.options.rtol)
