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
from ..problems.film.cavity import cavity_sign
from ..problems.film.certify import supply_defects
from ..problems.film.lubrication import LubricationProblem
from ..problems.film.model import Model
from ..problems.film.supplies import Supply, supply_flows
from ..problems.solution import Enclosure, Fields, Outcome, Solution
from ..scenes.moving import film_of
from ..scenes.scene import Derived, Solvable
from .ask import Ask
from .chain import Chain
from .compose import Inner

MOST_SOLVES = 40  # ends a search that goes round in circles; random films with dense fluids took up to 11
TOLERANCE = 1e-10  # of the largest flow: by how much what a source gives may differ from what the film takes
DIGITS, ENOUGH = 1e-7, 1e-4  # a step of this part of the largest pressure may be rounding; the misfit accepted then
PATIENCE, GIVE_UP = 2, 8  # such steps that do not halve the misfit: from then on ENOUGH is accepted; the search ends
DEAF = 1e-9  # of the slope at which a change by P ends the misfit: a flow that depends on P less does so by rounding
LIKELY = 20.0  # largest ratio between slopes with coefficients that follow and the film's own, either way
RETREATS, RETREAT = 5, 0.1  # how often, and to which part of the way from pressures with an answer to those without
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
    known = ask.start.settings.get("supply_pressures") if ask.start is not None else None
    from .sources import Sources  # here: of such films alone

    sources = Sources(supplies)
    free, P = sources.free, np.array(_first(model))
    if known is not None and len(known) == len(supplies):
        near: Any = ask.start
        P = np.array(known) if model.stored is None else sources.foreseen(near.problem, near.fields["p"])
    # Nothing flows in a steady film, through its restrictor neither, whatever rounding says.
    known_before = shut and len(supplies) == 1 and model.stored is None
    P = np.array([supplies[0].p_s]) if known_before else P
    other = np.full(2, np.nan)  # of one supply: the last pressure that was too low, and too high
    ahead: Fields | None = None  # of the film with the next pressures
    follow = model.stored is None and not (model.effects or model.law or model.grooves or known_before)
    chain = Chain(replace(ask, certify=False, reduction=ask.reduction and not ask.certify), inner)  # one band, at the end
    resting, least, enough = 0, np.inf, ENOUGH if known_before else TOLERANCE
    together = False  # film and pressures
    moved: Any = None  # the last step, and from where
    beside: Any = 0.0  # what effects add to the slopes
    retreats, carried = 0, 0.0 * P[free]  # from pressures that effects leave without an answer, and the last that had one
    for count in range(1, MOST_SOLVES + 1):
        if together:
            solution = chain.solve(scene, ahead, rescue=False)
        if together and solution.converged:
            P = np.array([one.p for one in solution.problem.held.supplies])  # type: ignore[attr-defined]
        else:
            solution = chain.solve(Fed(scene, sources.held(P)), ahead)
        problem: Any = solution.problem
        if not solution.converged:
            if not model.effects or solution.outcome != Outcome.MAX_ITERATIONS or retreats == RETREATS:
                break
            retreats, moved, ahead = retreats + 1, None, None
            P[free] = carried + RETREAT * (P[free] - carried)
            chain.forget()
            continue
        carried = P[free]
        flows = np.array(supply_flows(problem, solution.fields["p"], solution.fields["r"]))
        sought = [(one, float(p), float(flow)) for one, p, flow in zip(supplies, P, flows, strict=True)]
        problem.hold_at(supplies, P)
        off = np.array(supply_defects(problem, flows.tolist()), dtype=float)
        misfit = np.array([one.sought(p, flow) if one.open else (0.0, 0.0, 0.0) for one, p, flow in sought])
        starved = (off > TOLERANCE) & (misfit[:, 0] > 0.0) & (P <= 0.0)
        if np.max(off) <= TOLERANCE or starved.any() or count == MOST_SOLVES or known_before:
            break
        slopes, answers = _slopes(problem, solution.fields, free)
        if moved is not None:  # the film's coefficients follow as well: what the last step has changed (Broyden's slopes)
            by, before, was = moved
            secant = slopes + beside + np.outer(flows[free] - before - was @ by, by / (by @ by))
            likely = np.diag(slopes) / LIKELY < np.diag(secant)
            likely &= np.diag(secant) < LIKELY * np.diag(slopes)
            slopes, beside = (secant, secant - slopes) if likely.all() else (slopes, 0.0)
        matrix = misfit[free, 2:] * slopes + np.diag(misfit[free, 1])
        steep = np.abs(misfit[free, 0]) / np.maximum(P[free], model.p_unit * 1e-3)
        flat = np.diag(matrix) <= DEAF * steep  # a film that is nowhere full does not depend on P: ten times as much
        matrix += np.diag(np.where(flat, steep / 9.0 - np.diag(matrix), 0.0))
        new_P = np.maximum(P[free] + np.linalg.solve(matrix, -misfit[free, 0]), 0.0)
        if new_P.size == 1:  # the misfit grows with P
            other[int(misfit[free, 0][0] > 0.0)] = P[free][0]
            if not np.isnan(other).any() and not other[0] < new_P[0] < other[1]:
                new_P[:] = np.mean(other)
        rests = np.all(np.abs(new_P - P[free]) <= DIGITS * np.max(P)) and np.max(off) > 0.5 * least
        resting, least = resting + 1 if rests else 0, min(least, np.max(off))
        if resting >= GIVE_UP or (resting >= PATIENCE and np.max(off) <= ENOUGH):
            enough = ENOUGH
            break
        together = follow and count == 1 and solution.settings["method"] == "fas"
        by, P[free] = new_P - P[free], new_P
        moved = (by, flows[free], slopes) if model.effects and by.any() else None
        if model.stored is not None or follow:
            z = sources.put(problem, solution.fields["p"] - solution.fields["r"] + by @ np.array(answers), P)
            ahead = {"p": np.maximum(z, 0.0), "r": np.maximum(-z, 0.0)}
    if solution.converged and np.max(off) > enough:
        worst = int(np.argmax(np.where(starved, off, 0.0) if starved.any() else off))
        if starved.any():
            message = f"supply {worst + 1}: at p_c the film draws {flows[worst]:.6g} m3/s already, more than its source gives"
            solution.outcome, solution.message = Outcome.NO_SOLUTION, message
        else:
            message = f"supply {worst + 1}: film and source differ by {off[worst]:.1e} of the flow after {count} solves"
            if enough == ENOUGH or np.max(off) <= ENOUGH:
                message += ": the last digit of the pressure moves the film's flow by more than that"
            solution.outcome, solution.message = Outcome.MAX_ITERATIONS, message
    solution.steps = chain.steps
    problem.hold_at(supplies, P)
    solution.certificate = problem.certify(solution.fields, solution.settings["eps1"])
    if ask.certify:
        from .supply_band import enclose_fed  # here: seldom asked for

        none = "no band: supplies' pressures and the film's coefficients follow together; give the pressures that were found"
        varies = model.effects or model.law
        solution.enclosure = Enclosure(False, none) if varies else enclose_fed(problem, solution.fields)
    found = ", ".join(f"{p + model.p_c:.6g}" for p in P)
    solution.settings["supply_pressures"] = [float(p) for p in P]
    solution.because(f"supplies: pressures {found} Pa, found in {count} solves")
    return solution.judged()


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


def _slopes(problem: LubricationProblem, fields: Any, free: Any) -> tuple[Array, list[Array]]:
    """dQ_s/dP_t of the film at its signs for the supplies that are free, m3/s/Pa, and what it answers to each. Collective."""
    from .motions.linearised import Feed, Linear  # films without supplies, which ask for this module too, need none

    held = problem.held
    assert held is not None  # as `applies` found
    cavity = (cavity_sign(problem.reduce, fields["p"], fields["r"]) < 0) & ~held.mask.ravel()
    linear, feed = Linear(problem, cavity), Feed(problem, cavity, free)
    try:
        answers = linear.solve([feed.pushed(t) for t in feed.free])
        return feed.slopes(answers), answers
    finally:
        linear.destroy()
        feed.destroy()
