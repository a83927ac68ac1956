"""What the guarantees cost: --certify beside a linear solve, and the linear solves of --method monotone by grid.

python benchmarks/guaranteed_bounds.py [N]     N points a side for --certify, default 511
"""

import sys
from statistics import median
from time import perf_counter

import numpy as np

from lcp_lube.api import solve
from lcp_lube.base.options import recipe
from lcp_lube.base.stages import Stages
from lcp_lube.linear.system import make_system
from lcp_lube.problems.film.lubrication import LubricationProblem
from lcp_lube.problems.solution import Enclosure
from lcp_lube.scenes.scene import load_scene
from lcp_lube.solvers.monotone import ModelSystem

REPEAT = 3


def linear_solve(problem: LubricationProblem) -> float:
    """Seconds of one full-film solve to 1e-8 by BiCGStab and BoomerAMG: the yardstick of the performance benchmarks."""
    one = np.ones(problem.grid.local_size)
    begin = perf_counter()
    with recipe("bcgs_amg"):
        system = make_system("reduced", problem, Stages())
        system.solve(0 * one, one, np.abs(problem.c) + 1e-12, 0 * one, 1e-8)
        system.destroy()
    return perf_counter() - begin


def certify(n: int) -> None:
    print(f"--certify, {n} x {n} (medians of {REPEAT}; band: largest distance of p, in Pa and of p_max; load, relative)")
    for name in ("problem4", "rough", "journal"):
        bands, yardsticks, found = [], [], Enclosure(False, "")
        for _ in range(REPEAT):
            solution = solve(load_scene(name, {"n": n}), certify=True)
            problem, found = solution.problem, solution.enclosure or found
            assert isinstance(problem, LubricationProblem)
            quantities = problem.quantities(solution.fields)
            bands.append(solution.times["certify"])
            yardsticks.append(linear_solve(problem))
            solution.destroy()
        values = found.bounds
        widths = (
            f"{values['band_p']:.1e} Pa ({values['band_p'] / quantities['p_max']:.0e}), "
            f"load {values['band_load'] / quantities['load']:.0e}"
            if found.certified
            else found.message
        )
        cost = median(bands) / median(yardsticks)
        print(f"  {name:<10} {median(bands):.2f} s, {cost:.2f} of a full-film linear solve; {widths}", flush=True)


def monotone() -> None:
    print("--method monotone, linear solves on each grid")
    solves: list[int] = []
    original = ModelSystem.solve_model

    def counted(self: ModelSystem, *args: object) -> object:
        solves.append(self.problem.size)
        return original(self, *args)  # type: ignore[arg-type]

    ModelSystem.solve_model = counted  # type: ignore[assignment,method-assign]
    for name, changes in (
        ("problem3", {"n": 10_000}),
        ("problem4", {"n": 200}),
        ("journal", {"n": 128}),
        ("rough", {"n": 100, "amplitude": 8e-6}),
        ("textured_slider", {"K": 4, "depth": 135e-6}),
    ):
        solves.clear()
        solution = solve(load_scene(name, changes), method="monotone")
        sizes = sorted(set(solves))
        counts = ", ".join(f"{size}: {solves.count(size)}" for size in sizes)
        print(f"  {name:<16} {solution.outcome}, {solution.times['total']:.2f} s; points: solves {counts}", flush=True)
        solution.destroy()


if __name__ == "__main__":
    certify(int(sys.argv[1]) if len(sys.argv) > 1 else 511)
    monotone()
