"""The linear systems of heat that a film's liquid carries along: upwind, solved by Krylov's steps in the order of the flow."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from petsc4py import PETSc

from ...base.compiled import has_numba
from ...base.parallel import Array
from .downstream import downstream

RTOL = 1e-13
FEW, MOST = 60, 2000  # steps, and where whole factors would take too much
ORDERED = 4000  # points from which one rank's cells are put in the order of the flow
WHOLE = 500_000  # points, at most, of which one rank makes whole factors
STALE, REFINED = 10, 3  # steps with whole factors of another matrix from which on new ones pay; with its own


class Transport:
    """The upwind matrix and its inner solver: incomplete factors in the order of the flow, so that few steps do; whole ones
    where they do not, as in rings and in grooves that pump oil round and round, which do for the matrices of later answers too.

    known : those factors, which a loop keeps from answer to answer, if such have been needed; None where they serve no more.
    """

    def __init__(self, mat: PETSc.Mat, known: dict[Any, Any], cut: int):
        """mat : taken over. cut : as of `downstream`."""
        self.mat, self.known, self._cut = mat, known, cut
        self._order: Any = slice(None)
        self._ordered, self._own = mat, False  # whether the factors are this matrix's own
        self.ksp = PETSc.KSP().create(mat.comm)
        self.ksp.setOptionsPrefix("energy_")
        self.ksp.setType("gmres")
        self.ksp.setGMRESRestart(FEW)
        if "factors" in known:
            self.ksp.setFromOptions()  # as below: monitors, say
            self._by_factors(anew=known["factors"] is None)
            return
        if mat.comm.getSize() == 1 and mat.getSize()[0] >= ORDERED and has_numba():
            pointers, columns, values = mat.getValuesCSR()
            self._order = downstream(pointers, columns, values, cut)
            rows = PETSc.IS().createGeneral(self._order, comm=mat.comm)
            self._ordered = mat.permute(rows, rows)
            rows.destroy()
        self.ksp.setOperators(self._ordered)
        self.ksp.getPC().setType("ilu" if mat.comm.getSize() == 1 else "bjacobi")
        self.ksp.setTolerances(rtol=RTOL, atol=0.0, max_it=FEW if self._solver else MOST)
        self.ksp.setFromOptions()

    def copy(self) -> "Transport":
        return Transport(self.mat.copy(), self.known, self._cut)

    @property
    def _solver(self) -> str | None:
        """What makes whole factors of the matrix; None where it has too many points or PETSc has nothing for it."""
        if self.mat.comm.getSize() == 1:
            return "petsc" if self.mat.getSize()[0] <= WHOLE else None
        return "mumps" if PETSc.Sys.hasExternalPackage("mumps") else None

    def _by_factors(self, anew: bool) -> None:
        """Krylov's steps with the factors that are known, or with those of this matrix."""
        if anew:
            factors = PETSc.PC().create(self.mat.comm)
            factors.setOperators(self.mat)
            factors.setType("lu")
            factors.setFactorSolverType(self._solver)
            if self._solver == "petsc":
                factors.setFactorOrdering("nd")
            self.known["factors"] = factors
        if self._ordered is not self.mat:
            self._ordered.destroy()
        self._own = anew
        self._order, self._ordered = slice(None), self.mat
        self.ksp.setOperators(self.mat)
        self.ksp.getPC().setType("python")
        self.ksp.getPC().setPythonContext(_Factors(self.known["factors"]))
        self.ksp.setTolerances(rtol=RTOL, atol=0.0, max_it=REFINED if anew else 2 * STALE)

    def __call__(self, heat: Array, transposed: bool = False) -> tuple[Array, float]:
        """The solution, and its residual in parts of the right-hand side; transposed : that up the flow. Collective."""
        values, residual = self._solved(heat, transposed)
        failed = self.ksp.getConvergedReason() == PETSc.KSP.ConvergedReason.DIVERGED_MAX_IT
        if failed and self._solver and not self._own:
            self._by_factors(anew=True)
            values, residual = self._solved(heat, transposed)
        elif "factors" in self.known and self.ksp.getIterationNumber() > STALE:
            self.known["factors"] = None
        return values, residual

    def _solved(self, heat: Array, transposed: bool) -> tuple[Array, float]:
        x, b = self._ordered.createVecs()
        b.setArray(heat[self._order])
        size = b.norm()
        (self.ksp.solveTranspose if transposed else self.ksp.solve)(b, x)
        values = np.empty(heat.size)
        values[self._order] = x.array_r
        b.aypx(-1.0, self._ordered * x)
        residual = b.norm() / size if size > 0 else 0.0
        for obj in (x, b):
            obj.destroy()
        return values, float(residual)

    def destroy(self) -> None:
        self.ksp.destroy()
        self._ordered.destroy()
        self.mat.destroy()


@dataclass(frozen=True)
class _Factors:
    """Whole factors as PETSc's preconditioner of type python, of this matrix or of one near it."""

    pc: PETSc.PC

    def apply(self, pc: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        self.pc.apply(x, y)

    def applyTranspose(self, pc: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        self.pc.applyTranspose(x, y)
