"""Stiffness and damping of films between grooves on the ranks it is started on; how many films each rank linearises."""

import json
from typing import Any

from mpi4py import MPI

from lcp_lube import InputError, load_scene, solve
from lcp_lube.drivers.motions.coefficients import coefficients
from lcp_lube.drivers.motions.response import Response

SCENES = {
    "tilting_pad_journal": {"nx": 60, "ny": 3, "balance.tol": 1e-10},
    "fixed pads": {"nx": 60, "ny": 3, "balance": None, "eccentricity": 0.3, "tilts": [0.0] * 5},
    "tilting_pad_thrust": {"nx": 13, "ny": 9, "balance.tol": 1e-10},
    "two_groove_journal": {"nx": 36, "ny": 5, "balance": None, "eccentricity": 0.6},
}


def main() -> None:
    comm, made, fails = MPI.COMM_WORLD, Response.__init__, False
    count = [0]

    def counted(*given: Any, **more: Any) -> None:
        count[0] += 1
        if fails and comm.rank == comm.size - 1:
            raise InputError("as asked")
        made(*given, **more)

    Response.__init__ = counted  # type: ignore[method-assign]
    record: dict[str, Any] = {}
    for name, changes in SCENES.items():
        scene = load_scene(name if "_" in name else "tilting_pad_journal", changes)
        with solve(scene, stopping={"eps1": 1e-11}) as solution:
            counts = [comm.allgather(count[0])]
            found = coefficients(scene, solution, (0.0, 50.0))
            counts.append([after - before for after, before in zip(comm.allgather(count[0]), counts[0], strict=True)])
            record[name] = {
                "converged": bool(solution.converged),
                "matrices": [matrix.tolist() for one in found for matrix in (one.K, one.C)],
                "films": counts,
            }
            if name == "tilting_pad_journal":
                fails = True
                try:
                    coefficients(scene, solution)
                except InputError as error:
                    record["failed"] = comm.allgather(str(error))
                fails = False
        count[0] = 0
    if comm.rank == 0:
        print(json.dumps(record))


if __name__ == "__main__":
    main()
