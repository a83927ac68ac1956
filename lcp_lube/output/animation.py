"""A march in time as an animated picture (.gif): lines in 1D, maps in 2D, with the history of the load below."""

from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from ..base.files import replacing
from ..base.parallel import Array
from ..base.together import on_all_ranks
from .frames import Frames
from .style import BLUE, GREY, MAPS, NAMES, RED, STYLE, new_figure
from .units import axis, prefix

DOTS, RATE = 80, 10  # an inch; frames a second


def animate(frames: Frames, history: list[dict[str, Any]], path: Path) -> None:
    """Draw the frames into a .gif. Collective; rank 0 draws."""
    comm = MPI.COMM_WORLD
    with replacing(path, comm) as temporary, on_all_ranks(comm, str(path)):
        if comm.rank == 0 and frames.fields:
            import matplotlib as mpl
            from matplotlib.animation import PillowWriter
            from matplotlib.backends.backend_agg import FigureCanvasAgg

            with mpl.rc_context(STYLE):
                figure, titled, mark, update = _maps(frames, history) if frames.y.size else _lines(frames, history)
                FigureCanvasAgg(figure)
                writer = PillowWriter(fps=RATE)
                with writer.saving(figure, temporary, dpi=DOTS):
                    for t, fields in zip(frames.times, frames.fields, strict=True):
                        update(fields)
                        titled.set_title(f"t = {t:.4g} s", loc="left")
                        mark.set_xdata([t] * 2)
                        writer.grab_frame()


def _lines(frames: Frames, history: list[dict[str, Any]]) -> Any:
    """p and r along x, the film, and the load in time: figure, axes to be titled, mark of the time, and what draws a frame."""
    figure = new_figure(7.0, 5.6)
    upper, middle, lower = figure.subplots(3, 1, height_ratios=[2.2, 1.0, 0.8])
    scale, label = frames.along
    x, right = scale * frames.x, upper.twinx()
    to_p, unit_p = prefix(_most(frames, "p"), "Pa")
    to_h, unit_h = prefix(_most(frames, "h"), "m")
    (p_line,) = upper.plot(x, 0 * x, color=BLUE, lw=1.8)
    (r_line,) = right.plot(x, 0 * x, color=RED, lw=1.5, ls="-.")
    (h_line,) = middle.plot(x, 0 * x, color="black", lw=1.2)
    low = min(0.0, *(to_p * float(one["p"].min()) for one in frames.fields))
    upper.set(ylabel=f"{NAMES['p']} ({unit_p})", ylim=(low, 1.05 * to_p * _most(frames, "p") or 1.0))
    right.set(ylabel=NAMES["r"], ylim=(0, 1.05))
    middle.set(ylabel=f"{NAMES['h']} ({unit_h})", xlabel=label, ylim=(0, 1.05 * to_h * _most(frames, "h")))

    def update(fields: dict[str, Array]) -> None:
        p_line.set_ydata(to_p * fields["p"])
        r_line.set_ydata(fields["r"])
        h_line.set_ydata(to_h * fields["h"])

    return figure, upper, _history(lower, history), update


def _maps(frames: Frames, history: list[dict[str, Any]]) -> Any:
    """p and r as maps, and the load in time: as `_lines`."""
    figure = new_figure(8.0, 4.6)
    grid = figure.add_gridspec(2, 2, height_ratios=[2.6, 0.8])
    images: dict[str, Any] = {}
    (scale_x, label), (scale_y, label_y) = frames.along, axis("y", frames.lengths[1])
    box = (0.0, scale_x * frames.lengths[0], 0.0, scale_y * frames.lengths[1])
    for k, name in enumerate(("p", "r")):
        axes = figure.add_subplot(grid[0, k])
        factor, unit = prefix(_most(frames, "p"), "Pa") if name == "p" else (1.0, "")
        top = factor * _most(frames, "p") if name == "p" else max(_most(frames, "r"), 1e-3)
        shown = {"origin": "lower", "extent": box, "aspect": "auto", "cmap": MAPS[name], "vmin": 0.0, "vmax": top or 1.0}
        images[name] = (axes.imshow(factor * frames.fields[0][name], **shown), factor)  # type: ignore[arg-type]
        axes.set(xlabel=label, ylabel=label_y if k == 0 else "")
        figure.colorbar(images[name][0], ax=axes, location="top", label=NAMES[name] + (f" ({unit})" if unit else ""))
    lower = figure.add_subplot(grid[1, :])

    def update(fields: dict[str, Array]) -> None:
        for name, (image, factor) in images.items():
            image.set_data(factor * fields[name])

    return figure, lower, _history(lower, history), update


def _history(axes: Any, history: list[dict[str, Any]]) -> Any:
    """The load in time, or the largest pressure of a film without one; returns a line that marks a time."""
    name = "load" if "load" in history[0] else "p_max"
    values = np.array([row[name] for row in history])
    factor, unit = prefix(float(np.abs(values).max()), "N" if name == "load" else "Pa")
    axes.plot([row["t"] for row in history], factor * values, color=GREY, lw=1.0)
    axes.set(xlabel="t (s)", ylabel=f"{name} ({unit})".replace("_", " "))
    return axes.axvline(0.0, color=RED, lw=1.0)


def _most(frames: Frames, name: str) -> float:
    return max(float(one[name].max()) for one in frames.fields)
