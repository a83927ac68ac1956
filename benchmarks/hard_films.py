"""Multigrid on drawn films whose pockets, grooves and holes are as wide as one to three cells: how many are handed over?

63 to 255 points a side, film ratios to 100, walls from 1 mm/s to 1 km/s, a quarter of them rings, all schemes, half of them,
and all rings, with pressure all round. Laws: corners (pockets), stripes (grooves along x or y), holes (round), blocks (a random
height for each block of one to three cells), mixed (some of each). Prints the films that are not solved by cycles alone, and
cycles.

    python benchmarks/hard_films.py [--films 60] [--seed 0] [--law mixed] [--full] [--scheme nodal]
"""

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import petsc4py

petsc4py.init(sys.argv[:1])

from fas import cycles  # noqa: E402

from lcp_lube.base.parallel import Array  # noqa: E402
from lcp_lube.problems.film.lubrication import LubricationProblem  # noqa: E402
from lcp_lube.problems.film.reynolds import box_scheme  # noqa: E402
from lcp_lube.problems.grid import Grid  # noqa: E402

LAWS = ("corners", "stripes", "holes", "blocks", "mixed")
L, THIN, MU = 0.1, 1e-5, 0.015


@dataclass(frozen=True)
class Drawn:
    """A film of a seed and a law: nx by ny cells of size d, what lies in them, and how it is run."""

    seed: int
    law: str
    nx: int
    ny: int
    ring: bool
    ratio: float
    U: float
    p: float
    scheme: str
    film: Callable[[Array, Array], Array]

    def problem(self, full: bool = False) -> LubricationProblem:
        """Of the film; full : with so much pressure all round that it stays full."""
        ends = (("periodic",) * 2 if self.ring else ("open",) * 2, ("open",) * 2)
        grid = Grid((self.nx, self.ny), (L, L * self.ny / self.nx), ends=ends)
        natural = 6 * MU * self.U * L / THIN**2
        p = 100 * natural if full else self.p
        data: Any = {"mu": MU, "U": self.U, "p_unit": max(natural, p), "p_sides": (p,) * 4}
        scheme = box_scheme(grid, self.film, scheme=self.scheme, **data)
        return LubricationProblem(grid, scheme, **data, p_c=0.0, film=self.film)


def drawn(seed: int, law: str, scheme: str | None = None) -> Drawn:
    rng = np.random.default_rng([seed, LAWS.index(law), 29])
    nx, ny = (int(n) for n in rng.integers(63, 256, 2))
    ring, ratio, U = bool(rng.random() < 0.25), float(10 ** rng.uniform(0.3, 2)), float(10 ** rng.uniform(-3, 3))
    p = float(rng.choice([0.0, 10 ** rng.uniform(3, 6)]))
    if ring and p == 0.0:  # nothing would feed it, which scenes refuse: any void that goes round is an answer
        p = float(10 ** np.random.default_rng([seed, LAWS.index(law), 31]).uniform(3, 6))
    own = str(rng.choice(["nodal", "face", "upwind"]))
    shape, wedge = rng.integers(3), float(rng.uniform(0, 1.5))
    d, blocks = L / nx, int(rng.integers(1, 4))
    lattice = rng.random((ny // blocks + 2, nx // blocks + 2))
    parts: list[tuple[str, float, Array]] = []  # kind, depth, where, in cells
    for kind, most in (("corners", 60), ("stripes", 8), ("holes", 60)):
        if law in (kind, "mixed"):
            for _ in range(int(10 ** rng.uniform(0, np.log10(most)))):
                depth = (ratio - 1) * THIN * (1.0 if rng.random() < 0.7 else rng.random())
                size, at = rng.uniform(1, 3, 2), rng.uniform(0, 1, 2) * (nx, ny)
                if kind == "stripes":
                    side = int(rng.integers(2))
                    size[side], at[side] = (1e9, 0.0) if rng.random() < 0.5 else (rng.uniform(3, nx), at[side])
                parts.append((kind, depth, np.array([*at, *size])))

    def film(x: Array, y: Array) -> Array:
        s, t = x / d, y / d
        turn = 2 * np.pi * s / nx
        smooth = (np.zeros_like(s), wedge * (1 - s / nx), 1 + np.cos(turn) * min(wedge, 0.9))[2 if ring else shape]
        h = THIN * (1 + smooth) + 0 * t
        if law == "blocks" or (law == "mixed" and seed % 4 == 0):
            i, j = (np.clip((a / blocks).astype(int), 0, n // blocks + 1) for a, n in ((s, nx), (t, ny)))
            h = h * ratio ** lattice[j, i]
        for kind, depth, (a, b, width, height) in parts:
            if kind == "holes":
                inside = (s - a) ** 2 + (t - b) ** 2 < (0.5 * width) ** 2
            else:
                inside = (abs(s - a) < 0.5 * width) & (abs(t - b) < 0.5 * height)
            h = np.where(inside, np.maximum(h, THIN + depth), h)
        return h

    return Drawn(seed, law, nx, ny, ring, ratio, U, p, scheme or own, film)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--films", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--law", choices=LAWS, action="append", help="default all, so many films of each")
    parser.add_argument("--full", action="store_true", help="with so much pressure all round that films are full")
    parser.add_argument("--scheme", choices=("nodal", "face", "upwind"), help="default drawn")
    args = parser.parse_args()
    for law in args.law or LAWS:
        over, counts, work = 0, [], 0.0
        for seed in range(args.seed, args.seed + args.films):
            case = drawn(seed, law, args.scheme)
            problem = case.problem(args.full)
            run, message = cycles(problem, 1e-8)
            details = run.details
            if message:
                over += 1
                kinds = f"{case.nx} x {case.ny}{' ring' if case.ring else ''} {case.scheme} ratio {case.ratio:.3g}"
                print(f"{law} {seed}: {kinds} U {case.U:.2g} p {case.p:.2g}: {message}", flush=True)
            else:
                counts.append(details["cycles"])
                work += details["work_units"]
            problem.destroy()
        shares = np.percentile(counts, [50, 90, 100]).astype(int) if counts else []
        mean = work / max(len(counts), 1)
        print(
            f"{law}: {over} of {args.films} not by cycles; others' cycles 50, 90, 100 %: {shares}, work {mean:.0f}", flush=True
        )


if __name__ == "__main__":
    main()
