"""What the two-field preconditioners share: the blocks of [A B; R P], options with their legal values, inner KSPs."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from petsc4py import PETSc

from ...base.options import explain_error
from ...base.parallel import Array
from ...errors import InputError, nearest
from ...problems.grid import Grid
from ..krylov import LinearSolverError, reason_name


def choice(pc: PETSc.PC, option: str, legal: Sequence[str]) -> str:
    """Value of -PREFIX_pc_OPTION, one of `legal`, the first by default.

    Raises
    ------
    InputError : another value.
    """
    prefix = pc.getOptionsPrefix() or ""
    value = PETSc.Options(prefix).getString(option, legal[0])
    if value not in legal:
        raise InputError(f"-{prefix}{option} {value}: allowed are {', '.join(legal)}{nearest(value, legal)}")
    return value


class TwoFields:
    """The blocks of K = [A B; R P] behind a python PC, R and P diagonal.

    Parameters
    ----------
    pc : its operator carries the attributes `fields` (index sets 'p' and 'r') and `problem`, as `FullSystem` sets them.

    Attributes
    ----------
    A, B : matrices, refreshed by `refresh`.
    R, P : arrays of this rank's points, the diagonals of K's lower blocks.

    Raises
    ------
    InputError : a matrix without the two fields.
    """

    def __init__(self, pc: PETSc.PC):
        self._mat = pc.getOperators()[1]
        fields, problem = self._mat.getAttr("fields"), self._mat.getAttr("problem")
        if set(fields or ()) != {"p", "r"} or problem is None:
            raise InputError(
                f"-pc_python_type {pc.getPythonType()}: it needs a matrix of the two fields p and r, "
                "as --system full without -mat_type has it"
            )
        self.grid: Grid = problem.grid
        self.reduce = problem.reduce
        self._is = (fields["p"], fields["r"])
        first = self._mat.getOwnershipRange()[0]
        self._own = tuple(index.indices - first for index in self._is)
        self._blocks: list[Any] = [None] * 4
        self.refresh()

    def refresh(self) -> None:
        """Take over the matrix's present values. Collective."""
        pairs = [(row, column) for row in self._is for column in self._is]
        self._blocks = [
            self._mat.createSubMatrix(row, column, block) for (row, column), block in zip(pairs, self._blocks, strict=True)
        ]
        self.A, self.B = self._blocks[:2]
        self.R, self.P = (block.getDiagonal().array_r.copy() for block in self._blocks[2:])

    def take(self, x: PETSc.Vec) -> tuple[Array, Array]:
        """The p and r parts of this rank's entries."""
        return x.array_r[self._own[0]], x.array_r[self._own[1]]

    def put(self, y: PETSc.Vec, p: Array, r: Array) -> None:
        """Write the two parts into this rank's entries."""
        out = y.getArray()
        out[self._own[0]], out[self._own[1]] = p, r

    def multiply(self, mat: PETSc.Mat, a: Array) -> Array:
        """mat @ a for arrays of this rank's points. Collective."""
        y, x = mat.createVecs()
        x.setArray(a)
        mat.mult(x, y)
        out = y.array_r.copy()
        x.destroy()
        y.destroy()
        return out

    def void_coupling(self) -> tuple[Array, Array]:
        """B's diagonal and its entry to the west of it on the x line (0 where there is none)."""
        pointers, columns, values = self.B.getValuesCSR()
        rows = np.repeat(np.arange(pointers.size - 1), np.diff(pointers))
        west = columns != rows + self.B.getOwnershipRange()[0]
        below = np.zeros(pointers.size - 1)
        below[rows[west]] = values[west]
        return self.B.getDiagonal().array_r.copy(), below

    def destroy(self) -> None:
        for block in self._blocks:
            block.destroy()


class Inner:
    """A KSP inside a preconditioner, set by the options under its own prefix; by default one sparse LU.

    Parameters
    ----------
    mat : its operator; `setUp` after its values have changed.
    prefix : of its options.
    """

    def __init__(self, mat: PETSc.Mat, prefix: str):
        self._prefix = prefix
        self._ksp = PETSc.KSP().create(mat.comm)
        self._ksp.setOptionsPrefix(prefix)
        self._ksp.setType("preonly")
        pc = self._ksp.getPC()
        pc.setType("lu")
        packages = ("superlu", "umfpack", "mumps") if mat.comm.size == 1 else ("mumps", "superlu_dist")
        has = PETSc.Sys.hasExternalPackage
        package = next((name for name in packages if has(name) or (name == "umfpack" and has("suitesparse"))), None)
        if package:
            pc.setFactorSolverType(package)
        try:
            self._ksp.setFromOptions()
        except PETSc.Error as error:
            raise InputError(explain_error(error)) from None
        self._x, self._b = mat.createVecs()

    def setUp(self, mat: PETSc.Mat) -> None:
        self._ksp.setOperators(mat)
        self._ksp.setUp()

    def solve(self, b: Array) -> Array:
        """The KSP's answer for this rank's part of the right-hand side. Collective.

        Raises
        ------
        LinearSolverError : it failed; reaching its iteration limit is no failure of a preconditioner.
        """
        self._b.setArray(b)
        self._ksp.solve(self._b, self._x)
        reason = self._ksp.getConvergedReason()
        if reason < 0 and reason != PETSc.KSP.ConvergedReason.DIVERGED_MAX_IT:
            raise LinearSolverError(f"the inner KSP with prefix {self._prefix} failed: {reason_name(reason)}")
        return self._x.array_r.copy()

    def destroy(self) -> None:
        for obj in (self._ksp, self._x, self._b):
            obj.destroy()
