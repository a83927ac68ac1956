"""Obstacle Bratu with both obstacles touched: our nested active set and multigrid, and PETSc's own VI solver, in turn.

    python benchmarks/obstacle_peer.py [--n 1023] [--repeats 3] [-ksp_type ... for the peer]

The peer is what a PETSc user would write: SNES vinewtonrsls with GMRES and BoomerAMG, grid-sequenced by hand over the
same grids 31, 63, ..., each started from the interpolated answer of the one before, with the same code for f and f'
(matrix products and one exponential, at C speed). Residuals are computed here from the data, the same way for both.
Seconds are wall and CPU, on one core; on a shared machine the ratio of the CPU seconds is the one to trust. Rows go to
benchmarks/results/obstacle_peer.csv.
"""

import argparse
import os
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import petsc4py

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--n", type=int, default=1023, help="points a side, 2^k - 1")
    parser.add_argument("--repeats", type=int, default=3)
    ARGUMENTS, rest = parser.parse_known_args()
    petsc4py.init([sys.argv[0], *rest])

import numpy as np
from petsc4py import PETSc

from lcp_lube import load_scene, solve
from lcp_lube.base.resumable import ResumableCsv
from lcp_lube.output.results import machine
from lcp_lube.problems.obstacle import ObstacleProblem
from lcp_lube.scenes.obstacle import ObstacleScene

SCENE = {"lambda": 6.0, "v_upper": 0.3, "v_lower": "0.28 - 10*((x - 0.2)^2 + (y - 0.2)^2)"}
COARSEST = 31
RESULTS = Path(__file__).parent / "results"
COLUMNS = """solver n wall_s cpu_s iterations linear_iterations natural_residual scaled_residual contact_lower
    contact_upper sum_v""".split()  # noqa: SIM905


@dataclass(frozen=True)
class Result:
    """v on the finest grid, and iterations on every grid."""

    v: np.ndarray
    iterations: list[int]
    linear_iterations: list[int]


def grids(n: int) -> list[int]:
    """Points a side from the coarsest grid to n = 2^k - 1."""
    sizes = [n]
    while sizes[0] > COARSEST:
        sizes.insert(0, (sizes[0] - 1) // 2)
    return sizes


def problem_of(n: int) -> ObstacleProblem:
    """The problem on n x n points."""
    scene = load_scene("obstacle_bratu", {**SCENE, "n": n})
    assert isinstance(scene, ObstacleScene)
    return scene.build()


def peer(n: int) -> Result:
    """vinewtonrsls on every grid in turn, from v = 0.01 on the coarsest one."""
    options = PETSc.Options()
    defaults = {"ksp_type": "gmres", "pc_type": "hypre", "pc_hypre_type": "boomeramg"}
    added = [name for name in defaults if not options.hasName(name)]
    for name in added:
        options[name] = defaults[name]
    coarse, v = None, np.empty(0)
    iterations, linear = [], []
    for size in grids(n):
        problem = problem_of(size)
        v = problem.v0 if coarse is None else problem.prolong(coarse, {"v": v}, False)["v"]
        snes = _vi_solver(problem)
        x = snes.getFunction()[0].duplicate()
        x.setArray(v)
        snes.solve(None, x)
        if snes.getConvergedReason() <= 0:
            raise RuntimeError(f"the peer failed on {size} x {size}: reason {snes.getConvergedReason()}")
        iterations.append(snes.getIterationNumber())
        linear.append(snes.getLinearSolveIterations())
        v, coarse = x.array_r.copy(), problem
        snes.destroy()
    for name in added:
        options.delValue(name)
    return Result(v, iterations, linear)


def _vi_solver(problem: ObstacleProblem) -> PETSc.SNES:
    """The peer on one grid: f, f' and the bounds of the problem, everything else from PETSc's options."""

    def function(snes: PETSc.SNES, x: PETSc.Vec, f: PETSc.Vec) -> None:
        f.setArray(problem.residual(x.array_r))

    def jacobian(snes: PETSc.SNES, x: PETSc.Vec, J: PETSc.Mat, P: PETSc.Mat) -> None:
        problem.jacobian(x.array_r)  # J itself, refreshed

    J = problem.jacobian(problem.v0)
    f, lower, upper = (J.createVecLeft() for _ in range(3))
    lower.setArray(problem.lower)
    upper.setArray(problem.upper)
    snes = PETSc.SNES().create()
    snes.setType("vinewtonrsls")
    snes.setFunction(function, f)
    snes.setJacobian(jacobian, J, J)
    snes.setVariableBounds(lower, upper)
    snes.setFromOptions()
    return snes


def ours(n: int) -> Result:
    """The scene by its default method and recipe, nested."""
    solution = solve(load_scene("obstacle_bratu", {**SCENE, "n": n}), nested=True, stopping={"eps1": 1e-9})
    if not solution.converged:
        raise RuntimeError(solution.message)
    levels = solution.levels
    out = Result(
        solution.fields["v"],
        [level["iterations"] for level in levels],
        [level["linear_iterations"] for level in levels],
    )
    solution.destroy()
    return out


def multigrid(n: int) -> Result:
    """The scene by nonlinear multigrid."""
    scene = load_scene("obstacle_bratu", {**SCENE, "n": n})
    solution = solve(scene, method="fas")
    if not solution.converged or solution.took_over:
        raise RuntimeError(solution.message)
    out = Result(solution.fields["v"], [level["iterations"] for level in solution.levels], [0])
    solution.destroy()
    return out


def judge(n: int, v: np.ndarray) -> dict[str, Any]:
    """Natural residual of f as it stands, and of f/(dx dy) = -Lap v - lambda e^v (the stricter one by far); contact; sum."""
    problem = problem_of(n)
    f = problem.residual(v)
    out = {
        "natural_residual": np.abs(problem.natural_residual(v, f)).max(),
        "scaled_residual": np.abs(problem.natural_residual(v, f, f_scale=problem.grid.cell)).max(),
        **problem.quantities({"v": v}),
    }
    problem.destroy()
    return out


def run(n: int, repeats: int) -> list[dict[str, Any]]:
    """Both solvers in turn, `repeats` times; medians."""
    solvers: dict[str, Callable[[int], Result]] = {"ours": ours, "fas": multigrid, "peer": peer}
    seconds: dict[str, list[tuple[float, float]]] = {name: [] for name in solvers}
    found = {}
    for _ in range(repeats):
        for name, solver in solvers.items():
            wall, cpu = time.perf_counter(), time.process_time()
            found[name] = solver(n)
            seconds[name].append((time.perf_counter() - wall, time.process_time() - cpu))
    rows = []
    for name, result in found.items():
        wall, cpu = (statistics.median(column) for column in zip(*seconds[name], strict=True))
        rows.append(
            {
                "solver": name,
                "n": n,
                "wall_s": f"{wall:.2f}",
                "cpu_s": f"{cpu:.2f}",
                "iterations": " ".join(map(str, result.iterations)),
                "linear_iterations": " ".join(map(str, result.linear_iterations)),
                **judge(n, result.v),
            }
        )
    return rows


def main(arguments: argparse.Namespace) -> None:
    store = ResumableCsv(RESULTS / "obstacle_peer.csv", [*COLUMNS, "repeats", "load", "machine"], ("solver", "n"), signed=True)
    rows = run(arguments.n, arguments.repeats)
    for row in rows:
        store.add({**row, "repeats": arguments.repeats, "load": f"{os.getloadavg()[0]:.1f}", "machine": machine()})
        print("  ".join(f"{name} {row[name]}" for name in COLUMNS))
    *own, other = rows
    for row in own:
        for clock in ("wall_s", "cpu_s"):
            print(f"peer / {row['solver']}, {clock}: {float(other[clock]) / float(row[clock]):.2f}")


if __name__ == "__main__":
    main(ARGUMENTS)
