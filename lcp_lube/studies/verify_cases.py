"""What is known exactly, or was computed by others: scenes, grids, reference values and where each of them comes from."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..problems.solution import Solution

Values = dict[str, Any]


@dataclass(frozen=True)
class Reference:
    """A known value.

    tol : relative error allowed on the finest grid. order : that the error must fall with, between the first grid and the last;
    None where theory gives none, see `Case.note`.
    """

    value: float
    tol: float
    order: float | None = None
    source: str = ""  # where it is another one than the case's


@dataclass(frozen=True)
class Case:
    """A scene with known answers.

    scene, data : built-in name and changes. grids : changes that make it finer, coarse to fine; n gives the spacing.
    derive : quantities of the solution that `Problem.quantities` does not have. note : on the orders that are asked for.
    how : options of `solve`, where the default's tolerance is looser than the reference's digits.
    """

    name: str
    scene: str
    source: str
    references: dict[str, Reference]
    data: dict[str, Any] = field(default_factory=dict)
    grids: tuple[dict[str, Any], ...] = ({"n": 99}, {"n": 399}, {"n": 1599})
    derive: Callable[[Solution, Values], Values] = lambda solution, values: {}
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


QUADRATURE = "quadrature of the 1D formulas"
NOISE = "second order on average: each error goes with the place of the front in its cell"
PAD = {"n": 99}, {"n": 399}, {"n": 1599}  # whose points meet the pocket's edges


def _slider(number: int, x_r: float, x_f: float | None, Q: float, p_max: float, load: float) -> Case:
    references = {
        "rupture": Reference(x_r, 2e-6, 1.5),
        **({} if x_f is None else {"reformation": Reference(x_f, 2e-6, 1.5)}),
        "Q": Reference(Q, 2e-6, 1.5),
        "p_max": Reference(p_max, 2e-6, 1.5),
        "pressure_integral": Reference(load, 2e-6, 1.5),
    }
    return Case(f"problem {number}", f"problem{number}", QUADRATURE, references, derive=_film_ends, note=NOISE)


def _journal(ratio: float, so: float, attitude: float, leakage: float, jfo: dict[str, float]) -> Case:
    source = "Butenschoen 1976, table"
    other = "a JFO code on 720 x 80"
    references = {
        "sommerfeld": Reference(so, 5e-3),
        "attitude_deg": Reference(attitude, 5e-3),
        "side_leakage_number": Reference(leakage, 5e-3),
    }
    # r is largest next to the side, in a cell that shrinks with the grid.
    references |= {
        f"{key}, other code": Reference(value, 5e-3 if key == "r_max" else 1e-3, None, other) for key, value in jfo.items()
    }
    return Case(
        f"journal, B/D = {ratio:g}",
        "journal",
        source,
        references,
        {"eccentricity": 0.5, "width_over_diameter": ratio},
        ({"nx": 89, "ny": 19}, {"nx": 179, "ny": 39}, {"nx": 359, "ny": 79}),
        lambda solution, values: {f"{key}, other code": (values | _void(solution, values))[key] for key in jfo},
        "a table of four digits: no order",
    )


def _textured(K: int, p_max: float, force: float, points: int, r_max: float) -> Case:
    return Case(
        f"textured slider, K = {K}",
        "textured_slider",
        "two codes that agree to all digits, on the same discrete equations",
        {
            "p_max": Reference(p_max, 1e-9),
            "force": Reference(force, 1e-8),
            "cavitated_points": Reference(points, 1e-9),
            "r_max": Reference(r_max, 2e-6),
        },
        {"K": K},
        ({"n": 30 * K},),
        _void,
        "one grid: the reference is that grid's own solution",
        {"method": "active-set", "system": "reduced"},  # to rounding
    )


CASES: tuple[Case, ...] = (
    Case(
        "pocketed pad",
        "pocketed_pad",
        f"Fowell 2007; {QUADRATURE}",
        {
            "rupture": Reference(2e-3, 1e-9),
            "reformation": Reference(3.6112626558e-3, 1e-7, 1.5),
            "void_behind_rupture": Reference(0.4872906839, 1e-7, 1.8),
            "p_max": Reference(9_808_818.754, 1e-8, 1.8),
            "load": Reference(34_165.70098, 1e-5, 1.5),
        },
        {"U": 1.0},
        PAD,
        _pocket_start,
        NOISE,
    ),
    Case(
        "pocketed pad, slow",
        "pocketed_pad",
        f"Fowell 2007; {QUADRATURE}",
        {
            "p_at_pocket": Reference(40_621.8837, 1e-8, 1.8),
            "p_max": Reference(451_923.9105, 1e-8, 1.8),
            "load": Reference(1333.4520, 1e-6, 1.8),
            "iterations": Reference(1, 1e-9, None, "no cavitation: one linear solve must do"),
        },
        {"U": 0.02},
        PAD,
        _pocket_start,
    ),
    Case(
        "parabolic slider",
        "parabolic_slider",
        QUADRATURE,
        {
            "rupture/L": Reference(0.67893443, 1e-6, 1.5),
            "p_max": Reference(3_591_787.27, 1e-5, 1.5),
            "x_max/L": Reference(0.32106557, 2e-3, None, "found to a point of the grid"),
            "pressure_integral": Reference(101_349.500, 1e-5, 1.5),
        },
        derive=_film_ends,
        note=NOISE,
    ),
    Case(
        "long journal, eps = 0.5",
        "long_journal",
        QUADRATURE,
        {
            "rupture_deg": Reference(219.69402, 1e-6, 1.8),
            "P_max": Reference(4.47498820, 1e-5, 1.8),
            "x_max_deg": Reference(140.30599, 2e-3, None, "found to a point of the grid"),
            "sommerfeld": Reference(3.22777817, 1e-5, 1.8),
            "attitude_deg": Reference(58.296185, 1e-5, 1.8),
            "content_at_outlet": Reference(0.41017791, 1e-5, 1.8),
        },
        {"eccentricity": 0.5},
        derive=_film_ends,
    ),
    _journal(1.0, 0.8903, 56.705, 0.7852, {"sommerfeld": 0.89109, "attitude_deg": 56.699, "P_max": 1.97558, "r_max": 0.65874}),
    _journal(0.5, 0.3124, 54.993, 0.4694, {"sommerfeld": 0.31252, "attitude_deg": 54.989, "side_leakage_number": 0.46954}),
    _textured(1, 482_112.287892, -230.290207, 484, 0.443613),
    _textured(4, 529_298.978092, -277.726716, 7730, 0.441200),
    Case(
        "ball on a membrane",
        "obstacle_ball",
        "exact; PETSc's snes/tutorials/ex9",
        {"contact_radius": Reference(0.697965148223374, 1e-3, 1.0)},
        grids=({"n": 31}, {"n": 63}, {"n": 127}),
        derive=_contact,
        note="the contact's edge lies anywhere in its cell: first order at least",
    ),
    _slider(1, 0.065974581544, None, 8.657063555921e-05, 5_914_573.39206, 212_771.44779),
    _slider(2, 0.066679293337, 0.095363606341, 8.751718061681e-05, 6_624_157.84999, 256_421.47042),
    _slider(3, 0.010760001894, 0.074198534553, 8.049906681699e-05, 2_000_000.0, 40_857.61297),
    Case(
        "pure squeeze",
        "squeeze",
        "exact; Optasanu and Bonneau, Ausas 2009",
        {
            "rupture_time": Reference(0.2500791572, 1e-5, 1.8),
            "sigma": Reference(0.9769922949, 2e-4, 1.5),
            "sigma_time": Reference(0.3148258627, 2e-4, 1.5),
            "front": Reference(0.0390872, 2e-3),
            "reformation_time": Reference(0.7323899, 1e-3),
        },
        grids=({"n": 49, "steps": 75}, {"n": 99, "steps": 150}, {"n": 199, "steps": 300}),
        note="a front that has to fill its cell: no order asked of its place and of the end of the void",
    ),
)
QUICK = "problem 2"  # of all cases the one with rupture and reformation that costs least
