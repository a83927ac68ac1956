"""Films whose edges run across the lines of points: errors of drawn spiral-groove bearings and herringbones, and --accuracy's.

python benchmarks/slanted_edges.py spiral 100 26        # kind, seed and number of films
python benchmarks/slanted_edges.py herringbone 300 24
python benchmarks/slanted_edges.py theory               # many spirals against the theory of narrow grooves

Of each film the load, the largest pressure and friction on grids of twice the points, up to 130,000, against the mean of three
finer ones of other proportions; then runs to 1 and 0.3 %. Cells are as long for their width as chance has it: a scene's own
grid with another number of grooves.
"""

import math
import sys
from typing import Any

import numpy as np

from lcp_lube import InputError, load_scene, solve
from lcp_lube.drivers.accuracy.rungs import finer, first_shape, round_ring
from lcp_lube.scenes.moving import film_of

NAMES = ("load", "p_max", "friction")
MOST, FINEST = 130_000, (700, 1400)  # points of a grid of the ladder, and points a side of runs
TOLERANCES = (1e-2, 3e-3)


def drawn(kind: str, rng: np.random.Generator) -> Any:
    """A scene; InputError where its numbers do not make one."""
    if kind == "spiral":
        outer = float(rng.uniform(20, 100))
        inner, pads = outer * float(rng.uniform(0.3, 0.7)), int(rng.integers(8, 25))
        shape = {"h_min_um": float(rng.uniform(6, 20)), "taper_um": float(rng.uniform(6, 40))}
        shape |= {"angle_deg": float(rng.uniform(10, 45)), "ratio": float(rng.uniform(0.35, 0.65))}
        seal = float(rng.choice([0, 1])) * outer * float(rng.uniform(0.02, 0.06))
        words = {"D_inner_mm": inner, "D_outer_mm": outer, "pads": pads, **shape, "seal_mm": seal, "p_outer": 1e5}
        words |= {"p_inner": float(rng.choice([0.3, 1, 3])) * 1e5, "speed_rpm": float(10 ** rng.uniform(3, 4.3))}
        return load_scene("spiral_groove", words | {"mu": float(10 ** rng.uniform(-3, -1.7))})
    words = {"eccentricity": float(rng.uniform(0.05, 0.6)), "L_over_D": float(rng.uniform(0.5, 1.5))}
    words |= {"p_end": float(rng.choice([1, 3])) * 1e5, "speed_rpm": float(10 ** rng.uniform(3, 4))}
    grooves = {"depth_um": float(rng.uniform(10, 30)), "count": int(rng.integers(6, 14))}
    grooves |= {"angle_deg": float(rng.uniform(18, 50)), "ratio": float(rng.uniform(0.4, 0.6))}
    return load_scene("herringbone_journal", words | {f"film.{name}": value for name, value in grooves.items()})


def numbers(scene: Any, eps1: float) -> dict[str, float]:
    with solve(scene, stopping={"eps1": eps1}) as solution:
        return {name: solution.numbers[name] for name in NAMES if name in solution.numbers}


def ladder(scene: Any) -> list[tuple[int, ...]]:
    """The grids, from 200 points on."""
    model = film_of(scene)
    assert model is not None
    first, unit = round_ring(scene, first_shape(scene.shape, model.fewest_meshes(), None, 200))
    grid = model.grid(first)
    meshes = grid.meshes
    grid.destroy()
    shapes = [finer(first, meshes, k, unit) for k in range(20)]
    return [shape for shape in shapes if math.prod(shape) <= MOST]


def told(kind: str, seed: int, count: int) -> None:
    errors: dict[str, dict[int, list[float]]] = {name: {} for name in NAMES}
    runs: dict[float, list[tuple[float, float]]] = {tol: [] for tol in TOLERANCES}
    shapes: dict[int, tuple[int, ...]] = {}
    for k in range(seed, seed + count):
        try:
            scene = drawn(kind, np.random.default_rng(k))
        except InputError:
            continue
        nx, ny = scene.shape
        fine = (
            [(n, int(1.7 * n)) for n in (331, 361, 397)]
            if kind == "spiral"
            else [(int(m * nx), int(m * ny)) for m in (3.1, 3.4, 3.8)]
        )
        found = [numbers(scene.with_shape(shape), 1e-7) for shape in fine]
        limits = {name: float(np.mean([one[name] for one in found])) for name in found[0]}
        for rung, shape in enumerate(ladder(scene)):
            shapes.setdefault(rung, shape)
            for name, value in numbers(scene.refined(shape), 1e-6).items():
                errors[name].setdefault(rung, []).append(abs(value / limits[name] - 1.0))
        for tol in TOLERANCES:
            with solve(scene, accuracy=tol, quantity="load", finest=FINEST) as solution:
                if solution.converged:
                    off = abs(solution.numbers["load"] / limits["load"] - 1.0)
                    runs[tol].append((solution.settings["accuracy_estimate"], off))
    print("error, %, median and root mean square, on the grids of the first film")
    for name, by_rung in errors.items():
        for rung, off in by_rung.items():
            both = 100 * np.median(off), 100 * np.sqrt(np.mean(np.square(off)))
            print(f"{name:9} {' x '.join(map(str, shapes[rung])):>10}  {both[0]:8.2g} {both[1]:8.2g}")
    for tol, ended in runs.items():
        right = sum(off <= estimate for estimate, off in ended)
        wide = np.median([estimate / max(off, 1e-9) for estimate, off in ended]) if ended else np.nan
        print(f"to {tol:g}: {len(ended)} of {count} reach it, {right} of them right, estimates {wide:.1f} times the error")


def muijderman(H: float, angle: float, ratio: float) -> float:
    """g of the narrow-groove theory (Muijderman 1966, Whipple): dp/ds = 6 mu U g/film^2 across the motion, with no flow."""
    gamma, cot = (1 - ratio) / ratio, 1 / math.tan(angle)
    across = (1 + gamma * H**3) * (gamma + H**3) + H**3 * (cot * (1 + gamma)) ** 2
    return gamma * H**2 * cot * (1 - H) * (1 - H**3) / across


def narrow_grooves(
    film: float, depth: float, angle: float, ratio: float, radii: tuple[float, float, float]
) -> tuple[float, float]:
    """Load and inner flow of a full film with infinitely many spirals, between equal pressures, at 200 pi rad/s in 0.01 Pa s.

    What flows through is held back by the grooves, in series and side by side, and by the seal's film. radii : inner, of the
    seal, outer.
    """
    mu, omega, (inner, edge, outer) = 0.01, 200 * math.pi, radii
    g = muijderman(film / (film + depth), angle, ratio)
    cubes = [ratio * (film + depth) ** k + (1 - ratio) * film**k for k in (-3, 3)]
    conducts = math.cos(angle) ** 2 / cubes[0] + math.sin(angle) ** 2 * cubes[1]
    pumped = 3 * mu * omega * g / film**2 * (outer**2 - edge**2)
    slope = pumped / (math.log(outer / edge) / conducts + math.log(edge / inner) / film**3)  # 6 mu Q/pi
    r = np.linspace(inner, outer, 100001)
    in_seal, beyond = slope * np.log(np.minimum(r, edge) / inner) / film**3, np.maximum(r, edge)
    p = in_seal + slope * np.log(beyond / edge) / conducts - 3 * mu * omega * g / film**2 * (beyond**2 - edge**2)
    return abs(2 * math.pi * float(np.mean(p * r)) * (outer - inner)), abs(math.pi * slope / (6 * mu))


def against_theory() -> None:
    """30 and 60 spirals, extrapolated by one over their number, on cells of several shapes."""
    theory = np.array(narrow_grooves(1e-5, 2e-5, math.radians(16), 0.6, (0.015, 0.019, 0.03)))
    print("points a groove and land, rows an edge moves on by a column: errors of load and inner flow, %")
    for nx in (16, 24, 36):
        for rows in (0.37, 0.618, 0.87, 1.0, 1.15, 1.382, 2.2):
            found = []
            for pads in (30, 60):
                ny = round(rows * nx * pads * 0.015 / (2 * math.pi * 0.0225 * math.tan(math.radians(16))))
                scene = load_scene("spiral_groove", {"pads": pads, "p_inner": 1e6, "p_outer": 1e6})
                with solve(scene.with_shape((nx, ny))) as solution:
                    found.append(np.array([solution.numbers[name] for name in ("load", "inner_flow")]))
            print(f"{nx} {rows}: {100 * ((2 * found[1] - found[0]) / theory - 1).round(4)}", flush=True)


if __name__ == "__main__":
    what, *rest = sys.argv[1:] or ["spiral"]
    if what == "theory":
        against_theory()
    else:
        told(what, *map(int, rest or (100, 26)))
