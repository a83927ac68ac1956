"""Table 2 of Bergamaschi and Zilli: elastohydrodynamic line contact, and where its seconds go.

First the table itself (`lcp-lube table 2 --paper bergamaschi`), then the shares of the Jacobian, of its factorisation and of
the triangular solves, from PETSc's log, to n = 4000, and what keeping the Jacobian for several steps gains.

    python benchmarks/bergamaschi_zilli_table2.py [--quick] [--results benchmarks/results]

Rows of the shares that are in the csv already are not run again, whatever code made them, and printed with their age.
Seconds are medians of --repeat runs: of the processor for the whole, of the clock for its parts, whose shares are printed.
Rows run in processes of their own, so that the memory is theirs.
"""

import argparse
import json
import statistics
import subprocess
import sys
from functools import partial
from pathlib import Path
from time import process_time
from typing import Any

HERE = Path(__file__).parent
SIZES = (200, 1000, 2000, 4000)
KEEPS = (1, 2, 3, 5)
EVENTS = {"factor_s": ("MatLUFactor", "MatLUFactorSym", "MatLUFactorNum"), "solve_s": ("MatSolve",)}
COLUMNS = """n keep iterations cpu_s total_s jacobian_s factor_s solve_s rest_s memory_mb k x_b h_min p_max c1 outcome machine
    petsc""".split()  # noqa: SIM905


def run(n: int, keep: int) -> dict[str, Any]:
    """One solve to the default tolerances, with the seconds of its parts."""
    import petsc4py

    petsc4py.init(["table2"])
    from petsc4py import PETSc

    from lcp_lube import load_scene, solve
    from lcp_lube.output.results import as_dict, machine

    PETSc.Log.begin()
    begin = process_time()
    solution = solve(load_scene("ehl_line", {"n": n}), method="interior", options={"keep": keep})
    cpu_s = process_time() - begin
    data, seconds = as_dict(solution), solution.times
    stage = PETSc.Log.Stage("KSP").id  # PETSc counts by stage
    parts = {
        name: sum(PETSc.Log.Event(event).getPerfInfo(stage)["time"] for event in events) for name, events in EVENTS.items()
    }
    parts["jacobian_s"] = seconds["Jacobian"]
    total = seconds["total"]
    solution.destroy()
    return {
        **{name: data.get(name) for name in COLUMNS},
        **parts,
        "n": n,
        "keep": keep,
        "cpu_s": cpu_s,
        "total_s": total,
        "rest_s": total - sum(parts.values()),
        "machine": machine(),
        "petsc": data["versions"]["petsc"],
    }


def measured(n: int, keep: int, repeat: int) -> dict[str, Any]:
    """Medians of several runs in processes of their own."""
    command = [sys.executable, __file__, "--run", str(n), str(keep)]
    runs = [json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout) for _ in range(repeat)]
    medians = {name: round(statistics.median(run[name] for run in runs), 4) for name in COLUMNS if name.endswith("_s")}
    return {**runs[0], **medians, "memory_mb": round(max(run["memory_mb"] for run in runs), 1)}


def shares(results: Path, repeat: int, quick: bool) -> None:
    """The seconds by part, and the gain of keeping the Jacobian."""
    from lcp_lube.base.resumable import ResumableCsv
    from lcp_lube.output.table import line

    store = ResumableCsv(results / "bergamaschi_table2_shares.csv", COLUMNS, ("n", "keep"), signed=True)
    widths = (5, 4, 3, 8, 9, 7, 6, 6, 6, 12)
    print("\n" + line(["n", "keep", "it", "CPU s", "Jacobian", "factor", "solve", "rest", "MB", "k"], widths))
    for n in SIZES[: 2 if quick else None]:
        for keep in KEEPS:
            row = store.row({"n": n, "keep": keep}, partial(measured, n, keep, 1 if n > 2000 else repeat))
            total = float(row["total_s"])
            part = [100.0 * float(row[name]) / total for name in ("jacobian_s", "factor_s", "solve_s", "rest_s")]
            numbers = [row["iterations"], f"{float(row['cpu_s']):.3f}", *(f"{share:.0f} %" for share in part)]
            numbers += [f"{float(row['memory_mb']):.0f}", f"{float(row['k']):.8f}"]
            print(line([str(n), str(keep), *numbers], widths), row["outcome"], store.age(row), flush=True)
    print(
        "printed: n = 200 Jacobian 47 %, factor 22 %, solve 1 % of 1.30 s; n = 1000 30 %, 51 %, 1 % of 69.41 s (600 MHz Alpha)"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="leave the long rows out")
    parser.add_argument("--repeat", type=int, default=3, help="runs of a row; default 3, above n = 2000 one")
    parser.add_argument("--results", type=Path, default=HERE / "results", help="folder of the csv files")
    parser.add_argument("--run", nargs=2, type=int, metavar=("N", "KEEP"), help="one row alone, as JSON")
    args = parser.parse_args()
    if args.run:
        print(json.dumps(run(*args.run)))
        return
    from lcp_lube.__main__ import main as lcp_lube

    lcp_lube(["table", "2", "--paper", "bergamaschi", "--results", str(args.results)])
    shares(args.results, args.repeat, args.quick)


if __name__ == "__main__":
    main()
