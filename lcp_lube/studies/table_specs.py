"""What is in the published tables (tables.toml): how each printed row is run, and which runs it stands for."""

import math
import tomllib
from collections.abc import Mapping, Sequence
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
    transposed: bool = False
    runs: Sequence[Mapping[str, str]] = ()
    more: Sequence[Row] = ()
    points: Sequence[int] = ()
    quick: float = math.inf
    system: str = "full"
    printed: str = ""
    fitted: str | None = None
    note: str = "benchmarks/README.md explains what differs."

    def rows(self, printed: list[Row]) -> list[Row]:
        """The rows to run, from the printed ones; of a table for several numbers of processors those of this run's ranks.

        Raises
        ------
        InputError : a table without rows for as many processors as there are ranks.
        """
        if self.transposed:
            return _row_a_method(printed)
        rows, ranks = printed, MPI.COMM_WORLD.size
        if "p" in printed[0]:
            rows = [row for row in printed if int(row["p"]) == ranks]
            if not rows:
                known = ", ".join(sorted({row["p"] for row in printed}, key=int))
                raise InputError(f"this table is printed for {known} processors: run it on as many ranks, not on {ranks}")
        if not self.runs:
            return rows
        made = [
            {name: text.format(**row, side=math.isqrt(int(row["n"]))) for name, text in run.items()}
            for row in rows
            for run in self.runs
            if run.get("problem", row.get("problem")) == row.get("problem")
        ]
        return [*made, *self.more]


def _row_a_method(printed: list[Row]) -> list[Row]:
    """Table 7, which has a row a point and a column a method, as a row a method and a column p_i a point."""
    columns = [name for name in printed[0] if name.startswith("p_")]
    return [
        {"method": column.removeprefix("p_").replace("_", "-"), **{f"p_{row['i']}": row[column] for row in printed}}
        for column in columns
    ]


_TABLES = tomllib.loads(Path(__file__).with_name("tables.toml").read_text(encoding="utf-8"))
# The papers by the name that --paper takes: folder of the printed figures, and tables by number.
PAPERS: dict[str, tuple[str, dict[int, Spec]]] = {
    paper: (tables.pop("folder"), {int(number): Spec(**keys) for number, keys in tables.items()})
    for paper, tables in _TABLES.items()
}
