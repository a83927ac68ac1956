"""AINV: the factorised approximate inverse A^-1 ~ Z D^-1 W' of Benzi and Tuma, for -pc_type python."""

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from petsc4py import PETSc

from ...base.compiled import compiled
from ...base.parallel import Array
from ...errors import InputError
from ..krylov import LinearSolverError

SWEEPS = 4  # of the scaling; one is enough where the diagonal entries are the largest
SMALLEST_PIVOT = 1e-14  # of the scaled matrix, whose largest entries are 1


class AINV:
    """-pc_type python -pc_python_type lcp_lube.linear.pc.ainv.AINV

    W' A Z ~ D with unit upper triangular Z and W, made by biconjugation of the unit vectors (Benzi and Tuma, SIAM J. Sci.
    Comput. 19, 1998, 968-994): setting up and applying need products alone, no triangular solves. For a symmetric matrix
    W = Z and half the work. The matrix is first scaled to largest entries 1 in each row and column, so that one drop
    tolerance fits all. On several ranks the factors are those of the whole matrix, as on one: the columns of Z are made one
    after the other, so every rank gathers the matrix and makes them all; applying them is distributed.

    Options, each after the PC's own prefix
    ---------------------------------------
    -pc_ainv_drop : entries of Z and W smaller than this in modulus are left out as they arise; default 0.05. 0 drops
        nothing and gives the inverse, which is a full matrix.
    -pc_ainv_block : each rank factorises its own diagonal block alone (block Jacobi): a set-up that scales in seconds and
        memory, and counts that grow with the ranks; default false.

    Raises
    ------
    InputError : a drop tolerance below 0, a matrix that is not of type AIJ.
    LinearSolverError : a pivot is zero or not finite: the matrix has no such factorisation in the order of its unknowns, or
        the dropping has destroyed it. Smaller drop tolerances help against the second.
    """

    def __init__(self) -> None:
        self._factors: tuple[PETSc.Mat, ...] = ()

    def setFromOptions(self, pc: PETSc.PC) -> None:
        prefix = pc.getOptionsPrefix() or ""
        self.block = PETSc.Options(prefix).getBool("pc_ainv_block", False)
        self.drop = PETSc.Options(prefix).getReal("pc_ainv_drop", 0.05)
        if not 0 <= self.drop < 1:
            raise InputError(f"-{prefix}pc_ainv_drop {self.drop:g}: allowed are numbers from 0 to below 1")

    def setUp(self, pc: PETSc.PC) -> None:
        mat = pc.getOperators()[1]
        if mat.getType() not in ("seqaij", "mpiaij"):
            raise InputError(f"AINV: a matrix of type aij is needed, not {mat.getType()}")
        comm = mat.comm.tompi4py()
        A = _rows(mat.getDiagonalBlock()) if self.block or comm.size == 1 else _whole(mat)
        Z, DW, failed = factorise(A, self.drop)
        failures = [(rank, column) for rank, column in enumerate(comm.allgather(failed)) if column >= 0]
        if failures:
            rank, column = failures[0]
            where = f", rank {rank}" if self.block and comm.size > 1 else ""
            raise LinearSolverError(f"AINV with -pc_ainv_drop {self.drop:g}: zero or infinite pivot in column {column}{where}")
        self._fill = (Z.nnz + DW.nnz) / max(A.shape[0], 1)
        self._free()
        self._factors = tuple(_distributed(factor, mat) for factor in (DW, Z))
        self._middle = mat.createVecRight()

    def apply(self, pc: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        DW, Z = self._factors
        DW.mult(x, self._middle)
        Z.mult(self._middle, y)

    def applyTranspose(self, pc: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        DW, Z = self._factors
        Z.multTranspose(x, self._middle)
        DW.multTranspose(self._middle, y)

    def view(self, pc: PETSc.PC, viewer: PETSc.Viewer) -> None:
        fill = f", {self._fill:.1f} entries a row in Z and W on rank 0" if self._factors else ""
        viewer.printfASCII(f"  AINV: drop tolerance {self.drop:g}{fill}\n")

    def _free(self) -> None:
        if self._factors:
            for obj in (*self._factors, self._middle):
                obj.destroy()
            self._factors = ()

    def destroy(self, pc: PETSc.PC) -> None:
        self._free()


def _rows(mat: PETSc.Mat) -> sp.csr_matrix:
    """A sequential matrix."""
    pointers, columns, values = mat.getValuesCSR()
    return sp.csr_matrix((values, columns, pointers), shape=mat.getSize())


def _whole(mat: PETSc.Mat) -> sp.csr_matrix:
    """The whole matrix, on every rank. Collective."""
    pointers, columns, values = mat.getValuesCSR()
    parts = mat.comm.tompi4py().allgather((np.diff(pointers), columns, values))
    lengths, columns, values = (np.concatenate(part) for part in zip(*parts, strict=True))
    return sp.csr_matrix((values, columns, np.concatenate([[0], np.cumsum(lengths)])), shape=mat.getSize())


def _distributed(factor: sp.csr_matrix, mat: PETSc.Mat) -> PETSc.Mat:
    """A factor of the whole matrix or of this rank's block, its rows distributed as those of `mat`. Collective."""
    first, end = mat.getOwnershipRange()
    whole = factor.shape[0] == mat.getSize()[0]
    own = (factor[first:end] if whole else factor).tocsr()
    own.sort_indices()
    columns = own.indices if whole else own.indices + first
    csr = (own.indptr.astype(PETSc.IntType), columns.astype(PETSc.IntType), own.data)
    return PETSc.Mat().createAIJ(mat.getSizes(), csr=csr, comm=mat.comm)


def factorise(A: sp.csr_matrix, drop: float) -> tuple[sp.csr_matrix, sp.csr_matrix, int]:
    """Z and D^-1 W' with A^-1 ~ Z (D^-1 W'), the scaling of A folded into both.

    Parameters
    ----------
    A : n-by-n, canonical CSR.
    drop : drop tolerance for the scaled matrix.

    Returns
    -------
    Z, DW : n-by-n.
    failed : column without a usable pivot, -1 if there is none; Z and DW are then empty.
    """
    n = A.shape[0]
    if n == 0:
        return A, A, -1
    row, column = scaling(A)
    scaled = scale(A, row, column)
    transposed = scaled.T.tocsr()
    symmetric = bool(abs(scaled - transposed).max() <= 1e-12)
    run = compiled(biconjugate)

    def unit_upper(left: sp.csr_matrix, right: sp.csr_matrix) -> tuple[sp.csc_matrix, Array, int]:
        pointers, rows, values, pivots, failed = run(*_index64(left), left.data, *_index64(right), drop)
        if failed >= 0:
            return sp.csc_matrix((n, n)), pivots, int(failed)
        return sp.csc_matrix((values, rows, pointers), shape=(n, n)), pivots, -1

    Z, pivots, failed = unit_upper(scaled, transposed)
    W = Z
    if not symmetric and failed < 0:
        W, _, failed = unit_upper(transposed, scaled)
    if failed >= 0:
        return sp.csr_matrix((n, n)), sp.csr_matrix((n, n)), failed
    return scale(Z.tocsr(), column, np.ones(n)), scale(W.T, 1.0 / pivots, row), failed


def biconjugate(
    pointers: NDArray[np.int64],
    columns: NDArray[np.int64],
    values: Array,
    col_pointers: NDArray[np.int64],
    col_rows: NDArray[np.int64],
    drop: float,
) -> tuple[NDArray[np.int64], NDArray[np.int64], Array, Array, int]:
    """Unit upper triangular Z with (row j of A) z_i = 0 for j < i, column by column (left-looking), small entries dropped.

    Column i starts as the unit vector. In the order of j, every row j < i of A that meets its entries is made orthogonal
    to it by taking off a multiple of z_j; the entries that this brings may call for further rows j.

    Parameters
    ----------
    pointers, columns, values : A by rows.
    col_pointers, col_rows : where A has entries, by columns.

    Returns
    -------
    pointers, rows, values of Z by columns (rows not sorted), pivots (row i of A) z_i, and the column that failed or -1.
    """
    n = len(pointers) - 1
    z_pointers = np.zeros(n + 1, np.int64)
    capacity = 16 * n + 16
    z_rows, z_values = np.empty(capacity, np.int64), np.empty(capacity)
    pivots = np.zeros(n)
    z = np.zeros(n)  # column i, dense
    support, queue = np.empty(n, np.int64), np.empty(n, np.int64)
    in_support, queued = np.full(n, -1), np.full(n, -1)  # the last column that had an index there
    top = 0
    for i in range(n):
        support[0], z[i], in_support[i] = i, 1.0, i
        size, looked_at, waiting, j = 1, 0, 0, -1
        while True:
            while looked_at < size:  # rows that meet new entries join the queue, which is sorted with the smallest last
                k = support[looked_at]
                looked_at += 1
                for t in range(col_pointers[k], col_pointers[k + 1]):
                    row = col_rows[t]
                    if j < row < i and queued[row] != i:
                        queued[row] = i
                        place = waiting
                        waiting += 1
                        while place > 0 and queue[place - 1] < row:
                            queue[place] = queue[place - 1]
                            place -= 1
                        queue[place] = row
            if waiting == 0:
                break
            waiting -= 1
            j = queue[waiting]
            product = 0.0
            for k in range(pointers[j], pointers[j + 1]):
                product += values[k] * z[columns[k]]
            if product == 0.0:
                continue
            product /= pivots[j]
            for k in range(z_pointers[j], z_pointers[j + 1]):
                row = z_rows[k]
                entry = z[row] - product * z_values[k]
                if abs(entry) < drop:
                    z[row] = 0.0
                else:
                    z[row] = entry
                    if in_support[row] != i:
                        in_support[row] = i
                        support[size] = row
                        size += 1
        pivot = 0.0
        for k in range(pointers[i], pointers[i + 1]):
            pivot += values[k] * z[columns[k]]
        if not SMALLEST_PIVOT < abs(pivot) < np.inf:
            return z_pointers, z_rows[:top], z_values[:top], pivots, i
        pivots[i] = pivot
        if top + size > capacity:
            capacity = 2 * capacity + size
            more_rows, more_values = np.empty(capacity, np.int64), np.empty(capacity)
            more_rows[:top], more_values[:top] = z_rows[:top], z_values[:top]
            z_rows, z_values = more_rows, more_values
        for k in range(size):
            row = support[k]
            if z[row] != 0.0:
                z_rows[top], z_values[top] = row, z[row]
                top += 1
                z[row] = 0.0
        z_pointers[i + 1] = top
    return z_pointers, z_rows[:top], z_values[:top], pivots, -1


def scaling(A: sp.csr_matrix) -> tuple[Array, Array]:
    """Row and column factors that bring the largest modulus in each row and column of A near 1 (Ruiz); equal if A = A'."""
    row, column = np.ones(A.shape[0]), np.ones(A.shape[0])
    largest = abs(A)
    for _ in range(SWEEPS):
        by_row, by_column = (largest.max(axis=axis).toarray().ravel() for axis in (1, 0))
        if max(np.max(np.abs(by_row - 1.0), initial=0.0), np.max(np.abs(by_column - 1.0), initial=0.0)) < 0.1:
            break
        row /= np.sqrt(np.where(by_row > 0, by_row, 1.0))
        column /= np.sqrt(np.where(by_column > 0, by_column, 1.0))
        largest = abs(scale(A, row, column))
    return row, column


def scale(A: sp.csr_matrix, row: Array, column: Array) -> sp.csr_matrix:
    """diag(row) A diag(column)."""
    data = A.data * np.repeat(row, np.diff(A.indptr)) * column[A.indices]
    return sp.csr_matrix((data, A.indices, A.indptr), shape=A.shape)


def _index64(A: sp.csr_matrix) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    return A.indptr.astype(np.int64), A.indices.astype(np.int64)
