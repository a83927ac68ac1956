"""Derivatives as the JSON object, as a table to read, and as a picture: bars, and the film's own derivative at every point."""

from pathlib import Path
from typing import Any

import numpy as np

from ..base.parallel import Array
from ..drivers.derivatives.goal_error import GoalError
from ..drivers.derivatives.gradient import Gradient
from ..drivers.derivatives.march_gradient import MEAN
from ..problems.solution import Solution
from ..scenes.values import unit_of as key_unit
from .files import gather, thinning
from .maps import outline
from .picture import MOST_POINTS, Picture, collect
from .style import BLUE, RED, Axes, new_figure, save_figure
from .table import table
from .units import with_unit

MOST_BARS = 20  # as many names as are read on one picture


def unit_of(solution: Solution, name: str) -> str:
    """Of a number, a part of a vector, or what a balance has found."""
    units, name = solution.units, name.removeprefix(MEAN)
    words = [name, name.rpartition("_")[0], name.rpartition("_")[0].rpartition("_")[0]]
    found = next((units[word] for word in words if word in units), None)
    return key_unit(solution.solved_scene, name) if found is None else found


def as_dict(gradient: Gradient, solution: Solution) -> dict[str, Any]:
    """The keys of the command line's --json that are a gradient's own, docs/gradients.md."""
    return {
        "quantity": gradient.quantity,
        "value": gradient.value,
        "unit": unit_of(solution, gradient.quantity),
        "gradient": {key: gradient.gradient[key] for key in gradient.ranked},
        "elasticity": {key: gradient.elasticity[key] for key in gradient.ranked},
        "units": {key: key_unit(solution.solved_scene, key) for key in gradient.ranked},
        "held": gradient.held,
        "one_sided": gradient.one_sided,
        "uncertain": gradient.uncertain,
        "switching": {"points": gradient.switching, "gap": gradient.switching_gap},
    }


def text(gradient: Gradient, solution: Solution, values: dict[str, float]) -> str:
    """A table of all numbers, those that matter most first; then what has no derivative, or one to each side."""
    own = unit_of(solution, gradient.quantity)
    lines = [f"{gradient.quantity} = {gradient.value:.9g} {own}".rstrip()]
    rows = [("number", "value", "dQ/da", "elasticity")]
    for key in gradient.ranked:
        unit = key_unit(solution.solved_scene, key)
        per = f"{own or '1'} per {unit}" if unit else own
        size = gradient.elasticity[key]
        shown = with_unit(values[key], unit, 6).rstrip() if unit else f"{values[key]:.6g}"
        rows.append((key, shown, f"{gradient.gradient[key]:.6g} {per}".rstrip(), "-" if size is None else f"{size:+.4f}"))
    lines += table(rows, align="<>>>", gap="  ")
    for key, gap in gradient.one_sided.items():
        differ = f"its derivatives to both sides differ by {gap:.3g}; their mean"
        steps = "changes by steps: the slope over 1 % to both sides, or along the grid's lines"
        lines.append(f"{key}: {steps if np.isinf(gap) else differ}")
    lines += [f"{key}: its derivative's error is estimated as {error:.2g}" for key, error in gradient.uncertain.items()]
    if gradient.switching:
        lines.append(
            f"{gradient.switching} points are about to change between full and cavitated, or tie for the largest pressure: "
            f"derivatives differ by up to {gradient.switching_gap:.2g} of the largest to either side"
        )
    lines += [f"{key}: none: {reason}" for key, reason in gradient.held.items()]
    return "\n".join(lines)


def plot(gradient: Gradient, solution: Solution, field: Array, path: str | Path) -> None:
    """Bars of the elasticities, and dQ/dh over the film. Collective; rank 0 draws."""
    picture, values = _gathered(solution, field)

    def figure() -> Any:
        keys = [key for key in gradient.ranked if gradient.elasticity[key]][:MOST_BARS]
        figure = new_figure(10.4, max(3.6, 1.2 + 0.24 * len(keys)))
        bars, film = figure.subplots(1, 2, width_ratios=[1.0, 1.25])
        _bars(bars, gradient, keys)
        own = unit_of(solution, gradient.quantity)
        _film(figure, film, picture, gradient, values, own)  # type: ignore[arg-type]
        title = f"{solution.settings.get('scene', '')}: {gradient.quantity} {with_unit(gradient.value, own)}".rstrip()
        figure.suptitle(title, fontsize=10, x=0.01, ha="left")
        return figure

    save_figure(figure, path, solution.problem.grid.comm)


def plot_error(error: GoalError, solution: Solution, path: str | Path) -> None:
    """Where the error of a number comes from. Collective; rank 0 draws."""
    picture, values = _gathered(solution, error.field)
    unit = unit_of(solution, error.quantity)

    def figure() -> Any:
        figure = new_figure(6.4, 4.6)
        axes = figure.subplots()
        axes.set_xlabel(picture.along[1])  # type: ignore[union-attr]
        name = f"error of {error.quantity} ({unit or '1'} per mm²)"
        _map(figure, axes, picture, 1e-6 * values, name)  # type: ignore[arg-type]
        head = f"{solution.settings.get('scene', '')}: {error.quantity} {with_unit(error.value, unit)}".rstrip()
        shares = f"error near {with_unit(error.error, unit)}; half of what cells add lies in {error.worst:.1%} of them"
        axes.set_title(f"{head}\n{shares}", fontsize=9, loc="left")
        return figure

    save_figure(figure, path, solution.problem.grid.comm)


def _gathered(solution: Solution, field: Array) -> tuple[Picture | None, Array]:
    """A field on the picture's points, on rank 0. Collective."""
    grid = solution.problem.grid
    return collect(solution), gather(grid, field, thinning(grid, MOST_POINTS))


def _bars(axes: Axes, gradient: Gradient, keys: list[str]) -> None:
    sizes = [gradient.elasticity[key] or 0.0 for key in keys]
    axes.barh(range(len(keys)), sizes, color=[BLUE if size > 0 else RED for size in sizes], height=0.7)
    axes.set_yticks(range(len(keys)), keys)
    axes.invert_yaxis()
    axes.axvline(0.0, color="black", lw=0.8)
    axes.set_xlabel(f"% of {gradient.quantity} for 1 % of the number")
    axes.margins(x=0.18)
    for k, size in enumerate(sizes):
        axes.annotate(f"{size:+.3g}", (size, k), (3 if size > 0 else -3, 0), textcoords="offset points", va="center",
                      ha="left" if size > 0 else "right", fontsize=8)  # fmt: skip


def _film(figure: Any, axes: Axes, picture: Picture, gradient: Gradient, values: Array, unit: str) -> None:
    """The derivative by the film: a line, or a map in red (thinner is more) and blue (thicker is more)."""
    scale_x, label_x = picture.along
    line = picture.y.size == 0
    values = values * (1e-9 if line else 1e-12)
    name = f"d({gradient.quantity})/dh ({unit or '1'} per µm and {'mm' if line else 'mm²'})"
    axes.set_xlabel(label_x)
    if line:
        axes.axhline(0.0, color="black", lw=0.8)
        axes.plot(scale_x * picture.x, values, color=BLUE, lw=1.6)
        axes.set_ylabel(name)
        cavity = picture.sign < 0
        if cavity.any():
            axes.fill_between(scale_x * picture.x, 0, 1, where=cavity, color="0.91", transform=axes.get_xaxis_transform(), lw=0)
            axes.set_title("grey: cavitated", loc="left")
        return
    _map(figure, axes, picture, values, name)
    dotted = " (dotted: cavitated)" * bool((picture.sign < 0).any())
    axes.set_title(f"red: a thinner film gives more {gradient.quantity}{dotted}", loc="left")


def _map(figure: Any, axes: Axes, picture: Picture, values: Array, name: str) -> None:
    """A field in red (below 0) and blue, with the cavity's outline."""
    finite = values[np.isfinite(values)]
    largest = float(np.quantile(np.abs(finite), 0.995)) if finite.size else 0.0
    scale_y, label_y = picture.across
    look: dict[str, Any] = {"cmap": "RdBu", "vmin": -largest or -1.0, "vmax": largest or 1.0, "shading": "nearest"}
    image = axes.pcolormesh(picture.along[0] * picture.x, scale_y * picture.y, values, **look)
    axes.set_ylabel(label_y)
    outline(axes, picture, hatch="0.5")
    if not picture.is_journal:
        L, width = picture.solution.problem.grid.lengths
        axes.set_aspect("equal" if 0.2 < width / L < 5 else "auto")
    figure.colorbar(image, ax=axes, label=name, extend="both")
