"""A run's numbers as one row of a table, and tables of them for pandas."""

import csv
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..problems.solution import Solution
from .results import as_dict, finite

PLACES = {"p_max_at": "p_max", "min_h_at": "min_h", "force": "force", "moment": "moment"}
PARTS = {key: (f"{name}_x", f"{name}_y") for key, name in PLACES.items()}


def flat(data: dict[str, Any]) -> dict[str, Any]:
    """The JSON's keys as columns: places by coordinate, flows by side, the total of the seconds."""
    row: dict[str, Any] = {}
    for key, value in finite(data).items():
        if key in PARTS and not isinstance(value, float):  # in 1D a moment is one number
            row |= dict(zip(PARTS[key], [*(value or []), None][: len(value or []) or 2], strict=False))
        elif key in ("flow", "balance") and isinstance(value, dict):
            row |= {f"{key}_{name}": part for name, part in value.items()}
        elif not isinstance(value, (dict, list)):
            row[key] = value
    return row | {"time_s": data["time_s"]["total"]}


def to_pandas(source: str | Path | Iterable[Solution]) -> Any:
    """A table with a row for each run, as a pandas.DataFrame.

    Parameters
    ----------
    source : the csv of ``lcp-lube sweep --output``, or solutions.

    Returns
    -------
    DataFrame : numbers as numbers, `converged` as a truth value; of solutions ``attrs["units"]`` has the columns' units.

    Raises
    ------
    InputError : pandas is missing; a file that is no such csv.
    """
    try:
        import pandas
    except ImportError:
        raise InputError("to_pandas needs pandas: pip install lcp-lube[pandas]") from None
    if isinstance(source, str | Path):
        try:
            with Path(source).open(newline="", encoding="utf-8") as file:
                columns = next(csv.reader(file), [])
            if not {"outcome", "converged", "digest"} <= set(columns):
                raise InputError(f"{source}: no csv of a sweep: the columns outcome, converged and digest are needed")
            return pandas.read_csv(source)
        except (OSError, UnicodeDecodeError) as error:
            raise InputError(f"{source}: {getattr(error, 'strerror', None) or 'not a text file'}") from None
    solutions = list(source)
    frame = pandas.DataFrame([flat(as_dict(solution)) for solution in solutions])
    units: dict[str, str] = {}
    for solution in solutions:
        for name, unit in solution.units.items():
            names = PARTS.get(name, (name,)) if name != "flow" else [column for column in frame if column.startswith("flow_")]
            units |= {column: unit for column in names if unit and column in frame}
    frame.attrs["units"] = units
    return frame
