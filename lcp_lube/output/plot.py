"""Pictures of a Solution: lines in 1D, maps and a section in 2D, a journal in its bush."""

from pathlib import Path
from typing import Any

import numpy as np

from ..problems.solution import Solution
from .files import check_target
from .journal import journal
from .maps import FLAT, height, outline, panels, shape
from .panels import section
from .picture import Picture, collect, title
from .style import BLUE, NAMES, RED, Axes, Figure, new_figure, save_figure
from .units import prefix, with_unit

WIDE = 9.6  # inches: pictures with several maps


def plot(solution: Solution, path: str | Path) -> None:
    """Draw p, r and h (or whatever fields the problem has) to a .png, .pdf or .svg. Collective; rank 0 draws.

    1D: pressure and void fraction, the cavity shaded and its fronts marked, the exact solution where one is known, and the
    film with its liquid part. 2D: maps of p, r and h with the cavity's outline, and a section. Of journals a cross-section too.

    Raises
    ------
    InputError : another extension, matplotlib is missing, or the file cannot be written; then nothing is left behind.
    """
    check_target(path, plot=True, comm=solution.problem.grid.comm)
    picture = collect(solution)
    save_figure(lambda: draw(picture), path, solution.problem.grid.comm, few_colours=True)  # type: ignore[arg-type]


def draw(picture: Picture) -> Figure:
    """The figure that suits the problem."""
    if picture.y.size == 0:
        figure = _film_line(picture) if picture.sign.size else _lines(picture)
    else:
        figure = _film_maps(picture) if picture.sign.size else _maps(picture)
    converged = picture.solution.converged
    figure.suptitle(title(picture), fontsize=10, x=0.01, ha="left", color="black" if converged else RED)
    return figure


def _film_line(picture: Picture) -> Figure:
    figure = new_figure(10.4 if picture.is_journal else 7.2, 5.2)
    upper, lower, side = _section_axes(figure, picture)
    handles = section(upper, lower, picture)
    above = 1.1 if picture.fronts else 0.98  # over the fronts' names
    upper.legend(handles=handles, ncols=4, loc="lower right", bbox_to_anchor=(1.0, above))
    if side is not None:
        journal(side, picture)
    return figure


def _film_maps(picture: Picture) -> Figure:
    """Maps of p, r and h with the cavity's outline above a section: on the middle line, or where the pressure is larger."""
    maps = height(picture, 3, WIDE)
    figure = new_figure(WIDE, maps + 3.55)
    halves: Any = figure.subfigures(2, 1, height_ratios=[maps, 3.55])
    above, below = halves
    p = picture.fields["p"][0]
    row = int(np.argmax(p)) // picture.x.size
    if p[picture.middle].max() > 0.999 * p[row].max():
        row = picture.middle
    for name, axes in panels(above, picture, ("p", "r", "h")).items():
        axes.axhline(picture.across[0] * picture.y[row], color="black", alpha=0.4, lw=1.4)
        axes.axhline(picture.across[0] * picture.y[row], color="white", lw=0.9, ls=(0, (6, 4)))
        if name != "h":
            outline(axes, picture, hatch="white" if name == "p" else "black")
    upper, lower, side = _section_axes(below, picture)
    handles = section(upper, lower, picture, row, named=False)
    fronts = [f"{name} {picture.place(at)}" for name, at in picture.fronts.items()] if row == picture.middle else []
    there = ", ".join([f"section at y = {with_unit(picture.y[row], picture.length_unit)} (dashed)", *fronts])
    upper.set_title(there, loc="left", pad=22)
    upper.legend(handles=handles, ncols=3, loc="lower left", bbox_to_anchor=(-0.01, 0.97))
    if side is not None:
        journal(side, picture, row)
    return figure


def _section_axes(figure: Any, picture: Picture) -> tuple[Axes, Axes, Axes | None]:
    """Upper and lower axes of a section, and those beside them for a journal's cross-section."""
    columns = 1 + picture.is_journal
    grid = figure.add_gridspec(2, columns, height_ratios=[2.2, 1.0], width_ratios=[1.6, 1.0][:columns])
    upper = figure.add_subplot(grid[0, 0])
    lower = figure.add_subplot(grid[1, 0], sharex=upper)
    upper.tick_params(labelbottom=False)
    return upper, lower, figure.add_subplot(grid[:, 1]) if picture.is_journal else None


def _lines(picture: Picture) -> Figure:
    """Any fields in 1D, one above the other."""
    figure = new_figure(7.2, 1.2 + 1.9 * len(picture.fields))
    panels = figure.subplots(len(picture.fields), 1, sharex=True, squeeze=False)[:, 0]
    scale, label_x = picture.along
    for axes, (name, (values, unit)) in zip(panels, picture.fields.items(), strict=True):
        low, high = picture.limits(name)
        factor, unit = prefix(max(abs(low), abs(high)), unit)
        axes.plot(scale * picture.x, factor * values, color=BLUE, lw=1.8)
        margin = 0.05 * (high - low)
        label = NAMES.get(name, name) + (f" ({unit})" if unit else "")
        axes.set(ylabel=label, ylim=(factor * (low - margin), factor * (high + margin)))
    panels[-1].set_xlabel(label_x)
    return figure


def _maps(picture: Picture) -> Figure:
    """Any fields in 2D, side by side."""
    count = len(picture.fields)
    width = WIDE if shape(picture) < FLAT else 4.6 * count
    figure = new_figure(width, 0.3 + height(picture, count, width))
    panels(figure, picture, [*picture.fields])
    return figure
