"""Fluids whose viscosity and density depend on the pressure, and the box scheme with them.

p is the pressure above the cavitation pressure, at which the viscosity is mu and the density rho_0.

    Barus             mu(p) = mu exp(b p)
    Dowson-Higginson  rho(p)/rho_0 = (C + 1.66 p)/(C + p),  C = 2.22e9 Pa

Barus' law needs no iteration: (1/mu(p)) dp/dx = (1/mu) dq/dx with q = (1 - exp(-b p))/b, which has the sign of p, so q solves
the complementarity problem of a fluid of constant viscosity. Where b q reaches 1 no pressure carries the flow. Density
multiplies the flow through every face, by the mean of its two points' values; `piezo` iterates on it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...base.parallel import Array
from ..grid import Grid
from .lubrication import LubricationProblem
from .reynolds import BoxScheme, sides
from .supplies import Held, pressed

BULK, SLOPE = 2.22e9, 1.66


@dataclass(frozen=True)
class Law:
    """barus : b, 1/Pa; 0: constant viscosity. dowson_higginson : whether density depends on p."""

    barus: float = 0.0
    dowson_higginson: bool = False

    def reduced(self, p: Array) -> Array:
        """q of p, Pa."""
        return -np.expm1(-self.barus * p) / self.barus if self.barus else p

    def pressure(self, q: Array) -> Array:
        """p of q, Pa; inf or NaN where there is none."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return -np.log1p(-self.barus * q) / self.barus if self.barus else q

    def viscosity(self, p: Array) -> Array:
        """mu(p)/mu."""
        return np.exp(self.barus * p)

    def density(self, p: Array) -> Array:
        """rho(p)/rho_0."""
        return (BULK + SLOPE * p) / (BULK + p) if self.dowson_higginson else np.ones_like(p)

    def density_slope(self, p: Array) -> Array:
        """d(rho/rho_0)/dp, 1/Pa."""
        return (SLOPE - 1.0) * BULK / (BULK + p) ** 2 if self.dowson_higginson else np.zeros_like(p)

    def mobility(self, a: Array, b: Array) -> Array:
        """(q(b) - q(a))/(b - a): mu over the viscosity that acts between the pressures a and b."""
        step = self.barus * (b - a)
        safe = np.where(np.abs(step) > 1e-12, step, 1.0)
        return np.exp(-self.barus * a) * np.where(np.abs(step) > 1e-12, -np.expm1(-safe) / safe, 1.0)


def with_density(problem: LubricationProblem, law: Law, p: Array) -> LubricationProblem:
    """The problem in q of a film whose density is that of p (owned points, Pa); its grid is the problem's own. Collective."""
    framed = law.density(_framed(problem.grid, p, [float(law.pressure(np.array(q))) for q in problem.p_sides]))
    return _scaled(problem, _means(framed), problem.p_sides, problem.mu, held=problem.held)


def effective(
    problem: LubricationProblem, law: Law, p: Array, p_sides: tuple[float, float, float, float]
) -> LubricationProblem:
    """The problem in p with the fluid's coefficients at p: p and r solve it if they solve the fluid's own. Collective.

    Parameters
    ----------
    problem : that of a fluid of constant density and viscosity, in q. p : owned points, Pa. p_sides : Pa.
    """
    framed = _framed(problem.grid, p, p_sides)
    means = _means(law.density(framed))
    here = framed[1:-1, 1:-1]
    around = (framed[1:-1, :-2], framed[1:-1, 2:], framed[:-2, 1:-1], framed[2:, 1:-1])
    mobilities = [law.mobility(here, np.nan_to_num(other)) for other in around]
    at_faces = law.viscosity(0.5 * (here + np.nan_to_num(framed[1:-1, 2:])))  # drag is summed over the east faces
    held = problem.held
    if held is not None:  # back from q
        supplies = (replace(one, p=float(law.pressure(np.array(one.p)))) for one in held.supplies)
        held = replace(held, supplies=tuple(supplies))
    return _scaled(problem, means, p_sides, problem.mu * at_faces, mobilities, held)


@dataclass(frozen=True)
class Tangent:
    """The equations' derivatives by p (p_unit), of what flows out of a cell by its west, east, south and north face.

    own, other : by the cell's pressure, and by its neighbour's. carried, entering : of the Couette flow alone out of the east
    and the west face, by the cell's pressure. viscosity : d log(mu)/dp of the east face by its two points; None where constant.
    """

    own: list[Array]
    other: list[Array]
    carried: Array
    entering: Array
    viscosity: tuple[Array, Array] | None = None

    def entries(self, scheme: BoxScheme) -> list[tuple[int, int, Array]]:
        """Rows of dG/dp as (dj, di, value); those of cells that the scheme holds have its diagonal alone."""
        held = np.zeros((1, 1), dtype=bool) if scheme.held is None else scheme.held
        west, east, south, north = (np.where(held, 0.0, a) for a in self.other)
        centre = np.where(held, scheme.diagonal, sum(self.own))
        return [(0, 0, centre), (0, -1, west), (0, 1, east), (-1, 0, south), (1, 0, north)]


def tangent(problem: LubricationProblem, law: Law | None, constant: LubricationProblem, p: Array, r: Array) -> Tangent:
    """Derivatives of the balance of `effective(constant, law, p, ...)` by p, its coefficients' own ones among them. Collective.

    Parameters
    ----------
    problem : that one, at p; of a constant fluid (law None) the problem itself, as `constant` is.
    """
    s, grid, unit = constant.scheme, problem.grid, problem.p_unit
    conductances = [s.k_W, s.k_E, s.k_S, s.k_N]
    if law is None:
        none = np.zeros(grid.box)
        return Tangent(conductances, [-k for k in conductances], none, none)
    framed = _framed(grid, p * unit, problem.p_sides)
    q, dq = law.reduced(framed), np.exp(-law.barus * framed)
    rho, drho = _means(law.density(framed)), law.density_slope(framed)
    around = (
        (slice(1, -1), slice(0, -2)),
        (slice(1, -1), slice(2, None)),
        (slice(0, -2), slice(1, -1)),
        (slice(2, None), slice(1, -1)),
    )
    here = (slice(1, -1), slice(1, -1))
    void = grid.ghosted(r, outside=0.0)
    none = np.zeros(grid.box)
    dragged = [-(s.couette_W - s.b_W * void[1:-1, :-2]), s.couette_E + s.b_C * r.reshape(grid.box), none, none]
    own, other = [], []
    for k, at, mean, drag in zip(conductances, around, rho, dragged, strict=True):
        leaving = k * (q[here] - np.nan_to_num(q[at])) / unit + drag
        own.append(mean * k * dq[here] + 0.5 * drho[here] * leaving * unit)
        other.append(np.nan_to_num(-mean * k * dq[at] + 0.5 * drho[at] * leaving * unit))
    half = 0.5 * drho[here] * unit
    mu = np.full(grid.box, 0.5 * law.barus * unit)
    at_wall = sides(grid, ("closed", "mirror"))[1]  # where the point's own pressure stands for the one beyond
    return Tangent(own, other, half * dragged[1], half * dragged[0], (mu * (1.0 + at_wall), mu) if law.barus else None)


def _scaled(
    problem: LubricationProblem,
    density: list[Array],
    p_sides: tuple[float, float, float, float],
    mu: float | Array,
    mobility: list[Array] | None = None,
    held: Held | None = None,
) -> LubricationProblem:
    """The problem with densities at its west, east, south and north faces, and conductances times mobilities."""
    s, grid = problem.scheme, problem.grid
    factors = [rho * m for rho, m in zip(density, mobility, strict=True)] if mobility else density
    k = [a * factor for a, factor in zip((s.k_W, s.k_E, s.k_S, s.k_N), factors, strict=True)]
    couette_W, couette_E = s.couette_W * density[0], s.couette_E * density[1]
    c = couette_W - couette_E
    for conductance, at_side, p_side in zip(k, sides(grid), p_sides, strict=True):
        c = c + np.where(at_side, conductance * (p_side / problem.p_unit), 0.0)
    names = dict(zip(("k_W", "k_E", "k_S", "k_N"), k, strict=True))
    b = {"b_C": s.b_C * density[1], "b_W": s.b_W * density[0]}
    scheme = replace(s, **names, **b, couette_W=couette_W, couette_E=couette_E, c=c)  # type: ignore[arg-type]
    if held is not None:
        scheme = pressed(scheme, held, problem.p_unit)
    return LubricationProblem(
        grid,
        scheme,
        mu=mu,  # type: ignore[arg-type]
        U=problem.U,
        p_unit=problem.p_unit,
        p_sides=p_sides,
        p_c=problem.p_c,
        film=problem.film,
        shaft=problem.shaft,
        r_in=problem.r_in,
        held=held,
    )


def _framed(grid: Grid, values: Array, at_sides: Sequence[float]) -> Array:
    """Owned values with their neighbours': a side's where it is open, their own beyond others. Collective."""
    out = grid.ghosted(values)
    own = out[1:-1, 1:-1].copy()
    rim = (out[1:-1, :1], out[1:-1, -1:], out[:1, 1:-1], out[-1:, 1:-1])
    edge = (own[:, :1], own[:, -1:], own[:1], own[-1:])
    for view, inner, side, value in zip(rim, edge, sides(grid), at_sides, strict=True):
        outside = np.isnan(view)
        view[outside] = np.where(side.any(), value, inner)[outside]
    return out


def _means(framed: Array) -> list[Array]:
    """Means over the west, east, south and north face."""
    here = framed[1:-1, 1:-1]
    return [0.5 * (here + other) for other in (framed[1:-1, :-2], framed[1:-1, 2:], framed[:-2, 1:-1], framed[2:, 1:-1])]
