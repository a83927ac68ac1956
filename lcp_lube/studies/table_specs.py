"""What is in the published tables: how each printed row is run (tables.toml), and which runs a printed row stands for."""

import math
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from mpi4py import MPI

from ..base.resumable import Row
from ..errors import InputError


@dataclass(frozen=True)
class Spec:
    """How a printed table is run: the keys of tables.toml, which says what they are."""

    title: str
    command: str
    rows: Callable[[list[Row]], list[Row]] = list
    points: Sequence[int] = ()
    quick: float = math.inf
    system: str = "full"
    printed: str = ""
    fitted: str | None = None
    note: str = "benchmarks/README.md explains what differs."


def _row_a_method(printed: list[Row]) -> list[Row]:
    """Table 7 turned: a row a method, a column p_i a point."""
    columns = [name for name in printed[0] if name.startswith("p_")]
    return [
        {"method": column.removeprefix("p_").replace("_", "-"), **{f"p_{row['i']}": row[column] for row in printed}}
        for column in columns
    ]


def _these_ranks(printed: list[Row]) -> list[Row]:
    """The rows that were printed for as many processors p as this run has ranks; n points are `side` x `side`."""
    ranks = MPI.COMM_WORLD.size
    rows = [{**row, "side": f"{math.isqrt(int(row['n']))}"} for row in printed if int(row["p"]) == ranks]
    if not rows:
        known = ", ".join(sorted({row["p"] for row in printed}, key=int))
        raise InputError(f"this table is printed for {known} processors: run it on as many ranks, not on {ranks}")
    return rows


def _cimmino(printed: list[Row]) -> list[Row]:
    """Table 3. The paper does not say what its CG count counts: both problems' first step and all steps stand beside it.

    It prints neither Bratu's lambda nor the values on the boundary of the other problem.
    """
    settings = {"bratu": ("lambda=5", "lambda=6"), "poisson_cubic": ("boundary=1",)}
    return [
        {
            **{name: row[name] for name in ("problem", "n", "p", "side")},
            "set": setting,
            "it": row["newton_it"],
            "first_it": row["cg_it"],
            "linear_it": row["cg_it"],
            "time_s": row["time_s"],
        }
        for row in _these_ranks(printed)
        for setting in settings[row["problem"]]
    ]


def _row_a_preconditioner(printed: list[Row]) -> list[Row]:
    """Tables 4 and 5: a row a recipe; FSAI, which is not printed, beside the two that are."""
    columns = {"ainv": "ainv", "bcgs_jacobi": "jacobi", "fsai": ""}
    measured = {"it": "nonlinear_it", "linear_it": "linear_it", "time_s": "time_s"}
    return [
        {
            **{name: row[name] for name in ("n", "p", "side")},
            "recipe": recipe,
            **{ours: row.get(f"{column}_{theirs}", "") for ours, theirs in measured.items()},
        }
        for row in _these_ranks(printed)
        for recipe, column in columns.items()
    ]


def _obstacle(printed: list[Row]) -> list[Row]:
    """Table 1, and below it what is not printed: lambda = 10 from a start that reaches the contact with the upper bound."""
    measured = {"it": "nonlinear_it", "linear_it": "linear_it", "time_s": "cpu_s"}
    rows = [
        {
            **{name: row[name] for name in ("lambda", "n")},
            "side": f"{math.isqrt(int(row['n']))}",
            "v0": "1",
            **{ours: row[theirs] for ours, theirs in measured.items()},
        }
        for row in printed
    ]
    return [*rows, *({**rows[-1], "v0": v0, "it": "", "linear_it": "", "time_s": ""} for v0 in ("2", "3"))]


def _line_contact(printed: list[Row]) -> list[Row]:
    """Table 2, and below it what is not printed: ||H|| in flows instead of their divergence, and Jacobians kept for 3 steps."""
    rows = [{"n": row["n"], "rows": "divergence", "keep": "1", "eps1": "2e-7"} for row in printed]
    own = [{"n": row["n"], "rows": "flow", "keep": keep, "eps1": "1e-9"} for keep in "13" for row in printed]
    measured = [{"it": row["nonlinear_it"], "time_s": row["cpu_s"]} for row in printed]
    return [a | b for a, b in zip(rows + own, measured + len(own) * [{"it": "", "time_s": ""}], strict=True)]


ROWS: dict[str, Callable[[list[Row]], list[Row]]] = {
    "": list,
    "row_a_method": _row_a_method,
    "row_a_preconditioner": _row_a_preconditioner,
    "cimmino": _cimmino,
    "obstacle": _obstacle,
    "line_contact": _line_contact,
}


_TABLES = tomllib.loads(Path(__file__).with_name("tables.toml").read_text(encoding="utf-8"))
# The papers by the name that --paper takes: folder of the printed figures, and tables by number.
PAPERS: dict[str, tuple[str, dict[int, Spec]]] = {
    paper: (
        tables.pop("folder"),
        {int(number): Spec(**{**keys, "rows": ROWS[keys.get("rows", "")]}) for number, keys in tables.items()},
    )
    for paper, tables in _TABLES.items()
}
