"""Primal-dual active set: the semismooth Newton method for the piecewise linear equation in z.

With p = max(z, 0) and r = s max(-z, 0), s > 0, complementarity holds for every z, and what is left is

    G(z) = A max(z, 0) + B s max(-z, 0) - c = 0,

piecewise linear, with Jacobian J(theta) for theta = 1 where z >= 0 and 0 elsewhere. A full step lands on the solution of one
linear piece; where the signs of z come out as they went in, that is the exact discrete solution, so the iteration ends after
finitely many steps or cycles. From a coarser grid's answer, nonlinear Gauss-Seidel sweeps (`relaxation`) before the first step
and after each one put the fronts right to the cell, which saves two to four steps of five to seven.

Plain steps cycle on some rough films, and a line search at every step is worse: it forbids the rise of ||G|| through which the
method gets out of a poor start. Here, once ||G|| has stalled, sweeps take over for a while, twice as many each time: they
converge from any start, as G is an M-function, so the method cannot cycle for ever.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base.parallel import Array
from ..errors import InputError
from ..linear.krylov import Krylov
from ..linear.system import System, make_system
from ..problems.film.lubrication import LubricationProblem
from ..problems.solution import Fields, Step
from .job import Job
from .method_options import make_options
from .newton import StalledError
from .refined import check_refined
from .relaxation import Relaxation, relaxation

EPS = float(np.finfo(float).eps)
RESCUE_SWEEPS, MOST_SWEEPS = 16, 2**14  # once stalled: at first, and at most
LEAST = 1e-15  # p_unit: a largest pressure below this is rounding
REFINEMENTS, REFINED = 8, 1e-12  # solves that a direct solver adds to the last step, until z moves by less of itself


@dataclass(frozen=True)
class ActiveSetOptions:
    """patience: steps without a fall of ||G|| by 10 % before sweeps take over; give_up: steps after which it is taken to
    cycle; p0: full film at this p (p_unit) at the start; rtol: smallest relative tolerance of iterative inner solves; sweeps:
    of relaxation before the first step from a given start, and after each step; 0: none at all, also when stalled."""

    p0: float = 1.0
    patience: int = 4
    give_up: int = 100
    rtol: float = 1e-8
    sweeps: int = 16

    def __post_init__(self) -> None:
        if not (np.isfinite(self.p0) and self.p0 > 0):
            raise InputError(f"--p0 {self.p0}: a positive number is needed")
        for name in ("patience", "give_up"):
            if getattr(self, name) < 1:
                raise InputError(f"active-set.{name} = {getattr(self, name)}: at least 1 is needed")
        if self.sweeps < 0:
            raise InputError(f"active-set.sweeps = {self.sweeps}: at least 0 is needed")
        if not 0 < self.rtol < 1:
            raise InputError(f"active-set.rtol = {self.rtol}: allowed are numbers between 0 and 1")


class ActiveSet:
    """The iterates z; `newton.iterate` runs it. `norm` is ||G(z)|| / ||c||, see `_norm`.

    Parameters
    ----------
    start : fields p and r, a cell being cavitated where r > 0; default full film at options.p0.
    """

    state: tuple[str, ...] = ("z", "G", "norm", "_best", "_stalled", "_rescue", "_taken", "_sweeps")  # what a step starts from

    def __init__(
        self,
        problem: LubricationProblem,
        system: System,
        options: ActiveSetOptions,
        eps1: float,
        start: Fields | None = None,
    ):
        self.problem, self.system, self.options, self.eps1 = problem, system, options, eps1
        scheme = problem.scheme
        # Cavitated columns of J then have A's diagonal: a step in z means the same in both phases.
        self.diagonal = (scheme.k_W + scheme.k_E + scheme.k_S + scheme.k_N).ravel()
        self.s = self.diagonal / -scheme.b_C.ravel()
        self.z = start["p"] - start["r"] / self.s if start else np.full(problem.grid.local_size, options.p0)
        self.G = self._residual(self.z)
        self.norm = self._norm(self.z, self.G)
        self._relaxation: Relaxation | None = relaxation(problem) if options.sweeps else None
        self._sweeps = options.sweeps if start else 0
        self._relax(self._sweeps)
        self._best, self._stalled, self._rescue, self._taken = self.norm, 0, RESCUE_SWEEPS, 0

    @property
    def fields(self) -> Fields:
        return {"p": np.maximum(self.z, 0.0), "r": self.s * np.maximum(-self.z, 0.0)}

    @property
    def krylov(self) -> Krylov:
        return self.system.krylov

    def destroy(self) -> None:
        self.system.destroy()

    def _norm(self, z: Array, G: Array) -> float:
        """||G|| / ||c||; where rounding in G's sums alone exceeds eps1, on very fine grids, relative to that."""
        reduce, c = self.problem.reduce, self.problem.c
        # c is a difference of the wall's flows, and knows no more than they do.
        rounding = max(
            16 * EPS * reduce.norm(self.diagonal * np.abs(z) + np.abs(c)), EPS * reduce.norm(self.problem.scheme.b_C.ravel())
        )
        driven = reduce.norm(c) or reduce.norm(self.diagonal)  # nothing drives the film: p is measured by its unit
        return reduce.norm(G) / max(driven, rounding / self.eps1)

    def _residual(self, z: Array) -> Array:
        return self.problem.balance(np.maximum(z, 0.0), self.s * np.maximum(-z, 0.0))

    def _relax(self, sweeps: int, always: bool = False) -> None:
        """Sweeps from z, kept if ||G|| falls by them, or always."""
        if self._relaxation is None or not sweeps or self.norm <= self.eps1:
            return
        fields = self.fields
        p, r = self._relaxation(fields["p"], fields["r"], sweeps)
        z = p - r / self.s
        G = self._residual(z)
        norm = self._norm(z, G)
        if norm < self.norm or always:
            self.z, self.G, self.norm = z, G, norm

    def advance(self) -> Step:
        """One full Newton step, and sweeps: a few from a coarser grid's answer, many if ||G|| has stalled.

        The step's norm counts as zero when no sign of z changed: the next step would solve the same linear system again.

        Raises
        ------
        StalledError : after give_up steps; the last one leaves pressures uncertain.
        """
        if self._taken == self.options.give_up:
            steps = f"{self._taken} steps (active-set.give_up)"
            raise StalledError(f"||G|| is at {self.norm:.1e} of ||c|| after {steps}: they seem to cycle")
        self._taken += 1
        full = self._branch()
        cavity = (~full).astype(float)
        # Early steps need signs, not digits; the last one is to bring ||G|| below eps1, and no further.
        rtol = max(self.options.rtol, min(1e-2, max(0.1 * self.norm, 0.4 * self.eps1 / self.norm if self.norm else 1.0)))
        dp, dr, linear_iterations = self.system.solve(cavity, 1.0 - cavity, -self.G, np.zeros_like(self.G), rtol)
        with self.system.stages("step length"):
            d = np.where(full, dp, -dr / self.s)
            self.z = self.z + d
            self.G = self._residual(self.z)
            self.norm = self._norm(self.z, self.G)
            changed = self.problem.reduce.sum((full != (self.z >= 0)).astype(float))
        if not changed and self.system.direct:
            changed = self._refine(full)
        # In parts of the largest pressure, if that is far below p_unit: eps2 is no step then.
        p_max = float(np.clip(self.problem.reduce.max(self.z), LEAST, 1.0)) if self.norm > 8 * EPS else 1.0
        step_norm = self.problem.reduce.norm(d) / p_max if changed else 0.0
        with self.system.stages("relaxation"):
            if self._stalled >= self.options.patience:
                self._relax(self._rescue, always=True)
                self._stalled, self._rescue = 0, min(2 * self._rescue, MOST_SWEEPS)
            else:
                self._relax(self._sweeps)
        self._stalled = 0 if self.norm <= 0.9 * self._best else self._stalled + 1
        self._best = min(self._best, self.norm)
        return Step(self.norm, step_norm, 1.0, linear_iterations, rtol=rtol)

    def _branch(self) -> NDArray[np.bool_]:
        """Where the film counts as full: by the sign of z; a ring that is empty all round, which no solution is and whose
        matrix is singular, is full where it is least empty."""
        full, grid = self.z >= 0, self.problem.grid
        if grid.periodic[0] and grid.box[1] == grid.shape[0]:
            z = self.z.reshape(grid.box)
            empty = np.flatnonzero(~full.reshape(grid.box).any(axis=1))
            full.reshape(grid.box)[empty, np.argmax(z[empty], axis=1)] = True
        return full

    def _refine(self, full: NDArray[np.bool_]) -> float:
        """Solve again with the same factors for what is left of G: their rounding is that of A's diagonal, G's is not.

        Returns how many signs that changes: of pressures that are next to nothing beside what the wall could make.

        Raises
        ------
        StalledError : pressures stay uncertain (`refined`).
        """
        reduce, none, last, left = self.problem.reduce, np.zeros_like(self.G), np.inf, 0.0
        for _ in range(REFINEMENTS):
            dp, dr, _ = self.system.resolve(-self.G, none, self.options.rtol)
            d = np.where(full, dp, -dr / self.s)
            parts = [(np.where(some, np.abs(d), 0.0), np.where(some, np.abs(self.z), 0.0)) for some in (full, ~full)]
            size = max(reduce.max(moved) / (reduce.max(whole) or 1.0) for moved, whole in parts)
            left = reduce.max(parts[0][0])
            if not size < 0.5 * last:  # rounding, or NaN
                break
            self.z = self.z + d
            self.G, last = self._residual(self.z), size
            if size <= REFINED:
                break
        self.norm = self._norm(self.z, self.G)
        check_refined(self.problem, self.z, left)
        return reduce.sum((full != (self.z >= 0)).astype(float))


def build(job: Job) -> ActiveSet:
    """The registry's door.

    Raises
    ------
    InputError : an unknown option or a value out of range.
    """
    settings = make_options(ActiveSetOptions, "active-set", job.options)
    return ActiveSet(job.problem, make_system(job.system, job.problem, job.stages), settings, job.stopping.eps1, job.start)
