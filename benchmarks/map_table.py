"""What docs/results.md and docs/comparison.md say of the stability maps, from their csv.

    python benchmarks/map_table.py

Prints a line of docs/comparison.md's table for each map, and docs/results.md's words on din-pc; tests/docs/test_readme.py
compares.
"""

import csv
from pathlib import Path
from statistics import median

RESULTS = Path(__file__).parent / "results"
MAPS = {
    "film_ratio": "film ratio 1.1 to 1e4, 12 to 2000 points a side",
    "supply_speed": "speed 1e-3 to 1e3 m/s, supply 0 to 10 MPa",
    "roughness": "roughness of amplitude up to 20 um (standard deviation 9.6 um) on a film of 15 to 25 um",
}
METHODS = ("auto", "active-set", "din", "din-pc", "fas", "monotone", "fbn-a", "fbn-i")


def rows(name: str) -> list[dict[str, str]]:
    with (RESULTS / f"stability_{name}.csv").open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def lines() -> list[str]:
    """The table's lines, right answers of all runs, and the most steps of right answers."""
    most = dict.fromkeys(METHODS, 0)
    out = []
    for name, title in MAPS.items():
        cells = []
        for method in METHODS:
            mine = [row for row in rows(name) if row["method"] == method]
            right = [int(row["iterations"]) for row in mine if row["outcome"] == "converged"]
            most[method] = max(most[method], *right)
            cells.append(f"{len(right)}/{len(mine)}")
        out.append(f"| {title} | {' | '.join(cells)} |")
    return [*out, f"| most steps in the three | {' | '.join(map(str, most.values()))} |"]


def din_pc() -> str:
    """The words on din-pc's iterations."""
    mine = [row for name in MAPS for row in rows(name) if row["method"] == "din-pc"]
    right = [int(row["iterations"]) for row in mine if row["outcome"] == "converged"]
    failed = len(mine) - len(right)
    return f"median {median(right):g}, most {max(right)} iterations; {failed} of {len(mine)} films of the maps fail"


if __name__ == "__main__":
    print("\n".join([*lines(), "", din_pc()]))
