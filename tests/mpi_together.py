"""Run under mpiexec by the tests: the last rank, or rank 0, alone fails; every rank says on stderr what it was told.

mpiexec -n 2 python tests/mpi_together.py helper|F|J|file|picture
"""

import sys
from pathlib import Path

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from lcp_lube import Complementarity, solve
from lcp_lube.base.resumable import ResumableCsv
from lcp_lube.base.together import on_all_ranks
from lcp_lube.errors import InputError
from lcp_lube.output.files import replacing
from lcp_lube.studies.drawing import save

WORLD = MPI.COMM_WORLD
LAST = WORLD.rank == WORLD.size - 1
N = 4 * WORLD.size


def helper():
    with on_all_ranks(WORLD, "here"):
        if LAST:
            raise InputError("bad on purpose")


def user(fault):
    def F(v):
        if fault == "F" and LAST:
            raise ZeroDivisionError("on purpose")
        return v - 1.0

    def J(v):
        if fault == "J" and LAST:
            raise ZeroDivisionError("on purpose")
        mat = PETSc.Mat().createAIJ(((4, N), (4, N)), nnz=1, comm=PETSc.COMM_SELF if fault == "J" else PETSc.COMM_WORLD)
        first = mat.getOwnershipRange()[0]
        for k in range(first, first + 4):
            mat.setValue(k, k, 1.0)
        mat.assemble()
        return mat

    infinite = np.full(4, np.inf)
    solve(Complementarity(F, J, np.zeros(4), infinite, np.ones(4), n=N), method="semismooth", comm=PETSc.COMM_WORLD)


def file():
    with replacing(Path("no/such/folder/x.npz"), WORLD):
        pass


def table():
    ResumableCsv(Path("/proc/no/x.csv"), ["a"], ["a"], WORLD).add({"a": 1})


def picture():
    def build():
        raise InputError("no figure")

    save(build, Path("x.png"), WORLD)


CASES = {"helper": helper, "F": lambda: user("F"), "J": lambda: user("J"), "file": file, "table": table, "picture": picture}
try:
    CASES[sys.argv[1]]()
except InputError as error:
    sys.stderr.write(f"told {error}\n")  # in one piece: the ranks share the stream
    sys.exit(2)
