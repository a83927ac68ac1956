"""Run under mpiexec by the tests: a command in which rank 1 alone fails, inside the solve, in the way that is named.

mpiexec -n 3 python tests/mpi_one_rank_fails.py error|input|memory|interrupt|sleep solve problem1 ...

Every rank says its process id on stderr when it comes to the first linear solve; sleep: rank 1 stays there.
"""

import os
import sys
import time

from mpi4py import MPI

from lcp_lube.__main__ import main
from lcp_lube.errors import InputError
from lcp_lube.linear import full as newton_matrix

FAILURES: dict[str, BaseException] = {
    "error": ZeroDivisionError("on purpose"),
    "input": InputError("bad on purpose"),
    "memory": MemoryError(),
    "interrupt": KeyboardInterrupt(),
}
honest = newton_matrix.FullSystem.solve


def solve(self, *arguments):
    print(f"pid {os.getpid()}", file=sys.stderr, flush=True)
    if MPI.COMM_WORLD.rank == 1:
        if sys.argv[1] == "sleep":
            time.sleep(300)
        raise FAILURES[sys.argv[1]]
    return honest(self, *arguments)


newton_matrix.FullSystem.solve = solve  # type: ignore[method-assign]
sys.exit(main(sys.argv[2:]))
