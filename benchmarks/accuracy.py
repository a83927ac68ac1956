"""How good the estimate behind --accuracy is, and what it costs beside one grid that is as good.

Random 1D films with exact solutions (straight, smooth, stepped; tests/films.py), and random films over a square against a grid
with 1023 points a side (no finer one than 511 is allowed: runs that would need it are not reached). Estimate over error: 1 and
more is an estimate that holds. Then the scenes of the chart of speed against accuracy, scheme `face`: milliseconds of the
processor of a run to a tolerance and of the fastest one grid of multigrid that is as good, in turn in one process, medians.
That grid is the least of a ladder from which on all are as good; in parentheses any that is, by chance too. Last the fastest
that errs by no more than the run did, which is mostly less than its tolerance.

    python benchmarks/accuracy.py [--films 90] [--planes 18] [--seed 0] [--turns 9] [--scenes journal problem4]
"""

import argparse
import sys
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from statistics import median
from time import process_time
from typing import Any

import numpy as np
import petsc4py

petsc4py.init(sys.argv[:1])
sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))

from films import FilmScene, Knots, L, Pieces, random_films  # noqa: E402

from lcp_lube.api import solve  # noqa: E402
from lcp_lube.scenes.scene import Scene, load_scene  # noqa: E402
from lcp_lube.solvers.newton import Stopping  # noqa: E402
from lcp_lube.studies.precision import SCENES, VARIANTS  # noqa: E402

TOLERANCES = (1e-2, 1e-3, 1e-4)
ASKED = {"quantity": "pressure_integral"}
LADDER = {1: (12, 25, 50, 100, 200), 2: (31, 39, 47, 55, 63, 79, 95, 127, 159, 191, 255, 319, 383, 447, 511)}
REFERENCES = (1279, 2047)  # points a side


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


def clocked(scene: Scene, **how: Any) -> tuple[float, float]:
    """The pressure's integral, and milliseconds of the processor that the solve took."""
    begin = process_time()
    solution = solve(scene, **how)
    took = 1e3 * (process_time() - begin)
    with solution:
        return float(solution.numbers["pressure_integral"]) if solution.converged else np.nan, took


def cost(name: str, turns: int) -> None:
    """Print what runs to TOLERANCES cost, and the one grid that is as good."""
    source, changes = VARIANTS.get(name, (name, {}))
    scene: Any = load_scene(source, **changes | {"scheme": "face"})
    dim = len(scene.shape)
    if (exact := scene.exact()) is not None:
        truth, unsure = exact.load, 0.0
    else:
        a, b = (clocked(scene.with_shape((n, n)), method="fas", stopping={"eps1": 1e-10})[0] for n in REFERENCES)
        truth = b + (b - a) / ((REFERENCES[1] / REFERENCES[0]) ** 2 - 1.0)
        unsure = abs(truth / b - 1)
    jobs: dict[Any, tuple[Scene, dict[str, Any]]] = {tol: (scene, {"accuracy": tol, **ASKED}) for tol in TOLERANCES}
    for n in LADDER[dim]:
        jobs[n] = scene.with_shape((n,) * dim), {"method": "fas", "nested": False, "stopping": Stopping(1e-4, 1e-4)}
    runs: dict[Any, list[tuple[float, float]]] = {key: [] for key in jobs}
    for _, (key, (what, how)) in product(range(turns + 1), jobs.items()):  # the first turn loads what is compiled
        runs[key].append(clocked(what, **how))
    off = {key: abs(mine[-1][0] / truth - 1) for key, mine in runs.items()}
    took = {key: median(ms for _, ms in mine[1:]) for key, mine in runs.items()}
    for tol in TOLERANCES:
        if unsure > tol:
            continue
        good = {n for n in LADDER[dim] if off[n] <= tol}
        sure = [n for n in good if all(m in good for m in LADDER[dim] if m > n)]
        one, chance = (min(grids, key=took.__getitem__, default=None) for grids in (sure, good))
        beside = f"{one}: {took[one]:.1f} ms, {took[tol] / took[one]:.1f}" if one else "no grid"
        if chance and chance != one:
            beside += f" ({chance}: {took[chance]:.1f} ms, {took[tol] / took[chance]:.1f})"
        same = min((n for n in LADDER[dim] if off[n] <= off[tol]), key=took.__getitem__, default=None)
        beside += f"; same error {same}: {took[tol] / took[same]:.1f}" if same else "; none with this error"
        print(f"{name:<18} {tol:g}: off by {off[tol]:.1e}, {took[tol]:.1f} ms; {beside}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--films", type=int, default=90)
    parser.add_argument("--planes", type=int, default=18)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--turns", type=int, default=9, help="of which the median counts")
    parser.add_argument("--scenes", nargs="*", default=SCENES, help="whose cost is measured")
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
    for name in args.scenes:
        cost(name, args.turns)


if __name__ == "__main__":
    main()
