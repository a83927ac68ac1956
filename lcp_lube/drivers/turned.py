"""Films under a wall that moves to smaller x: the mirror image is solved, and its answer turned back."""

from dataclasses import dataclass, replace
from typing import Any

from ..problems.film.lubrication import LubricationProblem
from ..problems.film.model import Model
from ..problems.film.turned import TurnedProblem
from ..problems.solution import Solution
from ..scenes.moving import film_of
from ..scenes.scene import Derived, Solvable
from .ask import Ask, Start
from .compose import Inner


@dataclass(frozen=True)
class Mirrored(Derived):
    """The mirror image of a scene."""

    @property
    def model(self) -> Model:
        return self.whole.model.mirrored


def as_solved(solution: Solution) -> Solution:
    """The solution of what was solved: of a film that is turned round its mirror image."""
    problem: Any = solution.problem
    return replace(solution, problem=problem.moving, fields=problem.there(solution.fields))


def applies(scene: Solvable, ask: Ask) -> bool:
    """Whether the scene is a film whose wall moves to smaller x."""
    model = film_of(scene)
    return model is not None and model.U < 0


def solve(scene: Solvable, ask: Ask, inner: Inner) -> Solution:
    """The mirror image's solution, turned back. Collective."""
    if ask.start is not None and isinstance(near := ask.start.problem, TurnedProblem):
        made = ask.start.made if isinstance(ask.start, Start) else None  # in the mirror image's frame
        ask = replace(ask, start=Start(near.moving, near.there(ask.start.fields), ask.start.settings, made))
    solution = inner(Mirrored(scene), ask)
    assert isinstance(solution.problem, LubricationProblem)  # as `applies` found
    problem = TurnedProblem(solution.problem, scene.model.exact)  # type: ignore[union-attr]
    band = solution.enclosure
    if band is not None:
        band = replace(band, lower=problem.here(band.lower), upper=problem.here(band.upper))
    solution.because("the wall moves to smaller x: the mirror image is solved, and turned back")
    return replace(solution, problem=problem, fields=problem.here(solution.fields), enclosure=band)
