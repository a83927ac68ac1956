"""Exact elimination of the cavitated cells, then a KSP on what is left of the full film.

For theta in {0, 1}^n the unknown of a cavitated cell is r, and r is carried downstream without diffusion: what leaves a cell
enters the next one, b_C of cell i = -b_W of cell i + 1. Adding the rows of a run of cavitated cells to the row of the full
cell just downstream therefore cancels every r in them. What remains is the Schur complement S on the full cells,

    row of S = own row of A + rows of A of the cavitated run just upstream on its x line, columns in the full film only;

runs that reach the outlet are dropped, and the right-hand side is summed likewise. S has at most A's nonzeros and is again a
column diagonally dominant M-matrix: its columns are sums over fewer rows of A's. r follows by one sweep along x.

The KSP sees S diag(w), w the near-null vector of S (`nearnull`): row and column sums are then nonnegative and almost zero, as
multigrid wants them, whatever the fronts look like.
"""

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from ..base.parallel import Array
from ..base.stages import Stages
from ..errors import InputError
from ..problems.film.lubrication import LubricationProblem
from .krylov import Krylov
from .nearnull import COARSEST, near_null
from .system import System

CYCLES = 1  # from w = 1 or the last w; more of them gain nothing (benchmarks/README.md)


class CavitySystem(System):
    """Steps of the active-set method (theta in {0, 1}) through a KSP on the Schur complement of the full film.

    Raises
    ------
    InputError : a grid whose x lines are cut by ranks (1D, or fewer y lines than ranks, on more than one rank).
    """

    state: tuple[str, ...] = ("_w", "_full")  # what a step starts from

    def __init__(self, problem: LubricationProblem, stages: Stages | None = None):
        super().__init__(problem, stages)
        grid = problem.grid
        if any(grid.periodic):
            raise InputError("--system cavity: x lines need a beginning and an end, y columns too; take --system reduced")
        if problem.scheme.held is not None:
            raise InputError("--system cavity: supplies end the runs of void that it eliminates; take --system reduced")
        if grid.box[1] != grid.shape[0]:
            raise InputError("--system cavity: needs every x line on one rank; take --system reduced or fewer ranks")
        scheme = problem.scheme
        with self.stages("assembly"):
            ny, nx = grid.box
            place = np.arange((ny + 2) * (nx + 2)).reshape(ny + 2, nx + 2)
            self._offsets = [
                (value.ravel(), place[1 + dj : 1 + dj + ny, 1 + di : 1 + di + nx].ravel())
                for dj, di, value in scheme.pressure_entries()
            ]
            self._b_C = scheme.b_C.ravel()
        self._full = np.zeros(grid.local_size, dtype=bool)  # the cells of the last set-up
        self._w = np.ones(grid.local_size)  # near-null vector of the last S, 1 where there was none
        self._column, self._line = (a.ravel() for a in np.broadcast_arrays(np.arange(nx)[None, :], np.arange(ny)[:, None]))

    def solve(self, D_p: Array, D_r: Array, f1: Array, f2: Array, rtol: float) -> tuple[Array, Array, int]:
        """dp, dr and the number of linear iterations, for D_r = theta in {0, 1}, D_p = 1 - theta and f2 = 0. Collective."""
        reduce = self.problem.reduce
        with self.stages("Jacobian"):
            full = D_r > 0
            target = self._targets(full)
            kept = target >= 0
            rhs = np.bincount(target[kept], weights=f1[kept], minlength=int(full.sum())).astype(float, copy=False)
            changed, total = (reduce.sum(mask.astype(float)) for mask in (full != self._full, full))
        if changed or self.krylov is None:
            self.destroy()
            self._full = full
            mat = self._own(self._assemble(full, target))
            with self.stages("near-null"):
                if total > COARSEST:
                    self._scale(mat, full, CYCLES if changed else 0)
            with self.stages("KSP"):
                self.krylov = Krylov(mat)
        with self.stages("KSP"):
            y, iterations = self.krylov.of_array(rhs, rtol)
        dp = np.zeros_like(f1)
        dp[full] = self._w[full] * y
        with self.stages("Jacobian"):
            return dp, self._void(full, f1 - self.problem.multiply(self.problem.A, dp)), iterations

    def resolve(self, f1: Array, f2: Array, rtol: float) -> tuple[Array, Array, int]:
        """The same for another right-hand side and the cells of the last `solve`, whose set-up is kept. Collective."""
        return self.solve((~self._full).astype(float), self._full.astype(float), f1, f2, rtol)

    def _assemble(self, full: NDArray[np.bool_], target: NDArray[np.int64]) -> PETSc.Mat:
        """S for these full cells. Collective."""
        from scipy.sparse import coo_array  # here: it takes a while, and small films do without

        with self.stages("Jacobian"):
            local, comm = int(full.sum()), self.problem.grid.comm
            first, total = int(comm.exscan(local) or 0), comm.allreduce(local)
            numbers = np.where(full, first + np.cumsum(full) - 1.0, -1.0)
            framed = np.nan_to_num(self.problem.grid.ghosted(numbers), nan=-1.0).astype(np.int64).ravel()
            rows, columns, values = [], [], []
            for value, place in self._offsets:
                column = framed[place]
                used = (column >= 0) & (target >= 0)
                rows.append(target[used])
                columns.append(column[used])
                values.append(value[used])
            entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
            S = coo_array(entries, shape=(local, total)).tocsr()
            S.sort_indices()
            csr = (S.indptr.astype(PETSc.IntType), S.indices.astype(PETSc.IntType), S.data)
            return PETSc.Mat().createAIJWithArrays(((local, total), (local, total)), csr, comm=comm)

    def _scale(self, S: PETSc.Mat, full: NDArray[np.bool_], cycles: int) -> None:
        """Improve w and multiply the columns of S by it; a run that is taken up again has it already. Collective."""
        if cycles:
            self._w[full] = near_null(S, self._column[full], self._line[full], self._w[full], cycles)
        scaling = S.createVecRight()
        scaling.setArray(self._w[full])
        S.diagonalScale(None, scaling)
        scaling.destroy()

    def _targets(self, full: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Local full-film number of the cell that each cell's row is added to; -1 for runs that reach the outlet."""
        ny, nx = self.problem.grid.box
        number = np.where(full, np.cumsum(full) - 1, -1).reshape(ny, nx)
        here = np.where(full.reshape(ny, nx), np.arange(nx), nx)
        downstream = np.minimum.accumulate(here[:, ::-1], axis=1)[:, ::-1]
        found = np.take_along_axis(number, np.minimum(downstream, nx - 1), axis=1)
        return np.where(downstream < nx, found, -1).ravel()

    def _void(self, full: NDArray[np.bool_], balance: Array) -> Array:
        """dr of the cavitated cells from f1 - A dp: b_C dr adds up along each run."""
        ny, nx = self.problem.grid.box
        cells = full.reshape(ny, nx)
        carried = np.cumsum(np.where(cells, 0.0, balance.reshape(ny, nx)), axis=1)
        last_full = np.maximum.accumulate(np.where(cells, np.arange(nx), -1), axis=1)
        at_rupture = np.where(last_full >= 0, np.take_along_axis(carried, np.maximum(last_full, 0), axis=1), 0.0)
        return np.where(full, 0.0, (carried - at_rupture).ravel() / self._b_C)
