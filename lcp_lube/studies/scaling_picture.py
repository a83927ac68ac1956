"""The picture of the scaling chart, from the rows of its csv alone."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from mpi4py import MPI

from ..base.resumable import Row
from .drawing import look, new_figure, save

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def draw(rows: Sequence[Row], path: Path, comm: MPI.Comm) -> None:
    """Seconds a point by grid, and Krylov iterations a Newton step by ranks. Collective.

    Raises
    ------
    InputError : the file cannot be written.
    """
    good = [row for row in rows if row["outcome"] == "converged"]

    def build() -> Figure:
        cores = os.cpu_count() or 1
        figure = new_figure(
            3.0,
            "Nested active set on the cavity system, BiCGStab with BoomerAMG, medians. Left: a whole solve's seconds, up to "
            f"the {cores} ranks that have a core of their own. Right: Krylov iterations a Newton step on the finest grid, "
            "also on ranks that share cores.",
        )
        left, right = figure.subplots(1, 2)
        _seconds(left, [row for row in good if int(row["ranks"]) <= cores])
        _counts(right, good)
        return figure

    save(build, path, comm)


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
