"""How the cost of a whole solve grows with the grid and falls with the ranks: the runs, made on as many ranks as there are.

    lcp-lube chart scaling; mpiexec -n 2 lcp-lube chart scaling; ...

fills one csv; the picture is drawn anew from all of it. On more ranks than cores the seconds mean nothing and are not drawn,
but the iteration counts do: they are those of a cluster.
"""

import os
from collections.abc import Iterator, Sequence
from math import isqrt
from pathlib import Path
from statistics import median
from typing import Any

from ..base.progress import Line
from ..base.resumable import ResumableCsv, Row
from ..output.console import say
from ..output.style import Axes, Figure
from ..output.table import table as lines_of
from ..scenes.scene import load_scene
from .drawing import look, new_figure, save
from .experiment import open_store, run

SCENES = ("problem4", "rough")
STRONG = (250, 500, 1000)  # points a side, whatever the ranks
QUICK = (60, 120)
WEAK = 500  # points a side of a square that each rank has
REPEATS = 3
CHOICES: dict[str, Any] = {"method": "active-set", "system": "cavity", "recipe": "bcgs_amg", "nested": True}

KEY = ("kind", "scene", "n", "ranks")
COLUMNS = ("wall_s", "cpu_s", "runs", "levels", "finest_linear", "memory_mb")


def chart(quick: bool, results: Path) -> int:
    """Make the runs of this number of ranks that are not in the csv yet, then draw. Collective.

    quick : small grids, each run made once; kept apart from the full chart.
    """
    stem = "scaling" + "_quick" * quick
    store = open_store(results / f"{stem}.csv", KEY, COLUMNS)
    wanted = [
        (kind, scene, n)
        for kind, scene, n in cases(store.comm.size, quick)
        if store.find(kind=kind, scene=scene, n=n, ranks=store.comm.size) is None
    ]
    if wanted:
        run(load_scene("problem4", {"n": 63}), **CHOICES)  # what is compiled and loaded at first use is so before a clock runs
    counts_only = quick or store.comm.size > (os.cpu_count() or 1)
    with Line() as line:
        for kind, scene, n in line.over(wanted, lambda run: "{} {} {}, run".format(*run)):
            fill(store, kind, scene, n, 1 if counts_only else REPEATS)
    say("\n".join(table(store.rows)))
    save(lambda: picture(store.rows), results / f"{stem}.png", store.comm)
    say(f"{results / stem}.png, from {store.path} (remove it to run them again)")
    return 0


def cases(ranks: int, quick: bool) -> Iterator[tuple[str, str, int]]:
    """Kind, scene and points a side: 'strong', the same on any number of ranks; 'weak', as many points for every rank."""
    for scene in SCENES:
        for n in QUICK if quick else STRONG:
            yield "strong", scene, n
        yield "weak", scene, isqrt(ranks * (QUICK[0] if quick else WEAK) ** 2)


def fill(store: ResumableCsv, kind: str, scene: str, n: int, repeats: int) -> Row:
    """Make a run and keep it. Collective."""
    runs = [run(load_scene(scene, {"n": n}), **CHOICES) for _ in range(repeats)]
    first = runs[0]
    values = {
        **first,
        **{clock: f"{median(a_run[clock] for a_run in runs):.4f}" for clock in ("wall_s", "cpu_s")},
        "runs": repeats,
        "levels": " ".join(str(level["iterations"]) for level in first["levels"]),
        "finest_linear": first["linear_iterations"],
    }
    row = store.add({**values, "kind": kind, "scene": scene, "n": n, "ranks": store.comm.size})
    say(f"{kind} {scene} {n} x {n}, {store.comm.size} ranks: {row['outcome']}, {row['iterations']} steps, {row['wall_s']} s")
    return row


def table(rows: list[Row]) -> list[str]:
    """The rows as lines; speed-up against one rank on the same grid (strong) and seconds against it (weak)."""
    cells = [["", "", "", "ranks", "s", "us/point", "against 1", "steps", "Krylov", "MB"]]
    for row in sorted(rows, key=lambda row: (row["kind"], row["scene"], int(row["n"]), int(row["ranks"]))):
        one = reference(rows, row)
        seconds = float(row["wall_s"])
        ratio = f"{float(one['wall_s']) / seconds:.2f}" if one and can_time(row) else ""
        point = f"{1e6 * seconds / int(row['n']) ** 2:.2f}"
        counts = (row["iterations"], row["finest_linear"], f"{float(row['memory_mb'] or 0):.0f}")
        cells.append([row["kind"], row["scene"], row["n"], row["ranks"], f"{seconds:.2f}", point, ratio, *counts])
    return lines_of(cells, align="<<")


def reference(rows: list[Row], row: Row) -> Row | None:
    """The same run on one rank: the same grid (strong), or one rank's share of points (weak)."""
    alike = [r for r in rows if (r["kind"], r["scene"], r["ranks"]) == (row["kind"], row["scene"], "1")]
    return next((r for r in alike if row["kind"] == "weak" or r["n"] == row["n"]), None)


def can_time(row: Row) -> bool:
    """Whether this machine has a core for every rank."""
    return int(row["ranks"]) <= (os.cpu_count() or 1)


def picture(rows: Sequence[Row]) -> Figure:
    """Seconds a point by grid, and Krylov iterations a Newton step by ranks."""
    cores = os.cpu_count() or 1
    figure = new_figure(
        3.0,
        "Nested active set on the cavity system, BiCGStab with BoomerAMG, medians. Left: a whole solve's seconds, up to "
        f"the {cores} ranks that have a core of their own. Right: Krylov iterations a Newton step on the finest grid, "
        "also on ranks that share cores.",
    )
    good = [row for row in rows if row["outcome"] == "converged"]
    left, right = figure.subplots(1, 2)
    _seconds(left, list(filter(can_time, good)))
    _counts(right, good)
    return figure


def _seconds(axes: Axes, rows: Sequence[Row]) -> None:
    """Microseconds a point against points, a line for each scene and number of ranks."""
    series = sorted({(row["scene"], int(row["ranks"])) for row in rows})
    for k, (scene, ranks) in enumerate(series):
        mine = [row for row in rows if (row["scene"], int(row["ranks"])) == (scene, ranks)]
        points = sorted({int(row["n"]) ** 2: float(row["wall_s"]) for row in mine}.items())
        label = f"{scene}, {ranks} rank{'s' * (ranks > 1)}"
        axes.plot([n for n, _ in points], [1e6 * s / n for n, s in points], label=label, **look(k))
    axes.set(xscale="log", xlabel="points", ylabel="microseconds a point", ylim=(0, None), title="whole solve")
    if series:
        axes.legend(loc="lower right")


def _counts(axes: Axes, rows: Sequence[Row]) -> None:
    """Krylov iterations a step against ranks, a line for each scene and kind: the largest grid of each."""
    series = sorted({(row["kind"], row["scene"]) for row in rows})
    for k, (kind, scene) in enumerate(series):
        mine = [row for row in rows if (row["kind"], row["scene"]) == (kind, scene)]
        if kind == "strong":
            largest = max(int(row["n"]) for row in mine)
            mine = [row for row in mine if int(row["n"]) == largest]
        points = sorted((int(row["ranks"]), int(row["finest_linear"]) / max(int(row["iterations"]), 1)) for row in mine)
        label = f"{scene}, {kind}"
        axes.plot([ranks for ranks, _ in points], [count for _, count in points], label=label, **look(k))
    axes.set(xscale="log", xlabel="ranks", ylabel="iterations a step", ylim=(0, None), title="Krylov iterations")
    ticks = sorted({int(row["ranks"]) for row in rows})
    axes.set_xticks(ticks, [str(tick) for tick in ticks])
    axes.minorticks_off()
    if series:
        axes.legend()
