"""Start PETSc with the left-over arguments, run the command, end every rank when one fails."""

import os
import signal
import sys
import traceback

from .base import petsc as petsc_start
from .cli.arguments import parse, parser_of_all
from .cli.words import split
from .errors import InputError, NotFound


def main(argv: list[str] | None = None) -> int:
    """Run one command line; returns the exit status (0 converged, 1 not, 2 bad input, 130 interrupted)."""
    if "_ARGCOMPLETE" in os.environ:  # the shell asks what may stand here
        from .cli.completion import complete

        complete(parser_of_all())
    words = sys.argv[1:] if argv is None else argv
    try:
        own, petsc_arguments = split(words)
        args = None if "-help" in petsc_arguments and not own else parse(own)
        if args is not None:
            args.words = words  # PETSc's among them
            if (ranks := getattr(args, "ranks", None)) is not None:
                from .base.ranks import run_on

                return run_on(ranks, words)
            if (threads := getattr(args, "threads", None)) is not None:
                if threads < 1:
                    raise InputError(f"--threads {threads}: at least 1 is needed")
                os.environ["NUMBA_NUM_THREADS"] = str(threads)  # what `base/crew` reads
    except InputError as error:
        return _refuse(error)
    if getattr(args, "json", False) or getattr(args, "worker", False):
        _reserve_stdout()
    try:
        petsc_start.start(petsc_arguments)
    except InputError as error:
        return _refuse(error)
    if args is None:
        return 0
    from mpi4py import MPI

    from .base.alarm import Alarm, check_same

    alarm = Alarm()
    if alarm.alone:
        signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # `| head` is no error; PETSc's handler reports a crash
    try:
        from .cli.main import run

        # After the imports, which take seconds on a busy machine: ranks that refuse do so at nearly the same time.
        check_same(MPI.COMM_WORLD, "command line", words)
        return run(args)
    except InputError as error:
        return _refuse(error, alone=not alarm.all_arrive())
    except MemoryError:
        short = InputError("not enough memory; fewer points or more ranks are needed")
        return _refuse(short, alone=not alarm.all_arrive())
    except NotFound as error:  # all ranks have it, as they looked for it together
        if alarm.rank == 0:
            print(f"lcp-lube: {error}", file=sys.stderr, flush=True)
        return 1
    except KeyboardInterrupt as interrupt:
        alone = not alarm.all_arrive()
        if alone or alarm.rank == 0:
            print("; ".join(["lcp-lube: interrupted", *map(str, interrupt.args)]), file=sys.stderr, flush=True)
        if alone:
            alarm.end_all(130)
        return 130
    except Exception:
        if alarm.all_arrive() and alarm.rank > 0:
            return 1  # rank 0 has the same to say
        traceback.print_exc()
        sys.stderr.flush()
        alarm.end_all(1)
        return 1


def _reserve_stdout() -> None:
    """Keep stdout for the JSON: what PETSc prints, monitors and -log_view at its very end, goes to stderr."""
    sys.stdout.flush()
    # Both names: petsc4py hands PETSc's output to a sys.stdout that differs from sys.__stdout__.
    sys.stdout = sys.__stdout__ = os.fdopen(os.dup(1), "w")  # type: ignore[misc]
    os.dup2(2, 1)


def _refuse(error: InputError, alone: bool = False) -> int:
    """One line, status 2: from rank 0 if all ranks refuse (before MPI starts they do), else from the one that does."""
    named = (os.environ.get(name) for name in ("OMPI_COMM_WORLD_RANK", "PMI_RANK", "PMIX_RANK"))
    rank = next((found for found in named if found), "0")
    if rank == "0" or alone:
        print(f"lcp-lube: {error}", file=sys.stderr, flush=True)
    petsc_start.forget_unread()
    if alone:
        from mpi4py import MPI

        MPI.COMM_WORLD.Abort(2)
    return 2


if __name__ == "__main__":
    sys.exit(main())
