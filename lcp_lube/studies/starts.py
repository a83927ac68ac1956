"""Stability of DIN against its starting vector: p0, r0 from 1e-15 to 1e3 by each rule for mu (the paper's table 5 as a map)."""

import math
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from ..base.progress import Line
from ..base.resumable import Row
from ..output.console import say
from ..output.style import Axes, Figure
from ..scenes.scene import load_scene
from .drawing import look, new_figure, save
from .experiment import open_store, run
from .log import write_log
from .map_picture import FAILURES, Axis, Panels, chosen, converged, groups, legend, picture, unique

SCENES = ("problem1", "problem2", "problem3")
DECADES = range(-15, 4)  # p0 = r0 = 10^k; p0 in the problem's unit, MPa
GRID = range(-15, 4, 2)  # p0 x r0
N = 100  # the table's grid
LAPACK, SPARSE = "lu", "superlu"  # pivoting by rows in dense LU, which the table's rows were run with, and in SuperLU

# Rules for mu with the paper's step-length conditions; and the default one without centrality.
RULES = (("mu1", "FCB"), ("mu2", "FCB"), ("adaptive", "FCB"), ("mu2", "FB"))

KEY = ("scene", "n", "recipe", "mu", "conditions", "p0", "r0", "ranks")


def starts(quick: bool) -> Iterator[dict[str, Any]]:
    """Key columns of all runs: equal starts by both solvers, then the grid by LAPACK; quick: four by four on one scene."""
    scenes, decades, grid, n = (SCENES[:1], range(-15, 4, 6), range(-15, 4, 6), 20) if quick else (SCENES, DECADES, GRID, N)
    pairs = {
        LAPACK: [(k, k) for k in decades] + [(k, l) for k in grid for l in grid if k != l],
        SPARSE: [(k, k) for k in decades],
    }
    for scene in scenes:
        for recipe, exponents in pairs.items():
            for mu, conditions in RULES:
                fixed = {"scene": scene, "n": n, "recipe": recipe, "mu": mu, "conditions": conditions}
                yield from ({**fixed, "p0": f"1e{k}", "r0": f"1e{l}"} for k, l in exponents)


def chart(quick: bool, results: Path) -> int:
    """Make the runs that are not in starts.csv (starts_quick.csv) yet, then draw both pictures. Collective."""
    stem = "starts" + "_quick" * quick
    store = open_store(results / f"{stem}.csv", KEY, ())
    keys = [{**start, "ranks": store.comm.size} for start in starts(quick)]
    with Line() as line:
        runs = line.over(keys, lambda _: "starts, run", lambda key: store.find(**key) is not None)
        rows = with_rules([store.row(key, partial(_run, key)) for key in runs])
    say(f"{lines_sentence(rows)}\n{map_sentence(rows)}")
    pictures = [results / f"{stem}_{kind}.png" for kind in ("lines", "map")]
    if not quick:
        write_log(results, "stability: starts", rows, f"{lines_sentence(rows)} {map_sentence(rows)}", pictures)
    save(lambda: lines(rows), pictures[0], store.comm)
    x, y = Axis("p0", "p0 in MPa"), Axis("r0", "r0")  # iterations over both: a column a scene, a row a rule
    figure = partial(picture, grid_starts(rows), Panels("scene", "rule"), x, y, map_sentence(rows))
    save(figure, pictures[1], store.comm)
    say(f"{', '.join(map(str, pictures))}: {len(rows)} runs, {store.said}")
    return 0


def _run(start: dict[str, Any]) -> dict[str, Any]:
    """A run from one start. Collective."""
    options = {name: start[name] for name in ("mu", "conditions")} | {name: float(start[name]) for name in ("p0", "r0")}
    scene = load_scene(start["scene"], {"n": start["n"]})
    values = run(scene, method="din", system="full", recipe=start["recipe"], options=options)
    if not converged(values):
        say(f"{start['scene']} {start['recipe']} {rule(start)} p0 {start['p0']} r0 {start['r0']}: {values['message']}")
    return values


def rule(row: Row) -> str:
    """Name of the rule that a run follows: that for mu, and the conditions on the step where they are not the paper's."""
    return row["mu"] if row["conditions"] == "FCB" else f"{row['mu']}, {row['conditions']}"


def with_rules(rows: Sequence[Row]) -> list[Row]:
    """The rows with a column `rule`."""
    return [{**row, "rule": rule(row)} for row in rows]


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
    for (name,), mine in groups(equal_starts(rows), ("rule",)).items():
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
    for (name,), mine in groups(grid_starts(rows), ("rule",)).items():
        failing = min((apart(row) for row in mine if not converged(row)), default=None)
        farthest = max((apart(row) for row in mine if converged(row)), default=None)
        said = f"{name}: {sum(map(converged, mine))} of {len(mine)} converge"
        if failing:
            said += f", all those less than {failing} decades apart"
        if failing is not None and farthest is not None:
            said += f", none more than {farthest} decades apart"
        parts.append(said)
    return f"Numbers: iterations. Starts p0, r0 by {'; by '.join(parts)}."


def lines(rows: Sequence[Row]) -> Figure:
    """A column a scene, a row an inner solver, a line a rule; failures where their iterations ended."""
    sentence, rows = lines_sentence(rows), equal_starts(rows)
    scenes, recipes = unique(rows, "scene"), unique(rows, "recipe")
    figure = new_figure(1.3 + 1.9 * len(recipes), sentence)
    grid = figure.subplots(len(recipes), len(scenes), sharex=True, sharey=True, squeeze=False)
    for recipe, row_of_axes in zip(recipes, grid, strict=True):
        for scene, axes in zip(scenes, row_of_axes, strict=True):
            for number, ((name,), mine) in enumerate(groups(chosen(rows, scene=scene, recipe=recipe), ("rule",)).items()):
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
    for outcome, (mark, *_) in FAILURES.items():
        failed = chosen(rows, outcome=outcome)
        x, y = [float(row["p0"]) for row in failed], [float(row["iterations"]) for row in failed]
        axes.plot(x, y, color=look(number)["color"], marker=mark, mfc="none", ls="none", ms=6.5 - number)
