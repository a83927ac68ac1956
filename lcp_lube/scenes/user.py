"""A complementarity problem of the user's own, for `solve`: F, its Jacobian, bounds, a start.

import numpy as np
from lcp_lube import Complementarity, solve

problem = Complementarity(lambda x: (x - 1) ** 2 - 1.01, lambda x: np.diag(2 * (x - 1)), lower=[0], upper=[np.inf], x0=[0])
print(solve(problem).fields["v"])       # [2.00498756]
"""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Any, ClassVar

import numpy as np
from mpi4py import MPI
from numpy.typing import ArrayLike
from petsc4py import PETSc
from pydantic import PrivateAttr

from ..base.parallel import Array
from ..base.together import on_all_ranks
from ..errors import InputError
from ..problems.box import BoxProblem
from ..problems.certificate import Certificate, certificate_tol
from ..problems.facts import Facts
from ..problems.grid import Grid
from ..problems.solution import Fields
from .scene import Scene


class Complementarity(Scene):
    """l <= x <= u and F(x): F_i >= 0 where x_i = l_i, F_i <= 0 where x_i = u_i, F_i = 0 between. `solve` takes it as a scene.

    Parameters
    ----------
    F : x -> F(x), arrays of shape (n,).
    J : x -> F'(x): an (n, n) array, a SciPy sparse array, or a PETSc matrix with its whole diagonal stored (its rows where
        lower = upper are overwritten); a sparse one has the same pattern every time.
    lower, upper : bounds, shape (n,); -inf and inf where there are none (both: x_i is free, and F_i(x) = 0 an equation).
    x0 : start, shape (n,); moved into the bounds.

    With a communicator, `solve(problem, comm=...)`, all five are of the rank's own entries, J gives a PETSc matrix of that
    layout, and `n` is the whole number of unknowns. Without one every rank solves by itself. What F or J raises on some of
    several ranks is an InputError on all of them, if it is raised where F and J do not communicate.
    """

    problem_kind: ClassVar[str] = "user"
    F: Callable[[Array], Any]
    J: Callable[[Array], Any]
    lower: Any
    upper: Any
    x0: Any
    n: int
    _dense: bool | None = PrivateAttr(None)

    def __init__(
        self,
        F: Callable[[Array], Any],
        J: Callable[[Array], Any],
        lower: ArrayLike,
        upper: ArrayLike,
        x0: ArrayLike,
        *,
        n: int | None = None,
        name: str = "user",
    ):
        parts = [_vector(value, label) for value, label in ((lower, "lower"), (upper, "upper"), (x0, "x0"))]
        sizes = [part.size for part in parts]
        if len(set(sizes)) > 1 or not sizes[0]:
            raise InputError(f"lower, upper and x0 have {sizes} entries: the same number is needed, at least 1")
        data = {"lower": parts[0], "upper": parts[1], "x0": parts[2], "n": sizes[0] if n is None else n}
        super().__init__(**{"family": "user", "name": name, "F": F, "J": J, **data})

    def data_si(self) -> dict[str, Any]:
        """Its size alone: functions and arrays are the caller's."""
        return {"family": self.family, "n": self.n}

    @property
    def shape(self) -> tuple[int, ...]:
        return (self.n,)

    def facts(self, comm: PETSc.Comm | None = None) -> Facts:
        """Only J itself shows whether it is dense: it is evaluated at the start, once. Collective."""
        if self._dense is None:
            with users_own(comm.tompi4py() if comm else MPI.COMM_SELF, "J(x)"), np.errstate(all="ignore"):
                J = self.J(self.x0)
            self._dense = "dense" in J.getType() if isinstance(J, PETSc.Mat) else not hasattr(J, "tocsr")
        return Facts(self.problem_kind, self.shape, (comm or PETSc.COMM_SELF).getSize(), dense=self._dense)

    def build(self, comm: PETSc.Comm | None = None) -> "UserProblem":
        """The problem on a line of n points. Collective.

        Raises
        ------
        InputError : bounds that cross, a start that is no number, F or J of a wrong shape, parts that don't fit the ranks.
        """
        grid = Grid((self.n,), (self.n + 1.0,), comm or PETSc.COMM_SELF)
        sizes = list(zip(grid.comm.allgather(self.x0.size), np.diff(grid.starts), strict=True))
        for rank, (given, owned) in enumerate(sizes):  # all ranks look at all of them, and raise together
            if given != owned:
                raise InputError(f"x0 has {given} entries on rank {rank}, which owns {owned} of {self.n}")
        return UserProblem(grid, self.F, self.J, self.lower, self.upper, self.x0)


def users_own(comm: MPI.Comm, what: str) -> AbstractContextManager[None]:
    """A call of the user's function: on one rank its exception is the caller's own, on more an InputError on all of them."""
    if comm.size == 1:
        return nullcontext()
    return on_all_ranks(comm, what, caught=(Exception,))


class UserProblem(BoxProblem):
    """The box problem behind a `Complementarity`; where l = u the equation is x = l.

    dense: J gives dense matrices, for LAPACK.
    """

    kind = "user"

    def __init__(self, grid: Grid, F: Callable[[Array], Any], J: Callable[[Array], Any], lower: Array, upper: Array, x0: Array):
        self._F, self._J, self._bounds, self._fixed = F, J, (lower, upper), lower == upper
        self._any_fixed = grid.reduce.sum(self._fixed.astype(float)) > 0
        self._mat: PETSc.Mat | None = None
        super().__init__(grid, lower, upper, x0)
        # An equation x = l needs no bounds, and interior methods no inside of its box.
        self.lower, self.upper = np.where(self._fixed, -np.inf, lower), np.where(self._fixed, np.inf, upper)
        self.dense = "dense" in self.jacobian(self.v0).getType()

    def __reduce__(self) -> tuple[Any, ...]:
        return UserProblem, (self.grid, self._F, self._J, *self._bounds, self.v0)

    def residual(self, v: Array) -> Array:
        """F(v). Collective.

        Raises
        ------
        InputError : F gives no vector of n real numbers.
        """
        # inf and NaN are reported by the outer loop, or avoided by the line search
        with users_own(self.grid.comm, "F(x)"), np.errstate(all="ignore"):
            F = _vector(self._F(v), "F(x)")
            if F.size != v.size:
                raise InputError(f"F(x) has {F.size} entries, x has {v.size}")
        return np.where(self._fixed, v - self._bounds[0], F)

    def jacobian(self, v: Array) -> PETSc.Mat:
        """F'(v). Collective.

        Raises
        ------
        InputError : J gives no n-by-n matrix, or a sparse one of another pattern than before.
        """
        with users_own(self.grid.comm, "J(x)"), np.errstate(all="ignore"):
            J = self._J(v)
        mat = J if isinstance(J, PETSc.Mat) else self._sparse(J) if hasattr(J, "tocsr") else self._of_dense(J)
        if self._any_fixed:
            mat.setOption(PETSc.Mat.Option.KEEP_NONZERO_PATTERN, True)
            mat.zeroRows((self.grid.first + np.flatnonzero(self._fixed)).astype(PETSc.IntType), 1.0)
        return mat

    def _of_dense(self, J: Any) -> PETSc.Mat:
        values = np.asarray(J, dtype=float)
        n = self.grid.size
        if values.shape != (n, n):
            raise InputError(f"J(x) has shape {values.shape}: {(n, n)} is needed")
        if self._mat is None:
            self._mat = self._own(PETSc.Mat().createDense((n, n), comm=self.grid.petsc_comm))
            self._mat.setUp()
        self._mat.getDenseArray()[:] = values
        self._mat.assemble()
        return self._mat

    def _sparse(self, J: Any) -> PETSc.Mat:
        csr = J.tocsr()
        n = self.grid.size
        if csr.shape != (n, n):
            raise InputError(f"J(x) has shape {csr.shape}: {(n, n)} is needed")
        if self._mat is None:
            self._mat = self._own(_aij(csr, self.grid.petsc_comm))
        self._mat.zeroEntries()
        try:
            self._mat.setValuesCSR(csr.indptr.astype(PETSc.IntType), csr.indices.astype(PETSc.IntType), csr.data.astype(float))
        except PETSc.Error:
            raise InputError("J(x) has entries where the first one had none: store its zeros too, or let J be dense") from None
        self._mat.assemble()
        return self._mat

    def scale(self, v: Array) -> float:
        """F is the user's: its own units count."""
        return 1.0

    def certify(self, fields: Fields, eps1: float) -> Certificate:
        """Certificate of v, in the units of F. Collective.

        residual: largest natural residual |mid(v - u, F, v - l)|;
        rounding: the machine's epsilon times ||F'|| ||v|| (largest row sum, largest entry), below which F says nothing:
        iterates that run off to infinity may have F = 0 by rounding alone.
        """
        v = fields["v"]
        rows = self.jacobian(v).norm(PETSc.NormType.NORM_INFINITY)
        return Certificate(
            measures={
                "residual": self.reduce.max(np.abs(self.natural_residual(v, self.residual(v)))),
                "rounding": float(np.finfo(float).eps) * rows * self.reduce.max(np.abs(v)),
            },
            tol=certificate_tol(eps1),
        )


def _vector(value: Any, label: str) -> Array:
    """A new vector of floats."""
    try:
        if np.iscomplexobj(value):
            raise TypeError
        vector = np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{label}: a sequence of real numbers is needed") from None
    if vector.ndim != 1:
        raise InputError(f"{label} has shape {vector.shape}: one dimension is needed")
    return vector


def _aij(csr: Any, comm: PETSc.Comm) -> PETSc.Mat:
    """An empty PETSc matrix with the pattern of a SciPy one and the whole diagonal, which PETSc wants to be stored."""
    from scipy.sparse import csr_array, eye_array

    ones = csr_array((np.ones(csr.indices.size), csr.indices, csr.indptr), shape=csr.shape)
    pattern = (ones + eye_array(csr.shape[0])).tocsr()
    pattern.sort_indices()
    parts = (pattern.indptr.astype(PETSc.IntType), pattern.indices.astype(PETSc.IntType), np.zeros(pattern.nnz))
    return PETSc.Mat().createAIJ(csr.shape, csr=parts, comm=comm)
