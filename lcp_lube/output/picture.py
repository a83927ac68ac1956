"""What rank 0 draws of a Solution: fields thinned and gathered, units that suit them, the title."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.parallel import Array
from ..problems.film.exact import ExactSolution
from ..problems.film.flows import point_weights
from ..problems.film.fronts import cavity_sign, middle_row
from ..problems.film.lubrication import LubricationProblem
from ..problems.solution import Solution
from .files import coordinates, gather, taken
from .units import prefix, quantity

MOST_POINTS = {1: 4000, 2: 500}  # a direction; larger fields are thinned before rank 0 gathers them


@dataclass
class Picture:
    """Fields in SI as (ny, nx) arrays, or (nx,) with an empty y, thinned if large; and what is known beside them.

    Of a lubrication problem: sign, positive in the full film and negative in the cavity (`fronts.cavity_sign`); liquid, the
    thickness (m) of the liquid that passes the face `ahead` (m) of each point, where the scheme knows it; middle, the row of
    the middle line. Empty and 0 for other problems.
    """

    solution: Solution
    x: Array
    y: Array
    fields: dict[str, tuple[Array, str]]
    quantities: dict[str, Any]
    sign: Array
    liquid: Array
    ahead: float = 0.0
    middle: int = 0
    exact: ExactSolution | None = None

    @property
    def length_unit(self) -> str:
        """Metres, unless the problem is dimensionless."""
        return "m" if any(unit for _, unit in self.fields.values()) else ""

    @property
    def is_journal(self) -> bool:
        """A load with a direction is known."""
        return bool(np.all(np.isfinite(self.quantities.get("load_vector", np.nan))))

    @property
    def along(self) -> tuple[float, str]:
        """(factor, label) of the x axis: of a journal the angle from the widest film, else x in a unit that suits it."""
        grid = self.solution.problem.grid
        if self.is_journal:
            return 360.0 / grid.lengths[0], "angle from the widest film (°)"
        return self._axis("x", max(abs(grid.origin[0]), *grid.lengths))

    @property
    def across(self) -> tuple[float, str]:
        """(factor, label) of the y axis."""
        return self._axis("y", max(self.solution.problem.grid.lengths))

    def _axis(self, name: str, size: float) -> tuple[float, str]:
        factor, unit = prefix(size, self.length_unit)
        return factor, f"{name} ({unit})" if unit else name

    @property
    def fronts(self) -> dict[str, float]:
        """Rupture and reformation, where there are any: x in m, in 2D on the middle line."""
        return {name: self.quantities[name] for name in ("rupture", "reformation") if self.quantities.get(name) is not None}

    def place(self, x: float) -> str:
        """x with its unit."""
        return f"{self.along[0] * x:.4g}°" if self.is_journal else quantity(x, "m")

    @property
    def load(self) -> float | None:
        """What the bearing carries: a journal's load, else the integral of the absolute pressure."""
        return self.quantities.get("bearing_load", self.quantities.get("load"))


def collect(solution: Solution) -> Picture | None:
    """What there is to draw, on rank 0; None elsewhere. Collective."""
    problem: Any = solution.problem
    grid = problem.grid
    nx, ny = (math.ceil(n / MOST_POINTS[grid.dim]) for n in (*grid.shape, 1)[:2])
    stride = (nx, ny)
    fields = {name: (gather(grid, values, stride), unit) for name, (values, unit) in problem.physical(solution.fields).items()}
    quantities = problem.quantities(solution.fields)
    sign, liquid = np.empty(0), np.empty(0)
    more: dict[str, Any] = {}
    if isinstance(problem, LubricationProblem):
        s = problem.scheme
        passing = (s.couette_E.ravel() + s.b_C.ravel() * solution.fields["r"]) / (problem.U * point_weights(grid))
        liquid = gather(grid, passing, stride)
        sign = gather(grid, cavity_sign(problem, solution.fields["p"], solution.fields["r"]), stride)
        rows = taken(grid.shape[1], ny) if grid.dim == 2 else np.zeros(1)
        more = {
            "ahead": 0.0 if np.array_equal(s.couette_E, problem.U * s.h) else 0.5 * grid.spacing[0],
            "middle": int(np.argmin(np.abs(rows - middle_row(problem)))),
            "exact": problem.exact() if problem.exact is not None else None,
        }
    if grid.comm.rank > 0:
        return None
    x, *y = coordinates(grid, stride)
    return Picture(solution, x, y[0] if y else np.empty(0), fields, quantities, sign, liquid, **more)


def title(picture: Picture) -> str:
    """Scene, grid and the figures that an engineer asks for; a run that failed says so."""
    solution, values = picture.solution, picture.quantities
    shape = " x ".join(map(str, solution.problem.grid.shape))
    parts = [f"{solution.settings.get('scene', '')} ({shape} points)"]
    if not solution.converged:
        return f"{parts[0]}: NOT a solution, {solution.outcome.sentence}"
    if values.get("p_max") is not None:
        parts.append(f"$p_{{max}}$ {quantity(values['p_max'], picture.fields['p'][1])}".rstrip())
    if picture.load is not None:
        parts.append(f"load {quantity(picture.load, 'N/m' if picture.y.size == 0 else 'N')}")
    if values.get("sommerfeld") is not None:
        parts.append(f"So {values['sommerfeld']:.4g}")
    if values.get("cavitated_fraction") is not None:
        parts.append(f"{100 * values['cavitated_fraction']:.1f} % cavitated{' (dotted)' * (picture.y.size > 0)}")
    return ",  ".join(parts)


def scaled(values: Array, unit: str) -> tuple[Array, str]:
    """Values in a unit that suits them, and ' (unit)' for a label."""
    factor, unit = prefix(largest(values), unit)
    return values * factor, f" ({unit})" if unit else ""


def largest(values: Array) -> float:
    """Largest magnitude among the finite values (a run that overflowed is drawn too); 0 where there is none."""
    return float(np.max(np.abs(values[np.isfinite(values)]), initial=0.0))
