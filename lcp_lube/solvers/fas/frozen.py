"""J z = b and J' l = b of a film in the plane, J its Jacobian at the signs of a solution, by multigrid, two sides at once.

The cycle is that of the film itself with its signs held, for J' transposed: the same grids and conductances, the signs at the
coarse points for the coarse grids' signs. Full points alone are corrected, as void follows from the sweeps, which go along the
flow. Of J' a full point's residual goes where its pressure is interpolated from, nothing of a cavitated one's, and corrections
are interpolated as the film's residuals are restricted. GMRES removes what the fronts leave, preconditioned from the left, so
that the norm that it ends by is near the answer's error. How near is seen for J' by what l is for: l' (J z) = b' z of the
solution z, and it is improved until that holds. Of the void that cells store a motion exp(i nu t) makes a part leave them, with
another phase: a complex number.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from ...base.parallel import Array
from ...problems.film.lubrication import LubricationProblem
from . import finest, frozen_kernels, frozen_transfer, held, levels, transfer

SWEEPS = 1  # before and after the coarse grid
COARSEST = 3  # sweeps of the coarsest grid, in numbers of its points a side, where it has more than FEW points
FEW = 64
# Of J' less is asked: a derivative has about the relative error of lambda, 1e-7 beside the 1e-6 that is promised of it.
RTOL, TRANSPOSED, MOST = 1e-9, 1e-7, 60
AGREES, LEAST = 1e-7, 1e-13  # l' (J z) and b' z, relative: cycles go on until they do, down to the least residual


class Frozen:
    """J or J' of one problem, and one F cycle for it as a preconditioner, on a rank's points. Collective, as its methods.

    Attributes
    ----------
    work : cycles times right-hand sides so far.
    """

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
        self.leaves = -problem.scheme.b_C.ravel()  # q of a unit of void, with what a time step stores of it
        self.stored = M = None if first.void else M
        if M is not None:
            first.void = np.zeros_like(first.z), np.zeros_like(first.z)
            for into, values in zip(first.void, (self.leaves, M), strict=True):
                finest.put(first, grid, into, values)
        self.levels = levels.hierarchy(first, True)
        full = np.zeros_like(first.z)
        finest.put(first, grid, full, np.where(cavity, 0.0, 1.0))
        self.full = [full > 0.0]
        for fine, coarse in zip(self.levels[:-1], self.levels[1:], strict=True):
            values = np.zeros_like(coarse.z)
            transfer.inject(full, coarse.part(values), fine.first, fine.by_x, fine.by_y)
            full = coarse.gather(values)
            self.full.append(full > 0.0)
        self.free = [None if level.held is None else ~level.held for level in self.levels]

    def of(self, several: int, transposed: bool, nu: float = 0.0) -> None:
        """Take so many right-hand sides, 1 or 2; at nu > 0 they are one, real and imaginary."""
        self.several, self.transposed = several, transposed
        self.z, self.c, self.rest = ([np.zeros((several, *level.z.shape)) for level in self.levels] for _ in range(3))
        self.passed: list[tuple[Array | None, Array | None]] = [(level.carry, None) for level in self.levels]
        if self.stored is not None:
            self.passed = [(None, None)] * len(self.levels)
        if nu:
            for k, level in enumerate(self.levels):
                leaves, stored = level.void  # type: ignore[misc]
                part = leaves / (leaves + 1j * nu * stored + levels.LEAST)
                self.passed[k] = np.ascontiguousarray(part.real), np.ascontiguousarray(part.imag)
        self.inverse = None if nu else self._inverse()

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
        data = units, self.full[-1], free, level.kx, level.ky, none, self.passed[-1][0]
        if self.transposed:
            frozen_kernels.transposed_residual(*data, out)
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

    def mult(self, mat: PETSc.Mat | None, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """J x or J' x."""
        np.negative(self._rest(x.array_r, self.free[0]), out=y.array)

    def apply(self, pc: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """What one cycle makes of a right-hand side x."""
        self._put(self.c[0], x.array_r)
        self.z[0][:] = 0.0
        self._run(0, "F")
        self.work += self.several
        self._own(self.z[0], y.array)

    def _put(self, into: Array, values: Array) -> None:
        for one, part in zip(into, values.reshape(self.several, -1), strict=True):
            finest.put(self.levels[0], self.grid, one, part)

    def _own(self, a: Array, out: Array | None = None) -> Array:
        out = np.empty(len(a) * self.grid.local_size) if out is None else out
        for one, into in zip(a, out.reshape(len(a), *self.grid.box), strict=True):
            into[:] = finest.own(self.levels[0], self.grid, one)
        return out

    def _rest(self, x: Array, free: NDArray[np.bool_] | None) -> Array:
        """-J x, at free points."""
        self._put(self.z[0], x)
        self.c[0][:] = 0.0
        return self._own(self._residual(0, free))

    def _residual(self, k: int, free: NDArray[np.bool_] | None) -> Array:
        level, out = self.levels[k], self.rest[k]
        data = self.z[k], self.full[k], free, level.kx, level.ky, self.c[k], self.passed[k][0]
        if self.transposed:
            frozen_kernels.transposed_residual(*data, out)
        else:
            frozen_kernels.residual(*data, self.passed[k][1], out)
        return out

    def _run(self, k: int, kind: str) -> None:
        level, z, full = self.levels[k], self.z[k], self.full[k]
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
        coarse, where = self.levels[k + 1], (level.first, level.by_x, level.by_y)
        for _ in range(SWEEPS):
            self._sweep(k, False)
        c, rest = self.c[k + 1], self.rest[k] if self.transposed else self._residual(k, self.free[k])
        c[:], self.z[k + 1][:] = 0.0, 0.0
        for n in range(self.several):
            into = coarse.part(c[n])
            if self.transposed:
                data = full, self.free[k], level.kx, level.ky, self.c[k][n], self.passed[k][0]
                frozen_transfer.restrict(z[n], *data, into, *where, level.periodic[0])
                coarse.collect(c[n])
                c[n] *= self.full[k + 1]
            else:
                transfer.restrict(z[n], level.kx, level.ky, rest[n], into, *where, True, level.periodic[0], False, None)
                coarse.collect(c[n])
        self._run(k + 1, kind)
        if kind == "F" and k + 2 < len(self.levels):
            self._run(k + 1, "V")
        for n, found in enumerate(self.z[k + 1]):
            seen = coarse.part(found if self.transposed else found * self.full[k + 1])
            frozen_transfer.correct(z[n], full, seen, level.kx, level.ky, *where, level.periodic[0], not self.transposed)
            if level.held is not None:
                z[n][level.held] = 0.0
            level.share(z[n])
        for _ in range(SWEEPS):
            self._sweep(k, True)

    def _sweep(self, k: int, down: bool) -> None:
        level, z = self.levels[k], self.z[k]
        data = z, self.full[k], self.free[k], level.kx, level.ky, self.c[k], down, self.passed[k][0]
        if self.transposed:
            frozen_kernels.transposed_sweep(*data)
        else:
            frozen_kernels.sweep(*data, self.passed[k][1])
        for one in z:
            level.share(one)

    def solve(self, rows: Sequence[Array], transposed: bool = False, nu: float = 0.0, z: Array | None = None) -> Any:
        """(J + i nu M)^-1 b, complex, or J^-1 b, J'^-1 b for each b; None where cycles stall. Collective.

        z : of J', the solution, p where the film is full and -r where it is not, by which its answers are checked.
        """
        if nu and self.stored is None:
            return None
        found: list[Array] = []
        for start in range(0, len(rows), 1 if nu else 2):
            some = np.array([rows[start].real, rows[start].imag] if nu else rows[start : start + 2])
            answers = self._pair(some, transposed, nu, z)
            if answers is None:
                return None
            found += [answers] if nu else list(answers)
        return found

    def _pair(self, b: Array, transposed: bool, nu: float, z: Array | None) -> Any:
        given, over = self.held, self._over
        self.of(len(b), transposed, nu)
        scale: Any = np.where(self.cavity, self.leaves + (1j * nu * self.stored if nu else 0.0), 1.0)  # type: ignore[operator]
        b = b / scale if transposed else b
        at = scale * z if transposed and z is not None else None
        if given is None or over is None:
            x = self._gmres(b, at)
        elif transposed:
            x = self._gmres(np.where(given, 0.0, b), None if at is None else np.where(given, 0.0, at))
            x = None if x is None else np.where(given, over * (b + self._rest(x, None).reshape(b.shape)), x)
        else:
            pressed = over * b
            x = self._gmres(np.where(given, 0.0, b + self._rest(pressed, None).reshape(b.shape)))
            x = None if x is None else np.where(given, pressed, x)
        if x is None or transposed:
            return x
        return (x[0] + 1j * x[1]) / scale if nu else x / scale

    def _gmres(self, b: Array, z: Array | None = None) -> Array | None:
        """Of the free points, which z is zero beside; of J' until x' (J z) = b' z."""
        sizes: Any = np.array([self.grid.reduce.norm(one) for one in b])
        sizes = np.where(sizes > 0.0, sizes, 1.0) if self.passed[0][1] is None else np.hypot(*sizes) or 1.0
        b = b / sizes.reshape(-1, 1)
        sizes_of = (b.size, b.shape[0] * self.grid.size)
        mat = PETSc.Mat().createPython((sizes_of, sizes_of), self, comm=self.grid.petsc_comm)
        mat.setUp()
        ksp = PETSc.KSP().create(self.grid.petsc_comm)
        (x, rhs), seen = mat.createVecs(), mat.createVecRight()
        rtol, started, forced = TRANSPOSED if self.transposed else RTOL, [0.0], None if z is None else self._forced(z)

        def ended(ksp: PETSc.KSP, its: int, norm: float) -> int:
            started[0] = started[0] if its else norm
            reason = PETSc.KSP.ConvergedReason
            if not np.isfinite(norm) or its > MOST:
                return int(reason.DIVERGED_MAX_IT)
            if norm > rtol * started[0]:
                return int(reason.ITERATING)
            if z is None or self._agree(ksp.buildSolution(seen).array_r.reshape(b.shape), forced, b, z):  # type: ignore[arg-type]
                return int(reason.CONVERGED_RTOL)
            return int(reason.ITERATING if norm > LEAST * started[0] else reason.DIVERGED_BREAKDOWN)

        try:
            ksp.setOperators(mat)
            ksp.setType(PETSc.KSP.Type.GMRES)
            ksp.getPC().setType(PETSc.PC.Type.PYTHON)
            ksp.getPC().setPythonContext(self)
            ksp.setConvergenceTest(ended)
            rhs.setArray(b.ravel())
            ksp.solve(rhs, x)
            return x.array_r.reshape(b.shape) * sizes.reshape(-1, 1) if ksp.getConvergedReason() > 0 else None
        finally:
            for one in (ksp, mat, x, seen, rhs):
                one.destroy()

    def _forced(self, z: Array) -> Array:
        """J z."""
        first = self.levels[0]
        at, out = np.zeros((1, *first.z.shape)), np.zeros((1, *first.z.shape))
        finest.put(first, self.grid, at[0], z)
        none = np.zeros_like(at)
        frozen_kernels.residual(at, self.full[0], self.free[0], first.kx, first.ky, none, self.passed[0][0], None, out)
        return -self._own(out)

    def _agree(self, found: Array, forced: Array, b: Array, z: Array) -> bool:
        """Whether x' (J z) = b' z, each."""
        dot = self.grid.reduce.dot
        pairs = [(dot(x, forced), dot(one, z), dot(np.abs(one), np.abs(z))) for x, one in zip(found, b, strict=True)]
        return all(abs(ours - wanted) <= AGREES * size for ours, wanted, size in pairs)
