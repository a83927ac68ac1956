"""What rank 0 draws of a Solution: fields thinned and gathered, units that suit them, the title."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..parallel import Array
from ..problems.exact import ExactSolution
from ..problems.fronts import cavity_sign
from ..problems.solution import Solution
from .files import coordinates, gather
from .units import prefix, quantity

MOST_POINTS = {1: 4000, 2: 500}  # a direction; larger fields are thinned before rank 0 gathers them


@dataclass
class Picture:
    """Fields in SI as (ny, nx) arrays, or (nx,) with an empty y, thinned if large; and what is known beside them.

    sign is positive in the full film and negative in the cavity (`fronts.cavity_sign`); empty for problems without one.
    """

    solution: Solution
    x: Array
    y: Array
    fields: dict[str, tuple[Array, str]]
    sign: Array
    quantities: dict[str, Any]
    exact: ExactSolution | None

    @property
    def length_unit(self) -> str:
        """Metres, unless the problem is dimensionless."""
        return "m" if any(unit for _, unit in self.fields.values()) else ""


def collect(solution: Solution) -> Picture | None:
    """What there is to draw, on rank 0; None elsewhere. Collective."""
    problem: Any = solution.problem
    grid = problem.grid
    nx, ny = (math.ceil(n / MOST_POINTS[grid.dim]) for n in (*grid.shape, 1)[:2])
    stride = (nx, ny)
    fields = {name: (gather(grid, values, stride), unit) for name, (values, unit) in problem.physical(solution.fields).items()}
    sign, exact, quantities = np.empty(0), None, problem.quantities(solution.fields)
    if problem.kind == "lubrication":
        exact = problem.exact() if problem.exact is not None else None
        sign = gather(grid, cavity_sign(problem, solution.p, solution.r), stride)
    if grid.comm.rank > 0:
        return None
    x, *y = coordinates(grid, stride)
    return Picture(solution, x, y[0] if y else np.empty(0), fields, sign, quantities, exact)


def title(picture: Picture) -> str:
    """Scene, grid and the figures that an engineer asks for; a run that failed says so."""
    solution, values = picture.solution, picture.quantities
    shape = " x ".join(map(str, solution.problem.grid.shape))
    parts = [f"{solution.settings.get('scene', '')} ({shape} points)"]
    if not solution.converged:
        return f"{parts[0]}: NOT a solution, {solution.outcome.sentence}"
    if values.get("p_max") is not None:
        parts.append(f"$p_{{max}}$ {quantity(values['p_max'], picture.fields['p'][1])}".rstrip())
    if values.get("load") is not None:
        parts.append(f"load {quantity(values['load'], 'N/m' if picture.y.size == 0 else 'N')}")
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
