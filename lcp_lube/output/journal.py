"""A journal in its bush: the pressure around it, the liquid in the gap, the load and the attitude angle."""

from typing import Any

import numpy as np

from .panels import liquid_line, pressure_line
from .picture import Picture, largest
from .style import BLUE, GREY, LIQUID, RED, WALL, Axes
from .units import with_unit

CLEARANCE, HIGH, BUSH = 0.22, 0.55, 0.10  # mean gap, largest pressure and wall of the bush in its radii, as drawn


def journal(axes: Axes, picture: Picture, row: int | None = None) -> None:
    """Draw the cross-section through a row, the load downwards, the gap far too wide.

    The angle phi runs from x = 0 in the sense of rotation. The film presses the journal against the load, so the
    narrowest film lies at the attitude angle behind the load's direction, counted in the sense of rotation.
    """
    problem: Any = picture.solution.problem
    start, L = problem.grid.origin[0], problem.grid.lengths[0]
    force, attitude = picture.quantities["force"], picture.quantities["attitude_deg"]
    beginning = problem.shaft.start - 0.5 * np.pi - float(np.arctan2(-force[1], -force[0]))  # of x, the load pointing downwards

    def around(x: Any, radius: Any) -> tuple[Any, Any]:
        theta = beginning + 2.0 * np.pi * (x - start) / L
        return radius * np.cos(theta), radius * np.sin(theta)

    def ring(x: Any, inner: Any, outer: Any, **look: Any) -> None:
        (ax, ay), (bx, by) = around(x, inner), around(x[::-1], outer[::-1])
        axes.fill(np.concatenate([ax, bx]), np.concatenate([ay, by]), lw=0, **look)

    fine = picture.fine()
    h = picture.film(row, fine)
    to_gap = CLEARANCE / h.mean()
    x, p = pressure_line(picture, row)
    p_sides = p - problem.p_c
    liquid = liquid_line(picture, row, fine)[2]

    outside = 1.0 + BUSH
    height = HIGH * np.maximum(p_sides, 0.0) / (largest(p_sides) or 1.0)
    ring(x, outside + 0.0 * x, outside + height, color=BLUE, alpha=0.3)
    axes.plot(*around(x, np.where(height > 0, outside + height, np.nan)), color=BLUE, lw=1.6)
    ring(fine, 1.0 + 0.0 * fine, outside + 0.0 * fine, color=WALL)
    ring(fine, 1.0 - to_gap * h, 1.0 - to_gap * (h - liquid), color=LIQUID)  # the liquid clings to the journal
    axes.plot(*around(fine, 1.0), color="black", lw=1.0)
    axes.fill(*around(fine, 1.0 - to_gap * h), facecolor="0.93", edgecolor="black", lw=1.4)

    for name, place in picture.fronts.items() if row is None or row == picture.middle else ():
        gap = to_gap * picture.film(row, np.array([place]))[0]
        axes.plot(*around(place, np.array([1.0 - gap, outside])), color=RED)
        at = around(place, outside + 0.06)
        axes.text(*at, name, ha="left" if at[0] > 0 else "right", va="center", fontsize=8, color=RED)
    axes.plot(*around(start, np.array([1.0, outside])), color=GREY, lw=1.0)
    axes.text(*around(start, outside + 0.1), "0°", ha="center", va="center", fontsize=8, color=GREY)
    narrowest = -0.5 * np.pi + np.radians(attitude or 0.0)
    centre = 0.5 * to_gap * np.ptp(h) * unit(narrowest)
    axes.plot(*np.transpose([0.0 * centre, 0.85 * unit(narrowest)]), color=GREY, lw=0.8, ls=(0, (6, 3)))
    load = {"arrowstyle": "-|>", "lw": 1.6, "color": "black"}
    axes.annotate("", centre - [0.0, 0.62], centre, arrowprops=load)
    text = with_unit(picture.quantities.get("load") or 0.0, "N/m" if row is None else "N")
    axes.text(centre[0] - 0.04, centre[1] - 0.3, text, ha="right", fontsize=8.5)
    turn = np.linspace(0.35 * np.pi, 0.65 * np.pi, 30)
    axes.plot(*np.transpose([0.5 * unit(angle) for angle in turn]), color="black", lw=1.0)
    axes.annotate("", 0.5 * unit(turn[-1]), 0.5 * unit(turn[-3]), arrowprops={**load, "lw": 1.0})
    axes.text(0.0, 0.55, "$\\omega$", ha="center", va="bottom")
    angle = "" if attitude is None else f"attitude angle {attitude:.1f}°; "
    axes.set_title(f"{angle}gap not to scale", loc="center")
    axes.set_aspect("equal")
    axes.axis("off")


def unit(angle: float) -> Any:
    """The direction of an angle."""
    return np.array([np.cos(angle), np.sin(angle)])
