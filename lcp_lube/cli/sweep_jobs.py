"""A sweep's chains side by side: processes that are sent the numbers of a chain's points and answer with a row for each."""

import json
import os
import signal
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from queue import SimpleQueue
from subprocess import PIPE, Popen
from threading import Event, Thread
from typing import Any

from mpi4py import MPI

from ..base.petsc import launched
from ..base.ranks import begin, cores
from ..errors import InputError

Row = dict[str, Any]
Chains = Sequence[Sequence[int]]
WORTH = 1_000_000  # grid points of all chains together, below which processes of their own take longer to start than they save
HEAVY = 250_000  # grid points of one scene, above which several at once may be more than the memory holds


def jobs_for(asked: int | None, chains: int, sizes: Sequence[int]) -> int:
    """How many processes: as many as were asked for; else one a core where that pays, and one under mpiexec.

    sizes : grid points of every scene.
    """
    if asked is not None:
        if asked < 1:
            raise InputError(f"--jobs {asked}: at least 1 is needed")
        if asked > 1 and MPI.COMM_WORLD.size > 1:
            raise InputError(f"--jobs {asked}: not under mpiexec, whose ranks share each solve")
        return min(asked, chains)
    if launched() or sum(sizes) < WORTH or max(sizes) > HEAVY:
        return 1
    return min(cores(), chains)


def serve(rows_of: Callable[[Sequence[int]], Iterable[tuple[int, Row]]]) -> None:
    """A worker: reads lines with the numbers of a chain, and writes a line with each point's row, until its input ends."""
    signal.signal(signal.SIGTERM, signal.SIG_DFL)  # the way to end it; PETSc would report a crash
    for line in sys.stdin:
        for _, row in rows_of(json.loads(line)):
            print(json.dumps(row), flush=True)


def side_by_side(words: Sequence[str], jobs: int, chains: Chains) -> Iterator[tuple[int, Row]]:
    """Rows by their points' numbers, as they come. A process that ends before its time is a row, and another one goes on.

    words : the command line of the sweep, which every worker reads too.
    """
    waiting: SimpleQueue[list[int] | None] = SimpleQueue()
    for chain in [*map(list, chains), *[None] * jobs]:
        waiting.put(chain)
    done: SimpleQueue[tuple[int, Row] | None] = SimpleQueue()
    workers: list[Popen[str]] = []
    over = Event()
    threads = [Thread(target=_lead, args=(words, waiting, done, workers, over), daemon=True) for _ in range(jobs)]
    try:
        for thread in threads:
            thread.start()
        for _ in range(sum(map(len, chains))):
            found = done.get()
            if found is None:
                raise RuntimeError("a sweep's process could not be started")
            yield found
    finally:
        over.set()
        for worker in list(workers):
            worker.terminate()
        for thread in threads:
            thread.join()
        for worker in workers:
            with suppress(BrokenPipeError), worker:  # which closes the pipes and waits
                pass


def _lead(
    words: Sequence[str],
    waiting: "SimpleQueue[list[int] | None]",
    done: "SimpleQueue[tuple[int, Row] | None]",
    workers: "list[Popen[str]]",
    over: Event,
) -> None:
    """One worker at a time, from chain to chain."""
    worker: Popen[str] | None = None
    command = [sys.executable, "-m", "lcp_lube", *words, "--worker"]
    try:
        while (chain := waiting.get()) is not None:
            while chain and not over.is_set():
                if worker is None or worker.poll() is not None:
                    worker = begin(command, os.environ, stdin=PIPE, stdout=PIPE)
                    workers.append(worker)
                    if over.is_set():
                        worker.terminate()
                assert worker.stdin is not None and worker.stdout is not None
                try:
                    worker.stdin.write(f"{json.dumps(chain)}\n")
                    worker.stdin.flush()
                    for line in worker.stdout:
                        done.put((chain.pop(0), json.loads(line)))
                        if not chain:
                            break
                except (BrokenPipeError, json.JSONDecodeError):
                    worker.kill()
                if chain:
                    message = f"its process ended with status {worker.wait()}"
                    done.put((chain.pop(0), {"outcome": "crashed", "converged": False, "message": message}))
    except OSError:
        done.put(None)
