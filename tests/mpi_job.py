"""Run under mpiexec by the tests: checks of distributed grids, then solves whose records and fields go to a folder.

mpiexec -n 3 python tests/mpi_job.py OUT     writes OUT/record.json and OUT/fields.npz
"""

import json
import sys
import traceback
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

# name: (scene, changes, method, recipe); sizes that no number of ranks divides.
DIRECT: dict[str, tuple[str, dict[str, Any], str, str]] = {
    "line": ("problem1", {"n": 53}, "din", "mumps"),
    "line_superlu_dist": ("problem3", {"n": 31}, "din", "superlu_dist"),
    "plane": ("problem4", {"nx": 19, "ny": 17}, "din", "mumps"),
    "small": ("problem4", {"nx": 7, "ny": 5}, "din", "superlu_dist"),
    "flat": ("problem4", {"nx": 31, "ny": 1, "scheme": "face"}, "din", "mumps"),
}
ITERATIVE = {"bjacobi": "full", "asm": "reduced"}  # recipe: system


def natural(grid: Any) -> np.ndarray:
    """Number of each owned point in the order of the whole grid, x fastest."""
    i = np.arange(grid.x_start, grid.x_end)[None, :]
    j = np.arange(grid.y_start, grid.y_end)[:, None]
    return (j * grid.shape[0] + i).ravel()


def whole(grid: Any, owned: np.ndarray) -> np.ndarray:
    """A field in the order of the whole grid, on every rank."""
    out = np.empty(grid.size)
    for where, values in grid.comm.allgather((natural(grid), owned)):
        out[where] = values
    return out


def check_grid(shape: tuple[int, ...]) -> list[str]:
    """What is wrong with this rank's part of a grid."""
    from petsc4py import PETSc

    from lcp_lube.problems.grid import Grid

    grid = Grid(shape, (1.0, 3.0)[: len(shape)])
    number = natural(grid).reshape(grid.box)
    # Natural numbers with a frame of -1: what ghosted() and neighbours() must show, whoever owns the neighbour.
    nx, ny = shape[0], shape[1] if len(shape) == 2 else 1
    frame = np.full((ny + 2, nx + 2), -1)
    frame[1:-1, 1:-1] = np.arange(nx * ny).reshape(ny, nx)
    expected = frame[grid.y_start : grid.y_end + 2, grid.x_start : grid.x_end + 2]
    cross = np.ones(expected.shape, dtype=bool)
    cross[[0, 0, -1, -1], [0, -1, 0, -1]] = False  # corners are not to be used
    ghosted = np.nan_to_num(grid.ghosted(number.ravel().astype(float)), nan=-1).astype(int)
    numbers = grid.neighbours()
    application = grid.dm.getAO().petsc2app(numbers.ravel().astype(PETSc.IntType)).reshape(numbers.shape)
    faults = {
        "x": not np.allclose(grid.x, (number % nx + 1)[:1] / (nx + 1)),
        "y": len(shape) == 2 and not np.allclose(grid.y, 3 * (number // nx + 1)[:, :1] / (ny + 1)),
        "ghosted": not np.array_equal(ghosted[cross], expected[cross]),
        "neighbours": not np.array_equal(np.where(numbers < 0, -1, application)[cross], expected[cross]),
        "first": numbers[1, 1] != grid.first,
        "sum": grid.reduce.sum(number.ravel().astype(float)) != grid.size * (grid.size - 1) / 2,
        "extrema": (grid.reduce.min(number.ravel()), grid.reduce.max(number.ravel())) != (0, grid.size - 1),
    }
    nan = np.where(number.ravel() == grid.size - 1, np.nan, 1.0)  # on the last rank only
    faults["NaN"] = not (np.isnan(grid.reduce.min(nan)) and np.isnan(grid.reduce.max(nan)))
    grid.destroy()
    return [f"{shape}, rank {MPI.COMM_WORLD.rank}: {name}" for name, wrong in faults.items() if wrong]


def run(
    scene: str, changes: dict[str, Any], method: str, recipe: str, system: str = "full"
) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Record and whole fields of one solve; the options that nobody read are in the record."""
    from lcp_lube import load_scene, solve
    from lcp_lube.base.options import unread

    left: list[str] = []
    solution = solve(
        load_scene(scene, changes),
        method=method,
        system=system,
        recipe=recipe,
        nested=False,
        monitor=lambda k, step: left.extend(unread() if k == 1 else []),
    )
    grid = solution.problem.grid
    fields = {name: whole(grid, values) for name, values in solution.fields.items()}
    record = {
        "counts": [solution.iterations, solution.total("backtracking"), solution.total("centrality")],
        "outcome": str(solution.outcome),
        "message": solution.message,
        "unread": left,
        **solution.problem.quantities(solution.fields),
        **solution.certificate.measures,
    }
    solution.destroy()
    return record, fields


def main(out: Path) -> None:
    from recipes import attempt, one_rank

    from lcp_lube.registry import recipe_names

    shapes: list[tuple[int, ...]] = [(3,), (10,), (101,), (5, 3), (3, 7), (7, 5), (53, 41)]
    faults = MPI.COMM_WORLD.allgather([fault for shape in shapes for fault in check_grid(shape)])
    record: dict[str, Any] = {"grid_faults": [fault for rank in faults for fault in rank]}
    fields: dict[str, np.ndarray] = {}
    for name, case in DIRECT.items():
        record[name], found = run(*case)
        fields |= {f"{name}_{field}": values for field, values in found.items()}
    if MPI.COMM_WORLD.size == 2:
        # A few steps: whether every option is read shows in the first; convergence is tested on one rank, and below.
        # With three, another method takes over from the active set with GAMG of PETSc 3.26.
        record["recipes"] = {name: attempt(name, max_it=5) for name in recipe_names() if not one_rank(name)}
    for name, system in ITERATIVE.items():
        record[name] = run("problem4", {"nx": 23, "ny": 17}, "din", name, system)[0]
    if MPI.COMM_WORLD.rank == 0:
        np.savez(out / "fields.npz", **fields)
        (out / "record.json").write_text(json.dumps(record))


if __name__ == "__main__":
    try:
        main(Path(sys.argv[1]))
    except Exception:
        traceback.print_exc()
        sys.stderr.flush()
        MPI.COMM_WORLD.Abort(1)
