"""A line solved by quadrature, as the film has it and as the grid has it: what the grid gets wrong is their difference.

Steady flow along a line is one number Q (head of `exact`). In terms of J(x) = Int_0^x 6 mu/h^3, F(x) = Int_0^x 6 mu U/h^2 and
Z = F - Q J, the pressure of a film that is full all the way up to a constant,

    Q = min( (p_a - p_b + F(L))/J(L), min_x M(x), U h(0) (1 - r_in) if p_a = 0 ),     M = (p_a + F)/J,
    p(x) = Z(x) + max( p_b - Z(L), max_{t >= x} -Z(t) ),

p followed upstream from p_b and stopped at zero. It ruptures where U h rises through Q, or at an edge, and reforms where p,
followed upstream, is zero. The discrete equations with the fluxes of `integrals` are solved by the same two lines with the
points alone in the place of x, and with F less the void that enters, r_in F_1: so their Q and p are known, whoever solves them.

What is read off the fields of a solve is therefore corrected by what the film says minus what the discrete solution says
(`quantities`): the fields' own error stays in it, the grid's goes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...base.parallel import Array
from ..solution import Fields
from .cavity import VOID
from .exact import bisect
from .integrals import SAME, LineIntegrals

if TYPE_CHECKING:
    from .lubrication import LubricationProblem

Flags = NDArray[np.bool_]
ROUNDING = 4e-15  # of the largest |Z|: a pressure below it is zero
SETTLED = 1e-15  # relative change of Q
KINDS = {"open", "closed"}  # ends of a line that is known
MOST = 200  # looks for the least M: they converge by second order, from far away by halves


@dataclass(frozen=True)
class Line:
    """Pressure along a line from side to side.

    Attributes
    ----------
    integrals : between points, all places where U h = Q and all fronts among them. p : there, Pa above p_c. full : of each
        piece between two of them, whether it is full. Q : the equation's flow, m2/s, twice what flows. enters : whether void
        does at x = 0.
    """

    integrals: LineIntegrals
    p: Array
    full: Flags
    mu: float
    U: float
    Q: float
    enters: bool

    @cached_property
    def slope(self) -> Array:
        """p' at the panels' Gauss points, Pa/m; 0 in cavities."""
        h = self.integrals.h
        return np.where(self.full[self.integrals.interval, None], 6.0 * self.mu * (self.U - self.Q / h) / h**2, 0.0)

    def integral(self, antiderivative: Callable[[Array], Array], above: float = 0.0) -> float:
        """Integral of (p - above) w over the line, w by its antiderivative W: sums of p_1 [W] + Int p' (W_2 - W)."""
        line, W = self.integrals, antiderivative(self.integrals.points)
        behind = W[line.interval + 1, None] - antiderivative(line.at_gauss)
        return float(np.sum((self.p[:-1] - above) * np.diff(W)) + np.sum(line.weigh(self.slope * behind)))

    @property
    def friction(self) -> float:
        """Integral of mu U (1 - r)/h + (h/2) p', N/m: of 4 mu U/h - 3 mu Q/h^2 where full, mu Q/h^2 in cavities."""
        one, two, _ = self.mu * self.integrals.parts
        return float(np.sum(np.where(self.full, 4.0 * self.U * one - 3.0 * self.Q * two, self.Q * two)))

    @property
    def cavitated(self) -> float:
        """Length of the cavities, m."""
        return float(np.sum(np.diff(self.integrals.points)[~self.full]))

    @property
    def largest(self) -> tuple[float, float]:
        """The largest pressure, Pa above p_c, and its x, m: it is at a point, for there U h falls through Q."""
        top = float(np.max(self.p))
        return top, float(self.integrals.points[np.argmax(self.p >= top * (1.0 - 1e-12))])

    @property
    def fronts(self) -> tuple[list[float], list[float]]:
        """x of all ruptures and reformations, m."""
        x, before = self.integrals.points[:-1], np.concatenate([[not self.enters], self.full[:-1]])
        return x[before & ~self.full].tolist(), x[~before & self.full].tolist()


def solve_line(
    line: LineIntegrals, mu: float, U: float, p_a: float, p_b: float, r_in: float = 0.0, closed: bool = False
) -> Line:
    """The steady film of a line.

    Parameters
    ----------
    mu : Pa s. U : m/s, not negative. p_a, p_b : pressures at the first and the last point, Pa above p_c, not negative.
    r_in : void fraction that enters at the first point; 0 unless p_a is. closed : nothing flows, as an end is; p_b is the
    pressure at the last point all the same.
    """
    places = np.concatenate(
        [np.nextafter(line.ends[:-1], np.inf)[:, None], line.at_gauss, np.nextafter(line.ends[1:], -np.inf)[:, None]], axis=1
    )
    h = line.film_at(places)

    def J_F(x: Array) -> tuple[Array, Array]:
        _, two, three = 6.0 * mu * line.upto(x)
        return three, U * two

    @cache
    def crossings(level: float) -> Array:
        """Where U h goes through a level."""
        over = level < U * h
        k, i = np.nonzero(over[:, 1:] != over[:, :-1])
        sign = np.where(over[k, i], 1.0, -1.0)
        return bisect(lambda x: sign * (U * line.film_at(x) - level), places[k, i], places[k, i + 1])

    J, F = J_F(line.ends)
    Q_full = float((p_a - p_b + F[-1]) / J[-1])
    Q = float(np.min((p_a + F[1:]) / J[1:]))
    if p_a == 0.0:
        Q = min(Q, U * float(h[0, 0]) * (1.0 - r_in))
    if closed:
        Q_full = Q = 0.0
    for _ in range(MOST if U and Q else 0):
        J_x, F_x = J_F(crossings(Q))
        least = float(np.min((p_a + F_x) / J_x, initial=Q))
        if not least < Q * (1.0 - SETTLED):
            break
        Q = least
    Q = Q_full if Q_full <= Q * (1.0 + SETTLED) else Q
    x = np.union1d(line.ends, crossings(Q)) if U else line.ends
    J, F = J_F(x)
    Z = F - Q * J
    p = _followed(Z, p_b)
    rise = np.diff(Z)
    empty = (p[:-1] == 0.0) & (U * line.film_at(0.5 * (x[1:] + x[:-1])) > Q + VOID * abs(Q))
    refills = empty & (p[1:] > 0.0) & (rise > p[1:] * (1.0 + 1e-9))
    dry = empty & ((p[1:] == 0.0) | refills)
    k = np.flatnonzero(refills)

    def below(t: Array) -> Array:
        J_t, F_t = J_F(t)
        return Z[k + 1] - (F_t - Q * J_t) - p[k + 1]

    x_f = bisect(below, x[k], x[k + 1])
    apart = (x_f - x[k] > SAME * x[-1]) & (x[k + 1] - x_f > SAME * x[-1])
    k, x_f = k[apart], x_f[apart]
    points = np.insert(x, k + 1, x_f)
    whole = np.insert(~dry, k + 1, True)
    return Line(LineIntegrals(line.film, points, fine=True), np.insert(p, k + 1, 0.0), whole, mu, U, Q, r_in > 0.0)


def solve_points(
    line: LineIntegrals, mu: float, U: float, p_a: float, p_b: float, r_in: float = 0.0, closed: bool = False
) -> tuple[Array, Array]:
    """p (Pa) and r of the discrete equations at all points but the first and the last; arguments as in `solve_line`."""
    _, two, three = 6.0 * mu * line.parts
    J, F = np.cumsum(three), U * np.cumsum(two) - r_in * U * two[0]
    Q = 0.0 if closed else min(float(np.min((p_a + F[:-1]) / J[:-1])), float((p_a - p_b + F[-1]) / J[-1]))
    p = _followed(F - Q * J, p_b)
    with np.errstate(divide="ignore", invalid="ignore"):
        r = 1.0 - (Q + p[1:] / three[1:]) / (U * line.films[1:])  # beside a full point its pressure drives flow back
    return p[:-1], np.where((p[:-1] == 0.0) & (U > 0.0), np.maximum(r, 0.0), 0.0)


def _followed(Z: Array, p_b: float) -> Array:
    """p followed upstream from p_b and stopped at zero."""
    best = np.maximum.accumulate(np.append(-Z[:-1], p_b - Z[-1])[::-1])[::-1]
    p = Z + best
    return np.where(p > ROUNDING * np.max(np.abs(Z)), p, 0.0)


@dataclass(frozen=True)
class Known:
    """What is known of a line without a solver: the film's own solution, and the discrete one on the owned points (p in Pa)."""

    line: Line
    p_pa: Array
    r: Array


def known_of(problem: LubricationProblem) -> Known | None:
    """None for 2D, a film without `integrals`, ends without a pressure or a wall, supplies inside, other equations."""
    grid, line = problem.grid, problem.integrals
    if line is None or not problem.plain or problem.U < 0 or problem.held is not None or not {*grid.ends[0]} <= KINDS:
        return None
    p_a, p_b, closed = *problem.p_sides[:2], "closed" in grid.ends[0]
    if grid.ends[0][1] == "closed":  # what the wall brings is pressed back: full, with the slope 6 mu U/h^2 all the way
        p_b = p_a + 6.0 * problem.mu * problem.U * float(np.sum(line.parts[1]))
    data: Any = (problem.mu, problem.U, p_a, p_b, problem.r_in, closed)
    if data not in line.known:
        with np.errstate(all="ignore"):
            line.known[data] = solve_line(line, *data), *solve_points(line, *data)
    known, p, r = line.known[data]
    p, r = (field[grid.x_start : grid.x_end] for field in (p, r))
    return Known(known, p, r) if np.isfinite(known.Q) else None


def known_fields(problem: LubricationProblem) -> Fields | None:
    """The discrete solution where no solver is needed for it; None for the films that `known_of` leaves out. Collective."""
    if (moving := getattr(problem, "moving", None)) is not None:  # a TurnedProblem
        turned = known_fields(moving)
        return None if turned is None else problem.here(turned)  # type: ignore[attr-defined, no-any-return]
    known = known_of(problem)
    return None if known is None else {"p": known.p_pa / problem.p_unit, "r": known.r}
