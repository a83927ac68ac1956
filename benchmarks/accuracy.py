"""How good the estimate behind --accuracy is, and what a load to 1 % costs.

Random 1D films with exact solutions (straight, smooth, stepped; tests/films.py), random films over a square against a grid
with 1023 points a side (no finer one than 511 is allowed: runs that would need it are not reached), then the milliseconds of
problem4 and the journal. Estimate over error: 1 and more is an estimate that holds.

    python benchmarks/accuracy.py [--films 90] [--planes 18] [--seed 0]
"""

import argparse
import sys
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from statistics import median
from time import perf_counter, process_time
from typing import Any

import numpy as np
import petsc4py

petsc4py.init(sys.argv[:1])
sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))

from films import FilmScene, Knots, L, Pieces, random_films  # noqa: E402

from lcp_lube.api import solve  # noqa: E402
from lcp_lube.scenes.scene import Scene, load_scene  # noqa: E402


def planes(count: int, seed: int) -> Iterator[Scene]:
    """Squares: a random film of x, straight, smooth or stepped, tilted in y."""
    for k, (scene, _) in enumerate(random_films(count, seed)):
        film: Any = scene.gap
        tilt = float(np.random.default_rng(seed + k).uniform(0, 2))

        def tilted(x: Any, y: Any = 0.0, /, film: Pieces | Knots = film, tilt: float = tilt) -> np.ndarray:
            return film(x, y) * (1 + tilt * np.asarray(y) / L)

        yield FilmScene.of(tilted, dimension=2, p_a=scene.p_a, p_b=scene.p_b, p_side=scene.p_a, scheme="face", name=scene.name)


def value(scene: Scene, quantity: str, tol: float, finest: tuple[int, ...] | None = None) -> tuple[float, float, bool]:
    """The quantity, its estimated relative error, and whether the tolerance was reached."""
    solution = solve(scene, accuracy=tol, quantity=quantity, finest=finest)
    found = solution.levels[-1]["value"], solution.settings["accuracy_estimate"], solution.converged
    solution.destroy()
    return found


def report(name: str, runs: list[tuple[float, float]], missed: int) -> None:
    estimate, error = np.array(runs).T
    inexact = error > 1e-12
    ratio = estimate[inexact] / error[inexact]
    print(
        f"{name:<24} {len(runs):5} runs, {missed} not reached: it holds in {100 * np.mean(error <= estimate + 1e-12):.1f} %, "
        f"estimate/error median {median(ratio):.1f}, nine in ten below {np.quantile(ratio, 0.9):.0f}",
        flush=True,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--films", type=int, default=90)
    parser.add_argument("--planes", type=int, default=18)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    films = [(scene, exact) for scene, exact in random_films(args.films, args.seed) if exact.load > 0]
    for quantity, tol in product(("load", "p_max"), (1e-2, 1e-3, 1e-4)):
        runs, missed = [], 0
        for scene, exact in films:
            found, estimate, reached = value(scene, quantity, tol)
            missed += not reached
            if reached:
                runs.append((estimate, abs(found / getattr(exact, quantity) - 1)))
        report(f"1D, {quantity} to {tol:g}", runs, missed)
    references = []
    for plane in planes(args.planes, args.seed):
        solution = solve(plane.with_shape((1023, 1023)))
        references.append((plane, solution.problem.quantities(solution.fields)))
        solution.destroy()
    for quantity, tol in product(("load", "p_max"), (3e-2, 1e-2)):
        runs, missed = [], 0
        for plane, reference in references:
            found, estimate, reached = value(plane, quantity, tol, (511, 511))
            missed += not reached
            if reached and reference[quantity] > 0:
                runs.append((estimate, abs(found / reference[quantity] - 1)))
        report(f"2D, {quantity} to {tol:g}", runs, missed)
    for name in ("problem4", "journal", "problem1", "long_journal"):
        built_in, seconds, cpu = load_scene(name), [], []
        for _ in range(9):
            start, cpu_start = perf_counter(), process_time()
            value(built_in, "load", 1e-2)
            seconds.append(perf_counter() - start)
            cpu.append(process_time() - cpu_start)
        print(f"{name:<24} load to 1 %: {1e3 * median(seconds):.1f} ms, {1e3 * median(cpu):.1f} ms of them computing")


if __name__ == "__main__":
    main()
