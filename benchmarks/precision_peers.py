"""Speed against accuracy of what else is at hand: SciPy and PETSc's own complementarity solvers, in the precision chart.

    python benchmarks/precision_peers.py [SCENE ...] [--peers scipy,ssls,...] [--results DIR] [--quick]

Appends a row a run to the chart's csv, DIR/precision.csv; then `lcp-lube chart precision SCENE ... --results DIR` draws them.
The peers on the 2n form are given the best of STARTS on the smallest grid, and another one where that fails. A peer's seconds
hold the assembly of A and B, as our own runs' do, and its answer is judged by our certificate and measured against the same
known answers (benchmarks/peers.py says what each peer is).
"""

import argparse
import sys
from pathlib import Path
from statistics import median
from time import perf_counter, process_time
from typing import Any

import petsc4py

if __name__ == "__main__":
    petsc4py.init(sys.argv[:1])

import peers  # benchmarks/peers.py
from peers import MAX_IT, PEERS, TOL, Answer
from petsc4py import PETSc

from lcp_lube.problems.film.lubrication import LubricationProblem
from lcp_lube.studies import precision
from lcp_lube.studies.compare import read_off
from lcp_lube.studies.experiment import environment, open_store, scene_key
from lcp_lube.studies.known import RectangleScene, known_answer
from lcp_lube.studies.precision_words import PEER

NAMES = {
    "scipy": ("SciPy active set", "splu COLAMD"),
    "scipy_mmd": ("SciPy active set", "splu MMD_AT_PLUS_A"),
    "ssls": ("SNES vinewtonssls", "umfpack"),
    "rsls": ("SNES vinewtonrsls", "umfpack"),
    "tao_ssils": ("TAO ssils", "umfpack"),
}
# Points a side at most, by dimension: beyond, a run takes minutes (benchmarks/README.md has two of these).
MOST = {
    1: {"scipy": 10**9, "ssls": 2000, "rsls": 1000, "tao_ssils": 2000},
    2: {"scipy": 255, "ssls": 127, "rsls": 63, "tao_ssils": 127},
}


STARTS = [(1.0, 0.1), (1.0, 0.0), (0.0, 0.0), (0.0, 0.1)]  # p in p_unit and r, everywhere


def once(name: str, scene: RectangleScene) -> tuple[dict[str, Any], dict[str, float | None]]:
    """A peer's row but for the errors, and the numbers that it found."""
    wall, cpu = perf_counter(), process_time()
    problem = scene.build()
    assert isinstance(problem, LubricationProblem)
    try:
        try:
            answer: Answer | None = PEERS[name](problem)
            failure = answer.failure if answer else ""
        except (PETSc.Error, RuntimeError, MemoryError) as error:
            answer, failure = None, str(error).strip().splitlines()[-1]
        row: dict[str, Any] = {
            "wall_s": perf_counter() - wall,
            "cpu_s": process_time() - cpu,
            "points": problem.size,
            "krylov": 0,
        }
        if answer is None:
            return row | {"outcome": "linear_solver", "message": failure, "iterations": MAX_IT}, {}
        fields = {"p": answer.p, "r": answer.r}
        certificate = problem.certify(fields, TOL)
        good = certificate.holds and not failure
        outcome = "converged" if good else "max_iterations" if failure else "wrong_solution"
        data = problem.quantities(fields)
        row |= {"outcome": outcome, "message": failure or certificate.failure, "iterations": answer.iterations}
        return row | {key: data[key] for key in ("load", "p_max", "rupture")}, read_off(problem, data)
    finally:
        problem.destroy()


def ranked(name: str, scene: RectangleScene, starts: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """The starts, those first that solve the scene in the fewest steps; the best so far stays first if it solves this one."""
    steps = {}
    for start in starts:
        peers.MixedForm.start = start
        row, _ = once(name, scene)
        steps[start] = row["iterations"] if row["outcome"] == "converged" else 10 * MAX_IT
        if start == starts[0] and starts is not STARTS and steps[start] <= MAX_IT:
            return starts
    return sorted(starts, key=lambda start: steps[start])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument(
        "scenes", nargs="*", default=["problem1", "problem3", "journal", "problem4", "textured_slider", "dimpled_pad"]
    )
    parser.add_argument("--peers", default="scipy,ssls,rsls,tao_ssils")
    parser.add_argument("--results", type=Path, default=Path(__file__).parent / "results")
    parser.add_argument("--quick", action="store_true")
    arguments = parser.parse_args()
    stem = "precision_quick" if arguments.quick else "precision"
    store = open_store(arguments.results / f"{stem}.csv", precision.KEY, precision.COLUMNS)
    for source in arguments.scenes:
        scene = precision.film(source)
        repeats = 1 if arguments.quick else precision.REPEATS
        bench = precision.Bench(
            scene, known_answer(scene, arguments.results / f"{stem}_references.csv", arguments.quick), repeats
        )
        label, data = scene_key(scene)
        dimension = len(scene.shape)
        for name in arguments.peers.split(","):
            method, recipe = NAMES[name]
            starts = [(0.0, 0.0)] if name.startswith("scipy") else STARTS
            for n in precision.grids(scene, arguments.quick):
                key = {"scene": label, "data": data, "n": n, "method": method, "nested": False, "system": PEER}
                key |= {"recipe": recipe, "eps": TOL, "ranks": 1}
                row = store.find(**key)
                if n > MOST[dimension].get(name, MOST[dimension]["scipy"]):
                    break
                if row is None:
                    shape = (n,) * dimension
                    starts = ranked(name, scene.with_shape(shape), starts)  # type: ignore[arg-type]
                    peers.MixedForm.start = starts[0]
                    runs = [once(name, scene.with_shape(shape))]  # type: ignore[arg-type]
                    while len(runs) < (repeats if runs[0][0]["wall_s"] < precision.LONG else 1):
                        runs.append(once(name, scene.with_shape(shape)))  # type: ignore[arg-type]
                    clocks = {clock: f"{median(run[0][clock] for run in runs):.6f}" for clock in precision.CLOCKS}
                    errors = bench.errors(runs[0][1], shape) if runs[0][1] else {}
                    told = f"start {starts[0][0]:g}, {starts[0][1]:g}. {runs[0][0]['message']}"
                    values = {**environment(), **runs[0][0], **clocks, "runs": len(runs), **errors, "message": told}
                    row = store.add({**values, **key})
                    print(label, method, n, row["outcome"], row["iterations"], clocks["cpu_s"], row["load_error"], flush=True)
                if row["outcome"] != "converged":
                    break


if __name__ == "__main__":
    main()
