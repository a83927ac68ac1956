"""What the package costs: whole solves against one linear solve, against other codes, against the paper, and how both grow.

    python benchmarks/performance.py [EXPERIMENT ...] [--quick] [--repeats 3] [--results DIR]

Experiments: grids, films, peers, tables, line, cycles, krylov, auto (see EXPERIMENTS). Every case is a process of its own, so
that its peak memory is its own; whatever is divided by one another ran alternately in that process. Seconds are medians, by
the clock and of the processor: the second one is to be trusted where other jobs were on the machine (`load`). Cases that
stand in performance.csv (or peers.csv) already are not run again.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from time import perf_counter, process_time
from typing import Any

import petsc4py

if __name__ == "__main__":
    petsc4py.init(sys.argv[:1])

from peers import options  # benchmarks/peers.py
from peers import run as run_peer

from lcp_lube import load_scene, solve
from lcp_lube.base.options import recipe
from lcp_lube.base.resumable import ResumableCsv, Row
from lcp_lube.linear import cavity
from lcp_lube.linear.krylov import Krylov
from lcp_lube.output.results import machine, versions
from lcp_lube.output.table import table
from lcp_lube.problems.film.lubrication import LubricationProblem
from lcp_lube.registry import PACKAGE
from lcp_lube.solvers.newton import Stopping
from lcp_lube.studies.tables import PUBLISHED

Values = dict[str, Any]
KEY = ("experiment", "scene", "n", "variant")
COLUMNS = """runs wall_s cpu_s linear_wall_s linear_cpu_s ratio_wall ratio_cpu outcome iterations finest linear_iterations
    most_linear bytes_per_unknown p_max force residual complementarity printed_s stages load machine petsc message""".split()  # noqa: SIM905
LONG = 60.0  # processor seconds; a longer peer is run once
LINEAR_RTOL = 1e-8


@dataclass(frozen=True)
class Case:
    """A process: a scene, the values changed in it, and what is run on it."""

    experiment: str
    scene: str
    changes: Values
    variants: tuple[str, ...]  # rows of the csv

    @property
    def n(self) -> int:
        return int(self.changes.get("n") or self.changes["K"])


# Ours: what `auto` does (on half the width of symmetric films), and two methods on the whole film.
WHOLE: dict[str, Values] = {"default": {}, "fas": {"method": "fas"}, "active-set": {"method": "active-set"}}


def timed(call: Callable[[], Any]) -> tuple[Any, float, float]:
    """The result, seconds by the clock and of the processor."""
    wall, cpu = perf_counter(), process_time()
    result = call()
    return result, perf_counter() - wall, process_time() - cpu


def peak() -> int:
    """Largest resident memory of this process so far in bytes."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def ours(case: Case, **choices: Any) -> Values:
    """One solve of the case's scene, as a row; the fields are dropped."""
    before = peak()
    solution, wall, cpu = timed(lambda: solve(load_scene(case.scene, case.changes), **choices))
    p = solution.fields["p"] * solution.problem.p_unit
    values = {
        "wall_s": wall,
        "cpu_s": cpu,
        "outcome": str(solution.outcome),
        "message": solution.message,
        "iterations": " ".join(str(level["iterations"]) for level in solution.levels) or solution.iterations,
        "finest": solution.iterations,
        "linear_iterations": solution.total("linear_iterations"),
        "most_linear": max((step.linear_iterations for step in solution.steps), default=0),
        "bytes_per_unknown": (peak() - before) / solution.problem.unknowns,
        "p_max": p.max() + solution.problem.p_c,
        "force": float((p - solution.problem.p_sides[0]).sum()) * solution.problem.grid.cell,
        **solution.certificate.measures,
        "stages": " ".join(f"{name.replace(' ', '-')}:{seconds:.3g}" for name, seconds in solution.times.items()),
    }
    solution.destroy()
    return values


def full_film(problem: LubricationProblem) -> int:
    """A p = c, cavitation ignored, by the same KSP from scratch to rtol 1e-8: the yardstick. Returns its iterations."""
    with recipe("bcgs_amg"):
        krylov = Krylov(problem.A)
        x, b = problem.A.createVecs()
        b.setArray(problem.c)
        iterations = krylov.solve(b, x, LINEAR_RTOL)
        krylov.destroy()
        x.destroy()
        b.destroy()
    return iterations


def medians(runs: list[Values]) -> Values:
    """The first run's values with the medians of all runs' numbers of seconds; peak memory is the first one's."""
    clocks = [name for name in runs[0] if name.endswith("_s")]
    return {**runs[0], **{name: median(run[name] for run in runs) for name in clocks}, "runs": len(runs)}


def against_linear(case: Case, repeats: int) -> dict[str, Values]:
    """Whole solves and full-film linear solves in turn."""
    runs: dict[str, list[Values]] = {name: [] for name in case.variants}
    problem = load_scene(case.scene, case.changes).build()
    for _ in range(repeats):
        values = {name: ours(case, **WHOLE[name]) for name in runs}
        assert problem.A.assembled  # made at first use: here, outside the yardstick's time
        _, wall, cpu = timed(lambda: full_film(problem))
        for name, done in runs.items():
            done.append({**values[name], "linear_wall_s": wall, "linear_cpu_s": cpu})
    problem.destroy()
    out = {name: medians(done) for name, done in runs.items()}
    for name, done in runs.items():
        for clock in ("wall", "cpu"):
            out[name][f"ratio_{clock}"] = median(run[f"{clock}_s"] / run[f"linear_{clock}_s"] for run in done)
    return out


def against_peers(case: Case, repeats: int) -> dict[str, Values]:
    """Ours and every peer in turn; ratios are the peer's seconds over ours. Assembly counts for us and not for them."""
    runs: dict[str, list[Values]] = {name: [] for name in case.variants}
    for _ in range(repeats):
        for name, done in runs.items():
            if done and (done[-1]["outcome"] != "converged" or done[-1]["cpu_s"] > LONG):
                continue
            if name in WHOLE:
                done.append(ours(case, **WHOLE[name]))
                continue
            problem = load_scene(case.scene, case.changes).build()
            assert problem.A.assembled and problem.B.assembled  # made at first use: here, outside the peer's time
            done.append(run_peer(name, problem))
            problem.destroy()
    out = {name: medians(done) for name, done in runs.items()}
    for values in out.values():
        for clock in ("wall_s", "cpu_s"):
            if clock in values:
                values[f"ratio_{clock[:-2]}"] = values[clock] / out["default"][clock]
    return out


def every_recipe(case: Case, repeats: int) -> dict[str, Values]:
    """Methods and recipes on a problem of tables 8 to 11 at the tables' tolerance."""
    out = {}
    for variant in case.variants:
        method, system, inner = variant.split("/")
        runs: list[Values] = []
        while len(runs) < (repeats if not runs or runs[0]["cpu_s"] < 1.0 else 1):
            runs.append(ours(case, method=method, system=system, recipe=inner, nested=False, stopping=Stopping(1e-4, 1e-4)))
        out[variant] = {**medians(runs), "printed_s": printed(case, method, system, inner)}
    return out


def printed(case: Case, method: str, system: str, inner: str) -> str:
    """Seconds that tables 8 to 11 print for this run."""
    if (method, system) != ("din", "full"):
        return ""
    tables = {"problem1": (8, 9, 10), "problem4": (11,)}[case.scene]
    for k in tables:
        lines = (PUBLISHED / "mezzadri_galligani_2018" / f"table{k}.csv").read_text().splitlines()
        head = lines[0].split(",")
        for line in lines[1:]:
            row = dict(zip(head, line.split(","), strict=True))
            if row["n"] == str(case.n) and row.get("solver", "lu") == inner:
                return row["time_s"]
    return ""


def alone(case: Case, repeats: int) -> dict[str, Values]:
    """The default run."""
    return {case.variants[0]: medians([ours(case) for _ in range(repeats)])}


def near_null_cycles(case: Case, repeats: int) -> dict[str, Values]:
    """The active set from a cold start with so many cycles for the near-null vector, every inner solve to 1e-8."""
    out = {}
    default = cavity.CYCLES
    with options({"ksp_rtol": "1e-8"}):  # wins over the method's own tolerances
        for variant in case.variants:
            cavity.CYCLES = int(variant)
            choices = {"method": "active-set", "system": "cavity", "recipe": "bcgs_amg"}
            out[variant] = medians([ours(case, nested=False, **choices) for _ in range(repeats)])
    cavity.CYCLES = default
    return out


def true_tolerance(case: Case, repeats: int) -> dict[str, Values]:
    """The active set with every inner solve to 1e-8: are the Krylov iterations of a step bounded on every grid?"""
    with options({"ksp_rtol": "1e-8"}):
        return {case.variants[0]: ours(case, method="active-set")}


FIXED = """active-set/reduced/umfpack/flat active-set/reduced/umfpack/nested active-set/reduced/superlu/flat
    active-set/cavity/umfpack/nested active-set/cavity/bcgs_amg/flat active-set/cavity/bcgs_amg/nested fas//""".split()  # noqa: SIM905


def fixed_choices(case: Case, repeats: int) -> dict[str, Values]:
    """The default and every fixed choice in turn; ratios are the default's seconds over theirs."""
    runs: dict[str, list[Values]] = {name: [] for name in case.variants}
    for _ in range(repeats):
        for name, done in runs.items():
            method, system, inner, levels = (*name.split("/"), "", "", "")[:4] if name != "auto" else ("auto", "", "", "")
            nested = {"nested": True, "flat": False}.get(levels)
            done.append(ours(case, method=method, system=system or "auto", recipe=inner or None, nested=nested))
    out = {name: medians(done) for name, done in runs.items()}
    for values in out.values():
        for clock in ("wall", "cpu"):
            values[f"ratio_{clock}"] = out["auto"][f"{clock}_s"] / values[f"{clock}_s"]
    return out


# Cells a side, and the peers that can do it in reasonable time.
PEER_SETS = (
    (1, "scipy ssls rsls tao_ssils"),
    (4, "scipy scipy_mmd ssls rsls tao_ssils"),
    (20, "scipy ssls rsls"),
    (40, "scipy"),
)
# Recipes of tables 8 to 11 and the package's own, for each system that a method can use.
DIRECT = ("superlu", "mumps", "umfpack")
KRYLOV = ("gmres_ilu", "bcgs_ilu")
EXPERIMENTS: dict[str, Callable[[Case, int], dict[str, Values]]] = {
    "grids": against_linear,
    "films": against_linear,
    "peers": against_peers,
    "tables": every_recipe,
    "line": alone,
    "cycles": near_null_cycles,
    "krylov": true_tolerance,
    "auto": fixed_choices,
}


def cases(experiment: str, quick: bool) -> Iterator[Case]:
    """The cases of an experiment; quick: grids that take a second or two."""
    if experiment == "grids":
        for n in (40, 60) if quick else (250, 500, 1000, 2000):
            yield Case(experiment, "problem4", {"n": n}, tuple(WHOLE))
    elif experiment == "films":
        for n in (60,) if quick else (250, 500, 1000):
            yield Case(experiment, "rough", {"n": n}, tuple(WHOLE))
        for K in (2,) if quick else (8, 20, 32):
            yield Case(experiment, "textured_slider", {"K": K}, tuple(WHOLE))
        if (PACKAGE / "scenes" / "journal.toml").exists():
            for n in (60,) if quick else (250, 500, 1000):
                yield Case(experiment, "journal", {"n": n}, tuple(WHOLE))
    elif experiment == "peers":
        for K, names in PEER_SETS[:1] if quick else PEER_SETS[1:]:
            yield Case(experiment, "textured_slider", {"K": K}, (*WHOLE, *names.split()))
    elif experiment == "tables":
        yield from table_cases(quick)
    elif experiment == "line":
        for name in ("problem1", "problem3"):
            yield Case(experiment, name, {"n": 2000 if quick else 1_000_000}, ("default",))
    elif experiment == "krylov":
        for n in (60,) if quick else (200, 400, 800, 1600):
            for scene in ("textured_slider", "rough", "journal"):
                yield Case(experiment, scene, {"n": n, "K": n // 25} if scene == "textured_slider" else {"n": n}, ("default",))
    elif experiment == "auto":
        for n in (40,) if quick else (100, 200, 400):
            for scene in ("problem4", "rough", "journal", "textured_slider"):
                changes = {"n": n, "K": max(n // 25, 1)} if scene == "textured_slider" else {"n": n}
                yield Case(experiment, scene, changes, ("auto", *FIXED))
    elif experiment == "cycles":
        for scene, changes in (("textured_slider", {"K": 2 if quick else 8}), ("rough", {"n": 50 if quick else 250})):
            yield Case(experiment, scene, changes, ("0", "1", "2", "3"))


def table_cases(quick: bool) -> Iterator[Case]:
    """Problems 1 and 4 on the tables' grids; the ones that only dense LU or an hour would do are left out."""
    for scene, sizes in {
        "problem1": (50,) if quick else (100, 1000, 10_000),
        "problem4": (10,) if quick else (50, 100),
    }.items():
        for n in sizes:
            inner: dict[str, tuple[str, ...]] = {"full": (*DIRECT, *KRYLOV), "reduced": (*DIRECT, *KRYLOV)}
            if scene == "problem1":
                inner["reduced"] = ("banded", *inner["reduced"])
                if n <= 1000:
                    inner["full"] = ("lu", *inner["full"])
            else:
                inner["reduced"] = ("bcgs_amg", *inner["reduced"])
            variants = [
                f"{m}/{system}/{name}" for m in ("din", "din-pc", "active-set") for system in inner for name in inner[system]
            ]
            if scene == "problem4":
                variants.append("active-set/cavity/bcgs_amg")
            variants += [f"{m}/full/{name}" for m in ("fbn-a", "fbn-i") for name in inner["full"]]
            yield Case("tables", scene, {"n": n}, tuple(variants))


def job(case: Case, repeats: int) -> None:
    """Run a case in this process and print its rows as JSON. What is imported or compiled at first use is so before it."""
    solve(load_scene("problem4", {"n": 24})).destroy()
    for system in ("reduced", "cavity"):
        solve(load_scene("problem4", {"n": 24}), system=system, recipe="bcgs_amg").destroy()
    rows = EXPERIMENTS[case.experiment](case, repeats)
    print(json.dumps({name: {key: str(value) for key, value in row.items()} for name, row in rows.items()}))


def child(case: Case, repeats: int) -> dict[str, Values]:
    """Run a case in a process of its own.

    Raises
    ------
    RuntimeError : the process ended otherwise than it should; its last words.
    """
    text = json.dumps([case.experiment, case.scene, case.changes, case.variants])
    done = subprocess.run([sys.executable, __file__, "--job", text, "--repeats", str(repeats)], capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"exit status {done.returncode}: {(done.stderr.strip().splitlines() or ['nothing said'])[-1]}")
    return json.loads(done.stdout.splitlines()[-1])


def fill(store: ResumableCsv, case: Case, repeats: int) -> list[Row]:
    """The rows of a case, run if one of them is missing."""
    keys = [{"experiment": case.experiment, "scene": case.scene, "n": case.n, "variant": name} for name in case.variants]
    rows = [store.find(**key) for key in keys]
    if None in rows:
        common = {"load": f"{os.getloadavg()[0]:.1f}", "machine": machine(), "petsc": versions()["petsc"]}
        try:
            found = child(case, repeats)
        except RuntimeError as error:
            found = {name: {"outcome": "failed", "message": str(error)} for name in case.variants}
        rows = [store.add({**found[str(key["variant"])], **key, **common}) for key in keys]
    return [row for row in rows if row is not None]


SHOWN = """scene n variant wall_s cpu_s linear_cpu_s ratio_wall ratio_cpu iterations linear_iterations most_linear
    bytes_per_unknown printed_s load outcome""".split()  # noqa: SIM905


def show(rows: list[Row]) -> str:
    """The rows as a table, columns that none of them has left out."""

    def short(text: str) -> str:
        try:
            return text if text.isdigit() else f"{float(text):.4g}"
        except ValueError:
            return text

    names = [name for name in SHOWN if any(row[name] for row in rows)]
    lines = [names, *([short(row[name]) for name in names] for row in rows)]
    return "\n".join(table(lines))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("experiments", nargs="*", help=f"any of {', '.join(EXPERIMENTS)}; default all")
    parser.add_argument("--quick", action="store_true", help="small grids, once each, in csv files of their own")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--results", type=Path, default=Path(__file__).parent / "results")
    parser.add_argument("--job", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.job:
        experiment, scene, changes, variants = json.loads(arguments.job)
        return job(Case(experiment, scene, changes, tuple(variants)), arguments.repeats)
    for name in arguments.experiments:
        if name not in EXPERIMENTS:
            parser.error(f"{name}: allowed are {', '.join(EXPERIMENTS)}")
    for name in arguments.experiments or EXPERIMENTS:
        file = ("peers" if name == "peers" else "performance") + "_quick" * arguments.quick
        store = ResumableCsv(arguments.results / f"{file}.csv", [*KEY, *COLUMNS], KEY, signed=True)
        rows = []
        for case in cases(name, arguments.quick):
            rows += fill(store, case, 1 if arguments.quick else arguments.repeats)
            print(f"{name}: {case.scene} {case.n} done", file=sys.stderr, flush=True)
        print(f"\n{name}:\n{show(rows)}\n{arguments.results / file}.csv: {store.ages()}", flush=True)
    return None


if __name__ == "__main__":
    main()
