"""Newton's method for a film and its effects as one system: what the loop of effects goes on by where films alone mislead.

Between soft walls that drag more than pressure drives through a mesh a film's answer to a wavy wall is far from any that the
wall would have with it, and steps from film to film go astray. Here pressure and wall change together: a step is one linear
solve with the whole system (`coupled_response`), and no film.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from ...base.parallel import Array
from ...linear.krylov import LinearSolverError
from ..motions.coupled_response import STEP, Changes, CoupledResponse

NARROW = 1e-6  # of differences to one side
PRODUCTS = 1000  # with the system's derivative, from one film's answer on
LONGEST, SHORTEST = 3.0, 1e-3  # change of a field by a step; part of a step
DESCENT = 1e-4  # of the square of what is left, that a whole step has to take off
VAIN, GAINS = 3, 0.9  # steps in a row, not solved for by `most` products, that leave more than this part of it: it stands still
DONE = 1e-9  # of fields: what is left then is for films to tell


class CoupledNewton(CoupledResponse):
    """A loop's last answer and fields, and steps from there on. Collective, as its methods."""

    rtol, most, products = 1e-3, 60, 0

    def place(self, p: Array, r: Array, x: Array, flip: bool = False) -> None:
        super().place(p, r, x, flip)
        self._here = self._system(np.zeros(self.n), x, self.loop.base)

    def _along(self, y: Array) -> Changes:
        self.products += 1
        return super()._along(y)

    def _ends(self, z: Array, x: Array) -> tuple[list[Changes], float]:
        """From here to one side: half the work, and steps are solved for to three digits."""
        part = NARROW / STEP
        return [self._system(part * z, self.x + part * x, self.loop.base), self._here], part

    def found(self) -> Array:
        """The effects' fields after steps of Newton's method.

        A step is halved until what the film's Jacobian makes of what is left, which has the size of the fields, gets less.
        """
        R, vain, before, spent = self._left(self.p, self.r, self.x), 0, np.inf, 0
        while self.products < PRODUCTS:
            try:
                size = self._size_of(R)
            except LinearSolverError:  # viscosities beyond what factors hold
                break
            vain, before = vain + 1 if size > GAINS * before and self.products - spent >= 2 * self.most else 0, size
            if not DONE**2 < size < np.inf or vain == VAIN:
                break
            spent, y = self.products, self._settled(-R, 0.0, 0.0)
            t = min(1.0, LONGEST / self.loop.base.reduce.max(np.abs(y[self.n :])))
            z, least = np.where(self.cavity, -self.r, self.p), SHORTEST * t
            while t > least:
                new, x = z + t * y[: self.n], self.x + t * y[self.n :]
                p = np.where(self.given, self.p, np.maximum(new, 0.0))
                r = np.where(self.given, self.r, np.clip(-new, 0.0, 1.0))
                with np.errstate(all="ignore"):
                    R = self._left(p, r, x)
                    if self._size_of(R) < (1.0 - DESCENT * t) * size:
                        break
                t *= 0.5
            else:
                break
            self._linear.destroy()
            self.place(p, r, x)
        return self.x

    def _left(self, p: Array, r: Array, x: Array) -> Array:
        """What the equations leave at another state."""
        here, self.p, self.r = (self.p, self.r), p, r
        R = self._system(np.zeros(self.n), x, self.loop.base)[0]
        self.p, self.r = here
        return R

    def _size_of(self, R: Array) -> float:
        """The square of the size of the fields' changes that R stands for; inf where it overflows."""
        if not np.isfinite(self.loop.base.reduce.norm(R)):
            return np.inf
        z = self._linear.solve([R[: self.n]])[0] * np.where(self.cavity, 1.0, 1.0 / self.p_max)
        size = float(self.loop.base.reduce.dot(z, z) + self.loop.base.reduce.dot(R[self.n :], R[self.n :]))
        return size if np.isfinite(size) else np.inf


def newton(loop: Any, x: Array, watch: Callable[[], None]) -> tuple[float, Array]:
    """The change of the best fields, and these, from the film's answer at x on. Collective.

    The film's answer at the fields found tells by how much they are off, and is gone on from while that falls to a half.
    No film is started from another, and what is found is logged as films' answers are: a resumed run takes the same steps.
    Fields that it began from before lead nowhere else.
    """
    best, before = (np.inf, x), np.inf
    if any(not loop.base.reduce.max(np.abs(x - other)) > 0.0 for other in loop.tried):
        return best
    loop.tried.append(x)
    loop.told.append(f"from film {loop.solves + 1} on by Newton's method for film and effects as one")
    while True:
        loop.start = None
        loop.change, _ = loop.off(x, watch)
        best = min(best, (loop.change, x), key=lambda one: one[0])
        if loop.found or not loop.change <= 0.5 * before or not np.isfinite(loop.change):
            return best
        before = loop.change
        if len(loop.log) < len(loop.given):
            x = loop.given[len(loop.log)]
        else:
            if len(loop.log) == len(loop.given):  # its answer was given, not its film
                loop.start = None
                loop.again(False)
            at = loop.answer
            at.problem.cells = at.cells
            fields = {"p": at.p / at.problem.p_unit, "r": at.r}
            system = CoupledNewton(loop.scene, replace(loop.solution, problem=at.problem, fields=fields), [])
            try:
                x = system.found()
            finally:
                system.destroy()
        loop.log.append(x)
