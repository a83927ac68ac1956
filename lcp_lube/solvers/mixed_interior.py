"""Interior point of Bergamaschi and Zilli for mixed complementarity: unknowns with bounds beside free ones, dense or sparse f'.

The method is that of `interior`; a free unknown has neither slack nor multiplier, and its equation no term on C's diagonal.
What differs is the start, z = max(+-f, z0) in place of a constant, since f is of no known size; and the option to keep the
Jacobian for several steps, which the paper asks for because its dense Jacobian cost a third of the run. C's diagonal
S1^-1 Z1 + S2^-1 Z2 is new in every step all the same: it is what tells the bounds in contact from the others.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from petsc4py import PETSc

from ..base.parallel import Array
from ..linear.box import BoxSystem
from ..problems.box import BoxProblem
from ..problems.solution import Fields, Step
from .interior import Interior, InteriorOptions
from .job import Job
from .method_options import least, make_options, positive
from .steplength import StepLengthError

STUCK = 1e-9  # steps shorter than this lead nowhere


@dataclass(frozen=True)
class MixedInteriorOptions(InteriorOptions):
    """Those of `InteriorOptions`, z0 being the least start of z1 and z2; and keep: steps that one Jacobian serves."""

    z0: float = positive(1e-3)
    halvings: int = least(1, 20)
    keep: int = least(1, 1)


class KeptJacobian:
    """A problem whose Jacobian serves `keep` calls before it is evaluated anew; the rest is the problem's own.

    The first call, before the first step, gives the Newton matrix its layout and does not count.
    """

    def __init__(self, problem: BoxProblem, keep: int):
        self._problem, self._keep = problem, keep
        self._mat: PETSc.Mat | None = None
        self._age = keep  # calls served by the one at hand

    def __getattr__(self, name: str) -> Any:
        return getattr(self._problem, name)

    def jacobian(self, v: Array) -> PETSc.Mat:
        """f' at the v of this call or of an earlier one. Collective."""
        layout = self._mat is None
        if self._age >= self._keep:
            self._mat = self._problem.jacobian(v)
            self._age = 0
        self._age = self._keep if layout else self._age + 1
        return self._mat

    @property
    def old(self) -> bool:
        """Whether the last call was served by an earlier one's Jacobian."""
        return self._age > 1

    def expire(self) -> None:
        """Evaluate at the next call."""
        self._age = self._keep


class MixedInterior(Interior):
    """The iterates of the interior point method from z = max(+-f(v), z0), with Jacobians that may be kept."""

    state: tuple[str, ...] = ()  # a Jacobian kept from earlier steps cannot be made anew

    def __init__(
        self,
        problem: BoxProblem,
        system: BoxSystem,
        kept: KeptJacobian,
        options: MixedInteriorOptions,
        start: Fields | None = None,
    ):
        super().__init__(problem, system, options, start)
        self.kept = kept
        f = problem.residual(self.at.v)
        z1, z2 = (np.where(has, np.maximum(force, options.z0), 0.0) for has, force in zip(self._has, (f, -f), strict=True))
        self.at = replace(self.at, z1=z1, z2=z2)
        self.H = self._H(self.at)
        self.norm = problem.reduce.norm(*self.H)

    def advance(self) -> Step:
        """As `Interior.advance`; a step that a kept Jacobian fails to give is made with a new one. Collective.

        Raises
        ------
        StepLengthError : also where the bounds leave no room for a step, as where f is not monotone and H has a local minimum.
        """
        try:
            step = super().advance()
        except StepLengthError:
            if not self.kept.old:
                raise
            self.kept.expire()
            step = super().advance()
        if step.backtracking:
            self.kept.expire()
        if step.alpha < STUCK:
            raise StepLengthError(f"the bounds leave room for {step.alpha:.1e} of it")
        return step


def build(job: Job) -> MixedInterior:
    """The registry's door.

    Raises
    ------
    InputError : an unknown option or a value out of range.
    """
    settings = make_options(MixedInteriorOptions, "interior", job.options)
    kept = KeptJacobian(job.problem, settings.keep)
    seen_by_system: Any = kept
    return MixedInterior(job.problem, BoxSystem(seen_by_system, job.stages), kept, settings, job.start)
