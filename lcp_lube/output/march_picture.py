"""A march in time in one picture: pressure and void of the middle line over x and t, the load, a journal's orbit."""

from typing import Any

import numpy as np

from .frames import Frames
from .style import BLUE, GREY, MAPS, NAMES, RED, new_figure
from .units import prefix


def march_figure(frames: Frames, history: list[dict[str, Any]], title: str) -> Any:
    """Middle lines and load in time; with a journal that moves its orbit too."""
    orbit = "journal_x" in history[0]
    figure = new_figure(12.0 if orbit else 9.0, 5.4)
    grid = figure.add_gridspec(2, 3 if orbit else 2, height_ratios=[2.0, 1.0], width_ratios=[1, 1, 1.05][: 3 if orbit else 2])
    scale, label = frames.along
    to_t, unit_t = prefix(history[-1]["t"], "s")
    times = to_t * np.array(frames.line_times)
    for k, name in enumerate(("p", "r")):
        axes = figure.add_subplot(grid[0, k])
        values = np.array([line[name] for line in frames.lines])
        factor, unit = prefix(float(values.max()), "Pa") if name == "p" else (1.0, "")
        look: dict[str, Any] = {"cmap": MAPS[name], "shading": "nearest", "rasterized": True}
        mesh = axes.pcolormesh(scale * frames.line_x, times, factor * values, **look)
        axes.set(xlabel=label, ylabel=f"t ({unit_t})" if k == 0 else "")
        figure.colorbar(mesh, ax=axes, location="top", label=f"{NAMES[name]}{f' ({unit})' if unit else ''}, middle line")
    t = to_t * np.array([row["t"] for row in history])
    name = "load" if "load" in history[0] else "p_max"
    for k, (key, unit, colour) in enumerate(((name, "N" if name == "load" else "Pa", BLUE), ("cavitated_fraction", "", RED))):
        axes = figure.add_subplot(grid[1, k])
        values = np.array([row.get(key, np.nan) for row in history])
        factor, unit = prefix(float(np.nanmax(np.abs(values))), unit) if unit else (1.0, "")
        axes.plot(t, factor * values, color=colour, lw=1.3)
        ylabel = f"{key.replace('_', ' ')}{f' ({unit})' if unit else ''}"
        axes.set(xlabel=f"t ({unit_t})", ylabel=ylabel, ylim=(min(0.0, *(factor * values)), None))
    if orbit:
        draw_orbit(figure.add_subplot(grid[:, 2]), history)
    figure.suptitle(title, fontsize=10, x=0.01, ha="left")
    return figure


def draw_orbit(axes: Any, history: list[dict[str, Any]]) -> None:
    """The journal's way in the circle that its clearance leaves it, X downwards (where a vertical load points), Y to the right
    of it: a turn from X to Y goes against the clock."""
    x, y = (np.array([row[f"journal_{name}"] for row in history]) for name in "xy")
    angle = np.linspace(0.0, 2.0 * np.pi, 361)
    axes.plot(np.cos(angle), np.sin(angle), color="black", lw=1.2)
    axes.plot(y, -x, color=BLUE, lw=1.0)
    axes.plot(y[0], -x[0], "o", color=GREY, ms=5, label="t = 0")
    axes.plot(y[-1], -x[-1], "s", color=RED, ms=5, label="end")
    for length in (0.25, 0.5, 0.75):
        axes.plot(length * np.cos(angle), length * np.sin(angle), color="0.85", lw=0.6, zorder=0)
    axes.annotate("X", (0, -1.16), ha="center", va="center")
    axes.annotate("Y", (1.12, 0), ha="center", va="center")
    axes.set(xlim=(-1.2, 1.2), ylim=(-1.25, 1.2), xticks=[], yticks=[])
    axes.set_aspect("equal")
    axes.spines[:].set_visible(False)
    axes.set_title("journal in its clearance circle", loc="left")
    axes.legend(loc="upper right")
