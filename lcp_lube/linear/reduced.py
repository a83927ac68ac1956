"""The n-by-n system J(theta) = A diag(theta) - B diag(1 - theta), theta in [0, 1]^n, behind every method.

J(theta) blends the columns of two column diagonally dominant M-matrices, A and -B, so it is one itself and nonsingular for
every theta. It comes out of the 2n-by-2n system

    A dp + B dr = f1,   D_p dp + D_r dr = f2

by w = D_p + D_r, theta = D_r/w, g = f2/w, dp = theta y + g, dr = -(1 - theta) y + g: the second equation then holds for
every y, and the first one reads J(theta) y = f1 - (A + B) g. D_p and D_r must have the same sign, as DIN's r and p have
and the derivatives of the Fischer-Burmeister function.
"""

import numpy as np

from ..base.parallel import Array
from ..base.stages import Stages
from ..problems.film.assembly import csr, matrix
from ..problems.film.lubrication import LubricationProblem
from .krylov import Krylov
from .system import System


class ReducedSystem(System):
    """The step of any method through a KSP on J(theta), with its columns scaled to the diagonal of A.

    Column scaling balances full-film columns (conductances h^3/dx) and cavitated ones (U h): after it the diagonal is A's
    for every theta, and in the full film the matrix is A. For a direct solver the diagonal is 1: no off-diagonal entry is
    larger then, and what it takes for a zero pivot, by a number, is one. The sparsity is A's and never changes.
    """

    def __init__(self, problem: LubricationProblem, stages: Stages | None = None):
        super().__init__(problem, stages)
        grid, scheme = problem.grid, problem.scheme
        ny, nx = grid.box
        place = np.arange((ny + 2) * (nx + 2)).reshape(ny + 2, nx + 2)
        pressure = scheme.pressure_entries()
        void = {(dj, di): value for dj, di, value in scheme.void_entries()}
        with self.stages("assembly"):
            # In CSR order: the entries of A and, in A's sparsity, of B, and where their column stands in an array with ghosts.
            b = [void.get((dj, di), np.zeros(1)) for dj, di, _ in pressure]
            beside = [place[1 + dj : 1 + dj + ny, 1 + di : 1 + di + nx] for dj, di, _ in pressure]
            self._pointers, self._columns, self._a, self._b_entries, self._neighbour = csr(grid, pressure, b, beside)
            self._values = self._a.copy()  # of one rank the matrix's own
            self.mat = self._own(matrix(grid, self._pointers, self._columns, self._values))
            self._diagonal_A = scheme.diagonal.ravel()
            self._diagonal_B = -scheme.b_C.ravel()
            self._x, self._b = map(self._own, self.mat.createVecs())
            self.krylov = Krylov(self.mat)

    def assemble(self, theta: Array) -> Array:
        """Refresh the matrix for theta; returns the column scaling, y = scaling * (the KSP's solution). Collective."""
        scaling = 1.0 / (theta * self._diagonal_A + (1.0 - theta) * self._diagonal_B)
        if not self.direct:
            scaling *= self._diagonal_A
        full = self.problem.grid.ghosted(theta * scaling).ravel()
        cavity = self.problem.grid.ghosted((1.0 - theta) * scaling).ravel()
        np.subtract(self._a * full[self._neighbour], self._b_entries * cavity[self._neighbour], out=self._values)
        if self.problem.grid.comm.size > 1:
            self.mat.setValuesCSR(self._pointers, self._columns, self._values)
        self.mat.assemble()
        return scaling

    def solve(self, D_p: Array, D_r: Array, f1: Array, f2: Array, rtol: float) -> tuple[Array, Array, int]:
        """As `System.solve`; D_p and D_r of the same sign, not both zero. Collective."""
        with self.stages("Jacobian"):
            self._w = D_p + D_r
            self._theta = D_r / self._w
            self._scaling = self.assemble(self._theta)
        return self.resolve(f1, f2, rtol)

    def resolve(self, f1: Array, f2: Array, rtol: float) -> tuple[Array, Array, int]:
        problem, theta = self.problem, self._theta
        g = f2 / self._w
        if g.any() or problem.grid.comm.size > 1:
            f1 = f1 - problem.multiply(problem.A, g) - problem.multiply(problem.B, g)
        self._b.setArray(f1)
        with self.stages("KSP"):
            iterations = self.krylov.solve(self._b, self._x, rtol)
        y = self._scaling * self._x.array_r
        return theta * y + g, -(1.0 - theta) * y + g, iterations
