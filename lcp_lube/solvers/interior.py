"""Inexact interior point of Bergamaschi and Zilli for l <= v <= u and f(v), condensed to n unknowns; free ones among them too.

    H(v, s1, s2, z1, z2) = (f(v) - z1 + z2, S1 Z1 e, S2 Z2 e, v - l - s1, u - v - s2) = 0,   s, z > 0.

With b = -H but b2 = sigma mu e - S1 Z1 e, b3 = sigma mu e - S2 Z2 e, the Newton step is

    C dv = b1 + S1^-1 (b2 - Z1 b4) - S2^-1 (b3 - Z2 b5),   C = f'(v) + S1^-1 Z1 + S2^-1 Z2,
    ds1 = b4 + dv,  ds2 = b5 - dv,  dz1 = S1^-1 (b2 - Z1 ds1),  dz2 = S2^-1 (b3 - Z2 ds2),

where b4 = v - l - s1 and b5 = u - v - s2. (The paper's printed dz1, dz2 are wrong, and it calls C nonsymmetric; C has
the symmetry of f'.) Where a bound is infinite its s, z and their equations are absent.

The paper leaves sigma, mu and the tolerances open. It prints the start v = s = z = 1 (v0 = 1, s0 = 1); the defaults here, with
v0 = 1 and the slacks of that v, are fitted to the counts of its table 1.

For mixed complementarity, dense or sparse f', the start is z = max(+-f, z0), since f is of no known size, and the Jacobian may
be kept for several steps, which the paper asks for because its dense one cost a third of the run. C's diagonal is new in every
step all the same: it is what tells the bounds in contact from the others.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ..base.parallel import Array
from ..errors import InputError
from ..linear.box import BoxSystem
from ..problems.box import BoxProblem
from ..problems.solution import Fields, Step
from .job import Job
from .method import Method
from .method_options import MethodOptions, least, option, part, positive
from .steplength import StepLengthError, feasible, halve_until, inexact_decrease

STUCK = 1e-9  # mixed problems: steps shorter than this lead nowhere
RTOL = (1e-12, 0.5)  # of the inner solves: what PETSc's test can tell apart, and what still is a solve


@dataclass(frozen=True)
class InteriorOptions(MethodOptions):
    """Parameters of the interior point method.

    z0: start of z1 and z2; s0: of s1 and s2, 0 for v - l and u - v. sigma_max: sigma = min(sigma_max, mu). forcing: inner
    solves to ||residual|| <= forcing mu.
    boundary: the part of the way to the boundary s, z = 0 that a step may go. beta: of the decrease test; halvings: cuts of
    alpha before the run counts as failed. inside: the start keeps this part of the box (of 1, if wider) off the bounds.
    """

    method = "interior"
    z0: float = positive(1.0)
    s0: float = option(0.0, lambda s: 0 <= s < np.inf, "a positive number, or 0 for the slacks of v, is needed")
    sigma_max: float = part(0.2)
    forcing: float = part(0.05)
    boundary: float = part(0.9999)
    beta: float = part(1e-4)
    halvings: int = least(1, 5)
    inside: float = part(1e-3)


@dataclass(frozen=True)
class Point:
    """An iterate (or a step) and H there."""

    v: Array
    s1: Array
    s2: Array
    z1: Array
    z2: Array


class Interior(Method):
    """The iterates of the interior point method; `newton.iterate` runs it. `norm` is ||H||, all five blocks.

    A start is moved inside the bounds; the slacks are those of v but for options.s0.

    Raises
    ------
    InputError : also l = u somewhere: the box has no inside; nothing drives v.
    """

    Options: type[MethodOptions] = InteriorOptions
    problem: BoxProblem
    system: BoxSystem
    state: tuple[str, ...] = ("at", "H", "norm")

    def __init__(self, job: Job):
        super().__init__(job)
        problem, o = self.problem, self.options
        l, u = problem.lower, problem.upper
        self._has = np.isfinite(l), np.isfinite(u)
        if problem.reduce.sum((l == u).astype(float)):
            raise InputError("--method interior: v_lower = v_upper at some points, no inside to start in; active-set can")
        if problem.idle[0]:
            raise InputError(
                "--method interior: nothing drives v, and v = 0 is the answer: ||H|| <= eps1 says nothing about what is left "
                "of it, nor of s and z where it lies on a bound; active-set, semismooth or fas can"
            )
        self.system = BoxSystem(problem, self.stages)
        margin = o.inside * np.minimum(u - l, 1.0)
        v = np.clip(job.start["v"] if job.start else problem.v0, l + margin, u - margin)
        s1, s2 = (np.where(has, o.s0 or s, 1.0) for has, s in zip(self._has, (v - l, u - v), strict=True))
        z1, z2 = (np.where(has, z, 0.0) for has, z in zip(self._has, self._multipliers(v), strict=True))
        # Without a bound, s = 1 and z = 0 stay as they are.
        self.at = Point(v, s1, s2, z1, z2)
        self.H = self._H(self.at)
        self.norm = problem.reduce.norm(*self.H)
        self._pairs = problem.reduce.sum(self._has[0].astype(float)) + problem.reduce.sum(self._has[1].astype(float))

    def _linearise(self) -> None:
        """Take f' for the next step. Collective."""
        self.system.linearise(self.at.v)

    def _multipliers(self, v: Array) -> tuple[Array | float, Array | float]:
        """z1 and z2 to start with."""
        return self.options.z0, self.options.z0

    @property
    def fields(self) -> Fields:
        return {"v": self.at.v}

    def _H(self, at: Point) -> tuple[Array, ...]:
        """The five blocks; zero where a bound is absent."""
        has1, has2 = self._has
        return (
            self.problem.residual(at.v) - at.z1 + at.z2,
            at.s1 * at.z1,
            at.s2 * at.z2,
            np.where(has1, at.v - self.problem.lower - at.s1, 0.0),
            np.where(has2, self.problem.upper - at.v - at.s2, 0.0),
        )

    def advance(self) -> Step:
        """One inexact Newton step on the perturbed equations, then alpha by feasibility and backtracking. Collective."""
        o, reduce, at, H = self.options, self.problem.reduce, self.at, self.H
        has1, has2 = self._has
        mu = (reduce.sum(H[1]) + reduce.sum(H[2])) / (self._pairs or 1.0)
        sigma = min(o.sigma_max, mu)
        b1, b4, b5 = -H[0], H[3], H[4]
        b2, b3 = (np.where(has, sigma * mu - H[k], 0.0) for has, k in ((has1, 1), (has2, 2)))
        rhs = b1 + (b2 - at.z1 * b4) / at.s1 - (b3 - at.z2 * b5) / at.s2
        size = reduce.norm(rhs)
        wanted = o.forcing * (mu if self._pairs else size)
        rtol = float(np.clip(wanted / size, *RTOL)) if size > 0 else RTOL[1]
        self._linearise()
        dv, iterations = self.system.solve(rhs, rtol, shift=at.z1 / at.s1 + at.z2 / at.s2)
        ds1, ds2 = np.where(has1, b4 + dv, 0.0), np.where(has2, b5 - dv, 0.0)
        step = Point(dv, ds1, ds2, (b2 - at.z1 * ds1) / at.s1, (b3 - at.z2 * ds2) / at.s2)

        with self.system.stages("step length"):
            alpha, cuts, self.at, self.H = self._step_length(step)
            self.norm = reduce.norm(*self.H)
            step_norm = alpha * reduce.norm(step.v, step.s1, step.s2, step.z1, step.z2)
        return Step(self.norm, step_norm, alpha, iterations, 0, cuts, sigma, rtol)

    def _step_length(self, step: Point) -> tuple[float, int, Point, tuple[Array, ...]]:
        """alpha, the number of cuts, the new point and H there."""
        o, at, reduce = self.options, self.at, self.problem.reduce
        pairs = [(o.boundary * getattr(at, name), getattr(step, name)) for name in ("s1", "s2", "z1", "z2")]
        alpha = feasible(reduce, *pairs)

        @lru_cache(maxsize=1)
        def trial(alpha: float) -> tuple[Point, tuple[Array, ...]]:
            new = Point(*(getattr(at, name) + alpha * getattr(step, name) for name in ("v", "s1", "s2", "z1", "z2")))
            return new, self._H(new)

        def decreases(alpha: float) -> bool:
            return inexact_decrease(self.norm, reduce.norm(*trial(alpha)[1]), alpha, 0.0, o.beta)

        alpha, cuts = halve_until(decreases, alpha, most=o.halvings)
        return alpha, cuts, *trial(alpha)


@dataclass(frozen=True)
class MixedInteriorOptions(InteriorOptions):
    """Those of `InteriorOptions`, z0 being the least start of z1 and z2; and keep: steps that one Jacobian serves."""

    z0: float = positive(1e-3)
    halvings: int = least(1, 20)
    keep: int = least(1, 1)


class MixedInterior(Interior):
    """The iterates of the interior point method from z = max(+-f(v), z0), with Jacobians that may be kept."""

    Options = MixedInteriorOptions
    state = ()  # a Jacobian kept from earlier steps cannot be made anew

    def __init__(self, job: Job):
        super().__init__(job)
        self._age = self.options.keep  # steps that the Jacobian at hand has served

    def _linearise(self) -> None:
        if self._age >= self.options.keep:
            super()._linearise()
            self._age = 0
        self._age += 1

    def _multipliers(self, v: Array) -> tuple[Array, Array]:
        f = self.problem.residual(v)
        return np.maximum(f, self.options.z0), np.maximum(-f, self.options.z0)

    def advance(self) -> Step:
        """As `Interior.advance`; a step that a kept Jacobian fails to give is made with a new one. Collective.

        Raises
        ------
        StepLengthError : also where the bounds leave no room for a step, as where f is not monotone and H has a local minimum.
        """
        try:
            step = super().advance()
        except StepLengthError:
            if self._age <= 1:
                raise
            self._age = self.options.keep
            step = super().advance()
        if step.backtracking:
            self._age = self.options.keep
        if step.alpha < STUCK:
            raise StepLengthError(f"the bounds leave room for {step.alpha:.1e} of it")
        return step
