"""A line solved by quadrature, as the film has it and as the grid has it: what the grid gets wrong is their difference.

Steady flow along a line is one number Q (head of `exact`). In terms of J(x) = Int_0^x 6 mu/h^3, F(x) = Int_0^x 6 mu U/h^2 and
Z = F - Q J, the pressure of a film that is full all the way up to a constant,

    Q = min( (p_a - p_b + F(L))/J(L), min_x M(x), U h(0) (1 - r_in) if p_a = 0 ),     M = (p_a + F)/J,
    p(x) = Z(x) + max( p_b - Z(L), max_{t >= x} -Z(t) ),

p followed upstream from p_b and stopped at zero. It ruptures where U h rises through Q, or at an edge, and reforms where p,
followed upstream, is zero. The discrete equations with the fluxes of `integrals` are solved by the same two lines with the
points alone in the place of x, and with F less the void that enters, r_in F_1: so their Q and p are known, whoever solves them.

`known` puts lines together where supplies part them, and says what the grid gets wrong.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...base.parallel import Array
from .cavity import VOID, followed
from .exact import bisect
from .fluid import Law
from .integrals import SAME, LineIntegrals

Flags = NDArray[np.bool_]
ISOVISCOUS = Law()
ROUNDING = 4e-15  # of the largest |Z|: a pressure below it is zero
SETTLED = 1e-15  # relative change of Q
NEAR = 1e-11  # after such a change the next one, of second order, is below SETTLED on films whose h' x is over 1e-6 h
MOST = 200  # looks for the least M: they converge by second order, from far away by halves


@dataclass(frozen=True)
class Line:
    """Pressure along a line from side to side.

    Attributes
    ----------
    integrals : between points, the ends of its panels: all places where U h = Q and all fronts among them. q : there, Pa
        above p_c: the pressure, of Barus' fluid the unknown in its place (`fluid`). full : of each piece between two of them,
        whether it is full. Q : the equation's flow, m2/s, twice what flows. enters : whether void does at x = 0. law : of the
        fluid by the pressure.
    """

    integrals: LineIntegrals
    q: Array
    full: Flags
    mu: float
    U: float
    Q: float
    enters: bool
    law: Law = ISOVISCOUS

    @property
    def p(self) -> Array:
        """At the points, Pa above p_c; not finite where no pressure carries the flow."""
        return self.law.pressure(self.q)

    @cached_property
    def q_within(self) -> Array:
        """q at the panels' Gauss points."""
        line = self.integrals
        rise = 6.0 * self.mu * line.within(line.thicker * (self.U - self.Q * line.swollen / line.h) / line.h**2)
        return np.where(self.full[:, None], self.q[:-1, None] + rise, 0.0)

    @cached_property
    def _thicker(self) -> Array | float:
        """mu/mu_0 at the panels' Gauss points."""
        by_p = 1.0 - self.law.barus * self.q_within if self.law.barus else 1.0
        return self.integrals.thicker / by_p

    @cached_property
    def slope(self) -> Array:
        """p' at the panels' Gauss points, Pa/m; 0 in cavities."""
        h, swollen = self.integrals.h, self.integrals.swollen
        rise = self._thicker * (6.0 * self.mu * (self.U - self.Q * swollen / h) / h**2)
        return np.where(self.full[self.integrals.interval, None], rise, 0.0)

    def integral(self, antiderivative: Callable[[Array], Array], above: float = 0.0) -> float:
        """Integral of (p - above) w over the line, w by its antiderivative W: sums of p_1 [W] + Int p' (W_2 - W)."""
        line = self.integrals
        x, k = line.points, line.interval
        back = line.turned_back(0.5 * (x[1:] + x[:-1]))
        start, end = antiderivative(x[:-1] - back), antiderivative(x[1:] - back)
        behind = end[k, None] - antiderivative(line.at_gauss - back[k, None])
        return float(np.sum((self.p[:-1] - above) * (end - start)) + np.sum(line.weigh(self.slope * behind)))

    @property
    def friction(self) -> float:
        """Integral of mu U (1 - r)/h + (h/2) p', N/m: of 4 mu U/h - 3 mu Q/(rho h^2) where full, mu Q/h^2 in cavities."""
        if self.law.barus or self.integrals.along is not None:
            h, full = self.integrals.h, self.full[self.integrals.interval, None]
            shear = np.where(full, 4.0 * self.U - 3.0 * self.Q * self.integrals.swollen / h, self.Q / h) * self._thicker / h
            return float(self.mu * np.sum(self.integrals.weigh(shear)))
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


@dataclass(frozen=True)
class Flow:
    """Q of a line, m2/s, and its derivatives by the pressures (of Barus' fluid by q) at its ends, m2/s/Pa.

    crossings : where U h = Q, if that has been looked for.
    """

    Q: float
    by_a: float = 0.0
    by_b: float = 0.0
    crossings: Array | None = None


def crossings(line: LineIntegrals, U: float, level: float, exactly: bool = True) -> Array:
    """Where U h goes through a level; else where straight lines between the looks do."""
    places, h = line.looks
    over = level < U * h
    k, i = np.nonzero(over[:, 1:] != over[:, :-1])
    sign = np.where(over[k, i], 1.0, -1.0)
    (a, b), (f_a, f_b) = ([of[k, i + one] for one in (0, 1)] for of in (places, U * h - level))
    if not exactly:
        return a + (b - a) * (f_a / (f_a - f_b))
    return bisect(lambda x: sign * (U * line.carries(x) - level), a, b, (sign * f_a, sign * f_b))


def line_flow(
    line: LineIntegrals, mu: float, U: float, p_a: float, p_b: float, r_in: float = 0.0, closed: bool = False
) -> Flow:
    """What flows; arguments as in `solve_line`."""
    if closed:
        return Flow(0.0)
    J, F = _J_F(line, mu, U, line.ends)
    least, at = _least((p_a + F[1:]) / J[1:], J[1:])
    if p_a == 0.0 and (enters := U * float(line.looks[1][0, 0]) * (1.0 - r_in)) < least:
        least, at = enters, np.inf
    x: Array | None = None
    for look in range(MOST if U and least else 0):
        x = crossings(line, U, least, exactly=look > 0)  # M is level there: the first one errs by the fourth power of a look
        J_x, F_x = _J_F(line, mu, U, x)
        Q, J_Q = _least((p_a + F_x) / J_x, J_x)
        if not least * (1.0 - SETTLED) > Q:
            if look:
                break
            continue
        near, least, at = least * (1.0 - NEAR) <= Q, Q, J_Q
        if near and look:
            break
        x = None
    Q_full = float((p_a - p_b + F[-1]) / J[-1])
    return Flow(Q_full, 1.0 / J[-1], -1.0 / J[-1]) if Q_full <= least * (1.0 + SETTLED) else Flow(least, 1.0 / at, 0.0, x)


def _least(M: Array, J: Array) -> tuple[float, float]:
    """The least of M and the J there; inf where there is none."""
    k = int(np.argmin(M)) if M.size else 0
    return (float(M[k]), float(J[k])) if M.size else (np.inf, np.inf)


def _J_F(line: LineIntegrals, mu: float, U: float, x: Array) -> tuple[Array, Array]:
    _, two, three = 6.0 * mu * line.upto(x)
    return three, U * two


def solve_line(
    line: LineIntegrals,
    mu: float,
    U: float,
    p_a: float,
    p_b: float,
    r_in: float = 0.0,
    closed: bool = False,
    law: Law = ISOVISCOUS,
) -> Line:
    """The steady film of a line.

    Parameters
    ----------
    mu : Pa s. U : m/s, not negative. p_a, p_b : pressures at the first and the last point, Pa above p_c, not negative.
    r_in : void fraction that enters at the first point; 0 unless p_a is. closed : nothing flows, as an end is; p_b is the
    pressure at the last point all the same. law : of Barus' fluid, whose p_a and p_b are q.
    """
    flow = line_flow(line, mu, U, p_a, p_b, r_in, closed)
    Q, x = flow.Q, line.ends
    if U:
        x = np.union1d(x, crossings(line, U, Q) if flow.crossings is None else flow.crossings)
    J, F = _J_F(line, mu, U, x)
    Z = F - Q * J
    p = _followed(Z, p_b)
    rise = np.diff(Z)
    empty = (p[:-1] == 0.0) & (U * line.carries(0.5 * (x[1:] + x[:-1])) > Q + VOID * abs(Q))
    refills = empty & (p[1:] > 0.0) & (rise > p[1:] * (1.0 + 1e-9))
    dry = empty & ((p[1:] == 0.0) | refills)
    k = np.flatnonzero(refills)

    def below(t: Array) -> Array:
        J_t, F_t = _J_F(line, mu, U, t)
        return Z[k + 1] - (F_t - Q * J_t) - p[k + 1]

    x_f = bisect(below, x[k], x[k + 1], (rise[k] - p[k + 1], -p[k + 1]))
    begins = x_f - x[k] <= SAME * x[-1]
    dry[k[begins]] = False
    apart = ~begins & (x[k + 1] - x_f > SAME * x[-1])
    k, x_f = k[apart], x_f[apart]
    points = np.insert(x, k + 1, x_f)
    whole = np.insert(~dry, k + 1, True)
    found = LineIntegrals(line.film, points, fine=True, along=line.along)
    found.ring = line.ring
    return Line(found, np.insert(p, k + 1, 0.0), whole, mu, U, Q, r_in > 0.0, law)


def solve_points(
    parts: Array, mu: float, U: float, p_a: float, p_b: float, r_in: float = 0.0, closed: bool = False
) -> tuple[Array, Array, Flow]:
    """p (Pa) and r of the discrete equations at all points but the first and the last, and what flows.

    parts : `LineIntegrals.parts` between the points; the other arguments as in `solve_line`.
    """
    _, two, three = 6.0 * mu * parts
    J, F = np.cumsum(three), U * np.cumsum(two) - r_in * U * two[0]
    least, at = _least((p_a + F[:-1]) / J[:-1], J[:-1])
    Q_full = float((p_a - p_b + F[-1]) / J[-1])
    flow = Flow(Q_full, 1.0 / J[-1], -1.0 / J[-1]) if Q_full <= least else Flow(least, 1.0 / at)
    flow = Flow(0.0) if closed else flow
    p = _followed(F - flow.Q * J, p_b)
    with np.errstate(divide="ignore", invalid="ignore"):
        void = 1.0 - (flow.Q + p[1:] / three[1:]) / (
            U * two[1:] / three[1:]
        )  # beside a full point its pressure drives flow back
    return p[:-1], np.where((p[:-1] == 0.0) & (U > 0.0), np.maximum(void, 0.0), 0.0), flow


def _followed(Z: Array, p_b: float) -> Array:
    """As `cavity.followed`, without pressures that are rounding."""
    p = followed(Z, p_b)
    return np.where(p > ROUNDING * np.max(np.abs(Z)), p, 0.0)
