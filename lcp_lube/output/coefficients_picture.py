"""Stiffness and damping of a journal's film against the Sommerfeld number, and where a rigid rotor on it is stable."""

from typing import Any

import numpy as np

from .style import BLUE, GREY, RED, new_figure

LOOKS = {"xx": (BLUE, "-"), "xy": (RED, "-"), "yx": (RED, "--"), "yy": (BLUE, "--")}


def figure_of(rpm: Any, rows: list[dict[str, Any]], name: str) -> Any:
    """The coefficients of several speeds (rpm)."""
    figure = new_figure(10.5, 3.9)
    axes = figure.subplots(1, 3)
    S = np.array([row["S"] for row in rows])
    for one, key, title in zip(axes, ("K", "C"), ("stiffness K c/W", "damping C c$\\omega$/W"), strict=False):
        values = np.array([row["coefficients"][0][f"{key}_dimensionless"] for row in rows]).reshape(len(rows), 4)
        for (part, (colour, dashes)), value in zip(LOOKS.items(), values.T, strict=True):
            one.plot(S, np.abs(value), color=colour, ls=dashes, marker="o", ms=3, label=f"{key}{part}")
            below = value < 0
            one.plot(S[below], -value[below], "o", mfc="white", mec=colour, ms=5, ls="none")
        one.set(xscale="log", yscale="log", xlabel="Sommerfeld number S", title=title)
        one.legend(ncols=2, title="hollow: negative", title_fontsize=8)
    ws = np.array([np.nan if row["threshold"] is None else row["threshold"] for row in rows])
    axes[2].plot(rpm, ws, color=GREY, marker="o", ms=3)
    axes[2].set(xlabel="speed (rpm)", title="rigid rotor: unstable above $\\omega\\sqrt{c/g}$ =")
    axes[2].set_ylim(bottom=0.0)
    figure.suptitle(f"{name}: x along the load, y a quarter of a turn ahead", fontsize=10, x=0.01, ha="left")
    return figure
