"""The published tables, run again: a printed row becomes a command line, its numbers stand beside the printed ones."""

import re
import shlex
from collections.abc import Sequence
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from ..base.progress import Line, Progress
from ..base.resumable import ResumableCsv, Row
from ..cli.arguments import parse
from ..cli.asked import solution_of
from ..errors import InputError
from ..output.console import say
from ..output.results import as_dict, machine
from ..output.table import line
from ..problems.solution import Solution
from ..registry import PACKAGE
from .experiment import refuse_options
from .table_specs import PAPERS, Spec

# A wheel carries the printed tables inside the package; in a checkout they stand with the benchmarks.
PUBLISHED = next((d for d in (PACKAGE / "published", PACKAGE.parent / "benchmarks" / "published") if d.is_dir()), PACKAGE)

KEY = ("command", "ranks")
RECORD = """outcome iterations backtracking centrality linear_iterations first_linear c1 c2 min_p min_r residual complementarity
    mass_defect cpu_s time_s linear_s machine petsc message""".split()  # noqa: SIM905

# A printed column and the column of our record that it is compared with; other columns only name the row.
MEASURED = {
    "it": "iterations",
    "back": "backtracking",
    "cent": "centrality",
    "linear_it": "linear_iterations",
    "first_it": "first_linear",  # linear iterations of the first outer step
    "gmres": "linear_iterations",
    "c1": "c1",
    "c2": "c2",
    "wrong_solution": "outcome",
    "time_s": "cpu_s",
}


def find_table(paper: str, number: int) -> tuple[Spec, list[Row]]:
    """A table's spec and its printed rows; InputError where there is no such table, or its figures cannot be read."""
    folder, tables = PAPERS[paper]
    if number not in tables:
        known = ", ".join(map(str, tables)) or "none"
        raise InputError(f"table {number}: allowed for --paper {paper} are {known}")
    path = PUBLISHED / folder / f"table{number}.csv"
    try:
        lines = path.read_text(encoding="utf-8").split()
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}") from None
    names, *rows = (line.split(",") for line in lines)
    spec = tables[number]
    return spec, spec.rows([dict(zip(names, row, strict=True)) for row in rows])


def row_command(spec: Spec, printed: Row, fitted: bool = False) -> str:
    """The command line that runs a printed row; names of methods are in lower case here."""
    settings = (spec.fitted or "") if fitted else spec.printed
    return f"lcp-lube {' '.join([spec.command, settings]).strip()} --system {spec.system} --no-nested".format(
        **{**printed, "method": printed.get("method", "").lower()}
    )


def run_published_table(
    paper: str, number: int, *, results: Path, quick: bool = False, fitted: bool = False, stored: bool = False
) -> int:
    """Run a table and print each row beside the printed one; `=` marks a match, `!=` a difference. Collective.

    The runs are kept in `results` as a csv. A run that is there already, whatever its outcome, is not made again if this very
    code made it (`base.origin.code`); what other code made is run again. A row that was not made now says so and when it was.

    Parameters
    ----------
    quick : leave the long rows out.
    fitted : take the settings that are fitted to the paper's counts in place of those that it prints.
    stored : run nothing: print the rows that are there, whatever code made them.

    Returns
    -------
    int : exit status, 0 if every row ran; a failed run is a row, a run that its recipe or method refuses is not. With
    `stored`, 0 if every row was there.
    """
    spec, rows = find_table(paper, number)
    if fitted and spec.fitted is None:
        raise InputError(f"--fitted: table {number} of --paper {paper} is run with one set of settings only")
    refuse_options("the rows of a published table")
    runs = [row for row in rows if not (quick and float(row.get("n", 0)) > spec.quick)]
    columns = [*KEY, *(f"p_{i}" for i in spec.points), *RECORD]
    store = ResumableCsv(results / f"{paper}_table{number}.csv", columns, KEY, signed=True)
    layout = _Layout(rows)
    seconds = "; seconds of the processor (printed ones in brackets)" if "time_s" in layout.measured else ""
    settings = f" Settings {'fitted, not printed' if fitted else 'as printed'}." if spec.fitted is not None else ""
    say(
        f"{paper} table {number}: {spec.title}.{settings} "
        f"ours = printed where they match, ours != printed where they differ{seconds}."
    )
    say(layout.head())
    kept = stale = absent = refused = 0

    def find(printed: Row) -> Row | None:
        return store.find(command=row_command(spec, printed, fitted), ranks=store.comm.size)

    def stands(printed: Row) -> bool:
        return stored or ((row := find(printed)) is not None and store.current(row))

    line = Line()
    for printed in line.over(runs, lambda _: "row", stands):
        command, record = row_command(spec, printed, fitted), find(printed)
        if stored and record is None:
            absent += 1
            say(layout.name(printed, "not run"))
            continue
        if record is not None and not stored and not store.current(record):
            stale, record = stale + 1, None
        kept += record is not None
        if record is None:
            values = {"command": command, "ranks": store.comm.size, **run_command(command, spec.points, line)}
            if values["outcome"] == "refused":
                refused += 1
                say(layout.name(printed, f"refused: {values['message']}"))
                continue
            record = store.add(values)
        age = store.age(record)
        say(layout.line(printed, record) + (f"  [{age}]" if age else ""))
    line.end()
    say(layout.summary())
    left = f", {len(rows) - len(runs)} left out by --quick" if len(rows) > len(runs) else ""
    again = f", {stale} run again that other code had made" if stale else ""
    how = "printed as stored" if stored else "kept from a run of this very code"
    say(f"{len(runs)} rows, {kept} of them {how}{again}{left}; all are in {store.path}. {spec.note}")
    return 1 if refused or absent else 0


def run_command(command: str, points: Sequence[int] = (), progress: Progress | None = None) -> dict[str, Any]:
    """Run a `lcp-lube solve` command line: the columns RECORD, and p_i in the problem's unit for the points asked for; outcome
    'refused' and a message alone where the run could not start. Collective."""
    begin = process_time()
    try:
        solution = solution_of(parse(shlex.split(command)[1:]), progress=progress)
    except InputError as error:
        return {"outcome": "refused", "message": str(error)}
    cpu_s = process_time() - begin
    with solution:
        data = as_dict(solution)
        times = data.pop("time_s")
        return {
            **data,
            "cpu_s": f"{cpu_s:.4f}",
            "time_s": f"{times['total']:.4f}",
            "linear_s": f"{times['linear']:.4f}",
            "first_linear": solution.steps[0].linear_iterations if solution.steps else None,
            "machine": machine(),
            "petsc": data["versions"]["petsc"],
            **{f"p_{i}": _pressure(solution, i) for i in points},
        }


def _pressure(solution: Solution, i: int) -> float:
    """p at x_i = i dx in the problem's unit, on every rank. Collective."""
    grid = solution.problem.grid
    here = np.arange(grid.x_start, grid.x_end) + 1 == i
    return grid.reduce.sum(np.where(here, solution.fields["p"], 0.0))


class _Layout:
    """Columns wide enough for the printed rows, and the count of matches."""

    def __init__(self, rows: list[Row]):
        self.measured = [name for name in rows[0] if name in MEASURED or re.fullmatch(r"p_\d+", name)]
        self.names = [name for name in rows[0] if name not in self.measured]
        self.widths = {name: max(len(name), *(len(_rounded(row[name], row[name])) for row in rows)) for name in rows[0]}
        self.matches = {name: [0, 0] for name in self.measured if name != "time_s"}

    def _width(self, name: str) -> int:
        return 2 * max(self.widths[name], 5) + 4

    def head(self) -> str:
        return self._row(self.names, self.measured, "^")

    def name(self, printed: Row, said: str) -> str:
        """A row that has no numbers, and why."""
        return self._row([printed[n] for n in self.names], [said], "<")

    def _row(self, names: Sequence[str], cells: Sequence[str], side: str) -> str:
        widths = [*(self.widths[n] for n in self.names), *map(self._width, self.measured)]
        return line([*names, *cells], widths, "<" * len(names) + side * len(cells))

    def line(self, printed: Row, record: Row) -> str:
        cells = [self._cell(n, printed[n], _ours(n, record)) for n in self.measured]
        outcome = "" if record["outcome"] == "converged" else f"  {record['outcome']}"
        return self._row([printed[n] for n in self.names], cells, "<") + outcome

    def _cell(self, name: str, printed: str, ours: str) -> str:
        ours = _rounded(ours, printed)
        mark = "  "
        if name == "time_s":
            mark, printed = " (", f"{printed})"
        elif printed:
            equal = matches(ours, printed)
            self.matches[name][0] += equal
            self.matches[name][1] += 1
            mark = " =" if equal else "!="
        half = (self._width(name) - 4) // 2
        return f"{ours:>{half}} {mark} {_rounded(printed, printed):<{half}}"

    def summary(self) -> str:
        return "match: " + ", ".join(f"{name} {same} of {of}" for name, (same, of) in self.matches.items())


def _ours(name: str, record: Row) -> str:
    """Our value of a printed column, in the paper's words."""
    value = record[MEASURED.get(name, name)]
    if name == "wrong_solution":
        return "yes" if value == "wrong_solution" else "no"
    if name == "it":
        return {"max_iterations": "maxit", "step_length": "fail"}.get(record["outcome"], value)
    return value


def _rounded(value: str, printed: str) -> str:
    """A number with as many digits as the printed one has; anything else as it is."""
    digits = re.fullmatch(r"-?\d\.(\d+)e-?\d+", printed)
    if digits and value:
        return f"{float(value):.{len(digits[1])}e}"
    seconds = re.fullmatch(r"\d+\.\d+", printed)
    return f"{float(value):.2f}" if seconds and value else value


def matches(ours: str, printed: str) -> bool:
    """Whether a number of ours is the printed one, to the digits that are printed."""
    return _rounded(ours, printed) == _rounded(printed, printed)
