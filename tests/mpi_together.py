"""Run under mpiexec by the tests: the last rank, or rank 0, alone fails; every rank says on stderr what it was told.

mpiexec -n 2 python tests/mpi_together.py CASE
"""

import os
import resource
import signal
import sys
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from lcp_lube import Complementarity, solve
from lcp_lube.base.files import replacing
from lcp_lube.base.resumable import ResumableCsv
from lcp_lube.base.together import on_all_ranks
from lcp_lube.errors import InputError
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


def viewer(name, elsewhere=False):
    """The disk is full for one rank: for .npz and VTK for rank 0, which alone writes. Or one rank is in another folder."""
    with solved() as solution:
        if elsewhere:
            os.chdir("/proc" if LAST else ".")
        elif LAST if name.endswith(".h5") else WORLD.rank == 0:
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (300, 300))
        solution.save(name)


def checkpoint(write):
    """One rank finds no file."""
    from lcp_lube.drivers import checkpoint_file

    honest = checkpoint_file._transfer

    def missing(grid, path, *more, **how):
        return honest(grid, Path("/no/such/folder/x.ckpt") if LAST else path, *more, **how)

    with solved() as solution:
        grid, p = solution.problem.grid, solution.fields["p"]
        header, start = {"arrays": []}, 0
        if not write:
            checkpoint_file.write(Path("x.ckpt"), grid, {}, [("p", p), ("again", p)])
            header, start = checkpoint_file.read_header(Path("x.ckpt"), WORLD)
            WORLD.barrier()
            if WORLD.rank == 0:
                Path("y.ckpt").write_bytes(Path("x.ckpt").read_bytes())
                Path("x.ckpt").unlink()
            WORLD.barrier()
        checkpoint_file._transfer = missing
        try:
            if write:
                checkpoint_file.write(Path("x.ckpt"), grid, {}, [("p", p), ("again", p)])
            else:
                checkpoint_file.read_arrays(Path("y.ckpt"), grid, header, start)
        finally:
            WORLD.barrier()
            if WORLD.rank == 0:
                Path("y.ckpt").unlink(missing_ok=True)


def doctors():
    """A self-check that fails on one rank, the others not waiting for it inside the solve."""
    from lcp_lube.cli import doctor

    honest = doctor.load_scene

    def unreadable(name, changes):
        if LAST:
            raise ZeroDivisionError("on purpose")
        return honest(name, changes)

    doctor.load_scene, doctor.CHECKS, doctor.LOAD_TOL = unreadable, {"problem1": {"n": 20, "scheme": "face"}}, 1.0

    def alone(scene: Any, comm: Any) -> Any:
        return solve(scene, comm=PETSc.COMM_SELF)

    doctor.solve = alone
    checks = doctor.self_check(WORLD)
    assert [check["passed"] for check in checks] == [False]
    raise InputError(checks[0]["message"])


def solved():
    return solve("problem4", n=9, method="active-set")


CASES = {
    **{"helper": helper, "F": lambda: user("F"), "J": lambda: user("J"), "file": file, "table": table, "picture": picture},
    **{"vts": lambda: viewer("x.vts"), "h5": lambda: viewer("x.h5"), "npz": lambda: viewer("x.npz"), "doctor": doctors},
    "h5 elsewhere": lambda: viewer("x.h5", elsewhere=True),
    **{"write": lambda: checkpoint(True), "read": lambda: checkpoint(False)},
}
try:
    CASES[sys.argv[1]]()
except InputError as error:
    sys.stderr.write(f"told {error}\n")  # in one piece: the ranks share the stream
    sys.exit(2)
