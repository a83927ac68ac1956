"""How often --accuracy's estimates hold, on random plane films: how many true errors lie within them, and how far below.

python benchmarks/estimates.py 888 40            # seed and number of films
python benchmarks/estimates.py 777 60 strange    # of films unlike those that the constants were taken from
python benchmarks/estimates.py 3 120 unlike      # of films unlike these again: runs for the pressure's integral alone

Each film is solved with 10 to 16 points a side and on grids of twice the points, below 300 a side; from the third grid on, up
to 140 a side, the best value and its error (drivers/accuracy/estimate.py) are compared with the limit of the finest grids. The
last lines are of runs with --accuracy 10 to 0.1 % that end on no more: of their estimates, and of their points over those of
the one grid from which on all are as good as was asked for (geometric mean).

Runs on films of `unlike` are to 1, 0.3 and 0.1 %, against the limit of 511 and 767 points a side where these agree to half of
that.
"""

import sys
from collections.abc import Iterator
from itertools import cycle, islice
from typing import Any

import numpy as np

from lcp_lube import InputError, load_scene, solve
from lcp_lube.drivers.accuracy.estimate import Estimate, estimate
from lcp_lube.drivers.accuracy.rungs import finer
from lcp_lube.drivers.accuracy.unseen import misplaced_film

FINEST, TOLD = 300, 140  # points a side
NAMES = ("load", "p_max", "friction", "cavitated_area")
MAIN = NAMES[:3]
TOLERANCES = (1e-1, 3e-2, 1e-2, 3e-3, 1e-3)
KINDS = ("wedge", "parabola", "waves", "pocket", "square", "round", "dome", "step", "rough")
UNLIKE = ("taper", "ramp", "square", "round", "dome", "ripple", "pockets", "step", "dam", "journal", "oblique", "crown")
REFERENCES, FEW = (511, 767), {"max_it": 50}  # points a side; a film that takes more cycles is left out
WANTED: dict[str, Any] = {"quantity": "pressure_integral", "finest": (1023, 1023)}
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


def strange(seed: int, count: int) -> Iterator[tuple[str, dict[str, Any]]]:
    """Films of up to three features, with closed and periodic sides, ratios to 15, any pressures."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        L = float(rng.uniform(5e-3, 50e-3))
        W, h = L * float(rng.uniform(0.2, 4)), float(10 ** rng.uniform(-6, -4.5))
        base = rng.integers(4)
        film: list[dict[str, Any]] = [{"shape": "constant", "h": h}]
        if base == 1:
            film = [{"shape": "linear", "h_start": h * float(rng.uniform(1, 12)), "h_end": h}]
        elif base == 2:
            high, waves = h * float(rng.uniform(1.2, 15)), float(rng.integers(1, 4))
            film = [{"shape": "sinusoid", "h_min": h, "h_max": high, "waves": waves}]
        elif base == 3:
            film = [{"shape": "parabola", "h_min": h, "h_max": h * float(rng.uniform(1.2, 10))}]
        for _ in range(int(rng.integers(0, 3))):
            depth, feature = h * float(10 ** rng.uniform(-1, 0.7)), rng.integers(4)
            if feature == 0:
                x, y = (np.sort(rng.uniform(0.05, 0.95, 2)) for _ in range(2))
                (x0, x1), (y0, y1) = ((t[0], min(max(t[1], t[0] + 0.04), 0.99)) for t in (x, y))
                film.append({"shape": "pocket", "depth": depth, "x": [x0 * L, x1 * L], "y": [y0 * W, y1 * W]})
            elif feature == 1:
                columns, rows = int(rng.integers(1, 5)), int(rng.integers(1, 5))
                form = str(rng.choice(["square", "round", "dome"]))
                size = float(rng.uniform(0.2, 0.9)) * min(L / columns, W / rows)
                dimples = {"form": form, "depth": depth, "columns": columns, "rows": rows, "size": size}
                film.append({"shape": "dimples", **dimples})
            elif feature == 2:
                film.append({"shape": "step", "height": depth, "at": float(rng.uniform(0.1, 0.9)) * L})
            else:
                cells = {"seed": int(rng.integers(99)), "cells": int(rng.integers(3, 7))}
                film.append({"shape": "roughness", "sigma": 0.12 * h, **cells})
        kind = rng.integers(5)
        sides: dict[str, Any] = {
            name: float(rng.choice([0, 1e5, 10 ** rng.uniform(4, 7)])) for name in ("west", "east", "south", "north")
        }
        if kind == 1:
            sides |= dict.fromkeys(("south", "north"), "periodic")
        elif kind == 2:
            sides["south"] = "closed"
        elif kind == 3:
            sides |= {"west": "periodic", "east": "periodic", "south": max(sides["south"], 1e5)}
        elif kind == 4:
            sides["east"] = "closed"
        speed, fluid = float(10 ** rng.uniform(-2, 1.3)), {"mu": float(10 ** rng.uniform(-3, -0.5))}
        data = {"family": "bearing", "dimension": 2, "L": L, "width": W, "U": speed, "fluid": fluid, "film": film}
        yield "+".join(one["shape"] for one in film), {**data, "h_floor": 0.3 * h, "sides": sides}


def unlike(seed: int, count: int) -> Iterator[tuple[str, dict[str, Any]]]:
    """Tapers, ramps, dimples, ripples, pockets, steps, dams, journals, oblique slopes and crowns in turn, of any size."""
    rng = np.random.default_rng([seed, 2711])

    def some(low: float, high: float) -> float:
        return float(rng.uniform(low, high))

    def span(least: float, length: float) -> list[float]:
        start, end = sorted((some(0.0, 0.9), some(0.1, 1.0)))
        return [start * length, min(max(end, start + least), 0.99) * length]

    for kind in islice(cycle(UNLIKE), count):
        L = float(10 ** some(-2.7, -1.0))
        W, h = L * float(10 ** some(-0.6, 0.6)), L * float(10 ** some(-4.2, -3.0))
        ends = ((some(1, 3), 1.0), (some(1, 1.2), 1.0), (1.0, some(1, 1.6)))[rng.integers(3)]
        film: list[dict[str, Any]] = [{"shape": "linear", "h_start": h * ends[0], "h_end": h * ends[1]}]
        depth, x, y = h * float(10 ** some(-0.6, 0.6)), f"x/{L!r}", f"y/{W!r}"
        along, formula = str(rng.choice(["x", "x", "y"])), ""
        length = L if along == "x" else W
        if kind == "taper":
            formula = f"exp({some(-1.5, 1.5)}*{x} + {some(-0.8, 0.8)}*{y})*(1 + {some(0, 1.5)}*({x} - {some(0.3, 0.7)})**2)"
        elif kind == "ripple":
            formula = f"1 + {some(0, 1.5)}*(1 - {x}) + {some(0.1, 0.75)}*sin({some(2, 16)}*{x} + {some(-8, 8)}*{y})"
        elif kind == "oblique":
            formula = f"1 + {some(0.1, 1.3)}*(1 + tanh({some(3, 14)}*({x} - {some(0.3, 0.7)} + {some(-0.6, 0.6)}*({y} - 0.5))))"
        elif kind == "ramp":
            heights = {"h_start": depth, "h_end": 1e-3 * h} if rng.random() < 0.5 else {"h_start": 1e-3 * h, "h_end": depth}
            film.append({"shape": "linear", "along": along, "between": span(0.03, length), **heights})
        elif kind in ("square", "round", "dome"):
            columns, rows = int(rng.integers(1, 5)), int(rng.integers(1, 4))
            array = {"columns": columns, "rows": rows, "size": some(0.25, 0.85) * min(L / columns, W / rows)}
            film.append({"shape": "dimples", "form": kind, "depth": depth, **array})
        elif kind == "pockets":
            for _ in range(int(rng.integers(1, 4))):
                film.append({"shape": "pocket", "depth": depth * some(0.5, 1.5), "x": span(0.08, L), "y": span(0.08, W)})
        elif kind == "step":
            film.append({"shape": "step", "height": depth, "along": along, "at": some(0.1, 0.9) * length})
        elif kind == "dam":
            end, land = some(0.1, 0.8), some(0.03, 0.15)
            film = [{"shape": "constant", "h": h}]
            for places, part in (((0.02, end), 1.0), ((end + land, min(end + land + 0.4, 0.985)), some(0.5, 1.0))):
                x_ends, y_ends = [at * L for at in places], [some(0.02, 0.05) * W, some(0.9, 0.97) * W]
                film.append({"shape": "pocket", "depth": depth * part, "x": x_ends, "y": y_ends})
        elif kind == "journal":
            film = [{"shape": "journal", "c": h, "eccentricity": some(0.2, 0.95), "widest": some(0, L)}]
        else:
            film = [{"shape": "parabola", "h_min": h, "h_max": h * some(1.3, 5)}]
            waves = {"h_min": 1e-3 * h, "h_max": h * some(0.05, 0.6), "waves": some(0.5, 3)}
            film.append({"shape": "sinusoid", "along": "y", **waves})
        film = [{"shape": "formula", "h": f"{h!r}*({formula})"}] if formula else film
        sides: dict[str, Any] = {
            name: float(rng.choice([0, 0, 1e5, 10 ** some(4, 6)])) for name in ("west", "east", "south", "north")
        }
        if kind != "dam" and rng.random() < 0.12:
            sides["south"] = "closed"
        fluid, speed = {"mu": float(10 ** some(-3, -0.5))}, float(10 ** some(-1.5, 1.2))
        data = {"family": "bearing", "dimension": 2, "L": L, "width": W, "U": speed, "fluid": fluid, "film": film}
        yield kind, {**data, "h_floor": 1e-6 * h, "sides": sides}


def of_unlike(seed: int, count: int) -> None:
    """Runs of the program on films of `unlike`: how many are right, and how far below the estimate the error is."""
    rows: list[tuple[float, str, float, float]] = []
    for kind, data in unlike(seed, count):
        before = len(rows)
        try:
            a, b = (_integral({**data, "n": n}) for n in REFERENCES)
            limit = b + 0.9 * (b - a) / (((REFERENCES[1] + 1) / (REFERENCES[0] + 1)) ** 2 - 1.0)
            for tol in TOLERANCES[2:]:
                if abs(b - a) < 0.5 * tol * abs(limit):
                    with solve(load_scene({**data, "n": 95}), accuracy=tol, rescue=False, stopping=FEW, **WANTED) as run:
                        error = abs(run.numbers["pressure_integral"] / limit - 1)
                        rows += [(tol, kind, error, run.settings["accuracy_estimate"])] if run.converged else []
        except InputError as refused:
            print(kind, refused)
        print(kind, *(f"{tol:g}: {error:.1e} of {told:.1e}" for tol, _, error, told in rows[before:]), flush=True)
    for tol in TOLERANCES[2:]:
        mine = [row for row in rows if row[0] == tol]
        ratio = float(np.median([row[3] / max(row[2], LEAST) for row in mine]))
        right = 100 * float(np.mean([row[2] <= row[3] for row in mine]))
        below = 100 * float(np.mean([row[2] <= tol for row in mine]))
        print(f"{tol:g}: {len(mine)} runs, {right:.1f} % right, {ratio:.1f} times the error, {below:.1f} % of errors below it")
        for kind in UNLIKE:
            among = [row for row in mine if row[1] == kind]
            print(f"    {kind}: {sum(row[2] <= row[3] for row in among)} of {len(among)}")


def _integral(data: dict[str, Any]) -> float:
    with solve(load_scene(data), stopping={"eps1": 1e-9, **FEW}, rescue=False) as solution:
        return float(solution.numbers["pressure_integral"]) if solution.converged else np.nan


def run(data: dict[str, Any], name: str, tol: float) -> tuple[Estimate, list[int]]:
    """The answer of a run to a tolerance and its grids, points a side; of one that does not reach it on few grids none."""
    with solve(load_scene(data), accuracy=tol, quantity=name, finest=(FINEST, FINEST)) as solution:
        found = solution.estimates.get(name, {"value": np.nan, "error": np.inf})
        grids = [level["nx"] for level in solution.levels]
        return Estimate(found["value"], found["error"]), grids if solution.converged and grids[-1] <= TOLD else []


def main(seed: int, count: int, kinds: str = "") -> None:
    if kinds == "unlike":
        of_unlike(seed, count)
        return
    rows, runs, costs = [], [], []
    starts = np.random.default_rng(seed + 1)
    for kind, data in (strange if kinds else films)(seed, count):
        values: dict[str, list[float]] = {name: [] for name in NAMES}
        first = int(starts.integers(10, 17))
        misplaced: list[float] = []
        sizes: list[float] = []
        points: list[int] = []
        try:
            n, meshes = first, (0.0,)
            while n < FINEST:
                solution = solve(load_scene({**data, "n": n}), stopping={"eps1": 1e-9})
                misplaced.append(misplaced_film(solution.problem))
                meshes = meshes if points else solution.problem.grid.meshes
                sizes.append(solution.problem.grid.meshes[0])
                points.append(n)
                for name in NAMES:
                    number = solution.numbers.get(name) if solution.converged else None
                    values[name].append(np.nan if number is None else number)
                (n, *_) = finer((first, first), meshes, len(points))
                solution.destroy()
        except InputError as error:
            print(kind, error)
            continue
        for name in NAMES:
            v = values[name]
            limit = float(np.mean([v[k] + (v[k] - v[k - 2]) / 3 for k in (-1, -2)]))
            if not limit or np.isnan(limit):
                continue

            def told(found: Estimate, limit: float = limit) -> tuple[float, float]:
                return abs(found.value / limit - 1) + LEAST, found.error / abs(limit) + LEAST

            for k in (k for k in range(3, len(v) + 1) if points[k - 1] <= TOLD):
                rows.append((name, *told(estimate(v[:k], misplaced[:k], sizes[:k], name))))
            for tol in TOLERANCES if name in MAIN else ():
                found, grids = run({**data, "n": 8 * first + 7}, name, tol)
                if grids:
                    runs.append((f"runs, {name}", *told(found)))
                    good = 1 + max((k for k, value in enumerate(v) if not abs(value / limit - 1) <= tol), default=-1)
                    costs += [sum(n**2 for n in grids) / points[good] ** 2] if good < len(v) else []
    print(f"{'':16} {'within':>7} {'estimate/true, median':>22}")
    for name in (*NAMES, "all", *(f"runs, {name}" for name in MAIN)):
        among = MAIN if name == "all" else (name,)
        table = np.array([row[1:] for row in [*rows, *runs] if row[0] in among and np.isfinite(row[1:]).all()])
        ratio = (table[:, 1] / table[:, 0])[table[:, 0] > 10 * LEAST]
        print(f"{name:16} {100 * np.mean(table[:, 0] <= table[:, 1]):6.1f}% {np.median(ratio):22.1f}")
    print(f"points of a run over those of the fixed grid: {np.exp(np.mean(np.log(costs))):.1f}")


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), *sys.argv[3:])
