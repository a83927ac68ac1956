"""J' lambda = b of a film in the plane, J its Jacobian at the signs of a solution, by multigrid on the transposed system.

The cycle is that of the film itself transposed: the same grids and conductances, the signs at the coarse points for the coarse
grids' signs. What the film's interpolation of pressures gives to a full point, a full point's residual gives here to the coarse
points, nothing of it to cavitated ones; corrections are interpolated as the film's residuals are restricted. GMRES removes
what the fronts leave, preconditioned from the left, so that the norm that it ends by is near lambda's error. How near is seen
by what lambda is for: lambda' (J z) = b' z of the solution z, and it is improved until that holds.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from ...base.parallel import Array
from ...problems.film.lubrication import LubricationProblem
from . import adjoint_kernels, kernels, levels, transfer

SWEEPS = 1  # before and after the coarse grid
COARSEST = 3  # sweeps of the coarsest grid, in numbers of its points a side
RTOL, MOST = 1e-9, 60
AGREES = 5e-8  # lambda' (J z) and b' z, relative; where they do not
TIGHTER, TRIES = 1e-2, 3  # RTOL falls by so much, so many times


class Cycle:
    """One F cycle for J' as a preconditioner, and J' itself, on a rank's points. Collective, as its methods."""

    def __init__(self, problem: LubricationProblem, cavity: NDArray[np.bool_]):
        self.grid = grid = problem.grid
        self.levels = levels.hierarchy(levels.finest(problem), True)
        first = self.levels[0]
        levels.put(first, grid, first.z, np.where(cavity, 0.0, 1.0))
        for fine, coarse in zip(self.levels[:-1], self.levels[1:], strict=True):
            transfer.inject(fine.z, coarse.part(coarse.z), fine.first, fine.by_x, fine.by_y)
            coarse.gather(coarse.z)
        self.full = [level.z > 0.0 for level in self.levels]

    def mult(self, mat: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """J' x."""
        first = self.levels[0]
        levels.put(first, self.grid, first.z, x.array_r)
        first.c[:] = 0.0
        out = np.empty_like(first.c)
        adjoint_kernels.residual(first.z, self.full[0], first.kx, first.ky, first.c, out)
        y.array[:] = -self._own(out)

    def apply(self, pc: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """What one cycle makes of a right-hand side x."""
        first = self.levels[0]
        levels.put(first, self.grid, first.c, x.array_r)
        first.z[:] = 0.0
        self._run(0, "F")
        y.array[:] = self._own(first.z)

    def forced(self, z: Array) -> Array:
        """J z of a film's z, p or minus the flow of void. Collective."""
        first = self.levels[0]
        levels.put(first, self.grid, first.z, z)
        out = np.zeros_like(first.c)
        kernels.add_balance(first.z, first.kx, first.ky, out)
        return self._own(out)

    def _own(self, a: Array) -> Array:
        return levels.own(self.levels[0], self.grid, a).ravel()

    def _run(self, k: int, kind: str) -> None:
        level = self.levels[k]
        at = (level.z, self.full[k], level.kx, level.ky)
        if k + 1 == len(self.levels):
            for s in range(COARSEST * max(level.nx, level.ny)):
                self._sweep(k, s % 2 == 1)
            return
        coarse, where = self.levels[k + 1], (level.first, level.by_x, level.by_y)
        for _ in range(SWEEPS):
            self._sweep(k, False)
        coarse.c[:], coarse.z[:] = 0.0, 0.0
        adjoint_kernels.restrict(*at, level.c, coarse.part(coarse.c), *where, level.periodic[0])
        coarse.collect(coarse.c)
        coarse.c *= self.full[k + 1]
        self._run(k + 1, kind)
        if kind == "F" and k + 2 < len(self.levels):
            self._run(k + 1, "V")
        adjoint_kernels.correct(level.z, coarse.part(coarse.z), level.kx, level.ky, *where)
        level.share(level.z)
        for _ in range(SWEEPS):
            self._sweep(k, True)

    def _sweep(self, k: int, down: bool) -> None:
        level = self.levels[k]
        adjoint_kernels.sweep(level.z, self.full[k], level.kx, level.ky, level.c, down)
        level.share(level.z)


def transposed(problem: LubricationProblem, cavity: NDArray[np.bool_], rows: Sequence[Array], z: Array) -> list[Array] | None:
    """J'^-1 b for each b, J having A's columns in the full film and -B's in the cavity; None where cycles stall. Collective.

    z : the solution, p where the film is full and -r where it is not.
    """
    cycle, grid, dot = Cycle(problem, cavity), problem.grid, problem.grid.reduce.dot
    n = (grid.local_size, grid.size)
    mat = PETSc.Mat().createPython((n, n), cycle, comm=grid.petsc_comm)
    mat.setUp()
    ksp = PETSc.KSP().create(grid.petsc_comm)
    x, b = mat.createVecs()
    try:
        ksp.setOperators(mat)
        ksp.setType(PETSc.KSP.Type.GMRES)
        ksp.getPC().setType(PETSc.PC.Type.PYTHON)
        ksp.getPC().setPythonContext(cycle)
        forced, found = cycle.forced(np.where(cavity, -problem.scheme.b_C.ravel() * z, z)), []
        for row in rows:
            b.setArray(np.where(cavity, -row / problem.scheme.b_C.ravel(), row))
            wanted, size = dot(row, z), dot(np.abs(row), np.abs(z))
            for k in range(TRIES):
                ksp.setTolerances(rtol=RTOL * TIGHTER**k, max_it=MOST)
                ksp.setInitialGuessNonzero(k > 0)
                ksp.solve(b, x)
                if ksp.getConvergedReason() <= 0:
                    return None
                if abs(dot(x.array_r, forced) - wanted) <= AGREES * size:
                    break
            else:
                return None
            found.append(x.array_r.copy())
        return found
    finally:
        for one in (ksp, mat, x, b):
            one.destroy()
