"""Pictures of a Solution: lines in 1D, maps and a section in 2D. matplotlib is imported when one is drawn.

Figures are made without pyplot, so no window system is needed and no global state is touched.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError
from ..parallel import Array
from ..problems.solution import Solution
from .files import replacing
from .picture import Picture, collect, largest, scaled, title
from .units import prefix, quantity

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito's colours, told apart by all eyes; lines differ in their dashes too, for print.
BLUE, RED, GREY = "#0072B2", "#D55E00", "#555555"
MAPS = {"p": "viridis", "r": "cividis", "h": "Blues"}
NAMES = {"p": "pressure p", "r": "void fraction r", "h": "film h"}
STYLE: Any = {
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.spines.top": False,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "hatch.linewidth": 0.5,
    "svg.hashsalt": "lcp_lube",  # the same solution gives the same file
}


def plot(solution: Solution, path: str | Path) -> None:
    """Draw p, r and h (or whatever fields the problem has) to a .png, .pdf or .svg. Collective; rank 0 draws.

    1D: pressure and void fraction, the cavity shaded and its fronts marked, the exact solution where one is known, and the
    film with its liquid part. 2D: maps of p, r and h with the cavity's outline, and a section through the largest pressure.

    Raises
    ------
    InputError : matplotlib is missing, or the file cannot be written; then nothing is left behind.
    """
    try:
        import matplotlib as mpl
    except ImportError:
        raise InputError(f"--plot {path}: pictures need matplotlib: pip install lcp-lube[plot]") from None
    picture = collect(solution)
    with replacing(Path(path), solution.problem.grid.comm) as temporary:
        if picture is not None:
            with mpl.rc_context(STYLE):
                date = {".pdf": "CreationDate", ".svg": "Date"}.get(Path(path).suffix.lower())
                draw(picture).savefig(temporary, dpi=160, metadata={date: None} if date else None)


def draw(picture: Picture) -> Figure:
    """The figure that suits the problem."""
    if picture.y.size == 0:
        figure = _film_line(picture) if picture.sign.size else _lines(picture)
    else:
        figure = _film_maps(picture) if picture.sign.size else _maps(picture)
    converged = picture.solution.converged
    figure.suptitle(title(picture), fontsize=10, x=0.01, ha="left", color="black" if converged else RED)
    return figure


def new_figure(width: float, height: float) -> Figure:
    """An empty figure, sizes in inches."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def _film_line(picture: Picture) -> Figure:
    figure = new_figure(7.2, 5.2)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[2.6, 1.0])
    handles = section(upper, lower, picture)
    above = 1.1 if picture.quantities.get("rupture") is not None else 0.98  # over the fronts' names
    upper.legend(handles=handles, ncols=4, loc="lower right", bbox_to_anchor=(1.0, above))
    return figure


def _film_maps(picture: Picture) -> Figure:
    """Maps of p, r and h with the cavity's outline above a section through the largest pressure."""
    figure = new_figure(9.6, 6.9)
    grid = figure.add_gridspec(3, 3, height_ratios=[2.45, 1.6, 0.85])
    row = int(np.argmax(picture.fields["p"][0])) // picture.x.size
    for k, name in enumerate(("p", "r", "h")):
        axes = figure.add_subplot(grid[0, k])
        scale = colour_map(figure, axes, picture, name)
        axes.axhline(scale * picture.y[row], color="black", alpha=0.4, lw=1.4)
        axes.axhline(scale * picture.y[row], color="white", lw=0.9, ls=(0, (6, 4)))
        if name != "h":
            _outline(axes, picture, scale, hatch="white" if name == "p" else "black")
    upper = figure.add_subplot(grid[1, :])
    lower = figure.add_subplot(grid[2, :], sharex=upper)
    upper.tick_params(labelbottom=False)
    handles = section(upper, lower, picture, row)
    upper.legend(handles=handles, ncols=3, loc="lower right", bbox_to_anchor=(1.0, 0.98))
    upper.set_title(f"section at y = {quantity(picture.y[row], picture.length_unit)} (dashed in the maps)", loc="left")
    return figure


def section(upper: Axes, lower: Axes, picture: Picture, row: int | None = None) -> list[Any]:
    """p and r along a line in the upper axes, the film and its liquid part (1 - r) h in the lower ones.

    Parameters
    ----------
    picture : of a lubrication problem.
    row : which row of a 2D picture; the boundary values of p and h at both ends of the line are added.

    Returns
    -------
    What a legend should show.
    """
    problem: Any = picture.solution.problem
    p, r, h, sign = (a if row is None else a[row] for a in (*(picture.fields[name][0] for name in "prh"), picture.sign))
    start, L = problem.grid.origin[0], problem.grid.lengths[0]
    ends = np.array([start, start + L])
    at_ends = problem.film(ends, np.zeros(2) if row is None else np.full(2, picture.y[row]))
    r = np.concatenate([[0.0], r, r[-1:]])
    p = np.insert(p, [0, p.size], np.array(problem.p_sides[:2]) + problem.p_c)
    to_p = prefix(largest(p), "Pa")[0]
    p, label_p = scaled(p, "Pa")
    h, label_h = scaled(np.insert(h, [0, h.size], at_ends), "m")
    x, label_x = scaled(np.insert(picture.x, [0, picture.x.size], ends), "m")
    scale = prefix(largest(ends), "m")[0]

    known = ("rupture", "reformation") if row is None else ()  # in 2D they are those of the middle line
    fronts = {name: picture.quantities[name] for name in known if picture.quantities.get(name) is not None}
    spans = [upper.axvspan(scale * a, scale * b, color="0.90", lw=0) for a, b in _cavities(picture.x, sign, ends, fronts)]
    for name, place in fronts.items():
        upper.axvline(scale * place, color=GREY, lw=0.8, ls=(0, (1, 2)))
        text = f"{name}\n{quantity(place, 'm')}"
        upper.text(scale * place, 1.01, text, transform=upper.get_xaxis_transform(), ha="center", va="bottom", fontsize=8)

    right = upper.twinx()
    handles = upper.plot(x, p, color=BLUE, lw=2.0, label=NAMES["p"])
    handles += right.plot(x, r, color=RED, lw=1.8, ls="-.", label=NAMES["r"])
    if (exact := picture.exact) is not None:
        fine = np.linspace(ends[0], ends[1], 1201)
        handles += upper.plot(scale * fine, to_p * (exact.p(fine) + problem.p_c), "k--", lw=0.8, label="exact")
        right.plot(scale * fine, exact.r(fine), "k--", lw=0.8)
    upper.set(ylim=(min(0.0, 1.05 * np.nanmin(p)), 1.08 * (largest(p) or 1.0)), xlim=(x[0], x[-1]))
    right.set_ylim(0.0, 1.08 * max(largest(r), 1e-3))
    upper.set_ylabel(NAMES["p"] + label_p, color=BLUE)
    right.set_ylabel(NAMES["r"], color=RED)
    for span in spans[:1]:
        span.set_label("cavity")

    lower.fill_between(x, 0.0, (1.0 - r) * h, color=BLUE, alpha=0.35, lw=0)
    lower.fill_between(x, h, 1.25 * h.max(), facecolor="0.75", edgecolor="0.45", hatch="////", lw=0)
    lower.plot(x, h, color="black", lw=1.4)
    lower.spines["bottom"].set_linewidth(2.0)
    lower.annotate("", (0.11, 0.14), (0.02, 0.14), xycoords="axes fraction", arrowprops={"arrowstyle": "->"})
    lower.text(0.12, 0.14, "U      liquid (1 - r) h", transform=lower.transAxes, va="center")
    lower.set(ylim=(0.0, 1.25 * h.max()), ylabel=NAMES["h"] + label_h, xlabel="x" + label_x)
    return [*handles, *spans[:1]]


def _cavities(x: Array, sign: Array, ends: Array, fronts: dict[str, float]) -> list[tuple[float, float]]:
    """Where the cavities of a line begin and end, in m: half-way between points, or at the front that is known there."""
    edges = np.concatenate([ends[:1], (x[1:] + x[:-1]) / 2, ends[1:]])
    change = np.diff(np.concatenate([[0], (sign < 0).astype(int), [0]]))
    first, last = edges[change > 0], edges[change < 0]
    for name, these in (("rupture", first), ("reformation", last)):
        if name in fronts and these.size:
            these[np.argmin(np.abs(these - fronts[name]))] = fronts[name]
    return list(zip(first, last, strict=True))


def colour_map(figure: Figure, axes: Axes, picture: Picture, name: str) -> float:
    """A map of one field with its colour bar; returns the factor from metres to the axes' unit."""
    values, unit = picture.fields[name]
    values, label = scaled(values, unit)
    lengths, origin = picture.solution.problem.grid.lengths, picture.solution.problem.grid.origin
    scale, length_unit = prefix(max(lengths), picture.length_unit)
    dx, dy = (a[1] - a[0] if a.size > 1 else 2 * a[0] for a in (picture.x, picture.y))
    edges = (picture.x[0] - dx / 2, picture.x[-1] + dx / 2, picture.y[0] - dy / 2, picture.y[-1] + dy / 2)
    image = axes.imshow(
        values,
        extent=tuple(scale * edge for edge in edges),
        origin="lower",
        cmap=MAPS.get(name, "viridis"),
        interpolation="nearest",
        aspect="equal" if 0.4 < lengths[0] / lengths[1] < 2.5 else "auto",
    )
    figure.colorbar(image, ax=axes, location="top", pad=0.02, aspect=30, label=NAMES.get(name, name) + label)
    in_unit = f" ({length_unit})" if length_unit else ""
    ranges = ((scale * start, scale * (start + length)) for start, length in zip(origin, lengths, strict=True))
    axes.set(xlabel="x" + in_unit, ylabel="y" + in_unit, **dict(zip(("xlim", "ylim"), ranges, strict=True)))
    axes.spines[:].set_visible(True)
    return scale


def _outline(axes: Axes, picture: Picture, scale: float, hatch: str) -> None:
    """The cavity's edge as a white line and its inside hatched."""
    sign = picture.sign
    if min(sign.shape) < 2 or not sign.min() < 0 < sign.max():
        return
    x, y = scale * picture.x, scale * picture.y
    from matplotlib import rc_context

    with rc_context({"hatch.color": hatch}):
        axes.contourf(x, y, sign, levels=[sign.min() - 1.0, 0.0], colors="none", hatches=[".."])
    axes.contour(x, y, sign, levels=[0.0], colors="white", linewidths=1.2)


def _lines(picture: Picture) -> Figure:
    """Any fields in 1D, one above the other."""
    figure = new_figure(7.2, 1.2 + 1.9 * len(picture.fields))
    panels = figure.subplots(len(picture.fields), 1, sharex=True, squeeze=False)[:, 0]
    x, label_x = scaled(picture.x, picture.length_unit)
    for axes, (name, (values, unit)) in zip(panels, picture.fields.items(), strict=True):
        values, label = scaled(values, unit)
        axes.plot(x, values, color=BLUE, lw=1.8)
        axes.set_ylabel(NAMES.get(name, name) + label)
    panels[-1].set_xlabel("x" + label_x)
    return figure


def _maps(picture: Picture) -> Figure:
    """Any fields in 2D, side by side."""
    figure = new_figure(4.6 * len(picture.fields), 4.8)
    for axes, name in zip(figure.subplots(1, len(picture.fields), squeeze=False)[0], picture.fields, strict=True):
        colour_map(figure, axes, picture, name)
    return figure
