"""Nonlinear multigrid for obstacle problems: projected sweeps, full multigrid, and coarse grids that know the bounds.

FAS as in `fas`, for l <= v <= u and f(v) = A v - b - dx dy g(v). A coarse grid's bounds are the fine one's at its points
(Brandt and Cryer); forces of the bounds are passed on only to coarse points in contact, so that a solution is a fixed point;
what a correction takes beyond a bound is cut off, and some sweeps near the edges of the contact put these right to the point,
which the coarse grid knows to its own mesh only. In FASCD (Bueler and Farrell) the bounds are split over the grids instead.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ...base.parallel import Array
from ...errors import InputError
from ...problems.box import BoxProblem
from ...problems.obstacle import ObstacleProblem
from ...problems.semilinear import SemilinearProblem
from ...problems.solution import Fields, Step
from ..job import Job
from ..method_options import least
from ..newton import StalledError
from .cycles import CycleOptions, Cycles


@dataclass(frozen=True)
class BoxFasOptions(CycleOptions):
    """As `CycleOptions`; fronts are the edges of contacts."""

    pre: int = least(0, 2)
    post: int = least(0, 2)
    front: int = least(0, 12)


class _Grid:
    """What a level of an obstacle problem has beyond a `levels.Level`: bounds, cell areas, coordinates, work space."""

    def __init__(self, level: Any, bounds: Array, m: Array, x: Array, y: Array):
        self.level, self.bounds, self.m, self.x, self.y = level, bounds, m, x, y
        self.prepared, self.forces = (np.zeros((2, *level.z.shape)) for _ in range(2))
        self.touching = np.zeros_like(level.z)  # which points bounds hold, as `clip` tells


class BoxFas(Cycles):
    """The iterates v; `newton.iterate` runs it. `norm` is that of the active set: max |D R(v)| against the terms of f.

    The first step is full multigrid, unless a start is given, the others are cycles.
    """

    Options = BoxFasOptions
    problem: BoxProblem
    state = ("v", "norm", "_recent", "_first", "_taken")

    def __init__(self, job: Job):
        super().__init__(job)
        problem, start = self.problem, job.start
        from . import box_kernels, finest, front_points, levels, loops, transfer

        self._kernels, self._fronts, self._transfer, self._loops = box_kernels, front_points, transfer, loops
        self._finest, self._tools = finest, levels
        if not isinstance(problem, ObstacleProblem):
            raise InputError("--method fas: for obstacle problems on a rectangle; use active-set")
        self._source = problem.semilinear.source
        with self.stages("assembly"):
            self._grids = self._hierarchy(problem.semilinear)
        self._levels = [grid.level for grid in self._grids]
        self._begin(start is not None)
        self.v = problem.v0 if start is None else np.clip(start["v"], problem.lower, problem.upper)
        self.norm = self._first = self._norm()

    def _hierarchy(self, semilinear: SemilinearProblem) -> list[_Grid]:
        grid, tools = self.problem.grid, self._tools
        dx, dy = grid.spacing
        faces = (np.broadcast_to(k, grid.box) for k in semilinear.faces)
        finest = self._finest.level_of(grid, *faces, semilinear.b.reshape(grid.box))  # type: ignore[call-arg]
        levels = tools.hierarchy(finest, False)
        bounds, m = np.zeros((2, *finest.z.shape)), np.zeros_like(finest.z)
        for k, bound in enumerate((self.problem.lower, self.problem.upper)):
            self._finest.put(finest, grid, bounds[k], bound)
        self._finest.put(finest, grid, m, semilinear.cells)
        rows = slice(None) if finest.comm is None else slice(grid.y_start, grid.y_end)
        x = grid.origin[0] + dx * np.arange(1, grid.shape[0] + 1)
        y = (grid.origin[1] + dy * np.arange(1, grid.shape[1] + 1))[rows]
        grids = [_Grid(finest, bounds, m, x, y)]
        for fine, coarse in pairwise(levels):
            bounds, m = np.zeros((2, *coarse.z.shape)), np.zeros_like(coarse.z)
            for k in range(2):
                self._transfer.inject(grids[-1].bounds[k], coarse.part(bounds[k]), fine.first, fine.by_x, fine.by_y)
                coarse.gather(bounds[k])
            tools.restrict(fine, coarse, m, False, grids[-1].m)
            x = x[1::2] if fine.by_x else x
            every = grid.origin[1] + dy * np.arange(1, grid.shape[1] + 1)
            stride = 2 ** sum(level.by_y for level in levels[: len(grids)])
            lines = every[stride - 1 :: stride][: coarse.ny]
            grids.append(_Grid(coarse, bounds, m, x, lines if not coarse.split else lines[coarse.y0 : coarse.y1]))
        return grids

    @property
    def v(self) -> Array:
        """This rank's points."""
        return self._finest.own(self._grids[0].level, self.problem.grid, self._grids[0].level.z).ravel()

    @v.setter
    def v(self, value: Array) -> None:
        self._finest.put(self._grids[0].level, self.problem.grid, self._grids[0].level.z, value)

    @property
    def fields(self) -> Fields:
        return {"v": self.v}

    def advance(self) -> Step:
        """Full multigrid, or one cycle. Collective.

        Raises
        ------
        StalledError : the residual has stalled.
        """
        if self._stalled:
            raise StalledError(f"the residual is at {self.norm:.1e} after {self._taken} cycles and has stalled (fas.stall)")
        before = self.v.copy()  # of one line the points themselves
        with self.stages("cycles"):
            if self._taken == 0:
                self._full_multigrid()
            else:
                self._cycle(0, self.options.cycle)
        self._count()
        self.norm = self._norm()
        if self._taken == 1:
            self._first = self.norm
        reduce, after = self.problem.reduce, self.v
        size = max(reduce.largest(after), self.problem.idle[0]) or 1.0
        return Step(self.norm, reduce.largest(np.subtract(after, before, out=before)) / size, 1.0)

    def _evaluated(self, grid: _Grid, of: Callable[[Array, Array, Array], Any]) -> Any:
        """g, or what else the source tells, at v of the points."""
        return of(grid.x[None, :], grid.y[:, None], grid.level.z[1:-1, 1:-1])

    def _norm(self) -> float:
        """The finest grid's. Collective."""
        grid, reduce = self._grids[0], self.problem.reduce
        level, g = grid.level, self._evaluated(grid, self._source.value)
        largest, terms = self._kernels.norms(level.z, level.kx, level.ky, level.c, grid.m, g, grid.bounds)
        terms = reduce.sum(np.array([terms])) if level.comm is not None else terms
        return reduce.max(np.array([largest])) / (max(terms / self.problem.unknowns, self.problem.idle[1]) or 1.0)

    def _relax(self, grid: _Grid, sweeps: int, down: bool, near: bool = False) -> None:
        """Linearise at v and sweep, at first the points near the edges of the contact if wanted. Collective."""
        level, o = grid.level, self.options
        g, slope = self._evaluated(grid, self._source.both)
        self._kernels.linearise(level.z, level.kx, level.ky, level.c, grid.m, g, slope, grid.prepared[0], grid.prepared[1])
        arrays = (level.z, level.kx, level.ky, grid.bounds, grid.prepared)
        if near and o.front:
            # All arguments: where some are left out, a call takes a quarter of a millisecond more.
            spans, found = self._fronts.front_spans(grid.touching, o.width, False, 1, 0)
            level.work += o.front * self._kernels.sweep_spans(*arrays, spans, found, o.front)
            level.share(level.z)
        for count in [1] * sweeps if level.split else [sweeps] * bool(sweeps):
            self._kernels.sweep(*arrays, count, down)
            level.share(level.z)
        level.work += sweeps * level.nx * (level.z.shape[0] - 2)

    def _full_multigrid(self) -> None:
        for fine, coarse in pairwise(self._grids):  # the start, seen from the coarse grids
            self._inject(fine, coarse, coarse.level.z)
        self._tools.right_sides(self._levels, False)
        super()._full_multigrid()

    def _rise_to(self, k: int) -> None:
        if k + 1 < self._depth:
            level, coarse = self._levels[k], self._levels[k + 1]
            level.z[:] = 0.0
            self._add(level, coarse, np.zeros_like(coarse.part(coarse.z)))
            self._clip(self._grids[k])

    def _inject(self, fine: _Grid, coarse: _Grid, into: Array) -> None:
        level = fine.level
        self._transfer.inject(level.z, coarse.level.part(into), level.first, level.by_x, level.by_y)
        coarse.level.gather(into)

    def _add(self, level: Any, coarse: Any, old: Array) -> None:
        """Add the interpolated difference of the coarse grid's v and `old`."""
        arrays = (level.z, coarse.part(coarse.z), old, level.kx, level.ky)
        self._loops.correct(*arrays, level.first, level.by_x, level.by_y, False, 0, False, 1.0)

    def _clip(self, grid: _Grid) -> None:
        self._kernels.clip(grid.level.z, grid.bounds, grid.touching)
        for a in (grid.level.z, grid.touching):
            grid.level.share(a)

    def _solve_coarsest(self, k: int) -> None:
        level = self._levels[k]
        for s in range(4):
            self._relax(self._grids[k], max(level.nx, level.ny), s % 2 == 1)

    def _descend(self, k: int) -> None:
        grid, coarse = self._grids[k], self._grids[k + 1]
        level, lower = grid.level, coarse.level
        lower.work_on()
        self._relax(grid, self.options.pre, False)
        g = self._evaluated(grid, self._source.value)
        self._kernels.forces(level.z, level.kx, level.ky, level.c, grid.m, g, grid.bounds, grid.forces[0], grid.forces[1])
        for part in range(2):
            level.share(grid.forces[part])
            self._tools.restrict(level, lower, coarse.forces[part], False, grid.forces[part])
            lower.share(coarse.forces[part])
        self._inject(grid, coarse, lower.old)
        lower.z[:] = lower.old
        g = self._evaluated(coarse, self._source.value)
        self._kernels.coarse_right_side(
            lower.z, lower.kx, lower.ky, coarse.m, g, coarse.bounds, coarse.forces[0], coarse.forces[1], lower.c
        )

    def _ascend(self, k: int) -> None:
        grid, lower = self._grids[k], self._levels[k + 1]
        self._add(grid.level, lower, lower.part(lower.old))
        self._clip(grid)
        self._relax(grid, self.options.post, True, near=True)
