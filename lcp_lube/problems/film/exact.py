"""Exact solutions in 1D, against which accuracy is measured.

Steady, mass-conserving cavitation on [0, L], r the void fraction and alpha = h^3/(6 mu)::

    d/dx( U h (1 - r) - alpha p' ) = 0,   p r = 0,  p >= 0,  r >= 0,   p(0) = p_a,  p(L) = p_b,  r(0) = 0.

The flux Q is one constant. In the full film alpha p' = U h - Q, in the cavity r = 1 - Q/(U h).

**Q.** Let J(x) = Int_0^x 6 mu/h^3, F(x) = Int_0^x 6 mu U/h^2, and q = p_a + F - Q J the pressure of a film that is
full up to x. Where the film is full p' = q'; in the cavity p' = 0 <= q', because r >= 0 is U h >= Q. So q >= p >= 0
everywhere, with q = p up to the first rupture, where both are zero, or, if there is none, up to L, where both are p_b.
Hence ::

    Q = min( Q_full, min_x M(x) ),    M(x) = (p_a + F)/J,    Q_full = (p_a - p_b + F(L))/J(L),

and rupture is where M is least: there U h = Q, which is p = p' = 0, or h jumps up, or it is the inlet (p_a = 0,
M(0) = U h(0)). Stationary points of M are the roots of S(x) = p_a + F - U h J; S' = -U h' J, so S decreases where h
increases, and a monotone piece of the film has one such root at most.

**p.** Once Q is known the rest follows upstream from p(L) = p_b: p is the integral of p' = (U h - Q)/alpha, stopped at
zero while it would go below. Where it is stopped p' > 0, that is U h > Q: this is the cavity, and r > 0 as it must be.
It holds for any number of minima, jumps and cavities, for a cavity that reaches the outlet, and for none at all.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...base.parallel import Array
from ...errors import InputError
from .views import MirroredFilm

Indices = NDArray[np.intp]


_XI, _WEIGHT = np.polynomial.legendre.leggauss(16)
_TIE = 1e-14  # relative difference between two fluxes that rounding can make


@dataclass(frozen=True)
class ExactSolution:
    """Pressure and void fraction of a 1D film, and what engineers read off them.

    Attributes
    ----------
    rupture : where the (first) cavity begins (m); None in a full film.
    reformation : where it ends (m); None if there is none, or if it reaches the outlet.
    Q : flux per unit width (m2/s) of U h (1 - r) - alpha p'; half of it flows if one wall moves with U.
    p_max, x_max : greatest pressure (Pa) and its place (m).
    load : integral of p over [0, L] (N/m).
    """

    rupture: float | None
    reformation: float | None
    Q: float
    p_max: float
    x_max: float
    load: float
    _film: Any = field(repr=False, compare=False)
    _mu: float = field(repr=False, compare=False)
    _U: float = field(repr=False, compare=False)
    _x: Array = field(repr=False, compare=False)  # panel ends, shape (n,)
    _p: Array = field(repr=False, compare=False)  # pressure there
    _moving: "ExactSolution | None" = field(default=None, repr=False, compare=False)  # of the mirror image, where U < 0

    def p(self, x: ArrayLike) -> Array:
        """Return the pressure (Pa) at x (m), in the shape of x.

        Raises
        ------
        InputError : a point lies outside [0, L].
        """
        x = np.asarray(x, dtype=float)
        if self._moving is not None:
            return self._moving.p(self._x[-1] - x)
        L = self._x[-1]
        if not np.all((x >= -1e-12 * L) & (x <= (1 + 1e-12) * L)):  # grids round; NaN fails too
            raise InputError(f"x = {x.min()} .. {x.max()}: must be within 0 .. {L} (m)")
        k = np.clip(np.searchsorted(self._x, x, side="right"), 1, len(self._x) - 1)
        # no minimum inside a panel: one comparison does the stopping
        return np.maximum(self._p[k] - _gauss(self._slope, x, self._x[k]), 0)

    def r(self, x: ArrayLike) -> Array:
        """Return the void fraction (-) at x (m), in the shape of x; it raises what `p` raises."""
        x = np.asarray(x, dtype=float)
        if self._moving is not None:
            return self._moving.r(self._x[-1] - x)
        p = self.p(x)
        if self.rupture is None:
            return np.zeros_like(p)
        dry = (p == 0) & (x >= self.rupture)
        return np.where(dry, np.maximum(1 - self.Q / (self._U * self._film(x)), 0), 0)

    def _slope(self, x: Array) -> Array:
        h = self._film(x)
        return 6 * self._mu * (self._U * h - self.Q) / h**3


def exact_solution(film: Any, L: float, mu: float, U: float, p_a: float, p_b: float) -> ExactSolution:
    """Solve the 1D cavitation problem exactly, to quadrature of nearly machine precision.

    Theory in the head of this file. Rounding leaves an error of some 1e-14 of 6 mu U L/h_min^2 in p, so a film ratio of
    1 + 1e-6 leaves fewer digits than one of 2.

    Parameters
    ----------
    film : h(x) (m), smooth and monotone between the places (m) that its `breakpoints()` gives; jumps are allowed there.
    L, mu : length (m) and viscosity (Pa s), positive.
    U : speed of the wall (m/s); at U = 0 nothing ruptures, and where it is negative the mirror image is solved.
    p_a, p_b : pressures at x = 0 and x = L above the cavitation pressure (Pa), not negative.

    Raises
    ------
    InputError : a number out of its range, or a film that is not positive or not smooth between its breakpoints.
    """
    for name, value in {"L": L, "mu": mu}.items():
        if not 0 < value < math.inf:
            raise InputError(f"{name} = {value}: must be positive and finite")
    if not math.isfinite(U):
        raise InputError(f"U = {U}: must be finite")
    for name, value in {"p_a": p_a, "p_b": p_b}.items():
        if not 0 <= value < math.inf:
            raise InputError(f"{name} = {value}: must be finite and not negative (Pa above the cavitation pressure)")
    if U < 0:
        moving = exact_solution(MirroredFilm(film, L), L, mu, -U, p_b, p_a)
        rupture, reformation = (None if at is None else L - at for at in (moving.rupture, moving.reformation))
        return replace(moving, rupture=rupture, reformation=reformation, Q=-moving.Q, x_max=L - moving.x_max, _moving=moving)

    x = _panels(film, L)
    Q, rupture = _flux(film, x, mu, U, p_a, p_b)

    # Ends of panels at all U h = Q: there p has its maxima, and cavities begin.
    lo, hi = _inside(x)
    side = np.sign(U * film(lo) - Q)
    change = side * (U * film(hi) - Q) < 0
    x = np.union1d(x, bisect(lambda t: side[change] * (U * film(t) - Q), lo[change], hi[change]))

    p = np.full(len(x), float(p_b))
    solution = ExactSolution(rupture, None, Q, 0, 0, 0, film, mu, U, x, p)
    rise = _gauss(solution._slope, x[:-1], x[1:])
    for k in range(len(x) - 2, -1, -1):
        p[k] = max(p[k + 1] - rise[k], 0)

    fronts = np.empty(0)
    if rupture is not None:
        # Ahead of the rupture the film is full, also where p is zero: at the inlet with p_a = 0.
        behind = np.arange(len(x) - 1) >= np.argmin(abs(x - rupture))
        j = np.flatnonzero(behind & (p[:-1] == 0) & (p[1:] > 0))
        fronts = bisect(lambda t: _gauss(solution._slope, t, x[j + 1]) - p[j + 1], x[j], x[j + 1])
    ends = np.union1d(x, fronts)
    top = np.argmax(p)
    return ExactSolution(
        rupture=rupture,
        reformation=float(fronts[0]) if len(fronts) else None,
        Q=Q,
        p_max=float(p[top]),
        x_max=float(x[top]),
        load=float(np.sum(_gauss(solution.p, ends[:-1], ends[1:]))),
        _film=film,
        _mu=mu,
        _U=U,
        _x=x,
        _p=p,
    )


def _flux(film: Any, x: Array, mu: float, U: float, p_a: float, p_b: float) -> tuple[float, float | None]:
    """Return Q (m2/s) and the rupture point (m) or None: the minimum of M(x), see the head of this file."""

    def J_F(a: Array, b: Array) -> tuple[Array, Array]:
        return _gauss(lambda t: 6 * mu / film(t) ** 3, a, b), _gauss(lambda t: 6 * mu * U / film(t) ** 2, a, b)

    J, F = (np.append(0, np.cumsum(part)) for part in J_F(x[:-1], x[1:]))
    Q_full = float((p_a - p_b + F[-1]) / J[-1])

    def J_F_at(t: Array, k: Indices) -> tuple[Array, Array]:
        J_t, F_t = J_F(x[k], t)
        return J[k] + J_t, F[k] + F_t

    def S(t: Array, k: Indices) -> Array:
        J_t, F_t = J_F_at(t, k)
        return p_a + F_t - U * film(t) * J_t

    # M is least at a root of S, or at a panel end, where the film may jump.
    lo, hi = _inside(x)
    every = np.arange(len(lo))
    k = np.flatnonzero((S(lo, every) > 0) & (S(hi, every) <= 0))
    where = np.append(bisect(lambda t: S(t, k), lo[k], hi[k]), x[1:])
    J_w, F_w = J_F_at(where, np.append(k, every + 1))
    M = (p_a + F_w) / J_w
    least = np.argmin(M)
    Q, rupture = float(M[least]), float(where[least])

    h_a = film(lo[:1])[0]
    if p_a == 0 and U * h_a <= Q * (1 + _TIE):
        # The film is nowhere thinner than at the inlet: the cavity begins there, or where an even stretch ends.
        thicker = film(hi) > h_a
        Q, rupture = float(U * h_a), float(x[np.argmax(thicker)])
    return (Q_full, None) if Q_full <= Q * (1 + _TIE) else (Q, rupture)


def _panels(film: Any, L: float) -> Array:
    """Return ends of panels on which 16 Gauss points integrate h^-3 to rounding, shape (n,), from 0 to L."""
    pieces = np.unique([0.0, *(s for s in film.breakpoints() if 0 < s < L), L])
    few = len(pieces) <= 1000  # the pieces of a long profile are short enough by themselves
    x = np.unique(np.concatenate([np.linspace(a, b, 5) for a, b in pairwise(pieces)])) if few else pieces
    most = 10_000 + 4 * len(x)

    def weight(t: Array) -> Array:
        h = film(t)
        if not np.all((h > 0) & (h < math.inf)):
            raise InputError(f"h = {h.min()} .. {h.max()}: the film must be positive and finite (m)")
        return (L / h) ** 3

    while len(x) < most:
        middle = (x[:-1] + x[1:]) / 2
        whole = _gauss(weight, x[:-1], x[1:])
        halves = _gauss(weight, x[:-1], middle) + _gauss(weight, middle, x[1:])
        # A panel good to 1e-10 has halves that are good to rounding; asking for more would chase the noise of h.
        # Ends that rounding sets apart, or a jump that the film does not tell of, stay between two close ends.
        bad = (abs(whole - halves) > 1e-10 * halves) & (np.diff(x) > 1e-13 * L)
        if not bad.any():
            return np.union1d(x, middle)
        x = np.union1d(x, middle[bad])
    raise InputError(f"film: not smooth between its breakpoints, from x = {middle[bad][0]} m on")


def _inside(x: Array) -> tuple[Array, Array]:
    """Return the first and the last point inside each panel, where a film that jumps at the ends has its own side."""
    return np.nextafter(x[:-1], math.inf), np.nextafter(x[1:], -math.inf)


def _gauss(f: Callable[[Array], Array], a: Array, b: Array) -> Array:
    """Return the integrals of f from a to b by 16 Gauss points, in the broadcast shape of a and b."""
    half = (np.asarray(b) - a) / 2
    points = (np.asarray(a) + half)[..., None] + half[..., None] * _XI
    return half * np.sum(f(points) * _WEIGHT, axis=-1)


def bisect(f: Callable[[Array], Array], a: Array, b: Array, ends: tuple[Array, Array] | None = None) -> Array:
    """Return the roots of f, positive at a and not at b, in all brackets at once; rounding cannot make it fail.

    Where they are few, f is asked at many places of a bracket at once, along a first axis: a call costs more than a place then.
    They lie closest around the chord's root, so that a bracket of a smooth f shrinks to what the chord errs by. ends : f at
    a and at b, where they are known.
    """
    if not np.size(a):
        return b
    few = np.size(a) < 256
    even, near = (np.arange(1, 8) / 8.0, 4.0 ** -np.arange(2.0, 21.0)) if few else (np.array([0.5]), np.zeros(0))
    column = (-1, *[1] * np.ndim(a))
    even, around = even.reshape(column), np.concatenate([-near, 0.0 * near[:1], near]).reshape(column)
    f_a, f_b = ends or (np.ones_like(a), -np.ones_like(b))
    for _ in range(60):
        if not (np.nextafter(a, b) < b).any():
            break
        with np.errstate(all="ignore"):
            chord = np.fmax(np.fmin(f_a / (f_a - f_b), 1.0), 0.0)
        inside = np.minimum(np.maximum(a + (b - a) * np.concatenate([even + 0.0 * chord, chord + around]), a), b)
        inside.sort(axis=0)
        values = f(inside)
        x, f_x = (np.concatenate([left[None], of, right[None]]) for left, of, right in ((a, inside, b), (f_a, values, f_b)))
        last = np.logical_and.accumulate(values > 0, axis=0).sum(axis=0)
        at = tuple(np.indices(last.shape, sparse=True))
        (a, f_a), (b, f_b) = ([of[last + k, *at] for of in (x, f_x)] for k in (0, 1))
    return b
