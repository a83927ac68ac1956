"""The picture of speed against accuracy, and what it says in words, both from the rows of the csv alone."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpi4py import MPI

from ..output.resumable import Row
from .drawing import look, new_figure, save

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LEVELS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)

PANELS = ("2n system, direct solver", "2n system, Krylov solver", "n-by-n system", "nested iteration")  # from top to bottom
AXES = {
    "load": "relative error of the load",
    "rupture": "error of the rupture point / L",
}


def panel(row: Row) -> str:
    """Which of PANELS a run belongs to, by what its inner solver sees."""
    if row["nested"] == "True":
        return PANELS[3]
    if row["system"] != "full":
        return PANELS[2]
    return PANELS[0] if row["ksp_type"] == "preonly" else PANELS[1]


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
    """The Pareto front, from fast to accurate: no other run beats one in seconds and, by one part in ten, in error."""
    best: list[Row] = []
    least = float("inf")
    for row in sorted(rows, key=lambda row: seconds(row)):
        here = error(row, quantity)
        if here is not None and here < 0.9 * least:
            best.append(row)
            least = here
    return best


def cheapest(rows: Sequence[Row]) -> list[str]:
    """Lines of a table: for each scene and method the seconds of its fastest run within each of LEVELS, and which one it is."""
    lines = []
    for scene in _scenes(rows):
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


def fastest(rows: Sequence[Row], level: float, quantity: str = "load") -> Row | None:
    """The run of least seconds whose error is at most `level`."""
    return next((row for row in front(rows, quantity) if (error(row, quantity) or 0.0) <= level), None)


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
    scenes = _scenes(rows)
    names = list(dict.fromkeys(row["method"] for row in rows))
    figure = new_figure(8.8, caption(rows, quantity))
    grid = figure.subplots(len(PANELS), len(scenes), sharex=True, sharey=True, squeeze=False)
    accurate = [value for row in rows if (value := error(row, quantity))]
    failed_at = 4 * max(accurate, default=1.0)
    for column, scene in enumerate(scenes):
        mine = [row for row in rows if row["scene"] == scene]
        for title, axes in zip(PANELS, grid[:, column], strict=True):
            _front_line(axes, front(mine, quantity), quantity)
            inside = [row for row in mine if panel(row) == title]
            for number, name in enumerate(names):
                _series(axes, [row for row in inside if row["method"] == name], quantity, number, failed_at)
            axes.set(xscale="log", yscale="log")
            axes.grid(which="major", color="0.9", lw=0.6)
            if column == 0:
                axes.set_ylabel(f"{title}\n{AXES[quantity]}")
        grid[0, column].set_title(scene, fontweight="bold")
        grid[-1, column].set_xlabel("seconds")
    figure.legend(handles=_legend(names, rows), loc="outside upper center", ncols=5)
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


def caption(rows: Sequence[Row], quantity: str, level: float = 1e-4) -> str:
    """What the picture shows, from the rows: the cheapest run for one accuracy, and which inner solves fail."""
    sizes = sorted({int(row["n"]) for row in rows})
    text = f"Markers: n = {', '.join(map(str, sizes))}, of a method's recipes the fastest one."
    bests = {scene: fastest([row for row in rows if row["scene"] == scene], level, quantity) for scene in _scenes(rows)}
    said = "; ".join(f"{scene}: {describe(best)}" for scene, best in bests.items() if best)
    if said:
        text += f" Fastest within {_percent(level)}: {said}."
    failed = [row for row in rows if row["outcome"] != "converged"]
    counts = Counter(map(panel, failed))
    where = ", ".join(f"{counts[title]} with {title}" for title in PANELS if title in counts)
    return f"{text} {len(failed)} of {len(rows)} runs failed{': ' * bool(where)}{where}."


def _scenes(rows: Sequence[Row]) -> list[str]:
    return list(dict.fromkeys(row["scene"] for row in rows))
