"""`chart rungs`: error against seconds with effects as steps: what each effect buys and costs, and what the decision takes.

From the film without effects on, those that the scene names are added one by one, the largest first; the error is the distance
of the quantity from that of the model with all of them, on the same grid. Seconds are of processor time, the decision's own
included, a median of five runs one after another; `work` is unknowns times films, which does not depend on the machine.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from statistics import median
from time import process_time
from typing import Any

import numpy as np
from mpi4py import MPI

from ..api import solve
from ..base.progress import Line
from ..base.resumable import ResumableCsv, Row
from ..drivers.effects.decision import total_work
from ..output.console import say
from ..output.style import Figure
from ..registry import RUNGS
from ..scenes.effects.named import named
from ..scenes.scene import Scene, load_scene
from .drawing import look, new_figure, save

_WEDGE = [{"shape": "linear", "h_start": 4e-5, "h_end": 2e-5}]
_LAWS = {"mu": 0.02, "p_supply": 1e5, "barus": 2e-8, "density": "dowson-higginson"}
_WARM = {"beta": 0.03, "T_in": 320.0}
_PAD = {"family": "bearing", "L": 0.1, "U": 5.0, "fluid": _LAWS, "film": _WEDGE}
# Name: data, and the number of points of the full and of the quick chart.
SCENES: dict[str, tuple[Any, int, int]] = {
    "lined_pad": ("lined_pad", 1999, 999),
    "pocketed_pad_2d": ("pocketed_pad_2d", 159, 39),
    "adiabatic_journal": ("adiabatic_journal", 360, 120),
    "warm pad": (
        {**_PAD, "dimension": 2, "width": 0.08, "temperature": _WARM, "shear": {"law": "eyring", "tau_0": 1e5}},
        127,
        31,
    ),
    "slow cavity": (
        {**_PAD, "U": 0.3, "film": [{"shape": "sinusoid", "h_min": 8e-6, "h_max": 2e-5}], "temperature": _WARM},
        1999,
        999,
    ),
}
REPEATS = 5  # runs of which the median counts
KEY = ("scene", "n", "model")
NO_ERROR = 1e-8  # where an error that is none is drawn
APART = 0.5  # decades between labels
COLUMNS = (*KEY, "outcome", "quantity", "value", "error", "work", "share_of_work", "seconds")


def chart(quick: bool, results: Path) -> int:
    """Make the runs that are not there, draw them; exit status. Collective."""
    store = ResumableCsv(results / f"rungs{'_quick' * quick}.csv", COLUMNS, KEY)
    with Line() as line:
        scenes = line.over(SCENES.items(), lambda scene: f"{scene[0]}, scene")
        rows = [row for name, (source, n, few) in scenes for row in _of_scene(store, name, source, few if quick else n)]
    path = results / f"rungs{'_quick' * quick}.png"
    save(lambda: _draw(rows), path, MPI.COMM_WORLD)
    say(f"{path}: {len(rows)} runs of {len(SCENES)} scenes")
    return 0 if all(row["outcome"] == "converged" for row in rows) else 1


def _of_scene(store: ResumableCsv, name: str, source: Any, n: int) -> Iterator[Row]:
    """Rows from the least model to the full one, then the decision's."""
    own = isinstance(source, dict)
    plane = source.get("dimension") == 2 if own else "2d" in source
    size = {"nx": n, "ny": max(3, n // 2)} if plane else {"n": n}
    scene = load_scene({**source, **size, "name": name}) if own else load_scene(source, size)
    full = _run(store, scene, name, n, "full")
    names = named(scene)
    alone = {one: _run(store, scene, name, n, one) for one in names}
    least = _run(store, scene, name, n, "least")
    start = float(least["value"])
    order = sorted(names, key=lambda one: -abs(float(alone[one]["value"]) - start))
    steps = [least, *(_run(store, scene, name, n, ",".join(order[:k])) for k in range(1, len(order))), full]
    for row in [*steps, _run(store, scene, name, n, "auto")]:
        yield {**row, "error": f"{abs(float(row['value']) / float(full['value']) - 1.0):.3e}"}


def _run(store: ResumableCsv, scene: Scene, name: str, n: int, model: str) -> Row:
    return store.row({"scene": name, "n": n, "model": model}, lambda: _made(scene, model))


def _made(scene: Scene, model: str) -> dict[str, Any]:
    spent = []
    for _ in range(REPEATS - 1):
        begin = process_time()
        solve(scene, model=model).destroy()
        spent.append(process_time() - begin)
    begin = process_time()
    with solve(scene, model=model) as s:
        spent.append(process_time() - begin)
        found = s.settings.get("balance")
        value = found["value"] if found else s.numbers["load"]
        share = s.settings["model"].get("share_of_work", 0.0)
        return {
            **{"outcome": str(s.outcome), "quantity": found["vary"] if found else "load", "value": f"{value:.12g}"},
            **{"work": f"{total_work(s) * (1.0 + share):.6g}", "share_of_work": f"{share:.4g}"},
            "seconds": f"{median(spent):.3g}",
        }


def _draw(rows: Sequence[Row]) -> Figure:
    figure = new_figure(
        5.6,
        "Each line goes from the film without effects, by the largest first, to the one with all, whose error is none (at "
        f"{NO_ERROR:g}). Star: what the decision takes, its own time included. Lines at 1 % (dashed) and a tenth of that.",
    )
    names = list(dict.fromkeys(row["scene"] for row in rows))
    axes = figure.subplots(2, 3, sharey=True).ravel()
    for number, (name, ax) in enumerate(zip(names, axes, strict=False)):
        *steps, auto = [row for row in rows if row["scene"] == name]
        x, y = zip(*(_place(row) for row in steps), strict=True)
        ax.plot(x, y, **look(number))
        before: list[str] = []
        height = np.inf  # of the label above, whose place the next one leaves free
        for row in steps:
            models = [] if row["model"] == "least" else row["model"].split(",")
            new = ["all"] if row["model"] == "full" else [RUNGS[one].line for one in models if one not in before]
            height = min(np.log10(_place(row)[1]), height - APART)
            ax.annotate(
                ", ".join(new) or "none",
                _place(row),
                (2.2 * max(x), 10.0**height),
                va="center",
                fontsize=6.5,
                arrowprops={"arrowstyle": "-", "color": "0.6", "linewidth": 0.5},
            )
            before = models if row["model"] != "full" else before
        star = {**look(number), "marker": "*", "markersize": 10, "linestyle": "none", "markeredgecolor": "black"}
        ax.plot(*([one] for one in _place(auto)), **star)
        ax.axhline(1e-2, color="0.5", linestyle="--", linewidth=0.7)
        ax.axhline(1e-3, color="0.5", linewidth=0.7)
        ax.set(xscale="log", yscale="log", title=f"{name}\n{steps[0]['quantity']}", xlabel="seconds of processor time")
        ax.set_xlim(0.4 * min(x), 300.0 * max(x))
    for ax in axes[:: axes.size // 2]:
        ax.set_ylabel("error")
    for ax in axes[len(names) :]:
        ax.set_axis_off()
    return figure


def _place(row: Row) -> tuple[float, float]:
    """Seconds and error."""
    return float(row["seconds"]), max(float(row["error"]), NO_ERROR)
