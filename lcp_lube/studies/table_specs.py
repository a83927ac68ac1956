"""What is in the published tables: how each printed row is run, as data."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from ..base.resumable import Row
from ..errors import InputError


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
    printed, fitted : arguments for settings that the paper prints, and for others, fitted to its counts; None: it prints none
        that we depart from.
    note : said under the table.
    """

    title: str
    command: str
    rows: Callable[[list[Row]], list[Row]] = list
    points: tuple[int, ...] = ()
    quick: float = np.inf
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
    8: Spec("DIN with LAPACK's dense LU (problem 1)", f"solve problem1 --n {{n}} --recipe lu {_LOOSE}", quick=500),
    9: Spec(
        "DIN with sparse direct solvers (problem 1)",
        f"solve problem1 --n {{n}} --recipe {{solver}} {_LOOSE}",
        quick=100,
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


_ONES = "--set interior.s0=1"  # the printed start, v = s = z = 1; s2 = u - v = 3 fits the counts better

BERGAMASCHI = {
    1: Spec(
        "inexact interior point, BiCGStab with Jacobi (obstacle Bratu)",
        "solve obstacle_bratu --n {side} --set lambda={lambda} --set v0={v0} --method interior --recipe bcgs_jacobi",
        rows=_obstacle,
        quick=4096,
        system="jacobian",
        printed=_ONES,
        fitted="",
    ),
    2: Spec(
        "inexact interior point with LAPACK's LU of the dense Jacobian (elastohydrodynamic line contact)",
        "solve ehl_line --n {n} --method interior --set rows={rows} --set interior.keep={keep} --eps1 {eps1} --eps2 0.99",
        rows=_line_contact,
        system="jacobian",
    ),
    3: Spec(
        "Newton with block Cimmino, five orthogonal blocks of rows or more (4096 points)",
        "solve {problem} --n {side} --set {set} --method newton --recipe cimmino --set newton.eta=1e-5",
        rows=_cimmino,
        system="jacobian",
        printed="--set newton.relative=1e-4",
        fitted="--eps1 1e-9 --eps2 0.1",
    ),
    4: Spec(
        "inexact Newton with AINV and with Jacobi (Bratu, lambda = 1)",
        "solve bratu --n {side} --set lambda=1 --method newton --recipe {recipe} --set newton.eta=1e-3 --eps1 1e-9 --eps2 0.1",
        rows=_row_a_preconditioner,
        quick=4096,
        system="jacobian",
    ),
    5: Spec(
        "inexact interior point with AINV and with Jacobi (obstacle Bratu, lambda = 1)",
        "solve obstacle_bratu --n {side} --set lambda=1 --set v0=1 --method interior --recipe {recipe}",
        rows=_row_a_preconditioner,
        quick=4096,
        system="jacobian",
        printed=_ONES,
        fitted="",
    ),
}

# The papers by the name that --paper takes: folder of the printed figures, and tables by number.
PAPERS: dict[str, tuple[str, dict[int, Spec]]] = {
    "mezzadri": ("mezzadri_galligani_2018", MEZZADRI),
    "bergamaschi": ("bergamaschi_zilli", BERGAMASCHI),
}
