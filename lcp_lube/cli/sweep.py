"""`lcp-lube sweep`: a scene at many values of its keys, one csv row a point, each started from its neighbour's answer."""

import argparse
import csv
import io
import sys
from collections.abc import Callable, Iterable, Iterator, KeysView, Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from hashlib import sha256
from math import prod
from pathlib import Path
from typing import Any

from mpi4py import MPI
from tqdm import tqdm

from ..api import solve
from ..base.options import check_unread
from ..base.resumable import ResumableCsv
from ..drivers.accuracy.accuracy import DEFAULT_QUANTITY
from ..errors import InputError
from ..output.console import note, say
from ..output.files import check_target
from ..output.results import as_dict
from ..output.rows import flat
from ..problems.film.quantities import units as film_units
from ..problems.solution import Outcome, Solution, Step
from ..scenes.scene import Scene
from .asked import ask_of, scene_of
from .axes import Axis, chains, check, parse_axis, points
from .sweep_jobs import jobs_for, serve, side_by_side

REFUSED = "refused"  # an outcome beside those of `Outcome`: bad input that only the solve could notice


def solved(
    chain: Iterable[int],
    at: Sequence[dict[str, Any]],
    scene_at: Callable[[dict[str, Any]], Scene],
    solve_at: Callable[..., Solution],
    warm: bool,
) -> Iterator[tuple[int, dict[str, Any]]]:
    """Number and row of a chain's points, each started from the last one's answer that is one, if warm. Collective."""
    near: tuple[str, Solution] | None = None
    try:
        for k in chain:
            family = scene_at(at[k]).family
            try:
                solution = solve_at(at[k], near[1] if near and near[0] == family else None)
            except InputError as error:
                yield k, {"outcome": REFUSED, "converged": False, "message": str(error)}
                continue
            row = flat(as_dict(solution)) | {"start": solution.settings.get("start", "cold")}
            left: Solution | None = solution
            if warm and solution.converged:
                near, left = (family, solution), near[1] if near else None
            if left is not None:
                left.destroy()
            yield k, row
    finally:
        if near:
            near[1].destroy()


def sweep(
    axes: Sequence[Axis],
    scene_at: Callable[[dict[str, Any]], Scene],
    solve_at: Callable[..., Solution],
    path: Path | None = None,
    warm: bool = True,
    settings: str = "",
    progress: bool = True,
    jobs: int | None = 1,
    words: Sequence[str] = (),
) -> tuple[list[dict[str, Any]], list[str]]:
    """Solve a scene at every point of the product of the axes; a point that fails is a row as well. Collective.

    Returns the points in their order, and the names of their columns. Every point was refused: InputError.

    Parameters
    ----------
    scene_at : the scene at a point; all are built, and so validated, before the first is solved.
    solve_at : solve_at(point, near) -> Solution, near being a neighbour's to start from.
    path : a csv that is filled row by row; points that stand there, with the same data and settings, are not solved again.
    settings : what the answers depend on beside the scene; part of what tells one row from another.
    jobs, words : processes that solve side by side (`sweep_jobs`; None: where that pays), and the command line of each.
    """
    check(axes)
    at, reads = points(axes), points(axes, read=True)
    scenes = [scene_at(point) for point in reads]
    digests = [sha256(f"{scene.model_dump_json()} {settings}".encode()).hexdigest()[:12] for scene in scenes]
    keys, comm = [axis.key for axis in axes], MPI.COMM_WORLD
    pieces = chains(axes, warm)
    jobs = jobs_for(jobs, len(pieces), [prod(scene.shape) for scene in scenes])
    store = ResumableCsv(path, keys, ["digest"], comm, growing=True) if path else None
    if store:
        _same_layout(store, [_data(scene).keys() for scene in scenes])
        store.write()  # before the first run, not after it, it turns out whether it can be
    rows: list[dict[str, Any] | None] = [store.find(digest=digest) if store else None for digest in digests]
    left = [piece for whole in pieces if (piece := [k for k in whole if rows[k] is None])]
    made: dict[int, dict[str, Any]] = {}
    if jobs > 1:
        found: Iterator[tuple[int, dict[str, Any]]] = side_by_side(words, jobs, left)
    else:
        found = (one for piece in left for one in solved(piece, reads, scene_at, solve_at, warm))
    quiet = None if progress and comm.rank == 0 else True
    with (
        closing(found),  # type: ignore[type-var]
        tqdm(total=len(at), initial=len(at) - sum(map(len, left)), unit="point", disable=quiet, file=sys.stderr) as bar,
    ):
        for k, row in found:
            made[k] = {**at[k], **row, **_data(scenes[k]), "settings": settings, "digest": digests[k]}
            rows[k] = store.add(made[k]) if store else made[k]
            bar.set_postfix_str(f"{row['outcome']}, {row.get('iterations')} iterations", refresh=False)
            bar.update()
    if store and jobs > 1:
        store.again([made[k] for k in sorted(made)])
        rows = [store.find(digest=digest) for digest in digests]
    complete = [row for row in rows if row is not None]
    if all(row["outcome"] == REFUSED for row in complete):
        raise InputError(str(complete[0]["message"]))
    columns = [*keys, *(name for name in {name: 0 for row in complete for name in row} if name not in keys)]
    return complete, columns


def _same_layout(store: ResumableCsv, data: list[KeysView[str]]) -> None:
    """Refuse rows of an older version, or of another kind of scene: their columns would stay empty in the new ones."""
    if not store.rows:
        return
    needed = ["settings", *(name for name in data[0] if all(name in one for one in data))]
    known = {name for one in data for name in one}
    there = store.columns
    what = ""
    if lacks := next((name for name in needed if name not in there), None):
        what = f"without the column '{lacks}'"
    elif strange := next((name for name in there if name.startswith("scene.") and name not in known), None):
        what = f"with a column '{strange}' that this scene has not"
    if what:
        raise InputError(f"{store.path}: rows of another layout, {what}; move it away or name another file")


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


def run(args: argparse.Namespace) -> int:
    """The command: exit status 0 if every point converged, else 1; raises InputError as `sweep` does. Collective."""
    if args.output is not None and args.output.suffix.lower() != ".csv":
        raise InputError(f"--output {args.output}: a sweep writes a .csv")
    if args.plot is not None:
        check_target(args.plot, plot=True)

    def monitor(k: int, step: Step) -> None:
        if k == 1:
            check_unread()

    ask = ask_of(args, monitor)

    def solve_at(point: dict[str, Any], near: Solution | None) -> Solution:
        return solve(scene_of(args, point), ask, start=near)

    scene_at = partial(scene_of, args)
    axes = [parse_axis(text) for text in args.vary]
    if args.worker:
        at = points(axes, read=True)
        serve(lambda chain: solved(chain, at, scene_at, solve_at, args.warm))
        return 0
    settings = repr(replace(ask, monitor=None))
    rows, columns = sweep(axes, scene_at, solve_at, args.output, args.warm, settings=settings, jobs=args.jobs, words=args.words)
    if args.output is None:
        text = io.StringIO()
        writer = csv.DictWriter(text, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
        say(text.getvalue().rstrip("\n"))
    if args.plot is not None:
        _draw(args, rows, [axis.key for axis in axes], scene_at(points(axes, read=True)[0]))
    failed = sum(row["outcome"] != Outcome.CONVERGED for row in rows)
    steps = sum(int(row.get("iterations") or 0) for row in rows)
    note(f"sweep: {len(rows)} points, {failed} failed, {steps} iterations")
    return 1 if failed else 0


def _draw(args: argparse.Namespace, rows: list[dict[str, Any]], keys: list[str], scene: Scene) -> None:
    """The picture of --plot. Collective."""
    from ..output.style import save_figure
    from ..output.sweep_picture import check_names, figure_of

    usual = (name for name in DEFAULT_QUANTITY if any(name in row for row in rows))
    names = args.quantity.split(",") if args.quantity else [next(usual, "load")]
    check_names(rows, names)
    units = film_units(len(scene.shape))
    save_figure(lambda: figure_of(rows, keys, names, units, scene.name), args.plot)
