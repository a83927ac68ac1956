"""Run under mpiexec by the tests: a string over an obstacle, given by the user on the ranks' own points.

mpiexec -n 3 python tests/mpi_complementarity.py METHOD N     prints outcome, iterations and sum v as JSON
"""

import json
import sys
from typing import Any

import numpy as np
import petsc4py

petsc4py.init(sys.argv[:1])

from mpi4py import MPI  # noqa: E402
from petsc4py import PETSc  # noqa: E402

from lcp_lube import Complementarity, solve  # noqa: E402


def string(n: int, comm: MPI.Comm) -> Complementarity:
    """-v'' = -50 on (0, 1), v = 0 at the ends, v >= -0.1 - 0.3 x, v <= 1 everywhere but v(x_1) = -0.01."""
    matrix = PETSc.Mat().createAIJ((n, n), nnz=3, comm=comm)
    first, end = matrix.getOwnershipRange()
    for i in range(first, end):
        for j, value in ((i - 1, -1.0), (i, 2.0), (i + 1, -1.0)):
            if 0 <= j < n:
                matrix.setValue(i, j, value)
    matrix.assemble()
    x, y = matrix.createVecs()

    def F(v: np.ndarray) -> np.ndarray:
        x.setArray(v)
        matrix.mult(x, y)
        return y.array_r + 50.0 / (n + 1) ** 2

    number = np.arange(first, end)
    lower, upper = -0.1 - 0.3 * (number + 1) / (n + 1), np.ones(number.size)
    lower[number == 0] = upper[number == 0] = -0.01
    return Complementarity(F, lambda v: matrix.copy(), lower, upper, np.zeros(number.size), n=n)


def solve_string(method: str, n: int, comm: MPI.Comm) -> dict[str, Any]:
    """Outcome, iterations and what the answer is known by. Collective."""
    solution = solve(string(n, comm), method=method, comm=PETSc.Comm(comm), stopping={"eps1": 1e-11})
    problem, v = solution.problem, solution.fields["v"]
    record = {
        "outcome": str(solution.outcome),
        "iterations": solution.iterations,
        "sum": problem.reduce.sum(v),
        "first": comm.bcast(float(v[0])),
        **problem.quantities(solution.fields),
    }
    solution.destroy()
    return record


def main(n: int) -> None:
    records = {method: solve_string(method, n, MPI.COMM_WORLD) for method in ("semismooth", "interior", "active-set")}
    if MPI.COMM_WORLD.rank == 0:
        print(json.dumps(records))


if __name__ == "__main__":
    main(int(sys.argv[1]))
