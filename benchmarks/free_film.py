"""A free film: one number a cell, 1e5 of them, chosen for the largest load; its gain over the best regular texture.

A flat pad, 10 mm square, slides at 1 m/s over oil of 20 mPa s, 2 um away, 1 bar all round. Material may be taken away by up
to 4 um at every one of 320 x 320 points, a fifth of that in the mean: the volume of the texture. The depth is filtered by a
cone of radius 0.25 mm, so that no detail is finer than that and grids agree on it. The load's derivative by every number is
one transposed solve (docs/gradients.md); a step takes the best design by the linear forecast within a distance that every
number has for itself, shorter where it turns back and longer where it goes on, at the price of volume that keeps the bound.
The best regular texture has the same bounds and at most the same volume: square dimples in rows and columns over a part of the
pad from its inlet, the best of 125. The best single pocket is a rectangle from the inlet on, the best of 80.

    python benchmarks/free_film.py [--n 320] [--steps 40] [--results benchmarks/results]

The design is stored after each step (free_film.npz); a run that was stopped goes on from there. Writes free_film.csv and
free_film.png.
"""

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import convolve
from scipy.optimize import brentq

from lcp_lube import solve
from lcp_lube.base.resumable import ResumableCsv
from lcp_lube.drivers.derivatives.adjoint import Adjoint
from lcp_lube.drivers.derivatives.film_gradient import FilmGradient, areas
from lcp_lube.scenes.bearing import BearingScene

L, H, DEEPEST, VOLUME, RADIUS = 10e-3, 2e-6, 4e-6, 0.2, 0.25e-3
PAD: dict[str, Any] = {
    "family": "bearing",
    "name": "free film",
    "dimension": 2,
    "L": L,
    "width": L,
    "U": 1.0,
    "fluid": {"mu": 0.02, "p_supply": 1e5},
    "film": [{"shape": "constant", "h": H}],
}
STEP, NARROWER, WIDER = 0.15, 0.6, 1.15  # of a number in the first step, and in later ones by how the last one went
SHARP = 1.0  # part of the mean derivative within which a number moves less than it may


@dataclass(frozen=True)
class Heights:
    """A film from its heights at the points of a grid, the sides' and the faces' in between by bilinear interpolation."""

    h: Any

    def __call__(self, x: Any, y: Any = None, /) -> Any:
        ny, nx = self.h.shape
        at = [np.clip(np.asarray(t, dtype=float) * (n + 1) / L - 1.0, 0.0, n - 1.0) for t, n in ((y, ny), (x, nx))]
        low = [np.minimum(t.astype(int), n - 2) for t, n in zip(at, (ny, nx), strict=True)]
        part = [t - k for t, k in zip(at, low, strict=True)]
        (j, i), (v, u) = low, part
        return (1 - v) * ((1 - u) * self.h[j, i] + u * self.h[j, i + 1]) + v * (
            (1 - u) * self.h[j + 1, i] + u * self.h[j + 1, i + 1]
        )


class FreeScene(BearingScene):
    """The pad with a film of heights in the place of shapes."""

    @property
    def gap(self) -> Any:
        return Heights(HEIGHTS[self.name])


HEIGHTS: dict[str, Any] = {}


def cone(n: int) -> Any:
    """Weights of the filter on a grid of n points a side, over and above the volume that a number stands for."""
    reach = int(RADIUS * (n + 1) / L)
    j, i = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    weights = np.maximum(0.0, reach + 1 - np.hypot(i, j))
    return weights / weights.sum()


def evaluated(rho: Any, weights: Any) -> tuple[float, Any]:
    """Load (N) above ambient and its derivative by the density of material taken away, 0 to 1, at every point."""
    n = rho.shape[0]
    HEIGHTS["free film"] = H + DEEPEST * convolve(rho, weights, mode="nearest")
    scene = FreeScene(**PAD, n=n)
    solution = solve(scene)
    if not solution.converged:
        raise SystemExit(f"free film: {solution.message}")
    adjoint = Adjoint(scene, solution, ["load"])
    slope = FilmGradient(adjoint).field("load") * areas(solution.problem.grid)
    load = solution.load
    adjoint.destroy()
    solution.destroy()
    # The filter's transpose: symmetric weights, but for the rim, where "nearest" repeats the outermost numbers.
    reach = weights.shape[0] // 2
    spread = convolve(np.pad(slope.reshape(n, n), reach), weights, mode="constant")
    for axis in (0, 1):
        spread = np.moveaxis(spread, axis, 0)
        spread[reach] += spread[:reach].sum(axis=0)
        spread[-reach - 1] += spread[-reach:].sum(axis=0)
        spread = np.moveaxis(spread[reach:-reach], 0, axis)
    return load, DEEPEST * spread


def moved(rho: Any, slope: Any, move: Any) -> Any:
    """The best design within the volume and so far from this one, by the load's linear forecast."""

    def at(price: float) -> Any:
        return np.clip(rho + np.clip((slope - price) / (SHARP * scale), -1.0, 1.0) * move, 0.0, 1.0)

    scale = np.abs(slope).mean()
    if at(0.0).mean() <= VOLUME:
        return at(0.0)
    return at(brentq(lambda price: at(price).mean() - VOLUME, 0.0, 10.0 * np.abs(slope).max(), xtol=1e-12))


def free(n: int, steps: int, folder: Path) -> tuple[float, Any]:
    """Load and design after so many steps, from where the last run stopped. Each step is a row of free_film.csv."""
    stored, weights = folder / "free_film.npz", cone(n)
    rho, before, move, first, best = np.full((n, n), VOLUME), np.zeros((n, n)), np.full((n, n), STEP), 0, -np.inf
    if stored.is_file():
        with np.load(stored) as data:
            if data["rho"].shape == rho.shape:
                rho, before, move, first, best = (
                    data["rho"],
                    data["before"],
                    data["move"],
                    int(data["step"]),
                    float(data["best"]),
                )
    rows = ResumableCsv(folder / "free_film.csv", ["step", "load_N", "volume", "change"], ["step"])
    for step in range(first, steps):
        load, slope = evaluated(rho, weights)
        new = moved(rho, slope, move)
        change = new - rho
        turned = change * before < 0
        move = np.clip(np.where(turned, NARROWER, WIDER) * move, 1e-3, 0.5)
        if load < best:
            move = 0.7 * move
        size = np.abs(change).mean()
        rows.add({"step": step, "load_N": f"{load:.6g}", "volume": f"{rho.mean():.4f}", "change": f"{size:.2e}"})
        print(f"{step:3d}  load {load:9.4f} N  volume {rho.mean():.4f}  mean change {size:.1e}", flush=True)
        rho, before, best = new, change, max(best, load)
        temporary = folder / ".free_film.npz"
        np.savez_compressed(temporary, rho=rho, before=before, move=move, step=step + 1, best=best)
        temporary.replace(stored)
    return evaluated(rho, weights)[0], rho


def regular(n: int) -> tuple[float, dict[str, Any]]:
    """The best of the regular textures: dimples in rows and columns over a part of the pad from its inlet."""
    best: tuple[float, dict[str, Any]] = (-np.inf, {})
    for part in (0.4, 0.55, 0.7, 0.85, 1.0):
        for count in (1, 2, 3, 4, 6):
            for depth in (1e-6, 1.5e-6, 2e-6, 3e-6, 4e-6):
                side = L * np.sqrt(VOLUME * DEEPEST / depth / (count * max(1, round(count * part))))
                columns = max(1, round(count * part))
                side = min(side, 0.98 * part * L / columns, 0.98 * L / count)
                dimples = {"shape": "dimples", "form": "square", "depth": depth, "size": float(side)}
                dimples |= {"columns": columns, "rows": count, "x": [0.0, part * L]}
                with solve({**PAD, "film": [*PAD["film"], dimples]}, n=n) as solution:
                    if solution.converged and solution.load > best[0]:
                        best = solution.load, dimples
    return best


def pocket(n: int) -> tuple[float, dict[str, Any]]:
    """The best of single rectangular pockets of the same volume that begin at the inlet."""
    best: tuple[float, dict[str, Any]] = (-np.inf, {})
    for long in np.linspace(0.5, 0.95, 10):
        for depth in np.linspace(1e-6, 4e-6, 8):
            wide = min(VOLUME * DEEPEST / depth / long, 0.98)
            shape = {"shape": "pocket", "depth": float(depth), "x": [0.0, float(long * L)]}
            shape |= {"y": [float(0.5 * (1 - wide) * L), float(0.5 * (1 + wide) * L)]}
            with solve({**PAD, "film": [*PAD["film"], shape]}, n=n) as solution:
                if solution.converged and solution.load > best[0]:
                    best = solution.load, shape
    return best


def draw(rho: Any, text: str, path: Path) -> None:
    from matplotlib.figure import Figure

    n = rho.shape[0]
    depth = 1e6 * DEEPEST * convolve(rho, cone(n), mode="nearest")
    figure = Figure(figsize=(5.4, 4.6), layout="constrained")
    axes = figure.subplots()
    image = axes.imshow(depth, origin="lower", extent=(0, 1e3 * L, 0, 1e3 * L), cmap="Blues", vmin=0.0)
    axes.set(xlabel="x (mm), the wall moves to the right", ylabel="y (mm)")
    axes.set_title(text, fontsize=9)
    figure.colorbar(image, ax=axes, label="depth (µm)")
    figure.savefig(path, dpi=130)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--n", type=int, default=320, help="points a side; default 320, 102,400 numbers")
    parser.add_argument("--steps", type=int, default=40)
    parser.add_argument("--results", type=Path, default=Path("benchmarks/results"))
    args = parser.parse_args()
    args.results.mkdir(parents=True, exist_ok=True)
    load, rho = free(args.n, args.steps, args.results)
    found = []
    for name, (_, shape) in (("texture", regular(min(args.n, 79))), ("pocket", pocket(min(args.n, 79)))):
        with solve({**PAD, "film": [*PAD["film"], shape]}, n=args.n) as solution:
            gain = 100.0 * (load / solution.load - 1.0)
            found.append(f"best {name} {solution.load:.1f} N: {gain:+.0f} %")
            print(f"best regular {name}: {solution.load:.4f} N, {shape}")
    print(f"free film {load:.4f} N with {rho.size} numbers; {'; '.join(found)}")
    draw(rho, f"load {load:.1f} N; {'; '.join(found)}", args.results / "free_film.png")


if __name__ == "__main__":
    main()
