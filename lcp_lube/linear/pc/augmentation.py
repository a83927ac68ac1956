"""Augmentation preconditioner of the two-field systems [A B; R P] (paper, section 6), for -pc_type python."""

import numpy as np
from petsc4py import PETSc

from ...base.parallel import Array
from ...errors import InputError, nearest
from ..krylov import LinearSolverError
from .fields import Inner, TwoFields, choice

FORMS = ("triangular", "diagonal", "full")
WEIGHTS = ("p", "identity")


class AugmentationPC:
    """-pc_type python -pc_python_type lcp_lube.linear.pc.augmentation.AugmentationPC

    The second block row is negated (left multiplication by diag(I, -I)), [A B; -R -P], which has the signs of a saddle
    point; the preconditioner is made of the weight W, diagonal and positive, and of the augmented block

        S = A - B W^-1 R,

    an M-matrix as A and -B are (spec of the paper: Rees and Greif's augmentation with B W^-1 R for B' W^-1 B). Rows in which
    D_p + D_r < 0 (Fischer-Burmeister) are the negated ones already.

    Options, each after the PC's own prefix
    ---------------------------------------
    -pc_augmentation_form : triangular (default) [S B; 0 -W]; diagonal diag(S, W); full, see below.
    -pc_augmentation_weight : p (default; W = P, the pressures of DIN), identity, or a positive number w for W = w I.
    -pc_augmentation_floor : raises the entries of W = P to this part of the largest one; default 0.
    -pc_augmentation_scale : true (default) solves S's system in the variable (W + R) W^-1 p, false as it stands.
    -augmentation_ksp_type, -augmentation_pc_type, ... : the KSP of S; default preonly with a sparse LU.

    Notes
    -----
    With W = P, S is the Schur complement of P: the triangular form with an exact inner solve needs at most 2 GMRES
    iterations, and the diagonal one has the eigenvalues (-g +- sqrt(g^2 + 4 (1 + g)^2))/(2 (1 + g)) for g in the spectrum
    of -A^-1 B P^-1 R, which for g > 0 lie in [-1.62, -1] and [0.62, 1]. But in the cavity P falls to 1e-25, the columns of
    S there grow as r/p, and 1/W enters the iterates: the difficulty that the paper documents. With W = I nothing is large,
    but the iterations grow. The scaled variable makes the columns a blend of those of A and -B, of one size whatever p is;
    what remains is the division by W. The form `full` (W = P only) has none: the second block row R p + P r = g is met
    exactly by (p, r) = (R, P) g/(R^2 + P^2) + (P, -R) y/(R + P), y from the scaled S and the first row, so zeros in P (the
    rule in the Fischer-Burmeister systems) do no harm, and an exact inner solve makes it exact: 1 iteration.

    Raises
    ------
    InputError : an option's value off the list, a weight or floor that is not positive, a matrix without two fields.
    LinearSolverError : an entry of W is zero, or the inner KSP failed.
    """

    def __init__(self) -> None:
        self._fields: TwoFields | None = None
        self._inner: Inner | None = None
        self._S: PETSc.Mat | None = None

    def setFromOptions(self, pc: PETSc.PC) -> None:
        self._prefix = pc.getOptionsPrefix() or ""
        options = PETSc.Options(self._prefix)
        self._form = choice(pc, "pc_augmentation_form", FORMS)
        self._scale = options.getBool("pc_augmentation_scale", True)
        text = options.getString("pc_augmentation_weight", "p")
        self._weight = None if text == "p" else 1.0 if text == "identity" else _positive(pc, "pc_augmentation_weight", text)
        text = options.getString("pc_augmentation_floor", "")
        self._floor = _positive(pc, "pc_augmentation_floor", text) if text else 0.0
        if self._form == "full" and not (self._weight is None and self._scale and not self._floor):
            raise InputError(f"-{self._prefix}pc_augmentation_form full: only with weight p, scaled, without a floor")

    def setUp(self, pc: PETSc.PC) -> None:
        if self._fields is None:
            self._fields = TwoFields(pc)
        else:
            self._fields.refresh()
        fields = self._fields
        self._sign = np.where(fields.R + fields.P < 0.0, -1.0, 1.0)
        self._R, P = self._sign * fields.R, self._sign * fields.P
        W = P if self._weight is None else np.full(P.size, self._weight)
        self._W = np.maximum(W, self._floor * fields.reduce.max(W)) if self._floor else W
        total = self._W + self._R
        smallest = fields.reduce.min(total if self._form == "full" else self._W)
        if not smallest > 0.0:
            raise LinearSolverError(
                f"augmentation ({self._form}): smallest entry of the weight {smallest + 0.0:.3g}, not positive"
            )
        # Columns of S are blended as theta A - rest B; p = theta y.
        size = total if self._scale else self._W
        self._theta, self._rest = self._W / size, self._R / size
        self._S = blend(fields, self._theta, self._rest, self._S)
        if self._inner is None:
            self._inner = Inner(self._S, f"{self._prefix}augmentation_")
        self._inner.setUp(self._S)

    def apply(self, pc: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        fields, inner = self._fields, self._inner
        assert fields is not None and inner is not None
        g1, g2 = fields.take(x)
        g2 = self._sign * g2
        if self._form == "full":
            share = g2 / (self._R**2 + self._W**2)
            p, r = self._R * share, self._W * share
            v = inner.solve(g1 - fields.multiply(fields.A, p) - fields.multiply(fields.B, r))
            fields.put(y, p + self._theta * v, r - self._rest * v)
        elif self._form == "triangular":
            r = g2 / self._W
            fields.put(y, self._theta * inner.solve(g1 - fields.multiply(fields.B, r)), r)
        else:
            fields.put(y, self._theta * inner.solve(g1), -g2 / self._W)

    def destroy(self, pc: PETSc.PC) -> None:
        for obj in (self._fields, self._inner, self._S):
            if obj is not None:
                obj.destroy()


def blend(fields: TwoFields, theta: Array, rest: Array, into: PETSc.Mat | None = None) -> PETSc.Mat:
    """A diag(theta) - B diag(rest), in A's sparsity. Collective."""
    into = fields.A.copy(into, PETSc.Mat.Structure.SAME_NONZERO_PATTERN) if into is not None else fields.A.duplicate(copy=True)
    scale = fields.A.createVecRight()
    scale.setArray(theta)
    into.diagonalScale(None, scale)
    void = fields.B.duplicate(copy=True)
    scale.setArray(-rest)
    void.diagonalScale(None, scale)
    into.axpy(1.0, void, structure=PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
    void.destroy()
    scale.destroy()
    return into


def _positive(pc: PETSc.PC, option: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not (np.isfinite(value) and value > 0.0):
        words = f"{', '.join(WEIGHTS)} and positive numbers" if option.endswith("weight") else "positive numbers"
        near = nearest(text, WEIGHTS) if option.endswith("weight") else ""
        raise InputError(f"-{pc.getOptionsPrefix() or ''}{option} {text}: allowed are {words}{near}")
    return value
