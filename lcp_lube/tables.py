"""The published tables, run again: a printed row becomes a command line, its numbers stand beside the printed ones."""

import math
import re
import shlex
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from mpi4py import MPI

from .arguments import parse
from .cli import say, solution_of
from .errors import InputError
from .linear.options import LATE, set_names
from .output.results import as_dict, machine
from .output.resumable import ResumableCsv, Row
from .problems.solution import Solution
from .registry import PACKAGE

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


@dataclass(frozen=True)
class Spec:
    """How a printed table is run.

    Attributes
    ----------
    title : what the table shows.
    command : a row's arguments of `lcp-lube`, with the printed columns that fill it in braces.
    rows : makes one row a run of the printed csv.
    points : numbers i of the points x_i = i dx (1D) whose pressure, in the problem's unit, is printed as p_i.
    quick : --quick leaves rows with a larger n out.
    system : the matrix that the inner solver sees.
    note : said under the table.
    """

    title: str
    command: str
    rows: Callable[[list[Row]], list[Row]] = list
    points: tuple[int, ...] = ()
    quick: float = np.inf
    system: str = "full"
    note: str = "benchmarks/README.md explains what differs."


def _row_a_method(printed: list[Row]) -> list[Row]:
    """Table 7 turned: a row a method, a column p_i a point."""
    columns = [name for name in printed[0] if name.startswith("p_")]
    return [
        {"method": column.removeprefix("p_").replace("_", "-"), **{f"p_{row['i']}": row[column] for row in printed}}
        for column in columns
    ]


_LOOSE = "--method din --eps1 1e-4 --eps2 1e-4"

MEZZADRI = {
    2: Spec("DIN, direct solver, n = 100", "solve problem{problem} --film {film} --method din --recipe lu"),
    3: Spec(
        "DIN with GMRES: no preconditioner, no restart (problem 1)",
        "solve problem1 --n {n} --method din --recipe gmres --set din.tol_min=1e-12",
        quick=100,
    ),
    4: Spec(
        "the conditions on the step length taken apart, n = 100",
        "solve problem{problem} --method din --conditions {conditions} --recipe lu",
    ),
    5: Spec(
        "starting vectors and mu, n = 100", "solve problem{problem} --method din --p0 {p0} --r0 {r0} --mu {mu} --recipe lu"
    ),
    6: Spec("DIN and Fischer-Burmeister Newton, n = 100", "solve problem{problem} --method {method} --recipe lu"),
    7: Spec(
        "p in MPa at points of the cavity (problem 1, n = 100)",
        "solve problem1 --method {method} --recipe lu",
        rows=_row_a_method,
        points=(70, 71, 72, 73, 74, 75),
    ),
    8: Spec("DIN with LAPACK's dense LU (problem 1)", f"solve problem1 --n {{n}} --recipe lu {_LOOSE}"),
    9: Spec(
        "DIN with sparse direct solvers (problem 1)",
        f"solve problem1 --n {{n}} --recipe {{solver}} {_LOOSE}",
        quick=1000,
    ),
    10: Spec("DIN with ILU(0) (problem 1)", f"solve problem1 --n {{n}} --recipe {{solver}} {_LOOSE}", quick=1000),
    11: Spec(
        "DIN on the square, n x n (problem 4)",
        f"solve problem4 --n {{n}} --recipe {{solver}} {_LOOSE}",
        quick=50,
        note="The paper's text does not determine problem 4, and no reading of it gives both counts: benchmarks/README.md.",
    ),
}


def _these_ranks(printed: list[Row]) -> list[Row]:
    """The rows that were printed for as many processors p as this run has ranks; n points are `side` x `side`."""
    ranks = MPI.COMM_WORLD.size
    rows = [{**row, "side": f"{math.isqrt(int(row['n']))}"} for row in printed if int(row["p"]) == ranks]
    if not rows:
        known = ", ".join(sorted({row["p"] for row in printed}, key=int))
        raise InputError(f"this table is printed for {known} processors: run it on as many ranks, not on {ranks}")
    return rows


def _cimmino(printed: list[Row]) -> list[Row]:
    """Table 3. Bratu's count is that of the first Newton step; for the other problem it is taken for the sum."""
    settings = {"bratu": "lambda=5", "poisson_cubic": "peak=0.0625"}
    return [
        {
            **{name: row[name] for name in ("problem", "n", "p", "side")},
            "set": settings[row["problem"]],
            "it": row["newton_it"],
            "first_it": row["cg_it"] if row["problem"] == "bratu" else "",
            "linear_it": row["cg_it"] if row["problem"] != "bratu" else "",
            "time_s": row["time_s"],
        }
        for row in _these_ranks(printed)
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


BERGAMASCHI = {
    1: Spec(
        "inexact interior point, BiCGStab with Jacobi (obstacle Bratu)",
        "solve obstacle_bratu --n {side} --set lambda={lambda} --set v0={v0} --method interior --recipe bcgs_jacobi",
        rows=_obstacle,
        system="jacobian",
    ),
    2: Spec(
        "inexact interior point with LAPACK's LU of the dense Jacobian (elastohydrodynamic line contact)",
        "solve ehl_line --n {n} --method interior --set rows={rows} --set interior.keep={keep} --eps1 {eps1} --eps2 0.99",
        rows=_line_contact,
        system="jacobian",
    ),
    3: Spec(
        "Newton with block Cimmino, five orthogonal blocks of rows or more (4096 points)",
        "solve {problem} --n {side} --set {set} --recipe cimmino --set newton.eta=1e-5 --eps1 1e-9 --eps2 0.1",
        rows=_cimmino,
        system="jacobian",
    ),
    4: Spec(
        "inexact Newton with AINV and with Jacobi (Bratu, lambda = 1)",
        "solve bratu --n {side} --set lambda=1 --recipe {recipe} --set newton.eta=1e-3 --eps1 1e-9 --eps2 0.1",
        rows=_row_a_preconditioner,
        quick=4096,
        system="jacobian",
    ),
    5: Spec(
        "inexact interior point with AINV and with Jacobi (obstacle Bratu, lambda = 1)",
        "solve obstacle_bratu --n {side} --set lambda=1 --set v0=1 --method interior --recipe {recipe}",
        rows=_row_a_preconditioner,
        quick=16384,
        system="jacobian",
    ),
}

# The papers by the name that --paper takes: folder of the printed figures, and tables by number.
PAPERS: dict[str, tuple[str, dict[int, Spec]]] = {
    "mezzadri": ("mezzadri_galligani_2018", MEZZADRI),
    "bergamaschi": ("bergamaschi_zilli", BERGAMASCHI),
}


def find_table(paper: str, number: int) -> tuple[Spec, list[Row]]:
    """A table's spec and its printed rows.

    Raises
    ------
    InputError : no such table, or its printed figures cannot be read.
    """
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


def row_command(spec: Spec, printed: Row) -> str:
    """The command line that runs a printed row; names of methods are in lower case here."""
    return f"lcp-lube {spec.command} --system {spec.system} --no-nested".format(
        **{**printed, "method": printed.get("method", "").lower()}
    )


def run_published_table(paper: str, number: int, quick: bool = False, results: Path = Path("lcp_lube_results")) -> int:
    """Run a table and print each row beside the printed one; `=` marks a match, `!=` a difference. Collective.

    The runs are kept in `results` as a csv; a run that is there already, whatever its outcome, is not made again.

    Returns
    -------
    int : exit status, 0 if every row ran; a failed run is a row, a run that its recipe or method refuses is not.

    Raises
    ------
    InputError : no such table; a csv that cannot be read or written; PETSc options that would change the runs.
    """
    spec, rows = find_table(paper, number)
    foreign = sorted(set_names() - LATE)
    if foreign:
        raise InputError(f"-{foreign[0]}: the rows of a published table bring their own inner solvers")
    runs = [row for row in rows if not (quick and float(row.get("n", 0)) > spec.quick)]
    store = ResumableCsv(
        results / f"{paper}_table{number}.csv",
        [*KEY, *(f"p_{i}" for i in spec.points), *RECORD],
        KEY,
    )
    layout = _Layout(rows)
    seconds = "; seconds of the processor (printed ones in brackets)" if "time_s" in layout.measured else ""
    say(f"{paper} table {number}: {spec.title}. ours = printed where they match, ours != printed where they differ{seconds}.")
    say(layout.head())
    known = refused = 0
    for printed in runs:
        command = row_command(spec, printed)
        record = store.find(command=command, ranks=store.comm.size)
        known += record is not None
        if record is None:
            values = {"command": command, "ranks": store.comm.size, **run_command(command, spec.points)}
            if values["outcome"] == "refused":
                refused += 1
                say(f"{layout.name(printed)}refused: {values['message']}")
                continue
            record = store.add(values)
        say(layout.line(printed, record))
    say(layout.summary())
    left = f", {len(rows) - len(runs)} left out by --quick" if len(rows) > len(runs) else ""
    say(f"{len(runs)} rows, {known} of them already in {store.path} (remove it to run them again){left}. {spec.note}")
    return 1 if refused else 0


def run_command(command: str, points: tuple[int, ...] = ()) -> dict[str, Any]:
    """Run a `lcp-lube solve` command line and record it, however it ends. Collective.

    Returns
    -------
    dict : the columns RECORD, and p_i in the problem's unit for the points asked for; outcome 'refused' and a message
    alone where the run could not start.
    """
    begin = process_time()
    try:
        solution = solution_of(parse(shlex.split(command)[1:]))
    except InputError as error:
        return {"outcome": "refused", "message": str(error)}
    cpu_s = process_time() - begin
    try:
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
    finally:
        solution.destroy()


def _pressure(solution: Solution, i: int) -> float:
    """p at x_i = i dx in the problem's unit, on every rank. Collective."""
    grid = solution.problem.grid
    here = np.arange(grid.x_start, grid.x_end) + 1 == i
    return grid.reduce.sum(np.where(here, solution.p, 0.0))


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
        return "  ".join([f"{n:<{self.widths[n]}}" for n in self.names] + [f"{n:^{self._width(n)}}" for n in self.measured])

    def name(self, printed: Row) -> str:
        return "".join(f"{printed[n]:<{self.widths[n]}}  " for n in self.names)

    def line(self, printed: Row, record: Row) -> str:
        cells = [self._cell(n, printed[n], _ours(n, record)) for n in self.measured]
        outcome = "" if record["outcome"] == "converged" else f"  {record['outcome']}"
        return self.name(printed) + "  ".join(cells) + outcome

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
