"""FSAI: the factorised sparse approximate inverse A^-1 ~ G' G of Kolotilina and Yeremin, for -pc_type python."""

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from ...base.parallel import Array
from ...errors import InputError
from ..krylov import LinearSolverError

BATCH = 32_768  # rows of G whose small systems are solved at once: bounds the memory


class FSAI:
    """-pc_type python -pc_python_type lcp_lube.linear.pc.fsai.FSAI

    For a symmetric positive definite matrix: G is lower triangular with a given pattern, and of all these the one nearest
    to the inverse of the Cholesky factor (Kolotilina and Yeremin, SIAM J. Matrix Anal. Appl. 14, 1993, 45-58). Row i of G
    comes from one small system with the entries of A that its pattern picks, all rows independent of each other: the form of
    AINV that is parallel throughout. The rows are distributed as those of A; only "lower" depends on their numbering.

    Options, each after the PC's own prefix
    ---------------------------------------
    -pc_fsai_power : the pattern is that of the lower triangle of A^power; 1, 2 (default), 3 or 4.

    Raises
    ------
    InputError : a power off the list, a matrix that is not of type AIJ or not symmetric.
    LinearSolverError : a small system is not positive definite, so A is not.
    """

    def __init__(self) -> None:
        self._G: PETSc.Mat | None = None

    def setFromOptions(self, pc: PETSc.PC) -> None:
        prefix = pc.getOptionsPrefix() or ""
        self.power = PETSc.Options(prefix).getInt("pc_fsai_power", 2)
        if not 1 <= self.power <= 4:
            raise InputError(f"-{prefix}pc_fsai_power {self.power}: allowed are 1, 2, 3, 4")

    def setUp(self, pc: PETSc.PC) -> None:
        A = pc.getOperators()[1]
        if A.getType() not in ("seqaij", "mpiaij"):
            raise InputError(f"FSAI: a matrix of type aij is needed, not {A.getType()}")
        if not all(A.isSymmetricKnown()) and not A.isSymmetric(1e-12 * A.norm(PETSc.NormType.INFINITY)):
            raise InputError("FSAI: a symmetric matrix is needed; lcp_lube.linear.pc.ainv.AINV takes any")
        pointers, columns = lower_pattern(A, self.power)
        values, definite = rows_of_G(A, pointers, columns)
        if not A.comm.tompi4py().allreduce(definite, MPI.LAND):
            raise LinearSolverError("FSAI: the matrix is not positive definite")
        self._free()
        self._G = PETSc.Mat().createAIJ(A.getSizes(), csr=(pointers, columns, values), comm=A.comm)
        self._middle = self._G.createVecLeft()

    def apply(self, pc: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        assert self._G is not None
        self._G.mult(x, self._middle)
        self._G.multTranspose(self._middle, y)

    applyTranspose = apply

    def view(self, pc: PETSc.PC, viewer: PETSc.Viewer) -> None:
        viewer.printfASCII(f"  FSAI: pattern of the lower triangle of A^{self.power}\n")

    def _free(self) -> None:
        if self._G is not None:
            self._G.destroy()
            self._middle.destroy()

    def destroy(self, pc: PETSc.PC) -> None:
        self._free()


def lower_pattern(A: PETSc.Mat, power: int) -> tuple[NDArray, NDArray]:
    """Row pointers and columns (ascending, the diagonal last) of the lower triangle of A^power, own rows. Collective."""
    product = A
    for _ in range(power - 1):
        last, product = product, product.matMult(A)
        if last is not A:
            last.destroy()
    pointers, columns, _ = product.getValuesCSR()
    if product is not A:
        product.destroy()
    first, end = A.getOwnershipRange()
    rows = np.repeat(np.arange(first, end), np.diff(pointers))
    keep = columns <= rows
    pointers = np.zeros(end - first + 1, dtype=PETSc.IntType)
    np.cumsum(np.bincount(rows[keep] - first, minlength=end - first), out=pointers[1:])
    return pointers, columns[keep]


def rows_of_G(A: PETSc.Mat, pointers: NDArray, columns: NDArray) -> tuple[Array, bool]:
    """Values of G on a lower pattern, and whether all the small systems are positive definite. Collective.

    Row i, with pattern S whose last index is i: A[S, S] y = (0, ..., 0, 1)', g = y / sqrt(y_last); then (G A G')_ii = 1.
    """
    needed, where = np.unique(columns, return_inverse=True)
    chosen = PETSc.IS().createGeneral(needed.astype(PETSc.IntType), comm=PETSc.COMM_SELF)
    (block,) = A.createSubMatrices(chosen, chosen)
    data, indices, data_pointers = block.getValuesCSR()[::-1]
    near = sp.csr_matrix((data, indices, data_pointers), shape=block.getSize())
    block.destroy()
    chosen.destroy()
    counts, values, definite = np.diff(pointers), np.zeros(len(columns)), True
    for size in np.unique(counts):
        of_size = np.flatnonzero(counts == size)
        for start in range(0, len(of_size), BATCH):
            entries = pointers[of_size[start : start + BATCH], None] + np.arange(size)
            S = where[entries]
            shape = (len(S), size, size)
            left, right = (np.broadcast_to(part, shape).ravel() for part in (S[:, :, None], S[:, None, :]))
            systems = np.asarray(near[left, right]).reshape(shape)
            unit = np.zeros((len(S), size, 1))
            unit[:, -1] = 1.0
            try:
                y = np.linalg.solve(systems, unit)[:, :, 0]
            except np.linalg.LinAlgError:
                return values, False
            definite = definite and bool(np.all(y[:, -1] > 0))
            values[entries] = y / np.sqrt(np.where(y[:, -1:] > 0, y[:, -1:], 1.0))
    return values, definite
