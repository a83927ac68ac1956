"""The textured slider by what else is at hand: SciPy and PETSc's own complementarity solvers.

    python benchmarks/peers.py [K] [--peers scipy,ssls,...]

Every peer gets the same equations, A p + B r = c as our package assembled them, and its answer is judged by our certificate:
residual ||A p + B r - c||/(||A p|| + ||B r|| + ||c||), complementarity, mass balance. Assembly is not in the seconds of anyone.

- scipy: the plain active set on the n-by-n matrix [A on full cells, -B on cavitated ones] by scipy.sparse.linalg.splu, that is
  SuperLU with its default ordering COLAMD; scipy_mmd: the same with MMD_AT_PLUS_A, made for symmetric patterns.
- ssls, rsls: PETSc's SNES vinewtonssls and vinewtonrsls on the 2n unknowns (p free, F1 = 0; r >= 0, F2 = p) point by point,
  with LU; tao_ssils: PETSc's TAO ssils on the same.

The 2n form's rows of F1 are divided by diag(A), p is in bar: merit functions that add up squares want them alike.
"""

import argparse
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter, process_time

import numpy as np
import petsc4py
import scipy.sparse as sp
from scipy.sparse.linalg import splu

if __name__ == "__main__":
    petsc4py.init(sys.argv[:1])

from petsc4py import PETSc

from lcp_lube import load_scene
from lcp_lube.base.parallel import Array
from lcp_lube.problems.film.lubrication import LubricationProblem

LU = {"ksp_type": "preonly", "pc_type": "lu", "pc_factor_mat_solver_type": "umfpack"}
TOL = 1e-8  # of ||F1||/||c||, as in our runs
MAX_IT = 200


@dataclass(frozen=True)
class Answer:
    """p and r in the problem's units, the peer's steps, and its own words if it failed."""

    p: Array
    r: Array
    iterations: int
    failure: str = ""


def matrix(mat: PETSc.Mat) -> sp.csr_matrix:
    """A PETSc matrix on one rank as SciPy's."""
    pointers, columns, values = mat.getValuesCSR()
    return sp.csr_matrix((values, columns, pointers), shape=mat.getSize())


def scipy_active_set(problem: LubricationProblem, ordering: str = "COLAMD") -> Answer:
    """Full film first; then cells with p < 0 cavitate and cells with r < 0 fill, all at once, until none changes."""
    A, B, c = matrix(problem.A), matrix(problem.B), problem.c
    full, steps, changed = np.ones(problem.size), 0, True
    while changed and steps < MAX_IT:
        J = (A @ sp.diags(full) - B @ sp.diags(1.0 - full)).tocsc()
        J.eliminate_zeros()
        z = splu(J, permc_spec=ordering).solve(c)
        steps, changed = steps + 1, bool(((z >= 0) != full).any())
        full = (z >= 0).astype(float)
    return Answer(np.maximum(z, 0.0), np.maximum(-z, 0.0), steps, f"cells still change after {MAX_IT} steps" if changed else "")


class MixedForm:
    """The 2n unknowns p_i, r_i side by side: p free and F1 = 0, its rows divided by diag(A); r >= 0, F2 = p >= 0, p r = 0."""

    start = (0.0, 0.1)  # p and r everywhere

    def __init__(self, problem: LubricationProblem):
        A, B, n = matrix(problem.A), matrix(problem.B), problem.size
        scale = sp.diags(1.0 / A.diagonal())
        i = np.arange(n)
        at_p, at_r = (sp.csr_matrix((np.ones(n), (2 * i + k, i)), shape=(2 * n, n)) for k in (0, 1))
        # A tiny number keeps a place on every diagonal: the semismooth methods add to it.
        places = sp.diags(np.full(n, 1e-300))
        M = (at_p @ (scale @ A) + at_r) @ at_p.T + (at_p @ (scale @ B) + at_r @ places) @ at_r.T
        M = M.tocsr()
        M.sort_indices()
        csr = (M.indptr.astype(PETSc.IntType), M.indices.astype(PETSc.IntType), M.data)
        self.J = PETSc.Mat().createAIJ((2 * n, 2 * n), csr=csr, comm=PETSc.COMM_SELF)
        self._original = self.J.duplicate(copy=True)
        self.q = at_p @ (scale @ problem.c)
        self.x, self.lower = self.J.createVecs()
        self.upper = self.x.duplicate()
        self.lower.setArray(at_p @ np.full(n, PETSc.NINFINITY))
        self.upper.set(PETSc.INFINITY)
        # The best of fifteen starts for the semismooth peers on the textured slider: p = 1 bar, r = 0 takes them three to five
        # times the steps. (On problems 1 and 4 it is among the worst: precision_peers.py tries several.)
        self.x.setArray(at_p @ np.full(n, self.start[0]) + at_r @ np.full(n, self.start[1]))

    def function(self, solver: object, x: PETSc.Vec, f: PETSc.Vec) -> None:
        self._original.mult(x, f)
        f.setArray(f.array_r - self.q)

    def jacobian(self, solver: object, x: PETSc.Vec, J: PETSc.Mat, P: PETSc.Mat) -> None:
        self._original.copy(J)

    def answer(self, iterations: int, reason: int) -> Answer:
        x = self.x.array_r
        out = Answer(x[::2].copy(), x[1::2].copy(), iterations, "" if reason > 0 else f"PETSc's reason {reason}")
        for obj in (self.J, self._original, self.x, self.lower, self.upper):
            obj.destroy()
        return out


@contextmanager
def options(values: dict[str, str]) -> Iterator[None]:
    """PETSc options for a while."""
    database = PETSc.Options()
    for name, value in values.items():
        database[name] = value
    try:
        yield
    finally:
        for name in values:
            database.delValue(name)


def snes(problem: LubricationProblem, kind: str) -> Answer:
    """PETSc's SNES of that type with LU."""
    form = MixedForm(problem)
    solver = PETSc.SNES().create(PETSc.COMM_SELF)
    with options(LU):
        solver.setType(kind)
        solver.setFunction(form.function, form.J.createVecLeft())
        solver.setJacobian(form.jacobian, form.J, form.J)
        solver.setVariableBounds(form.lower, form.upper)
        size = float(np.linalg.norm(form.q))
        solver.setTolerances(rtol=1e-14, atol=TOL * size, stol=0.0, max_it=MAX_IT)
        solver.setFromOptions()
        solver.solve(None, form.x)
    iterations, reason = solver.getIterationNumber(), solver.getConvergedReason()
    solver.destroy()
    return form.answer(iterations, reason)


def tao(problem: LubricationProblem, kind: str) -> Answer:
    """PETSc's TAO of that type with LU."""
    form = MixedForm(problem)
    solver = PETSc.TAO().create(PETSc.COMM_SELF)
    with options({f"tao_{name}" if name.startswith("no") else name: value for name, value in LU.items()}):
        solver.setType(kind)
        solver.setConstraints(form.function, form.J.createVecLeft())
        solver.setJacobian(form.jacobian, form.J, form.J)
        solver.setVariableBounds(form.lower, form.upper)
        solver.setSolution(form.x)
        solver.setTolerances(gatol=TOL * float(np.linalg.norm(form.q)), grtol=0.0, gttol=0.0)
        solver.setMaximumIterations(MAX_IT)
        solver.setFromOptions()
        solver.solve()
    iterations, reason = solver.getIterationNumber(), solver.getConvergedReason()
    solver.destroy()
    return form.answer(iterations, reason)


PEERS: dict[str, Callable[[LubricationProblem], Answer]] = {
    "scipy": scipy_active_set,
    "scipy_mmd": lambda problem: scipy_active_set(problem, "MMD_AT_PLUS_A"),
    "ssls": lambda problem: snes(problem, "vinewtonssls"),
    "rsls": lambda problem: snes(problem, "vinewtonrsls"),
    "tao_ssils": lambda problem: tao(problem, "ssils"),
}


def run(name: str, problem: LubricationProblem) -> dict[str, object]:
    """One peer's seconds, steps and what our certificate says of its answer."""
    wall, cpu = perf_counter(), process_time()
    try:
        answer = PEERS[name](problem)
    except (PETSc.Error, RuntimeError, MemoryError) as error:
        lines = str(error).strip().splitlines()
        return {"outcome": "failed", "message": lines[-1] if lines else type(error).__name__}
    wall, cpu = perf_counter() - wall, process_time() - cpu
    certificate = problem.certify({"p": answer.p, "r": answer.r}, TOL)
    p = answer.p * problem.p_unit
    force = float(np.sum(p - problem.p_sides[0])) * problem.grid.cell
    return {
        "outcome": "failed" if answer.failure or not certificate.holds else "converged",
        "message": answer.failure or certificate.failure,
        "wall_s": wall,
        "cpu_s": cpu,
        "iterations": answer.iterations,
        "p_max": p.max() + problem.p_c,
        "force": force,
        **certificate.measures,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("K", type=int, nargs="?", default=4)
    parser.add_argument("--peers", default=",".join(PEERS))
    arguments = parser.parse_args()
    problem = load_scene("textured_slider", {"K": arguments.K}).build()
    for name in arguments.peers.split(","):
        row = run(name, problem)
        print(name, "  ".join(f"{k} {v:.10g}" if isinstance(v, float) else f"{k} {v}" for k, v in row.items()), flush=True)
    problem.destroy()


if __name__ == "__main__":
    main()
