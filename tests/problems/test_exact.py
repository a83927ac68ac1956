"""Exact 1D solutions: printed tables, closed forms, and the equations themselves as laws."""

from dataclasses import dataclass
from math import atan2, cos, log, pi, sin, sqrt

import numpy as np
import pytest
from films import CD, DC, WAVES, Wave
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.optimize import brentq

from lcp_lube.errors import InputError
from lcp_lube.problems.film.exact import exact_solution
from lcp_lube.problems.film.profile import PiecewiseLinear
from lcp_lube.problems.film.shapes import Sum

FORMS = (CD, DC)
L, MU, U = 0.1, 0.015, 5.0


@dataclass(frozen=True)
class Pad:
    """Straight pad from h_a to h_b with a pocket, a jump of the given depth, between two points."""

    h_a: float
    h_b: float
    length: float
    pocket: tuple[float, float] = (0.0, 0.0)
    depth: float = 0.0

    def __call__(self, x, y=None):
        x = np.asarray(x)
        inside = (x > self.pocket[0]) & (x < self.pocket[1])
        return self.h_a + (self.h_b - self.h_a) * x / self.length + self.depth * inside

    def breakpoints(self):
        return self.pocket


@dataclass(frozen=True)
class Ripple:
    """Several equal waves."""

    waves: int = 4

    def __call__(self, x, y=None):
        return 20e-6 * (1 + 0.5 * np.cos(2 * pi * self.waves * np.asarray(x) / L))

    def breakpoints(self):
        return tuple(np.arange(2 * self.waves + 1) * L / (2 * self.waves))


def wave(shape="sinusoid", form=CD, ratio=5 / 3, h_min=15e-6):
    return Wave(shape, form, h_min, ratio * h_min, 0, L)


def scale(h_min):
    """What rounding errors in p are relative to."""
    return 6 * MU * U * L / h_min**2


@pytest.mark.parametrize(
    "form, p_0, rupture, reformation, Q, p_max, load",
    [
        (CD, 0, 0.065974581544, None, 8.657063555921e-05, 5914573.39206, 212771.44779),
        (CD, 1e6, 0.066679293337, 0.095363606341, 8.751718061681e-05, 6624157.84999, 256421.47042),
        (DC, 1e6, 0.010760001894, 0.074198534553, 8.049906681699e-05, 2000000.0, 40857.61297),
    ],
    ids=["problem1", "problem2", "problem3"],
)
def test_reference_table(form, p_0, rupture, reformation, Q, p_max, load):
    """Every printed digit of the table in the bearing specification."""
    exact = exact_solution(wave(form=form), L, MU, U, p_0, p_0)
    assert exact.rupture == pytest.approx(rupture, abs=0.5e-12)
    assert exact.reformation == (None if reformation is None else pytest.approx(reformation, abs=0.5e-12))
    np.testing.assert_allclose(exact.Q, Q, rtol=0, atol=0.5e-17)
    assert exact.p_max == pytest.approx(p_max, abs=0.5e-5)
    assert exact.load == pytest.approx(load, abs=0.5e-5)
    if form == DC:
        assert exact.x_max == pytest.approx(0.0892400, abs=0.5e-7)


def test_parabolic_slider():
    length = 76.2e-3
    exact = exact_solution(Wave("parabola", CD, 25.4e-6, 50.8e-6, 0, length), length, 0.039, 4.57, 0, 0)
    assert exact.rupture is not None
    assert exact.rupture / length == pytest.approx(0.67893443, abs=0.5e-8)
    assert exact.x_max / length == pytest.approx(0.32106557, abs=0.5e-8)
    assert exact.p_max == pytest.approx(3591787.27, abs=0.5e-2)
    assert exact.load == pytest.approx(101349.500, abs=0.5e-3)


def test_long_journal_bearing():
    """P = p (c/R)^2/(mu omega), here c = R = mu = omega = 1."""
    exact = exact_solution(Wave("sinusoid", CD, 0.5, 1.5, 0, 2 * pi), 2 * pi, 1.0, 1.0, 0, 0)
    assert exact.rupture is not None
    assert np.degrees(exact.rupture) == pytest.approx(219.69402, abs=0.5e-5)
    assert np.degrees(exact.x_max) == pytest.approx(140.30599, abs=1e-5)  # printed one unit off 360 - 219.694016
    assert exact.p_max == pytest.approx(4.47498820, abs=0.5e-8)
    assert 1 - exact.r(2 * pi) == pytest.approx(0.41017791, abs=0.5e-8)


def test_pocketed_pad():
    """A film that jumps: rupture at the step, without p' = 0."""
    film, p_0 = Pad(1.05e-6, 1e-6, 0.01, (0.002, 0.005), 1e-6), 1e5
    exact = exact_solution(film, 0.01, 0.01, 1.0, p_0, p_0)
    assert (exact.rupture, exact.x_max) == (0.002, 0.005)
    assert exact.reformation == pytest.approx(3.6112626558e-3, abs=0.5e-13)
    assert exact.r(np.nextafter(0.002, 1)) == pytest.approx(0.4872906839, abs=0.5e-10)
    assert exact.p_max == pytest.approx(9808818.754, abs=0.5e-3)
    assert exact.load - p_0 * 0.01 == pytest.approx(34165.70098, abs=0.5e-5)

    hidden = Pad(1.05e-6, 1e-6, 0.01, (0.002, 0.005), 1e-6)
    object.__setattr__(hidden, "breakpoints", lambda: ())  # found by bisection
    assert exact_solution(hidden, 0.01, 0.01, 1.0, p_0, p_0).load == pytest.approx(exact.load, rel=1e-10)

    exact = exact_solution(film, 0.01, 0.01, 0.02, p_0, p_0)
    assert exact.rupture is None and not exact.r(np.linspace(0, 0.01, 99)).any()
    np.testing.assert_allclose(exact.p([0.002, 0.005]), [40621.8837, 451923.9105], atol=0.5e-4)
    assert exact.load - p_0 * 0.01 == pytest.approx(1333.4520, abs=0.5e-4)


def test_converging_slider():
    """Rayleigh's plane slider; it never cavitates."""
    h_a, h_b = 50e-6, 20e-6
    exact = exact_solution(Pad(h_a, h_b, L), L, MU, U, 0, 0)
    assert exact.rupture is None and exact.reformation is None
    np.testing.assert_allclose(exact.Q, 2 * U * h_a * h_b / (h_a + h_b), rtol=1e-13)
    load = 6 * MU * U * (L / (h_a - h_b)) ** 2 * (log(h_a / h_b) - 2 * (h_a - h_b) / (h_a + h_b))
    assert exact.load == pytest.approx(load, rel=1e-12)


def test_diverging_slider():
    """Without supply pressure the cavity begins at the inlet, with little of it just behind."""
    film, x = Pad(20e-6, 50e-6, L), np.linspace(0, L, 101)
    exact = exact_solution(film, L, MU, U, 0, 0)
    assert (exact.rupture, exact.reformation, exact.Q, exact.load) == (0.0, None, U * 20e-6, 0.0)
    np.testing.assert_allclose(exact.r(x), 1 - 20e-6 / film(x), atol=1e-15)
    for p_a in (1.0, 1e3, 1e5):  # p'(0) = -6 mu U h' x_r/h^3 for little p_a
        exact = exact_solution(film, L, MU, U, p_a, 0)
        np.testing.assert_allclose(exact.Q, U * film(exact.rupture), rtol=1e-13)
        assert exact.rupture == pytest.approx(sqrt(p_a * 20e-6**3 / (3 * MU * U * 3e-4)), rel=1e-4 * sqrt(p_a))


@pytest.mark.parametrize("p_a, p_b", [(0, 0), (1e6, 1e6), (1e6, 0), (0, 1e6)])
def test_even_film_has_linear_pressure(p_a, p_b):
    x = np.linspace(0, L, 101)
    exact = exact_solution(wave(ratio=1), L, MU, U, p_a, p_b)
    assert exact.rupture is None and not exact.r(x).any()
    np.testing.assert_allclose(exact.p(x), p_a + (p_b - p_a) * x / L, atol=1e-13 * scale(15e-6))
    assert exact.load == pytest.approx((p_a + p_b) / 2 * L, abs=1e-13 * scale(15e-6) * L)


class Sommerfeld:
    """Closed forms for h = K (1 + e cos t), t = 2 pi x/L + phase, by cos g = (e + cos t)/(1 + e cos t)."""

    def __init__(self, ratio, form, h_min):
        self.K, self.e = h_min * (ratio + 1) / 2, (ratio - 1) / (ratio + 1)
        self.one_minus_e, self.phase = 2 / (ratio + 1), 0 if form == CD else pi

    def h(self, x):
        return self.K * (self.one_minus_e + 2 * self.e * cos((2 * pi * x / L + self.phase) / 2) ** 2)

    def integrals(self, x):
        """J and F of the module, but for a constant."""
        t, e = 2 * pi * x / L + self.phase, self.e
        turns = round(t / (2 * pi))
        half = t / 2 - pi * turns
        g = 2 * pi * turns + 2 * atan2(sqrt(self.one_minus_e) * sin(half), sqrt(1 + e) * cos(half))
        b = self.one_minus_e * (1 + e)
        F = 6 * MU * U / self.K**2 * L / (2 * pi) * (g - e * sin(g)) / b**1.5
        J = 6 * MU / self.K**3 * L / (2 * pi) * (g * (1 + e**2 / 2) - 2 * e * sin(g) + e**2 * sin(2 * g) / 4) / b**2.5
        return J, F

    def rise(self, a, b, Q):
        """Pressure difference over a full film."""
        (J_a, F_a), (J_b, F_b) = self.integrals(a), self.integrals(b)
        return F_b - F_a - Q * (J_b - J_a)


@pytest.mark.parametrize("ratio", [1.5, 10, 1e3, 1e4])
@pytest.mark.parametrize("form, supply", [(CD, 0), (CD, 1e-3), (CD, 2e-2), (DC, 1e-3), (DC, 2e-2)])
def test_sommerfeld_cavitated(ratio, form, supply):
    h_min = 1e-6
    closed, p_0 = Sommerfeld(ratio, form, h_min), supply * scale(h_min) / sqrt(ratio)
    exact = exact_solution(wave("sinusoid", form, ratio, h_min), L, MU, U, p_0, p_0)
    diverging = (L / 2, L) if form == CD else (0, L / 2)
    x_r = brentq(lambda x: p_0 + closed.rise(0, x, U * closed.h(x)), *diverging, xtol=1e-18)
    Q = U * closed.h(x_r)
    assert exact.rupture == pytest.approx(x_r, rel=1e-10)
    np.testing.assert_allclose(exact.Q, Q, rtol=1e-12)
    assert exact.p_max == pytest.approx(closed.rise(0, L - x_r, Q) + p_0 if form == CD else 2 * p_0, rel=1e-10)

    x_f = L
    if p_0:
        x_f = brentq(lambda x: closed.rise(x, L, Q) - p_0, x_r, L - x_r if form == DC else L, xtol=1e-18)
        assert exact.reformation == pytest.approx(x_f, rel=1e-12)
    x = np.concatenate([np.linspace(0, x_r, 50), np.linspace(x_f, L, 50)])
    p = [p_0 + closed.rise(0, t, Q) if t < x_f else p_0 - closed.rise(t, L, Q) for t in x]
    np.testing.assert_allclose(exact.p(x), p, rtol=1e-10, atol=1e-10 * exact.p_max)

    peak = min(max(L - x_r, 0), L)
    parts = [quad(lambda t: p_0 + closed.rise(0, t, Q), 0, x_r, points=[min(peak, x_r / 2), x_r / 2], epsrel=1e-12)[0]]
    if p_0:
        parts.append(quad(lambda t: p_0 - closed.rise(t, L, Q), x_f, L, points=[(x_f + L) / 2], epsrel=1e-12)[0])
    assert exact.load == pytest.approx(sum(parts), rel=1e-10)


@pytest.mark.parametrize("ratio", [1.5, 10, 1e3, 1e4])
@pytest.mark.parametrize("shape", WAVES)
@pytest.mark.parametrize("form", FORMS)
def test_full_film_is_antisymmetric(ratio, shape, form):
    """Under a high enough supply pressure p - p_0 is odd about the middle, so the load is p_0 L."""
    h_min = 1e-6
    p_0 = 0.2 * scale(h_min)
    exact = exact_solution(wave(shape, form, ratio, h_min), L, MU, U, p_0, p_0)
    assert exact.rupture is None
    assert exact.load == pytest.approx(p_0 * L, rel=1e-11)
    x = np.linspace(0, L, 1001)
    np.testing.assert_allclose(exact.p(x) + exact.p(x[::-1]), 2 * p_0, rtol=1e-10)
    if shape == "sinusoid":
        e = (ratio - 1) / (ratio + 1)
        b = 4 * ratio / (ratio + 1) ** 2  # 1 - e^2
        np.testing.assert_allclose(exact.Q, U * h_min * (ratio + 1) * b / (2 + e**2), rtol=1e-12)


def flux_defect(exact, film, n=4000):
    """Greatest |p(x2) - p(x1) - Int 6 mu (U h (1 - r) - Q)/h^3| over n cells: the equation, by a rule of its own."""
    ends = [s for s in (exact.rupture, exact.reformation, *film.breakpoints()) if s is not None]
    # cells as small as the film is thin: x as a function of Int 1/h
    t = np.linspace(0, L, 20 * n + 1)
    weight = np.append(0, np.cumsum(1 / film((t[1:] + t[:-1]) / 2)))
    x = np.union1d(np.interp(np.linspace(0, weight[-1], n + 1), weight, t), ends)
    xi, w = np.polynomial.legendre.leggauss(4)
    half = np.diff(x)[:, None] / 2
    points = x[:-1, None] + half * (1 + xi)
    h = film(points)
    slope = 6 * MU * (U * h * (1 - exact.r(points)) - exact.Q) / h**3
    return np.max(abs(np.diff(exact.p(x)) - np.sum(half * w * slope, axis=1)))


pressures = st.one_of(st.just(0.0), st.floats(-6, 0).map(lambda s: 10**s))  # parts of scale(h_min)
waves = st.builds(
    lambda shape, form, decades: wave(shape, form, 10**decades, 1e-6),
    st.sampled_from(WAVES),
    st.sampled_from(FORMS),
    st.one_of(st.just(0.0), st.floats(0.01, 4)),
)


@settings(deadline=None)
@given(waves, pressures, pressures)
def test_laws(film, p_a, p_b):
    """Signs, complementarity, boundary values and the equation itself: together they leave one solution only."""
    unit = scale(film.h_min)
    exact = exact_solution(film, L, MU, U, p_a * unit, p_b * unit)
    x = np.sort(np.append(np.linspace(0, L, 1000), film.breakpoints()))
    p, r = exact.p(x), exact.r(x)
    assert np.all(p >= 0) and np.all((r >= 0) & (r < 1)) and np.all(p * r == 0)
    np.testing.assert_allclose(p[[0, -1]], [p_a * unit, p_b * unit], rtol=1e-10, atol=1e-12 * unit)
    assert flux_defect(exact, film) < 1e-10 * unit
    assert np.all(p <= exact.p_max * (1 + 1e-12)) and exact.p(exact.x_max) == pytest.approx(exact.p_max, rel=1e-12)
    if exact.rupture is None:
        assert exact.reformation is None and not r.any()
    else:
        assert np.all(r[x <= exact.rupture] == 0)
        assert (exact.reformation is None) == (p_b == 0 and U * film(L) >= exact.Q)
        assert exact.p(exact.rupture) <= 1e-12 * unit


@settings(deadline=None, max_examples=50)
@given(waves, pressures, pressures, *[st.floats(0.1, 10)] * 4)
def test_scaling(film, p_a, p_b, k_x, k_h, k_mu, k_U):
    """p scales with mu U L/h^2, r not at all, Q with U h. In particular mu -> k mu, U -> U/k leaves p alone."""
    unit = scale(film.h_min)
    k_p = k_mu * k_U * k_x / k_h**2
    one = exact_solution(film, L, MU, U, p_a * unit, p_b * unit)
    other_film = Wave(film.shape, film.form, k_h * film.h_min, k_h * film.h_max, 0, k_x * L)
    two = exact_solution(other_film, k_x * L, k_mu * MU, k_U * U, p_a * unit * k_p, p_b * unit * k_p)
    # r jumps at the front, so compare away from it
    x = np.array([s for s in np.linspace(0, L, 50) if abs(s - (one.reformation or -L)) > 1e-9 * L])
    np.testing.assert_allclose(two.p(k_x * x), k_p * one.p(x), atol=1e-10 * k_p * unit)
    np.testing.assert_allclose(two.r(k_x * x), one.r(x), atol=1e-9)
    np.testing.assert_allclose(two.Q / (k_h * k_U), one.Q, rtol=1e-11, atol=1e-11 * U * film.h_min)
    assert two.load == pytest.approx(k_p * k_x * one.load, rel=1e-9, abs=1e-11 * k_p * k_x * unit * L)


def test_several_cavities():
    film, x = Ripple(), np.linspace(0, L, 5000)
    exact = exact_solution(film, L, MU, U, 1e5, 1e5)
    p, r = exact.p(x), exact.r(x)
    assert np.count_nonzero(np.diff((r > 0).astype(int)) == 1) == 4
    assert np.all(p * r == 0) and np.all(r >= 0)
    np.testing.assert_allclose(p[[0, -1]], 1e5, rtol=1e-9)
    # the flux law holds in every cell but the few that hold a later front
    assert np.max(abs(np.diff(U * film(x) * (1 - r) - film(x) ** 3 / (6 * MU) * np.gradient(p, x)))[10:100]) < 1e-3
    dry = r > 0
    np.testing.assert_allclose((U * film(x) * (1 - r))[dry], exact.Q, rtol=1e-13)


def test_problem_4_film_on_a_line():
    """Even stretches before and after the wave, with kinks."""
    film = Wave("sinusoid", CD, 15e-6, 25e-6, 3 * L / 8, L / 4)
    exact = exact_solution(film, L, MU, U, 0, 0)
    assert exact.rupture is not None and exact.reformation is None
    assert L / 2 < exact.rupture < 5 * L / 8
    assert flux_defect(exact, film) < 1e-11 * scale(15e-6)
    upside_down = exact_solution(Wave("sinusoid", DC, 15e-6, 25e-6, 3 * L / 8, L / 4), L, MU, U, 0, 0)
    assert (upside_down.rupture, upside_down.p_max, upside_down.Q) == (3 * L / 8, 0.0, U * 15e-6)


def test_shapes_of_the_result():
    exact = exact_solution(wave(), L, MU, U, 0, 0)
    assert exact.p(0.03).shape == () and exact.r(np.full((3, 4), 0.09)).shape == (3, 4)
    for x in (-0.01, [0.05, 0.11], float("nan")):
        with pytest.raises(InputError, match=r"^x = .* must be within 0 \.\. 0\.1"):
            exact.p(x)


@pytest.mark.parametrize("name", ["L", "mu", "U"])
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
def test_refused_numbers(name, value):
    if name == "U" and value <= 0.0:
        return  # a film at rest, or one that moves to smaller x
    allowed = "finite" if name == "U" else "positive and finite"
    with pytest.raises(InputError, match=rf"^{name} = {value}: must be {allowed}"):
        exact_solution(wave(), **{"L": L, "mu": MU, "U": U, "p_a": 0, "p_b": 0, name: value})


@pytest.mark.parametrize("name", ["p_a", "p_b"])
@pytest.mark.parametrize("value", [-1.0, float("nan"), float("inf")])
def test_refused_pressures(name, value):
    with pytest.raises(InputError, match=rf"^{name} = {value}: must be finite and not negative"):
        exact_solution(wave(), **{"L": L, "mu": MU, "U": U, "p_a": 0, "p_b": 0, name: value})


def test_refused_films():
    with pytest.raises(InputError, match=r"^h = .*must be positive"):
        exact_solution(Pad(1e-6, -1e-6, L), L, MU, U, 0, 0)
    rough = Ripple(10**7)
    object.__setattr__(rough, "breakpoints", lambda: ())
    with pytest.raises(InputError, match=r"^film: not smooth between its breakpoints, from x = .* m on$"):
        exact_solution(rough, L, MU, U, 0, 0)


@pytest.mark.parametrize("ulps", [-2, -1, 1, 2])
def test_ends_that_rounding_sets_apart(ulps):
    """A wave from 3L/8 on whose end is not quite L, as sums of fractions of L are."""
    ends = [Wave("sinusoid", DC, 15e-6, 25e-6, 0.0375, 0.0625 + k * np.spacing(0.1)) for k in (0, ulps)]
    one, two = (exact_solution(film, L, MU, U, 1e6, 1e6) for film in ends)
    for name in ("rupture", "reformation", "Q", "p_max", "x_max", "load"):
        assert getattr(two, name) == pytest.approx(getattr(one, name), rel=1e-12)


def test_profiles_of_any_number_of_points():
    """A long profile brings its own panels, more than others need."""
    x = np.linspace(0.0, 0.05, 3001)
    film = PiecewiseLinear(x, np.zeros(1), (1e-5 + 5e-6 * np.cos(200 * x))[None, :], "linear")
    coarse = PiecewiseLinear(x[::3], np.zeros(1), film.z[:, ::3], "linear")
    fine, few = (exact_solution(Sum([part]), 0.05, 0.01, 1.0, 0.0, 0.0) for part in (film, coarse))
    assert fine.p_max == pytest.approx(few.p_max, rel=1e-3) and fine.load == pytest.approx(few.load, rel=1e-3)
