#!/usr/bin/env python3
"""docs/pictures of motion and coefficients: axes, K and C, an orbit, a texture that travels, what stored void does."""

import math
import subprocess
import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np

from lcp_lube import load_scene, solve
from lcp_lube.drivers.motions.coefficients import coefficients
from lcp_lube.output.style import BLUE, GREY, RED, STYLE, new_figure

PICTURES = Path(__file__).parent.parent / "docs" / "pictures"
RUNS = {
    "coefficients.png": ["coefficients", "two_groove_journal", "--set", "balance.load=2000", "--speeds", "500:12000:12:log"],
    "dynamic_journal.png": ["solve", "dynamic_journal"],
    "moving_texture.png": ["solve", "moving_texture", "--set", "motion.t_end=0.02", "--set", "motion.steps=400"],
}


def axes_picture() -> None:
    """Load, axes, sense of rotation and angles of a journal."""
    figure = new_figure(5.2, 4.8)
    axes = figure.subplots()
    angle = np.linspace(0.0, 2.0 * np.pi, 361)
    e = 0.12 * np.array([math.sin(0.9), -math.cos(0.9)])  # of the journal, its attitude 0.9 rad ahead of the load
    axes.plot(np.cos(angle), np.sin(angle), color="black", lw=1.6)
    axes.fill(e[0] + 0.86 * np.cos(angle), e[1] + 0.86 * np.sin(angle), facecolor="0.93", edgecolor="black", lw=1.2)
    arrow = {"arrowstyle": "-|>", "lw": 1.6}
    axes.annotate("", (0, -0.62), (0, 0.0), arrowprops={**arrow, "color": RED})
    axes.text(-0.05, -0.55, "x: along the load,\n$\\theta$ = 0", color=RED, va="top", ha="right")
    axes.annotate("", (0.62, 0), (0, 0), arrowprops={**arrow, "color": BLUE})
    axes.text(0.36, 0.05, "y: a quarter of a turn ahead", color=BLUE, ha="center", va="bottom")
    turn = np.linspace(0.75 * np.pi, 0.3 * np.pi, 40)[::-1]
    axes.plot(0.45 * np.cos(turn), 0.45 * np.sin(turn), color=GREY, lw=1.4)
    head, neck = ((0.45 * math.cos(a), 0.45 * math.sin(a)) for a in (turn[-1], turn[-3]))
    axes.annotate("", head, neck, arrowprops={**arrow, "color": GREY})
    axes.text(0.0, 0.5, "$\\omega$", color=GREY, ha="center", va="bottom", fontsize=12)
    axes.plot([0, 1.1 * math.sin(0.9)], [0, -1.1 * math.cos(0.9)], color="black", lw=0.8, ls="--")
    axes.text(1.12 * math.sin(0.9), -1.12 * math.cos(0.9), "thinnest film,\nat the attitude angle", va="top")
    axes.set(xlim=(-1.2, 1.75), ylim=(-1.25, 1.15), xticks=[], yticks=[])
    axes.set_aspect("equal")
    axes.spines[:].set_visible(False)
    figure.savefig(PICTURES / "axes.png", dpi=150)


def stored_void() -> None:
    """K and C of a ring fed from its ends over the frequency, with the void that is stored and without it."""
    scene = load_scene("ring_journal", n=240)
    ratios = np.geomspace(0.03, 10.0, 48)
    with solve(scene) as solution:
        scale = scene.clearance / solution.load
        nu = [*(ratios * scene.omega)]
        both = [coefficients(scene, solution, nu, stored=stored) for stored in (True, False)]
    figure = new_figure(9.4, 3.9)
    for axes, name, unit in zip(figure.subplots(1, 2), "KC", ("K c/W", "C c$\\omega$/W"), strict=True):
        for found, dashes in zip(both, ("-", "--"), strict=True):
            values = np.array([getattr(one, name) for one in found]) * scale * (scene.omega if name == "C" else 1.0)
            for (i, j), colour in {(0, 0): BLUE, (0, 1): RED, (1, 0): "#CC79A7", (1, 1): GREY}.items():
                label = f"{name}{'xy'[i]}{'xy'[j]}" if dashes == "-" else None
                axes.plot(ratios, values[:, i, j], color=colour, ls=dashes, label=label)
        axes.set(xscale="log", xlabel="frequency over speed, $\\nu/\\omega$", title=unit)
        axes.legend(ncols=2)
    figure.suptitle("ring_journal: film forms again inside. Full lines: void stored; dashed: left out", fontsize=10)
    figure.savefig(PICTURES / "stored_void.png", dpi=110)


def main() -> None:
    for name, words in RUNS.items():
        subprocess.run(
            [sys.executable, "-m", "lcp_lube", *words, "--plot", str(PICTURES / name)], check=True, stdout=subprocess.DEVNULL
        )
    with mpl.rc_context(STYLE):
        axes_picture()
        stored_void()


if __name__ == "__main__":
    main()
