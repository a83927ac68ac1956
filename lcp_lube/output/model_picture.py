"""The decision as a picture: what each effect changes in the quantity asked for, beside the tolerance."""

from pathlib import Path
from typing import Any

from ..errors import InputError
from ..registry import RUNGS
from .style import BLUE, GREY, RED, Figure, new_figure, save_figure

DOTS = 160  # an inch
LEAST = 1e-3  # of the part of the tolerance from which effects count: what is smaller is drawn as that


def plot_model(model: dict[str, Any], path: str | Path) -> None:
    """Draw settings['model'] of a solution to a .png, .pdf or .svg; InputError where no decision was taken. Collective."""
    if "quantity" not in model:
        raise InputError(f"--plot-model {path}: no decision was taken: {model['reason']}")
    save_figure(lambda: _draw(model), path, dpi=DOTS)


def _draw(model: dict[str, Any]) -> Figure:
    effects = {**model["kept"], **model["left_out"]}
    told = sorted(((name, e) for name, e in effects.items() if e is not None), key=lambda one: abs(one[1]))
    counts = 0.1 * model["tolerance"] * 100
    figure = new_figure(6.2, 1.1 + 0.32 * max(len(told), 1))
    axes = figure.add_subplot()
    axes.set_xscale("log")
    axes.axvspan(LEAST * counts, counts, color="0.93", zorder=0)
    axes.axvline(counts, color=GREY, linewidth=0.9)
    axes.axvline(10 * counts, color=GREY, linewidth=0.9, linestyle="--")
    for row, (name, e) in enumerate(told):
        size, kept = max(abs(e) * 100, 1.3 * LEAST * counts), name in model["kept"]
        axes.barh(row, size, left=0, height=0.55, color=(RED if e < 0 else BLUE) if kept else "0.7", zorder=2)
        axes.annotate(f"{100 * e:+.2g} %", (size, row), (4, 0), textcoords="offset points", va="center")
    axes.set_yticks(range(len(told)), [RUNGS[name].line for name, _ in told])
    biggest = max((abs(e) * 100 for _, e in told), default=counts)
    axes.set_xlim(LEAST * counts, 6 * max(biggest, 10 * counts))
    axes.set_xlabel(f"change of the {model['quantity']} in % (blue: more, red: less; grey: left out)")
    axes.set_title("grey field: below a tenth of the tolerance (dashed)", fontsize=8.5, color=GREY, loc="left")
    axes.spines[["right"]].set_visible(False)
    return figure
