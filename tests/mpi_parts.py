"""Bratu and obstacle scenes, reduced and whole, on the ranks that it is started on: by how much they differ."""

import json
from typing import Any

import numpy as np
from mpi4py import MPI
from side_scenes import reduced_solve

from lcp_lube import load_scene, solve

SCENES = {
    "bratu": {"nx": 17, "ny": 14},
    "obstacle_bratu": {"nx": 20, "ny": 21},
    "obstacle_bratu, multigrid": {"nx": 40, "ny": 49},
}


def main() -> None:
    record = {}
    for name, changes in SCENES.items():
        scene = load_scene(name.split(",")[0], changes)
        how: dict[str, Any] = {"stopping": {"eps1": 1e-11}}
        if "multigrid" in name:
            how |= {"method": "active-set", "recipe": "multigrid"}
        part = (reduced_solve if "multigrid" in name else solve)(scene, **how)
        whole = solve(scene, reduction=False, **how)
        reduce = whole.problem.grid.reduce
        record[name] = {
            "converged": bool(part.converged and whole.converged),
            "reduction": part.settings["details"].get("reduction"),
            "difference": max(
                float(reduce.max(np.abs(part.fields[key] - field)) / (reduce.max(np.abs(field)) or 1.0))
                for key, field in whole.fields.items()
            ),
        }
        part.destroy()
        whole.destroy()
    if MPI.COMM_WORLD.rank == 0:
        print(json.dumps(record))


if __name__ == "__main__":
    main()
