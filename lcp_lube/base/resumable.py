"""A csv that a long experiment fills row by row, and takes up again where it was left."""

import csv
import io
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from mpi4py import MPI

from ..errors import InputError
from . import origin
from .files import write_text
from .together import on_all_ranks

Row = dict[str, str]


class ResumableCsv:
    """Rows that are in the file already need not be run again.

    Rank 0 reads and writes, the other ranks receive the rows. The file is replaced whole after each row, so that it is
    never half-written.

    Parameters
    ----------
    path : the csv; it and its folder are made with the first row.
    columns : names of all columns; a row leaves some of them out, they stay empty.
    key : the columns that tell one row from another.
    comm : the ranks that work together; every method but `find` is collective.
    growing : columns that the file has, and those that new rows bring, are added to `columns`.
    signed : rows carry the columns `origin.COLUMNS`: the code that made them, the date, a digest of code and key. Collective
        callers compare `current`, and print `age` beside what they did not make.

    Raises
    ------
    InputError : the file cannot be read, or is no csv with these keys; by the methods that write, it cannot be written.
    """

    def __init__(
        self,
        path: Path,
        columns: Sequence[str],
        key: Sequence[str],
        comm: MPI.Comm = MPI.COMM_WORLD,
        growing: bool = False,
        signed: bool = False,
    ):
        columns = [*columns, *(name for name in origin.COLUMNS if name not in columns)] if signed else columns
        self.path, self.columns, self.key, self.comm, self.growing = path, list(columns), list(key), comm, growing
        self.signed = signed
        self._made: list[Row] = []  # by this process
        self.rows: list[Row] = self._on_rank_0(self._read)
        self._grow(name for row in self.rows[:1] for name in row)
        self._read_before = (list(self.columns), list(self.rows))

    def find(self, **key: object) -> Row | None:
        """The row with these keys, its values as text."""
        wanted = [str(key[name]) for name in self.key]
        return next((row for row in self.rows if [row[name] for name in self.key] == wanted), None)

    def row(self, key: dict[str, Any], make: Callable[[], dict[str, Any]]) -> Row:
        """The row with this key, made and written now where it is not there; raises InputError as `add` does."""
        return self.find(**key) or self.add({**make(), **key})

    @property
    def said(self) -> str:
        """How many rows were made now."""
        return f"{len(self._made)} of them new; the others stood in {self.path} (remove it to run them again)."

    def current(self, row: Row) -> bool:
        """Whether this very code made the row (of a signed csv), by the command that its key names."""
        return row["digest"] == origin.signature([row[name] for name in self.key])["digest"]

    def age(self, row: Row) -> str:
        """By what and when a row of a signed csv was made; empty if by this process."""
        return "" if row in self._made else origin.told(row)

    def ages(self) -> str:
        """How many rows of a signed csv were made by what and when, for scripts that print them as they are stored."""
        counts = Counter(self.age(row) or "made now" for row in self.rows)
        return "; ".join(f"{count} rows {age}" for age, count in counts.items()) or "no rows"

    def add(self, values: dict[str, Any]) -> Row:
        """Write a row, in the place of the one with the same keys if there is one; returns it as text."""
        row = self._take(values)
        self.write()
        return row

    def again(self, made: Iterable[dict[str, Any]]) -> None:
        """Write the file as if it had been filled in this order."""
        self.columns, self.rows, self._made = list(self._read_before[0]), list(self._read_before[1]), []
        for values in made:
            self._take(values)
        self.write()

    def _take(self, values: dict[str, Any]) -> Row:
        """The row as text, in its place in memory."""
        if self.signed:
            values = {**values, **origin.signature([str(values[name]) for name in self.key])}
        self._grow(values)
        row = {name: "" if values.get(name) is None else str(values[name]) for name in self.columns}
        row = self.comm.bcast(row)  # seconds differ from rank to rank
        old = self.find(**{name: row[name] for name in self.key})
        if old is None:
            self.rows.append(row)
        else:
            self.rows[self.rows.index(old)] = row
        self._made.append(row)
        return row

    def write(self) -> None:
        """Replace the file; to be called before a long run, to hear whether it can be written."""
        self._on_rank_0(lambda: self.path.parent.mkdir(parents=True, exist_ok=True))
        text = io.StringIO()
        writer = csv.DictWriter(text, self.columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows(self.rows)
        write_text(self.path, text.getvalue(), self.comm)

    def _read(self) -> list[Row]:
        if not self.path.exists():
            return []
        if not self.path.is_file():
            raise InputError(f"{self.path}: is no ordinary file")  # a device would be replaced
        with self.path.open(newline="", encoding="utf-8") as file:
            reader = csv.DictReader(file, restval="")
            missing = set(self.key) - set(reader.fieldnames or ())
            if missing:
                raise InputError(f"{self.path}: no csv of this experiment, it has no column {min(missing)}; move it away")
            names = dict.fromkeys([*self.columns, *(reader.fieldnames or ())]) if self.growing else self.columns
            return [{name: row.get(name) or "" for name in names} for row in reader]

    def _grow(self, names: Iterable[str]) -> None:
        if self.growing:
            self.columns += [name for name in names if name not in self.columns]

    def _on_rank_0(self, call: Callable[[], Any]) -> Any:
        """The call's result on every rank; its failure too, as an InputError."""
        result = None
        with on_all_ranks(self.comm):
            if self.comm.rank == 0:
                try:
                    result = call()
                except (OSError, UnicodeDecodeError, csv.Error) as error:
                    raise InputError(f"{self.path}: {getattr(error, 'strerror', None) or error}") from None
        return self.comm.bcast(result)
