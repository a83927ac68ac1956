"""Inner solvers that lie, for -ksp_type python and -pc_type python: what `test_never_wrong` puts into runs."""

import numpy as np
from petsc4py import PETSc


class Liar:
    """A KSP that claims convergence whatever it returns; `lie` writes that into x."""

    def lie(self, b: PETSc.Vec, x: PETSc.Vec) -> None:
        raise NotImplementedError

    def solve(self, ksp: PETSc.KSP, b: PETSc.Vec, x: PETSc.Vec) -> None:
        self._mat = ksp.getOperators()[0]
        self.lie(b, x)
        ksp.setIterationNumber(1)
        ksp.setConvergedReason(PETSc.KSP.ConvergedReason.CONVERGED_RTOL)


class Lazy(Liar):
    """x = 0."""

    def lie(self, b: PETSc.Vec, x: PETSc.Vec) -> None:
        x.set(0.0)


class Noise(Liar):
    """Random numbers of the right-hand side's size."""

    def lie(self, b: PETSc.Vec, x: PETSc.Vec) -> None:
        first, last = x.getOwnershipRange()
        x.setArray(np.random.default_rng(first).normal(size=last - first))
        x.scale(b.norm())


class Copy(Liar):
    """x = b, as if the matrix were the identity."""

    def lie(self, b: PETSc.Vec, x: PETSc.Vec) -> None:
        b.copy(x)


class Holey(Liar):
    """The right answer but for one NaN."""

    def lie(self, b: PETSc.Vec, x: PETSc.Vec) -> None:
        exact(self._mat, b, x)
        if x.getLocalSize():
            values = x.array_r.copy()
            values[values.size // 2] = np.nan
            x.setArray(values)


class Backwards(Liar):
    """The right answer with the wrong sign: a Jacobian times -1."""

    def lie(self, b: PETSc.Vec, x: PETSc.Vec) -> None:
        exact(self._mat, b, x)
        x.scale(-1.0)


class Sloppy(Liar):
    """The right answer but for 30 % of every entry, by turns too much and too little."""

    def lie(self, b: PETSc.Vec, x: PETSc.Vec) -> None:
        exact(self._mat, b, x)
        values = x.array_r.copy()
        x.setArray(values * (1.0 + 0.3 * (-1.0) ** np.arange(values.size)))


def exact(mat: PETSc.Mat, b: PETSc.Vec, x: PETSc.Vec) -> None:
    """x = A^-1 b by dense elimination (one rank)."""
    dense = mat.convert("dense", PETSc.Mat())
    try:
        x.setArray(np.linalg.solve(dense.getDenseArray(), b.array_r))
    except np.linalg.LinAlgError:
        x.set(np.nan)
    dense.destroy()


class NaNPC:
    """A preconditioner that returns NaN."""

    def apply(self, pc: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        y.set(np.nan)


class ZeroPC:
    """A preconditioner that returns 0."""

    def apply(self, pc: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        y.set(0.0)
