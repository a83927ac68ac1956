"""Nonlinear multigrid: convergence factors by film and grid, seconds against one linear solve, bytes, options, ranks.

    python benchmarks/fas.py [EXPERIMENT ...] [--quick] [--repeats 3] [--results DIR]

Experiments: factors, linear, points, bytes, options, ranks, threads, small (see EXPERIMENTS); rows go to
benchmarks/results/fas.csv, and cases that stand there already are not run again: another --results begins anew. Every case
is a process of its own. Seconds are medians, by the clock and of the processor; on a machine that others use (`load`) the
second ones are to be trusted. --tables prints the rows of the tables in docs/nonlinear_multigrid_measured.md.
"""

import argparse
import json
import os
import resource
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from statistics import median
from time import perf_counter, process_time, thread_time
from typing import Any

import petsc4py

if __name__ == "__main__":
    petsc4py.init(sys.argv[:1])

import numpy as np
from mpi4py import MPI

from lcp_lube import load_scene, solve
from lcp_lube.base.crew import crew
from lcp_lube.base.options import recipe
from lcp_lube.base.resumable import ResumableCsv
from lcp_lube.base.stages import Stages
from lcp_lube.linear.krylov import Krylov
from lcp_lube.output.results import machine
from lcp_lube.problems.film.lubrication import LubricationProblem
from lcp_lube.solvers.fas.driver import Fas
from lcp_lube.solvers.job import Job
from lcp_lube.solvers.newton import Stopping

Values = dict[str, Any]
KEY = ("experiment", "film", "n", "variant")
COLUMNS = """outcome took_over cycles factor work_units wall_s cpu_s linear_cpu_s ratio_cpu ns_per_point memory_gb p_max
    residual load machine message""".split()  # noqa: SIM905
ROUND = {"p_a": 1e5, "p_b": 1e5, "p_side": 1e5}
# name: (scene, changes); below the line, films on which multigrid is hard.
FILMS: dict[str, tuple[str, Values]] = {
    "problem4": ("problem4", {}),
    "problem4 0.1 MPa": ("problem4", ROUND),
    "journal 0.5": ("journal", {"eccentricity": 0.5}),
    "journal 0.9": ("journal", {"eccentricity": 0.9}),
    "journal 0.99": ("journal", {"eccentricity": 0.99}),
    "dimples 8x8": ("textured_slider", {"K": 8}),
    "dimples 20x20": ("textured_slider", {"K": 20}),
    "rough 2.5 um": ("rough", {}),
    "rough 4 um": ("rough", {"amplitude": 4e-6}),
    "rough ratio 100": ("rough", {"amplitude": 15e-6, "h_floor": 5e-7}),
    "deep dimples 8x8": ("textured_slider", {"K": 8, "depth": 135e-6}),
    "deep dimples 20x20": ("textured_slider", {"K": 20, "depth": 135e-6}),
    "step 10:1": ("bearing", {"h_start_um": 100, "h_end_um": 10}),
    "step 1:10": ("bearing", {"h_start_um": 10, "h_end_um": 100}),
}
LARGEST = ("problem4", "journal 0.9", "dimples 20x20", "rough 2.5 um")  # at 2047 and 4095 a side
VARIANTS: dict[str, Values] = {
    "default": {},
    "V": {"cycle": "V"},
    "W": {"cycle": "W"},
    "no front sweeps": {"front": 0},
    "4 front sweeps": {"front": 4},
    "20 front sweeps": {"front": 20},
    "no truncation": {"truncation": "none"},
    "truncation points": {"truncation": "points"},
    "linear weights": {"weights": "linear"},
    "1+2 sweeps": {"pre": 1, "post": 2},
    "1+1 sweeps": {"pre": 1, "post": 1},
}


class Step:
    """A step of the film at 60 % of the length."""

    def __init__(self, before: float, behind: float):
        self.before, self.behind = before, behind

    def __call__(self, x: Any, y: Any = 0.0) -> np.ndarray:
        return np.where(np.asarray(x) + 0 * np.asarray(y) < 0.06, self.before, self.behind)


def problem_of(film: str, n: int) -> LubricationProblem:
    """The film's problem on n x n points."""
    name, changes = FILMS[film]
    if name != "bearing":
        return load_scene(name, {**changes, "nx": n, "ny": n}).build()
    from lcp_lube.problems.film.reynolds import box_scheme
    from lcp_lube.problems.grid import Grid

    step = Step(changes["h_start_um"] * 1e-6, changes["h_end_um"] * 1e-6)
    grid, sides = Grid((n, n), (0.1, 0.1)), (1e5,) * 4
    scheme = box_scheme(grid, step, mu=0.015, U=5.0, scheme="face", p_sides=sides, p_unit=1e6)
    return LubricationProblem(grid, scheme, mu=0.015, U=5.0, p_unit=1e6, p_sides=sides, p_c=0.0, film=step)


def cycles(problem: LubricationProblem, eps1: float, most: int = 40, **options: Any) -> tuple[Fas, str]:
    """Multigrid alone, without anybody to take over; and how it ended."""
    run, taken = Fas(Job(problem, Stages(), options=options, stopping=Stopping(eps1))), 0
    try:
        while run.norm > eps1 and taken < most:
            run.advance()
            taken += 1
    except ArithmeticError as error:
        return run, str(error)
    return run, "" if run.norm <= eps1 else f"not converged after {most} cycles"


def measured(run: Fas, message: str) -> Values:
    """A finished run as a row."""
    details = run.details
    residual = run.problem.certify(run.fields, 1e-10).measures["residual"]
    return {
        "outcome": "stalled" if "stalled" in message else "as far as asked" if message else "converged",
        "cycles": details["cycles"],
        "factor": details["convergence_factor"],
        "work_units": details["work_units"],
        "residual": residual,
        "message": message,
    }


def timed(call: Callable[[], Any]) -> tuple[Any, float, float]:
    """The result, seconds by the clock and of the processor."""
    wall, cpu = perf_counter(), process_time()
    result = call()
    return result, perf_counter() - wall, process_time() - cpu


def warm() -> None:
    """Compile, or read what was compiled before."""
    for film in ("problem4", "dimples 8x8"):
        problem = problem_of(film, 40)
        run, _ = cycles(problem, 1e-8)
        problem.certify(run.fields, 1e-8)
        problem.destroy()


def factors(film: str, n: int, variant: str, repeats: int) -> Values:
    """Cycles to 1e-10; where they stall, what the whole run with its hand-over does."""
    problem = problem_of(film, n)
    (run, message), wall, cpu = timed(lambda: cycles(problem, 1e-10, **VARIANTS[variant]))
    values = {**measured(run, message), "wall_s": wall, "cpu_s": cpu}
    problem.destroy()
    if message and FILMS[film][0] != "bearing" and n <= 511 and variant == "default":
        name, changes = FILMS[film]
        solution = solve(load_scene(name, {**changes, "nx": n, "ny": n}), method="fas")
        own, steps = solution.settings["details"]["cycles"] + 1, solution.iterations
        values["took_over"] = f"{solution.settings['method']} {steps - own} steps: {solution.outcome}"
        solution.destroy()
    return values


def full_film(problem: LubricationProblem) -> None:
    """A p = c, cavitation ignored, by BiCGStab and BoomerAMG from scratch to rtol 1e-8: the yardstick."""
    with recipe("bcgs_amg"):
        krylov = Krylov(problem.A)
        x, b = problem.A.createVecs()
        b.setArray(problem.c)
        krylov.solve(b, x, 1e-8)
        for obj in (krylov, x, b):
            obj.destroy()


def linear(film: str, n: int, variant: str, repeats: int) -> Values:
    """Full multigrid alone, or all cycles to 1e-8, and one linear solve, in turn, without the problem's coefficients."""
    most = 1 if variant == "full multigrid" else 40
    problem, rows = problem_of(film, n), []
    full_film(problem)
    for _ in range(repeats):
        (run, message), wall, cpu = timed(lambda: cycles(problem, 1e-8, most))
        _, _, linear_cpu = timed(lambda: full_film(problem))
        rows.append((wall, cpu, linear_cpu, cpu / linear_cpu))
    wall, cpu, linear_cpu, ratio = (median(column) for column in zip(*rows, strict=True))
    values = {**measured(run, message), "p_max": run.fields["p"].max() * problem.p_unit}
    problem.destroy()
    return {**values, "wall_s": wall, "cpu_s": cpu, "linear_cpu_s": linear_cpu, "ratio_cpu": ratio}


def points(film: str, n: int, variant: str, repeats: int) -> Values:
    """A whole run, from the scene to the certificate, to 1e-6, with its peak memory."""
    name, changes = FILMS[film]
    rows = []
    for _ in range(repeats if n < 4000 else 1):
        scene = load_scene(name, {**changes, "nx": n, "ny": n})
        solution, wall, cpu = timed(lambda: solve(scene, method="fas", stopping={"eps1": 1e-6}))  # noqa: B023
        rows.append((wall, cpu))
        details = solution.settings["details"]
        values = {
            "outcome": str(solution.outcome),
            "cycles": details["cycles"],
            "factor": details["convergence_factor"],
            "work_units": details["work_units"],
            "residual": solution.certificate.measures["residual"],
            "message": " ".join(f"{stage.replace(' ', '-')}:{seconds:.3g}" for stage, seconds in solution.times.items()),
        }
        solution.destroy()
    wall, cpu = (median(column) for column in zip(*rows, strict=True))
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    return {**values, "wall_s": wall, "cpu_s": cpu, "ns_per_point": 1e9 * cpu / n**2, "memory_gb": memory}


def bytes_moved(film: str, n: int, variant: str, repeats: int) -> Values:
    """One, or three sweeps of the finest grid, against the time that its 40 bytes a point and sweep take (copying arrays); by
    several threads by the clock, against as many that copy."""
    problem = problem_of(film, n)
    run, _ = cycles(problem, 1e-3, 2)
    run._finest.take_back(run._levels[0], problem, run.fields)  # z, which the certificate has done without
    level, sweep, count, own = run._levels[0], run._loops.sweep, int(variant.split()[0]), crew().threads
    clock, part = (perf_counter if own > 1 else thread_time), 8_000_000 // own
    source, target = np.ones(8_000_000), np.zeros(8_000_000)

    def best(call: Callable[[], Any]) -> float:
        seconds = []
        for _ in range(7):
            begin = clock()
            call()
            seconds.append(clock() - begin)
        return min(seconds)

    def copy(k: int) -> None:
        np.copyto(target[k * part : (k + 1) * part], source[k * part : (k + 1) * part])

    per_byte = best(lambda: crew().run(copy, own)) / (24 * part * own)  # read, written, and read before it is written
    seconds = best(lambda: sweep(level.z, level.kx, level.ky, level.c, count, False, level.carry, False))
    values = {"wall_s" if own > 1 else "cpu_s": seconds, "ns_per_point": 1e9 * seconds / n**2, "outcome": "measured"}
    moved = 40 * n**2 * per_byte
    values["ratio_cpu"] = seconds / moved
    values["message"] = f"{1e-9 / per_byte:.1f} GB/s; {seconds / moved / count:.2f} of the time of {count} passes' bytes"
    problem.destroy()
    return values


def ranks(film: str, n: int, variant: str, repeats: int) -> Values:
    """Cycles to 1e-8 on so many ranks, without the problem's coefficients: the slowest rank's seconds."""
    comm, rows = MPI.COMM_WORLD, []
    problem = problem_of(film, n)
    for _ in range(repeats):
        comm.barrier()
        (run, message), wall, cpu = timed(lambda: cycles(problem, 1e-8))
        rows.append((comm.allreduce(wall, MPI.MAX), comm.allreduce(cpu, MPI.MAX)))
    wall, cpu = (median(column) for column in zip(*rows, strict=True))
    values = {**measured(run, message), "wall_s": wall, "cpu_s": cpu}
    problem.destroy()
    return values


def small(film: str, n: int, variant: str, repeats: int) -> Values:
    """200 solves of a small film in one process, each with another speed and its load read off: seconds of one."""
    scene, loads = load_scene(film, {"n": n}), []

    def solves() -> None:
        for k in range(200):
            with solve(scene, U=scene.U * (1.0 + 1e-3 * k)) as solution:
                loads.append(solution.load if variant == "with numbers" else len(solution.steps))

    solves()
    wall, cpu = (median(column) for column in zip(*(timed(solves)[1:] for _ in range(repeats)), strict=True))
    return {"outcome": "converged", "wall_s": wall / 200, "cpu_s": cpu / 200}


EXPERIMENTS: dict[str, Callable[[str, int, str, int], Values]] = {
    "factors": factors,
    "options": factors,
    "linear": linear,
    "points": points,
    "bytes": bytes_moved,
    "ranks": ranks,
    "threads": points,
    "small": small,
}


def cases(experiment: str, quick: bool) -> Iterator[tuple[str, int, str]]:
    """Film, points a side and variant of an experiment's cases."""
    if experiment == "factors":
        for n in (63,) if quick else (127, 255, 511, 1023, 2047, 4095):
            for film in FILMS:
                if n < 2000 or film in LARGEST:
                    yield film, n, "default"
    elif experiment == "options":
        for film in ("problem4",) if quick else ("journal 0.5", "dimples 20x20", "rough 2.5 um"):
            for variant in VARIANTS:
                yield film, 63 if quick else 511, variant
    elif experiment == "linear":
        for variant in ("full multigrid", "to 1e-8"):
            yield "problem4", 63 if quick else 1023, variant
    elif experiment == "points":
        for n in (63,) if quick else (255, 511, 1023, 2047, 4095):
            yield "problem4", n, "to 1e-6"
    elif experiment == "bytes":
        for variant in ("1 sweep", "3 sweeps in one pass", "3 sweeps by 2 threads"):
            yield "problem4", 127 if quick else 2047, variant
    elif experiment in ("ranks", "threads"):
        for variant in ("1", "2"):
            yield "problem4", 127 if quick else 2047, variant
    elif experiment == "small":
        for film, n in (("problem1", 100), ("problem4", 60)):
            for variant in ("solved", "with numbers"):
                yield film, n, variant


def child(experiment: str, case: tuple[str, int, str], repeats: int) -> Values:
    """A case in a process of its own, or on several ranks."""
    command = [sys.executable, __file__, "--job", json.dumps([experiment, *case]), "--repeats", str(repeats)]
    if experiment == "ranks" and case[2] != "1":
        command = [shutil.which("mpiexec") or "mpiexec", "-n", case[2], *command]
    threads = case[2] if experiment == "threads" else "2" if "2 threads" in case[2] else "1"
    environment = {"OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": threads}
    done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, **environment})
    if done.returncode:
        return {"outcome": "failed", "message": (done.stderr.strip().splitlines() or ["nothing said"])[-1]}
    return json.loads(done.stdout.splitlines()[-1])


def tables(rows: list[dict[str, str]]) -> Iterator[str]:
    """Lines of the two tables of docs/nonlinear_multigrid_measured.md that follow from rows by film and grid."""
    of = {(row["experiment"], row["film"], int(row["n"])): row for row in rows}
    for film in FILMS:
        found = [of.get(("factors", film, n)) for n in (127, 255, 511, 1023, 2047, 4095)]
        cells = [f"{float(row['factor']):.2f} ({row['cycles']})" if row and row["factor"] else "" for row in found]
        yield f"| {film} | {' | '.join(cells)} |"
    for name, column in (("cycles to 1e-6", "cycles"), ("ns a point, all of it", "ns_per_point")):
        found = [of.get(("points", "problem4", n)) for n in (255, 511, 1023, 2047, 4095)]
        yield f"| {name} | {' | '.join(f'{float(row[column]):.0f}' if row else '' for row in found)} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("experiments", nargs="*", help=f"any of {', '.join(EXPERIMENTS)}; default all")
    parser.add_argument("--quick", action="store_true", help="small grids, in a csv file of their own")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--results", type=Path, default=Path(__file__).parent / "results")
    parser.add_argument("--tables", action="store_true", help="print the rows of the tables in the docs, and run nothing")
    parser.add_argument("--job", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.job:
        experiment, film, n, variant = json.loads(arguments.job)
        warm()
        values = EXPERIMENTS[experiment](film, n, variant, arguments.repeats)
        if MPI.COMM_WORLD.rank == 0:
            print(json.dumps({key: str(value) for key, value in values.items()}))
        return
    for name in arguments.experiments:
        if name not in EXPERIMENTS:
            parser.error(f"{name}: allowed are {', '.join(EXPERIMENTS)}")
    store = ResumableCsv(arguments.results / f"fas{'_quick' * arguments.quick}.csv", [*KEY, *COLUMNS], KEY, signed=True)
    if arguments.tables:
        print("\n".join(tables(store.rows)))
        return
    for experiment in arguments.experiments or EXPERIMENTS:
        for film, n, variant in cases(experiment, arguments.quick):
            key = {"experiment": experiment, "film": film, "n": n, "variant": variant}
            row = store.find(**key)
            if row is None:
                values = child(experiment, (film, n, variant), 1 if arguments.quick else arguments.repeats)
                row = store.add({**values, **key, "load": f"{os.getloadavg()[0]:.1f}", "machine": machine()})
            shown = (f"{name} {row[name]}" for name in (*KEY, *COLUMNS) if row[name] and name not in ("machine", "experiment"))
            print(experiment, "  ".join(shown), store.age(row), flush=True)


if __name__ == "__main__":
    main()
