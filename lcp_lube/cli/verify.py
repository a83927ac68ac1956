"""`lcp-lube verify`: the known answers (`verify_cases`), ours beside them, and a verdict."""

import argparse
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from time import perf_counter
from typing import Any

import numpy as np

from ..api import solve
from ..base.options import check_unread
from ..base.progress import Line, Progress
from ..output.console import say
from ..output.results import finite
from ..output.table import table as rows_of
from ..scenes.scene import load_scene
from ..studies.verify_cases import CASES, DERIVED, QUICK, Case, Reference

ROUNDING = 1e-9  # relative error that no finer grid has to improve on


@dataclass(frozen=True)
class Row:
    """One quantity of one case: what each grid gave, coarse to fine; NaN where a solve failed."""

    quantity: str
    reference: Reference
    source: str
    grids: list[str]
    values: list[float]
    errors: list[float]
    order: float | None

    @property
    def fault(self) -> str:
        """What is wrong: the finest error beyond its bound, or the order, where one is asked for; else empty."""
        if not self.errors[-1] <= self.reference.tol:  # NaN is wrong too
            return f"{self.errors[-1]:.1e} > {self.reference.tol:.0e}"
        needed = self.reference.order
        if not needed or self.errors[-1] <= ROUNDING or self.steady or (self.order is not None and self.order >= needed):
            return ""
        return f"order {self.order:.2f}" if self.order is not None else "no order"

    @property
    def steady(self) -> bool:
        """Whether all grids give one value: the reference's own digits are what is left."""
        return bool(np.ptp(self.values) <= ROUNDING * abs(self.values[-1]))

    def as_dict(self) -> dict[str, Any]:
        known = {"reference": self.reference.value, "tol": self.reference.tol, "order_needed": self.reference.order or None}
        return {**asdict(self), **known, "ours": self.values[-1], "passed": not self.fault}


@dataclass(frozen=True)
class Verdict:
    """A case that was run."""

    case: Case
    rows: list[Row]
    failures: list[str]  # of solves
    seconds: float

    @property
    def passed(self) -> bool:
        return not self.failures and not any(row.fault for row in self.rows)

    def as_dict(self) -> dict[str, Any]:
        return {
            **{"case": self.case.name, "scene": self.case.scene, "data": self.case.data, "note": self.case.note},
            **{"passed": self.passed, "failures": self.failures, "time_s": self.seconds},
            "rows": [row.as_dict() for row in self.rows],
        }


def verify(cases: Sequence[Case] = CASES) -> list[Verdict]:
    """Run the cases. Collective."""
    with Line() as line:
        return [_run_case(case, line) for case in line.over(cases, lambda case: case.name)]


def quick_cases() -> list[Case]:
    """The one case of a short self-check."""
    return [case for case in CASES if case.name == QUICK]


def _run_case(case: Case, progress: Progress) -> Verdict:
    begin = perf_counter()
    found, spacings, grids, failures = [], [], [], []
    for grid in case.grids:
        scene = load_scene(case.scene, {**case.data, **grid})
        grids.append(" x ".join(map(str, scene.shape)))
        with solve(scene, **case.how, progress=progress) as solution:
            check_unread()
            values = solution.problem.quantities(solution.fields)
            found.append({**values, **DERIVED[case.derive](solution, values)} if solution.converged else {})
            spacings.append(float(np.max(solution.problem.grid.spacing)))
            if not solution.converged:
                failures.append(f"{grids[-1]}: {solution.outcome}, {solution.message}")
    rows = []
    for name, reference in case.references.items():
        ours = [float("nan" if (value := values.get(name)) is None else value) for values in found]
        errors = [abs(value / reference.value - 1.0) for value in ours]
        order = None
        if len(errors) > 1 and errors[0] > 0 and errors[-1] > 0:
            order = float(np.log(errors[0] / errors[-1]) / np.log(spacings[0] / spacings[-1]))
        rows.append(Row(name, reference, reference.source or case.source, grids, ours, errors, order))
    return Verdict(case, rows, failures, perf_counter() - begin)


def table(verdicts: Sequence[Verdict]) -> str:
    """Ours, reference, errors by grid, order and verdict, for people."""
    cells = [["quantity", "ours", "reference", "relative error by grid", "order (needed)", "verdict"]]
    for row in (row for verdict in verdicts for row in verdict.rows):
        order = "-" if row.order is None or row.errors[-1] <= ROUNDING or row.steady else f"{row.order:.2f}"
        needed = f"({row.reference.order:g})" if row.reference.order else ""
        numbers = (f"{row.values[-1]:.9g}", f"{row.reference.value:.9g}", " ".join(f"{error:8.1e}" for error in row.errors))
        verdict_word = f"FAIL: {row.fault}" if row.fault else "ok"
        cells.append([f"  {row.quantity}", *numbers, f"{order:>5} {needed}", verdict_word])
    head, *told = rows_of(cells, align="<>><<<", least=[33, 15, 15, 26])
    printed, lines = iter(told), [head]
    for verdict in verdicts:
        case, grids = verdict.case, ", ".join(verdict.rows[0].grids)
        data = "".join(f", {key} = {value}" for key, value in case.data.items())
        lines += ["", f"{case.name} ({case.scene}{data}; {grids}): {case.source}"]
        lines += [f"  {failure}" for failure in verdict.failures]
        lines += [next(printed) for _ in verdict.rows]
        if case.note:
            lines.append(f"  ({case.note})")
    good = sum(verdict.passed for verdict in verdicts)
    seconds = sum(verdict.seconds for verdict in verdicts)
    return "\n".join([*lines, "", f"{good} of {len(verdicts)} cases pass, {seconds:.1f} s"])


def run(args: argparse.Namespace) -> int:
    """The command; exit status 1 if a case fails. Collective."""
    verdicts = verify(quick_cases() if args.quick else CASES)
    passed = all(verdict.passed for verdict in verdicts)
    record = {"passed": passed, "cases": [verdict.as_dict() for verdict in verdicts]}
    say(json.dumps(finite(record)) if args.json else table(verdicts))
    return 0 if passed else 1
