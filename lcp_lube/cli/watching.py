"""What `solve` does while a film goes on in time: a bar, a history, fields and frames; and the pictures at its end."""

from __future__ import annotations

import argparse
import sys
from bisect import bisect_right
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpi4py import MPI

from ..base.quantity import in_si
from ..errors import InputError
from ..output.files import check_target
from ..output.style import save_figure
from ..problems.solution import Solution
from ..scenes.moving import motion_of
from ..scenes.scene import Scene

if TYPE_CHECKING:
    from ..scenes.motion import MotionTable

GIF, FILES = 40, 10  # frames of an animation, times of a series of files


class Watching:
    """Called with every time step (`Ask.watch`). Collective."""

    def __init__(self, args: argparse.Namespace, scene: Scene):
        self.table: MotionTable | None = motion_of(scene)
        paths = [Path(path) for path in args.output]
        series = [path for path in paths if path.suffix.lower() == ".pvd"]
        self.picture = Path(args.plot) if args.plot else None
        gif = self.picture is not None and self.picture.suffix.lower() == ".gif"
        if self.table is None:
            wanted = {"--history": args.history, "--times": args.times, "--plot": args.plot if gif else None}
            if found := next((f"{name} {value}" for name, value in wanted.items() if value), None):
                raise InputError(f"{found}: scene {scene.name} does not go on in time (it has no [motion])")
            return
        from tqdm import tqdm  # here: few scenes go on in time

        from ..output.frames import Frames, HistoryFile, Series

        self.gif, self.boundary = gif, args.boundary
        self.times = _times(args.times, self.table.t_end, GIF if gif else FILES)
        self.args_times = tuple(self.times) if args.times or series or gif else ()
        if self.picture is not None:
            check_target(self.picture.with_suffix(".png") if gif else self.picture, plot=True)
        comm = MPI.COMM_WORLD
        self.history = HistoryFile(Path(args.history), comm, args.resume is not None) if args.history else None
        self.series = [Series(path, args.boundary) for path in series]
        self.frames = Frames() if self.picture is not None else None
        quiet = None if comm.rank == 0 else True
        self._bar: Any = tqdm(total=self.table.t_end, unit="s", disable=quiet, file=sys.stderr, bar_format=BAR)
        self._done = self._last = 0  # of the times; the number of the last step

    def _again(self, comm: MPI.Comm) -> None:
        """A run to an accuracy marches anew on each grid: the last one's steps are kept. Collective."""
        if self.history is not None:
            self.history.again()
        for series in self.series:
            series.again(comm)
        if self.frames is not None:
            self.frames = type(self.frames)()
        self._done = 0
        self._bar.reset()

    def __call__(self, moment: Any) -> None:
        """A step was taken."""
        if moment.count == 1 and self._last:
            self._again(moment.problem.grid.comm)
        self._last, dt = moment.count, moment.row["dt"]
        if self.history is not None:
            self.history.add(moment.row, dt)
        done = bisect_right(self.times, moment.t + 0.5 * dt)  # of the times, which ascend
        if done > self._done:
            self._done = done
            for series in self.series:
                series.add(moment)
            if self.frames is not None and self.gif:
                self.frames.add(moment)
        if self.frames is not None and not self.gif:
            self.frames.add_line(moment)
        self._bar.set_postfix_str(f"step {moment.count}, {moment.row['iterations']} iterations", refresh=False)
        self._bar.update(moment.t - self._bar.n)

    def close(self) -> None:
        """The march has ended, one way or the other."""
        if self.table is not None:
            self._bar.close()
            if self.history is not None:
                self.history.close()

    def draw(self, solution: Solution) -> None:
        """The picture that was asked for. Collective."""
        assert self.picture is not None and self.frames is not None
        if not solution.history:
            return
        if self.gif:
            from ..output.animation import animate

            animate(self.frames, solution.history, self.picture)
        else:
            from ..output.march_picture import march_figure

            frames, title = self.frames, f"{solution.settings['scene']}, {solution.message}"
            save_figure(lambda: march_figure(frames, solution.history, title), self.picture)


BAR = "{l_bar}{bar}| {n:.4g}/{total:.4g} s [{elapsed}<{remaining}, {postfix}]"


def _times(text: str | None, end: float, count: int) -> list[float]:
    """When fields are kept: a number of times, or the times themselves; the end is always among them."""
    if text is None:
        return [end * (k + 1) / count for k in range(count)]
    words = text.split(",")
    try:
        if len(words) == 1 and words[0].strip().isdigit():
            if int(text) < 1:
                raise InputError("at least 1 is needed")
            return _times(None, end, int(text))
        times = [in_si(word, "s") for word in words]
    except InputError as error:
        raise InputError(f"--times {text}: {error}") from None
    if any(t is None or not 0 < t <= end * (1 + 1e-12) for t in times):
        raise InputError(
            f"--times {text}: times above 0 up to motion.t_end = {end:g} s, with commas between them, or a number of times"
        )
    return sorted(t for t in times if t is not None)
