"""What the pictures of the charts share: print size, colours and markers that all eyes tell apart, a sentence underneath."""

import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mpi4py import MPI

from ..output.style import STYLE, Figure, save_figure

DOTS = 200  # an inch, in a .png
WIDTH = 7.2  # inches: a page's text width, so that the type is read at the size it is set
COLOURS = ("#0072B2", "#009E73", "#D55E00", "#CC79A7", "#E69F00", "#56B4E9")  # Okabe and Ito's, but for black
MARKERS = ("o", "s", "^", "v", "D", "P", "*", "<", ">")
CHART: Any = {
    **STYLE,
    "font.size": 8.0,
    "axes.titlesize": 8.5,
    "axes.labelsize": 8.0,
    "axes.spines.right": False,
    "legend.fontsize": 8.0,
    "lines.linewidth": 1.2,
    "lines.markersize": 4.0,
}


def look(number: int) -> dict[str, Any]:
    """Colour and marker of a chart's series; the pair is told apart by all eyes and in print."""
    return {"color": COLOURS[number % len(COLOURS)], "marker": MARKERS[number % len(MARKERS)]}


def save(build: Callable[[], Figure], path: Path, comm: MPI.Comm) -> None:
    """Draw on rank 0 with the charts' style and replace the picture. Collective."""
    save_figure(build, path, comm, DOTS, CHART)


def new_figure(height: float, sentence: str) -> Figure:
    """A figure of the page's width with a sentence under it."""
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    text = textwrap.fill(sentence, 120)
    below = (0.14 * (text.count("\n") + 1) + 0.08) / height
    figure = Figure(figsize=(WIDTH, height), layout=ConstrainedLayoutEngine(rect=(0.0, below, 1.0, 1.0 - below)))
    figure.text(0.01, 0.06 / height, text, va="bottom", ha="left", linespacing=1.15)
    return figure
