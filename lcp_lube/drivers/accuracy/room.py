"""Whether there is room for the next grid of a run to an accuracy, in what was allowed and in memory."""

from math import ceil, prod

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from ...errors import InputError
from ...problems.solution import Solution
from ..memory import DENSE, available
from .rungs import ASYMPTOTIC

BYTES, BYTES_FAS = {1: 900, 2: 1200}, 300  # memory of a point (`memory.MEASURED`)
SMALL_CHANGE = 1e8  # bytes that every machine has


def no_room(solution: Solution, shape: tuple[int, ...], finest: tuple[int, ...] | None, estimate: float, tol: float) -> str:
    """Why the next grid cannot be; empty if it can. Collective.

    Raises
    ------
    InputError : even with second order from here on, the tolerance is out of memory's reach.
    """
    problem, name = solution.problem, " x ".join(map(str, shape))
    if finest and any(n > most for n, most in zip(shape, finest, strict=True)):
        return f"a finer grid than {' x '.join(map(str, finest))} is not allowed"
    each = BYTES_FAS if solution.asked == "fas" else BYTES[len(shape)]
    dense = bool(getattr(problem, "dense", False))

    def needed(points: float) -> float:
        """Bytes of all ranks."""
        return DENSE * points**2 if dense else each * points

    factor = 0.7 * (estimate / tol) ** 0.5 if estimate < ASYMPTOTIC else 0.0
    points = max(prod(shape), prod(factor * n for n in problem.grid.shape))
    if needed(points) < SMALL_CHANGE:
        return ""
    comm = problem.grid.comm
    machine = comm.Split_type(MPI.COMM_TYPE_SHARED)
    share = comm.allreduce(machine.size / comm.size, MPI.MAX)  # of the points, on the machine that has the most ranks
    machine.Free()
    left = comm.allreduce(available(), MPI.MIN) / share
    if points > prod(shape) and not finest and (needed(points) > left or points > np.iinfo(PETSc.IntType).max // 2):
        raise InputError(
            f"--accuracy {tol:g}: takes some {ceil(factor * problem.grid.shape[0])} points along x (with "
            f"{problem.grid.shape[0]} it is {estimate:.1e}), {needed(points) / 1e9:.0f} GB; {left / 1e9:.0f} GB are available"
        )
    if needed(prod(shape)) > left:
        return f"a grid of {name} needs {needed(prod(shape)) / 1e9:.0f} GB, {left / 1e9:.0f} GB are available"
    return ""
