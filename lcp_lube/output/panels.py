"""Panels of a picture: p, r and the film along a line, maps with the cavity's outline."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.parallel import Array
from ..problems.film.quantities import open_pressures
from .picture import Picture, largest, scaled
from .style import BLUE, CAVITY, GREY, LIQUID, MAPS, NAMES, RED, WALL
from .units import prefix

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

FINE = 1201  # points of a line that is drawn from a formula
ANGLES = range(0, 361, 60)
MOST_SQUARE = 2.5  # longer rectangles fill their map instead of keeping their shape


def section(upper: Axes, lower: Axes, picture: Picture, row: int | None = None, named: bool = True) -> list[Any]:
    """p and r along a line in the upper axes, the film and the liquid in it in the lower ones.

    r is drawn at the faces, where the scheme knows how much liquid passes: at the points it would come half a cell late.

    Parameters
    ----------
    picture : of a lubrication problem.
    row : which row of a 2D picture; boundary values of p are added at open ends of the line.
    named : name the fronts above the upper axes.

    Returns
    -------
    What a legend should show.
    """
    problem: Any = picture.solution.problem
    scale, label_x = picture.along
    ends = problem.grid.origin[0] + np.array([0.0, problem.grid.lengths[0]])
    sign = picture.sign if row is None else picture.sign[row]
    x, p = pressure_line(picture, row)
    to_p = prefix(largest(p), "Pa")[0]
    p, label_p = scaled(p, "Pa")
    x_r, r, liquid = liquid_line(picture, row)
    fine = np.linspace(ends[0], ends[1], FINE)
    h = film_line(picture, row, fine)
    to_h, unit_h = prefix(largest(h), "m")

    known = picture.fronts if row is None or row == picture.middle else {}
    spans = [upper.axvspan(scale * a, scale * b, color=CAVITY, lw=0) for a, b in cavities(picture.x, sign, ends, known)]
    for name, place in known.items():
        upper.axvline(scale * place, color=GREY, lw=0.8, ls=(0, (1, 2)))
        if named:
            text = f"{name}\n{picture.place(place)}"
            upper.text(scale * place, 1.01, text, transform=upper.get_xaxis_transform(), ha="center", va="bottom", fontsize=8)

    right = upper.twinx()
    handles = upper.plot(scale * x, p, color=BLUE, lw=2.0, label=NAMES["p"])
    handles += right.plot(scale * x_r, r, color=RED, lw=1.8, ls="-.", label=NAMES["r"])
    if (exact := picture.exact) is not None:
        handles += upper.plot(scale * fine, to_p * (exact.p(fine) + problem.p_c), "k--", lw=0.8, label="exact")
        right.plot(scale * fine, exact.r(fine), "k--", lw=0.8)
    upper.set(ylim=(min(0.0, 1.05 * np.nanmin(p)), 1.08 * (largest(p) or 1.0)), xlim=scale * ends)
    right.set_ylim(0.0, 1.08 * max(largest(r), 1e-3))
    upper.set_ylabel(NAMES["p"] + label_p, color=BLUE)
    right.set_ylabel(NAMES["r"], color=RED)
    for span in spans[:1]:
        span.set_label("cavity")

    top = 1.25 * to_h * h.max()
    lower.fill_between(scale * x_r, 0.0, to_h * liquid, color=LIQUID, lw=0)
    lower.fill_between(scale * fine, to_h * h, top, facecolor=WALL, edgecolor="0.45", hatch="////", lw=0)
    lower.plot(scale * fine, to_h * h, color="black", lw=1.4)
    lower.spines["bottom"].set_linewidth(2.0)
    lower.annotate("", (0.11, 0.14), (0.02, 0.14), xycoords="axes fraction", arrowprops={"arrowstyle": "->"})
    lower.text(0.12, 0.14, "U      liquid (1 - r) h", transform=lower.transAxes, va="center")
    if picture.is_journal:
        lower.set_xticks(ANGLES)
    lower.set(ylim=(0.0, top), ylabel=f"{NAMES['h']} ({unit_h})", xlabel=label_x)
    return [*handles, *spans[:1]]


def film_line(picture: Picture, row: int | None, x: Array) -> Array:
    """The film in metres at x along a row."""
    problem: Any = picture.solution.problem
    return np.asarray(problem.film(x, np.full_like(x, 0.0 if row is None else picture.y[row])))


def pressure_line(picture: Picture, row: int | None) -> tuple[Array, Array]:
    """x (m) and absolute pressure (Pa) along a row, from end to end."""
    problem: Any = picture.solution.problem
    p = picture.fields["p"][0] if row is None else picture.fields["p"][0][row]
    start, L = problem.grid.origin[0], problem.grid.lengths[0]
    around = 0.5 * (p[0] + p[-1])
    beside = (around, around) if problem.grid.periodic[0] else (p[0], p[-1])
    sides = open_pressures(problem)[:2]
    first, last = (near if side is None else side + problem.p_c for side, near in zip(sides, beside, strict=True))
    return np.concatenate([[start], picture.x, [start + L]]), np.concatenate([[first], p, [last]])


def liquid_line(picture: Picture, row: int | None) -> tuple[Array, Array, Array]:
    """x (m), void fraction and thickness of the liquid (m) along a row, from end to end."""
    problem: Any = picture.solution.problem
    start, L = problem.grid.origin[0], problem.grid.lengths[0]
    kinds = problem.grid.ends[0]
    x = picture.x + picture.ahead
    liquid = picture.liquid if row is None else picture.liquid[row]
    r = 1.0 - liquid / film_line(picture, row, x)
    if kinds[1] == "closed" and r.size > 1:
        r[-1] = r[-2]  # nothing passes the end
    first = {"open": 0.0, "periodic": r[-1]}.get(kinds[0], r[0])
    x, r = np.concatenate([[start], x, [start + L]]), np.concatenate([[first], r, r[-1:]])
    return x, r, (1.0 - r) * film_line(picture, row, x)


def cavities(x: Array, sign: Array, ends: Array, fronts: dict[str, float]) -> list[tuple[float, float]]:
    """Where the cavities of a line begin and end, in m: half-way between points, or at the front that is known there."""
    edges = np.concatenate([ends[:1], (x[1:] + x[:-1]) / 2, ends[1:]])
    change = np.diff(np.concatenate([[0], (sign < 0).astype(int), [0]]))
    first, last = edges[:-1][change[:-1] > 0], edges[change < 0]
    for name, these in (("rupture", first), ("reformation", last)):
        if name in fronts and these.size:
            these[np.argmin(np.abs(these - fronts[name]))] = fronts[name]
    return list(zip(first, last, strict=True))


def map_shape(picture: Picture) -> float | None:
    """Height over width of a map that keeps its shape; None for one that fills its place."""
    L, width = picture.solution.problem.grid.lengths
    keeps = picture.along[0] == picture.across[0] and 1 / MOST_SQUARE < L / width < MOST_SQUARE
    return width / L if keeps else None


def colour_map(figure: Figure | SubFigure, axes: Axes, picture: Picture, name: str) -> None:
    """A map of one field with its colour bar; the cells at the sides reach up to them."""
    values, unit = picture.fields[name]
    values, label = scaled(values, unit)
    grid: Any = picture.solution.problem.grid
    (scale_x, label_x), (scale_y, label_y) = picture.along, picture.across
    dx, dy = (a[1] - a[0] if a.size > 1 else 2 * a[0] for a in (picture.x, picture.y))
    edges = (picture.x[0] - 1.5 * dx, picture.x[-1] + 1.5 * dx, picture.y[0] - 1.5 * dy, picture.y[-1] + 1.5 * dy)
    image = axes.imshow(
        np.pad(values, 1, mode="edge"),
        extent=tuple(scale * edge for scale, edge in zip((scale_x, scale_x, scale_y, scale_y), edges, strict=True)),
        origin="lower",
        cmap=MAPS.get(name, "viridis"),
        interpolation="nearest",
        aspect="equal" if map_shape(picture) else "auto",
    )
    figure.colorbar(image, ax=axes, location="top", pad=0.02, aspect=30, label=NAMES.get(name, name) + label)
    x_limits, y_limits = (
        (scale * start, scale * (start + length))
        for scale, start, length in zip((scale_x, scale_y), grid.origin, grid.lengths, strict=True)
    )
    axes.set(xlabel=label_x, ylabel=label_y, xlim=x_limits, ylim=y_limits)
    if picture.is_journal:
        axes.set_xticks(ANGLES[::2])
    axes.spines[:].set_visible(True)


def outline(axes: Axes, picture: Picture, hatch: str) -> None:
    """The cavity's edge as a white line and its inside dotted."""
    sign = picture.sign
    if min(sign.shape) < 2 or not sign.min() < 0 < sign.max():
        return
    x, y = picture.along[0] * picture.x, picture.across[0] * picture.y
    from matplotlib import rc_context

    with rc_context({"hatch.color": hatch}):
        axes.contourf(x, y, sign, levels=[sign.min() - 1.0, 0.0], colors="none", hatches=[".."])
    axes.contour(x, y, sign, levels=[0.0], colors="white", linewidths=1.2)
