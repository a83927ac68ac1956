"""Films with sides of every kind, reduced and whole, on the ranks that it is started on: what differs, and the quantities."""

import json
import sys
from pathlib import Path

import numpy as np
from mpi4py import MPI
from side_scenes import SCENES, reduced_solve

from lcp_lube import load_scene, solve

KEYS = ("load", "friction", "p_max", "cavitated_fraction")


def main(folder: Path) -> None:
    record = {}
    for name, text in SCENES.items():
        if MPI.COMM_WORLD.rank == 0:
            (folder / f"{name}.toml").write_text(text)
        MPI.COMM_WORLD.barrier()
        scene = load_scene(folder / f"{name}.toml")
        auto, whole = (solver(scene, method="active-set", nested=False) for solver in (reduced_solve, solve))
        worst = max(
            auto.problem.reduce.max(np.abs(auto.fields[key] - whole.fields[key])) / max(1.0, whole.problem.reduce.max(field))
            for key, field in whole.fields.items()
        )
        quantities = auto.problem.quantities(auto.fields)
        record[name] = {
            "converged": auto.converged and whole.converged,
            "reduction": auto.settings["details"].get("reduction"),
            "difference": worst,
            **{key: quantities[key] for key in KEYS},
        }
        auto.destroy()
        whole.destroy()
    if MPI.COMM_WORLD.rank == 0:
        print(json.dumps(record))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
