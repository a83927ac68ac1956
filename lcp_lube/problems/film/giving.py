"""What a time step's cells store beyond the rigid film's room, where a fluid's density or walls give way to the pressure.

With d(stored)/dt held while a film is solved for its pressures, films of short steps answer by pressures that throw it from
side to side: a cell gains far more by them than flows. So it is linearised in q (`fluid`) at a pressure p_k that is near,

    stored = stored_k + gives (q - q_k),    full cells;    (stored_k - gives q_k) (1 - r),    cavitated ones:

a term >= 0 on A's diagonal, which leaves a step in the M-matrix family and settles the sooner, the shorter it is.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from ...base.parallel import Array
from .effects import Answer, Cells, Effect, FaceFactors
from .fluid import Law
from .lubrication import LubricationProblem

LEAST_KEPT = 0.5  # of what a cell stores at p_k, at most of the rigid film: by the line through that it does so at p = 0
LEAST = 1e-30  # 1/Pa
WIDEST = 40.0  # of the logarithm of a factor, of an iterate


@dataclass(frozen=True)
class Giving(Effect):
    """slopes : by how much more of the rigid film a full cell stores for 1 Pa more, at p = 0, 1/Pa. walls : by these alone."""

    law: Law
    walls: Array
    channels: ClassVar[tuple[str, ...]] = ("pressure",)

    @classmethod
    def of(cls, law: Law, effects: Sequence[Effect], film: LubricationProblem) -> "Giving | None":
        """film : the rigid one; None where nothing gives way, or nothing is stored. Collective."""
        h = film.scheme.h.ravel()
        found = cls(law, sum((effect.yields(film.grid) for effect in effects), np.zeros(h.size)) / h)
        return found if film.scheme.storage is not None and film.reduce.max(found.slopes) > LEAST else None

    @property
    def slopes(self) -> Array:
        return np.maximum(self.walls + self.law.density_slope(np.zeros(self.walls.size)), LEAST)

    def apply(self, at: Answer, out: Cells) -> None:
        out["pressure"] += at.p

    def linearised(self, by: FaceFactors, cells: Cells, h: Array) -> FaceFactors:
        """A film's factors with what its cells store linearised at their pressure."""
        p, stored = cells["pressure"], by.values["stored"].ravel()
        thick = 1.0 + cells.get("lift", 0.0) / h
        q, slope = self.law.reduced(p), self.law.density_slope(p) * thick + cells.get("density", 1.0) * self.walls
        gives, left = slope * self.law.viscosity(p), stored - LEAST_KEPT * np.minimum(stored, 1.0)  # dp/dq = mu(p)/mu
        gives = np.minimum(gives, np.divide(left, q, out=np.full_like(q, np.inf), where=q > 0.0))
        found = {"stored": stored - gives * q, "gives": gives}
        return replace(by, values=by.values | {name: a.reshape(by.grid.box) for name, a in found.items()})


def filled(plain: FaceFactors, by: FaceFactors, q: Array) -> FaceFactors:
    """The factors `plain` with what was stored, by whatever law: so mass is conserved. by : those of the film of q, Pa."""
    if "gives" not in by.values:
        return plain
    stored = by.values["stored"] + by.values["gives"] * q.reshape(by.grid.box)
    return replace(plain, values=plain.values | {"stored": stored})


def logarithm(lift: Array) -> Array:
    """log(1 + lift), where pressure goes by a power of the film, as it does; below half of the rigid film its tangent's."""
    return np.where(lift > -0.5, np.log1p(np.maximum(lift, -0.5)), 2.0 * lift + 1.0 - np.log(2.0))


def lift_of(x: Array) -> Array:
    """The other way round."""
    thin = x < -np.log(2.0)
    return np.where(thin, 0.5 * (x - 1.0 + np.log(2.0)), np.expm1(np.minimum(np.where(thin, 0.0, x), WIDEST)))
