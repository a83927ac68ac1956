"""Pictures of a Solution: lines in 1D, maps and a section in 2D. matplotlib is imported when one is drawn.

Figures are made without pyplot, so no window system is needed and no global state is touched.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError
from ..parallel import Array
from ..problems.quantities import cavity_sign
from ..problems.solution import Solution
from .files import coordinates, gather, replacing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_POINTS = {1: 4000, 2: 500}  # a direction; larger fields are thinned before rank 0 gathers them
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


@dataclass
class Picture:
    """What rank 0 draws: fields in SI as (ny, nx) arrays or (nx,) if y is empty, thinned if large.

    sign is positive in the full film and negative in the cavity (`quantities.cavity_sign`); empty for problems without one.
    """

    solution: Solution
    x: Array
    y: Array
    fields: dict[str, tuple[Array, str]]
    sign: Array
    quantities: dict[str, Any] = field(default_factory=dict)

    @property
    def length_unit(self) -> str:
        """Metres, unless the problem is dimensionless."""
        return "m" if any(unit for _, unit in self.fields.values()) else ""


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


def collect(solution: Solution) -> Picture | None:
    """What there is to draw, on rank 0; None elsewhere. Collective."""
    problem: Any = solution.problem
    grid = problem.grid
    nx, ny = (math.ceil(n / MOST_POINTS[grid.dim]) for n in (*grid.shape, 1)[:2])
    stride = (nx, ny)
    fields = {name: (gather(grid, values, stride), unit) for name, (values, unit) in problem.physical(solution.fields).items()}
    sign, quantities = np.empty(0), problem.quantities(solution.fields)
    if problem.kind == "lubrication":
        sign = gather(grid, cavity_sign(problem, solution.p, solution.r), stride)
    if grid.comm.rank > 0:
        return None
    x, *y = coordinates(grid, stride)
    return Picture(solution, x, y[0] if y else np.empty(0), fields, sign, quantities)


def draw(picture: Picture) -> Figure:
    """The figure that suits the problem."""
    if picture.y.size == 0:
        figure = _film_line(picture) if picture.sign.size else _lines(picture)
    else:
        figure = _film_maps(picture) if picture.sign.size else _maps(picture)
    converged = picture.solution.converged
    figure.suptitle(title(picture), fontsize=10, x=0.01, ha="left", color="black" if converged else RED)
    return figure


def title(picture: Picture) -> str:
    """Scene, grid and the figures that an engineer asks for; a run that failed says so."""
    solution, values = picture.solution, picture.quantities
    shape = " x ".join(map(str, solution.problem.grid.shape))
    parts = [f"{solution.settings.get('scene', '')} ({shape} points)"]
    if not solution.converged:
        return f"{parts[0]}: NOT a solution, {solution.outcome.sentence}"
    if values.get("p_max") is not None:
        parts.append(f"$p_{{max}}$ {_quantity(values['p_max'], 'Pa')}")
    if values.get("load") is not None:
        parts.append(f"load {_quantity(values['load'], 'N/m' if picture.y.size == 0 else 'N')}")
    if values.get("cavitated_fraction") is not None:
        parts.append(f"{100 * values['cavitated_fraction']:.1f} % cavitated{' (dotted)' * (picture.y.size > 0)}")
    return ",  ".join(parts)


def prefix(largest: float, unit: str) -> tuple[float, str]:
    """(factor, unit): what takes SI values up to `largest` to numbers from 1 to 1000, and their unit."""
    if not unit or not 0 < largest < math.inf:
        return 1.0, unit
    power = min(max(3 * math.floor(math.log10(largest) / 3 + 1e-12), -9), 9)
    return 10.0**-power, {-9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}[power] + unit


def _quantity(value: float, unit: str) -> str:
    factor, unit = prefix(abs(value), unit)
    return f"{value * factor:.4g} {unit}"


def _scaled(values: Array, unit: str) -> tuple[Array, str]:
    """Values in a unit that suits them, and ' (unit)' for a label."""
    factor, unit = prefix(_largest(values), unit)
    return values * factor, f" ({unit})" if unit else ""


def _largest(values: Array) -> float:
    """Largest magnitude among the finite values (a run that overflowed is drawn too); 0 where there is none."""
    return float(np.max(np.abs(values[np.isfinite(values)]), initial=0.0))


def _new_figure(width: float, height: float) -> Figure:
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def _film_line(picture: Picture) -> Figure:
    figure = _new_figure(7.2, 5.2)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[2.6, 1.0])
    section(upper, lower, picture)
    return figure


def _film_maps(picture: Picture) -> Figure:
    """Maps of p, r and h with the cavity's outline above a section through the largest pressure."""
    figure = _new_figure(9.6, 6.9)
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
    section(upper, lower, picture, row)
    upper.set_title(f"section at y = {_quantity(picture.y[row], picture.length_unit)} (dashed in the maps)", loc="left")
    return figure


def section(upper: Axes, lower: Axes, picture: Picture, row: int | None = None) -> None:
    """p and r along a line in the upper axes, the film and its liquid part (1 - r) h in the lower ones.

    Parameters
    ----------
    picture : of a lubrication problem.
    row : which row of a 2D picture; the boundary values of p and h at both ends of the line are added.
    """
    problem: Any = picture.solution.problem
    p, r, h, sign = (a if row is None else a[row] for a in (*(picture.fields[name][0] for name in "prh"), picture.sign))
    start, L = problem.grid.origin[0], problem.grid.lengths[0]
    ends = np.array([start, start + L])
    at_ends = problem.film(ends, np.zeros(2) if row is None else np.full(2, picture.y[row]))
    r = np.concatenate([[0.0], r, r[-1:]])
    p = np.insert(p, [0, p.size], np.array(problem.p_sides[:2]) + problem.p_c)
    to_p = prefix(_largest(p), "Pa")[0]
    p, label_p = _scaled(p, "Pa")
    h, label_h = _scaled(np.insert(h, [0, h.size], at_ends), "m")
    x, label_x = _scaled(np.insert(picture.x, [0, picture.x.size], ends), "m")
    scale = prefix(_largest(ends), "m")[0]

    fronts = {name: picture.quantities[name] for name in ("rupture", "reformation") if picture.quantities.get(name) is not None}
    spans = [upper.axvspan(scale * a, scale * b, color="0.90", lw=0) for a, b in _cavities(picture.x, sign, ends, fronts)]
    for name, place in fronts.items():
        upper.axvline(scale * place, color=GREY, lw=0.8, ls=(0, (1, 2)))
        text = f"{name}\n{_quantity(place, 'm')}"
        upper.text(scale * place, 1.01, text, transform=upper.get_xaxis_transform(), ha="center", va="bottom", fontsize=8)

    right = upper.twinx()
    handles = upper.plot(x, p, color=BLUE, lw=2.0, label=NAMES["p"])
    handles += right.plot(x, r, color=RED, lw=1.8, ls="-.", label=NAMES["r"])
    exact = problem.exact() if row is None and problem.exact is not None else None
    if exact is not None:
        fine = np.linspace(ends[0], ends[1], 1201)
        handles += upper.plot(scale * fine, to_p * (exact.p(fine) + problem.p_c), "k--", lw=0.8, label="exact")
        right.plot(scale * fine, exact.r(fine), "k--", lw=0.8)
    upper.set(ylim=(min(0.0, 1.05 * np.nanmin(p)), 1.08 * (_largest(p) or 1.0)), xlim=(x[0], x[-1]))
    right.set_ylim(0.0, 1.08 * max(_largest(r), 1e-3))
    upper.set_ylabel(NAMES["p"] + label_p, color=BLUE)
    right.set_ylabel(NAMES["r"], color=RED)
    for span in spans[:1]:
        span.set_label("cavity")
    above = (1.0, 1.1 if fronts else 0.98)  # over the fronts' names
    upper.legend(handles=[*handles, *spans[:1]], ncols=4, loc="lower right", bbox_to_anchor=above)

    lower.fill_between(x, 0.0, (1.0 - r) * h, color=BLUE, alpha=0.35, lw=0)
    lower.fill_between(x, h, 1.25 * h.max(), facecolor="0.75", edgecolor="0.45", hatch="////", lw=0)
    lower.plot(x, h, color="black", lw=1.4)
    lower.spines["bottom"].set_linewidth(2.0)
    lower.annotate("", (0.11, 0.14), (0.02, 0.14), xycoords="axes fraction", arrowprops={"arrowstyle": "->"})
    lower.text(0.12, 0.14, "U      liquid (1 - r) h", transform=lower.transAxes, va="center")
    lower.set(ylim=(0.0, 1.25 * h.max()), ylabel=NAMES["h"] + label_h, xlabel="x" + label_x)


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
    values, label = _scaled(values, unit)
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
    figure = _new_figure(7.2, 1.2 + 1.9 * len(picture.fields))
    panels = figure.subplots(len(picture.fields), 1, sharex=True, squeeze=False)[:, 0]
    x, label_x = _scaled(picture.x, picture.length_unit)
    for axes, (name, (values, unit)) in zip(panels, picture.fields.items(), strict=True):
        values, label = _scaled(values, unit)
        axes.plot(x, values, color=BLUE, lw=1.8)
        axes.set_ylabel(NAMES.get(name, name) + label)
    panels[-1].set_xlabel("x" + label_x)
    return figure


def _maps(picture: Picture) -> Figure:
    """Any fields in 2D, side by side."""
    figure = _new_figure(4.6 * len(picture.fields), 4.8)
    for axes, name in zip(figure.subplots(1, len(picture.fields), squeeze=False)[0], picture.fields, strict=True):
        colour_map(figure, axes, picture, name)
    return figure
