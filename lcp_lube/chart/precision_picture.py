"""The picture of speed against accuracy, and what it says in words, both from the rows of the csv alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpi4py import MPI

from ..output.resumable import Row
from .drawing import look, new_figure, save

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LEVELS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)

# Panels from top to bottom, by what the inner solver sees.
PANELS: dict[str, Callable[[Row], bool]] = {
    "2n system, direct": lambda row: row["nested"] != "True" and row["system"] == "full" and row["ksp_type"] == "preonly",
    "2n system, Krylov": lambda row: row["nested"] != "True" and row["system"] == "full" and row["ksp_type"] != "preonly",
    "n-by-n system": lambda row: row["nested"] != "True" and row["system"] != "full",
    "nested iteration": lambda row: row["nested"] == "True",
}
AXES = {
    "load": "relative error of the load",
    "rupture": "error of the rupture point / L",
}


def seconds(row: Row) -> float:
    """What a run costs: seconds by the clock, or of the processor where that is less, because other jobs slowed the clock."""
    return min(float(row["wall_s"]), float(row["cpu_s"]))


def error(row: Row, quantity: str) -> float | None:
    """The error to draw; None for a run that failed.

    The load's is the larger one of the whole error and of the part that the iteration leaves: an iteration that stops where
    both parts happen to cancel is not accurate.
    """
    names = ("load_error", "iteration_error") if quantity == "load" else ("rupture_error",)
    values = [float(row[name]) for name in names if row[name]]
    return max(values) if row["outcome"] == "converged" and values else None


def front(rows: Sequence[Row], quantity: str) -> list[Row]:
    """The Pareto front, from fast to accurate: no other run beats one in seconds and, by one part in a hundred, in error."""
    best: list[Row] = []
    least = float("inf")
    for row in sorted(rows, key=lambda row: seconds(row)):
        here = error(row, quantity)
        if here is not None and here < 0.99 * least:
            best.append(row)
            least = here
    return best


def cheapest(rows: Sequence[Row]) -> list[str]:
    """Lines of a table: for each scene and method the seconds of its fastest run within each of LEVELS, and which one it is."""
    lines = []
    for scene in dict.fromkeys(row["scene"] for row in rows):
        head = f"{scene}: seconds of the fastest run whose load is within"
        lines.append(head + "".join(f"{_percent(level):>10}" for level in LEVELS))
        mine = [row for row in rows if row["scene"] == scene]
        for method in dict.fromkeys(row["method"] for row in mine):
            runs = [fastest([row for row in mine if row["method"] == method], level) for level in LEVELS]
            cells = "".join(f"{seconds(run):>10.2g}" if run else f"{'-':>10}" for run in runs)
            lines.append(f"  {method:<{len(head) - 2}}{cells}")
        for level in LEVELS:
            run = fastest(mine, level)
            if run:
                lines.append(f"  fastest within {_percent(level)}: {describe(run)}")
    return lines


def fastest(rows: Sequence[Row], level: float) -> Row | None:
    """The run of least seconds whose load's error is at most `level`."""
    return next((row for row in front(rows, "load") if (error(row, "load") or 0.0) <= level), None)


def describe(row: Row) -> str:
    """A run in a few words."""
    nested = ", nested" * (row["nested"] == "True")
    inner = f"{row['system']} system, {row['recipe']}"
    return f"{row['method']}{nested}, {inner}, eps {float(row['eps']):g}, n = {row['n']}: {1e3 * seconds(row):.3g} ms"


def _percent(level: float) -> str:
    return f"{100 * level:g} %"


def draw(rows: Sequence[Row], quantity: str, path: Path, comm: MPI.Comm) -> None:
    """Draw the error of `quantity` (a key of AXES) against seconds. Collective."""
    save(lambda: picture(rows, quantity), path, comm)


def picture(rows: Sequence[Row], quantity: str) -> Figure:
    """A column a scene, a row a kind of inner solve; lines join a method's fastest runs over the grids."""
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    names = list(dict.fromkeys(row["method"] for row in rows))
    figure = new_figure(8.8, caption(rows, quantity))
    grid = figure.subplots(len(PANELS), len(scenes), sharex=True, sharey=True, squeeze=False)
    accurate = [value for row in rows if (value := error(row, quantity))]
    failed_at = 4 * max(accurate, default=1.0)
    for column, scene in enumerate(scenes):
        mine = [row for row in rows if row["scene"] == scene]
        for (title, belongs), axes in zip(PANELS.items(), grid[:, column], strict=True):
            _front_line(axes, front(mine, quantity), quantity)
            inside = [row for row in mine if belongs(row)]
            for number, name in enumerate(names):
                _series(axes, [row for row in inside if row["method"] == name], quantity, number, failed_at)
            axes.set(xscale="log", yscale="log")
            axes.grid(which="major", color="0.9", lw=0.6)
            if column == 0:
                axes.set_ylabel(f"{title}\n{AXES[quantity]}")
        grid[0, column].set_title(scene, fontweight="bold")
        grid[-1, column].set_xlabel("seconds")
    figure.legend(handles=_legend(names, rows), loc="outside upper center", ncols=4)
    return figure


def _front_line(axes: Axes, best: Sequence[Row], quantity: str) -> None:
    errors = [error(row, quantity) or 0.0 for row in best]
    axes.step([seconds(row) for row in best], errors, where="post", color="0.75", lw=4.0, solid_capstyle="butt", zorder=1)


def _series(axes: Axes, rows: Sequence[Row], quantity: str, number: int, failed_at: float) -> None:
    """A method's fastest recipe on each grid, by tolerance; every run that failed as a cross on one line."""
    for eps in dict.fromkeys(row["eps"] for row in rows):
        points = []
        for n in sorted({row["n"] for row in rows}, key=int):
            here = [row for row in rows if row["eps"] == eps and row["n"] == n and error(row, quantity)]
            points += sorted(here, key=lambda row: seconds(row))[:1]
        errors = [error(row, quantity) or 0.0 for row in points]
        axes.plot([seconds(row) for row in points], errors, **look(number), **_tolerance(eps))
    failed = [seconds(row) for row in rows if row["outcome"] != "converged"]
    axes.plot(failed, [failed_at] * len(failed), ls="none", marker="x", color=look(number)["color"], ms=5.0)


def _tolerance(eps: str) -> dict[str, Any]:
    """Loose tolerances dashed with open markers."""
    return {"ls": "--", "mfc": "white"} if float(eps) > 1e-6 else {"ls": "-"}


def _legend(names: Sequence[str], rows: Sequence[Row]) -> list[Any]:
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], **look(number), label=name) for number, name in enumerate(names)]
    for eps in dict.fromkeys(row["eps"] for row in rows):
        handles.append(Line2D([], [], color="0.3", marker="o", label=f"eps = {float(eps):g}", **_tolerance(eps)))
    return [
        *handles,
        Line2D([], [], color="0.3", marker="x", ls="none", label="failed"),
        Line2D([], [], color="0.75", lw=4.0, label="Pareto front of all"),
    ]


def caption(rows: Sequence[Row], quantity: str) -> str:
    """What the picture shows, counted from the rows."""
    failures = [row for row in rows if row["outcome"] != "converged"]
    sizes = sorted({int(row["n"]) for row in rows})
    text = (
        f"Points: n = {', '.join(map(str, sizes))}; of a method's recipes the fastest one, median of {max_runs(rows)} runs. "
        f"{len(failures)} of {len(rows)} runs failed"
    )
    return text + "."


def max_runs(rows: Sequence[Row]) -> int:
    """How many runs the medians are of, at most."""
    return max((int(row["runs"]) for row in rows), default=0)
