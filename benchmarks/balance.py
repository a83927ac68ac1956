"""Solves that a load balance takes from a cold start: eccentricities 0.1 to 0.97, bearings of every kind, L/D 0.25 to 2.

A film is solved at an eccentricity (in parts of that at which the journal touches its bore) and the attitude of 40 degrees, and
then its load is asked for, starting from nothing. attitude `given`: at 40 degrees, the load's direction is free; `open`: the
load is vertical, and the attitude follows.

    python benchmarks/balance.py [--nx 180] [--ny 15] [--results benchmarks/results]

Writes balance.csv: part is that of the eccentricity found; iterations are solves on the grid asked for, work is that of all
grids in such solves, by points.
"""

import argparse
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from lcp_lube import load_scene, solve
from lcp_lube.base.resumable import ResumableCsv
from lcp_lube.drivers.loads.place import touching

PARTS = (0.1, 0.3, 0.5, 0.7, 0.9, 0.97)
RATIOS = (0.25, 0.5, 1.0, 2.0)
ATTITUDE = 40.0
BEARINGS: dict[str, tuple[str, dict[str, Any]]] = {
    "ring": ("ring_journal", {}),
    "one groove": ("two_groove_journal", {"grooves_deg": [180.0]}),
    "two grooves": ("two_groove_journal", {}),
    "four grooves": ("two_groove_journal", {"grooves_deg": [45.0, 135.0, 225.0, 315.0]}),
    "barrel": ("two_groove_journal", {"barrel": 2e-5}),
    "lemon": ("lemon_journal", {}),
    "three lobes": ("three_lobe_journal", {}),
    "pressure dam": ("dam_journal", {}),
    "tilted axis": ("misaligned_journal", {}),
    "groove at h_max": ("journal", {}),
}
KEY = ("bearing", "attitude", "L_over_D", "asked_part", "nx", "ny")
COLUMNS = ("load_N", "outcome", "eccentricity", "part", "iterations", "solves", "work")


def balanced(bearing: str, attitude: str, L_over_D: float, asked_part: float, nx: int, ny: int) -> dict[str, Any]:
    """One balance."""
    name, changes = BEARINGS[bearing]
    grooved = name != "journal"
    changes = {**changes, "nx": nx, "ny": ny, "L_over_D" if grooved else "width_over_diameter": L_over_D}
    if name == "misaligned_journal":
        changes["tilt"] = 2.5e-4 / L_over_D  # half the clearance at the edges
    place = {"attitude_deg": ATTITUDE} if grooved else {}
    e = asked_part * (touching(load_scene(name, changes), math.radians(ATTITUDE)) if grooved else 1.0)
    there = solve(load_scene(name, {**changes, **place, "eccentricity": e}))
    load = there.problem.quantities(there.fields)["load"]
    there.destroy()
    scene = load_scene(name, {**changes, **(place if attitude == "given" else {}), "balance.load": load})
    solution = solve(scene)
    found, phi = solution.settings["balance"], solution.settings.get("attitude_deg", ATTITUDE)
    solution.destroy()
    most = touching(scene, math.radians(phi)) if grooved else 1.0
    row = {"eccentricity": found["value"], "part": f"{found['value'] / most:.4f}", "outcome": solution.outcome.value}
    return row | {"load_N": load, "work": f"{found['work']:.2f}", **{name: found[name] for name in ("iterations", "solves")}}


def keys(nx: int, ny: int) -> Iterator[dict[str, Any]]:
    for bearing, (name, _) in BEARINGS.items():
        for attitude in ("given",) if name == "journal" else ("given", "open"):
            for ratio in RATIOS:
                for part in PARTS:
                    yield dict(zip(KEY, (bearing, attitude, ratio, part, nx, ny), strict=True))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--nx", type=int, default=180)
    parser.add_argument("--ny", type=int, default=15)
    parser.add_argument("--results", type=Path, default=Path(__file__).parent / "results")
    args = parser.parse_args()
    table = ResumableCsv(args.results / "balance.csv", [*KEY, *COLUMNS], KEY, signed=True)
    print("| bearing | attitude | L/D | " + " | ".join(f"{part:g}" for part in PARTS) + " |")
    print("|---|---|---|" + "---|" * len(PARTS))
    for key in keys(args.nx, args.ny):
        row = table.row(key, lambda key=key: balanced(**key))  # type: ignore[misc]
        if key["asked_part"] == PARTS[0]:
            cells = []
        failed = "" if row["outcome"] == "converged" else "!"
        cells.append(f"{row['iterations']} ({float(row['work']):.1f}){failed}")
        if key["asked_part"] == PARTS[-1]:
            print(f"| {key['bearing']} | {key['attitude']} | {key['L_over_D']:g} | " + " | ".join(cells) + " |", flush=True)
    print(table.said)


if __name__ == "__main__":
    main()
