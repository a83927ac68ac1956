"""Films of a fluid that depends on the pressure: their equations at a pressure, and their derivatives by it.

`Giving` is of what a time step's cells store beyond the rigid film's room, where density or walls give way to the pressure.

With d(stored)/dt held while a film is solved for its pressures, films of short steps answer by pressures that throw it from
side to side: a cell gains far more by them than flows. So it is linearised in q (`fluid`) at a pressure p_k that is near,

    stored = stored_k + gives (q - q_k),    full cells;    (stored_k - gives q_k) (1 - r),    cavitated ones:

a term >= 0 on A's diagonal, which leaves a step in the M-matrix family and settles the sooner, the shorter it is.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from ...base.parallel import Array
from ..solution import Fields
from .effects import Answer, Cells, Effect, FaceFactors, answer, around, face_means, factors, framed_by, scaled
from .fluid import Law
from .lubrication import LubricationProblem
from .reynolds import BoxScheme, sides

LEAST_KEPT = 0.5  # of what a cell stores at p_k, at most of the rigid film: by the line through that it does so at p = 0
LEAST = 1e-30  # 1/Pa
EMPTY = 1e-6  # of a cell's room: less liquid takes up nothing that others have left
WIDEST = 40.0  # of the logarithm of a factor, of an iterate


def effective(problem: LubricationProblem, law: Law, p: Array, p_sides: tuple[float, ...]) -> LubricationProblem:
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


@dataclass(frozen=True)
class Giving(Effect):
    """slopes : by how much more of the rigid film a full cell stores for 1 Pa more, at p = 0, 1/Pa. walls : by these alone.
    alone : whether density is all that follows the pressure, of which a film may take its own while it is solved."""

    law: Law
    walls: Array
    alone: bool
    channels: ClassVar[tuple[str, ...]] = ("pressure",)

    @classmethod
    def of(cls, law: Law, effects: Sequence[Effect], film: LubricationProblem, alone: bool) -> "Giving | None":
        """film : the rigid one; None where nothing gives way, or nothing is stored. Collective."""
        h = film.scheme.h.ravel()
        found = cls(law, sum((effect.yields(film.grid) for effect in effects), np.zeros(h.size)) / h, alone)
        return found if film.scheme.storage is not None and film.reduce.max(found.slopes) > LEAST else None

    @cached_property
    def slopes(self) -> Array:
        return np.maximum(self.walls + self.law.density_slope(np.zeros(self.walls.size)), LEAST)

    def apply(self, at: Answer, out: Cells) -> None:
        out["pressure"] += at.p

    def linearised(self, by: FaceFactors, cells: Cells, h: Array) -> FaceFactors:
        """A film's factors with what its cells store linearised at their pressure."""
        thick = 1.0 + cells.get("lift", 0.0) / h
        slope = self.law.density_slope(cells["pressure"]) * thick + cells.get("density", 1.0) * self.walls
        return replace(_linearised(self.law, by, cells["pressure"], slope), law=self.law if self.alone else None)


def _linearised(law: Law, by: FaceFactors, p: Array, slope: Array) -> FaceFactors:
    """slope : by how much more of the rigid film a full cell stores for 1 Pa more, at p, 1/Pa."""
    stored, q = by.values["stored"].ravel(), law.reduced(p)
    gives, left = slope * law.viscosity(p), stored - LEAST_KEPT * np.minimum(stored, 1.0)  # dp/dq = mu(p)/mu
    gives = np.minimum(gives, np.divide(left, q, out=np.full_like(q, np.inf), where=q > 0.0))
    found = {"stored": stored - gives * q, "gives": gives}
    return replace(by, values=by.values | {name: a.reshape(by.grid.box) for name, a in found.items()})


def renew(problem: LubricationProblem, q: Array) -> None:
    """Give a problem whose density follows by a law the coefficients at another q (p_unit, `fluid`). Collective."""
    rigid, law = problem.factors.rigid, problem.factors.law
    p = law.pressure(q * rigid.p_unit)
    sides = [float(law.density(law.pressure(np.array(side)))) for side in rigid.p_sides]
    by = _linearised(law, factors(rigid, {"density": law.density(p)}, sides), p, law.density_slope(p))
    problem.scheme = scaled(rigid, by, held=problem.held).scheme
    problem.factors = replace(by, law=law, rigid=rigid, at=q)


def renewed(problem: Any, law: Law, p: Array | None) -> Cells | None:
    """The fields at p (Pa; None: those taken last) of a film that took its own while it was solved; None if it did not."""
    by = getattr(problem, "factors", None)
    if by is None or by.at is None:
        return None
    p = law.pressure(by.at * problem.p_unit) if p is None else p
    return {"density": law.density(p), "pressure": p}


def filled(plain: FaceFactors, by: FaceFactors, q: Array) -> FaceFactors:
    """The factors `plain` with what was stored, by whatever law: so mass is conserved. by : those of the film of q, Pa."""
    if "gives" not in by.values:
        return plain
    stored = by.values["stored"] + by.values["gives"] * q.reshape(by.grid.box)
    return replace(plain, values=plain.values | {"stored": stored})


def closed(by: FaceFactors, problem: Any, fields: Fields, rigid: LubricationProblem) -> FaceFactors:
    """The factors with what is left of a problem's balances in what its cells store, so that no cell loses any. Collective."""
    p, r, storage = fields["p"], fields["r"], np.asarray(rigid.scheme.storage)
    room, left = storage * (1.0 - r.reshape(storage.shape)), problem.balance(p, r).reshape(storage.shape)
    off = np.divide(left, room, out=np.zeros(storage.shape), where=room > EMPTY * storage)
    return replace(by, values=by.values | {"stored": by.values["stored"] - off})


def logarithm(lift: Array) -> Array:
    """log(1 + lift), where pressure goes by a power of the film, as it does; below half of the rigid film its tangent's."""
    return np.where(lift > -0.5, np.log1p(np.maximum(lift, -0.5)), 2.0 * lift + 1.0 - np.log(2.0))


def lift_of(x: Array) -> Array:
    """The other way round."""
    thin = x < -np.log(2.0)
    return np.where(thin, 0.5 * (x - 1.0 + np.log(2.0)), np.expm1(np.minimum(np.where(thin, 0.0, x), WIDEST)))
