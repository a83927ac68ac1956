"""A journal that goes where load, film and its mass take it: Newton's method on its place at the end of a time step.

    mass c d2e/dt2 = F(e, film) + W(t),     d/dt by the formula that the film's contents have (`march`)

e = [X, Y] is in parts of the clearance c. The film is solved at every iterate; -dF/de of the step is exact
(`linearised`: stiffness, and damping with what is stored, in one matrix), and is kept while iterates converge quickly.
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..base.parallel import Array
from ..errors import InputError
from ..problems.film.forces import forces
from ..problems.solution import Solution
from ..scenes.motion import MotionTable
from .march import Formula

MOST, TOL = 30, 1e-9  # iterates a step; forces left, in parts of the largest seen
SLOW = 0.2  # fall of the forces left by an iterate above which the matrix is made anew
NEAREST = 0.5  # of the thinnest film: the longest step of the journal


@dataclass
class Rotor:
    """Places (clearances) and speeds of the last times, the newest first; c : clearance, m."""

    table: MotionTable
    c: float
    places: list[Array] = field(default_factory=list)
    speeds: list[Array] = field(default_factory=list)
    size: float = 0.0  # largest force so far, N
    K: Array | None = None  # of the last step, N/m
    weight: float = 0.0  # of the formula that it belongs to

    @classmethod
    def of(cls, table: MotionTable, c: float, place: tuple[float, float]) -> "Rotor":
        """At t = 0; place : where the journal is unless the table says."""
        return cls(table, c, [np.array(table.position or place)], [np.array(table.velocity)])

    def guess(self, dt: float, dts: list[float]) -> Array:
        """The place after a step, as the last steps went on."""
        if not dts:
            return self.places[0] + dt * self.speeds[0]
        return self.places[0] + dt * (self.speeds[0] + 0.5 * (dt / dts[0]) * (self.speeds[0] - self.speeds[1]))

    def settle(
        self,
        t: float,
        formula: Formula,
        start: Array,
        film_at: Callable[[Array], Solution],
        stiffness: Callable[[Solution], Array],
    ) -> tuple[Solution, Array, str]:
        """The film and the place at the step's end; a reason where there is none. Collective.

        Parameters
        ----------
        film_at : solves the film with the journal there. stiffness : -dF/de of such a solution, N/m.
        """
        assert self.table.mass is not None  # as its validator found
        load, mass = np.array(self.table.load_at(t)), self.table.mass * self.c
        if self.K is not None and formula.weight != self.weight:
            self.K = None
        e, before = start, np.inf
        for k in range(MOST):
            solution, e = (film_at(e), e) if k else self._first(e, film_at)
            if not solution.converged:
                return solution, e, ""
            problem: Any = solution.problem
            force = np.array(forces(problem, solution.fields["p"] * problem.p_unit)["force"])
            speed = formula.weight * e - formula.old(self.places)
            inertia = mass * (formula.weight * speed - formula.old(self.speeds))
            left = inertia - force - load
            self.size = max(self.size, float(np.hypot(*force)), float(np.hypot(*load)))
            now = float(np.hypot(*left)) / (self.size or 1.0)
            if now <= TOL:
                return solution, e, ""
            if self.K is None or now > SLOW * before:
                self.K, self.weight = stiffness(solution), formula.weight
            before = now
            try:
                move = -np.linalg.solve(mass * formula.weight**2 * np.eye(2) + self.c * self.K, left)
            except np.linalg.LinAlgError:
                return solution, e, "the film has no stiffness there"
            longest = NEAREST * problem.reduce.min(problem.scheme.h) / self.c
            size = float(np.hypot(*move))
            if not size < np.inf:
                return solution, e, "its forces are no numbers"
            if size <= 1e-14:
                return solution, e, ""
            e = e + move * min(1.0, longest / size)
            solution.destroy()
        return solution, e, f"forces of {now:.1e} of the largest are left after {MOST} iterates of the journal's place"

    def _first(self, e: Array, film_at: Callable[[Array], Solution]) -> tuple[Solution, Array]:
        """The film where the journal is expected, or where it has room on the way there."""
        last = self.places[0]
        for part in (1.0, 0.5, 0.25):
            with suppress(InputError):  # the wall would touch
                place = last + part * (e - last)
                return film_at(place), place
        return film_at(last), last

    def accept(self, e: Array, formula: Formula) -> None:
        """Take a step over."""
        speed = formula.weight * e - formula.old(self.places)
        self.places, self.speeds = [e, *self.places[:2]], [speed, *self.speeds[:1]]

    def error(self, e: Array, dt: float, dts: list[float], thinnest: float) -> float | None:
        """How far the journal is from where its last steps pointed, in parts of the thinnest film; None at first."""
        if len(dts) < 2:
            return None
        return float(np.hypot(*(e - self.guess(dt, dts)))) * self.c / thinnest / 3.0
