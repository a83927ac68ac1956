"""Films of a fluid that depends on the pressure: their equations at a pressure, and their derivatives by it."""

from dataclasses import dataclass

import numpy as np

from ...base.parallel import Array
from .effects import Cells, answer, around, face_means, factors, framed_by
from .fluid import Law
from .lubrication import LubricationProblem
from .reynolds import BoxScheme, sides


def effective(
    problem: LubricationProblem, law: Law, p: Array, p_sides: tuple[float, float, float, float]
) -> LubricationProblem:
    """The problem in p with the fluid's coefficients at p: p and r solve it if they solve the fluid's own. Collective.

    Parameters
    ----------
    problem : that of a fluid of constant density and viscosity, in q. p : owned points, Pa. p_sides : Pa.
    """
    cells: Cells = {"density": law.density(p)} if law.dowson_higginson else {}
    by = factors(problem, cells, [float(law.density(np.array(side))) for side in p_sides])
    return answer(problem, law, cells, by, p, np.zeros_like(p), p_sides).problem


@dataclass(frozen=True)
class Tangent:
    """The equations' derivatives by p (p_unit), of what flows out of a cell by its west, east, south and north face.

    own, other : by the cell's pressure, and by its neighbour's. carried, entering : of the Couette flow alone out of the east
    and the west face, by the cell's pressure. viscosity : d log(mu)/dp of the east face by its two points; None where constant.
    stored : of what the cell stores, in a time step, by its pressure.
    """

    own: list[Array]
    other: list[Array]
    carried: Array
    entering: Array
    viscosity: tuple[Array, Array] | None = None
    stored: Array | float = 0.0

    def entries(self, scheme: BoxScheme) -> list[tuple[int, int, Array]]:
        """Rows of dG/dp as (dj, di, value); those of cells that the scheme holds have its diagonal alone."""
        held = np.zeros((1, 1), dtype=bool) if scheme.held is None else scheme.held
        west, east, south, north = (np.where(held, 0.0, a) for a in self.other)
        centre = np.where(held, scheme.diagonal, sum(self.own) + self.stored)
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
    framed = framed_by(grid, p * unit, problem.p_sides)
    q, dq = law.reduced(framed), np.exp(-law.barus * framed)
    rho, drho = face_means(law.density(framed)), law.density_slope(framed)
    beside = zip(*(map(np.nan_to_num, around(a)) for a in (q, dq, drho)), strict=True)
    q, dq, drho = (a[1:-1, 1:-1] for a in (q, dq, drho))
    void = grid.ghosted(r, outside=0.0)
    none = np.zeros(grid.box)
    dragged = [-(s.couette_W - s.b_W * void[1:-1, :-2]), s.couette_E + s.b_E * r.reshape(grid.box), none, none]
    own, other = [], []
    for k, (q_there, dq_there, drho_there), mean, drag in zip(conductances, beside, rho, dragged, strict=True):
        leaving = k * (q - q_there) / unit + drag
        own.append(mean * k * dq + 0.5 * drho * leaving * unit)
        other.append(np.nan_to_num(-mean * k * dq_there + 0.5 * drho_there * leaving * unit))
    half = 0.5 * drho * unit
    mu = np.full(grid.box, 0.5 * law.barus * unit)
    at_wall = sides(grid, ("closed", "mirror"))[1]  # where the point's own pressure stands for the one beyond
    viscosity = (mu * (1.0 + at_wall), mu) if law.barus else None
    stored = 0.0 if s.storage is None else s.storage * (1.0 - r.reshape(grid.box)) * drho * unit
    return Tangent(own, other, half * dragged[1], half * dragged[0], viscosity, stored)
