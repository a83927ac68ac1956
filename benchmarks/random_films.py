"""A method on random films: does it always end, in how many steps, and who had to help?

Films: rough on the scale of the grid, rough and smooth, stepped, dimpled; film ratios up to 100; 0 to 1 MPa all round; speeds
from 0.05 to 50 m/s; 32 to 128 points a side. Prints the distribution of steps and writes every run to a csv.

    python benchmarks/random_films.py [--films 10000] [--seed 0] [--method active-set]
"""

import argparse
import csv
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import petsc4py

petsc4py.init(sys.argv[:1])

from lcp_lube.api import solve  # noqa: E402
from lcp_lube.base.parallel import Array  # noqa: E402
from lcp_lube.scenes.published import LubricationScene  # noqa: E402

KINDS = ("grid_rough", "rough", "stepped", "dimpled")


class RandomScene(LubricationScene):
    """A square with a film that depends on a seed: log-uniform between h_min and ratio h_min in one of four ways."""

    dimension: Any = 2
    seed: int
    kind: str
    ratio: float

    @property
    def gap(self) -> Any:
        rng = np.random.default_rng(self.seed)
        cells = {"grid_rough": self.n, "rough": self.n // 4, "stepped": 5, "dimpled": 0}[self.kind]
        lattice = rng.random((cells + 1, cells + 1))
        dimples, fill, L = int(rng.integers(2, 9)), rng.uniform(0.3, 0.8), self.L

        def film(x: Array, y: Array) -> Array:
            if self.kind == "dimpled":
                u, v = (np.abs((a / L * dimples) % 1.0 - 0.5) < 0.5 * fill for a in (x, y))
                level = (u & v).astype(float)
            else:
                i, j = (np.clip((a / L * cells).astype(int), 0, cells) for a in (x, y))
                level = lattice[j, i]
                if self.kind == "rough":  # bilinear, not stepped
                    s, t = (np.clip(a / L * cells, 0, cells) - k for a, k in ((x, i), (y, j)))
                    i1, j1 = np.minimum(i + 1, cells), np.minimum(j + 1, cells)
                    level = (1 - t) * ((1 - s) * level + s * lattice[j, i1]) + t * (
                        (1 - s) * lattice[j1, i] + s * lattice[j1, i1]
                    )
            return 1e-5 * self.ratio**level

        return film


def scene(seed: int) -> RandomScene:
    rng = np.random.default_rng([seed, 1])
    p = float(rng.choice([0.0, 10 ** rng.uniform(3, 6)]))
    return RandomScene(
        name=f"random{seed}",
        seed=seed,
        kind=str(rng.choice(KINDS)),
        ratio=float(10 ** rng.uniform(0.1, 2)),
        n=int(rng.choice([32, 48, 64, 96, 128], p=[0.35, 0.25, 0.25, 0.1, 0.05])),
        U=float(10 ** rng.uniform(np.log10(0.05), np.log10(50))),
        p_a=p,
        p_b=p,
        p_side=p,
        scheme="face",
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--films", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--method", default="active-set", help="or auto, fas, ...; default active-set")
    parser.add_argument("--output", type=Path, help="default results/random_films.csv, with the method's name for another one")
    args = parser.parse_args()
    other = "" if args.method == "active-set" else f"_{args.method}"
    args.output = args.output or Path(__file__).parent / "results" / f"random_films{other}.csv"
    choices: dict[str, Any] = {"recipe": "umfpack", "nested": False} if args.method == "active-set" else {}
    steps, outcomes, helped = [], Counter[str](), 0
    with args.output.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["seed", "kind", "n", "ratio", "U", "p", "outcome", "iterations", "helped", "message"])
        for seed in range(args.seed, args.seed + args.films):
            case = scene(seed)
            solution = solve(case, method=args.method, **choices)
            took_over = solution.took_over is not None
            steps.append(solution.iterations)
            outcomes[str(solution.outcome)] += 1
            helped += took_over
            data = [seed, case.kind, case.n, f"{case.ratio:.4g}", f"{case.U:.4g}", f"{case.p_a:.4g}", solution.outcome]
            writer.writerow([*data, solution.iterations, int(took_over), "" if solution.converged else solution.message])
            solution.destroy()
    percentiles = np.percentile(steps, [50, 90, 99, 100]).astype(int)
    print(f"{args.films} films: {dict(outcomes)}; another method took over {helped} times")
    print("steps: median {}, 90 % {}, 99 % {}, most {}".format(*percentiles))


if __name__ == "__main__":
    main()
