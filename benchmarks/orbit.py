"""How a dynamically loaded journal's orbit becomes periodic: Ausas, Jai and Buscaglia (2009), the built-in `dynamic_journal`.

    python benchmarks/orbit.py [--nx 24] [--ny 3] [--steps 60] [--turns 7] [--results benchmarks/results]

Adds to orbit.csv, for every turn after the first, by how much the journal's place (in clearances) and the largest pressure (in
parts of its maximum) differ from those a turn before: at the turn's end, and the most over all its steps. The paper's grid and
steps are --nx 200 --ny 20 --steps 1000 (--turns 6: six minutes).
"""

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from lcp_lube import load_scene, solve
from lcp_lube.base.resumable import ResumableCsv

TURN = 0.02  # s
KEY = ("nx", "ny", "steps", "turn")
COLUMNS = ("place_end", "place_most", "p_max_most", "mass_defect_run")


def turns(nx: int, ny: int, steps: int, count: int) -> list[dict[str, Any]]:
    """Differences of each turn from the one before, from the second on."""
    changes = {"nx": nx, "ny": ny, "motion.t_end": count * TURN, "motion.steps": count * steps}
    with solve(load_scene("dynamic_journal", changes)) as solution:
        if not solution.converged:
            raise SystemExit(f"dynamic_journal: {solution.message}")
        rows, lost = solution.history, solution.settings["details"]["mass_defect_run"]
    place = np.array([[row["journal_x"], row["journal_y"]] for row in rows]).reshape(count, steps, 2)
    highest = np.array([row["p_max"] for row in rows]).reshape(count, steps)
    moved, changed = np.linalg.norm(np.diff(place, axis=0), axis=2), np.abs(np.diff(highest, axis=0)) / highest.max()
    return [
        {
            "place_end": f"{a[-1]:.2e}",
            "place_most": f"{a.max():.2e}",
            "p_max_most": f"{b.max():.2e}",
            "mass_defect_run": f"{lost:.1e}",
        }
        for a, b in zip(moved, changed, strict=True)
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, default in (("nx", 24), ("ny", 3), ("steps", 60), ("turns", 7)):
        parser.add_argument(f"--{name}", type=int, default=default)
    parser.add_argument("--results", type=Path, default=Path(__file__).parent / "results")
    args = parser.parse_args()
    table = ResumableCsv(args.results / "orbit.csv", [*KEY, *COLUMNS], KEY, signed=True)
    grid = {"nx": args.nx, "ny": args.ny, "steps": args.steps}
    found: list[dict[str, Any]] = []
    for turn in range(2, args.turns + 1):
        if table.find(**grid, turn=turn) is None:
            found = found or turns(args.nx, args.ny, args.steps, args.turns)
            table.add({**grid, "turn": turn, **found[turn - 2]})
        row = table.find(**grid, turn=turn) or {}
        print(f"turn {turn}: " + ", ".join(f"{name} {row[name]}" for name in COLUMNS))
    print(table.said)


if __name__ == "__main__":
    main()
