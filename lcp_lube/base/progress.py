"""Progress of a long run: its loops report it, and a line on a terminal shows it with the time that is left."""

import sys
from collections.abc import Callable, Iterable, Iterator
from math import isfinite, log
from time import perf_counter
from typing import Self, TextIO, TypeVar

from mpi4py import MPI

Item = TypeVar("Item")

# Reported by a loop: its name in ORDER, what it is at in words, and the part of its work that is done, from 0 to 1.
Progress = Callable[[str, str, float], None]
ORDER = ("sweep", "accuracy", "time", "grids")  # from the outermost in: the first that has reported gives the time left

PATIENCE = 2.0  # seconds before anything is shown
PAUSE = 0.2  # and between two lines
# Columns of a terminal that a line of progress takes at most: longer ones wrap, and \r no longer goes back to their start.
WIDTH = 100


def decades(first: float, now: float, last: float) -> float:
    """The part of the way that a norm has come down from first to last, counted in decades."""
    if not (isfinite(first) and isfinite(now) and first > last > 0 and now > 0):
        return 0.0
    return min(max(log(first / now) / log(first / last), 0.0), 1.0)


class Line:
    """One line on a terminal that is written over and over, and cleared at the end (of its `with`). Elsewhere it does nothing.

    Parameters
    ----------
    stream : where; default stderr.
    clock : seconds.
    """

    def __init__(self, stream: TextIO | None = None, clock: Callable[[], float] = perf_counter):
        self.stream = stream or sys.stderr
        self._mute = MPI.COMM_WORLD.rank > 0
        self._clock, self._begin = clock, clock()
        self._next = self._begin + PATIENCE
        self._told: dict[str, tuple[str, float]] = {}
        self._shown = False

    def __call__(self, name: str, words: str, part: float) -> None:
        """Take a loop's report; show it if it is time to."""
        self._told = {other: told for other, told in self._told.items() if ORDER.index(other) < ORDER.index(name)}
        self._told[name] = (words, part)
        now = self._clock()
        if part == 0.0 and len(self._told) == 1:  # the outermost loop begins: what came before is none of its time
            self._begin = now
        if now < self._next or self._mute or not self.stream.isatty():
            return
        self._next = now + PAUSE
        self._shown = True
        self.stream.write(f"\r\x1b[K{self.text(now)[:WIDTH]}")
        self.stream.flush()

    def text(self, now: float) -> str:
        """The line: what each loop is at, and what is left by the outermost one."""
        known = sorted(self._told.items(), key=lambda told: ORDER.index(told[0]))
        part = known[0][1][1]
        left = f"; about {duration((now - self._begin) * (1.0 - part) / part)} left" if part > 0.01 else ""
        return f"lcp-lube: {', '.join(words for _, (words, _) in known)}{left}"

    def over(
        self, items: Iterable[Item], words: Callable[[Item], str], kept: Callable[[Item], bool] = lambda _: False
    ) -> Iterator[Item]:
        """The items, each reported before it is worked on, except those kept from an earlier run, which take no time."""
        items = list(items)
        due, done = [not kept(item) for item in items], 0
        for item, waits in zip(items, due, strict=True):
            if waits:
                self("sweep", f"{words(item)} {done + 1} of {sum(due)}", done / sum(due))
                done += 1
            yield item

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    def end(self) -> None:
        """Clear the line."""
        if self._shown:
            self.stream.write("\r\x1b[K")
            self.stream.flush()
            self._shown = False


def duration(seconds: float) -> str:
    """'40 s', '12 min', '3 h'."""
    for size, unit in ((5400.0, "h"), (90.0, "min")):
        if seconds >= size:
            return f"{seconds / (3600.0 if unit == 'h' else 60.0):.0f} {unit}"
    return f"{max(seconds, 1.0):.0f} s"


def of_ladder(seconds: list[float], estimate: float, tol: float, factor: float) -> float:
    """The part of the work that is done on finer and finer grids, each `factor` times as long, at second order from here on."""
    if estimate <= tol:
        return 1.0
    levels = max(1.0, round(log(estimate / tol) / log(4.0))) if isfinite(estimate) else 3.0
    left = seconds[-1] * sum(factor**k for k in range(1, int(levels) + 1))
    return sum(seconds) / (sum(seconds) + left)
