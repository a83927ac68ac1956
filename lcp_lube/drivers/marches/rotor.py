"""What is free in a march: a journal or a film's level under a load, and pads that tilt; Newton's method on its place at the
end of a time step.

    mass d2q/dt2 = Q(q, film) + W(t),     d/dt by the formula that the film's contents have (`march`)

q : a journal's [X, Y] in parts of the clearance, or the film's level (m), and the pads' tilts (rad); Q : the film's forces on
them, and its moments about the pivots, which without inertia are to be 0. The film is solved at every iterate; -dQ/dq of
the step is exact (`linearised`: stiffness, and damping with what is stored, in one matrix); it is kept, with what each move
tells of it (Broyden's formula), while iterates converge quickly.
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...base.parallel import Array
from ...errors import InputError
from ...problems.solution import Solution
from .march import Formula
from .march_coordinates import Coordinates

MOST, TOL = 30, 1e-9  # iterates a step; forces left, in parts of the largest seen
SLOW = 0.2  # fall of the forces left by an iterate above which the matrix is made anew
GROWN, HALVED = 2.0, 2  # rise of them by an exact matrix's move, of which half is then taken, and how often in turn
SAME = 1e-9  # relative: formulas' weights that differ by no more do so by the rounding of times
NEAREST = 0.5  # of the thinnest film: the longest step
SMALLEST = 1e-13  # of the thinnest film: a step that is none


@dataclass
class Rotor:
    """Places and speeds of the last times, the newest first. digits : of the forces that may be left, if more than TOL."""

    of: Coordinates
    digits: float = 0.0
    places: list[Array] = field(default_factory=list)
    speeds: list[Array] = field(default_factory=list)
    size: float = 0.0  # largest force so far, N
    K: Array | None = None  # of the last step, N/m of film
    weight: float = 0.0  # of the formula that it belongs to

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
        start : where the search begins, with what is given at its place.
        film_at : solves the film there. stiffness : -dQ/dq of such a solution, by m and rad.
        """
        of, free = self.of, np.flatnonzero(self.of.free)
        loads, inertia = of.loads(t), of.mass * of.unit
        scale = of.unit / of.reach  # moments as forces
        if abs(formula.weight - self.weight) > SAME * formula.weight:
            self.K = None
        inert = np.diag(of.mass * (scale * formula.weight) ** 2)
        q, last, was, before = start, np.where(of.free, self.places[0], start), np.zeros(0), np.inf
        exact, halved = False, 0
        for k in range(MOST):
            solution, q = _film_towards(q, last, film_at)
            if not solution.converged:
                return solution, q, ""
            problem: Any = solution.problem
            force = of.forces(solution)
            speed = formula.weight * q - formula.old(self.places)
            left = scale * (inertia * (formula.weight * speed - formula.old(self.speeds)) - force - loads)
            self.size = max(self.size, *(float(np.linalg.norm(scale * one)) for one in (force, loads)))
            now = float(np.linalg.norm(left[free])) / (self.size or 1.0)
            if now <= max(TOL, self.digits):
                return solution, q, ""
            if exact and now > GROWN * before and halved < HALVED:
                q, halved = last + 0.5 * (q - last), halved + 1
                solution.destroy()
                continue
            K, exact, halved = self.K, self.K is None or now > SLOW * before, 0
            if K is None or exact:
                K, self.weight = stiffness(solution) * np.outer(scale, scale), formula.weight
            elif k and (length := float((moved := of.reach * (q - last)) @ moved)):
                K = K + np.outer(left - was - (inert + K) @ moved, moved) / length
            self.K, matrix = K, inert + K
            if not (np.isfinite(left).all() and np.isfinite(matrix).all()):
                return solution, q, "its forces are no numbers"
            move = np.zeros(q.size)
            move[free] = np.linalg.lstsq(matrix[np.ix_(free, free)], -left[free], rcond=1e-13)[0]
            size, thinnest = float(np.linalg.norm(move)), problem.reduce.min(problem.scheme.h)
            if size <= SMALLEST * thinnest:
                return solution, q, ""
            longest = NEAREST * thinnest
            last, was, before = q, left, now
            q = q + np.clip(move, -longest, longest) / of.reach
            solution.destroy()
        most = of.names[free[np.argmax(np.abs(left[free]))]]
        return solution, q, f"forces of {now:.1e} of the largest are left after {MOST} iterates, most of them on {most}"

    def accept(self, q: Array, formula: Formula) -> None:
        """Take a step over."""
        speed = formula.weight * q - formula.old(self.places)
        self.places, self.speeds = [q, *self.places[:2]], [speed, *self.speeds[:1]]

    def error(self, q: Array, dt: float, dts: list[float], thinnest: float) -> float | None:
        """How far it is from where its last steps pointed, in parts of the thinnest film; None at first."""
        if len(dts) < 2:
            return None
        return float(np.linalg.norm(self.of.reach * (q - self.guess(dt, dts)))) / thinnest / 3.0


def _film_towards(q: Array, last: Array, film_at: Callable[[Array], Solution]) -> tuple[Solution, Array]:
    """The film at a place, or where it has room on the way there from the last one; and that place. Collective."""
    for part in (1.0, 0.5, 0.25):
        with suppress(InputError):  # the wall would touch
            place = last + part * (q - last)
            return film_at(place), place
    return film_at(last), last
