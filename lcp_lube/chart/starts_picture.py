"""Pictures of DIN's starts, and what they show in a sentence, from the rows of the csv alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..output.resumable import Row
from ..problems.solution import Outcome

if TYPE_CHECKING:
    pass

# A marker for each way to fail.
FAILURES = {
    Outcome.MAX_ITERATIONS: ("x", "500 iterations"),
    Outcome.STEP_LENGTH: ("_", "no step length"),
    Outcome.WRONG_SOLUTION: ("o", "wrong solution"),
    Outcome.LINEAR_SOLVER: ("+", "linear solver"),
    Outcome.NOT_FINITE: ("*", "not finite"),
}


def _decade(value: str) -> int:
    return round(math.log10(float(value)))


def _unique(rows: Sequence[Row], name: str) -> list[str]:
    return list(dict.fromkeys(row[name] for row in rows))


def findings(rows: Sequence[Row]) -> str:
    """What the rows show: per rule and inner solver how many starts fail, where, and how the failed runs ended."""
    return " ".join(_finding([row for row in rows if row["mu"] == mu], mu) for mu in _unique(rows, "mu"))


def _finding(rows: Sequence[Row], mu: str) -> str:
    failed = [row for row in rows if row["outcome"] != Outcome.CONVERGED]
    if not failed:
        most = max(int(row["iterations"]) for row in rows)
        return f"{mu} converges from all {len(rows)} starts, in {most} iterations at most."
    where = []
    for recipe in _unique(failed, "recipe"):
        largest = max(min(_decade(row["p0"]), _decade(row["r0"])) for row in failed if row["recipe"] == recipe)
        where.append(f"1e{largest} ({recipe})")
    tiny = sum(float(row["c2"] or "nan") < 1e-8 for row in failed)
    return (
        f"{mu} fails from {len(failed)} of {len(rows)} starts, all with min(p0, r0) <= {' or '.join(where)}: {tiny} of them "
        f"creep, their last ||alpha d|| below 1e-8 with ||F|| still above it."
    )
