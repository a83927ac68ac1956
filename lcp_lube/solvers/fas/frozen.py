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
from petsc4py import PETSc

from ...base.parallel import Array
from .frozen_cycles import Cycles

# Of J' less is asked: a derivative has about the relative error of lambda, 1e-7 beside the 1e-6 that is promised of it.
RTOL, TRANSPOSED, MOST = 1e-9, 3e-8, 60
AGREES, LEAST = 1e-7, 1e-13  # l' (J z) and b' z, relative: cycles go on until they do, down to the least residual


class Frozen(Cycles):
    """Solves with J, J + i nu M or J' of one problem. Collective, as its methods."""

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
        (x, rhs), (start, seen) = mat.createVecs(), mat.createVecs()
        rtol, size = TRANSPOSED if self.transposed else RTOL, [0.0]

        def ended(ksp: PETSc.KSP, its: int, norm: float) -> int:
            size[0] = size[0] or norm
            reason = PETSc.KSP.ConvergedReason
            if not np.isfinite(norm) or its > MOST:
                return int(reason.DIVERGED_MAX_IT)
            if norm > rtol * size[0]:
                return int(reason.ITERATING)
            if z is None:
                return int(reason.CONVERGED_RTOL)
            answer = ksp.buildSolution(seen)
            answer.axpy(1.0, start)
            size[0] = min(size[0], answer.norm()) if its else size[0]
            if norm <= rtol * size[0] and self._agree(answer.array_r.reshape(b.shape), b, z):
                return int(reason.CONVERGED_RTOL)
            return int(reason.ITERATING if norm > LEAST * size[0] else reason.DIVERGED_BREAKDOWN)

        try:
            ksp.setOperators(mat)
            ksp.setType(PETSc.KSP.Type.GMRES)
            ksp.getPC().setType(PETSc.PC.Type.NONE)
            ksp.setConvergenceTest(ended)
            if self.transposed and np.isfinite(first := self.nested(b)).all():
                start.setArray(first)
                size[0] = start.norm()  # nearly that of M b
            self._put(self.c[0], b)
            self.mult(mat, start, rhs)
            rhs.scale(-1.0)  # M b - M J x of the start
            self.c[0][:] = 0.0
            ksp.solve(rhs, x)
            x.axpy(1.0, start)
            return x.array_r.reshape(b.shape) * sizes.reshape(-1, 1) if ksp.getConvergedReason() > 0 else None
        finally:
            for one in (ksp, mat, x, start, seen, rhs):
                one.destroy()

    def _agree(self, found: Array, b: Array, z: Array) -> bool:
        """Whether x' (J z) = b' z, each."""
        dot, rest = self.grid.reduce.dot, b + self._rest(found, self.free[0]).reshape(b.shape)
        return all(abs(dot(left, z)) <= AGREES * dot(np.abs(asked), np.abs(z)) for left, asked in zip(rest, b, strict=True))
