"""Pictures of DIN's starts, and what they show in words, from the rows of the csv alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from mpi4py import MPI

from ..base.resumable import Row
from .drawing import look, new_figure, save
from .map_picture import FAILURES, chosen, converged, legend, unique

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def rule(row: Row) -> str:
    """Name of the rule that a run follows: that for mu, and the conditions on the step where they are not the paper's."""
    return row["mu"] if row["conditions"] == "FCB" else f"{row['mu']}, {row['conditions']}"


def by_rule(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """The rows of each rule."""
    rules: dict[str, list[Row]] = {}
    for row in rows:
        rules.setdefault(rule(row), []).append(row)
    return rules


def decade(row: Row, name: str) -> int:
    """k for a start of 10^k."""
    return round(math.log10(float(row[name])))


def apart(row: Row) -> int:
    """By how many decades p0 and r0 differ."""
    return abs(decade(row, "p0") - decade(row, "r0"))


def equal_starts(rows: Sequence[Row]) -> list[Row]:
    return [row for row in rows if row["p0"] == row["r0"]]


def grid_starts(rows: Sequence[Row]) -> list[Row]:
    """Those of the solver and the decades that have unequal starts too."""
    recipe = next(row["recipe"] for row in rows if apart(row))
    decades = {row["p0"] for row in rows if apart(row)}
    return [row for row in rows if row["recipe"] == recipe and row["p0"] in decades and row["r0"] in decades]


def lines_sentence(rows: Sequence[Row]) -> str:
    """Rule by rule, from which equal starts DIN fails, for each inner solver."""
    sentences = []
    for name, mine in by_rule(equal_starts(rows)).items():
        failed = [row for row in mine if not converged(row)]
        if not failed:
            most = max(int(row["iterations"]) for row in mine)
            sentences.append(f"{name}: all {len(mine)} converge, in {most} iterations at most.")
            continue
        largest = {
            recipe: max(decade(row, "p0") for row in chosen(failed, recipe=recipe)) for recipe in unique(failed, "recipe")
        }
        where = " and ".join(f"1e{k} with recipe {recipe}" for recipe, k in largest.items())
        sentences.append(f"{name}: {len(failed)} of {len(mine)} fail, the largest {where}.")
    return f"Starts p0 = r0. {' '.join(sentences)}"


def map_sentence(rows: Sequence[Row]) -> str:
    """Rule by rule, how many starts of the grid converge, and how far apart p0 and r0 may be."""
    parts = []
    for name, mine in by_rule(grid_starts(rows)).items():
        failing = min((apart(row) for row in mine if not converged(row)), default=None)
        farthest = max((apart(row) for row in mine if converged(row)), default=None)
        said = f"{name}: {sum(map(converged, mine))} of {len(mine)} converge"
        if failing:
            said += f", all those less than {failing} decades apart"
        if failing is not None and farthest is not None:
            said += f", none more than {farthest} decades apart"
        parts.append(said)
    return f"Numbers: iterations. Starts p0, r0 by {'; by '.join(parts)}."


def draw_lines(rows: Sequence[Row], path: Path, comm: MPI.Comm) -> None:
    """Iterations against p0 = r0. Collective."""
    save(lambda: lines(rows), path, comm)


def draw_maps(rows: Sequence[Row], path: Path, comm: MPI.Comm) -> None:
    """Iterations over p0 x r0. Collective."""
    save(lambda: maps(rows), path, comm)


def lines(rows: Sequence[Row]) -> Figure:
    """A column a scene, a row an inner solver, a line a rule; failures where their iterations ended."""
    sentence, rows = lines_sentence(rows), equal_starts(rows)
    scenes, recipes = unique(rows, "scene"), unique(rows, "recipe")
    figure = new_figure(1.3 + 1.9 * len(recipes), sentence)
    grid = figure.subplots(len(recipes), len(scenes), sharex=True, sharey=True, squeeze=False)
    for recipe, row_of_axes in zip(recipes, grid, strict=True):
        for scene, axes in zip(scenes, row_of_axes, strict=True):
            for number, (name, mine) in enumerate(by_rule(chosen(rows, scene=scene, recipe=recipe)).items()):
                _rule(axes, mine, number, name)
            axes.set(xscale="log", ylim=(0, None), xticks=[10.0**k for k in range(-15, 4, 6)])
            axes.grid(which="major", color="0.9", lw=0.6)
        row_of_axes[0].set_ylabel(f"recipe {recipe}\niterations")
    for scene, axes in zip(scenes, grid[0], strict=True):
        axes.set_title(scene, fontweight="bold")
    for axes in grid[-1]:
        axes.set_xlabel("p0 in MPa = r0")
    handles, labels = grid[0, 0].get_legend_handles_labels()
    marks = legend(rows)
    said = [str(mark.get_label()) for mark in marks]
    figure.legend(handles + marks, labels + said, loc="outside upper center", ncols=len(labels) + len(said))
    return figure


def _rule(axes: Axes, rows: Sequence[Row], number: int, name: str) -> None:
    """A line through the starts that converge; later rules are thinner, so that rules which agree are all seen."""
    x = [float(row["p0"]) for row in rows]
    y = [float(row["iterations"]) if converged(row) else math.nan for row in rows]
    axes.plot(x, y, **look(number), lw=2.6 - 0.7 * number, ms=5.6 - 1.0 * number, label=name)
    for outcome, (mark, _) in FAILURES.items():
        failed = chosen(rows, outcome=outcome)
        x, y = [float(row["p0"]) for row in failed], [float(row["iterations"]) for row in failed]
        axes.plot(x, y, color=look(number)["color"], marker=mark, mfc="none", ls="none", ms=6.5 - number)


def maps(rows: Sequence[Row]) -> Figure:
    """A column a scene, a row a rule; a cell's colour and number are its iterations, a mark says how it failed."""
    sentence, rows = map_sentence(rows), grid_starts(rows)
    scenes, rules = unique(rows, "scene"), by_rule(rows)
    figure = new_figure(1.0 + 2.0 * len(rules), sentence)
    grid = figure.subplots(len(rules), len(scenes), sharex=True, sharey=True, squeeze=False)
    for (name, mine), row_of_axes in zip(rules.items(), grid, strict=True):
        for scene, axes in zip(scenes, row_of_axes, strict=True):
            _map(axes, chosen(mine, scene=scene))
        row_of_axes[0].set_ylabel(f"{name}\nr0")
    for scene, axes in zip(scenes, grid[0], strict=True):
        axes.set_title(scene, fontweight="bold")
    for axes in grid[-1]:
        axes.set_xlabel("p0 in MPa")
    marks = legend(rows)
    figure.legend(handles=marks, loc="outside upper right", ncols=len(marks) or 1)
    return figure


def _map(axes: Axes, rows: Sequence[Row]) -> None:
    """One rule on one scene, a cell a start."""
    from matplotlib.colors import LogNorm

    decades = sorted({decade(row, "p0") for row in rows})
    place = {k: number for number, k in enumerate(decades)}
    cells = np.full((len(decades), len(decades)), np.nan)
    for row in rows:
        i, j = place[decade(row, "p0")], place[decade(row, "r0")]
        if converged(row):
            cells[j, i] = float(row["iterations"])
            colour = "white" if cells[j, i] > 130 else "black"
            axes.text(i, j, row["iterations"], ha="center", va="center", fontsize=6.5, color=colour)
        else:
            axes.plot(i, j, ls="none", marker=FAILURES[row["outcome"]][0], ms=3.5, color="0.45")
    axes.imshow(cells, origin="lower", cmap="Blues", norm=LogNorm(15, 500), aspect="equal")
    axes.set_xticks(range(len(decades)), [f"$10^{{{k}}}$" if k % 4 == 1 else "" for k in decades])
    axes.set_yticks(range(len(decades)), [f"$10^{{{k}}}$" if k % 4 == 1 else "" for k in decades])
