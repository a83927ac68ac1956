"""Splittings A = F - E with their exact Schur complements S = P - R F^-1 B, solved by forward substitution along x."""

import numpy as np
from petsc4py import PETSc
from scipy.linalg import lapack

from ...base.parallel import Array
from ...problems.grid import Grid
from ..krylov import LinearSolverError
from .fields import TwoFields

FORWARD = PETSc.Mat.SORType.FORWARD_SWEEP | PETSc.Mat.SORType.ZERO_INITIAL_GUESS


class Pipeline:
    """Hands the values at the east ends of the x lines on to the next rank along x.

    Forward substitution along lines that cross ranks is sequential over them: a rank waits for those to its west. Ranks side
    by side in y work at the same time.
    """

    def __init__(self, grid: Grid):
        self._box = grid.box
        self._comm = grid.comm.Split(color=grid.y_start, key=grid.x_start)

    def receive(self) -> Array:
        """Values just west of this rank's lines, shape (ny_local,); zero at the domain's west side."""
        west = np.zeros(self._box[0])
        if self._comm.rank > 0:
            self._comm.Recv(west, source=self._comm.rank - 1)
        return west

    def send(self, values: Array) -> None:
        """Pass this rank's own points on."""
        if self._comm.rank + 1 < self._comm.size:
            self._comm.Send(np.ascontiguousarray(values.reshape(self._box)[:, -1]), dest=self._comm.rank + 1)

    def destroy(self) -> None:
        self._comm.Free()


class Jacobi:
    """F = diag(A). S is lower bidiagonal along every x line; without `lines` its diagonal alone is used."""

    def __init__(self, fields: TwoFields, lines: bool = True):
        self._fields, self._lines = fields, lines
        self._pipeline = Pipeline(fields.grid)

    def refresh(self) -> None:
        f = self._fields
        b, west = f.void_coupling()
        self._a = f.A.getDiagonal().array_r.copy()
        self._diagonal = f.P - f.R * b / self._a
        check_pivots(f, self._diagonal)
        below = (-f.R * west / self._a).reshape(f.grid.box)
        self._inflow = below[:, 0].copy()
        below[:, 0] = 0.0  # the lines lie end to end in LAPACK's band
        self._band = np.zeros((2, self._a.size))
        self._band[0], self._band[1, :-1] = self._diagonal, below.ravel()[1:]

    def solve_F(self, g: Array) -> Array:
        return g / self._a

    def solve_S(self, g: Array) -> Array:
        if not self._lines:
            return g / self._diagonal
        g = g.reshape(self._fields.grid.box).copy()
        g[:, 0] -= self._inflow * self._pipeline.receive()
        r = lapack.dtbtrs(self._band, g.reshape(-1, 1), uplo="L")[0].ravel()
        self._pipeline.send(r)
        return r

    def destroy(self) -> None:
        self._pipeline.destroy()


class GaussSeidel:
    """F = lower triangle of A within the rank's own points (between ranks F is block diagonal; B's coupling is kept).

    F^-1 B is a full lower triangle, but S r = g is the second half of [F B; R P](p, r) = (0, g), which is 2-by-2 block lower
    triangular when p and r of a point stand together. Write (p, r) = (-b, a) g/d + (P, -R) t/d with a, b the diagonals of A
    and B and d = a P - b R: then R p + P r = g, a p + b r = t, and the rows that remain,

        t + (strict lower part of A) p + (west part of B) r = 0,

    are a unit lower triangle in t with A's sparsity: one forward sweep.
    """

    def __init__(self, fields: TwoFields):
        self._fields = fields
        self._pipeline = Pipeline(fields.grid)
        local = fields.A.getDiagonalBlock() if fields.A.comm.size > 1 else fields.A
        pointers, columns, _ = local.getValuesCSR()
        rows = np.repeat(np.arange(pointers.size - 1), np.diff(pointers))
        self._lower = columns <= rows
        self._rows, self._columns = rows[self._lower], columns[self._lower]
        counts = np.bincount(self._rows, minlength=pointers.size - 1)
        self._csr = np.concatenate([[0], np.cumsum(counts)]).astype(PETSc.IntType), self._columns.astype(PETSc.IntType)
        self._west = (self._columns == self._rows - 1) & (self._rows % fields.grid.box[1] != 0)
        ones = np.ones(self._rows.size)
        size = pointers.size - 1
        self._F, self._T = (PETSc.Mat().createAIJ((size, size), csr=(*self._csr, ones), comm=PETSc.COMM_SELF) for _ in range(2))
        self._x, self._b = self._F.createVecs()

    def refresh(self) -> None:
        f = self._fields
        local = f.A.getDiagonalBlock() if f.A.comm.size > 1 else f.A
        lower = local.getValuesCSR()[2][self._lower]
        self._set(self._F, lower)
        self._a, (self._bd, west) = f.A.getDiagonal().array_r.copy(), f.void_coupling()
        self._d = self._a * f.P - self._bd * f.R
        check_pivots(f, self._d)
        self._inflow = west.reshape(f.grid.box)[:, 0].copy()
        west.reshape(f.grid.box)[:, 0] = 0.0
        self._within = west
        sweep = lower * (f.P / self._d)[self._columns]
        sweep[self._west] -= west[self._rows[self._west]] * (f.R / self._d)[self._columns[self._west]]
        sweep[self._rows == self._columns] = 1.0
        self._set(self._T, sweep)

    def _set(self, mat: PETSc.Mat, values: Array) -> None:
        mat.setValuesCSR(*self._csr, values)
        mat.assemble()

    def _forward(self, mat: PETSc.Mat, g: Array) -> Array:
        """Solution of a lower triangular local system."""
        self._b.setArray(g)
        mat.SOR(self._b, self._x, sortype=FORWARD)
        return self._x.array_r.copy()

    def solve_F(self, g: Array) -> Array:
        return self._forward(self._F, g)

    def solve_S(self, g: Array) -> Array:
        f = self._fields
        p, r = -self._bd * g / self._d, self._a * g / self._d
        self._b.setArray(p)
        self._F.mult(self._b, self._x)
        rest = self._a * p - self._x.array_r
        rest[1:] -= self._within[1:] * r[:-1]
        rest.reshape(f.grid.box)[:, 0] -= self._inflow * self._pipeline.receive()
        r -= f.R / self._d * self._forward(self._T, rest)
        self._pipeline.send(r)
        return r

    def destroy(self) -> None:
        self._pipeline.destroy()
        for obj in (self._F, self._T, self._x, self._b):
            obj.destroy()


def check_pivots(fields: TwoFields, pivots: Array) -> None:
    """Raise LinearSolverError where a pivot is zero or not finite. Collective."""
    smallest, largest = fields.reduce.min(np.abs(pivots)), fields.reduce.max(np.abs(pivots))
    if not (smallest > 0.0 and np.isfinite(largest)):
        raise LinearSolverError(f"saddle-point preconditioner: pivots between {smallest} and {largest}")
