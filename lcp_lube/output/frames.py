"""What is kept of a march in time while it goes on: its history as a csv, fields at chosen times, frames to draw."""

import csv
import os
from dataclasses import dataclass, field
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np

from ..base.parallel import Array
from ..base.together import on_all_ranks
from ..errors import InputError
from ..problems.film.fronts import middle_row
from ..problems.solution import Outcome, Solution
from .files import check_target, coordinates, gather, save, taken, thinning, write_collection
from .units import around, axis

MOST = {1: 1000, 2: 160}  # points a direction of a frame
LINE, LINES = 400, 600  # points, and times, of the middle line


class HistoryFile:
    """A csv with a row for each time step, appended as they come. Collective.

    Parameters
    ----------
    resumed : the march was taken up again: rows up to there stay.
    """

    def __init__(self, path: Path, comm: Any, resumed: bool):
        self.path, self.comm, self.resumed = path, comm, resumed
        self._file: Any = None
        with on_all_ranks(comm, f"--history {path}"):
            if comm.rank == 0:
                if path.is_dir() or (path.exists() and not path.is_file()):
                    raise InputError("is no ordinary file")
                with path.open("a"):
                    pass

    def add(self, row: dict[str, Any], dt: float) -> None:
        """Append a row; the first one begins the file, or follows those before it."""
        with on_all_ranks(self.comm, f"--history {self.path}"):
            if self.comm.rank == 0:
                if self._file is None:
                    self._begin([*row], row["t"] - 0.5 * dt)
                told = (f"{value:.12g}" if isinstance(value, float) else str(value) for value in row.values())
                csv.writer(self._file, lineterminator="\n").writerow(told)
                self._file.flush()

    def _begin(self, columns: list[str], before: float) -> None:
        """A new file with the old one's rows up to a time, of a run that is taken up; one cut short by a kill is not kept."""
        lines = list(csv.reader(self.path.read_text().splitlines())) if self.resumed else []
        kept = [line for line in lines[1:] if len(line) == len(lines[0]) and float(line[0]) < before]
        temporary = self.path.with_name(f".{self.path.name}.{os.getpid()}")
        with temporary.open("w", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows([columns, *kept])
        os.replace(temporary, self.path)
        self._file = self.path.open("a", newline="")

    def again(self) -> None:
        """The march begins once more, on a finer grid."""
        self.close()
        self._file, self.resumed = None, False

    def close(self) -> None:
        if self._file is not None:
            self._file.close()


class Series:
    """Fields at chosen times: a .pvd, which lists a .vts for each. Collective."""

    def __init__(self, path: Path, boundary: bool):
        check_target(path.with_suffix(".vts"))
        self.path, self.boundary, self._files = path, boundary, list[tuple[float, str]]()

    def add(self, moment: Any) -> None:
        """Write the fields of a step, and the list once more with it."""
        comm = moment.problem.grid.comm
        target = self.path.with_name(f"{self.path.stem}_{moment.count:06d}.vts")
        solution = Solution(moment.problem, moment.fields, Outcome.CONVERGED, "", None, [])  # type: ignore[arg-type]
        save(solution, target, self.boundary)
        self._files.append((float(f"{moment.t:.12g}"), target.name))
        write_collection(self.path, self._files, comm)

    def again(self, comm: Any) -> None:
        """The march begins once more, on a finer grid: what the one before has left is taken away."""
        with on_all_ranks(comm, f"--output {self.path}"):
            for _, name in self._files if comm.rank == 0 else ():
                self.path.with_name(name).unlink(missing_ok=True)
        self._files = []


@dataclass
class Frames:
    """On rank 0: p (Pa), r and h at some times, thinned to a picture's size; and p and r of the middle line at many."""

    times: list[float] = field(default_factory=list)
    fields: list[dict[str, Array]] = field(default_factory=list)
    line_times: list[float] = field(default_factory=list)
    lines: list[dict[str, Array]] = field(default_factory=list)
    x: Array = field(default_factory=lambda: np.empty(0))
    y: Array = field(default_factory=lambda: np.empty(0))
    line_x: Array = field(default_factory=lambda: np.empty(0))
    lengths: tuple[float, ...] = ()
    journal: bool = False
    _every: int = 1

    @property
    def along(self) -> tuple[float, str]:
        """By what x is multiplied to be drawn, and the axis' label: degrees round a journal."""
        return around(self.lengths[0]) if self.journal else axis("x", self.lengths[0])

    def add(self, moment: Any) -> None:
        """Keep a frame. Collective."""
        problem, grid = moment.problem, moment.problem.grid
        stride = thinning(grid, MOST)
        physical = problem.physical(moment.fields)
        kept = {name: gather(grid, physical[name][0], stride) for name in ("p", "r", "h")}
        self.x, *y = coordinates(grid, stride)
        self.y, self.lengths, self.journal = (y[0] if y else self.y), grid.lengths, problem.shaft is not None
        if grid.comm.rank == 0:
            self.times.append(moment.t)
            self.fields.append(kept)

    def add_line(self, moment: Any) -> None:
        """Keep the middle line; of very many steps every second one, and so on. Collective."""
        if moment.count % self._every:
            return
        problem, grid = moment.problem, moment.problem.grid
        step = ceil(grid.shape[0] / LINE)
        physical, row = problem.physical(moment.fields), middle_row(problem)
        rows = np.arange(grid.shape[1] if grid.dim == 2 else 1)
        kept = {}
        for name in ("p", "r"):
            own = (rows >= grid.y_start) & (rows < grid.y_end) & (rows == row)
            values = physical[name][0].reshape(grid.box)[own[grid.y_start : grid.y_end]]
            line = np.zeros(grid.shape[0])
            line[grid.x_start : grid.x_end] = values[0] if len(values) else 0.0
            kept[name] = grid.comm.allreduce(line)[taken(grid.shape[0], step)].astype(np.float32)
        self.line_x, self.lengths = grid.lines[0][taken(grid.shape[0], step)], grid.lengths
        self.journal = problem.shaft is not None
        self.line_times.append(moment.t)
        self.lines.append(kept)
        if len(self.lines) > LINES:
            self._every *= 2
            self.line_times, self.lines = self.line_times[1::2], self.lines[1::2]
