"""Work of one rank alone: when it fails there, it fails on all ranks."""

import errno
import os
import resource
from collections.abc import Iterator
from contextlib import contextmanager
from time import monotonic, sleep

from mpi4py import MPI

from ..errors import InputError

PATIENCE = 5.0  # seconds that a rank which failed waits for the others, which may be a little behind
FOREVER = 1e9  # seconds
EXPECTED: tuple[type[Exception], ...] = (InputError, OSError)


@contextmanager
def on_all_ranks(comm: MPI.Comm, what: str = "", caught: tuple[type[Exception], ...] = EXPECTED) -> Iterator[None]:
    """A block that may fail on some ranks and not on others; the lowest failure is raised on all. Collective.

    The block itself must not communicate: a rank that has left it waits for those still in it.

    Parameters
    ----------
    what : put before the reason.
    caught : what is raised as an InputError on every rank; anything else leaves at once, on the rank where it arose.

    Raises
    ------
    InputError : the same on every rank.
    """
    failure: Exception | None = None
    try:
        yield
    except caught as error:
        failure = error
    reason = "" if failure is None else _reason(failure)
    found = comm.allgather(reason)
    if first := next(filter(None, found), ""):
        raise InputError(f"{what}: {first}" if what else first) from failure


def all_come(comm: MPI.Comm, seconds: float) -> bool:
    """Whether all ranks call this within the time: one that failed inside PETSc or HDF5 may have left the others there."""
    request, end = comm.Ibarrier(), monotonic() + seconds
    while not request.Test():
        if monotonic() > end:
            return False
        sleep(0.01)
    return True


def _reason(error: Exception) -> str:
    if isinstance(error, InputError):
        return str(error) or "InputError"
    if isinstance(error, OSError):
        return error.strerror or str(error) or type(error).__name__
    return f"{type(error).__name__}: {error}"


def reserve(file: str, room: int) -> None:
    """Take room for so many bytes in a file that is there, before ranks write it: a full disk shows here.

    Raises
    ------
    OSError : the disk, or this rank's limit, has no such room, or this rank no such file.
    """
    with open(file, "r+b") as opened:
        if 0 <= resource.getrlimit(resource.RLIMIT_FSIZE)[0] < room:  # no call would report what another rank has taken
            raise OSError(errno.EFBIG, os.strerror(errno.EFBIG))
        if hasattr(os, "posix_fallocate"):
            os.posix_fallocate(opened.fileno(), 0, room)
