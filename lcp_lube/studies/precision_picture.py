"""The pictures of speed against accuracy, from the rows of the csv alone."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpi4py import MPI

from ..base.resumable import Row
from ..registry import METHODS
from .drawing import MARKERS, look, new_figure, save
from .precision_words import ASKED, PEER, by_scene, error, fastest, front, loose, percent, seconds, sentence, time

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

AXES = {
    "load": "relative error of the load",
    "p_max": "relative error of the largest pressure",
    "rupture": "error of the rupture point / L",
}
COLUMNS = 2
GRID = "error of the grid"


def draw_all(rows: Sequence[Row], stem: Path, comm: MPI.Comm) -> list[Path]:
    """All pictures: an error against seconds for each of AXES, the load's against Krylov iterations, and its parts. Collective.

    Returns
    -------
    list of Path : the files, stem_load.png and so on.
    """
    pictures: dict[str, Callable[[], Figure]] = {name: lambda name=name: against_seconds(rows, name) for name in AXES}  # type: ignore[misc]
    pictures |= {"krylov": lambda: against_krylov(rows), "parts": lambda: parts(rows)}
    paths = []
    for name, build in pictures.items():
        paths.append(stem.with_name(f"{stem.name}_{name}.png"))
        save(build, paths[-1], comm)
    return paths


def against_seconds(rows: Sequence[Row], quantity: str) -> Figure:
    """A panel a scene; of each method and tolerance the fastest run on every grid, and the Pareto front, named where asked."""
    text = (
        "Of a method's systems and recipes the fastest one on each grid; filled: the grid's error prevails, open: "
        f"what the iteration leaves. Grey band: doubt of a reference that is not exact. {sentence(rows, quantity)}"
    )
    figure, panels = _panels(rows, text, AXES[quantity], "seconds", "Pareto front")
    for scene, mine in by_scene(rows).items():
        axes = panels[scene]
        best = front(mine, quantity)
        axes.step([seconds(r) for r in best], _errors(best, quantity), where="post", color="0.8", lw=4.0, zorder=1)
        unsure = max((float(row.get(f"{quantity}_unsure") or 0.0) for row in mine), default=0.0)
        if unsure > 0:
            axes.axhspan(1e-16, unsure, color="0.93", zorder=0)
        for name in methods(rows):
            _series(axes, [row for row in mine if row["method"] == name], quantity, styles(rows, name), seconds)
        _limits(axes, mine, quantity)
        _answers(axes, mine, quantity)
    return figure


def against_krylov(rows: Sequence[Row]) -> Figure:
    """The load's error against Krylov iterations on all grids, for the runs that have any: no clock."""
    rows = [row for row in rows if row.get("krylov") not in ("", "0", None)]
    text = (
        "Krylov iterations of a run, coarser grids included; of a method's Krylov recipes the one with the fewest on each "
        "grid. Direct solvers and multigrid without matrices have none and are left out. " + fewest(rows)
    )
    figure, panels = _panels(rows, text, AXES["load"], "Krylov iterations")
    for scene, mine in by_scene(rows).items():
        for name in methods(rows):
            here = [row for row in mine if row["method"] == name]
            _series(panels[scene], here, "load", styles(rows, name), lambda row: float(row["krylov"]))
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
    rows = [row for row in rows if row["outcome"] == "converged" and row["n"] != "auto" and row.get("load_grid")]
    over = [row for row in rows if loose(row, "load")]
    names = ", ".join(f"{m} eps {float(e):g}" for m, e in dict.fromkeys((r["method"], r["eps"]) for r in over))
    text = (
        "Line: error of the grid (the same grid solved to rounding). Marks: what the iteration adds, the largest of a method's "
        f"recipes. The iteration's part is the larger one in {len(over)} of {len(rows)} runs{f': {names}' * bool(names)}."
    )
    figure, panels = _panels(rows, text, AXES["load"], "points a side", GRID)
    for scene, mine in by_scene(rows).items():
        axes = panels[scene]
        grids = {int(row["n"]): float(row["load_grid"]) for row in mine}
        axes.plot(sorted(grids), [grids[n] for n in sorted(grids)], color="0.75", lw=4.0, zorder=1)
        for name in methods(rows):
            for eps in dict.fromkeys(row["eps"] for row in mine if row["method"] == name):
                most: dict[int, float] = {}
                for row in mine:
                    if (row["method"], row["eps"]) == (name, eps):
                        most[int(row["n"])] = max(float(row["load_iteration"] or 0.0), most.get(int(row["n"]), 1e-16))
                style = styles(rows, name) | _tolerance(eps)
                axes.plot(sorted(most), [most[n] for n in sorted(most)], **{**style, "lw": 0.8})
        axes.set_ylim(1e-16, None)
    return figure


def methods(rows: Sequence[Row]) -> list[str]:
    """All methods in the registry's order, the peers last."""
    found = dict.fromkeys(row["method"] for row in rows if row["system"] != PEER)
    order = [*METHODS, *found]
    names = sorted(found, key=order.index)
    return [*names, *dict.fromkeys(row["method"] for row in rows if row["system"] == PEER)]


def styles(rows: Sequence[Row], name: str) -> dict[str, Any]:
    """Colour and marker, the same in all pictures; other codes in grey, so that they are told from ours at a glance."""
    peers = [row["method"] for row in rows if row["system"] == PEER]
    if name in peers:
        return {"color": "0.45", "marker": MARKERS[::-1][[*dict.fromkeys(peers)].index(name) % len(MARKERS)]}
    films = [method for method, entry in METHODS.items() if "lubrication" in entry.kinds]
    return look(films.index(name)) if name in films else {"color": "#882255", "marker": "h"}


def _errors(rows: Sequence[Row], quantity: str) -> list[float]:
    return [max(error(row, quantity) or 0.0, 1e-16) for row in rows]


def _series(axes: Axes, rows: Sequence[Row], quantity: str, style: dict[str, Any], cost: Callable[[Row], float]) -> None:
    """A method's cheapest run on each grid, by tolerance; runs that failed as crosses at the top."""
    varying = {row["n"] for row in rows} == {"auto"}  # one line through all tolerances
    for eps in ["all"] if varying else dict.fromkeys(row["eps"] for row in rows):
        mine = [row for row in rows if varying or row["eps"] == eps]
        points = []
        for n in sorted({row["points"] for row in mine if row["points"]}, key=int):
            here = [row for row in mine if row["points"] == n and error(row, quantity) is not None]
            points += sorted(here, key=cost)[:1]
        line = _tolerance("1e-8" if varying else eps)
        xs, ys = [cost(row) for row in points], _errors(points, quantity)
        axes.plot(xs, ys, **{**style, "marker": ""}, ls=line["ls"], lw=1.0)
        for x, y, row in zip(xs, ys, points, strict=True):
            axes.plot(x, y, **style, ls="none", mfc="white" if loose(row, quantity) else style["color"])
    failed = [cost(row) for row in rows if row["outcome"] != "converged" and row["cpu_s"]]
    axes.plot(failed, [0.97] * len(failed), ls="none", marker="x", color=style["color"], transform=axes.get_xaxis_transform())


def _answers(axes: Axes, rows: Sequence[Row], quantity: str) -> None:
    """Lines at the accuracies that are asked for; under the title who reaches them first, and who is on the front."""
    said = []
    for level in ASKED:
        axes.axhline(level, color="0.5", lw=0.7, ls=":", zorder=0)
        best = fastest(rows, level, quantity)
        said.append(f"{percent(level)}: {best['method']}, {time(best)}" if best else f"{percent(level)}: none")
    names = ", ".join(dict.fromkeys(row["method"] for row in front(rows, quantity)))
    text = "   ".join(said) + f"\nfront: {names or 'empty'}"
    axes.text(0.0, 1.015, text, transform=axes.transAxes, fontsize=6.8, va="bottom")


def _limits(axes: Axes, rows: Sequence[Row], quantity: str) -> None:
    seen = [value for row in rows if (value := error(row, quantity))]
    if seen:
        axes.set_ylim(0.4 * max(min(seen), 1e-13), 8 * max(seen))


def _panels(rows: Sequence[Row], text: str, ylabel: str, xlabel: str, grey: str = "") -> tuple[Figure, dict[str, Axes]]:
    """Empty panels by scene, and a legend in the place that is left or under them."""
    from matplotlib.ticker import NullFormatter

    scenes = [*by_scene(rows)]
    lines = math.ceil((len(scenes) + 1) / COLUMNS)
    figure = new_figure(0.9 + 2.15 * lines, text)
    grid = figure.subplots(lines, COLUMNS, squeeze=False)
    panels = {}
    for number, axes in enumerate(grid.ravel()):
        if number >= len(scenes):
            axes.set_axis_off()
            continue
        panels[scenes[number]] = axes
        axes.set(xscale="log", yscale="log")
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.grid(which="major", color="0.92", lw=0.6)
        axes.set_title(scenes[number], fontweight="bold", loc="left", pad=22 if xlabel == "seconds" else 6)
        axes.set_xlabel(xlabel)
        if number % COLUMNS == 0:
            axes.set_ylabel(ylabel)
    place = grid.ravel()[len(scenes)]
    place.legend(handles=_legend(rows, grey), loc="center", ncols=2, fontsize=7.0)
    return figure, panels


def _tolerance(eps: str) -> dict[str, Any]:
    """Loose tolerances dashed."""
    return {"ls": "--" if float(eps) > 1e-6 else "-"}


def _legend(rows: Sequence[Row], grey: str) -> list[Any]:
    """Methods, tolerances, marks, and what the grey line is."""
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], **styles(rows, name), label=name) for name in methods(rows)]
    for eps in dict.fromkeys(row["eps"] for row in rows if row["n"] != "auto"):
        handles.append(Line2D([], [], color="0.3", label=f"eps = {float(eps):g}", ls=_tolerance(eps)["ls"]))
    if grey != GRID:
        handles.append(Line2D([], [], color="0.3", marker="o", mfc="white", ls="none", label="iteration's part larger"))
    if any(row["outcome"] != "converged" for row in rows):
        handles.append(Line2D([], [], color="0.3", marker="x", ls="none", label="failed"))
    return [*handles, *([Line2D([], [], color="0.8", lw=4.0, label=grey)] if grey else [])]
