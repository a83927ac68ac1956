"""Start PETSc with the left-over arguments, run the command, end every rank when one fails."""

import os
import signal
import sys
import time
import traceback

from .arguments import parse, split
from .errors import InputError


def main(argv: list[str] | None = None) -> int:
    """Run one command line; returns the exit status (0 converged, 1 not, 2 bad input, 130 interrupted)."""
    words = sys.argv[1:] if argv is None else argv
    try:
        own, petsc_arguments = split(words)
        args = None if "-help" in petsc_arguments and not own else parse(own)
    except InputError as error:
        return _refuse(error)
    if getattr(args, "json", False):
        _reserve_stdout()
    alarm = _start(petsc_arguments)
    if args is None:
        return 0
    from .cli import run

    try:
        return run(args)
    except InputError as error:
        return _refuse(error, alone=not alarm.all_arrive())
    except MemoryError:
        short = InputError("not enough memory; fewer points or more ranks are needed")
        return _refuse(short, alone=not alarm.all_arrive())
    except KeyboardInterrupt:
        print("lcp-lube: interrupted", file=sys.stderr)
        return 130
    except Exception:
        if alarm.all_arrive() and alarm.rank > 0:
            return 1  # rank 0 has the same to say
        traceback.print_exc()
        sys.stderr.flush()
        alarm.end_all(1)
        return 1


class _Alarm:
    """Tells whether all ranks have come to the same place, and ends them all if not."""

    def __init__(self) -> None:
        from mpi4py import MPI

        self._comm = MPI.COMM_WORLD.Dup()  # of its own: ranks that did not fail wait in some other collective call
        self.rank, self.alone = self._comm.rank, self._comm.size == 1

    def all_arrive(self, seconds: float = 4.0) -> bool:
        """True if every rank calls this within the time. If some do, the lowest of them gives up first, and speaks for all."""
        request = self._comm.Ibarrier()
        end = time.monotonic() + seconds + min(0.25 * self.rank, 4.0)
        while not request.Test():
            if time.monotonic() > end:
                return False
            time.sleep(0.01)
        return True

    def end_all(self, status: int) -> None:
        if not self.alone:
            self._comm.Abort(status)


def _start(petsc_arguments: list[str]) -> _Alarm:
    """Initialise MPI and PETSc."""
    import petsc4py

    petsc4py.init(["lcp-lube", *petsc_arguments])
    alarm = _Alarm()
    if alarm.alone:
        signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # `| head` is no error; PETSc's handler reports a crash
    return alarm


def _reserve_stdout() -> None:
    """Keep stdout for the JSON: what PETSc prints, monitors and -log_view at its very end, goes to stderr."""
    sys.stdout.flush()
    # Both names: petsc4py hands PETSc's output to a sys.stdout that differs from sys.__stdout__.
    sys.stdout = sys.__stdout__ = os.fdopen(os.dup(1), "w")  # type: ignore[misc]
    os.dup2(2, 1)


def _refuse(error: InputError, alone: bool = False) -> int:
    """One line, status 2: from rank 0 if all ranks refuse (before MPI starts they do), else from the one that does."""
    rank = os.environ.get("OMPI_COMM_WORLD_RANK") or os.environ.get("PMI_RANK") or "0"
    if rank == "0" or alone:
        print(f"lcp-lube: {error}", file=sys.stderr, flush=True)
    if alone:
        from mpi4py import MPI

        MPI.COMM_WORLD.Abort(2)
    return 2


if __name__ == "__main__":
    sys.exit(main())
