"""One KSP, configured by options alone: tolerances, counts, and failures that are reported."""

import atexit
import ctypes
import gc
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress

import numpy as np
from petsc4py import PETSc

from ..base.options import explain_error, set_names
from ..base.owned import Owned
from ..base.parallel import Array
from ..errors import InputError

ZERO_PIVOT = (71, 81)  # PETSc's codes for LU and Cholesky: the matrix is singular, not the options wrong
MAX_INNER_ITERATIONS = 10_000  # the paper's limit; -ksp_max_it overrides it
MUMPS_SHORT = (-8, -9, -11, -14, -15, -17, -18, -19, -20)  # INFOG(1): a workspace or buffer is too small
MUMPS_LARGEST_RESERVE = 2000  # per cent: MUMPS' own 20, made four times as much three times
SHIFT = "pc_sor_diagonal_shift"


class LinearSolverError(ArithmeticError):
    """The inner solver broke down; the message says how."""


@atexit.register
def free_garbage() -> None:
    """Free what is kept alive by reference cycles alone while Python still runs. Collective.

    PETSc would free it at its own end, and calls a python PC's methods then: a crash. numba leaves such cycles when it
    compiles inside a PC's set-up, through the frames of exceptions that it has caught.
    """
    gc.collect()
    if PETSc.Sys.isInitialized() and not PETSc.Sys.isFinalized():
        PETSc.garbage_cleanup()


@contextmanager
def own_errors() -> Iterator[None]:
    """What a python PC or KSP raises comes out as itself: newer releases of petsc4py hide it behind a PETSc.Error."""
    try:
        yield
    except PETSc.Error as error:
        cause: BaseException = error
        while cause.__cause__ is not None:
            cause = cause.__cause__
        if cause is error:
            raise
        raise cause from None


@contextmanager
def zeros_fail_together() -> Iterator[None]:
    """Options by which SOR, wherever it is read here, fails on all ranks at a zero on the diagonal of one of them.

    Without a shift it raises on the rank that has the zero, while the others wait inside the solve for ever; with one below
    any number PETSc notes the failure, and all ranks hear of it.
    """
    options, given = PETSc.Options(), set_names()
    prefixes = {"", *(name.removesuffix("pc_type") for name in given if name.endswith("pc_type"))}
    names = [name for p in prefixes for name in (p + SHIFT, f"{p}mg_levels_{SHIFT}") if name not in given]
    for name in names:
        options.setValue(name, "-1e-300")
    try:
        yield
    finally:
        for name in names:
            options.delValue(name)


def one_thread_for_superlu_dist() -> None:
    """OpenMP with one thread if an option asks for superlu_dist: 8.1.2 gives wrong factors with more (benchmarks/README.md).

    OMP_NUM_THREADS, read when PETSc is loaded, may be unset or too large in a program that started PETSc itself. OpenMP is
    reached through the libraries that petsc4py depends on; without one there are no threads.
    """
    if "superlu_dist" in PETSc.Options().getAll().values():
        with suppress(AttributeError):
            ctypes.CDLL(PETSc.__file__).omp_set_num_threads(1)


class Krylov:
    """A KSP with the empty prefix for one matrix whose values change.

    Parameters
    ----------
    mat : operator; -mat_type TYPE converts it for the solver (dense for LAPACK), the AIJ assembly stays.
    fields : index sets by name, for PCFIELDSPLIT.

    Raises
    ------
    InputError : an option's value is unknown or does not fit the matrix or the number of ranks.
    """

    def __init__(self, mat: PETSc.Mat, fields: dict[str, PETSc.IS] | None = None):
        self.mat = mat
        options = PETSc.Options()
        given = set_names()
        kind = options.getString("mat_type", "")
        self._converted = PETSc.Mat() if kind and kind not in ("aij", mat.getType()) else None
        self._kind = kind
        self._fixed_rtol = "ksp_rtol" in given
        if "pc_factor_in_place" in given:
            raise InputError("-pc_factor_in_place: the matrix is written anew in every step, factors cannot take its place")
        one_thread_for_superlu_dist()
        self._own = Owned(self, mat.comm)
        if self._converted is not None:
            self._own(self._converted)
        self.ksp = self._own(PETSc.KSP().create(mat.comm))
        self.ksp.setTolerances(max_it=MAX_INNER_ITERATIONS)
        self._ready = False
        self.fields = fields or {}
        try:
            with own_errors(), zeros_fail_together():
                self.ksp.setFromOptions()
        except PETSc.Error as error:
            raise InputError(explain_error(error)) from None
        except (ImportError, AttributeError) as error:  # PETSc imports the class of a python PC or KSP here
            names = [f"-{name} {options.getString(name)}" for name in ("ksp_python_type", "pc_python_type") if name in given]
            raise InputError(f"{' '.join(names)}: {error}") from None

    @property
    def direct(self) -> bool:
        return self.ksp.getType() == PETSc.KSP.Type.PREONLY

    @property
    def ksp_type(self) -> str:
        return str(self.ksp.getType())

    @property
    def pc_type(self) -> str:
        return str(self.ksp.getPC().getType())

    def set_up(self) -> None:
        """Hand the matrix over; bad options that only show against a matrix show here, before anything is solved."""
        try:
            operator = self.mat
            if self._converted is not None:
                operator = self.mat.convert(self._kind, self._converted)
            self.ksp.setOperators(operator)
            pc = self.ksp.getPC()
            if not self._ready and pc.getType() == PETSc.PC.Type.FIELDSPLIT:
                if not self.fields:
                    raise InputError("-pc_type fieldsplit: it needs a matrix of two fields, as --system full has it")
                # Which field is solved or eliminated first is an option of ours: PETSc has none, it goes by the calls' order.
                order = PETSc.Options().getString("fieldsplit_order", ",".join(self.fields))
                if sorted(order.split(",")) != sorted(self.fields):
                    raise InputError(f"-fieldsplit_order {order}: allowed are {','.join(self.fields)} in any order")
                pc.setFieldSplitIS(*((name, self.fields[name]) for name in order.split(",")))
            with own_errors(), nullcontext() if self.direct else zeros_fail_together():
                self.ksp.setUp()
                self.ksp.setUpOnBlocks()
        except PETSc.Error as error:
            self._keep()
            if self._ready or error.ierr in ZERO_PIVOT:
                raise LinearSolverError(explain_error(error)) from None
            raise InputError(explain_error(error)) from None
        self._ready = True

    def solve(self, b: PETSc.Vec, x: PETSc.Vec, rtol: float, transposed: bool = False) -> int:
        """Solve for the matrix's present values; returns the number of iterations (0 for a direct solver). Collective.

        Parameters
        ----------
        transposed : solve with the transposed matrix, whose factors the direct solvers have as well.

        Raises
        ------
        LinearSolverError : any negative reason but the iteration limit (the outer loop can use what was reached), or a
            result that is not finite.
        """
        if not self.direct and not self._fixed_rtol:
            self.ksp.setTolerances(rtol=rtol)
        self.set_up()
        reason = self._run(b, x, transposed)
        while reason == PETSc.KSP.ConvergedReason.DIVERGED_PCSETUP_FAILED and self._enlarge_mumps():
            reason = self._run(b, x, transposed)
        if reason < 0 and reason != PETSc.KSP.ConvergedReason.DIVERGED_MAX_IT:
            raise LinearSolverError(f"KSP {self.ksp_type} with PC {self.pc_type} failed: {reason_name(reason)}")
        if not np.isfinite(x.norm()):
            raise LinearSolverError(f"KSP {self.ksp_type} with PC {self.pc_type} gave a vector that is not finite")
        return 0 if self.direct else self.ksp.getIterationNumber()

    def of_array(self, b: Array, rtol: float, transposed: bool = False) -> tuple[Array, int]:
        """`solve` for an array of this rank's part: the solution's, and the number of iterations. Collective."""
        x, rhs = self.mat.createVecs()
        rhs.setArray(b)
        iterations = self.solve(rhs, x, rtol, transposed)
        found = x.array_r.copy()
        for vec in (x, rhs):
            vec.destroy()
        return found, iterations

    def _run(self, b: PETSc.Vec, x: PETSc.Vec, transposed: bool = False) -> int:
        """Solve; returns PETSc's reason."""
        try:
            with own_errors():
                (self.ksp.solveTranspose if transposed else self.ksp.solve)(b, x)
        except PETSc.Error as error:
            self._keep()
            raise LinearSolverError(explain_error(error)) from None
        return self.ksp.getConvergedReason()

    def _keep(self) -> None:
        """Never free this KSP: where PETSc has left a solve by an error, its multigrid crashes on being destroyed."""
        self.ksp.incRef()

    def _enlarge_mumps(self) -> bool:
        """If MUMPS ran out of the workspace it had foreseen, which pivoting can outgrow: provide four times the reserve."""
        pc = self.ksp.getPC()
        if self.pc_type not in ("lu", "cholesky") or pc.getFactorSolverType() != "mumps":
            return False
        factor = pc.getFactorMatrix()
        reserve = 4 * factor.getMumpsIcntl(14)  # in per cent
        if factor.getMumpsInfog(1) not in MUMPS_SHORT or reserve > MUMPS_LARGEST_RESERVE:
            return False
        # Only a new factor takes it, and that reads it from the options.
        options, name = PETSc.Options(), "mat_mumps_icntl_14"
        before = options.getString(name, "")
        options.setValue(name, str(reserve))
        operator = self.ksp.getOperators()[0]
        pc.reset()
        self.ksp.setOperators(operator)
        self.ksp.setUp()
        options.delValue(name)
        if before:
            options.setValue(name, before)
            options.getString(name)  # read, as it was
        return True

    def destroy(self) -> None:
        self._own.free()


def reason_name(reason: int) -> str:
    """PETSc's name of a converged reason, DIVERGED_BREAKDOWN for -5, say."""
    names = {v: k for k, v in vars(PETSc.KSP.ConvergedReason).items() if not k.startswith("_") and isinstance(v, int)}
    return names.get(reason, str(reason))
