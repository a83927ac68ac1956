"""What the charts share: where their runs are kept, and one run as a row."""

import os
from collections.abc import Sequence
from datetime import date
from hashlib import sha256
from importlib.util import find_spec
from math import isfinite
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

from mpi4py import MPI

from ..api import solve
from ..base.options import LATE, set_names
from ..base.resumable import ResumableCsv
from ..errors import InputError
from ..output.results import as_dict, machine, versions
from ..problems.solution import Outcome, Step
from ..scenes.scene import Scene
from .compare import exact_errors, read_off
from .reference import WRONG, Reference

# Outcomes of the charts, beside those of `Outcome`: left by us (two), and solved, but by the method's fallback.
KRYLOV_LIMIT, TIME_LIMIT, FELL_BACK = "krylov_limit", "time_limit", "fell_back"
RECORD = """outcome iterations linear_iterations centrality backtracking c1 c2 ksp_type pc_type load rupture min_p min_r
    machine load_average petsc date message""".split()  # noqa: SIM905


def open_store(path: Path, key: Sequence[str], columns: Sequence[str]) -> ResumableCsv:
    """The csv of a chart, with the columns `key`, `columns` and RECORD. Collective.

    Raises InputError where matplotlib is missing, PETSc options are set that would change every run, or the csv cannot be read.
    """
    if find_spec("matplotlib") is None:
        raise InputError("chart: pictures need matplotlib: pip install lcp-lube[plot]")
    refuse_options("the runs of a chart")
    return ResumableCsv(path, [*key, *columns, *RECORD], key)


def refuse_options(runs: str) -> None:
    """Raise InputError where PETSc options are set that would change every run."""
    if foreign := sorted(set_names() - LATE):
        raise InputError(f"-{foreign[0]}: {runs} bring their own inner solvers")


def scene_key(scene: Scene) -> tuple[str, str]:
    """A scene's name, and a digest of its data but for the grid: a scene file that was edited is run again."""
    data = scene.model_dump_json(exclude={"name", "n", "nx", "ny"}, exclude_defaults=True)
    return scene.name, sha256(data.encode()).hexdigest()[:8]


def environment() -> dict[str, str]:
    """What a run's seconds depend on, and when it was made."""
    load = f"{os.getloadavg()[0]:.1f}"  # jobs that wanted a core when the run had ended
    return {"machine": machine(), "load_average": load, "petsc": versions()["petsc"], "date": date.today().isoformat()}


class _Enough(Exception):
    """Leaves a run from within its monitor; its argument is the outcome."""


def run(
    scene: Scene,
    krylov_limit: float = float("inf"),
    reference: Reference | None = None,
    steps: list[Step] | None = None,
    cpu_limit: float = float("inf"),
    **choices: Any,
) -> dict[str, Any]:
    """One run, however it ends: RECORD, `wall_s`, `cpu_s` (this rank's), errors and the rest of the JSON's keys. Collective.

    Further keys: `read_off` (`compare.read_off`), `points`, `krylov`: Krylov iterations on all grids. `iterations` are those of
    all grids too. A run that is refused raises InputError.

    Parameters
    ----------
    krylov_limit : the run is left after the step in which its Krylov iterations pass this number; of its answer nothing is
        then known. Counted in iterations, not in seconds: a limit that falls on the same step on every machine.
    reference : gives `distance` and `reference`; a certified answer that is as far from it as WRONG is a wrong one.
    steps : filled with the record of every step.
    cpu_limit : as `krylov_limit`, in seconds of the processor (of the rank that used most), where what is measured is seconds.
    """
    steps = [] if steps is None else steps

    def monitor(k: int, step: Step) -> None:
        steps.append(step)
        if sum(step.linear_iterations for step in steps) > krylov_limit:
            raise _Enough(KRYLOV_LIMIT)
        if isfinite(cpu_limit) and MPI.COMM_WORLD.allreduce(process_time() - cpu_begin, MPI.MAX) > cpu_limit:
            raise _Enough(TIME_LIMIT)

    begin, cpu_begin = perf_counter(), process_time()
    try:
        solution = solve(scene, monitor=monitor, **choices)
    except _Enough as enough:
        limit = f"{krylov_limit:,.0f} Krylov iterations" if enough.args[0] == KRYLOV_LIMIT else f"{cpu_limit:g} s"
        counts = {name: sum(getattr(s, name) for s in steps) for name in ("linear_iterations", "centrality", "backtracking")}
        return {
            **{**environment(), **counts, "iterations": len(steps), "krylov": counts["linear_iterations"]},
            **{"wall_s": perf_counter() - begin, "cpu_s": process_time() - cpu_begin},
            **{"outcome": enough.args[0], "c1": steps[-1].norm, "c2": steps[-1].step_norm},
            "message": f"left after {limit} with ||F|| = {steps[-1].norm:.2e}",
        }
    clocks = {"wall_s": solution.times["total"], "cpu_s": process_time() - cpu_begin}
    with solution:
        data = as_dict(solution)
        # 'auto' is all that it does; of a method that was asked for by name a rescue by another one is a failure.
        rescued = solution.took_over and choices.get("method", "auto") != "auto"
        outcome: dict[str, Any] = {"outcome": FELL_BACK} if rescued else {}
        if reference is not None:
            far = reference.distance(solution.problem, solution.fields)
            outcome |= {"distance": None if far is None else f"{far:.3e}", "reference": reference.how}
            if solution.converged and (not reference.solvable or (far is not None and not far <= WRONG)):
                why = f"{far:.1e} from the reference" if far is not None else "although there is no solution"
                outcome |= {"outcome": Outcome.WRONG_SOLUTION, "message": f"{solution.message}, {why}"}
        more = {
            "iterations": len(steps),
            "read_off": read_off(solution.problem, data),
            "points": solution.problem.grid.size,
            "krylov": sum(step.linear_iterations for step in steps),
        }
        return {**environment(), **data, **exact_errors(solution.problem, data), **more, **clocks, **outcome}
