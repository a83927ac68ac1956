"""Figures 1, 2 and 3 of Mezzadri and Galligani (2018), with the exact solutions, and the README's picture.

1: p, r and h of problems 1 to 3. 2: problem 2 with the sinusoidal and with the parabolic film. 3: surfaces of p and r of
problem 4. The answer is unique, so the default method serves as well as the paper's.

    python benchmarks/mezzadri_galligani_figures.py [--n 100] [--results benchmarks/results]
"""

import argparse
import sys
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import petsc4py
from matplotlib.figure import Figure

petsc4py.init(sys.argv[:1])

from mpi4py import MPI  # noqa: E402

from lcp_lube.api import solve  # noqa: E402
from lcp_lube.base.files import replacing  # noqa: E402
from lcp_lube.output.panels import section  # noqa: E402
from lcp_lube.output.picture import Picture, collect, largest, title  # noqa: E402
from lcp_lube.output.plot import plot  # noqa: E402
from lcp_lube.output.style import BLUE, MAPS, NAMES, RED, STYLE, new_figure  # noqa: E402
from lcp_lube.output.units import prefix  # noqa: E402
from lcp_lube.problems.solution import Solution  # noqa: E402
from lcp_lube.scenes.scene import load_scene  # noqa: E402


def solved(name: str, **changes: Any) -> Solution:
    """A published problem's solution; a run that fails ends the script."""
    solution = solve(load_scene(name, changes))
    if not solution.converged:
        raise SystemExit(f"{name} {changes}: {solution.message}")
    return solution


def picture_of(solution: Solution) -> Picture:
    picture = collect(solution)
    assert picture is not None, "the figures are drawn on one rank"
    return picture


def scaled(values: Any, unit: str) -> tuple[Any, str]:
    """Values in a unit that suits them, and ' (unit)' for a label."""
    factor, unit = prefix(largest(values), unit)
    return values * factor, f" ({unit})" if unit else ""


def profiles(pictures: list[Picture]) -> Figure:
    """Figure 1: one column a problem, p and r above the film."""
    figure = new_figure(12.6, 4.8)
    grid = figure.subplots(2, len(pictures), sharex="col", height_ratios=[2.6, 1.0])
    for picture, upper, lower in zip(pictures, *grid, strict=True):
        handles = section(upper, lower, picture)
        upper.set_title(title(picture).partition(" (")[0], loc="left", pad=26)
    figure.suptitle("p, r and h of problems 1 to 3", fontsize=10, x=0.01, ha="left")
    figure.legend(handles=handles, ncols=4, loc="upper right")
    return figure


def films(pictures: dict[str, Picture]) -> Figure:
    """Figure 2: h, p and r of two films, one panel each, two lines in a panel."""
    figure = new_figure(12.6, 3.4)
    looks = ({"color": BLUE, "ls": "-", "lw": 2.0}, {"color": RED, "ls": "-.", "lw": 1.8})
    panels = figure.subplots(1, 3)
    L = next(iter(pictures.values())).solution.problem.grid.lengths[0]
    for (film, picture), look in zip(pictures.items(), looks, strict=True):
        x, label_x = scaled(picture.x, "m")
        for axes, name in zip(panels, ("h", "p", "r"), strict=True):
            values, label = scaled(*picture.fields[name])
            axes.plot(x, values, label=film, **look)
            axes.set(xlabel="x" + label_x, ylabel=NAMES[name] + label, xlim=(0.0, 1e3 * L))
            axes.set_ylim(bottom=0.0)
        load, rupture = picture.quantities["load"], picture.quantities["rupture"]
        print(f"figure 2, {film}: p_max {picture.quantities['p_max']:.6g} Pa, load {load:.6g} N/m, rupture {rupture:.6g} m")
    panels[0].legend(loc="lower left")
    figure.suptitle("problem 2: two films between the same least and greatest thickness", fontsize=10, x=0.01, ha="left")
    return figure


def surfaces(picture: Picture) -> Figure:
    """Figure 3: p and r over the square."""
    figure = new_figure(11.0, 4.8)
    x, label_x = scaled(picture.x, "m")
    y, label_y = scaled(picture.y, "m")
    for k, name in enumerate(("p", "r")):
        axes: Any = figure.add_subplot(1, 2, k + 1, projection="3d")
        values, label = scaled(*picture.fields[name])
        every = {"rstride": 2, "cstride": 2, "linewidth": 0.15, "edgecolor": "white"}
        axes.plot_surface(*np.meshgrid(x, y), values, cmap=MAPS[name], **every)
        axes.set(xlabel="x" + label_x, ylabel="y" + label_y, zlabel=NAMES[name] + label)
        axes.view_init(elev=32, azim=-122)
    figure.suptitle(title(picture).replace(" (dotted)", ""), fontsize=10, x=0.01, ha="left")
    return figure


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--n", type=int, default=100, help="interior points a side")
    parser.add_argument("--results", type=Path, default=Path(__file__).parent / "results", help="folder of the pictures")
    args = parser.parse_args()
    args.results.mkdir(parents=True, exist_ok=True)
    lines = [solved(f"problem{k}", n=args.n) for k in (1, 2, 3)]
    pair = {film: solved("problem2", n=args.n, film=film) for film in ("sinusoid", "parabola")}
    square = solved("problem4", n=args.n)
    with mpl.rc_context(STYLE):
        figures = {
            "mezzadri_galligani_figure1.png": profiles([picture_of(solution) for solution in lines]),
            "mezzadri_galligani_figure2.png": films({film: picture_of(solution) for film, solution in pair.items()}),
            "mezzadri_galligani_figure3.png": surfaces(picture_of(square)),
        }
        for name, figure in figures.items():
            with replacing(args.results / name, MPI.COMM_WORLD) as temporary:
                figure.savefig(temporary, dpi=130)
    plot(square, args.results / "problem4.png")
    for solution in (*lines, *pair.values(), square):
        solution.destroy()


if __name__ == "__main__":
    main()
