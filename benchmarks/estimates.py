"""How often --accuracy's estimates hold, on random plane films: how many true errors lie within them, and how far below.

python benchmarks/estimates.py 7 40    # seed and number of films

Each film is solved with 7 to 255 points a side; from the third grid on the best value and its error (drivers/estimate.py) are
compared with the limit of the two finest grids.
"""

import sys
from collections.abc import Iterator
from typing import Any

import numpy as np

from lcp_lube import InputError, load_scene, solve
from lcp_lube.drivers.estimate import estimate, misplaced_film

GRIDS = (7, 15, 31, 63, 127, 255)
NAMES = ("load", "p_max", "friction")
KINDS = ("wedge", "parabola", "waves", "pocket", "square", "round", "dome", "step", "rough")
LEAST = 1e-10  # relative: below it a number is exact


def films(seed: int, count: int) -> Iterator[tuple[str, dict[str, Any]]]:
    """Films of one feature each, of any size and place, at any speed and pressures."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        L = 0.02
        W, h, kind = L * float(rng.choice([0.5, 1, 2])), float(rng.uniform(2e-6, 2e-5)), str(rng.choice(KINDS))
        ratio, depth = float(rng.uniform(1.3, 4)), h * float(rng.uniform(0.3, 3))
        film: list[dict[str, Any]] = [{"shape": "linear", "h_start": h * float(rng.uniform(1, 2.2)), "h_end": h}]
        if kind == "parabola":
            film = [{"shape": "parabola", "h_min": h, "h_max": h * ratio}]
        elif kind == "waves":
            film = [{"shape": "sinusoid", "h_min": h, "h_max": h * ratio, "waves": float(rng.uniform(0.6, 3))}]
        elif kind == "pocket":
            x, y = (np.sort(rng.uniform(0.08, 0.9, 2)) + np.array([0.0, 0.06]) for _ in range(2))
            film.append({"shape": "pocket", "depth": depth, "x": [x[0] * L, x[1] * L], "y": [y[0] * W, y[1] * W]})
        elif kind in ("square", "round", "dome"):
            columns, rows = (int(rng.integers(1, 4)) for _ in range(2))
            size = float(rng.uniform(0.3, 0.8)) * min(L / columns, W / rows)
            film.append({"shape": "dimples", "form": kind, "depth": depth, "columns": columns, "rows": rows, "size": size})
        elif kind == "step":
            film.append({"shape": "step", "height": depth, "at": float(rng.uniform(0.1, 0.9)) * L})
        elif kind == "rough":
            seed, cells = int(rng.integers(0, 99)), int(rng.integers(3, 7))
            film.append({"shape": "roughness", "sigma": 0.15 * h, "seed": seed, "cells": cells})
        west = float(rng.choice([0, 1e5, 1e6]))
        east, ends = (float(rng.choice([0, 1e5, west])) for _ in range(2))
        sides = {"west": west, "east": east, "south": ends, "north": ends}
        speed, fluid = float(10 ** rng.uniform(-1, 1)), {"mu": 0.02}
        data = {"family": "bearing", "dimension": 2, "L": L, "width": W, "U": speed, "fluid": fluid, "film": film}
        yield kind, {**data, "h_floor": 0.3 * h, "sides": sides}


def main(seed: int, count: int) -> None:
    rows = []
    for kind, data in films(seed, count):
        values: dict[str, list[float]] = {name: [] for name in NAMES}
        misplaced = []
        try:
            for n in GRIDS:
                solution = solve(load_scene({**data, "n": n}), stopping={"eps1": 1e-9})
                misplaced.append(misplaced_film(solution.problem))
                for name in NAMES:
                    values[name].append(solution.numbers[name] if solution.converged else np.nan)
                solution.destroy()
        except InputError as error:
            print(kind, error)
            continue
        for name in NAMES:
            v = values[name]
            limit = v[-1] + (v[-1] - v[-2]) / 3
            for k in (3, 4, 5):
                found = estimate(v[:k], misplaced[:k])
                rows.append((name, k, abs(found.value - limit) / abs(limit) + LEAST, found.error / abs(limit) + LEAST))
    print(f"{'':12} {'within':>7} {'estimate/true, median':>22}")
    for name in (*NAMES, "all"):
        table = np.array([row[2:] for row in rows if name in (row[0], "all")])
        print(f"{name:12} {100 * np.mean(table[:, 0] <= table[:, 1]):6.1f}% {np.median(table[:, 1] / table[:, 0]):22.1f}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:3]))
