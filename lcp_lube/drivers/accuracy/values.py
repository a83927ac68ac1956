"""What the grids of a run to an accuracy say of its numbers: taken where they are asked for, and the best of each."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from math import hypot, inf, isfinite
from typing import Any

import numpy as np

from ...problems.film.forces import of_line, totals
from ...problems.film.fronts import counted
from ...problems.film.lubrication import LubricationProblem
from ...problems.film.strip import stream_weights
from ...problems.film.turned import TurnedProblem
from ...problems.film.turning import ahead
from ...problems.solution import Fields, Problem, Solution
from ...problems.transfer import interpolated
from .estimate import INTEGRALS, QUADRATURE, Estimate, Traits, estimate, follow, known_line, of_pair, scalars
from .unseen import misplaced_film

APART = 1.8  # spacings of two grids over one another, at least, where two such are there: nearer ones tell little
BLOCKS = 6  # parts of a side over which the change of the pressure is integrated
CLOSE = 32  # points a side of a grid whose cells are looked at in some 500 places along each line
SWINGING = ("load", "p_max", "friction", "cavitated_fraction")  # numbers that come and go in a march
LARGE = 1_000_000  # points beyond which a grid is not kept until its numbers are asked for


class Values:
    """The values on all grids so far, coarse to fine. It becomes `Solution.told_by`.

    Parameters
    ----------
    film : what its estimates hang on. least : relative error that the solves may leave on any grid.

    Attributes
    ----------
    line : a problem and its fields that have the numbers of a line that is known; None of other films.
    largest : the quantity had in the last grid's march, if it is one that comes and goes; else 0.
    """

    def __init__(self, film: Traits, least: float):
        self.line: tuple[LubricationProblem, Fields] | None = None
        self._known: Mapping[str, float] | None = None  # all numbers of it
        self.quantity, self.best = "", Estimate(np.nan, inf)
        self._film, self._least = film, least
        self._grids: list[Solution | Mapping[str, float]] = []  # those before the last, or their numbers
        self._last: Mapping[str, float] = {}  # numbers of the last one, once they are told
        self._own: list[float] = []  # of the quantity
        self._sizes: list[float] = []
        self._misplaced: list[float] = []
        self._converged = False  # on the last grid
        self._other, self._change = -2, (inf, inf)  # of the pressure from that grid on: `_change`
        self._full = False  # nothing is cavitated
        self.largest = 0.0

    def add(
        self, solution: Solution, before: Solution | None, earlier: Solution | None, size: float, quantity: str, value: float
    ) -> None:
        """One grid more, so many meshes a side, and this value of the quantity there. Collective.

        before, earlier : the answers on the last grid, and on that before it.
        """
        problem = solution.problem
        if self._film.line and before is None:
            self.line = known_line(problem)
        if before is not None:
            self._grids.append(before if "numbers" not in vars(before) else _numbers(before))
        self.quantity, self._converged = quantity, solution.converged
        self._own.append(value if solution.converged else np.nan)
        self._sizes.append(size)
        # Of what quadrature does not tell nothing is known; what a grid saw all of, looked at closely, a finer one sees too.
        seen = before is not None and self._misplaced[-1] == 0.0 and min(before.problem.grid.shape) >= CLOSE
        self._misplaced.append(inf if self.line is not None else 0.0 if seen else misplaced_film(problem))
        self._other = -3 if earlier is not None and size < APART * self._sizes[-2] else -2
        other = earlier if self._other == -3 else before
        self._change = _change(solution, other, quantity, self._own[self._other]) if other and self._film.pairs else (inf, inf)
        self._full = self._film.pairs and not problem.reduce.max(solution.fields["r"]) > 0.0
        self.largest = max((abs(row[quantity]) for row in solution.history), default=0.0) if quantity in SWINGING else 0.0
        self.best = self._best(quantity, self._own)

    @property
    def relative(self) -> float:
        """The error of the quantity's best value over that value; in time over the largest it had, which may end as next to
        nothing beside that."""
        found = replace(self.best, value=max(abs(self.best.value), self.largest)).relative
        return max(found, self._least) if self.largest else found

    def _best(self, name: str, values: list[float]) -> Estimate:
        """The best value of a number and its error: from what is known of a line, or from its values on all grids."""
        value, truth = values[-1], self._truth(name)
        if np.isfinite(truth):
            above = max(1.0, abs(value / truth)) if truth else 1.0  # relative to the truth, not to a value that is too large
            return Estimate(value, above * abs(value - truth) + QUADRATURE * abs(value))
        by_load, by_all = self._change
        if not isfinite(by_load) or (name not in INTEGRALS and len(values) > 2):
            found = estimate(values, self._misplaced, self._sizes, name, self._film)
            never = name in SWINGING and not any(value < 0.0 for value in values)  # below nothing
            return replace(found, value=max(0.0, found.value)) if never else found
        grids, change = (self._misplaced, self._sizes), by_load if name in INTEGRALS else by_all
        pair = of_pair(values, *grids, change, name, self._other, self._full, self._film)
        return replace(pair, error=max(pair.error, self._least * abs(value)))

    def _truth(self, name: str) -> float:
        """A number of a line that is known; NaN where there is none. Collective."""
        if self.line is None:
            return np.nan
        if self._known is None:
            if name == self.quantity and (found := carried(self.line[0], None, name)) is not None:
                return found
            self._known = scalars(self.line[0].quantities(self.line[1]))
        return self._known.get(name, np.nan)

    def tell(self, solution: Solution, numbers: dict[str, Any]) -> dict[str, Any]:
        """The last grid's numbers with the best value in the place of its own, in place. Collective."""
        self._last = {**sought(solution), **scalars(numbers)} if self._converged else {}
        if self.best.extrapolated and self.quantity in numbers:
            follow(numbers, self.quantity, self._own[-1], self.best.value)
        if solution.problem.grid.comm.size > 1:  # what needs every rank is taken now
            self.estimates  # noqa: B018
        return numbers

    @cached_property
    def estimates(self) -> dict[str, dict[str, Any]]:
        """Value, error (in its unit) and extrapolated of every number that has an estimate, once `tell` has been called.

        From the numbers of all grids, which are taken here. Collective the first time.
        """
        grids = [one if isinstance(one, Mapping) else _numbers(one) for one in self._grids] + [self._last]
        out = {}
        for name in {**self._last, self.quantity: 0.0}:
            values = self._own if name == self.quantity else [found.get(name, np.nan) for found in grids]
            if isfinite((best := self._best(name, values)).error):
                out[name] = vars(best)
        return out


def carried(problem: Problem, fields: Fields | None, quantity: str) -> float | None:
    """An integral of the pressure without all other numbers, where a scene makes nothing else of it; else None. Collective.

    fields : None: that of a line as its film has it.
    """
    kept = problem.grid.comm.size == 1 and problem.grid.size <= LARGE
    if quantity not in INTEGRALS or not isinstance(problem, LubricationProblem) or not kept or problem.more:
        return None
    if isinstance(problem, TurnedProblem) or (problem.extras is not None and problem.shaft is None):
        return None
    return _integral(problem, fields, quantity)


def _integral(problem: LubricationProblem, fields: Fields | None, quantity: str) -> float:
    """One of INTEGRALS, as `forces` has it; fields : as in `carried`. Collective."""
    names = ("force_x", "force_y") if quantity == "load" and problem.shaft is not None else (quantity,)
    from ...problems.film.known import known_of  # here: of runs to an accuracy alone

    known = known_of(problem)
    if fields is None:
        assert known is not None  # as `known_line` found
        found = of_line(problem, known, names)
    else:
        found = totals(problem, fields["p"] * problem.p_unit, fields["r"], known, names)
    return hypot(found["force_x"], found["force_y"]) if len(names) == 2 else found[quantity]


def sought(solution: Solution) -> dict[str, float]:
    """The value that a balance found: what it carries is given."""
    balance = solution.settings.get("balance")
    return {balance["vary"]: balance["value"]} if balance else {}


def _numbers(solution: Solution) -> dict[str, float]:
    return {**sought(solution), **scalars(solution.numbers)} if solution.converged else {}


def _change(solution: Solution, before: Solution, quantity: str, value: float) -> tuple[float, float]:
    """How far the pressure has changed from the grid before, at the points of that; value : of the quantity there. Collective.

    Returns
    -------
    by_load : the change of its integrals over BLOCKS x BLOCKS parts of the film, without signs, over the quantity: errors that
        cancel within a dimple do not count, those that do so by chance across the film do. by_all : of |p - p'| over that of p.
    """
    problem, told = solution.problem, quantity in INTEGRALS and solution.converged
    if not (told and before.converged) or not isinstance(problem, LubricationProblem):
        return inf, inf
    coarse: Any = before.problem
    grid = coarse.grid
    there = interpolated(problem.grid, grid, solution.fields["p"] * problem.p_unit, ahead(coarse, problem))
    p = before.fields["p"] * coarse.p_unit
    share = np.divide(counted(coarse, p, before.fields["r"]), p, out=np.ones_like(p), where=p > 0.0)
    changed = ((there - p) * share).reshape(grid.box) * (grid.cell * stream_weights(grid)) * grid.widths(0)
    column, row = (
        np.arange(*ends) * BLOCKS // n
        for ends, n in zip(((grid.x_start, grid.x_end), (grid.y_start, grid.y_end)), grid.shape, strict=True)
    )
    blocks = np.bincount((BLOCKS * row[:, None] + column).ravel(), changed.ravel(), BLOCKS**2)
    by_blocks, own = float(np.sum(np.abs(grid.comm.allreduce(blocks)))), abs(value)
    by_points, whole = (
        coarse.reduce.sum(np.abs(changed)),
        value if quantity == INTEGRALS[1] else _integral(coarse, before.fields, INTEGRALS[1]),
    )
    return by_blocks / own if own else inf, by_points / whole if whole else inf
