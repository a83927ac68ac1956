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

from ..errors import InputError
from ..linear.box_system import BoxSystem
from ..linear.stages import Stages
from ..parallel import Array
from ..problems.box import BoxProblem
from ..problems.solution import Fields, Step
from .interior import Interior, InteriorOptions
from .method_options import make_options
from .newton import Stopping
from .steplength import StepLengthError

STUCK = 1e-9  # steps shorter than this lead nowhere


@dataclass(frozen=True)
class MixedInteriorOptions(InteriorOptions):
    """Those of `InteriorOptions`, z0 being the least start of z1 and z2; and keep: steps that one Jacobian serves."""

    z0: float = 1e-3
    halvings: int = 20
    keep: int = 1

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.keep < 1:
            raise InputError(f"interior.keep = {self.keep}: at least 1 is needed")


class KeptJacobian:
    """A problem whose Jacobian is evaluated only at every keep-th call; the rest is the problem's own.

    Its first call, before the first step, serves the layout of the Newton matrix and does not count.
    """

    def __init__(self, problem: BoxProblem, keep: int):
        self._problem, self._keep, self._calls = problem, keep, -1

    def __getattr__(self, name: str) -> Any:
        return getattr(self._problem, name)

    def jacobian(self, v: Array) -> PETSc.Mat:
        """f' at the v of this call or of an earlier one. Collective."""
        if self._calls < 0 or self._calls % self._keep == 0:
            self._mat = self._problem.jacobian(v)
        self._calls += 1
        return self._mat


class MixedInterior(Interior):
    """The iterates of the interior point method from z = max(+-f(v), z0)."""

    def __init__(self, problem: BoxProblem, system: BoxSystem, options: MixedInteriorOptions, start: Fields | None = None):
        super().__init__(problem, system, options, start)
        f = problem.residual(self.at.v)
        z1, z2 = (np.where(has, np.maximum(force, options.z0), 0.0) for has, force in zip(self._has, (f, -f), strict=True))
        self.at = replace(self.at, z1=z1, z2=z2)
        self.H = self._H(self.at)
        self.norm = problem.reduce.norm(*self.H)

    def advance(self) -> Step:
        """As `Interior.advance`. Collective.

        Raises
        ------
        StepLengthError : also where the bounds leave no room for a step, as where f is not monotone and H has a local minimum.
        """
        step = super().advance()
        if step.alpha < STUCK:
            raise StepLengthError(f"the bounds leave room for {step.alpha:.1e} of it")
        return step


def build(
    problem: BoxProblem,
    stages: Stages,
    system: str,
    options: dict[str, Any],
    stopping: Stopping,
    start: Fields | None = None,
) -> MixedInterior:
    """The registry's door.

    Raises
    ------
    InputError : an unknown option or a value out of range.
    """
    settings = make_options(MixedInteriorOptions, "interior", options)
    kept: Any = KeptJacobian(problem, settings.keep)
    return MixedInterior(problem, BoxSystem(kept, stages), settings, start)
