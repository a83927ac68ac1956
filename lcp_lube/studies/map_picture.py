"""The picture of a map of outcomes: panels of cells, a number where runs converge, a mark that says how they fail."""

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.resumable import Row
from ..output.style import Axes, Figure
from ..problems.solution import Outcome
from .drawing import WIDTH, new_figure
from .experiment import FELL_BACK, KRYLOV_LIMIT

KRYLOV_MOST = 100_000  # of a whole run; what takes more has a colour of its own
# Of each way to fail: its marker, its label, and the words for such runs in a sentence.
FAILURES: dict[str, tuple[str, str, str]] = {
    Outcome.MAX_ITERATIONS: ("x", "iteration limit", "at the iteration limit"),
    Outcome.STEP_LENGTH: ("_", "no step length", "without a step length"),
    Outcome.STALLED: ("v", "stalled", "stalled"),
    Outcome.WRONG_SOLUTION: ("o", "wrong solution", "wrong"),
    Outcome.LINEAR_SOLVER: ("+", "linear solver", "by the inner solver"),
    Outcome.NOT_FINITE: ("D", "not finite", "not finite"),
    Outcome.NO_SOLUTION: ("|", "says: no solution", "'no solution'"),
    FELL_BACK: ("^", "rescued by another method", "rescued by another method"),
    KRYLOV_LIMIT: ("s", "Krylov limit", f"over {KRYLOV_MOST:,} Krylov iterations"),
}
LEAST, MOST = 3, 500  # steps at the ends of the colours


@dataclass(frozen=True)
class Axis:
    """A key column along an axis: its label with the unit, its name in sentences, and whether its values are numbers."""

    column: str
    label: str
    name: str = ""
    number: bool = True


@dataclass(frozen=True)
class Panels:
    """Key columns that make a panel: what stands across, and what down (a block of panels each); outlined marks cells."""

    across: str
    down: str = ""
    columns: int = 5  # panels in a row at most
    outlined: Callable[[Row], bool] | None = None
    outline_label: str = ""


def unique(rows: Sequence[Row], name: str) -> list[str]:
    """Values of a column, in the order in which they come."""
    return list(dict.fromkeys(row[name] for row in rows))


def chosen(rows: Sequence[Row], **values: str) -> list[Row]:
    """The rows with these values."""
    return [row for row in rows if all(row[name] == value for name, value in values.items())]


def groups(rows: Sequence[Row], by: Sequence[str]) -> dict[tuple[str, ...], list[Row]]:
    """The rows by the values of some columns, in the order in which they come."""
    found: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        found.setdefault(tuple(row[name] for name in by), []).append(row)
    return found


def converged(row: Row) -> bool:
    return row["outcome"] == Outcome.CONVERGED


def tick(value: str) -> str:
    """A number as a tick label: powers of ten as such."""
    number = float(value)
    exponent = math.log10(abs(number)) if number else 0.0
    if number and exponent == round(exponent) and not -1 <= exponent <= 2:
        return f"${'-' * (number < 0)}10^{{{round(exponent)}}}$"
    return f"{number:g}"


def values_of(rows: Sequence[Row], axis: Axis) -> list[str]:
    """What stands along an axis: numbers from small to large, words in the order in which they come."""
    found = unique(rows, axis.column)
    return sorted(found, key=float) if axis.number else found


def picture(
    rows: Sequence[Row], panels: Panels, x: Axis, y: Axis, sentence: str, right: Callable[[Row], bool] = converged
) -> Figure:
    """All panels, with one colour scale and one legend; panels that are the same in every cell are drawn once."""
    down = unique(rows, panels.down) if panels.down else [""]
    titles = _merged(rows, panels, x, y)
    # Inches of the widest text of a panel.
    words = max(0.062 * len(x.label), *(0.078 * len(title) for title in titles.values()))
    fits = max(1, min(panels.columns, int((WIDTH - 0.8) / (words + 0.1))))
    lines_each = math.ceil(len(titles) / fits)
    columns = math.ceil(len(titles) / lines_each)
    kept = [row for row in rows if row[panels.across] in titles]
    blocks = {d: chosen(kept, **({panels.down: d} if panels.down else {})) for d in down}
    # A line of type for every cell, and room for the label.
    tall = [max(0.75, 0.155 * len(values_of(mine, y)), 0.064 * len(y.label)) for mine in blocks.values()]
    heights = [height for height in tall for _ in range(lines_each)]
    turned = _crowded([tick(value) if x.number else value for value in values_of(rows, x)])  # the numbers under a panel
    figure = new_figure(0.55 + sum(heights) + 0.5 * len(heights) + 0.35 * turned, sentence)
    grid = figure.subplots(len(heights), columns, squeeze=False, height_ratios=heights)
    for block, (d, mine) in enumerate(blocks.items()):
        for number in range(lines_each * columns):
            line, column = block * lines_each + number // columns, number % columns
            axes: Axes = grid[line, column]
            if number >= len(titles):
                axes.remove()
                continue
            across = [*titles][number]
            _cells(axes, chosen(mine, **{panels.across: across}), panels, x, y, right)
            if lines_each > 1 or block == 0:
                axes.set_title(titles[across], fontweight="bold")
            if column == 0:
                axes.set_ylabel(f"{d}\n{y.label}" if d else y.label)
            else:
                axes.set_yticklabels([])
            if line == len(heights) - 1 or (block == len(blocks) - 1 and number + columns >= len(titles)):
                axes.set_xlabel(x.label)
    handles = legend(rows, right)
    if panels.outlined and any(map(panels.outlined, rows)):
        from matplotlib.patches import Patch

        handles.append(Patch(fill=False, ec="black", lw=1.4, label=panels.outline_label))
    if handles:
        figure.legend(handles=handles, loc="outside upper right", ncols=min(len(handles), 5))
    return figure


def _crowded(labels: Sequence[str]) -> bool:
    return sum(len(label.strip("${}^")) + 1 for label in labels) > 22


def _merged(rows: Sequence[Row], panels: Panels, x: Axis, y: Axis) -> dict[str, str]:
    """What stands across -> its title; values whose runs end alike in all cells share the first one's panel."""
    seen: dict[Any, list[str]] = {}
    for value in unique(rows, panels.across):
        mine = chosen(rows, **{panels.across: value})
        place = [name for name in (panels.down, x.column, y.column) if name]
        cells = frozenset((*(row[name] for name in place), row["outcome"], row["iterations"]) for row in mine)
        seen.setdefault(cells, []).append(value)
    return {names[0]: ", ".join(names) for names in seen.values()}


def legend(rows: Sequence[Row], right: Callable[[Row], bool] = converged) -> list[Any]:
    """The marks of the ways in which some run failed."""
    from matplotlib.lines import Line2D

    seen = {row["outcome"] for row in rows if not right(row)}
    return [
        Line2D([], [], color="0.3", marker=mark, mfc="none", ls="none", label=label)
        for outcome, (mark, label, _) in FAILURES.items()
        if outcome in seen
    ]


def _cells(axes: Axes, rows: Sequence[Row], panels: Panels, x: Axis, y: Axis, right: Callable[[Row], bool]) -> None:
    """One panel. A cell of several runs shows the most steps of them, and beside a mark how many of them failed."""
    from matplotlib.colors import LogNorm
    from matplotlib.patches import Rectangle

    xs, ys = values_of(rows, x), values_of(rows, y)
    cells = np.full((len(ys), len(xs)), np.nan)
    small = 6.5  # points, the least that is read at a column's width
    for (at_x, at_y), here in groups(rows, (x.column, y.column)).items():
        i, j = xs.index(at_x), ys.index(at_y)
        failed = [row for row in here if not right(row)]
        if failed:
            worst = Counter(row["outcome"] for row in failed).most_common(1)[0][0]
            part = len(failed) < len(here)
            mark = FAILURES.get(worst, "p")[0]
            axes.plot(i - 0.22 * part, j, ls="none", marker=mark, mfc="none", ms=4.0, color="0.25")
            if part:
                axes.text(i + 0.15, j, f"{len(failed)}/{len(here)}", ha="center", va="center", fontsize=small)
            continue
        cells[j, i] = max(1, *(int(row["iterations"]) for row in here))
        colour = "white" if cells[j, i] > 60 else "black"
        axes.text(i, j, f"{cells[j, i]:.0f}", ha="center", va="center", fontsize=small, color=colour)
        if panels.outlined and all(map(panels.outlined, here)):
            axes.add_patch(Rectangle((i - 0.46, j - 0.46), 0.92, 0.92, fill=False, ec="black", lw=1.2))
    axes.imshow(cells, origin="lower", cmap="Blues", norm=LogNorm(LEAST, MOST), aspect="auto")
    axes.tick_params(length=0)
    skip_x, skip_y = (max(1, math.ceil(len(values) / most)) for values, most in ((xs, 12), (ys, 16)))
    _ticks(axes.set_xticks, xs, x, skip_x)
    _ticks(axes.set_yticks, ys, y, skip_y)


def _ticks(put: Callable[..., Any], values: Sequence[str], axis: Axis, skip: int) -> None:
    labels = [tick(value) if axis.number else value for value in values]
    labels = [label if k % skip == 0 else "" for k, label in enumerate(labels)]
    turned = put.__name__ == "set_xticks" and _crowded(labels)
    put(range(len(values)), labels, fontsize=6.5, rotation=90 if turned else 0)
