"""Pictures of DIN's starts, and what they show in words, from the rows of the csv alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from mpi4py import MPI

from ..output.resumable import Row
from ..problems.solution import Outcome
from .drawing import look, new_figure, save

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# A marker for each way to fail.
FAILURES = {
    Outcome.MAX_ITERATIONS: ("x", "iteration limit"),
    Outcome.STEP_LENGTH: ("_", "no step length"),
    Outcome.WRONG_SOLUTION: ("o", "wrong solution"),
    Outcome.LINEAR_SOLVER: ("+", "linear solver"),
    Outcome.NOT_FINITE: ("*", "not finite"),
}


def unique(rows: Sequence[Row], name: str) -> list[str]:
    """Values of a column, in the order in which they come."""
    return list(dict.fromkeys(row[name] for row in rows))


def chosen(rows: Sequence[Row], **values: str) -> list[Row]:
    """The rows with these values."""
    return [row for row in rows if all(row[name] == value for name, value in values.items())]


def converged(row: Row) -> bool:
    return row["outcome"] == Outcome.CONVERGED


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
    rows = equal_starts(rows)
    sentences = []
    for mu in unique(rows, "mu"):
        mine = chosen(rows, mu=mu)
        failed = [row for row in mine if not converged(row)]
        if not failed:
            most = max(int(row["iterations"]) for row in mine)
            sentences.append(f"{mu}: all {len(mine)} starts converge, in {most} iterations at most.")
            continue
        where = []
        for recipe in unique(rows, "recipe"):
            failing = [decade(row, "p0") for row in chosen(failed, recipe=recipe)]
            if failing:
                where.append(f"1e{max(failing)} with recipe {recipe}")
        creeping = sum(float(row["c2"] or "nan") < 1e-6 for row in failed)
        sentences.append(
            f"{mu}: {len(failed)} of {len(mine)} starts fail, the largest {' and '.join(where)}; {creeping} of them have come "
            f"to creep, with ||alpha d|| below 1e-6 and ||F|| not yet small."
        )
    return f"Starts p0 = r0. {' '.join(sentences)}"


def map_sentence(rows: Sequence[Row]) -> str:
    """How many starts of the grid converge by each rule, and how far apart p0 and r0 may be."""
    rows = grid_starts(rows)
    counts = ", ".join(f"{sum(map(converged, chosen(rows, mu=mu)))} by {mu}" for mu in unique(rows, "mu"))
    each = len(rows) // len(unique(rows, "mu"))
    farthest = max((apart(row) for row in rows if converged(row)), default=0)
    text = f"Numbers: iterations. Of {each} starts converge {counts}; none with p0 and r0 more than {farthest} decades apart."
    steady = unique([row for row in rows if row["mu"] != "mu1"], "mu")
    failing = [apart(row) for row in rows if row["mu"] in steady and not converged(row)]
    if failing and min(failing) > 0:
        text += f" By {' and '.join(steady)} all converge that are less than {min(failing)} decades apart."
    return text


def draw_lines(rows: Sequence[Row], path: Path, comm: MPI.Comm) -> None:
    """Iterations against p0 = r0. Collective."""
    save(lambda: lines(rows), path, comm)


def draw_maps(rows: Sequence[Row], path: Path, comm: MPI.Comm) -> None:
    """Iterations over p0 x r0. Collective."""
    save(lambda: maps(rows), path, comm)


def lines(rows: Sequence[Row]) -> Figure:
    """A column a scene, a row an inner solver, a line a rule; failures where their iterations ended."""
    sentence, rows = lines_sentence(rows), equal_starts(rows)
    scenes, recipes, rules = (unique(rows, name) for name in ("scene", "recipe", "mu"))
    figure = new_figure(1.3 + 1.9 * len(recipes), sentence)
    grid = figure.subplots(len(recipes), len(scenes), sharex=True, sharey=True, squeeze=False)
    for recipe, row_of_axes in zip(recipes, grid, strict=True):
        for scene, axes in zip(scenes, row_of_axes, strict=True):
            for number, mu in enumerate(rules):
                _rule(axes, chosen(rows, scene=scene, recipe=recipe, mu=mu), number)
            axes.set(xscale="log", ylim=(0, None))
            axes.grid(which="major", color="0.9", lw=0.6)
        row_of_axes[0].set_ylabel(f"recipe {recipe}\niterations")
    for scene, axes in zip(scenes, grid[0], strict=True):
        axes.set_title(scene, fontweight="bold")
    for axes in grid[-1]:
        axes.set_xlabel("p0 in MPa = r0")
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(
        handles + _failure_handles(rows), labels + _failure_labels(rows), loc="outside upper center", ncols=len(rules) + 2
    )
    return figure


def _rule(axes: Axes, rows: Sequence[Row], number: int) -> None:
    """A line through the starts that converge; later rules are thinner, so that rules which agree are all seen."""
    x = [float(row["p0"]) for row in rows]
    y = [float(row["iterations"]) if converged(row) else math.nan for row in rows]
    axes.plot(x, y, **look(number), lw=2.6 - 0.9 * number, ms=5.6 - 1.5 * number, label=rows[0]["mu"])
    for outcome, (mark, _) in FAILURES.items():
        failed = chosen(rows, outcome=outcome)
        ends = [float(row["iterations"]) for row in failed]
        axes.plot([float(row["p0"]) for row in failed], ends, color=look(number)["color"], marker=mark, ls="none", ms=5.5)


def _failure_labels(rows: Sequence[Row]) -> list[str]:
    return [label for outcome, (_, label) in FAILURES.items() if chosen(rows, outcome=outcome)]


def _failure_handles(rows: Sequence[Row]) -> list:
    from matplotlib.lines import Line2D

    marks = [mark for outcome, (mark, _) in FAILURES.items() if chosen(rows, outcome=outcome)]
    return [Line2D([], [], color="0.3", marker=mark, ls="none", ms=5.5) for mark in marks]


def maps(rows: Sequence[Row]) -> Figure:
    """A column a rule, a row a scene; a cell's colour and number are its iterations, a mark says how it failed."""
    sentence, rows = map_sentence(rows), grid_starts(rows)
    scenes, rules = unique(rows, "scene"), unique(rows, "mu")
    figure = new_figure(0.9 + 2.05 * len(scenes), sentence)
    grid = figure.subplots(len(scenes), len(rules), sharex=True, sharey=True, squeeze=False)
    for scene, row_of_axes in zip(scenes, grid, strict=True):
        for mu, axes in zip(rules, row_of_axes, strict=True):
            _map(axes, chosen(rows, scene=scene, mu=mu))
        row_of_axes[0].set_ylabel(f"{scene}\nr0")
    for mu, axes in zip(rules, grid[0], strict=True):
        axes.set_title(mu, fontweight="bold")
    for axes in grid[-1]:
        axes.set_xlabel("p0 in MPa")
    figure.legend(_failure_handles(rows), _failure_labels(rows), loc="outside upper right", ncols=len(FAILURES))
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
            axes.text(i, j, row["iterations"], ha="center", va="center", fontsize=6.0, color=colour)
        else:
            axes.plot(i, j, ls="none", marker=FAILURES[Outcome(row["outcome"])][0], ms=3.5, color="0.45")
    axes.imshow(cells, origin="lower", cmap="Blues", norm=LogNorm(15, 500), aspect="equal")
    axes.set_xticks(range(len(decades)), [f"$10^{{{k}}}$" if k % 4 == 1 else "" for k in decades])
    axes.set_yticks(range(len(decades)), [f"$10^{{{k}}}$" if k % 4 == 1 else "" for k in decades])
