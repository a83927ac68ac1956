"""What derivatives cost beside the solve that they belong to: the table of docs/gradients.md.

    python benchmarks/gradients.py [SCENE:POINTS[:KEY] ...] [--repeats 5]

Solve and derivatives of the load are run in turn in one process; a row has medians of their parts of the solve, in processor
time: lambda and what it needs; lambda and all film values; lambda and one number of the scene; lambda and all of its numbers.
Of marches: all numbers and the march that they belong to. On several ranks by mpiexec.
"""

import argparse
from collections.abc import Callable
from statistics import median
from time import process_time
from typing import Any

import numpy as np

from lcp_lube import load_scene, solve
from lcp_lube.drivers.derivatives.adjoint import Adjoint
from lcp_lube.drivers.derivatives.film_gradient import FilmGradient
from lcp_lube.drivers.derivatives.gradient import gradients
from lcp_lube.drivers.marches.march_course import Trace
from lcp_lube.scenes.moving import motion_of

CASES = ["problem4:255", "problem4:511", "problem4:1023", "dimpled_pad:255", "dimpled_pad:511", "dimpled_pad:1023"]
CASES += ["journal:720", "journal:1440", "moving_texture"]
KEYS = {"problem4": "L", "dimpled_pad": "L", "journal": "D"}  # those that move the whole grid


def timed(task: Callable[[], Any]) -> tuple[float, Any]:
    start = process_time()
    found = task()
    return process_time() - start, found


def steady(scene: Any, key: str) -> list[float]:
    def all_films(solution: Any) -> None:
        adjoint = Adjoint(scene, solution, ["load"])
        FilmGradient(adjoint).field("load")
        adjoint.destroy()

    seconds, solution = timed(lambda: solve(scene))
    tasks = [
        lambda: Adjoint(scene, solution, ["load"]).destroy(),
        lambda: all_films(solution),
        lambda: gradients(scene, solution, ["load"], [key]),
        lambda: gradients(scene, solution, ["load"]),
    ]
    found = [seconds, *(timed(task)[0] / seconds for task in tasks)]
    solution.destroy()
    return found


def march(scene: Any) -> list[float]:
    trace = Trace()
    seconds, solution = timed(lambda: solve(scene, watch=trace))
    more, _ = timed(lambda: gradients(scene, solution, ["load"], trace=trace))
    solution.destroy()
    return [seconds, (seconds + more) / seconds]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", default=CASES)
    parser.add_argument("--repeats", type=int, default=5)
    args = parser.parse_args()
    for case in args.cases:
        name, points, key = (*str(case).split(":"), "", "")[:3]
        scene = load_scene(name)
        if points:
            n, (nx, ny) = int(points), scene.shape
            scene = scene.with_shape((n, n * ny // nx))
        one = (lambda: march(scene)) if motion_of(scene) else lambda: steady(scene, key or KEYS[name])  # noqa: B023
        one()  # what is loaded and compiled at first
        rows = np.array([one() for _ in range(args.repeats)])
        print(case, f"solve {median(rows[:, 0]):.3f} s,", *(f"{median(column):.2f}" for column in rows[:, 1:].T), flush=True)


if __name__ == "__main__":
    main()
