"""Run under mpiexec by the tests: the saddle-point and augmentation preconditioners against dense algebra.

    mpiexec -n 3 python tests/mpi_preconditioners.py

Every rank computes what the preconditioner must give from the gathered matrix, and ends with the names of what differs.
"""

import itertools
import sys
import traceback
from typing import Any

import numpy as np
import petsc4py

if __name__ == "__main__":
    petsc4py.init(sys.argv[:1])

from mpi4py import MPI
from petsc4py import PETSc

from lcp_lube.base.options import recipe
from lcp_lube.linear.full import FullSystem
from lcp_lube.linear.pc.augmentation import AugmentationPC
from lcp_lube.linear.pc.splittings import SaddlePC
from lcp_lube.scenes.scene import load_scene

COMM = MPI.COMM_WORLD
# Scene, changes, sign of D_p and D_r: positive in DIN, negative in Fischer-Burmeister Newton.
CASES: tuple[tuple[str, dict[str, Any], float], ...] = (
    ("problem1", {"n": 11}, 1.0),
    ("problem4", {"nx": 7, "ny": 5, "p_side": 1e5}, -1.0),
    ("problem4", {"nx": 4, "ny": 9, "scheme": "face"}, 1.0),
)


SERIAL = COMM.size == 1  # all combinations of options; on several ranks those that communicate in their own way


def gathered(mat: PETSc.Mat) -> np.ndarray:
    """The whole matrix, dense, on every rank."""
    pointers, columns, values = mat.getValuesCSR()
    local = np.zeros((pointers.size - 1, mat.getSize()[1]))
    local[np.repeat(np.arange(local.shape[0]), np.diff(pointers)), columns] = values
    return np.concatenate(COMM.allgather(local))


def system_with(problem: Any, sign: float, seed: int = 0) -> FullSystem:
    """A Newton system with random diagonals of one sign, small and large, different on every rank."""
    rng = np.random.default_rng([seed, COMM.rank])
    system = FullSystem(problem)
    D_p, D_r = (sign * 10.0 ** rng.uniform(-3, 1, problem.grid.local_size) for _ in range(2))
    zero = np.zeros(problem.grid.local_size)
    system.solve(D_p, D_r, zero, zero, 1e-2)
    return system


def apply(kind: type, system: FullSystem, options: dict[str, str], g: np.ndarray) -> np.ndarray:
    """P^-1 g, whole, for g whole."""
    database = PETSc.Options()
    for name, value in options.items():
        database[f"test_{name}"] = value
    pc = PETSc.PC().create(system.mat.comm)
    pc.setOptionsPrefix("test_")
    pc.setOperators(system.mat)
    pc.setType("python")
    context = kind()
    pc.setPythonContext(context)
    context.setFromOptions(pc)
    pc.setUp()
    x, y = system.mat.createVecs()
    first, last = system.mat.getOwnershipRange()
    x.setArray(g[first:last])
    pc.apply(x, y)
    out = np.concatenate(COMM.allgather(y.array_r.copy()))
    for obj in (pc, x, y):
        obj.destroy()
    for name in options:
        database.delValue(f"test_{name}")
    return out


def blocks(system: FullSystem) -> tuple[np.ndarray, tuple[np.ndarray, ...], tuple[np.ndarray, np.ndarray]]:
    """The owner of every point, A, B, R, P dense, and the places of p and r in a vector."""
    K = gathered(system.mat)
    p, r = (np.concatenate(COMM.allgather(system.fields[name].indices)) for name in ("p", "r"))
    owner = np.repeat(np.arange(COMM.size), COMM.allgather(system.problem.grid.local_size))
    return owner, tuple(K[np.ix_(i, j)] for i in (p, r) for j in (p, r)), (p, r)


def check_saddle(system: FullSystem, g: np.ndarray) -> list[str]:
    """Which variants of the saddle-point preconditioner differ from the inverse they stand for."""
    owner, (A, B, R, P), (p, r) = blocks(system)
    faults = []
    forms = ("full", "triangular", "diagonal") if SERIAL else ("full",)
    kinds = itertools.product(("jacobi", "gauss_seidel", "none"), ("exact", "lines", "diagonal"), forms)
    for splitting, schur, form in kinds:
        if (splitting, schur) == ("none", "exact"):
            continue
        own = owner[:, None] == owner[None, :]
        F = {"jacobi": np.diag(np.diag(A)), "gauss_seidel": np.tril(A) * own, "none": A}[splitting]
        S: np.ndarray = P - R @ np.linalg.solve(F if schur == "exact" else np.diag(np.diag(A)), B)
        S = np.diag(np.diag(S)) if schur == "diagonal" else S
        second = g[r] - R @ np.linalg.solve(F, g[p]) if form == "full" else g[r]
        y = np.linalg.solve(S, second)
        expected = np.empty_like(g)
        expected[p], expected[r] = np.linalg.solve(F, g[p] - (B @ y if form != "diagonal" else 0.0)), y
        given = {"pc_saddle_splitting": splitting, "pc_saddle_schur": schur, "pc_saddle_form": form}
        if splitting == "none":
            given["saddle_pc_type"] = "redundant"
        if not np.allclose(apply(SaddlePC, system, given, g), expected, rtol=1e-8, atol=1e-10 * np.abs(expected).max()):
            faults.append(f"saddle {splitting} {schur} {form}")
    return faults


def check_augmentation(system: FullSystem, g: np.ndarray, sign: float) -> list[str]:
    """The same for the augmentation preconditioner, of [A B; -R -P] for a negated second row where the signs ask for it."""
    _, (A, B, R, P), (p, r) = blocks(system)
    R, P, g2 = sign * R, sign * P, -sign * g[r]  # the second row of [A B; -R -P](p, r) = (g1, -g2)
    faults = []
    weights, scales = (("p", "identity", "0.5"), ("true", "false")) if SERIAL else (("p",), ("true",))
    for form, weight, scale in itertools.product(("triangular", "diagonal", "full"), weights, scales):
        if form == "full" and (weight, scale) != ("p", "true"):
            continue
        W = P if weight == "p" else np.eye(len(P)) * (1.0 if weight == "identity" else 0.5)
        S: np.ndarray = A - B @ np.linalg.solve(W, R)
        zero = np.zeros_like(A)
        M = {
            "triangular": np.block([[S, B], [zero, -W]]),
            "diagonal": np.block([[S, zero], [zero, W]]),
            "full": np.block([[A, B], [-R, -P]]),
        }[form]
        expected = np.empty_like(g)
        expected[p], expected[r] = np.split(np.linalg.solve(M, np.concatenate([g[p], g2])), 2)
        given = {"pc_augmentation_form": form, "pc_augmentation_weight": weight, "pc_augmentation_scale": scale}
        given["augmentation_pc_type"] = "redundant"
        if not np.allclose(apply(AugmentationPC, system, given, g), expected, rtol=1e-7, atol=1e-10 * np.abs(expected).max()):
            faults.append(f"augmentation {form} {weight} {scale}")
    return faults


def main() -> list[str]:
    faults = []
    for name, changes, sign in CASES:
        problem = load_scene(name, changes).build()
        with recipe("mumps"):
            system = system_with(problem, sign)
        g: np.ndarray = np.random.default_rng(1).standard_normal(problem.unknowns)
        for fault in check_saddle(system, g) + check_augmentation(system, g, sign):
            faults.append(f"{name} {changes}, sign {sign:+.0f}, {COMM.size} ranks: {fault}")
        system.destroy()
        problem.destroy()
    return faults


if __name__ == "__main__":
    try:
        found = main()
    except Exception:
        traceback.print_exc()
        sys.stderr.flush()
        COMM.Abort(1)
    if found and COMM.rank == 0:
        print("\n".join(found))
    sys.exit(bool(found))
