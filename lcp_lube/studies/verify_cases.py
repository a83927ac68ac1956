"""What is known exactly, or was computed by others (verify_cases.toml), and what an answer is asked beside its quantities."""

import math
import tomllib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..problems.solution import Solution

Values = dict[str, Any]
QUICK = "problem 2"  # of all cases the one with rupture and reformation that costs least


@dataclass(frozen=True)
class Reference:
    """A known value.

    tol : relative error allowed on the finest grid. order : that the error must fall with, between the first grid and the last;
    0 where theory gives none, see `Case.note`.
    """

    value: float
    tol: float
    order: float = 0.0
    source: str = ""  # where it is another one than the case's


@dataclass(frozen=True)
class Case:
    """A scene with known answers.

    scene, data : built-in name and changes. grids : changes that make it finer, coarse to fine.
    derive : one of DERIVED, for quantities that `Problem.quantities` does not have. note : on the orders that are asked for.
    how : options of `solve`, where the default's tolerance is looser than the reference's digits.
    """

    name: str
    scene: str
    source: str
    references: dict[str, Reference]
    data: dict[str, Any] = field(default_factory=dict)
    grids: tuple[dict[str, Any], ...] = ({"n": 99}, {"n": 399}, {"n": 1599})
    derive: str = ""
    note: str = ""
    how: dict[str, Any] = field(default_factory=dict)


def _film_ends(solution: Solution, values: Values) -> Values:
    """Lengths over L, flow, and what the flow says of the void where it is not sampled. Collective."""
    problem: Any = solution.problem
    L = problem.grid.lengths[0]
    west, east, *_ = problem.boundary_flows(solution.fields["p"], solution.fields["r"])
    out = {"Q": west, "iterations": solution.iterations, "x_max/L": values["p_max_at"][0] / L}
    out["x_max_deg"] = 360.0 * out["x_max/L"]
    if values["rupture"] is not None:
        at = [np.array([x]) for x in (values["rupture"] + 1e-9 * L, L)]
        behind, outlet = (float(problem.film(x, np.zeros(1))[0]) for x in at)
        out |= {"rupture/L": values["rupture"] / L, "rupture_deg": 360.0 * values["rupture"] / L}
        # In the cavity r = 1 - Q/(U h).
        out |= {"void_behind_rupture": 1.0 - west / (problem.U * behind), "content_at_outlet": east / (problem.U * outlet)}
    out["P_max"] = values["p_max"] / values["p_unit"]
    return out


def _pocket_start(solution: Solution, values: Values) -> Values:
    """Pressure at x = 2 mm, which is a point of these grids. Collective."""
    problem: Any = solution.problem
    grid = problem.grid
    here = (np.abs(grid.x[0] - 2e-3) < 0.5 * grid.spacing[0]).astype(float)
    return {
        **_film_ends(solution, values),
        "p_at_pocket": problem.reduce.dot(solution.fields["p"], here) * problem.p_unit + problem.p_c,
    }


def _void(solution: Solution, values: Values) -> Values:
    """Force of p - p_ambient by cells, number of points in the cavity, largest void fraction. Collective."""
    problem: Any = solution.problem
    above = solution.fields["p"] * problem.p_unit + problem.p_c - values["p_ambient"]
    return {
        "force": problem.reduce.sum(above) * problem.grid.cell,
        "cavitated_points": values["cavitated_fraction"] * problem.grid.size,
        "r_max": problem.reduce.max(solution.fields["r"]),
        "P_max": values["p_max"] / values["p_unit"],
    }


def _contact(solution: Solution, values: Values) -> Values:
    """Contact radius a from the force between membrane and ball, the sum of -Lap v: v = A log(r) + B outside, and the ball's
    slope at a is A/a, so A = -a^2/sqrt(1 - a^2). Collective."""
    problem: Any = solution.problem
    grid = problem.grid
    v = grid.ghosted(solution.fields["v"], outside=0.0)
    pull = 4.0 * v[1:-1, 1:-1] - v[:-2, 1:-1] - v[2:, 1:-1] - v[1:-1, :-2] - v[1:-1, 2:]
    A2 = (problem.reduce.sum(np.where(np.hypot(grid.x, grid.y) < 1.5, pull, 0.0)) / (2.0 * math.pi)) ** 2
    return {"contact_radius": math.sqrt(0.5 * (math.sqrt(A2 * A2 + 4.0 * A2) - A2))}


def _other_code(solution: Solution, values: Values) -> Values:
    """Names that stand beside those of another source."""
    return {f"{name}, other code": value for name, value in (values | _void(solution, values)).items()}


DERIVED: dict[str, Callable[[Solution, Values], Values]] = {
    "": lambda solution, values: {},
    "ends": _film_ends,
    "pocket": _pocket_start,
    "void": _void,
    "contact": _contact,
    "other_code": _other_code,
}


def _read() -> tuple[Case, ...]:
    cases = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))["case"]
    known = [{name: Reference(*row) for name, row in case.pop("known").items()} for case in cases]
    return tuple(Case(references=references, **case) for case, references in zip(cases, known, strict=True))


CASES = _read()
