"""The n-by-n Newton matrices of box-constrained problems, with the coarser grids behind them for -pc_type mg."""

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from ..base.options import explain_error
from ..base.owned import Owned
from ..base.parallel import Array
from ..base.stages import Stages
from ..errors import InputError
from ..problems.box import BoxProblem
from ..problems.transfer import Transfer
from .krylov import Krylov

Mask = NDArray[np.bool_]


class BoxSystem:
    """(f'(v) + diag(shift)) x = rhs, or f'(v) x = rhs at the free points with x given at the held ones, through a KSP.

    Python preconditioners find `problem` as an attribute of the matrix.
    """

    def __init__(self, problem: BoxProblem, stages: Stages | None = None):
        self.problem = problem
        self.stages = stages or Stages()
        with self.stages("assembly"):
            self.matrix = NewtonMatrix(problem)
            self.matrix.mat.setAttr("problem", problem)
            self.krylov = Krylov(self.matrix.mat)
            self._multigrid = None
            if self.krylov.pc_type == PETSc.PC.Type.MG:
                self._multigrid = Multigrid(problem, self.krylov.ksp)

    def linearise(self, v: Array) -> Array:
        """Take f' at v for the next `solve`; returns its diagonal. Collective."""
        with self.stages("Jacobian"):
            self._v = v
            return self.matrix.linearise(v)

    def solve(self, rhs: Array, rtol: float, shift: Array | None = None, held: Mask | None = None) -> tuple[Array, int]:
        """x and the number of linear iterations. Collective.

        Parameters
        ----------
        rhs : right-hand side; at held points, x itself.
        shift : added to the diagonal.
        held : points where x is known: their rows and columns become those of a diagonal matrix.
        """
        with self.stages("Jacobian"):
            self.matrix.update(shift, held)
            self.matrix.set_right_hand_side(rhs, held)
            if self._multigrid is not None:
                self._multigrid.update(self._v, shift, held)
        with self.stages("KSP"):
            iterations = self.krylov.solve(self.matrix.b, self.matrix.x, rtol)
        return self.matrix.x.array_r.copy(), iterations

    def destroy(self) -> None:
        """Free the PETSc objects; a python PC must not outlive this."""
        self.krylov.destroy()
        self.matrix.destroy()
        if self._multigrid is not None:
            self._multigrid.destroy()


class NewtonMatrix:
    """f'(v) + diag(shift), or f'(v) with the rows and columns of held points zeroed but for the diagonal. Fixed sparsity."""

    def __init__(self, problem: BoxProblem):
        self.problem = problem
        self._own = Owned(self, problem.grid.petsc_comm)
        self.mat = self._own(problem.jacobian(problem.v0).duplicate(copy=True))
        self.x, self.b = map(self._own, self.mat.createVecs())

    def linearise(self, v: Array) -> Array:
        """Take f' at v for `update`; returns its diagonal. Collective."""
        self._jacobian = self.problem.jacobian(v)
        self._jacobian.getDiagonal(self.b)
        self._diagonal = self.b.array_r.copy()
        return self._diagonal

    def update(self, shift: Array | None, held: Mask | None) -> None:
        """New values. Collective."""
        self._jacobian.copy(self.mat, structure=PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        if held is not None:
            self.b.setArray(np.where(held, 0.0, 1.0))
            self.mat.diagonalScale(self.b, self.b)
            # Any positive value does where x is known; f's own keeps the rows in one size.
            known = np.where(self._diagonal > 0, self._diagonal, 1.0)
            self.b.setArray(np.where(held, known, self._diagonal if shift is None else self._diagonal + shift))
        elif shift is not None:
            self.b.setArray(self._diagonal + shift)
        else:
            return
        self.mat.setDiagonal(self.b)
        self.mat.assemble()

    def set_right_hand_side(self, rhs: Array, held: Mask | None) -> None:
        """b for the values of the last update: what the held points contribute goes to the right. Collective."""
        if held is not None:
            self.x.setArray(np.where(held, rhs, 0.0))
            self._jacobian.mult(self.x, self.b)
            unit = np.where(self._diagonal > 0, self._diagonal, 1.0)
            rhs = np.where(held, unit * rhs, rhs - self.b.array_r)
        self.b.setArray(rhs)

    def destroy(self) -> None:
        self._own.free()


class Multigrid:
    """Coarse matrices for PCMG: the same problem on coarser grids, at the restricted v, with its points held or shifted.

    A coarse point is held when at least half of the weight that fine points have from it belongs to held ones: the coarse
    grid then sees the contact area neither too large nor too small (truncated monotone multigrid: Kornhuber 1994). f being
    scaled by the cell's size, coarse matrices need no factor beside those of the transfer.
    """

    def __init__(self, problem: BoxProblem, ksp: PETSc.KSP):
        self._matrices: list[NewtonMatrix] = []
        self._transfers: list[Transfer] = []
        self._weights: list[Array] = []
        limit = PETSc.Options().getInt("pc_mg_levels", 30)
        while len(self._matrices) < limit - 1 and (coarser := problem.coarser()) is not None:
            points = problem.grid.local_size
            problem, transfer = coarser
            self._matrices.append(NewtonMatrix(problem))
            self._transfers.append(transfer)
            self._weights.append(transfer.restrict(np.ones(points)))
        pc = ksp.getPC()
        try:
            pc.setMGLevels(len(self._matrices) + 1)
            for level, (transfer, matrix) in enumerate(zip(self._transfers[::-1], self._matrices[::-1], strict=True)):
                pc.setMGInterpolation(level + 1, transfer.mat)
                pc.getMGSmoother(level).setOperators(matrix.mat)
            ksp.setFromOptions()  # again: smoothers exist only now
        except PETSc.Error as error:
            raise InputError(explain_error(error)) from None

    def update(self, v: Array, shift: Array | None, held: Mask | None) -> None:
        """New values on every coarse grid. Collective."""
        for transfer, matrix, weight in zip(self._transfers, self._matrices, self._weights, strict=True):
            v = transfer.restrict(v) / weight
            if shift is not None:
                shift = transfer.restrict(shift)
            if held is not None:
                held = transfer.restrict(held.astype(float)) >= 0.5 * weight
            matrix.linearise(v)
            matrix.update(shift, held)

    def destroy(self) -> None:
        for matrix in self._matrices:
            matrix.destroy()
