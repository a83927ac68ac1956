"""A pool of threads for work on many lines of a grid, in parts that are independent or wait for one another themselves.

How work is split does not depend on the number of threads, and neither do the bits of the result: sums are added in the order
of the parts.
"""

import os
from collections.abc import Callable
from functools import cache
from threading import Lock
from typing import Any

import numpy as np

from ..errors import InputError

VARIABLE = "NUMBA_NUM_THREADS"  # what --threads sets
FEWEST = 120_000  # points of a grid that threads are woken for
PARTS = 8  # of the lines of such a grid


class Crew:
    """So many threads, the calling one among them; the others start with the first work for them.

    One piece of work at a time: what a task asks the crew for, its own thread does.
    """

    def __init__(self, threads: int):
        self.threads = threads
        self._others: Any = None
        self._busy = Lock()

    def run(self, task: Callable[[int], Any], count: int, together: bool = False) -> list[Any]:
        """What task(0) to task(count - 1) return; they run at the same time where there are as many threads.

        together : they wait for one another, and must all be at work.
        """
        some = min(self.threads, count)
        if some < 2 or not self._busy.acquire(blocking=together):
            return [task(k) for k in range(count)]
        out, errors = [None] * count, np.geterr()  # of arithmetic: each thread has settings of its own

        def every(first: int) -> None:
            with np.errstate(**errors):
                for k in range(first, count, some):
                    out[k] = task(k)

        try:
            from concurrent.futures import ThreadPoolExecutor

            self._others = self._others or ThreadPoolExecutor(self.threads - 1, "lcp-lube")
            others = [self._others.submit(every, first) for first in range(1, some)]
            every(0)
            for one in others:
                one.result()
        finally:
            self._busy.release()
        return out


def by_rows(task: Callable[[int, int], Any], lines: int, points: int) -> list[Any]:
    """What task(first, last + 1) returns for parts of so many lines, of so many points in all: the crew's work if many."""
    if points < FEWEST:
        return [task(0, lines)]
    parts = min(PARTS, lines)
    return crew().run(lambda k: task(lines * k // parts, lines * (k + 1) // parts), parts)


def crew() -> Crew:
    """The threads of this process."""
    return _crew(threads(), os.getpid())


@cache
def _crew(number: int, process: int) -> Crew:
    return Crew(number)


def threads() -> int:
    """As many as were asked for; else 1: two gain on the grids of large films alone, and lose on a busy machine.

    Raises
    ------
    InputError : no whole number from 1 on was asked for.
    """
    asked = os.environ.get(VARIABLE) or "1"
    if not asked.isdecimal() or int(asked) < 1:
        raise InputError(f"{VARIABLE} = {asked}: a whole number from 1 on is needed")
    return int(asked)
