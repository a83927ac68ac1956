"""How the fields of a loop of effects are found: Anderson's method first, others from its best fields where it does not do."""

from collections.abc import Callable

import numpy as np
from petsc4py import PETSc

from ...base.parallel import Array
from .coupled_newton import newton
from .loop import FIRST, NEAR, Loop
from .nonlinear import LONG, beyond, by_films, by_half_steps, steps, warmer

MOST_SOLVES = 100  # films; LONG while the least change has fallen to a tenth within as many as
PATIENCE = 50  # these; two cycles
MEMORY = 30  # answers that Anderson's method combines; -coupling_snes_anderson_m changes it
CYCLE = 25  # steps after which it begins anew: its least squares see no changes 1e-8 of the largest that they remember
FEW, AWAY = 1, 30.0  # answers combined while a coefficient changes by more than NEAR; AWAY: times the least change
LONGEST = 1.0  # relative change of a coefficient in one step, before answers are combined
STILL = 3  # films in which the least change has not fallen to a half, where it is films' own error

Best = tuple[float, Array]  # a change, and the fields that it is of


def settle(loop: Loop, begin: Array, watch: Callable[[], None]) -> None:
    """Films from these fields on, until the fields are found or no film can be solved. Collective.

    Where Anderson's method leads no further, it begins once from thinner oil: what hardly moves against a supply gets hot, and
    then flows back from it. Soft walls, whose film drags what it has, go on by Newton's methods from the best fields. What is
    left in the end are these.
    watch : called after every film.
    """
    loop.begun = begin
    anderson = _Anderson(loop, begin, watch)
    anderson.run()
    x, least = anderson.x, anderson.least
    steady, left = loop.model.stored is None, lambda: not (loop.found or loop.endless)
    if steady and left() and "warmth" in loop.names and np.isfinite(least[0]):
        least = anderson.at_once(least[1])
        least = least if loop.found or "lift" in loop.names else by_half_steps(loop, least, watch)
    if steady and left() and "lift" in loop.names and np.isfinite(loop.change):
        x.setArray(least[1])
        loop.told.append(f"from film {loop.solves + 1} on by Newton's method with films for its products")
        least = by_films(loop, x, least, watch)
        loop.change = np.nan_to_num(loop.change, nan=np.inf)
    if not loop.found and least[0] < loop.change:
        loop.change = loop.off(least[1], watch)[0]
    if steady and left() and np.isfinite(loop.change):
        loop.endless = beyond(loop)
    x.destroy()


class _Anderson:
    """Anderson's method, in cycles. Far from the answer old steps mislead: there it combines two answers alone, and many once
    coefficients change by less than `NEAR`. Where steps lead away from the best fields so far, or a cycle ends, it begins anew
    from these; where that leads no further, once from thinner oil.

    best, least : of this start, and of both. last : fields, and what the effects leave of them. mark : a least change, and
    after how many films it was found; halved : likewise. idle : cycles without better fields.
    """

    def __init__(self, loop: Loop, begin: Array, watch: Callable[[], None]):
        self.loop, self.watch = loop, watch
        self.best: Best = (np.inf, begin)
        self.least, self.last, self.near, self.idle = self.best, (begin + 1.0, begin), False, 0
        self.mark = self.halved = (np.inf, 0)
        steady = loop.model.stored is None
        # Films between soft walls that are not near after so many are solved with their walls at once.
        self.wait = FIRST if steady and "lift" in loop.names else np.inf
        self.warm = warmer(loop, begin) if steady and "warmth" in loop.names else None
        self.x = PETSc.Vec().createMPI((len(loop.names) * loop.h.size, None), comm=loop.base.grid.petsc_comm)
        self.x.setArray(begin)

    def run(self) -> None:
        """Until the fields are found, there is no film, or both kinds of cycle lead no further."""
        loop, x = self.loop, self.x
        while not (self._ends() or loop.found or np.isnan(loop.change)):  # NaN: no film
            before = self.best[0]
            steps(x, "anderson", self._residual, self._ended, CYCLE, {"snes_anderson_m": MEMORY if self.near else FEW})
            self.near, self.idle = not self.near, self.idle + 1 if self.best[0] >= before else 0
            if loop.solves >= self.wait and NEAR < loop.change < np.inf:
                self.wait = 2 * loop.solves
                places = (self.best[1], self.last[0]) if self.best[0] < loop.change else (self.best[1],)
                self.best = self.least = self.at_once(*places)
                if loop.found:
                    break
                x.setArray(self.best[1])
            if self.best[0] < loop.change < np.inf:
                x.setArray(self.best[1])
            if self.idle == 2:  # both kinds of cycle would take the same steps again
                if self.warm is None:
                    break
                x.setArray(self.warm)
                loop.told.append(f"from film {loop.solves + 1} on from oil of 1/e of the viscosity")
                self.best, self.warm, self.near, self.idle = (np.inf, self.warm), None, False, 0
                self.mark = self.halved = (np.inf, loop.solves)

    def at_once(self, *places: Array) -> Best:
        """The best fields by Newton's method for film and effects as one, from each of these on until one leads to the end."""
        found = self.least
        for one in places:
            found = found if self.loop.found else min(found, newton(self.loop, one, self.watch), key=lambda one: one[0])
        self.loop.change = np.nan_to_num(self.loop.change, nan=np.inf)
        return found

    def _ends(self) -> bool:
        most = LONG if self.loop.solves - self.mark[1] < PATIENCE else MOST_SOLVES
        return bool(self.loop.endless) or self.loop.solves >= most

    def _residual(self, snes: PETSc.SNES, x: PETSc.Vec, f: PETSc.Vec) -> None:
        loop, before = self.loop, x.array_r.copy()
        if loop.base.reduce.max(np.abs(before - self.last[0])) > 0.0:  # not those that the cycle before has ended with
            loop.change, after = loop.off(before, self.watch)
            self.last = before, after
            if loop.change < self.best[0]:
                self.best = loop.change, before
            self.least = min(self.least, self.best, key=lambda one: one[0])
            if self.best[0] <= 0.1 * self.mark[0]:
                self.mark = self.best[0], loop.solves
            if self.best[0] <= 0.5 * self.halved[0]:
                self.halved = self.best[0], loop.solves
            loop.still = loop.solves - self.halved[1] >= STILL
        f.setArray(np.clip(self.last[1], -LONGEST, LONGEST))

    def _ended(self, snes: PETSc.SNES, it: int, norms: tuple[float, float, float]) -> int:
        loop, reasons = self.loop, PETSc.SNES.ConvergedReason
        if not np.isfinite(loop.change):
            return int(reasons.DIVERGED_FNORM_NAN)
        if loop.change > AWAY * self.best[0] or self._ends() or (loop.solves >= self.wait and loop.change > NEAR):
            return int(reasons.DIVERGED_DTOL)
        done = loop.found if self.near or self.idle else loop.change <= NEAR
        return int(reasons.CONVERGED_FNORM_ABS) if done else 0
