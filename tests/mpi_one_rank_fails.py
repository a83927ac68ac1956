"""Run under mpiexec by the tests: a command in which rank 1 alone fails, inside the solve, in the way that is named.

mpiexec -n 3 python tests/mpi_one_rank_fails.py error|input|memory solve problem1 ...
"""

import sys

from mpi4py import MPI

from lcp_lube.__main__ import main
from lcp_lube.errors import InputError
from lcp_lube.linear import newton_matrix

FAILURES = {"error": ZeroDivisionError("on purpose"), "input": InputError("bad on purpose"), "memory": MemoryError()}
honest = newton_matrix.FullSystem.solve


def solve(self, *arguments):
    if MPI.COMM_WORLD.rank == 1:
        raise FAILURES[sys.argv[1]]
    return honest(self, *arguments)


newton_matrix.FullSystem.solve = solve  # type: ignore[method-assign]
sys.exit(main(sys.argv[2:]))
