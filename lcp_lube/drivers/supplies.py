"""Supplies whose pressures are not given: Newton's method for the pressures at which sources and film agree on the flow.

With its pressures P given the film is a problem of its own, which every method solves. What supply s gives to the film, Q_s(P),
grows with P_s and falls with the others' pressures (an M-function: the film's response to a pressure is one), and its source
gives R_s(P_s), which never grows. Newton's method on Q - R, with the exact derivative of the discrete film at its signs, ends
after a handful of solves, each started from the last. That leaves A, B, c and every method as they are; sharing one unknown
among a supply's cells would put a dense row into each of their matrices, grids and kernels.

Where multigrid solves, one such step brings the pressures near: from there they are unknowns of its own cycles.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from petsc4py import PETSc

from ..base.parallel import Array
from ..errors import InputError
from ..problems.facts import Facts
from ..problems.film.lubrication import LubricationProblem
from ..problems.film.model import Model
from ..problems.film.supplies import Supply
from ..problems.solution import Enclosure, Outcome, Solution
from ..scenes.moving import film_of
from ..scenes.scene import Derived, Solvable
from .ask import Ask
from .chain import Chain
from .compose import Inner

MOST_SOLVES = 40  # ends a search that goes round in circles; random films with dense fluids took up to 11
FIRST = 0.5  # part of p_s behind a restrictor, to begin with


@dataclass(frozen=True)
class Fed(Derived):
    """A scene with its supplies held at pressures, whatever feeds them."""

    supplies: tuple[Supply, ...]

    @property
    def model(self) -> Model:
        return replace(self.whole.model, supplies=self.supplies, exact=None)

    def facts(self, comm: PETSc.Comm | None = None) -> Facts:
        return self.whole.facts(comm)

    def build(self, comm: PETSc.Comm | None = None) -> LubricationProblem:
        problem: LubricationProblem = self.whole.build(comm)
        problem.hold_at(self.supplies)
        return problem


def applies(scene: Solvable, ask: Ask) -> bool:
    """Whether the film has a supply whose pressure has to be found."""
    model = film_of(scene)
    return not isinstance(scene, Fed) and model is not None and any(one.open for one in model.supplies)


def solve(scene: Solvable, ask: Ask, inner: Inner) -> Solution:
    """The solution at the pressures at which every source gives what its supply takes. Collective.

    Raises
    ------
    InputError : what all the supplies give has no way out, and nothing says how large the pressure is.

    Returns
    -------
    Solution : outcome NO_SOLUTION where the film draws more than a supply gives even at the cavitation pressure.
    """
    model: Model = scene.model  # type: ignore[union-attr]
    supplies = model.supplies
    if model.stored is not None:
        from .marches import supply_step  # here: of marches alone

        if (by_steps := supply_step.solve(scene, ask, inner)) is not None:
            return by_steps
    shut = not model.grooves and not any(side.kind == "open" for side in model.sides[: 2 * len(scene.shape)])
    if shut and all(one.flow is not None for one in supplies):
        raise InputError(f"{scene.name}: supply.1.flow: no side has a pressure, and no supply one or a restrictor: no way out")
    from .sources import Sources  # here: of such films alone
    from .supply_search import Search

    sources = Sources(supplies)
    # Nothing flows in a steady film that is shut, through its restrictor neither, whatever rounding says.
    settled = shut and len(supplies) == 1 and model.stored is None
    P = np.array([supplies[0].p_s]) if settled else _begin(model, ask, sources)
    search, ahead = Search(model, sources, P, settled), None
    follow = model.stored is None and not (model.effects or model.law or model.grooves or settled)
    chain = Chain(replace(ask, certify=False, reduction=ask.reduction and not ask.certify), inner)  # one band, at the end
    together = False  # film and pressures
    for count in range(1, MOST_SOLVES + 1):
        if together:
            solution = chain.solve(scene, ahead, rescue=False)
        if together and solution.converged:
            search.P = np.array([one.p for one in solution.problem.held.supplies])  # type: ignore[attr-defined]
        else:
            solution = chain.solve(Fed(scene, sources.held(search.P)), ahead)
        problem: Any = solution.problem
        if not solution.converged:  # effects may leave pressures without an answer
            if not model.effects or solution.outcome != Outcome.MAX_ITERATIONS or not search.retreat():
                break
            ahead = None
            chain.forget()
        else:
            done = search.meet(problem, solution.fields) or count == MOST_SOLVES
            if done or not search.step(problem, solution.fields):
                break
            together = follow and count == 1 and solution.settings["method"] == "fas"
            ahead = search.ahead(problem, solution.fields) if model.stored is not None or follow else ahead
    search.judge(solution, count)
    solution.steps = chain.steps
    problem.hold_at(supplies, search.P)
    solution.certificate = ask.certify_by(problem, solution.fields, solution.settings["eps1"])
    if ask.certify:
        from .supply_band import enclose_fed  # here: seldom asked for

        none = "no band: supplies' pressures and the film's coefficients follow together; give the pressures that were found"
        varies = model.effects or model.law
        solution.enclosure = Enclosure(False, none) if varies else enclose_fed(problem, solution.fields)
    found = ", ".join(f"{p + model.p_c:.6g}" for p in search.P)
    solution.settings["supply_pressures"] = [float(p) for p in search.P]
    solution.because(f"supplies: pressures {found} Pa, found in {count} solves")
    return solution.judged()


def _begin(model: Model, ask: Ask, sources: Any) -> Array:
    """Pressures to begin with: those of the start, where it has any. Collective."""
    known = ask.start.settings.get("supply_pressures") if ask.start is not None else None
    if known is None or len(known) != len(model.supplies):
        return np.array(_first(model))
    near: Any = ask.start
    return np.array(known) if model.stored is None else sources.foreseen(near.problem, near.fields["p"])


def _first(model: Model) -> list[float]:
    """Pressures to begin with: given ones, a part of a restrictor's p_s, the sides' largest behind a given flow."""
    sides = max((side.p for side in model.sides if side.kind == "open"), default=0.0)
    return [one.p if not one.open else FIRST * one.p_s if one.law else sides + 1e-3 * model.p_unit for one in model.supplies]


def check_backflow(solution: Solution) -> None:
    """Refuse an answer in which oil flows back through a restrictor that was not said to let it.

    Raises
    ------
    InputError : names the supply and both pressures.
    """
    held = getattr(solution.problem, "held", None)
    for number, one in enumerate(held.supplies if held is not None and solution.converged else (), start=1):
        if one.law and not one.backflow and one.p > one.p_s:
            p_s, p = (value + solution.problem.p_c for value in (one.p_s, one.p))  # type: ignore[attr-defined]
            raise InputError(
                f"{solution.settings['scene']}: supply.{number}.p_s = {p_s:g}: less than the film's pressure there, {p:g} Pa: "
                f"oil would flow back through the restrictor; a larger p_s is needed, or supply.{number}.backflow = true"
            )
