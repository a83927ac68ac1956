"""Where a run's seconds go: the share outside KSPSolve and factorisation, memory per unknown, and two targets of speed.

    python benchmarks/timing_share.py [--repeats N]

Each case is a `lcp-lube solve` of problem 1 (n = 10,000) or problem 4 (200 x 200) in a process of its own, so that memory is
that run's alone. Medians of N runs. On a machine that others use too the clock's seconds say little: shares and targets are
those of the processor.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
from statistics import median
from time import process_time
from typing import Any

CASES = (
    # arguments of `lcp-lube solve`, target for the processor's seconds, target for the share outside the inner solver
    ("problem1 --n 10000 --method din --system full --no-nested --eps1 1e-4 --eps2 1e-4 --recipe superlu", 0.5, 0.25),
    ("problem1 --n 10000 --method din --system full --no-nested --eps1 1e-4 --eps2 1e-4 --recipe mumps", None, 0.25),
    ("problem1 --n 10000 --method din --system full --no-nested --eps1 1e-4 --eps2 1e-4 --recipe gmres_ilu", 6.0, 0.25),
    ("problem4 --n 200 --method din --system full --no-nested --eps1 1e-4 --eps2 1e-4 --recipe umfpack", None, 0.25),
    ("problem4 --n 200 --method din --system full --no-nested --eps1 1e-4 --eps2 1e-4 --recipe mumps", None, 0.25),
)


def measure(arguments: str) -> dict[str, Any]:
    """One run in this process; memory is what it grew by since PETSc had started."""
    import petsc4py

    petsc4py.init(["lcp-lube"])

    from lcp_lube.cli.arguments import parse
    from lcp_lube.cli.asked import solution_of
    from lcp_lube.linear.krylov import Krylov
    from lcp_lube.output.results import as_dict, machine

    args = parse(["solve", *arguments.split()])
    solution_of(parse(["solve", "problem1", "--n", "20"])).destroy()  # imports what is imported late
    inside = []
    solve = Krylov.solve

    def timed(*arguments: Any) -> int:
        """A KSP's set-up, which is the factorisation, and its solve."""
        begin = process_time()
        try:
            return solve(*arguments)
        finally:
            inside.append(process_time() - begin)

    Krylov.solve = timed  # type: ignore[assignment, method-assign]
    start_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    begin = process_time()
    solution = solution_of(args)
    cpu_s = process_time() - begin
    data = as_dict(solution)
    solution.destroy()
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - start_kb
    return {
        **{key: data[key] for key in ("outcome", "iterations", "linear_iterations", "unknowns")},
        "clock_s": data["time_s"]["total"],
        "cpu_s": cpu_s,
        "share": 1.0 - sum(inside) / cpu_s,
        "bytes_per_unknown": 1024.0 * grown / data["unknowns"],
        "machine": machine(),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=5, metavar="N")
    parser.add_argument("--case", help=argparse.SUPPRESS)  # the process that makes one run
    args = parser.parse_args()
    if args.case:
        print(json.dumps(measure(args.case)))
        return
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    for k, (arguments, most_s, most_share) in enumerate(CASES):
        command = [sys.executable, __file__, "--case", arguments]
        runs = [
            json.loads(subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout)
            for _ in range(args.repeats)
        ]
        if k == 0:
            print(f"{runs[0]['machine']}, one of them used; medians of {args.repeats} runs")
        middle = {key: median(run[key] for run in runs) for key in ("clock_s", "cpu_s", "share", "bytes_per_unknown")}
        first = runs[0]
        print(
            f"{arguments}\n  {first['outcome']}, {first['iterations']} iterations, {first['linear_iterations']} Krylov; "
            f"{middle['clock_s']:.3f} s by the clock, {middle['cpu_s']:.3f} s of processor"
            f"{verdict(middle['cpu_s'], most_s, ' s')}; outside the inner solver "
            f"{100 * middle['share']:.0f} %{verdict(middle['share'], most_share)}; "
            f"{middle['bytes_per_unknown']:.0f} bytes an unknown"
        )


def verdict(value: float, target: float | None, unit: str = "") -> str:
    """Whether a target is met, in brackets; nothing where there is none."""
    if target is None:
        return ""
    return f" ({'within' if value <= target else 'over'} the target of {target:g}{unit})"


if __name__ == "__main__":
    main()
