"""No more model than a scene needs: what does not vary is not solved for, what mirrors itself is solved once.

`film_part` and `rectangle_part` say what is left of a scene. The reduced equations are the whole problem's own, with like
unknowns put in one: their answer, spread out again, is certified on the whole problem's data like any other, and where that
fails the whole problem is solved. (A film that does not cavitate needs no choice: the active-set method's first step is its one
linear solve.)
"""

from dataclasses import replace
from math import prod
from typing import Any

from ..problems.certificate import Certificate
from ..problems.film.tangent import renew
from ..problems.solution import Fields, Outcome, Problem, Solution
from ..problems.transfer import Pick, numbers
from ..scenes.scene import Solvable
from . import film_part, rectangle_part
from .ask import Ask, Built, Start, bare
from .compose import Inner
from .memory import LARGE, look_ahead, resident
from .plan import plan

Part = film_part.Part | rectangle_part.Quarter
FAMILIES = (film_part, rectangle_part)  # their UNLIKELY and NONE: why there is no part, by a few points and by all of them


def parts_for(scene: Solvable) -> Any:
    """Where parts of this scene are looked for, if anywhere."""
    return next((family for family in FAMILIES if family.applies(scene)), None)


def applies(scene: Solvable, ask: Ask) -> bool:
    """Whether there is something that symmetries could be looked for in."""
    return parts_for(scene) is not None


def why_not(ask: Ask) -> str:
    """What of the ask wants the whole model; empty if nothing does."""
    if not ask.reduction:
        return "no reduction was asked for"
    if ask.named:
        return "a method, a matrix or an inner solver was named: the whole scene's"
    if ask.certify:
        return "the band is proved for the whole problem"
    return "checkpoints hold the whole problem" if ask.checkpoint or ask.resume else ""


def solve(scene: Solvable, ask: Ask, inner: Inner) -> Solution:
    """The whole problem's solution from the least part that has it; from itself where there is none. Collective."""
    family = parts_for(scene)
    assert family is not None  # as `applies` found
    if reason := why_not(ask) or ("" if family.promising(scene) else family.UNLIKELY):
        return _whole(inner(scene, ask), reason)
    if ask.memory_check and prod(scene.shape) >= LARGE:
        facts = scene.facts(ask.comm)
        look_ahead(facts, plan(facts, ask, scene.name), ask.mpi)
    before, problem = resident(), scene.build(ask.comm)
    part = family.part_of(scene, problem)
    if part is None:
        return _whole(inner(scene, replace(ask, built=Built(problem, before))), family.NONE)
    solution = solve_part(part, problem, ask, inner)
    if solution.outcome is not Outcome.WRONG_SOLUTION:
        return solution
    solution.destroy()
    return _whole(inner(scene, ask), f"the reduced one's answer ({part.kind}) is not the whole scene's")


def _whole(solution: Solution, reason: str) -> Solution:
    """A solution of the whole model, with the reason for that."""
    solution.because(f"the whole model: {reason}")
    return solution


def solve_part(part: Part, problem: Problem, ask: Ask, inner: Inner) -> Solution:
    """The whole problem's solution from its part's. Collective.

    Parameters
    ----------
    problem : the whole one. ask : its `start` is a neighbour's whole problem.
    """
    details = {"reduction": part.kind}
    known = part.answer(problem)
    if known is not None:
        eps1 = ask.stopping_for((1e-8, 1e-8)).eps1
        settings = {
            "scene": part.name,
            "method": "none",
            "scheme": part.scheme,
            "eps1": eps1,
            "why": [part.sentence],
            "details": details,
        }
        certificate = problem.certify(known, eps1)
        return Solution(problem, known, Outcome.CONVERGED, "nothing to solve", certificate, [], settings).judged()
    start = None
    if ask.start is not None:
        small = bare(problem, part.grid(problem.grid.petsc_comm))
        near = problem.prolong(ask.start.problem, ask.start.fields, False)
        take = Pick(problem.grid, small.grid, *numbers(small.grid))
        start = Start(small, {name: take(values) for name, values in near.items()}, ask.start.settings)
        take.destroy()
    whole = _Whole(part, problem, ask)
    solution = inner(part, replace(ask, start=start, judge=whole.certify))
    if start is not None:
        start.problem.grid.destroy()
    certificate = whole.certify(solution.problem, solution.fields, solution.settings["eps1"])
    solution.problem.destroy()
    part.lent.give_back()
    settings = {
        **solution.settings,
        "why": [part.sentence, *solution.settings["why"]],
        "details": {**solution.settings["details"], **details},
    }
    found = {"problem": whole.problem, "fields": whole.fields, "certificate": certificate, "settings": settings}
    return replace(solution, **found).judged()


class _Whole:
    """The whole problem, and the fields that a part's answer spreads out to; for several answers, the last one's."""

    def __init__(self, part: Part, problem: Any, ask: Ask):
        self.problem, self._part, self._ask = problem, part, ask
        self.fields: Fields = {}
        self._seen: Fields = {}
        self._found: Certificate

    def certify(self, small: Any, fields: Fields, eps1: float) -> Certificate:
        """Of the part's fields by the whole problem's data, once for the same ones. Collective."""
        if self._seen is not fields:
            with self._part.lent.returned():
                self._certify(small, fields, eps1)
        return self._found

    def _certify(self, small: Any, fields: Fields, eps1: float) -> None:
        spread = Pick(small.grid, self.problem.grid, *self._part.places(self.problem.grid))
        self._seen, self.fields = fields, {name: spread(values) for name, values in fields.items()}
        if (held := getattr(small, "held", None)) is not None:  # pressures of supplies may have followed
            self.problem.hold_at(self.problem.held.supplies, [one.p for one in held.supplies])
        if (by := getattr(small, "factors", None)) is not None and by.at is not None:
            renew(self.problem, spread(by.at))
        spread.destroy()
        if hasattr(small, "many"):
            self.problem.many = small.many
        self._found = self._ask.certify_by(self.problem, self.fields, eps1)
