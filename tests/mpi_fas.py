"""Run under mpiexec by test_fas.py: nonlinear multigrid on several ranks, records and whole fields to a folder.

mpiexec -n 3 python tests/mpi_fas.py OUT     writes OUT/record.json and OUT/fields.npz
"""

import json
import sys
import traceback
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI
from mpi_job import whole

SIDES = {"round": "periodic", "p_side": 1e5}
FED = {
    "family": "bearing", "dimension": 2, "L_mm": 100, "width_mm": 60, "U": 2.0, "nx": 64, "ny": 37,
    "fluid": {"mu": 0.02, "p_supply": 1e5},
    "film": [{"shape": "journal", "c": 50e-6, "eccentricity": 0.7}],
    "sides": {"west": "periodic", "east": "periodic"},
    "supply": [
        {"x_mm": [-10, 15], "y_mm": [13, 47], "p": 1e6},
        {"shape": "hole", "at_mm": [60, 20], "diameter_mm": 1e-3, "p": 3e5},
        {"shape": "hole", "at_mm": [40, 40], "diameter_mm": 9, "flow": 1e-6},
    ],
}  # fmt: skip
# name: (scene, changes). Sizes that no number of ranks divides; lines cut by the ranks, or too few of them; periodic in x.
CASES: dict[str, tuple[Any, dict[str, Any]]] = {
    "line": ("problem3", {"n": 53}),
    "plane": ("problem4", {"nx": 61, "ny": 47, "p_a": 1e5, "p_b": 1e5, "p_side": 1e5}),
    "even": ("rough", {"nx": 64, "ny": 50}),
    "few": ("problem4", {"nx": 31, "ny": 7, "scheme": "face"}),
    "flat": ("problem4", {"nx": 31, "ny": 1, "scheme": "upwind"}),
    "dimples": ("textured_slider", {"K": 2, "nx": 53, "ny": 67}),
    "ring": ("journal", {"nx": 72, "ny": 37, "eccentricity": 0.7, **SIDES}),
    "fed": (FED, {}),
    "lobes": ("three_lobe_journal", {"nx": 73, "ny": 21, "attitude_deg": 50.0}),
    "obstacles": (
        "obstacle_bratu",
        {"nx": 50, "ny": 61, "v_upper": 0.3, "v_lower": "0.28 - 10*((x - 0.2)^2 + (y - 0.2)^2)"},
    ),
    "pad": ("dimpled_pad", {"nx": 101, "ny": 101}),
    "pockets": (
        {
            "family": "bearing",
            "dimension": 2,
            "L_mm": 100,
            "width_mm": 80,
            "U": 1.0,
            "nx": 83,
            "ny": 70,
            "scheme": "nodal",
            "fluid": {"mu": 0.015},
            "sides": {"west": 1e5, "east": 1e5, "south": 1e5, "north": 1e5},
            "film": [
                {"shape": "linear", "h_start": 2e-5, "h_end": 1e-5},
                *(
                    {"shape": "pocket", "depth": 5e-5, "x_mm": [x, x + 2.5], "y_mm": [y, y + 2.2]}
                    for x, y in ((20, 26), (31, 26), (40.3, 27.1), (51, 53.2), (60, 54.1), (76.6, 53.1), (33, 70), (12, 9))
                ),
            ],
        },
        {},
    ),
    "hard": ("textured_slider", {"K": 3, "nx": 60, "ny": 63, "depth": 135e-6}),
}


def run(name: str, method: str = "fas") -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Record and whole fields of one solve."""
    from lcp_lube import load_scene, solve

    scene, changes = CASES[name]
    stopping = {"eps1": 1e-9 if name == "obstacles" else 1e-10}
    solution = solve(load_scene(scene, changes), method=method, stopping=stopping)
    fields = {key: whole(solution.problem.grid, values) for key, values in solution.fields.items()}
    record = {
        "outcome": str(solution.outcome),
        "message": solution.message,
        "took_over": solution.settings["took_over"],
        "iterations": solution.iterations,
        "levels": len(solution.levels),
        **solution.settings["details"],
        **solution.certificate.measures,
    }
    solution.destroy()
    return record, fields


def main(out: Path) -> None:
    record: dict[str, Any] = {}
    fields: dict[str, np.ndarray] = {}
    for name in CASES:
        record[name], found = run(name)
        fields |= {f"{name}_{field}": values for field, values in found.items()}
    if MPI.COMM_WORLD.rank == 0:
        np.savez(out / "fields.npz", **fields)
        (out / "record.json").write_text(json.dumps(record))


if __name__ == "__main__":
    try:
        main(Path(sys.argv[1]))
    except Exception:
        traceback.print_exc()
        sys.stderr.flush()
        MPI.COMM_WORLD.Abort(1)
