"""Whether all ranks have reached the same place in the program; where they have not, the job is ended."""

import hashlib
import os
import re

from mpi4py import MPI

from ..errors import InputError
from .together import all_come


class Alarm:
    """Made by all ranks together; lives on a communicator of its own, as ranks that did not fail wait in some other call."""

    def __init__(self) -> None:
        self._comm = MPI.COMM_WORLD.Dup()
        self.rank, self.alone = self._comm.rank, self._comm.size == 1

    def all_arrive(self) -> bool:
        """True if every rank calls this within the time. If some do, the lowest of them gives up first, and reports for all.

        The time is 4 s, up to 6 s on a busy machine: ranks that fail together are then further apart, and a job in which one
        rank fails is still to end within 10 s.
        """
        seconds = min(6.0, 4.0 * max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1)))
        return all_come(self._comm, seconds + min(0.25 * self.rank, 2.0))

    def end_all(self, status: int) -> None:
        if not self.alone:
            self._comm.Abort(status)


def check_same(comm: MPI.Comm, what: str, value: object) -> None:
    """Refuse input that is not the same on all ranks, which would end in a hang or in nonsense. Collective.

    Parameters
    ----------
    value : its `repr` is compared, addresses left out.
    """
    if comm.size == 1:
        return
    text = re.sub(r" at 0x[0-9a-f]+", "", repr(value))  # a function's address is each process's own
    digest = hashlib.sha256(text.encode(errors="replace")).digest()
    digests = comm.allgather(digest)
    other = next((rank for rank, found in enumerate(digests) if found != digests[0]), None)
    if other is not None:
        raise InputError(f"{what}: not the same on rank 0 and on rank {other}")
