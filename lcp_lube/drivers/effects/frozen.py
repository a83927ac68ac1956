"""Films with their coefficients held: what the loop of effects solves until they count as found, and what it linearises."""

from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from ...problems.certificate import certificate_tol
from ...problems.facts import Facts
from ...problems.film.effects import FaceFactors
from ...problems.film.fluid import Law
from ...problems.film.lubrication import LubricationProblem
from ...problems.film.model import Model
from ...problems.film.stored import Stored
from ...problems.grid import EVEN
from ...scenes.scene import Derived
from ..ask import Ask, Start

SETTLED = 0.1  # of eps1: relative change of the coefficients
IN_TIME = (1e-2, 0.1, 5e-5)  # the same in a time step: of what it changes, of the square of its part in them, and at most


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
        if problem.held is not None and self.law.barus:
            problem.held = replace(problem.held, law=self.law)
        return problem if self.by is None else self.by.film(problem)

    def factored(self, problem: Any, j: NDArray[np.int64], i: NDArray[np.int64]) -> Any:
        return problem if self.by is None else self.by.on(problem.grid, j, i).film(problem)


def settled(ask: Ask, stored: Stored | None, moved: float, reach: float = np.inf, still: bool = False) -> float:
    """Relative change of the coefficients at which they count as found: by the eps1 asked for, not by a method's own.

    In a time step, which is expected to change effects of a size `reach` by `moved`, as far as its formula's error makes sense
    of it: a part of that change, or where effects are small, of the square of moved/reach, which is that error's size. Nothing
    is lost by it, as what cells store has the very density that flows.
    still : whether it falls no further: films are solved to eps1 themselves, and may leave no less.
    """
    eps1 = ask.stopping_for((1e-8, 1e-8)).eps1
    least = eps1 if still else SETTLED * eps1
    given = ask.stopping is not None and not ask.options.get("rest")
    if stored is None or stored.exact or given:
        return least
    part = max(IN_TIME[0] * moved, IN_TIME[1] * (moved / reach) ** 2 if reach else 0.0)
    return max(least, min(part, IN_TIME[2], certificate_tol(eps1)))


def lent(near: Any, shape: tuple[int, ...]) -> LubricationProblem | None:
    """The rigid film of a start whose effects were looked at, on this grid, which is taken over."""
    if not isinstance(near, Start) or near.made is None or near.problem.grid.shape != shape:
        return None
    found: Any = near.problem
    rigid = found if found.plain else found.rigid
    if type(rigid) is not LubricationProblem or rigid.remade:
        return None
    base = copy(rigid)
    base.exact, base.rigid, found.shares_grid = None, None, True
    return base
