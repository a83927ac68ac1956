"""The tuned constants of the solvers, each swept: what a run costs, in counts, with other values than the one in the code.

    python benchmarks/constants.py [NAME ...]

A row is a constant at a value, over the scenes of its case: sums of outer iterations, linear iterations and work (sweeps over
the finest grid's points, multigrid alone), and how many runs converged. `*` marks the value in the code. Counts only: they are
the same on every machine, but for a few in the last place.
"""

import argparse
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import lcp_lube
from lcp_lube import load_scene, solve

HARD = (
    ("rough", {"nx": 119, "ny": 119}),
    ("textured_slider", {"K": 6}),
    ("journal", {"nx": 240, "ny": 59, "eccentricity": 0.95}),
    ("dimpled_pad", {"nx": 127, "ny": 127}),
)
LONG = (
    ("problem4", {"nx": 511, "ny": 31}),
    ("problem4", {"nx": 31, "ny": 511}),
    ("journal", {"nx": 480, "ny": 31, "width_over_diameter": 0.1}),
    ("rough", {"nx": 511, "ny": 31}),
    ("rough", {"nx": 27, "ny": 64}),
    ("dimpled_pad", {"nx": 255, "ny": 31}),
)
CAVITY = {"method": "active-set", "system": "cavity", "recipe": "bcgs_amg"}
FAS: dict[str, Any] = {"method": "fas"}


@dataclass(frozen=True)
class Sweep:
    """A constant of a module, the values to try, and the runs that it may matter to; `place`: which of a tuple's."""

    module: str
    name: str
    values: tuple[Any, ...]
    ask: dict[str, Any]
    scenes: tuple[tuple[str, dict[str, Any]], ...] = HARD


SWEEPS = (
    Sweep("linear.nearnull", "COARSEST", (50, 200, 800, 3200), CAVITY),
    Sweep("linear.nearnull", "SWEEPS", (1, 2, 3, 5), CAVITY),
    Sweep("linear.nearnull", "LEAK", (1e-6, 1e-5, 1e-4, 1e-3, 1e-2), CAVITY),
    Sweep("solvers.active_set", "FIRST", (1e-3, 1e-2, 1e-1), CAVITY),
    Sweep("solvers.active_set", "FORCING", (0.01, 0.1, 0.5), CAVITY),
    Sweep("solvers.active_set", "LAST", (0.1, 0.4, 0.9), CAVITY),
    Sweep("solvers.active_set", "RESCUE_SWEEPS", (4, 16, 64), CAVITY),
    Sweep("solvers.fas.levels", "STRONG", (2.0, 4.0, 8.0, 16.0, 64.0, 1e9), FAS, LONG),
    Sweep("solvers.fas.levels", "FEWEST", (2, 3, 7), FAS),
)


def runs(sweep: Sweep) -> tuple[int, int, int, float]:
    """Converged runs, iterations, linear iterations and work, summed over the scenes."""
    converged = iterations = linear = 0
    work = 0.0
    for name, changes in sweep.scenes:
        with solve(load_scene(name, changes), rescue=False, reduction=False, **sweep.ask) as solution:
            converged += solution.converged
            iterations += solution.iterations
            linear += solution.total("linear_iterations")
            work += float(solution.quantities.get("work_units") or 0.0)
    return converged, iterations, linear, work


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="constants; default all")
    names = parser.parse_args().names
    print(f"{'constant':34} {'value':>8} {'converged':>9} {'iterations':>10} {'linear':>7} {'work':>8}")
    for sweep in SWEEPS:
        if names and sweep.name not in names:
            continue
        module = import_module(f"{lcp_lube.__name__}.{sweep.module}")
        ours = getattr(module, sweep.name)
        for value in sweep.values:
            setattr(module, sweep.name, value)
            done, iterations, linear, work = runs(sweep)
            mark = "*" if value == ours else " "
            label = f"{sweep.module}.{sweep.name}"
            print(
                f"{label:34} {value:8g}{mark} {done:4}/{len(sweep.scenes)} {iterations:12} {linear:7} {work:8.1f}", flush=True
            )
        setattr(module, sweep.name, ours)


if __name__ == "__main__":
    main()
