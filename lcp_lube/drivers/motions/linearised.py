"""The discrete film, linearised at the signs of a solution: solves with its Jacobian, and what supplies make of them."""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from ...base.compiled import has_numba
from ...base.options import recipe
from ...base.parallel import Array
from ...linear.krylov import Krylov
from ...problems.facts import Facts
from ...problems.film.assembly import assemble
from ...problems.film.flows import volume_unit
from ...problems.film.lubrication import LubricationProblem
from ...registry import SMALL
from ..plan import default_recipe

RTOL = 1e-12  # of an iterative inner solver
Entries = list[tuple[int, int, Array]]


class Linear:
    """J = A where the film is full, -B where it is not, and J + i nu M, solved with for several right-hand sides at once.

    Large films in the plane by multigrid on frozen signs where its cycles converge; else by factors of the matrix, which of
    J + i nu M is a real one of twice the size.
    """

    def __init__(
        self,
        problem: LubricationProblem,
        cavity: NDArray[np.bool_],
        entries: Entries | None = None,
        given: Any = None,
        M: Array | None = None,
        factored: bool = False,
        least: int = 0,
    ):
        """entries : of dG/dp, where that is not A (of a fluid with a law). given : points in a groove, whose rows are those of
        the identity. M : the diagonal of what void is stored (`at`). factored : it is solved with so often that factors pay.
        least : points from which multigrid does; default SMALL."""
        if entries is None and problem.tangent is not None:
            entries = problem.tangent.entries(problem.scheme)
        self.problem, self.cavity, self.entries, self.given, self.M = problem, cavity, entries, given, M
        grid, self.frozen = problem.grid, None
        self.terms: list[float] = []
        apart = entries is None and not factored and (given is None or problem.held is None)
        if apart and grid.dim == 2 and grid.size > (least or SMALL) and has_numba():
            from ...solvers.fas.frozen import Frozen  # here: numba starts with it

            self.frozen = Frozen(problem, cavity, M, given)

    def solve(self, rows: Sequence[Array]) -> list[Array]:
        """J^-1 b for each b. Collective."""
        found = self.frozen and self.frozen.solve(rows)
        return found or [self._factors.of_array(b, RTOL)[0] for b in rows]

    def solve_transposed(self, rows: Sequence[Array], z: Array, sizes: Sequence[float] = ()) -> list[Array]:
        """J'^-1 b for each b; z : the solution, p where the film is full and -r where it is not. Collective.

        sizes : of the quantities, which may be small against the terms of b' z; default as large. Of cycles' answers the
        sizes of these terms are `terms` then."""
        found = self.frozen and self.frozen.solve(rows, transposed=True, z=z, sizes=sizes)
        self.terms = self.frozen.terms if self.frozen and found else []
        return found or [self._factors.of_array(b, RTOL, transposed=True)[0] for b in rows]

    def at(self, nu: float, rows: Sequence[Any], stored: bool = True) -> list[Any]:
        """(J + i nu M)^-1 b for each complex b; stored = False: J^-1 b. Collective."""
        if not stored:
            parts = self.solve([part for b in rows for part in (b.real, b.imag)])
            return [real + 1j * imaginary for real, imaginary in zip(parts[::2], parts[1::2], strict=True)]
        found = self.frozen and self.frozen.solve(rows, nu=nu)
        return found or self._by_matrix(nu, rows)

    @cached_property
    def J(self) -> PETSc.Mat:
        grid, s = self.problem.grid, self.problem.scheme
        (ny, nx), found = grid.box, dict[tuple[int, int], Any]()
        for entries, column in ((self.entries or s.pressure_entries(), ~self.cavity), (s.void_entries(), -1.0 * self.cavity)):
            at = grid.ghosted(column.astype(float), 0.0)
            for dj, di, value in entries:
                part = value * at[1 + dj : 1 + dj + ny, 1 + di : 1 + di + nx]
                found[dj, di] = found[dj, di] + part if (dj, di) in found else part
        J = assemble(grid, [(*place, value) for place, value in found.items()])
        if self.given is not None:
            J.zeroRows((grid.first + np.flatnonzero(self.given)).astype(PETSc.IntType), 1.0)
        return J

    @cached_property
    def _factors(self) -> Krylov:
        return self._factored(self.J, "full" if self.entries is not None else "reduced")  # that is: an M-matrix

    def _by_matrix(self, nu: float, rows: Sequence[Any]) -> list[Any]:
        assert self.M is not None  # for the type checker
        J, n = self.J, self.problem.grid.local_size
        diagonal = J.createVecLeft()
        diagonal.setArray(nu * self.M)
        plus = PETSc.Mat().createAIJ(J.getSizes(), nnz=1, comm=J.comm)
        plus.setDiagonal(diagonal)
        plus.assemble()
        minus = plus.copy()
        minus.scale(-1.0)
        nest = PETSc.Mat().createNest([[J, minus], [plus, J]], comm=J.comm)
        big = nest.convert("aij", PETSc.Mat())
        krylov = self._factored(big)
        found = [krylov.of_array(np.concatenate([b.real, b.imag]), RTOL)[0] for b in rows]
        krylov.destroy()
        for obj in (nest, big, minus, plus, diagonal):
            obj.destroy()
        return [z[:n] + 1j * z[n:] for z in found]

    def _factored(self, mat: PETSc.Mat, system: str = "full") -> Krylov:
        grid = self.problem.grid
        facts = Facts(self.problem.kind, grid.shape, grid.comm.size, grid.periodic)
        with recipe(default_recipe(facts, system, large=False)[0]):
            krylov = Krylov(mat)
            krylov.set_up()
        return krylov

    def destroy(self) -> None:
        for name in ("_factors", "J"):
            if name in self.__dict__:
                self.__dict__[name].destroy()


class Feed:
    """Supplies whose pressures follow: what they add to a change z of the film at given pressures.

    With Z_t the film's answer to a pressure P_t, f_s(z) what supply s gives more for a change z, and the derivatives a_s and
    b_s of `Supply.misfit` by pressure and flow:

        b_s (f_s(z) + raw_s + sum over t of f_s(Z_t) P_t) + a_s P_s = 0,     z -> z + sum over t of Z_t P_t

    raw_s is what the cells of supply s take by themselves: the change of their balance at fixed fields.
    """

    def __init__(self, problem: LubricationProblem, cavity: Any, free: Any):
        held, whole = problem.held, problem.scheme.changed(held=None)
        assert held is not None  # for the type checker: it has supplies
        self.problem, self.cavity, self.held, self.free = problem, cavity, held, np.flatnonzero(free)
        by_p = whole.pressure_entries() if problem.tangent is None else problem.tangent.entries(whole)
        self._A, self._B = assemble(problem.grid, by_p), assemble(problem.grid, whole.void_entries())
        self._unit = volume_unit(problem)

    def pushed(self, t: int) -> Array:
        """Right-hand side of a pressure of 1 Pa in supply t."""
        d = self.problem.scheme.diagonal / self.problem.p_unit
        return np.where(self.held.owner == t, d, 0.0).ravel()

    def taken(self, z: Any, raw: Any = 0.0) -> Any:
        """f_s(z) + raw_s of all supplies, m3/s. Collective."""
        multiply = self.problem.multiply
        flows = raw + 0.0 * z
        for part, turn in ((z.real, 1.0), (z.imag, 1j)) if np.iscomplexobj(z) else ((z, 1.0),):
            full, void = np.where(self.cavity, 0.0, part), np.where(self.cavity, -part, 0.0)
            flows = flows + turn * (multiply(self._A, full) + multiply(self._B, void))
        total = self.problem.reduce.sum
        found = []
        for k in range(len(self.held.supplies)):
            mine = np.where(self.held.owner.ravel() == k, flows, 0.0)
            found.append(complex(total(mine.real), total(mine.imag)) if np.iscomplexobj(mine) else total(mine))
        return self._unit * np.array(found)

    def slopes(self, answers: Any) -> Any:
        """dQ_s/dP_t of the supplies that are free, m3/s/Pa, from the film's answers Z_t. Collective."""
        n = len(self.held.supplies)
        return np.stack([self.taken(z)[self.free] for z in answers], axis=1) if len(answers) else np.zeros((n, 0))

    def corrected(self, z: Any, raw: Any, answers: Any, sources: Array) -> Any:
        """z with the pressures that follow; sources : a and b of all supplies, shape (supplies, 2). Collective."""
        P = following(self.slopes(answers), self.taken(z, raw)[self.free], sources[self.free])
        return z + sum(p * answer for p, answer in zip(P, answers, strict=True))

    def destroy(self) -> None:
        self._A.destroy()
        self._B.destroy()


def following(slopes: Any, taken: Any, sources: Array, off: Any = 0.0) -> Any:
    """P of `Feed`'s equation, of the supplies that are free: their slopes, what they would give at P = 0, their a and b.

    off : what else their misfits change by.
    """
    by_p, by_flow = sources.T
    return np.linalg.solve(by_flow[:, None] * slopes + np.diag(by_p), -by_flow * taken - off)
