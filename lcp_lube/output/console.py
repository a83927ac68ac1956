"""Text for people, on standard output."""

import os
import sys

from mpi4py import MPI

from ..errors import InputError


def say(text: str) -> None:
    """Print on rank 0.

    Raises
    ------
    InputError : on rank 0, standard output cannot take it (a full disk).
    """
    if MPI.COMM_WORLD.rank == 0:
        try:
            print(text, flush=True)
        except OSError as error:
            sys.stdout = open(os.devnull, "w")  # noqa: SIM115  (else Python tries to flush it once more at its end)
            raise InputError(f"standard output: {error.strerror}") from None
