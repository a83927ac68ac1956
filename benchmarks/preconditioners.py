"""The inner solvers of DIN side by side: Krylov iterations and seconds of every recipe on problems 1 and 4.

    python benchmarks/preconditioners.py
    mpiexec -n 2 python benchmarks/preconditioners.py      (and -n 4: block Jacobi, the paper's parallel case)

eps1 = eps2 = 1e-4, as tables 8 to 11 of the paper, which names GMRES with block Jacobi and ILU for its
parallel runs. Every run is a row of benchmarks/results/preconditioners.csv, and
rows that are there are not run again. A failure is a row with its reason; a recipe that failed is not tried on larger grids,
and a run is left after LIMIT Krylov iterations. Seconds are medians of three runs where one takes less than 5 s. At its end the
script writes the tables between the two marks in benchmarks/README.md.
"""

import os
import statistics
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import petsc4py
from mpi4py import MPI

if __name__ == "__main__":
    petsc4py.init(sys.argv[:1])

from lcp_lube.base.resumable import ResumableCsv, Row
from lcp_lube.scenes.scene import load_scene
from lcp_lube.solvers.newton import Stopping
from lcp_lube.studies.experiment import KRYLOV_LIMIT, run

HERE = Path(__file__).parent
KEY = ("problem", "n", "system", "recipe", "ranks")
COLUMNS = (*KEY, *"outcome iterations linear_iterations wall_s cpu_s p_max machine petsc message".split())  # noqa: SIM905
CASES = (("problem1", 1000), ("problem1", 10_000), ("problem4", 50), ("problem4", 100), ("problem4", 200))
RECIPES = {
    "full": """superlu mumps gmres_ilu bcgs_ilu jacobi sor augmentation augmentation_identity augmentation_amg saddle_jacobi
        saddle_gs saddle_approx saddle_amg fieldsplit_schur fieldsplit_gamg fieldsplit_schur_p
        fieldsplit_multiplicative ainv""",
    "reduced": "superlu jacobi sor bcgs_jacobi bcgs_bjacobi bcgs_amg",
}
PARALLEL = "bjacobi"  # the recipe that runs on several ranks
RANKS = (1, 2, 4)
LIMIT = 50_000
PARALLEL_LIMIT = 200_000
MARKS = "<!-- preconditioners: begin -->", "<!-- preconditioners: end -->"


def measure(problem: str, n: int, system: str, recipe: str) -> dict[str, Any]:
    """One row: the first of the runs, with the median seconds of all."""
    scene = load_scene(problem, {"n": n})
    results: list[dict[str, Any]] = []
    while not results or (len(results) < 3 and results[0]["wall_s"] < 5.0 and MPI.COMM_WORLD.size == 1):
        results.append(
            run(
                scene,
                PARALLEL_LIMIT if recipe == PARALLEL else LIMIT,
                method="din",
                system=system,
                recipe=recipe,
                stopping=Stopping(1e-4, 1e-4),
                nested=False,
            )
        )
    seconds = {key: f"{statistics.median(result[key] for result in results):.4g}" for key in ("wall_s", "cpu_s")}
    key = {"problem": problem, "n": n, "system": system, "recipe": recipe, "ranks": MPI.COMM_WORLD.size}
    return {**results[0], **seconds, **key}


def fill(store: ResumableCsv) -> None:
    """Run what is missing for this number of ranks, smallest grids first. Collective."""
    comm = MPI.COMM_WORLD
    pairs = [(system, recipe) for system, recipes in RECIPES.items() for recipe in recipes.split()]
    for system, recipe in [*(pairs if comm.size == 1 else []), ("full", PARALLEL)]:
        failed: dict[str, str] = {}
        for problem, n in CASES:
            case: dict[str, Any] = {"problem": problem, "n": n, "system": system, "recipe": recipe}
            row = store.find(**case, ranks=comm.size)
            if row is None and problem in failed:
                reason = {"outcome": "skipped", "message": f"failed for n = {failed[problem]}"}
                row = store.add({**case, "ranks": comm.size, **reason})
            elif row is None:
                row = store.add(measure(**case))
                if comm.rank == 0:
                    print(" ".join(row[name] for name in COLUMNS[:9]), row["message"], flush=True)
            if row["outcome"] != "converged":
                failed.setdefault(problem, row["n"])


def cell(row: Row | None) -> str:
    """'Krylov iterations; seconds', or why there are none."""
    if row is None:
        return ""
    if row["outcome"] == "converged":
        return f"{int(row['linear_iterations']):,}; {float(row['cpu_s']):.2g} s"
    if row["outcome"] == KRYLOV_LIMIT:
        return f"over {PARALLEL_LIMIT if row['recipe'] == PARALLEL else LIMIT:,} its"
    return {"skipped": "—", "linear_solver": f"fails at step {int(row['iterations'] or 0) + 1}"}.get(
        row["outcome"], row["outcome"].replace("_", " ")
    )


def tables(store: ResumableCsv) -> Iterable[str]:
    """Markdown: a table a system, a line a recipe."""
    for system, recipes in RECIPES.items():
        yield f"\nDIN, {system} system: Krylov iterations of the whole run; processor seconds of the whole run\n"
        yield "| recipe | " + " | ".join(f"{problem}, n = {n:,}" for problem, n in CASES) + " |"
        yield "|---|" + "---|" * len(CASES)
        for recipe in recipes.split():
            cells = (cell(store.find(problem=p, n=n, system=system, recipe=recipe, ranks=1)) for p, n in CASES)
            yield f"| `{recipe}` | " + " | ".join(cells) + " |"
    yield f"\nDIN, full system, GMRES(30) with block Jacobi, ILU(0) in each rank's block (`{PARALLEL}`)\n"
    yield "| ranks | " + " | ".join(f"{problem}, n = {n:,}" for problem, n in CASES) + " |"
    yield "|---|" + "---|" * len(CASES)
    for ranks in RANKS:
        found = (store.find(problem=p, n=n, system="full", recipe=PARALLEL, ranks=ranks) for p, n in CASES)
        yield f"| {ranks} | " + " | ".join(map(cell, found)) + " |"
    yield f"\n{store.ages()}.\n"


def write_readme(path: Path, lines: Iterable[str]) -> None:
    """Replace what stands between the two marks."""
    before, begin, rest = path.read_text(encoding="utf-8").partition(MARKS[0])
    _, end, after = rest.partition(MARKS[1])
    if not (begin and end):
        print(f"{path}: no marks {MARKS[0]} and {MARKS[1]}; nothing written")
        return
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    temporary.write_text("\n".join([before + begin, *lines, end + after]), encoding="utf-8")
    os.replace(temporary, path)


def main() -> None:
    store = ResumableCsv(HERE / "results" / "preconditioners.csv", COLUMNS, KEY, signed=True)
    fill(store)
    if MPI.COMM_WORLD.rank == 0:
        lines = list(tables(store))
        print("\n".join(lines))
        write_readme(HERE / "README.md", lines)


if __name__ == "__main__":
    main()
