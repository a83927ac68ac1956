"""Primal-dual active set: the semismooth Newton method for the piecewise linear equation in z.

With p = max(z, 0) and r = s max(-z, 0), s > 0, complementarity holds for every z, and what is left is

    G(z) = A max(z, 0) + B s max(-z, 0) - c = 0,

piecewise linear, with Jacobian J(theta) for theta = 1 where z >= 0 and 0 elsewhere. A full step lands on the solution of one
linear piece; where the signs of z come out as they went in, that is the exact discrete solution, so the iteration ends after
finitely many steps or cycles. From a coarser grid's answer, nonlinear Gauss-Seidel sweeps (`relaxation`) before the first step
and after each one put the fronts right to the cell, which saves two to four steps of five to seven.

Plain steps cycle on some rough films, and a line search at every step is worse: it forbids the rise of ||G|| through which the
method gets out of a poor start. Here, once ||G|| has stalled, sweeps take over for a while, twice as many each time: they
converge from any start, as G is an M-function. Where the film hangs on less than rounding, on a ring that is hardly fed, the
steps lead back to the same cycle all the same, and the method says so.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base.parallel import Array
from ..linear.system import System, make_system
from ..problems.film.lubrication import LubricationProblem
from ..problems.solution import Fields, Step
from .job import Job
from .line_start import full_along
from .method import Method
from .method_options import MethodOptions, least, part, positive
from .newton import StalledError
from .relaxation import Relaxation, relaxation
from .zform import EPS, ZForm

RESCUE_SWEEPS, MOST_SWEEPS = 16, 2**14  # once stalled: at first, and at most
IN_VAIN = 6  # times that sweeps may take over without ||G|| ever falling below what it was before
# Inner tolerances: the first steps need signs, not digits; later ones a part of ||G||; the last one brings ||G|| below eps1
# and no further (benchmarks/constants.py sweeps the three).
FIRST, FORCING, LAST = 1e-2, 0.1, 0.4
NONE = 1e-9  # of the largest flow that the wall brings to a cell or drags away: less is rounding
CHEAP = 10_000  # points up to which direct steps cost no more than sweeps that save them, whose compiler loads in 0.5 s
DAM = 0.25  # part of all flows that the wall leaves over, and of the points, from which and up to which it counts as a dam
FALL = 0.9  # of ||G||: a step that leaves no more is no stall
LEAST = 1e-15  # p_unit: a largest pressure below this is rounding


@dataclass(frozen=True)
class ActiveSetOptions(MethodOptions):
    """patience: steps without a fall of ||G|| by 10 % before sweeps take over; give_up: steps after which it is taken to
    cycle; p0: p of the full film at the start (p_unit); rtol: smallest relative tolerance of iterative inner solves; sweeps:
    of relaxation before the first step from a given start that has a front, and after each step, but not where a direct solver
    steps on a film in the plane so small that a step costs less than what it would save; 0: none at all, also when stalled."""

    method = "active-set"
    p0: float = positive(1.0, "--p0")
    patience: int = least(1, 4)
    give_up: int = least(1, 100)
    rtol: float = part(1e-8)
    sweeps: int = least(0, 16)


class ActiveSet(Method):
    """The iterates z; `newton.iterate` runs it. `norm` is ||G(z)|| / ||c||, see `zform.ZForm.norm`.

    A start's cells count as cavitated where r > 0; without one those do that lines by themselves would have (`line_start`),
    or, if these tell nothing and nothing presses the film, those that the wall empties.
    """

    Options = ActiveSetOptions
    problem: LubricationProblem
    system: System
    state = ("z", "G", "norm", "_best", "_stalled", "_rescue", "_vain", "_taken", "_sweeps")

    def __init__(self, job: Job):
        super().__init__(job)
        problem, options, start = self.problem, self.options, job.start
        self.system = make_system(job.system, problem, self.stages)
        self.form = ZForm(problem)
        self.z = self.form.z(start) if start else options.p0 * np.where(self._full_at_first(), 1.0, -1.0)
        self._look()
        self._relaxation: Relaxation | None = relaxation(problem) if options.sweeps else None
        cheap = self.system.direct and problem.grid.dim == 2 and problem.grid.size <= CHEAP
        self._sweeps = options.sweeps if start and not cheap and problem.reduce.min(self.z) < 0.0 else 0
        self._relax(self._sweeps)
        self._best, self._stalled, self._rescue, self._vain, self._taken = self.norm, 0, RESCUE_SWEEPS, 0, 0

    @property
    def fields(self) -> Fields:
        return self.form.fields(self.z)

    def _full_at_first(self) -> NDArray[np.bool_]:
        """But where the wall drags away more than it brings, in a film without given pressures: a step is saved. All of it if
        it brings more than it drags away in all, at few points: a dam presses all that lies before it. Collective."""
        problem, c, reduce = self.problem, self.problem.c, self.problem.reduce
        if (full := full_along(problem)) is not None:
            return full
        if any(problem.p_sides) or problem.held is not None:
            return np.ones(c.size, dtype=bool)
        dammed = reduce.sum(c) > DAM * reduce.sum(np.abs(c)) and reduce.sum((c > 0.0).astype(float)) < DAM * problem.size
        return (c >= -NONE * reduce.largest(c)) | dammed

    def _look(self) -> None:
        self.G = self.form.residual(self.z)
        self.norm = self.form.norm(self.z, self.G, self.eps1)

    def _relax(self, sweeps: int, always: bool = False) -> None:
        """Sweeps from z, kept if ||G|| falls by them, or always."""
        if self._relaxation is None or not sweeps or self.norm <= self.eps1:
            return
        before = self.z, self.G, self.norm
        self.z = self.form.z(self._relaxation(self.fields, sweeps))
        self._look()
        if not (self.norm < before[2] or always):
            self.z, self.G, self.norm = before

    def advance(self) -> Step:
        """One full Newton step, and sweeps: a few from a coarser grid's answer, many if ||G|| has stalled.

        The step's norm counts as zero when no sign of z changed: the next step would solve the same linear system again.

        Raises
        ------
        StalledError : after give_up steps, or sweeps in vain; the last one leaves pressures uncertain.
        """
        if self._taken == self.options.give_up or self._vain > IN_VAIN:
            why = "active-set.give_up" if self._vain <= IN_VAIN else f"{self._vain} times sweeps took over in vain"
            raise StalledError(f"||G|| is at {self.norm:.1e} of ||c|| after {self._taken} steps ({why}): they seem to cycle")
        self._taken += 1
        before, full = self.norm, self._branch()
        cavity = (~full).astype(float)
        last = LAST * self.eps1 / self.norm if self.norm else 1.0
        rtol = max(self.options.rtol, min(FIRST, max(FORCING * self.norm, last)))
        dp, dr, linear_iterations = self.system.solve(cavity, 1.0 - cavity, -self.G, np.zeros_like(self.G), rtol)
        with self.system.stages("step length"):
            d = np.where(full, dp, -dr / self.form.s)
            self.z = self.z + d
            self._look()
            changed = self.problem.reduce.sum((full != (self.z >= 0)).astype(float))
        if not changed and self.system.direct:
            self.z = self.form.refine(self.z, self.G, full, lambda f: self._solve_again(f, full))
            self._look()
            # Signs of pressures that are next to nothing beside what the wall could make.
            changed = self.problem.reduce.sum((full != (self.z >= 0)).astype(float))
        # In parts of the largest pressure, if that is far below p_unit: eps2 is no step then.
        p_max = min(max(self.problem.reduce.max(self.z), LEAST), 1.0) if self.norm > 8 * EPS else 1.0
        step_norm = self.problem.reduce.norm(d) / p_max if changed else 0.0
        with self.system.stages("relaxation"):
            if self._stalled >= self.options.patience:
                self._relax(self._rescue, always=True)
                self._stalled, self._rescue, self._vain = 0, min(2 * self._rescue, MOST_SWEEPS), self._vain + 1
            else:
                self._relax(self._sweeps)
        if self.norm <= FALL * self._best:
            self._stalled = self._vain = 0
        elif not (self.problem.grid.periodic[0] and self.norm <= FALL * before):  # a ring's comes down by itself from a rise
            self._stalled += 1
        self._best = min(self._best, self.norm)
        return Step(self.norm, step_norm, 1.0, linear_iterations, rtol=rtol)

    def _branch(self) -> NDArray[np.bool_]:
        """Where the film counts as full: by the sign of z; a ring that is empty all round, which no solution is and whose
        matrix is singular, is full where it is least empty."""
        full, grid = self.z >= 0, self.problem.grid
        if grid.periodic[0] and grid.box[1] == grid.shape[0] and self.problem.scheme.storage is None:
            z = self.z.reshape(grid.box)
            empty = np.flatnonzero(~full.reshape(grid.box).any(axis=1))
            full.reshape(grid.box)[empty, np.argmax(z[empty], axis=1)] = True
        return full

    def _solve_again(self, f: Array, full: NDArray[np.bool_]) -> Array:
        """The step for another right-hand side with the matrix of the last one. Collective."""
        dp, dr, _ = self.system.resolve(f, np.zeros_like(f), self.options.rtol)
        return np.where(full, dp, -dr / self.form.s)
