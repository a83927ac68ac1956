"""Text for people: answers on standard output, what is said beside them on standard error."""

import os
import sys

from mpi4py import MPI

from ..errors import InputError


def say(text: str) -> None:
    """Print on rank 0; on a terminal over the line of progress (base/progress).

    Raises
    ------
    InputError : on rank 0, standard output cannot take it (a full disk).
    """
    if MPI.COMM_WORLD.rank == 0:
        try:
            clear = "\r\x1b[K" if on_terminal() else ""
            # One write: after it `| head` may be gone, and the files not yet written.
            print(f"{clear}{text}\n", end="", flush=True)
        except OSError as error:
            sys.stdout = open(os.devnull, "w")  # noqa: SIM115  (else Python tries to flush it once more at its end)
            raise InputError(f"standard output: {error.strerror}") from None


def note(text: str) -> None:
    """Print on rank 0, on standard error."""
    if MPI.COMM_WORLD.rank == 0:
        print(text, file=sys.stderr, flush=True)


def coloured(text: str, word: str, good: bool) -> str:
    """The text with a word at the start of a line in green or, bold, in red; as it is where no terminal will show it.

    NO_COLOR, or TERM=dumb, switch that off.
    """
    if not on_terminal() or os.environ.get("NO_COLOR"):
        return text
    return f"\n{text}".replace(f"\n{word}", f"\n\x1b[{'32' if good else '1;31'}m{word}\x1b[0m", 1)[1:]


def on_terminal() -> bool:
    """Whether someone sees it. Ranks that mpiexec started may have a pseudo-terminal for stdout, but a pipe for stderr."""
    return sys.stdout.isatty() and sys.stderr.isatty() and os.environ.get("TERM") != "dumb"
