"""Newton's method for the pressures of a film's supplies, at which what their sources give is what the film takes."""

from typing import Any

import numpy as np

from ..base.parallel import Array
from ..problems.film.cavity import cavity_sign
from ..problems.film.certify import supply_defects
from ..problems.film.lubrication import LubricationProblem
from ..problems.film.model import Model
from ..problems.film.supplies import supply_flows
from ..problems.solution import Fields, Outcome, Solution
from .motions.linearised import Feed, Linear
from .sources import Sources

TOLERANCE = 1e-10  # of the largest flow: by how much what a source gives may differ from what the film takes
DIGITS, ENOUGH = 1e-7, 1e-4  # a step of this part of the largest pressure may be rounding; the misfit accepted then
PATIENCE, GIVE_UP = 2, 8  # such steps that do not halve the misfit: from then on ENOUGH is accepted; the search ends
DEAF = 1e-9  # of the slope at which a change by P ends the misfit: a flow that depends on P less does so by rounding
LIKELY = 20.0  # largest ratio between slopes with coefficients that follow and the film's own, either way
RETREATS, RETREAT = 5, 0.1  # how often, and to which part of the way from pressures with an answer to those without


class Search:
    """The pressures, and what is known of the flows at them. All methods are collective.

    Attributes
    ----------
    P : Pa over the cavitation pressure, of all supplies; the free ones are sought. flows : from supplies to the film, m3/s.
    off : by which part of the largest flow source and film differ, of each supply.

    Parameters
    ----------
    settled : whether the pressure is known: nothing flows in a film that is shut, whatever rounding says.
    """

    def __init__(self, model: Model, sources: Sources, P: Array, settled: bool):
        self.P, self.free, self.settled = P, sources.free, settled
        self.flows = self.off = np.zeros(P.size)
        self._model, self._sources = model, sources
        self._misfit = np.zeros((P.size, 3))  # value, and its derivatives by P and by the flow (`Supply.sought`)
        self._starved = np.zeros(P.size, dtype=bool)
        self._between = np.full(2, np.nan)  # of one supply: the last pressure that was too low, and too high
        self._resting, self._least, self._enough = 0, np.inf, ENOUGH if settled else TOLERANCE
        self._moved: tuple[Array, Array, Array] | None = None  # the last step, and from which flows and slopes
        self._beside: Any = 0.0  # what effects add to the slopes
        self._retreats, self._carried = 0, 0.0 * P[self.free]  # the last pressures that had an answer
        self._step, self._answers = (
            0.0 * P[self.free],
            np.zeros((0, 0)),
        )  # the last step, and the film's answer to each pressure

    def retreat(self) -> bool:
        """Go back most of the way to pressures that had an answer; False where that has been tried often enough."""
        if self._retreats == RETREATS:
            return False
        self._retreats, self._moved = self._retreats + 1, None
        self.P[self.free] = self._carried + RETREAT * (self.P[self.free] - self._carried)
        return True

    def meet(self, problem: LubricationProblem, fields: Fields) -> bool:
        """What film and sources say of the flows at these pressures; whether they agree, or never will."""
        supplies, self._carried = self._model.supplies, self.P[self.free]
        self.flows = np.array(supply_flows(problem, fields["p"], fields["r"]))
        problem.hold_at(supplies, self.P)
        self.off = np.array(supply_defects(problem, self.flows.tolist()), dtype=float)
        each = zip(supplies, self.P.tolist(), self.flows.tolist(), strict=True)
        self._misfit = np.array([one.sought(p, flow) if one.open else (0.0, 0.0, 0.0) for one, p, flow in each])
        self._starved = (self.off > TOLERANCE) & (self._misfit[:, 0] > 0.0) & (self.P <= 0.0)
        return bool(np.max(self.off) <= TOLERANCE or self._starved.any() or self.settled)

    def step(self, problem: LubricationProblem, fields: Fields) -> bool:
        """A step of Newton's method; False, and none, where steps are rounding and bring no more."""
        film, free, worst = self._model, self.free, float(np.max(self.off))
        slopes, self._answers = self._slopes(problem, fields)
        P, misfit = self.P[free], self._misfit[free]
        matrix = misfit[:, 2:] * slopes + np.diag(misfit[:, 1])
        steep = np.abs(misfit[:, 0]) / np.maximum(P, film.p_unit * 1e-3)
        flat = np.diag(matrix) <= DEAF * steep  # a film that is nowhere full does not depend on P: ten times as much
        matrix += np.diag(np.where(flat, steep / 9.0 - np.diag(matrix), 0.0))
        new_P = np.maximum(P + np.linalg.solve(matrix, -misfit[:, 0]), 0.0)
        if new_P.size == 1:  # the misfit grows with P
            self._between[int(misfit[0, 0] > 0.0)] = P[0]
            if not np.isnan(self._between).any() and not self._between[0] < new_P[0] < self._between[1]:
                new_P[:] = np.mean(self._between)
        rests = np.all(np.abs(new_P - P) <= DIGITS * np.max(self.P)) and worst > 0.5 * self._least
        self._resting, self._least = self._resting + 1 if rests else 0, min(self._least, worst)
        if self._resting >= GIVE_UP or (self._resting >= PATIENCE and worst <= ENOUGH):
            self._enough = ENOUGH
            return False
        self._step, self.P[free] = new_P - P, new_P
        self._moved = (self._step, self.flows[free], slopes) if film.effects and self._step.any() else None
        return True

    def ahead(self, problem: LubricationProblem, fields: Fields) -> Fields:
        """The fields that the last step leads to, at the film's signs."""
        change = self._step @ np.array(self._answers)
        z = self._sources.put(problem, fields["p"] - fields["r"] + change, self.P)
        return {"p": np.maximum(z, 0.0), "r": np.maximum(-z, 0.0)}

    def judge(self, solution: Solution, solves: int) -> None:
        """Where film and sources differ at the end, what becomes of the solution."""
        off = self.off
        if not solution.converged or np.max(off) <= self._enough:
            return
        worst = int(np.argmax(np.where(self._starved, off, 0.0) if self._starved.any() else off))
        if self._starved.any():
            drawn = f"{self.flows[worst]:.6g} m3/s"
            solution.outcome = Outcome.NO_SOLUTION
            solution.message = f"supply {worst + 1}: at p_c the film draws {drawn} already, more than its source gives"
            return
        message = f"supply {worst + 1}: film and source differ by {off[worst]:.1e} of the flow after {solves} solves"
        if self._enough == ENOUGH or np.max(off) <= ENOUGH:
            message += ": the last digit of the pressure moves the film's flow by more than that"
        solution.outcome, solution.message = Outcome.MAX_ITERATIONS, message

    def _slopes(self, problem: LubricationProblem, fields: Fields) -> tuple[Array, Any]:
        """dQ_s/dP_t, m3/s/Pa, with what the film's coefficients, which follow, were seen to add; and the film's answers."""
        slopes, answers = _own_slopes(problem, fields, self.free)
        if self._moved is not None:  # by what the last step has changed (Broyden's slopes)
            by, before, was = self._moved
            secant = slopes + self._beside + np.outer(self.flows[self.free] - before - was @ by, by / (by @ by))
            own, found = np.diag(slopes), np.diag(secant)
            likely = bool(((own / LIKELY < found) & (found < LIKELY * own)).all())
            slopes, self._beside = (secant, secant - slopes) if likely else (slopes, 0.0)
        return slopes, answers


def _own_slopes(problem: LubricationProblem, fields: Any, free: Any) -> tuple[Array, list[Array]]:
    """dQ_s/dP_t of the film at its signs for the supplies that are free, m3/s/Pa, and what it answers to each. Collective."""
    held = problem.held
    assert held is not None  # as `supplies.applies` found
    cavity = (cavity_sign(problem.reduce, fields["p"], fields["r"]) < 0) & ~held.mask.ravel()
    linear, feed = Linear(problem, cavity), Feed(problem, cavity, free)
    try:
        answers = linear.solve([feed.pushed(t) for t in feed.free])
        return feed.slopes(answers), answers
    finally:
        linear.destroy()
        feed.destroy()
