"""The pictures of speed against accuracy, from the rows of the csv alone."""

import math
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from mpi4py import MPI

from ..base.resumable import Row
from ..output.style import Axes, Figure
from ..registry import METHODS
from .drawing import look, new_figure, save
from .precision_words import ASKED, PEER, by_scene, error, fastest, front, loose, percent, seconds, sentence, time, timed

AXES = {
    "load": "relative error of the load",
    "p_max": "relative error of the largest pressure",
    "rupture": "error of the rupture point / L",
}
COLUMNS = 2
MOST_LINES = 7  # in a panel: more are not told apart
OTHERS = "other codes, the fastest"
PREFERRED = ("din", "din-pc", "fbn-a", "active-set", "fas", "auto --accuracy", OTHERS)
GRID = "error of the grid"
ROUNDING = 1e-14  # an error that is nothing else


def draw_all(rows: Sequence[Row], stem: Path, comm: MPI.Comm) -> list[Path]:
    """An error against seconds for each of AXES, the load's against Krylov iterations, and its parts: stem_load.png and so on.
    Collective."""
    pictures: dict[str, Callable[[], Figure]] = {name: partial(against_seconds, rows, name) for name in AXES}
    pictures |= {"krylov": partial(against_krylov, rows), "parts": partial(parts, rows)}
    paths = {name: stem.with_name(f"{stem.name}_{name}.png") for name in pictures}
    for name, build in pictures.items():
        save(build, paths[name], comm)
    return [*paths.values()]


def against_seconds(rows: Sequence[Row], quantity: str) -> Figure:
    """A panel a scene; of each method the cheapest run on every grid, and the Pareto front, named where asked."""
    shown = drawn(rows)
    solved = {row["scene"] for row in rows if row["outcome"] == "converged"}
    told = {row["scene"] for row in rows if error(row, quantity) is not None}  # several cavities: no one rupture point
    exact = [scene for scene in by_scene(rows) if scene in told and largest(rows, scene, quantity) <= ROUNDING]
    rows = [row for row in rows if (row["scene"] in told or row["scene"] not in solved) and row["scene"] not in exact]
    words = ", ".join(exact)
    text = (
        "Of a method's systems, recipes and tolerances the fastest run on each grid; filled: the grid's error prevails, open: "
        "what the iteration leaves. Grey band: doubt of a reference that is not exact. "
        f"{f'Right to rounding in every run, and not drawn: {words}. ' * bool(exact)}"
        f"{left_out(shown, rows)}{sentence(rows, quantity)}"
    )
    figure, panels = _panels(shown, rows, text, AXES[quantity], "seconds", "Pareto front")
    for scene, mine in by_scene(timed(rows)).items():
        axes = panels[scene]
        best = front(mine, quantity)
        axes.step([seconds(r) for r in best], _errors(best, quantity), where="post", color="0.8", lw=4.0, zorder=1)
        unsure = max((float(row.get(f"{quantity}_unsure") or 0.0) for row in mine), default=0.0)
        if unsure > 0:
            axes.axhspan(1e-16, unsure, color="0.93", zorder=0)
        for name in shown:
            _series(axes, [row for row in mine if label(row) == name], quantity, styles(shown, name), seconds)
        _limits(axes, [row for row in mine if label(row) in shown], quantity)
        _answers(axes, mine, quantity)
    return figure


def largest(rows: Sequence[Row], scene: str, quantity: str) -> float:
    """The largest error of a scene's runs: none where a rupture is an edge of the film on every grid."""
    return max(here for row in rows if row["scene"] == scene and (here := error(row, quantity)) is not None)


def against_krylov(rows: Sequence[Row]) -> Figure:
    """The load's error against Krylov iterations on all grids, for the runs that have any: no clock."""
    shown = drawn(rows)
    rows = [row for row in rows if row.get("krylov") not in ("", "0", None)]
    text = (
        "Krylov iterations of a run, coarser grids included; of a method's Krylov recipes the one with the fewest on each "
        "grid. Direct solvers and multigrid without matrices have none and are left out. "
        + left_out(shown, rows)
        + fewest(rows)
    )
    figure, panels = _panels(shown, rows, text, AXES["load"], "Krylov iterations")
    for scene, mine in by_scene(rows).items():
        for name in shown:
            here = [row for row in mine if label(row) == name]
            _series(panels[scene], here, "load", styles(shown, name), lambda row: float(row["krylov"]))
        _limits(panels[scene], mine, "load")
    return figure


def fewest(rows: Sequence[Row]) -> str:
    """Who needs the fewest iterations for a hundredth of a per cent, scene by scene."""
    parts = []
    for scene, mine in by_scene(rows).items():
        good = [row for row in mine if (here := error(row, "load")) is not None and here <= ASKED[-1]]
        best = min(good, key=lambda row: float(row["krylov"]), default=None)
        if best:
            parts.append(f"{scene} {best['method']} ({best['krylov']}, {best['recipe']})")
    return f"Fewest within {percent(ASKED[-1])}: {'; '.join(parts)}." if parts else ""


def parts(rows: Sequence[Row]) -> Figure:
    """The load's error on each grid taken apart: the grid's part as a line, the iteration's part a mark a method."""
    shown = drawn(rows)
    rows = [row for row in rows if row["outcome"] == "converged" and row["n"] != "auto" and row.get("load_grid")]
    over = [row for row in rows if loose(row, "load")]
    names = ", ".join(f"{m} eps {float(e):g}" for m, e in dict.fromkeys((r["method"], r["eps"]) for r in over))
    text = (
        "Line: error of the grid (the same grid solved to rounding). Marks: what the iteration adds at a method's smallest "
        f"tolerance, the largest of its recipes. {left_out(shown, rows)}"
        f"The iteration's part is the larger one in {len(over)} of {len(rows)} runs{f': {names}' * bool(names)}."
    )
    figure, panels = _panels(shown, rows, text, AXES["load"], "points a side", GRID)
    for scene, mine in by_scene(rows).items():
        axes = panels[scene]
        grids = {int(row["n"]): float(row["load_grid"]) for row in mine}
        axes.plot(sorted(grids), [grids[n] for n in sorted(grids)], color="0.75", lw=4.0, zorder=1)
        for name in shown:
            theirs = [row for row in mine if label(row) == name]
            eps = min((row["eps"] for row in theirs), key=float, default="")
            most: dict[int, float] = {}
            for row in theirs:
                if row["eps"] == eps:
                    most[int(row["n"])] = max(float(row["load_iteration"] or 0.0), most.get(int(row["n"]), 1e-16))
            axes.plot(sorted(most), [most[n] for n in sorted(most)], **{**styles(shown, name), "lw": 0.8})
        axes.set_ylim(1e-16, None)
    return figure


def label(row: Row) -> str:
    """The line that a run belongs to: its method, or other codes together."""
    return OTHERS if row["system"] == PEER else str(row["method"])


def drawn(rows: Sequence[Row]) -> list[str]:
    """At most MOST_LINES lines: PREFERRED ones, then others in the registry's order while there is room."""
    found = dict.fromkeys(map(label, rows))
    order = [*PREFERRED, *METHODS, *found]
    kept = sorted(found, key=order.index)[:MOST_LINES]
    return sorted(kept, key=[*METHODS, *found].index)


def left_out(shown: Sequence[str], rows: Sequence[Row]) -> str:
    """Whose lines are not drawn."""
    names = [name for name in dict.fromkeys(map(label, rows)) if name not in shown]
    return f"Not drawn, in the csv: {', '.join(names)}. " if names else ""


def styles(shown: Sequence[str], name: str) -> dict[str, Any]:
    """Colour and marker of a line, the same in all pictures of these rows; other codes have black, which no method has."""
    return {"color": "#000000", "marker": "*"} if name == OTHERS else look([n for n in shown if n != OTHERS].index(name))


def _errors(rows: Sequence[Row], quantity: str) -> list[float]:
    return [max(error(row, quantity) or 0.0, 1e-16) for row in rows]


def _series(axes: Axes, rows: Sequence[Row], quantity: str, style: dict[str, Any], cost: Callable[[Row], float]) -> None:
    """A method's cheapest run on each grid, of those as accurate as the grid where there are any; failures as crosses."""
    points = []
    for n in sorted({row["points"] for row in rows if row["points"]}, key=int):
        here = [row for row in rows if row["points"] == n and error(row, quantity) is not None]
        points += sorted(here, key=lambda row: (loose(row, quantity), cost(row)))[:1]
    xs, ys = [cost(row) for row in points], _errors(points, quantity)
    axes.plot(xs, ys, **{**style, "marker": ""}, lw=1.0)
    for x, y, row in zip(xs, ys, points, strict=True):
        axes.plot(x, y, **style, ls="none", mfc="white" if loose(row, quantity) else style["color"])
    failed = [cost(row) for row in rows if row["outcome"] != "converged" and row["cpu_s"]]
    axes.plot(failed, [0.95] * len(failed), ls="none", marker="x", color=style["color"], transform=axes.get_xaxis_transform())


def _answers(axes: Axes, rows: Sequence[Row], quantity: str) -> None:
    """Lines at the accuracies asked for; under the title the method that reaches each first, and those on the front."""
    said = []
    for level in ASKED:
        axes.axhline(level, color="0.5", lw=0.7, ls=":", zorder=0)
        best = fastest(rows, level, quantity)
        said.append(f"{percent(level)}: {best['method']}, {time(best)}" if best else f"{percent(level)}: none")
    names = ", ".join(dict.fromkeys(row["method"] for row in front(rows, quantity)))
    text = "   ".join(said) + f"\nfront: {names or 'empty'}"
    axes.text(0.0, 1.015, text, transform=axes.transAxes, fontsize=7.0, va="bottom")


def _limits(axes: Axes, rows: Sequence[Row], quantity: str) -> None:
    seen = [value for row in rows if (value := error(row, quantity))]
    if seen:
        low, high = max(min(seen), 1e-13), max(seen)
        low, high = (0.4 * low, 8 * high) if high > 8 * low else (low / 8, 8 * high)  # two powers of ten in every panel
        axes.set_ylim(low, high)


def _panels(
    shown: Sequence[str], rows: Sequence[Row], text: str, ylabel: str, xlabel: str, grey: str = ""
) -> tuple[Figure, dict[str, Axes]]:
    """Empty panels by scene, and a legend in the place that is left or under them."""
    from matplotlib.ticker import NullFormatter

    scenes = [*by_scene(rows)]
    full = len(scenes) % COLUMNS == 0  # then the legend has a line of its own
    heights = [1.0] * math.ceil(len(scenes) / COLUMNS) + [0.5] * full
    figure = new_figure(0.9 + 2.15 * sum(heights), text)
    grid = figure.subplots(len(heights), COLUMNS, squeeze=False, height_ratios=heights)
    panels = {}
    for number, axes in enumerate(grid.ravel()):
        if number >= len(scenes):
            axes.set_axis_off()
            continue
        panels[scenes[number]] = axes
        axes.set(xscale="log", yscale="log")
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.yaxis.set_minor_formatter(NullFormatter())
        axes.grid(which="major", color="0.92", lw=0.6)
        axes.set_title(scenes[number], fontweight="bold", loc="left", pad=22 if xlabel == "seconds" else 6)
        axes.set_xlabel(xlabel)
        if number % COLUMNS == 0:
            axes.set_ylabel(ylabel)
    place = grid.ravel()[len(scenes)]
    place.legend(handles=_legend(shown, rows, grey), loc="center", ncols=2, fontsize=7.0)
    return figure, panels


def _legend(shown: Sequence[str], rows: Sequence[Row], grey: str) -> list[Any]:
    """Lines, marks, and what the grey line is."""
    from matplotlib.lines import Line2D

    here = {label(row) for row in rows}
    handles = [Line2D([], [], **styles(shown, name), label=name) for name in shown if name in here]
    if grey != GRID:
        handles.append(Line2D([], [], color="0.3", marker="o", mfc="white", ls="none", label="iteration's part larger"))
    if any(row["outcome"] != "converged" for row in rows):
        handles.append(Line2D([], [], color="0.3", marker="x", ls="none", label="failed"))
    return [*handles, *([Line2D([], [], color="0.8", lw=4.0, label=grey)] if grey else [])]
