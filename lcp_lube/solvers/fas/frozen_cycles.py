"""Cycles of `frozen`: the film's own with its signs held, for J' transposed, on the grids and conductances of the film.

Single precision takes 0.6 of the time: what cycles are wrong by is seen in the residual, which is not of it.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.parallel import Array
from ...problems.film.lubrication import LubricationProblem
from . import finest, frozen_kernels, frozen_transfer, held, levels, transfer

COARSEST = 3  # sweeps of the coarsest grid, in numbers of its points a side, where it has more than FEW points
FEW = 128  # up to which J's inverse is kept: 128 KB


class Cycles:
    """J or J' of one problem, and one F cycle for it as a preconditioner, on a rank's points. Collective, as its methods.

    Attributes
    ----------
    work : cycles times right-hand sides so far.
    asked, at : right-hand sides and answers, with frames.
    """

    asked: Array
    at: Array

    def __init__(
        self,
        problem: LubricationProblem,
        cavity: NDArray[np.bool_],
        M: Array | None = None,
        given: NDArray[np.bool_] | None = None,
    ):
        """M : what cavitated cells store of a unit of void, in J's units; None: nothing is asked at a frequency.
        given : points whose rows are those of the identity, as those of supplies are with A's diagonal."""
        self.problem, self.grid, self.cavity, self.work = problem, problem.grid, cavity, 0
        first, grid = finest.finest(problem), problem.grid
        scheme = problem.scheme
        self.held = given if scheme.held is None else scheme.held.ravel()
        if given is not None:
            mask = np.zeros_like(first.z)
            finest.put(first, grid, mask, given.astype(float))
            held.hold(first, mask, mask)
        self._over = (
            None if self.held is None else np.where(self.held, 1.0 / scheme.diagonal.ravel() if given is None else 1.0, 0.0)
        )
        self.leaves = np.empty(grid.local_size)  # q of a unit of void, with what a time step stores of it
        for lines, some in scheme.in_strips(grid):
            np.negative(some.b_C, out=self.leaves.reshape(grid.box)[lines])
        self.stored = M = M if first.void is None else None
        if M is not None:
            first.void = np.zeros((3, *first.z.shape))
            for into, values in zip(first.void, (self.leaves, M), strict=False):
                finest.put(first, grid, into, values)
        self.levels = levels.hierarchy(first, True)
        full = np.zeros(first.z.shape, dtype=bool)
        finest.put(first, grid, full, ~cavity)
        self.full = [full]
        for fine, coarse in zip(self.levels[:-1], self.levels[1:], strict=True):
            full = np.zeros(coarse.z.shape, dtype=bool)
            transfer.inject(self.full[-1], coarse.part(full), fine.first, fine.by_x, fine.by_y)
            self.full.append(coarse.gather(full))
        self.free = [None if level.held is None else ~level.held for level in self.levels]

    def of(self, several: int, transposed: bool, nu: float = 0.0, single: bool = False) -> None:
        """Take so many right-hand sides, 1 or 2; at nu > 0 they are one, real and imaginary. single : precision of cycles."""
        kind: Any = np.float32 if single else np.float64
        self.several, self.transposed, self.single = several, transposed, single
        shapes = [(several, *level.z.shape) for level in self.levels]
        self.z = [np.zeros(shape, kind) for shape in shapes]
        self.c = [np.zeros(shape, kind) for shape in shapes]
        self.rest = [] if transposed else [np.zeros(shape, kind) for shape in shapes]
        self.k = [(level.kx.astype(kind, copy=False), level.ky.astype(kind, copy=False)) for level in self.levels]
        self.passed: list[tuple[Array | None, Array | None]] = [(None, None)] * len(self.levels)
        if self.stored is None:
            self.passed = [
                (None if level.carry is None else level.carry[0].astype(kind, copy=False), None) for level in self.levels
            ]
        if nu:
            for k, level in enumerate(self.levels):
                leaves, stored, _ = level.void  # type: ignore[misc]
                part = leaves / (leaves + 1j * nu * stored + levels.LEAST)
                self.passed[k] = np.ascontiguousarray(part.real), np.ascontiguousarray(part.imag)
        self.inverse = None if nu else self._inverse()

    def _carry(self, k: int) -> Array | None:
        carry = None if self.stored is not None else self.levels[k].carry
        return None if carry is None else carry[0]

    def _inverse(self) -> Array | None:
        """Of the coarsest grid's J or J', where it is small."""
        level = self.levels[-1]
        n, shape = level.nx * level.ny, (level.ny, level.nx)
        if n > FEW or level.split:
            return None
        units = np.zeros((n, *level.z.shape))
        units[:, 1:-1, 1:-1] = np.eye(n).reshape(n, *shape)
        for one in units:
            level.share(one)
        out, free, none = np.zeros_like(units), self.free[-1], np.zeros_like(units)
        data = units, self.full[-1], free, level.kx, level.ky, none, self._carry(-1)
        if self.transposed:
            frozen_kernels.transposed_residual(*data, np.ones(n), out)
        else:
            frozen_kernels.residual(*data, None, out)
        J = -out[:, 1:-1, 1:-1].reshape(n, n).T
        if free is not None:
            held = ~free[1:-1, 1:-1].ravel()
            J[held], J[:, held], J[held, held] = 0.0, 0.0, 1.0
        with np.errstate(all="ignore"):
            scale = np.abs(J).max(axis=1)  # rows of a pressure and of void differ by much
            try:
                inverse = np.linalg.inv(J / scale[:, None]) / scale
            except np.linalg.LinAlgError:
                return None
        return inverse if np.isfinite(inverse).all() else None

    def cycle(self, x: Array) -> None:
        """One more F cycle from x, which is changed in place; of what is in its frame nothing is left."""
        self.z[0] = self._known(x)
        self._run(0, "F")
        self.work += self.several
        self.bare(x)

    def bare(self, a: Array) -> Array:
        """Nothing but this rank's points, for dots of arrays with their frames. a : of the finest level."""
        rows, columns = self._owned
        for beside in (a[..., : rows.start, :], a[..., rows.stop :, :], a[..., : columns.start], a[..., columns.stop :]):
            beside[:] = 0.0
        return a

    @property
    def _owned(self) -> tuple[slice, slice]:
        grid, level = self.grid, self.levels[0]
        y0, y1 = (grid.y_start, grid.y_end) if level.comm is None else (0, level.y1 - level.y0)
        return slice(y0 + 1, y1 + 1), slice(grid.x_start + 1, grid.x_end + 1)

    def own(self, a: Array) -> Array:
        """This rank's points of arrays of the finest level."""
        rows, columns = self._owned
        return a[..., rows, columns]

    def _known(self, a: Array) -> Array:
        """What stands in the place of other ranks' points, and in the frame, brought up to date. Collective."""
        level, grid = self.levels[0], self.grid
        for one in a:
            if level.comm is None and grid.comm.size > 1:
                one[1:-1, 1:-1] = finest.whole(grid, self.own(one))
            level.share(one)
        return a

    def put(self, into: Array, values: Array) -> None:
        """This rank's values of each right-hand side or answer into an array with a frame. Collective."""
        for one, part in zip(into, values.reshape(self.several, *self.grid.box), strict=True):
            self.own(one)[:] = part
        self._known(into)

    def left(self, over: Array, out: Array) -> None:
        """c - J' l of `asked` and `at` at free points, times a number of each. out : with a frame. Collective."""
        level = self.levels[0]
        data = self._known(self.at), self.full[0], self.free[0], level.kx, level.ky, self.asked
        frozen_kernels.transposed_residual(*data, self._carry(0), over, out)

    def misfits(self, z: Array) -> Array:
        """(c - J' l)' z of the same. z : `bare`. Collective."""
        level, out = self.levels[0], np.zeros(self.several)
        data = self._known(self.at), self.full[0], self.free[0], level.kx, level.ky, self.asked
        frozen_kernels.transposed_misfit(*data, self._carry(0), z, out)
        return np.asarray(self.grid.comm.allreduce(out))

    def products(self, z: Array) -> Array:
        """|c|' |z| of `asked`. z : `bare`. Collective."""
        out = np.zeros(self.several)
        frozen_kernels.products(self.asked, z, out)
        return np.asarray(self.grid.comm.allreduce(out))

    def rest_of(self, b: Array, x: Array) -> Array:
        """b - J x or b - J' x, as if no pressure were held. Collective."""
        self.put(self.asked, b)
        self.put(self.at, x)
        level, out = self.levels[0], np.zeros_like(self.at)
        data = self.at, self.full[0], None, level.kx, level.ky, self.asked
        if self.transposed:
            frozen_kernels.transposed_residual(*data, self._carry(0), np.ones(self.several), out)
        else:
            frozen_kernels.residual(*data, *self.passed[0], out)
        return self.own(out).reshape(b.shape)

    def _run(self, k: int, kind: str) -> None:
        level, z = self.levels[k], self.z[k]
        if k + 1 == len(self.levels) and self.inverse is not None:
            inside = (slice(1, -1), slice(1, -1))
            for one, c in zip(z, self.c[k], strict=True):
                one[inside] = (self.inverse @ c[inside].ravel()).reshape(level.ny, level.nx)
                level.share(one)
            return
        if k + 1 == len(self.levels):
            for s in range(COARSEST * max(level.nx, level.ny)):
                self._sweep(k, s % 2 == 1)
            return
        self._sweep(k, False)
        self._descend(k)
        self.z[k + 1][:] = 0.0
        self._run(k + 1, kind)
        if kind == "F" and k + 2 < len(self.levels):
            self._run(k + 1, "V")
        self._ascend(k)
        self._sweep(k, True)

    def _descend(self, k: int) -> None:
        """What level k leaves is the coarser one's right-hand side."""
        level, coarse, z, c = self.levels[k], self.levels[k + 1], self.z[k], self.c[k + 1]
        where = level.first, level.by_x, level.by_y
        kx, ky = self.k[k]
        if not self.transposed:
            frozen_kernels.residual(z, self.full[k], self.free[k], kx, ky, self.c[k], *self.passed[k], self.rest[k])
        c[:] = 0.0
        for n in range(self.several):
            into = coarse.part(c[n])
            if self.transposed:
                data = self.full[k], self.free[k], kx, ky, self.c[k][n], self.passed[k][0]
                frozen_transfer.restrict(z[n], *data, into, *where, level.periodic[0])
                coarse.collect(c[n])
                frozen_kernels.kept(c[n], self.full[k + 1])
            else:
                transfer.restrict(z[n], kx, ky, self.rest[k][n], into, *where, True, level.periodic[0], False, None)
                coarse.collect(c[n])

    def _ascend(self, k: int) -> None:
        """Add the coarser level's answer, interpolated."""
        level, coarse, z = self.levels[k], self.levels[k + 1], self.z[k]
        data = *self.k[k], level.first, level.by_x, level.by_y, level.periodic[0], not self.transposed
        for n, found in enumerate(self.z[k + 1]):
            seen = coarse.part(found if self.transposed else found * self.full[k + 1])
            frozen_transfer.correct(z[n], self.full[k], seen, *data)
            if level.held is not None:
                z[n][level.held] = 0.0
            level.share(z[n])

    def nested(self) -> Array:
        """A first answer to J' l = c of the finest level: those of the coarser grids, from the coarsest up."""
        last = len(self.levels) - 1
        for k in range(last):
            self.z[k][:] = 0.0
            self._descend(k)
            self._hand_on(k)
        self.z[last][:] = 0.0
        self._run(last, "V")
        for k in reversed(range(last)):
            self.z[k][:] = 0.0
            self._ascend(k)
            if k:
                self._run(k, "V")
        self._sweep(0, True)
        return self.z[0]

    def _hand_on(self, k: int) -> None:
        """What level k's cavities ask for is asked of the coarser one's."""
        level, coarse = self.levels[k], self.levels[k + 1]
        for asked, into in zip(self.c[k], self.c[k + 1], strict=True):
            data = level.share(asked), self.full[k], self.passed[k][0], coarse.part(into)
            frozen_transfer.hand_on(*data, level.first, level.by_x, level.by_y)
            coarse.gather(into)

    def _sweep(self, k: int, down: bool) -> None:
        level, z = self.levels[k], self.z[k]
        data = z, self.full[k], self.free[k], *self.k[k], self.c[k], down, self.passed[k][0]
        if self.transposed:
            frozen_kernels.transposed_sweep(*data, level.periodic[0])
        else:
            frozen_kernels.sweep(*data, self.passed[k][1])
        for one in z:
            level.share(one)
