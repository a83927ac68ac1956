"""The 2n-by-2n Newton matrix [A B; D_p D_r] of the papers as one PETSc AIJ Mat, ordered by field inside each rank."""

import numpy as np
from petsc4py import PETSc

from ..base.parallel import Array
from ..base.stages import Stages
from ..problems.film.assembly import assemble
from ..problems.film.lubrication import LubricationProblem
from .krylov import Krylov
from .system import System

TINY = 1e-10  # entries that are far from PETSc's zero pivot, 2e-14, on one side


class FullSystem(System):
    """A dp + B dr = f1, D_p dp + D_r dr = f2 through a KSP on the 2n-by-2n matrix.

    The sparsity is fixed when the object is made; `solve` refreshes the values of D_p and D_r alone changing. Rank k
    holds the p and then the r of its points. Python preconditioners find `fields` (index sets of p and r) and `problem`
    as attributes of the matrix.
    """

    def __init__(self, problem: LubricationProblem, stages: Stages | None = None):
        super().__init__(problem, stages)
        nl, comm = problem.grid.local_size, problem.grid.petsc_comm
        with self.stages("assembly"):
            diagonal = assemble(problem.grid, [(0, 0, np.ones(1))])
            nest = PETSc.Mat().createNest([[problem.A, problem.B], [diagonal, diagonal]], comm=comm)
            self.mat = self._own(nest.convert("aij", PETSc.Mat()))
            nest.destroy()
            diagonal.destroy()
            own_p = (2 * problem.grid.first + np.arange(nl)).astype(PETSc.IntType)
            self._rows = own_p + nl
            # Row k of the complementarity block is (D_p)_k, (D_r)_k: refreshed alone by `solve`.
            self._pointers = np.arange(0, 2 * nl + 1, 2, dtype=PETSc.IntType)
            self._columns = np.stack([own_p, self._rows], axis=1).ravel()
            self._values = np.ones(2 * nl)
            self._x, self._b = map(self._own, self.mat.createVecs())
            self._scale = self._row_scale()
            if self._scale is not None:
                self._b.setArray(np.concatenate([self._scale, np.ones(nl)]))
                self.mat.diagonalScale(self._b, None)
            parts = {"p": own_p, "r": self._rows}
            self.fields = {name: self._own(PETSc.IS().createGeneral(part, comm=comm)) for name, part in parts.items()}
            self.mat.setAttr("fields", self.fields)
            self.mat.setAttr("problem", problem)
            self.krylov = Krylov(self.mat, self.fields)

    def solve(self, D_p: Array, D_r: Array, f1: Array, f2: Array, rtol: float) -> tuple[Array, Array, int]:
        with self.stages("Jacobian"):
            self._values[0::2], self._values[1::2] = D_p, D_r
            self.mat.setValuesIJV(self._pointers, self._columns, self._values, rowmap=self._rows)
            self.mat.assemble()
        return self.resolve(f1, f2, rtol)

    def resolve(self, f1: Array, f2: Array, rtol: float) -> tuple[Array, Array, int]:
        nl = f1.size
        b = self._b.array_w
        b[:nl], b[nl:] = f1 if self._scale is None else self._scale * f1, f2
        del b  # gives the array back to the vector
        with self.stages("KSP"):
            iterations = self.krylov.solve(self._b, self._x, rtol)
        x = self._x.array_r.copy()
        return x[:nl], x[nl:], iterations

    def _row_scale(self) -> Array | None:
        """Powers of 2 for the rows of A and B, which take their largest entries next to 1; None where none is below TINY.

        A film ratio of 1e3 makes conductances differ by 1e9, and a solver that compares with a number takes small for zero.
        """
        s = self.problem.scheme
        largest = np.maximum(s.diagonal, -s.b_C).ravel()
        if not self.problem.reduce.min(largest) < TINY:
            return None
        return 2.0 ** -np.round(np.log2(largest))
