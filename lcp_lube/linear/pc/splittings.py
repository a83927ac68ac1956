"""Saddle-point preconditioner of the two-field systems [A B; R P] (paper, section 6), for -pc_type python."""

from petsc4py import PETSc

from ...base.parallel import Array
from .fields import Inner, TwoFields, choice
from .sweeps import GaussSeidel, Jacobi

SPLITTINGS = ("jacobi", "gauss_seidel", "none")
SCHUR = ("exact", "lines", "diagonal")
FORMS = ("full", "triangular", "diagonal")


class SaddlePC:
    """-pc_type python -pc_python_type lcp_lube.linear.pc.splittings.SaddlePC

    Siefert and de Sturler's preconditioners for generalised saddle-point problems: A = F - E by a splitting, and the Schur
    complement S = P - R F^-1 B of F. The smaller E, the fewer iterations.

    Options, each after the PC's own prefix
    ---------------------------------------
    -pc_saddle_splitting : jacobi (default) F = diag(A); gauss_seidel: F = lower triangle of A, on each rank that of its own
        points; none: F = A, through the KSP with prefix saddle_ (default preonly with a sparse LU).
    -pc_saddle_schur : exact (default): S itself, by forward substitution along the x lines, sequential over the ranks along x;
        lines: that of the Jacobi splitting, P - R diag(A)^-1 B (default, and the best there is, for none); diagonal: its
        diagonal alone.
    -pc_saddle_form : full (default), the inverse of [F B; R P]; triangular, that of [F B; 0 S]; diagonal, diag(F, S)^-1.

    Raises
    ------
    InputError : an option's value off the list, exact with none, a matrix without two fields.
    LinearSolverError : a pivot of S is zero, or the inner KSP failed.
    """

    def __init__(self) -> None:
        self._fields: TwoFields | None = None
        self._parts: list[Jacobi | GaussSeidel | Whole] = []

    def setFromOptions(self, pc: PETSc.PC) -> None:
        self._kind = choice(pc, "pc_saddle_splitting", SPLITTINGS)
        self._schur = choice(pc, "pc_saddle_schur", ("lines", "diagonal") if self._kind == "none" else SCHUR)
        self._form = choice(pc, "pc_saddle_form", FORMS)

    def setUp(self, pc: PETSc.PC) -> None:
        if self._fields is None:
            self._fields = TwoFields(pc)
            self._make(self._fields, pc.getOptionsPrefix() or "")
        else:
            self._fields.refresh()
        for part in self._parts:
            part.refresh()

    def _make(self, fields: TwoFields, prefix: str) -> None:
        """The splitting for F, and the one whose Schur complement is used."""
        self._F: Jacobi | GaussSeidel | Whole
        self._S: Jacobi | GaussSeidel
        if self._kind == "gauss_seidel" and self._schur == "exact":
            self._F = self._S = GaussSeidel(fields)
        else:
            self._F = self._S = Jacobi(fields, lines=self._schur != "diagonal")
            if self._kind == "gauss_seidel":
                self._F = GaussSeidel(fields)
            elif self._kind == "none":
                self._F = Whole(fields, f"{prefix}saddle_")
        self._parts = [self._S] if self._F is self._S else [self._F, self._S]

    def apply(self, pc: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        fields = self._fields
        assert fields is not None
        g1, g2 = fields.take(x)
        if self._form == "full":
            g2 = g2 - fields.R * self._F.solve_F(g1)
        r = self._S.solve_S(g2)
        if self._form != "diagonal":
            g1 = g1 - fields.multiply(fields.B, r)
        fields.put(y, self._F.solve_F(g1), r)

    def destroy(self, pc: PETSc.PC) -> None:
        for part in self._parts:
            part.destroy()
        if self._fields is not None:
            self._fields.destroy()


class Whole(Inner):
    """F = A, through a KSP of its own."""

    def __init__(self, fields: TwoFields, prefix: str):
        super().__init__(fields.A, prefix)
        self._fields = fields

    def refresh(self) -> None:
        self.setUp(self._fields.A)

    def solve_F(self, g: Array) -> Array:
        return self.solve(g)
