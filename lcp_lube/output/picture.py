"""What rank 0 draws of a Solution: fields thinned and gathered, units that suit them, the title."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..base.parallel import Array
from ..problems.box import BoxProblem
from ..problems.film.cavity import cavity_sign
from ..problems.film.edges import jumps_of
from ..problems.film.exact import ExactSolution
from ..problems.film.front_curves import front_curves
from ..problems.film.fronts import middle_row
from ..problems.film.lubrication import LubricationProblem
from ..problems.solution import Solution
from .files import coordinates, gather, taken, thinning
from .liquid import NOISE, ahead, void_at_faces
from .units import around, axis, with_unit

FINE = 1201  # points of a line that is drawn from a formula
MOST_POINTS = {1: 4000, 2: 500}  # a direction; larger fields are thinned before rank 0 gathers them


@dataclass
class Picture:
    """Fields in SI as (ny, nx) arrays, or (nx,) with an empty y, thinned if large; and what is known beside them.

    scales : what a field's values are large or small against; differences below `noise` of it say nothing.
    Of a lubrication problem: sign, positive in the full film and negative in the cavity (`cavity.cavity_sign`); void, the void
    fraction at the face `ahead` (m) of each point, where the scheme knows it; middle, the row of the middle line; curves, the
    fronts in the plane (`front_curves`). Empty and 0 for other problems.
    """

    solution: Solution
    x: Array
    y: Array
    fields: dict[str, tuple[Array, str]]
    quantities: dict[str, Any]
    scales: dict[str, float]
    sign: Array
    void: Array
    ahead: Array = field(default_factory=lambda: np.zeros(1))
    middle: int = 0
    exact: ExactSolution | None = None
    curves: list[Array] = field(default_factory=list)

    def noise(self, name: str) -> float:
        """Differences of a field that are not drawn, in parts of its scale: rounding, and of the void what the run left."""
        return trace(self.solution) if name == "r" else NOISE

    @property
    def length_unit(self) -> str:
        """Metres, unless the problem is dimensionless."""
        return "m" if any(unit for _, unit in self.fields.values()) else ""

    @property
    def is_journal(self) -> bool:
        """A load with a direction is known."""
        return bool(np.all(np.isfinite(self.quantities.get("force", np.nan))))

    @property
    def along(self) -> tuple[float, str]:
        """(factor, label) of the x axis: of a film round a shaft the angle from x = 0, else x in a unit that suits it."""
        grid = self.solution.problem.grid
        if self.is_journal:
            return around(grid.lengths[0])
        return axis("x", max(abs(grid.origin[0]), *grid.lengths), self.length_unit)

    @property
    def across(self) -> tuple[float, str]:
        """(factor, label) of the y axis."""
        return axis("y", self.solution.problem.grid.lengths[1], self.length_unit)

    def film(self, row: int | None, x: Array) -> Array:
        """The film of a lubrication problem in metres at x along a row."""
        problem: Any = self.solution.problem
        return np.asarray(problem.film(x, np.full_like(x, 0.0 if row is None else self.y[row])))

    def fine(self) -> Array:
        """Places (m) along x close enough to draw the film, with two at each of its known edges."""
        problem: Any = self.solution.problem
        start, L = problem.grid.origin[0], problem.grid.lengths[0]
        edges = np.array(jumps_of(problem.film, "x"))
        beside = np.concatenate([edges - NOISE * L, edges + NOISE * L])
        inside = beside[(beside > start) & (beside < start + L)]
        return np.unique(np.concatenate([np.linspace(start, start + L, FINE), inside]))

    def limits(self, name: str) -> tuple[float, float]:
        """Smallest and largest value (SI) that a bar or an axis of a field must show.

        Values that differ by rounding alone span from 0 to their size, or to the scale if they are 0 by rounding too: a full
        film has a void of 0 between 0 and 1, not a picture of its rounding.
        """
        values, scale = self.fields[name][0], self.scales[name]
        values = values[np.isfinite(values)]
        low, high = (float(values.min()), float(values.max())) if values.size else (0.0, 0.0)
        noise = self.noise(name)
        if high - low > noise * max(scale, abs(low), abs(high)):
            return (0.0 if name == "r" else low), high
        size = 0.5 * (low + high)
        return (min(0.0, size), max(0.0, size)) if abs(size) > noise * scale else (0.0, scale)

    @property
    def fronts(self) -> dict[str, float]:
        """Rupture and reformation, where there are any: x in m, in 2D on the middle line."""
        return {name: self.quantities[name] for name in ("rupture", "reformation") if self.quantities.get(name) is not None}

    def place(self, x: float) -> str:
        """x with its unit."""
        return f"{self.along[0] * x:.4g}°" if self.is_journal else with_unit(x, "m")


def collect(solution: Solution) -> Picture | None:
    """What there is to draw, on rank 0; None elsewhere. Collective."""
    problem: Any = solution.problem
    grid = problem.grid
    stride = nx, ny = thinning(grid, MOST_POINTS)
    fields = {name: (gather(grid, values, stride), unit) for name, (values, unit) in problem.physical(solution.fields).items()}
    quantities = problem.quantities(solution.fields)
    scales = {
        name: grid.reduce.max(np.abs(np.where(np.isfinite(values), values, 0.0))) or 1.0
        for name, (values, _) in problem.physical(solution.fields).items()
    }
    sign, void = np.empty(0), np.empty(0)
    more: dict[str, Any] = {}
    if isinstance(problem, BoxProblem):
        scales["f"] = problem.scales(solution.fields["v"])[1]
    if isinstance(problem, LubricationProblem):
        r = solution.fields["r"]
        signs = cavity_sign(problem.reduce, solution.fields["p"], r)
        least = trace(solution)
        signs = np.where(signs < -least, signs, np.maximum(signs, least))  # a void that says nothing is none
        sign, void = gather(grid, signs, stride), gather(grid, void_at_faces(problem, r, signs), stride)
        scales |= {"p": _pressure_scale(problem), "r": 1.0}
        rows = taken(grid.shape[1], ny) if grid.dim == 2 else np.zeros(1)
        more = {
            "ahead": ahead(problem)[taken(grid.shape[0], nx)],
            "middle": int(np.argmin(np.abs(rows - middle_row(problem)))),
            "exact": problem.exact() if problem.exact is not None else None,
            "curves": front_curves(problem, solution.fields["p"], np.where(signs < 0, r, 0.0)) if grid.dim == 2 else [],
        }
    if grid.comm.rank > 0:
        return None
    x, *y = coordinates(grid, stride)
    return Picture(solution, x, y[0] if y else np.empty(0), fields, quantities, scales, sign, void, **more)


def trace(solution: Solution) -> float:
    """The void that says nothing: rounding, or what the certificate's own tolerance allows (interior methods leave some)."""
    return max(NOISE, solution.certificate.tol)


def _pressure_scale(problem: LubricationProblem) -> float:
    """What the wall's motion can raise in the thickest film, or what the sides have, Pa. Collective."""
    h = problem.reduce.max(problem.scheme.h)
    mu = problem.reduce.max(np.atleast_1d(problem.mu))  # that of a fluid may differ from point to point
    viscous = 6.0 * mu * abs(problem.U) * problem.grid.lengths[0] / h**2
    return max(viscous, *map(abs, problem.p_sides), abs(problem.p_c)) or 1.0


def title(picture: Picture) -> str:
    """Scene, grid and the figures that an engineer asks for; a run that failed says so."""
    solution, values = picture.solution, picture.quantities
    shape = " x ".join(map(str, solution.problem.grid.shape))
    parts = [f"{solution.settings.get('scene', '')} ({shape} point{'s' * (shape != '1')})"]
    if not solution.converged:
        return f"{parts[0]}: NOT a solution, {solution.outcome.sentence}"
    if (now := values.get("t_end")) is not None:
        parts.append(f"at the end, $t$ = {now:.4g}")
    if values.get("p_max") is not None:
        largest_p = with_unit(values["p_max"], picture.fields["p"][1]).rstrip()
        when = "" if now is None else f" at $t$ = {values['p_max_time']:.4g}"
        parts.append(f"$p_{{max}}$ {'was ' * bool(when)}{largest_p}{when}")
    if values.get("load") is not None:
        parts.append(f"load {with_unit(values['load'], 'N/m' if picture.y.size == 0 else 'N')}")
    if values.get("sommerfeld") is not None:
        parts.append(f"So {values['sommerfeld']:.4g}")
    if values.get("cavitated_fraction") is not None:
        parts.append(f"{100 * values['cavitated_fraction']:.1f} % cavitated{' (dotted)' * (picture.y.size > 0)}")
    return ",  ".join(parts)


def largest(values: Array) -> float:
    """Largest magnitude among the finite values (a run that overflowed is drawn too); 0 where there is none."""
    return float(np.max(np.abs(values[np.isfinite(values)]), initial=0.0))
