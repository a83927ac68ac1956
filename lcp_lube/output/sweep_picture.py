"""Numbers of a sweep over the values of its last key, a line for each combination of the others."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..base.parallel import Array
from ..errors import InputError, nearest
from .style import BLUE, GREY, RED, new_figure
from .units import axis

LOOKS = [(colour, dashes) for dashes in ("-", "--", ":", "-.") for colour in (BLUE, RED, GREY)]
SAME = 1e-2  # relative: steps, or ratios, that are even but for rounded values
FAR = 50.0  # the largest over the smallest of a number from which on it is drawn by its logarithm


def check_names(rows: Sequence[Mapping[str, Any]], names: Sequence[str]) -> None:
    """That every name is a column of numbers.

    Raises
    ------
    InputError : one is not, with the nearest that is.
    """
    known = [
        column for column in dict.fromkeys(key for row in rows for key in row) if any(_number(row, column) for row in rows)
    ]
    for name in names:
        if name not in known:
            raise InputError(f"--quantity {name}: no number of these runs{nearest(name, known)}")


def figure_of(
    rows: Sequence[Mapping[str, Any]], keys: Sequence[str], names: Sequence[str], units: Mapping[str, str], title: str
) -> Any:
    """A panel for each name over keys[-1]; points that did not converge are crosses at the bottom.

    Parameters
    ----------
    rows : of the sweep, numbers or their text. units : SI units by name, '' or missing for none.
    """
    figure = new_figure(4.6 * len(names) + 0.6, 3.6)
    groups: dict[tuple[str, ...], list[Mapping[str, Any]]] = {}
    for row in rows:
        groups.setdefault(tuple(str(row[key]) for key in keys[:-1]), []).append(row)
    for axes, name in zip(figure.subplots(1, len(names), squeeze=False)[0], names, strict=True):
        found = np.array([_value(row, name) for row in rows])
        largest = float(np.nanmax(np.abs(found), initial=0.0))
        factor, label = axis(name, largest, units.get(name, ""))
        for k, (values, group) in enumerate(groups.items()):
            x = _places([row[keys[-1]] for row in group])
            colour, dashes = LOOKS[k % len(LOOKS)]
            line = ", ".join(f"{key} = {value}" for key, value in zip(keys, values, strict=False))
            axes.plot(x, [factor * _value(row, name) for row in group], color=colour, ls=dashes, marker="o", ms=3, label=line)
            if failed := [at for at, row in zip(x, group, strict=True) if np.isnan(_value(row, name))]:
                axes.plot(failed, np.zeros(len(failed)), "x", color=colour, transform=axes.get_xaxis_transform(), clip_on=False)
        axes.set(xlabel=keys[-1], title=label)
        if by_ratios(_places(list(dict.fromkeys(row[keys[-1]] for row in rows)))):
            axes.set_xscale("log")
        sizes = found[np.isfinite(found)]
        if sizes.size and sizes.min() > 0.0 and sizes.max() > FAR * sizes.min():
            axes.set_yscale("log")
        if keys[:-1]:
            axes.legend()
    figure.suptitle(title, fontsize=10, x=0.01, ha="left")
    return figure


def by_ratios(x: Sequence[Any]) -> bool:
    """Whether three values or more are numbers at equal ratios, and not at equal steps."""
    if len(x) < 3 or not all(isinstance(one, float) and one > 0.0 for one in x):
        return False
    return _even(np.log(x)) and not _even(np.array(x))


def _even(x: Array) -> bool:
    steps = np.diff(x)
    return bool(np.ptp(steps) <= SAME * np.abs(steps).max())


def _places(values: Sequence[Any]) -> list[Any]:
    """Numbers where all are, else their texts."""
    try:
        return [float(value) for value in values]
    except ValueError:
        return [str(value) for value in values]


def _number(row: Mapping[str, Any], name: str) -> bool:
    try:
        return not isinstance(row[name], bool) and bool(np.isfinite(float(row[name])))
    except (KeyError, TypeError, ValueError):
        return False


def _value(row: Mapping[str, Any], name: str) -> float:
    """NaN of what did not converge, or is no number."""
    return float(row[name]) if str(row.get("converged")) == "True" and _number(row, name) else np.nan
