"""What a cycle of nonlinear multigrid does on a film's grids: sweeps, the way down and the way up (`driver`)."""

from math import ceil
from typing import Any

import numpy as np

from ...problems.film.lubrication import LubricationProblem
from .cycles import Cycles

BORDER = 4  # lines on either side of the border between two ranks
SELDOM = 0.75  # times that sweeps at fronts relax a point in the mean, up to which a start has them too


class FilmCycles(Cycles):
    """The class that fills this in gives the levels, and the modules of the loops, which are loaded with its first problem."""

    problem: LubricationProblem
    _kernels: Any
    _loops: Any
    _tools: Any
    _coarsest: Any
    _finest: Any
    _following: Any  # supplies whose pressures are unknowns too, if any
    _harmonic: bool
    _truncation: int
    _unit: float
    _correction: float  # sum of the squares of what the last way up has corrected on the finest grid

    def _rise_to(self, k: int) -> None:
        level = self._levels[k]
        if k + 1 < self._depth:
            coarse = self._levels[k + 1]
            where = (level.first, level.by_x, level.by_y, self._harmonic, not self._tools.looked(coarse)[2], level.sides)
            coarse.put_sides(*(a * p / self.problem.p_unit for a, p in zip(level.sides, self.problem.p_sides, strict=True)))
            self._loops.interpolate(level.z, coarse.part(coarse.seen(coarse.z)), level.kx, level.ky, *where)
            coarse.put_sides()
            level.share(level.z)
        if level.held is not None:
            level.z[level.held] = level.given
        if k + 1 < self._depth and self._rare(level, self._levels[k + 1]):
            self._relax_fronts(level, 0.5)

    def _rare(self, level: Any, coarse: Any) -> bool:
        """Whether fronts, seen on the coarse grid, are so few that a start is to have sweeps there. Collective.

        What they carry away from the front is smooth, and the coarse grid's business.
        """
        if level.carry is not None or level.held is not None:
            return False
        return (coarse.comm.allreduce(coarse.near) if coarse.split else coarse.near) <= SELDOM

    def _solve_coarsest(self, k: int) -> None:
        level, self._correction = self._levels[k], 0.0
        if not self._coarsest.solve(level):
            for s in range(2):
                self._relax(level, max(level.nx, level.ny), s == 1)
        elif self._following:
            self._following.solve(k)

    def _descend(self, k: int) -> None:
        level, coarse = self._levels[k], self._levels[k + 1]
        coarse.work_on()
        self._relax(level, self.options.pre, False)
        if self._following:
            self._following.relax(k)
        self._tools.held.settle(level)
        self._tools.restrict(level, coarse, coarse.c, self._harmonic)
        self._loops.inject(level.z, coarse.part(coarse.old), level.first, level.by_x, level.by_y)
        coarse.gather(coarse.old)
        if coarse.scale is not None:
            np.multiply(coarse.old, coarse.scale, out=coarse.old, where=coarse.old < 0.0)
        coarse.z[:] = coarse.old
        self._loops.add_balance(coarse.old, coarse.kx, coarse.ky, coarse.c, coarse.carry)
        if self._following:
            self._following.descend(k)

    def _ascend(self, k: int) -> None:
        o, level, coarse = self.options, self._levels[k], self._levels[k + 1]
        new, old = (coarse.part(coarse.seen(z)) for z in (coarse.z, coarse.old))
        if self._following:
            self._following.ascend(k)
        at_supplies = None if level.held is None else level.z[level.held]
        given = (level.z, new, old, level.kx, level.ky)
        if level.ways is None:
            rules = (level.first, level.by_x, level.by_y, self._harmonic, self._truncation, level.periodic[0], self._unit)
            self._correction = self._loops.correct(*given, *rules)
        else:
            rule = (level.ways, level.first, self._truncation, level.periodic[0])
            self._correction = self._loops.correct_steps(*given, *rule)
        if level.held is not None:
            level.z[level.held] = at_supplies
        level.share(level.z)
        if k == 0:
            self._finest.renewed(level, self.problem, self._following)
        if o.front:
            self._relax_fronts(level)
        self._relax(level, o.post, True)

    def _relax_fronts(self, level: Any, part: float = 1.0) -> None:
        """Sweeps near the fronts; in a time step, in which these have moved by some cells, twice as many twice as far.

        part : of the sweeps, where all are not needed.
        """
        front, width = ((1 if level.carry is None else 2) * n for n in (ceil(part * self.options.front), self.options.width))
        # What lies beyond a periodic side, or is another rank's, must be new every sweep or two: else fronts across it wander.
        ring, often = level.periodic[0], level is self._levels[0] or level.carry is not None or level.held is not None
        parts = front if level.periodic[1] else (front + 1) // 2 if level.split else 1
        work = 0
        for n, count in enumerate(front // parts + (n < front % parts) for n in range(parts)):
            how = (count, width, level.carry, level.held, level.slips, ring, n + 1 < parts, often)
            work += self._loops.relax_front(level.z, level.kx, level.ky, level.c, *how)
            level.share(level.z)
        level.work += work
        level.near = work / (level.nx * level.ny)

    def _relax(self, level: Any, sweeps: int, down: bool) -> None:
        """Sweeps without a word between them; then, where other ranks go on, once more over the lines that border on theirs.

        That makes up for what these did not hear of: the factor is that of one rank, where without it it doubles.
        """
        arrays, ring = (level.z, level.kx, level.ky, level.c), level.periodic[0]
        if level.held is not None:
            for _ in range(sweeps):
                self._tools.held.sweep(*arrays, level.spans, 1, level.z.shape[0], down, level.carry, ring)
                level.share(level.z)
        elif sweeps:
            self._loops.sweep(*arrays, sweeps, down, level.carry, ring)
            level.share(level.z)
        if sweeps and level.split:
            for first in (0, level.z.shape[0] - BORDER - 2):
                if level.held is not None:
                    self._tools.held.sweep(*arrays, level.spans, first + 1, first + BORDER, down, level.carry, ring)
                    continue
                rows, faces = slice(first, first + BORDER + 2), slice(first, first + BORDER + 3)
                carry = None if level.carry is None else np.ascontiguousarray(level.carry[:, rows])
                self._kernels.sweep(level.z[rows], level.kx[rows], level.ky[faces], level.c[rows], 1, down, carry, ring)
            level.share(level.z)
        level.work += sweeps * level.nx * (level.z.shape[0] - 2)
