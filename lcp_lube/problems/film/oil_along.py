"""Lines of an oil that is not the same everywhere, by quadrature: density by the pressure, viscosity by what effects make.

With mu and rho in units of mu_0 and rho_0, Q = rho (U h - h^3 p'/(6 mu mu_0)), so that a full film has

    p' = 6 mu_0 mu (U/h^2 - Q/(rho h^3)):

all of `line` holds with mu h^-2 and mu h^-3/rho in the place of h^-2 and h^-3, and h rho in that of h where it is compared
with Q/U. mu and rho are those of the pressures and slopes found, again and again: each time they change by a part of what they
changed by before. A face of the discrete equations has its two points' means (`effects.factors`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.parallel import Array
from .fluid import Law
from .integrals import TO_POWERS, LineIntegrals
from .line import Line

if TYPE_CHECKING:
    from .effects import Effect
    from .lubrication import LubricationProblem


@dataclass(frozen=True)
class Oil:
    """mu : viscosity at p_c, Pa s. law : by the pressure. effects : those on the viscosity, all of them `local`. faces : what
    they have made of the conductances and wall's flows of west and east faces at owned points, as (k_W, u_W, k_E, u_E)."""

    mu: float
    law: Law
    effects: tuple[Effect, ...] = ()
    faces: Sequence[Array] = ()


def oil_of(
    base: LubricationProblem, law: Law, cells: Mapping[str, Array], faces: Mapping[str, Array], effects: Sequence[Effect]
) -> Oil | None:
    """A line's oil, if nothing else makes it differ from the rigid film, and all that it depends on is local.

    cells, faces : what effects have made of its points and faces (`effects.FaceFactors`).
    """
    dense = {"density"} if law.dowson_higginson else set()
    acting = tuple(effect for effect in effects if effect.channels != ("density",))
    if {*cells} == dense and not acting:
        return Oil(base.mu, law) if dense or law.barus else None
    if base.held is not None or not all(effect.local for effect in acting) or {*cells} != dense | {"viscosity"}:
        return None
    return Oil(base.mu, law, acting, [faces[name].ravel() for name in ("k_W", "u_W", "k_E", "u_E")])


MEMORY = 2  # films beside the last two


class Along:
    """mu and 1/rho along a line, polynomials in every panel.

    Parameters
    ----------
    ends : of the panels, m. values : at their Gauss points, shape (2, panels, 8).
    """

    def __init__(self, ends: Array, values: Array):
        self._ends, self._parts = ends, np.moveaxis(values @ TO_POWERS.T, 2, 0)

    def __call__(self, x: Array) -> Array:
        k = np.clip(np.searchsorted(self._ends, x, side="right") - 1, 0, self._ends.size - 2)
        a, b = self._ends[k], self._ends[k + 1]
        at, out = np.clip((2.0 * x - a - b) / (b - a), -1.0, 1.0), self._parts[-1].take(k, axis=1)
        for part in self._parts[-2::-1]:  # a third of the time of new arrays and of indices in brackets
            out *= at
            out += part.take(k, axis=1)
        return out


def made_along(found: Line, oil: Oil, reduce: Any) -> Array:
    """mu and 1/rho that a film's pressures and slopes make, at its panels' Gauss points, shape (2, panels, 8)."""
    at, law = found.integrals, oil.law
    x, p, slope = (np.ascontiguousarray(a).ravel() for a in (at.at_gauss, law.pressure(found.q_within), found.slope))
    ones = np.ones(x.size)
    here: Any = SimpleNamespace(p=p, law=law, h=np.array(at.h).ravel(), speed=found.U * ones, gradient=(slope, 0.0 * ones))
    here.base, here.problem = SimpleNamespace(mu=oil.mu), SimpleNamespace(reduce=reduce)
    here.grid = SimpleNamespace(x=(x - at.turned_back(x))[None, :], y=np.zeros((1, 1)), box=(1, x.size))
    here.mu = oil.mu * (at.thicker * np.ones_like(at.h)).ravel() * law.viscosity(p)
    out = {"viscosity": ones.copy()}
    for effect in oil.effects:
        effect.apply(here, out)
    return np.array([out["viscosity"], 1.0 / law.density(p)]).reshape(2, *at.h.shape)


class Settling:
    """A line's oil from film to film: of the last ones what makes the least of what they are off by (Anderson's method).

    Attributes
    ----------
    line : with the oil as it is taken next. off : by how much the last film's was off, and its fronts have moved, relative.
    """

    def __init__(self, line: LineIntegrals):
        self.line, self._bare, self.off = line, line, np.inf
        self._before: list[tuple[Array, Array]] = []
        self._fronts = np.zeros(0)

    def take(self, found: Line, oil: Oil, reduce: Any) -> None:
        """The next oil, after a film with this one."""
        at, fronts, made = found.integrals, np.concatenate(found.fronts), made_along(found, oil, reduce)
        off = made - np.stack([at.thicker * np.ones_like(at.h), at.swollen * np.ones_like(at.h)])
        moved = np.max(np.abs(fronts - self._fronts), initial=0.0) if fronts.size == self._fronts.size else np.inf
        self.off = max(float(np.max(np.abs(off / made))), float(moved) / at.points[-1])
        before = [one for one in self._before if one[0].shape == made.shape]
        mixed = made
        if before and not (fronts.size and oil.effects):  # which make mu jump at fronts, that move
            steps = np.array([(off - one).ravel() for _, one in before])
            shares = np.linalg.lstsq(steps @ steps.T, steps @ off.ravel(), rcond=1e-14)[0]
            mixed = made - sum(share * (made - one) for share, (one, _) in zip(shares, before, strict=True))
        self._before, self._fronts = [*before[-MEMORY:], (made, off)], fronts
        end = at.points[-1]  # a front at a side, but for rounding, is no point of its own: its cell would hold nothing
        ends = np.union1d(self._bare.ends, fronts[np.minimum(fronts, end - fronts) > 1e-12 * end])
        self.line = LineIntegrals(self._bare.film, ends, fine=True, along=Along(at.ends, mixed))
        self.line.ring = self._bare.ring


def with_densities(parts: Array, p: Array, law: Law) -> Array:
    """`LineIntegrals.parts` with the mean densities of the points around; p : Pa above p_c, at both ends too."""
    rho = law.density(p)
    return parts / np.stack([np.ones(p.size - 1)] * 2 + [0.5 * (rho[1:] + rho[:-1])])
