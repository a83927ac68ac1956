"""`lcp-lube sweep`: a scene at many values of its keys, one csv row a point, each started from its neighbour's answer."""

import argparse
import csv
import io
import re
import sys
import tomllib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from hashlib import sha256
from itertools import product
from math import isfinite, prod
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI
from tqdm import tqdm

from ..api import solve
from ..base.options import check_unread
from ..base.quantity import Quantity, quantity
from ..base.resumable import ResumableCsv
from ..errors import InputError
from ..output.console import say
from ..output.results import as_dict, finite
from ..problems.solution import Outcome, Solution, Step
from ..scenes.scene import Scene
from .asked import ask_of, scene_of

MOST_POINTS = 100_000
REFUSED = "refused"  # an outcome beside those of `Outcome`: bad input that only the solve could notice
PLACES = {"p_max_at": "p_max", "min_h_at": "min_h", "force": "force", "moment": "moment"}
PARTS = {key: (f"{name}_x", f"{name}_y") for key, name in PLACES.items()}


@dataclass(frozen=True)
class Axis:
    """A key of the scene and the values it takes."""

    key: str
    values: tuple[Any, ...]
    unit: str = ""  # of all values, in SI base units, where units were given

    def given(self, value: Any) -> Any:
        """The value as the scene is to read it, which checks its unit."""
        return f"{value!r} {self.unit}" if self.unit else value


def parse_axis(text: str) -> Axis:
    """KEY=FROM:TO:N (N values, both ends among them), KEY=FROM:TO:N:log (at equal ratios) or KEY=A,B,C.

    Whole numbers stay whole where FROM, TO and the step are.

    Raises
    ------
    InputError : of another form; N < 1; a range without equal ratios.
    """
    key, equals, values = (part.strip() for part in text.partition("="))
    forms = "KEY=FROM:TO:N, KEY=FROM:TO:N:log or KEY=A,B,C is needed"
    if not (key and equals and values):
        raise InputError(f"--vary {text}: {forms}")
    match [part.strip() for part in values.split(":")]:
        case [listed]:
            return _listed(text, key, listed)
        case [start, end, count, *log] if log in ([], ["log"]):
            pass
        case _:
            raise InputError(f"--vary {text}: {forms}")
    first, last = quantity(start), quantity(end)
    if first is None or last is None or not re.fullmatch(r"[+-]?\d{1,9}", count):
        raise InputError(f"--vary {text}: {forms}")
    a, b, n, unit = first.value, last.value, int(count), _common(text, [first, last])
    if not (isfinite(a) and isfinite(b) and isfinite(b - a) and 1 <= n <= MOST_POINTS):
        raise InputError(f"--vary {text}: FROM and TO must be finite, N from 1 to {MOST_POINTS}")
    if log:
        if min(a, b) <= 0:
            raise InputError(f"--vary {text}: equal ratios need FROM > 0 and TO > 0")
        return Axis(key, tuple(_rounded(number) for number in np.geomspace(a, b, n)), unit)
    numbers = np.linspace(a, b, n)
    whole = all(end.lstrip("+-").isdigit() for end in (start, end)) and bool(np.all(numbers == np.rint(numbers)))
    return Axis(key, tuple(int(number) if whole else _rounded(number) for number in numbers), unit)


def _common(text: str, found: Sequence[Quantity]) -> str:
    """The unit of quantities that belong together; empty if they have none.

    Raises
    ------
    InputError : they are of different dimensions.
    """
    if len({one.dimension for one in found if one.unit}) > 1 or len({one.unit for one in found if one.value}) > 1:
        raise InputError(f"--vary {text}: values of one dimension are needed, all with a unit or none")
    return next((one.text.partition(" ")[2] for one in found if one.unit), "")


def _rounded(number: float) -> float:
    """0.3, not 0.30000000000000004."""
    return float(f"{number:.14g}")


def _listed(text: str, key: str, values: str) -> Axis:
    """The values of A,B,C as TOML, as quantities, or as bare words."""
    try:
        return Axis(key, tuple(tomllib.loads(f"values = [{values}]")["values"]))
    except (ValueError, RecursionError):
        pass
    words = [value.strip() for value in values.split(",")]
    found = [one for word in words if (one := quantity(word)) is not None]
    if len(found) < len(words):
        return Axis(key, tuple(words))
    return Axis(key, tuple(one.value for one in found), _common(text, found))


@dataclass
class _Neighbours:
    """Answers that later points start from: for each axis the latest one with the axes behind it at their first value."""

    axes: int
    kept: list[tuple[str, Solution] | None] = field(init=False)  # family and answer

    def __post_init__(self) -> None:
        self.kept = [None] * self.axes

    def near(self, axis: int, scene: Scene) -> Solution | None:
        """What a point that moved along this axis starts from."""
        family, solution = self.kept[axis] or ("", None)
        return solution if family == scene.family else None

    def keep(self, axis: int, scene: Scene, solution: Solution | None) -> None:
        """Take an answer in the place of those at this axis and behind; None: forget them."""
        old = self.kept[axis:]
        self.kept[axis:] = [(scene.family, solution) if solution is not None else None] * len(old)
        left = [id(near[1]) for near in self.kept if near is not None]
        for unused in {id(near[1]): near[1] for near in old if near is not None}.values():
            if id(unused) not in left:
                unused.destroy()


def points(axes: Sequence[Axis]) -> Iterator[tuple[int, dict[str, Any]]]:
    """Each point of the product, the last axis moving fastest, with the first axis that moved since the point before."""
    before: tuple[int, ...] | None = None
    for numbers in product(*(range(len(axis.values)) for axis in axes)):
        moved = next((k for k in range(len(axes)) if before is not None and numbers[k] != before[k]), 0)
        yield moved, {axis.key: axis.values[k] for axis, k in zip(axes, numbers, strict=True)}
        before = numbers


def sweep(
    axes: Sequence[Axis],
    scene_at: Callable[[dict[str, Any]], Scene],
    solve_at: Callable[..., Solution],
    path: Path | None = None,
    warm: bool = True,
    settings: str = "",
    progress: bool = True,
) -> tuple[list[dict[str, Any]], list[str]]:
    """Solve a scene at every point of the product of the axes; a point that fails is a row as well. Collective.

    Parameters
    ----------
    scene_at : the scene at a point; all are built, and so validated, before the first is solved.
    solve_at : solve_at(point, near) -> Solution, near being a neighbour's to start from.
    path : a csv that is filled row by row; points that stand there, with the same data and settings, are not solved again.
    warm : start each point from its neighbour's answer.
    settings : what the answers depend on beside the scene; part of what tells one row from another.
    progress : a bar on stderr, if that is a terminal.

    Returns
    -------
    list of dict, list of str : the points in their order, and the names of their columns.

    Raises
    ------
    InputError : an invalid value; a file that cannot be read or written; every point was refused.
    """
    for k, axis in enumerate(axes):
        if axis.key in [other.key for other in axes[:k]]:
            raise InputError(f"--vary {axis.key}: given twice")
    if prod(len(axis.values) for axis in axes) > MOST_POINTS:
        raise InputError(f"--vary: {prod(len(axis.values) for axis in axes)} points; at most {MOST_POINTS} are allowed")
    keys = [axis.key for axis in axes]
    reads = {axis.key: axis.given for axis in axes}
    plan = [(moved, point, scene_at({key: reads[key](value) for key, value in point.items()})) for moved, point in points(axes)]
    comm = MPI.COMM_WORLD
    store = ResumableCsv(path, keys, ["digest"], comm, growing=True) if path else None
    if store:
        store.write()  # before the first run, not after it, it turns out whether it can be
    neighbours, rows = _Neighbours(len(axes)), []
    with tqdm(plan, unit="point", disable=None if progress and comm.rank == 0 else True, file=sys.stderr) as bar:
        for moved, point, scene in bar:
            digest = sha256(f"{scene.model_dump_json()} {settings}".encode()).hexdigest()[:12]
            row = store.find(digest=digest) if store else None
            if row is None:
                as_read = {key: reads[key](value) for key, value in point.items()}
                row = {**point, **_row(as_read, scene, solve_at, neighbours, moved if warm else None)}
                row |= {**_data(scene), "settings": settings, "digest": digest}
                row = store.add(row) if store else row
            rows.append(row)
            bar.set_postfix_str(f"{row['outcome']}, {row.get('iterations')} iterations")
    neighbours.keep(0, plan[0][2], None)
    if all(row["outcome"] == REFUSED for row in rows):
        raise InputError(str(rows[0]["message"]))
    columns = [*keys, *(name for name in {name: 0 for row in rows for name in row} if name not in keys)]
    return rows, columns


def _row(
    point: dict[str, Any], scene: Scene, solve_at: Callable[..., Solution], neighbours: _Neighbours, moved: int | None
) -> dict[str, Any]:
    """Solve one point, which moved along this axis; None: from the beginning. Collective."""
    try:
        solution = solve_at(point, None if moved is None else neighbours.near(moved, scene))
    except InputError as error:
        return {"outcome": REFUSED, "converged": False, "message": str(error)}
    row = flat(as_dict(solution)) | {"start": solution.settings.get("start", "cold")}
    if moved is not None and solution.converged:
        neighbours.keep(moved, scene, solution)
    else:
        solution.destroy()
    return row


def _data(scene: Scene) -> dict[str, Any]:
    """The scene's data as columns, 'scene.h_min [m]', so that every row says what was solved."""
    units = scene.data_units()

    def columns(value: Any, path: str) -> dict[str, Any]:
        if isinstance(value, list) and value and isinstance(value[0], dict):
            value = dict(enumerate(value, start=1))
        if isinstance(value, dict):
            return {name: one for key, inner in value.items() for name, one in columns(inner, f"{path}.{key}").items()}
        unit = units.get(path[1:])
        return {f"scene{path} [{unit}]" if unit else f"scene{path}": value}

    return columns(scene.data_si(), "")


def flat(data: dict[str, Any]) -> dict[str, Any]:
    """The JSON's keys as columns: places by coordinate, flows by side, the total of the seconds."""
    row: dict[str, Any] = {}
    for key, value in finite(data).items():
        if key in PARTS and not isinstance(value, float):  # in 1D a moment is one number
            row |= dict(zip(PARTS[key], [*(value or []), None][: len(value or []) or 2], strict=False))
        elif key in ("flow", "balance") and isinstance(value, dict):
            row |= {f"{key}_{name}": part for name, part in value.items()}
        elif not isinstance(value, (dict, list)):
            row[key] = value
    return row | {"time_s": data["time_s"]["total"]}


def run(args: argparse.Namespace) -> int:
    """The command: exit status 0 if every point converged, else 1; raises InputError as `sweep` does. Collective."""
    if args.output is not None and args.output.suffix.lower() != ".csv":
        raise InputError(f"--output {args.output}: a sweep writes a .csv")

    def monitor(k: int, step: Step) -> None:
        if k == 1:
            check_unread()

    ask = ask_of(args, monitor)

    def solve_at(point: dict[str, Any], near: Solution | None) -> Solution:
        return solve(scene_of(args, point), ask, start=near)

    rows, columns = sweep(
        [parse_axis(text) for text in args.vary],
        lambda point: scene_of(args, point),
        solve_at,
        args.output,
        args.warm,
        settings=repr(replace(ask, monitor=None)),
    )
    if args.output is None:
        text = io.StringIO()
        writer = csv.DictWriter(text, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
        say(text.getvalue().rstrip("\n"))
    failed = sum(row["outcome"] != Outcome.CONVERGED for row in rows)
    if MPI.COMM_WORLD.rank == 0:
        steps = sum(int(row.get("iterations") or 0) for row in rows)
        print(f"sweep: {len(rows)} points, {failed} failed, {steps} iterations", file=sys.stderr, flush=True)
    return 1 if failed else 0
