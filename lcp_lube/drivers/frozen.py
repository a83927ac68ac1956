"""Films with their coefficients held: what the loop of effects solves, and what is linearised about its answer."""

from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from ..problems.facts import Facts
from ..problems.film.effects import FaceFactors
from ..problems.film.fluid import Law
from ..problems.film.lubrication import LubricationProblem
from ..problems.film.model import Model
from ..problems.grid import EVEN
from ..scenes.scene import Derived


@dataclass(frozen=True)
class Frozen(Derived):
    """A scene with its coefficients held, in q where Barus' law holds.

    by : factors of its own grid; None: no effects. base : its rigid film on this grid, if known, whose grid films share.
    """

    law: Law
    by: FaceFactors | None = None
    even: bool = True
    base: LubricationProblem | None = None

    @cached_property
    def constant(self) -> Model:
        """The rigid film of the constant fluid, in q."""
        model: Model = self.whole.model
        sides = (replace(side, p=float(self.law.reduced(np.array(side.p)))) for side in model.sides)
        supplies = tuple(replace(one, p=float(self.law.reduced(np.array(one.p)))) for one in model.supplies)
        changed: dict[str, Any] = {"sides": tuple(sides), "supplies": supplies, "law": None, "effects": (), "exact": None}
        if any(getattr(effect, "even_lines", False) for effect in model.effects):
            changed["places"] = EVEN
        return replace(model, **changed)

    @property
    def model(self) -> Model | None:
        """What `grooves` and `symmetry` look at; they take their parts' factors from `by`."""
        return self.constant if self.even or self.constant.grooves else None

    def with_shape(self, shape: tuple[int, ...]) -> "Frozen":
        return Frozen(self.whole.with_shape(shape), self.law, None, self.even)

    def facts(self, comm: PETSc.Comm | None = None) -> Facts:
        return self.constant.facts(self.shape, comm)

    def build(self, comm: PETSc.Comm | None = None) -> LubricationProblem:
        problem = self.constant.build(self.shape, comm) if self.base is None else copy(self.base)
        problem.shares_grid = problem.shares_grid or self.base is not None
        problem.coefficients_for = None  # what is certified is another problem, made from this one
        if problem.held is not None and self.law.barus:
            problem.held = replace(problem.held, law=self.law)
        return problem if self.by is None else self.by.film(problem)

    def factored(self, problem: Any, j: NDArray[np.int64], i: NDArray[np.int64]) -> Any:
        problem.coefficients_for = None  # which faces at round edges make, and effects do not
        return problem if self.by is None else self.by.on(problem.grid, j, i).film(problem)
