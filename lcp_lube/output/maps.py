"""Maps of fields in their true shape, with colour bars and the cavity's outline."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..base.parallel import Array
from .panels import ANGLES
from .picture import Picture
from .style import MAPS, NAMES, Axes, Figure, SubFigure
from .units import prefix

SLENDER = 12.0  # longer rectangles are drawn as if they were as slender as that, and say so
FLAT, TALL = 0.4, 2.5  # height over width below which maps stand one above the other, and above which their bars are upright
LONG, HIGH = 6.6, 4.4  # inches: of a flat map, of a tall one
HIGHEST = 1.5  # height of other maps over the width that there is for them
BAR = 0.1  # inches


def shape(picture: Picture) -> float:
    """Height over width of a map as it is drawn: the true one up to SLENDER; a map over angles is square."""
    L, width = picture.solution.problem.grid.lengths
    return 1.0 if picture.is_journal else float(np.clip(width / L, 1 / SLENDER, SLENDER))


def height(picture: Picture, count: int, width: float) -> float:
    """Inches that `count` maps need in a figure of this width."""
    ratio = shape(picture)
    if ratio < FLAT:
        return 0.3 + count * (0.6 + LONG * ratio)
    return 1.25 + 0.25 * (ratio > 1) + (HIGH if ratio > TALL else _side(count, width) * min(ratio, HIGHEST))


def _side(count: int, width: float) -> float:
    """Inches that a map is wide, where its height leaves it free."""
    return width / count - 0.6


def panels(figure: Figure | SubFigure, picture: Picture, names: Sequence[str]) -> dict[str, Axes]:
    """A map of each of these fields: side by side, or flat ones one above the other."""
    flat, side = shape(picture) < FLAT, _side(len(names), figure.bbox.width / figure.dpi)
    places = figure.subplots(*((len(names), 1) if flat else (1, len(names))), squeeze=False).ravel()
    for axes, name in zip(places, names, strict=True):
        colour_map(figure, axes, picture, name, side)
        if flat and axes is not places[-1]:
            axes.set_xlabel("")
            axes.tick_params(labelbottom=False)
    return dict(zip(names, places, strict=True))


def colour_map(figure: Figure | SubFigure, axes: Axes, picture: Picture, name: str, side: float) -> None:
    """A map of one field with its colour bar, about `side` inches wide; the cells at the sides reach up to them."""
    grid: Any = picture.solution.problem.grid
    values, unit = picture.fields[name]
    limits = picture.limits(name)
    factor, unit = prefix(max(map(abs, limits)), unit)
    label = NAMES.get(name, name) + (f" ({unit})" if unit else "")
    (scale_x, label_x), (scale_y, label_y) = picture.along, picture.across
    x, y = _to_the_sides(picture)
    ratio = shape(picture)
    width_over_height = scale_x * grid.lengths[0] / (scale_y * grid.lengths[1])
    look: dict[str, Any] = {"cmap": MAPS.get(name, "viridis"), "vmin": factor * limits[0], "vmax": factor * limits[1]}
    cells = np.pad(factor * values, 1, mode="edge")
    edges_x, edges_y = _cell_edges(x), _cell_edges(y)
    if grid.even:
        box = (edges_x[0], edges_x[-1], edges_y[0], edges_y[-1])
        image: Any = axes.imshow(cells, extent=box, origin="lower", interpolation="nearest", **look)
    else:
        image = axes.pcolormesh(edges_x, edges_y, cells, rasterized=True, **look)
    axes.set_aspect(ratio * width_over_height)
    (x0, y0), (L, width) = grid.origin, grid.lengths
    axes.set(
        xlabel=label_x, ylabel=label_y, xlim=(scale_x * x0, scale_x * (x0 + L)), ylim=(scale_y * y0, scale_y * (y0 + width))
    )
    if not picture.is_journal and not np.isclose(stretch := ratio * grid.lengths[0] / grid.lengths[1], 1.0):
        times = f"; y drawn {stretch:.2g} times" if stretch > 1 else f", {1 / stretch:.2g} times"
        axes.set_xlabel(f"{label_x}{times} too long")
    if picture.is_journal:
        axes.set_xticks(ANGLES[::2])
    axes.spines[:].set_visible(True)
    _bar(figure, axes, image, label, ratio, side)


def _bar(figure: Figure | SubFigure, axes: Axes, image: Any, label: str, ratio: float, side: float) -> None:
    """A colour bar as long as the map's side: above it, or upright beside slender ones."""
    if FLAT <= ratio <= TALL:
        high = side * min(ratio, HIGHEST)
        place, upright = (0.0, 1.0 + BAR / high, 1.0, BAR / high), False
    else:
        wide = LONG if ratio < FLAT else HIGH / ratio
        place, upright = (1.0 + BAR / wide, 0.0, BAR / wide, 1.0), True
    bar = figure.colorbar(image, cax=axes.inset_axes(place), orientation="vertical" if upright else "horizontal")
    from matplotlib.ticker import MaxNLocator

    bar.locator = MaxNLocator(nbins=5, min_n_ticks=2)
    if upright:
        axes.set_title(label, fontsize="medium")
    else:
        bar.ax.xaxis.set_ticks_position("top")
        bar.ax.xaxis.set_label_position("top")
        bar.set_label(label)


def _cell_edges(at: Array) -> Array:
    """Half-way between points, and as far beyond the first and the last one."""
    half = 0.5 * np.diff(at)
    return np.concatenate([at[:1] - half[:1], at[:-1] + half, at[-1:] + half[-1:]])


def _to_the_sides(picture: Picture) -> list[Array]:
    """x and y as they are drawn, with one more at each end, as far away as points are from one another."""
    grid: Any = picture.solution.problem.grid
    scales, found = (picture.along[0], picture.across[0]), []
    for scale, at, start, length in zip(scales, (picture.x, picture.y), grid.origin, grid.lengths, strict=True):
        step = at[1] - at[0] if at.size > 1 else 2.0 * max(at[0] - start, start + length - at[0])
        found.append(scale * np.concatenate([[at[0] - step], at, [at[-1] + step]]))
    return found


def outline(axes: Axes, picture: Picture, hatch: str) -> None:
    """The cavity's fronts as white lines and its inside dotted."""
    sign = np.pad(picture.sign, 1, mode="edge")  # up to the sides, as the colours reach
    if not sign.min() < 0:
        return
    from matplotlib import rc_context

    with rc_context({"hatch.color": hatch}):
        axes.contourf(*_to_the_sides(picture), sign, levels=[sign.min() - 1.0, 0.0], colors="none", hatches=[".."])
    for curve in picture.curves:
        axes.plot(picture.along[0] * curve[:, 0], picture.across[0] * curve[:, 1], color="white", lw=1.2)
