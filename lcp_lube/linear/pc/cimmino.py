"""Block Cimmino: projections on the row spaces of blocks of rows, as a preconditioner and as a KSP of its own.

For row blocks A_1, ..., A_m of A, with A_i^+ = A_i' (A_i A_i')^-1,

    M^-1 r = sum_i A_i^+ r_i = A' D r,      D = diag((A_1 A_1')^-1, ..., (A_m A_m')^-1) in the order of the rows,
    H = M^-1 A = sum_i A_i^+ A_i,

a sum of orthogonal projections: symmetric positive definite for any nonsingular A, so that conjugate gradients apply to H
x = M^-1 b (Arioli, Duff, Noailles and Ruiz, SIAM J. Sci. Stat. Comput. 13, 1992, 47-70). One block is all of A: H = I.
Blocks of mutually orthogonal rows make D diagonal, whatever their number; then H is A'A with the rows of A normalised.

In parallel the rows stay where PETSc has them. Each rank factorises A_i A_i' for the blocks of its own rows; A and A' carry
what crosses the ranks. A block never reaches over ranks: its parts count as blocks of their own, which for orthogonal rows
makes no difference.
"""

from types import SimpleNamespace

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from petsc4py import PETSc

from ...base.compiled import compiled
from ...errors import InputError
from ..krylov import LinearSolverError
from .fields import Inner, choice

PARTITIONS = ("first_fit", "stencil", "contiguous", "rows")


class Cimmino:
    """-pc_type python -pc_python_type lcp_lube.linear.pc.cimmino.Cimmino

    M^-1 r = sum_i A_i^+ r_i, for a KSP that takes nonsymmetric preconditioners (gmres, bcgs, richardson); for conjugate
    gradients on H see `CimminoCG`.

    Options, each after the PC's own prefix
    ---------------------------------------
    -cimmino_partition : first_fit (default): a row joins the first block to whose rows it is orthogonal, in natural order on
        each rank; stencil: blocks (x + 2 y) mod 5 of a five-point matrix on a grid, orthogonal; contiguous: equal shares of
        consecutive rows; rows: each row a block.
    -cimmino_blocks : number of contiguous blocks in all, at least one a rank; default one a rank.
    -cimmino_sub_... : the KSP for the systems A_i A_i' of blocks that are not orthogonal; default a sparse LU.

    Raises
    ------
    InputError : a partition off the list or that does not fit the matrix, fewer blocks than ranks.
    LinearSolverError : a row is empty, or a block's rows are linearly dependent.
    """

    def __init__(self) -> None:
        self.blocks: NDArray[np.int64] | None = None
        self._inner: Inner | None = None
        self._sub: PETSc.Mat | None = None
        self._work: PETSc.Vec | None = None

    def setFromOptions(self, pc: PETSc.PC) -> None:
        self._prefix = pc.getOptionsPrefix() or ""
        self.partition = choice(pc, "cimmino_partition", PARTITIONS)
        self.count = PETSc.Options(self._prefix).getInt("cimmino_blocks", 0) if self.partition == "contiguous" else 0

    def setUp(self, pc: PETSc.PC) -> None:
        self.refresh(pc.getOperators()[1])

    def refresh(self, A: PETSc.Mat) -> None:
        """Take over the values of A; the blocks are chosen the first time. Collective."""
        if A.getType() not in ("seqaij", "mpiaij"):
            raise InputError(f"Cimmino: a matrix of type aij is needed, not {A.getType()}")
        self.A = A
        pointers, columns, values = A.getValuesCSR()
        needed, where = np.unique(columns, return_inverse=True)
        rows = sp.csr_matrix((values, where, pointers), shape=(len(pointers) - 1, len(needed)))
        if self.blocks is None:
            self.blocks = self._partition(A, rows)
            self._work = A.createVecLeft()
        products = (rows @ rows.T).tocoo()
        inside = (self.blocks[products.row] == self.blocks[products.col]) & (products.data != 0.0)
        within = sp.csr_matrix((products.data[inside], (products.row[inside], products.col[inside])), shape=products.shape)
        self._norms = within.diagonal()
        comm = A.comm.tompi4py()
        if comm.allreduce(int(np.sum(self._norms <= 0.0))):
            raise LinearSolverError("Cimmino: a row of the matrix has no entries")
        self.orthogonal = within.nnz == len(self._norms)
        if not self.orthogonal:
            self._factorise(within)

    def _factorise(self, within: sp.csr_matrix) -> None:
        """One factorisation of all of this rank's A_i A_i' at once: they do not share unknowns."""
        if self._sub is not None:
            self._sub.destroy()
        within.sort_indices()
        index = (within.indptr.astype(PETSc.IntType), within.indices.astype(PETSc.IntType))
        self._sub = PETSc.Mat().createAIJ(within.shape, csr=(*index, within.data), comm=PETSc.COMM_SELF)
        if self._inner is None:
            self._inner = Inner(self._sub, f"{self._prefix}cimmino_sub_")
        self._inner.setUp(self._sub)

    def _partition(self, A: PETSc.Mat, rows: sp.csr_matrix) -> NDArray[np.int64]:
        """The block of each of this rank's rows. Collective."""
        count = rows.shape[0]
        if self.partition == "rows":
            return np.arange(count)
        if self.partition == "first_fit":
            pattern = abs(rows)  # rows that share a column may be orthogonal by cancellation, for these values alone
            shared = sp.csr_matrix(pattern @ pattern.T)
            return compiled(first_fit)(shared.indptr.astype(np.int64), shared.indices.astype(np.int64))
        if self.partition == "stencil":
            grid = getattr(A.getAttr("problem"), "grid", None)
            if grid is None or grid.dim != 2 or grid.local_size != count:
                raise InputError("-cimmino_partition stencil: a five-point matrix on a 2D grid is needed; first_fit takes any")
            x, y = np.arange(grid.x_start, grid.x_end), np.arange(grid.y_start, grid.y_end)
            return ((x[None, :] + 2 * y[:, None]) % 5).ravel()
        ranks, rank = A.comm.size, A.comm.rank
        total = self.count or ranks
        if total < ranks:
            raise InputError(f"-cimmino_blocks {total}: at least one block a rank is needed, {ranks} here")
        mine = total // ranks + (rank < total % ranks)
        return np.arange(count) * mine // max(count, 1)

    def multiply(self, r: PETSc.Vec, y: PETSc.Vec) -> None:
        """y = M^-1 r = A' D r. Collective."""
        work = self._work
        assert work is not None
        if self.orthogonal:
            work.setArray(r.array_r / self._norms)
        else:
            assert self._inner is not None
            work.setArray(self._inner.solve(r.array_r))
        self.A.multTranspose(work, y)

    def apply(self, pc: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        self.multiply(x, y)

    def view(self, pc: PETSc.PC, viewer: PETSc.Viewer) -> None:
        viewer.printfASCII(f"  Cimmino: partition {self.partition}\n")

    def destroy(self, pc: PETSc.PC | None = None) -> None:
        for obj in (self._inner, self._sub, self._work):
            if obj is not None:
                obj.destroy()


class CimminoCG:
    """-ksp_type python -ksp_python_type lcp_lube.linear.pc.cimmino.CimminoCG -pc_type none

    Conjugate gradients on H x = M^-1 b, with the options of `Cimmino`. The tolerances are the outer KSP's and hold for the
    residual of H; the inner KSP with prefix cimmino_ (default cg without preconditioner) takes further options.
    """

    def __init__(self) -> None:
        self.sum = Cimmino()
        self._ksp: PETSc.KSP | None = None
        self._state = -1

    def setFromOptions(self, ksp: PETSc.KSP) -> None:
        self.sum.setFromOptions(ksp)
        self._prefix = f"{ksp.getOptionsPrefix() or ''}cimmino_"

    def _refresh(self, A: PETSc.Mat) -> PETSc.KSP:
        """The KSP for H, with the present values of A: PETSc sets a KSP up once only, not when its matrix has changed."""
        if A.stateGet() != self._state:
            self.sum.refresh(A)
            self._state = A.stateGet()
        if self._ksp is None:
            self._H = PETSc.Mat().createPython(A.getSizes(), SimpleNamespace(mult=self._multiply), comm=A.comm)
            self._H.setUp()
            self._b, self._middle = A.createVecs()
            self._ksp = PETSc.KSP().create(A.comm)
            self._ksp.setOptionsPrefix(self._prefix)
            self._ksp.setOperators(self._H)
            self._ksp.setType(PETSc.KSP.Type.CG)
            self._ksp.getPC().setType(PETSc.PC.Type.NONE)
            self._ksp.setFromOptions()
        return self._ksp

    def _multiply(self, _: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """y = H x = M^-1 A x."""
        self.sum.A.mult(x, self._middle)
        self.sum.multiply(self._middle, y)

    def solve(self, ksp: PETSc.KSP, b: PETSc.Vec, x: PETSc.Vec) -> None:
        inner = self._refresh(ksp.getOperators()[0])
        rtol, atol, divtol, max_it = ksp.getTolerances()
        inner.setTolerances(rtol, atol, divtol, max_it)
        self.sum.multiply(b, self._b)
        inner.solve(self._b, x)
        ksp.setIterationNumber(inner.getIterationNumber())
        ksp.setResidualNorm(inner.getResidualNorm())
        ksp.setConvergedReason(inner.getConvergedReason())

    def destroy(self, ksp: PETSc.KSP) -> None:
        if self._ksp is not None:
            for obj in (self._ksp, self._H, self._b, self._middle):
                obj.destroy()
        self.sum.destroy()


def first_fit(pointers: NDArray[np.int64], columns: NDArray[np.int64]) -> NDArray[np.int64]:
    """Colours of a graph (CSR) in natural order: each vertex takes the smallest one that no neighbour has."""
    n = len(pointers) - 1
    colour, taken = np.full(n, -1), np.full(n + 1, -1)
    for i in range(n):
        for k in range(pointers[i], pointers[i + 1]):
            if colour[columns[k]] >= 0:
                taken[colour[columns[k]]] = i
        c = 0
        while taken[c] == i:
            c += 1
        colour[i] = c
    return colour
