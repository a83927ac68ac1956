"""What all pictures share: colours, names, matplotlib's settings. matplotlib is imported when a figure is made."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from mpi4py import MPI

from ..base.files import replacing
from ..base.together import on_all_ranks

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure
else:  # names for annotations everywhere
    Axes = Figure = SubFigure = Any

# Okabe and Ito's colours, told apart by all eyes; lines differ in their dashes too, for print.
BLUE, RED, GREY = "#0072B2", "#D55E00", "#555555"
DOTS = 130  # an inch, in a .png
LIQUID, WALL, CAVITY = "#A6CCE3", "0.78", "0.91"
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


def new_figure(width: float, height: float) -> Figure:
    """An empty figure, sizes in inches; without pyplot, so that no window system is needed and no global state is touched."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def save_figure(
    build: Callable[[], Figure],
    path: str | Path,
    comm: MPI.Comm = MPI.COMM_WORLD,
    dpi: int = DOTS,
    style: Any = STYLE,
    few_colours: bool = False,
) -> None:
    """Write a figure to a .png, .pdf or .svg; what is drawn alike gives the same file. Collective.

    Parameters
    ----------
    build : makes it, under `style`; called on rank 0 alone.
    few_colours : for a .png, see `fewer_colours`.
    """
    path = Path(path)
    kind = path.suffix.lower()
    with replacing(path, comm) as temporary, on_all_ranks(comm, str(path)):
        if comm.rank == 0:
            import matplotlib as mpl

            date = {".pdf": "CreationDate", ".svg": "Date"}.get(kind)
            with mpl.rc_context(style):
                build().savefig(temporary, dpi=dpi, metadata={date: None} if date else None)
            if few_colours and kind == ".png":
                fewer_colours(temporary)


def fewer_colours(path: str) -> None:
    """Write a .png again with the 256 colours that these pictures are made of: a third of its size, no difference to the eye.

    76 of each map, for the rest greys and blends of the lines' colours with white.
    """
    import matplotlib as mpl
    from PIL import Image  # what matplotlib writes a .png with

    maps = [mpl.colormaps[name](np.linspace(0.0, 1.0, 76))[:, :3] for name in MAPS.values()]
    greys = np.linspace(0.0, 1.0, 14)[:, None] * np.ones(3)
    lines = np.array([mpl.colors.to_rgb(name) for name in (BLUE, RED, LIQUID, "#B2D4E8")])
    blends = [part + (1.0 - part) * lines[:2] for part in (0.0, 0.25, 0.5, 0.75)]
    colours = np.concatenate([*maps, greys, *blends, lines[2:]])
    palette = Image.new("P", (1, 1))
    palette.putpalette(np.rint(255 * colours).astype(int).ravel().tolist())
    with Image.open(path) as image:
        small = image.convert("RGB").quantize(palette=palette, dither=Image.Dither.NONE)
    small.save(path, format="PNG", optimize=True)
