"""Largest pressures and fronts between the points of a grid."""

import numpy as np
import pytest

from lcp_lube import InputError, load_scene, solve
from lcp_lube.problems.film.fronts import _rises_through
from lcp_lube.problems.film.peak import Window
from lcp_lube.problems.film.shapes import Along, Block, Sum
from lcp_lube.problems.grid import Grid

WEDGE = {
    "family": "bearing",
    "dimension": 2,
    "L": 0.02,
    "width": 0.013,
    "U": 1.0,
    "fluid": {"mu": 0.02, "p_supply": 0.0},
    "film": [{"shape": "parabola", "h_min": 5e-6, "h_max": 1.3e-5}],
}


def hill(x, y):
    """Largest, 1, at (0.43, 0.52); its axes lie obliquely."""
    u, v = x - 0.43, y - 0.52
    return np.exp(-2 * u**2 - 3 * v**2 + 1.5 * u * v + u**3 - 0.5 * v**3)


def tops(n, offset, function=hill):
    """Height and place that are found with points anywhere."""
    places = tuple((np.arange(n) + o) / n for o in offset)
    grid = Grid((n, n), (1.0, 1.0), places=places)
    p = function(grid.x, grid.y).ravel()
    j, i = np.unravel_index(np.argmax(p), grid.box)
    window = Window(grid, p, [grid.x[0, i], grid.y[j, 0]], (0.0,) * 4)
    found = window.top(), window.slopes(p.size), p
    grid.destroy()
    return found


def test_a_smooth_top_is_met_to_third_order():
    errors, places = [], []
    for n in (16, 32, 64):
        found = [tops(n, offset)[0] for offset in np.random.default_rng(2).uniform(0.1, 0.9, (20, 2))]
        errors.append(max(abs(top - 1.0) for top, _ in found))
        places.append(np.median([np.hypot(x - 0.43, y - 0.52) for _, (x, y) in found]))
    assert -np.polyfit(np.log([16, 32, 64]), np.log(errors), 1)[0] > 2.2
    assert errors[-1] < 2e-5 and places[-1] < 2e-4 and places[0] > 4 * places[-1]


def test_a_ridge_on_a_line_of_points_stays_what_it_is():
    def roof(x, y):
        return 1.0 - np.abs(x - 0.5) - (x - 0.5) ** 2 - 0.3 * (y - 0.52) ** 2

    (top, (x, y)), _, _ = tops(20, (0.0, 0.4), roof)
    assert top == pytest.approx(1.0, abs=1e-12) and x == pytest.approx(0.5) and y == pytest.approx(0.52)


def test_its_derivatives_are_weights_of_the_points_around():
    (top, _), slopes, p = tops(16, (0.37, 0.8))
    assert slopes.sum() == pytest.approx(1.0, abs=1e-9) and np.count_nonzero(slopes) <= 25
    assert slopes @ p == pytest.approx(top, rel=1e-9)  # of first degree in the pressures


@pytest.mark.parametrize("ends", [("closed", "closed"), ("periodic", "periodic"), ("mirror", "open")])
def test_at_the_ends_of_a_line(ends):
    """A pressure that is even about both ends, largest at one of them, or periodic."""
    n = 12
    grid = Grid((n,), (1.0,), ends=(ends, ("open", "open")))
    x = grid.x[0]
    p = np.cos(2 * np.pi * x)
    top, (at,) = Window(grid, p, [x[np.argmax(p)]], (1.0,) * 4).top()
    assert top == pytest.approx(1.0, abs=2e-3) and min(at % 1.0, 1.0 - at % 1.0) < 0.01
    grid.destroy()


def test_largest_pressure_of_a_film():
    film, values = [{"shape": "linear", "h_start": 1.2e-5, "h_end": 5e-6}], {}
    for n in (19, 26, 34, 101):
        with solve(load_scene({**WEDGE, "film": film, "n": n})) as s:
            values[n] = s.numbers["p_max"], s.fields["p"].max() * s.problem.p_unit
    off = {n: abs(top / values[101][0] - 1.0) for n, (top, _) in values.items()}
    assert off[19] < 6e-3 and off[34] < off[26] < off[19]


def area(curve):
    x, y = curve.T
    return 0.5 * abs(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]))


def test_fronts_of_dimples_are_closed_curves():
    with solve(load_scene("dimpled_pad", {"nx": 40, "ny": 40, "film.dimples.form": "round"})) as s:
        curves = s.front_curves()
        assert len(curves) == 25 and all((curve[0] == curve[-1]).all() for curve in curves)
        assert sum(map(area, curves)) == pytest.approx(s.numbers["cavitated_area"], rel=0.15)
        centres = np.array([curve.mean(axis=0) for curve in curves])
        assert np.all(np.abs(centres / 2e-3 % 1.0 - 0.5) < 0.2)


def test_a_front_from_side_to_side():
    """Where it crosses lines y = const, against a fine grid; a turned film has the mirror image."""
    at = np.linspace(0.15, 0.85, 15) * WEDGE["width"]
    places = {}
    for n, U in ((20, 1.0), (20, -1.0), (40, 1.0), (95, 1.0)):
        with solve(load_scene({**WEDGE, "n": n, "U": U})) as s:
            (curve,) = s.front_curves()
        curve = curve[np.argsort(curve[:, 1])]
        assert curve[0, 1] == 0.0 and curve[-1, 1] == pytest.approx(WEDGE["width"])
        places[n, U] = np.interp(at, curve[:, 1], curve[:, 0])
    np.testing.assert_allclose(places[20, -1.0], WEDGE["L"] - places[20, 1.0], atol=1e-12)
    coarse, fine = (np.median(np.abs(places[n, 1.0] - places[95, 1.0]) / WEDGE["L"]) for n in (20, 40))
    assert coarse < 1.5e-3 and fine < 1e-3  # a few hundredths of a spacing


def bisected(film, level, a, b, y):
    """Where the film first grows to a level, by the first of four parts at whose end it has, again and again."""
    for _ in range(25):
        ends = a[:, None] + (b - a)[:, None] * np.array([0.25, 0.5, 0.75, 1.0])
        thick = film(ends, y[:, None]) >= level[:, None]
        thick[:, -1] = True
        first, row = thick.argmax(axis=1), np.arange(a.size)
        a, b = np.where(first > 0, ends[row, first - 1], a), ends[row, first]
    return b


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("count", [3, 500])
def test_where_a_film_grows_to_a_level(seed, count):
    """Waves, level parts and steps, that are told and that are not; levels below and above all of the film too."""
    rng = np.random.default_rng(seed)
    at, far = np.sort(rng.uniform(0.0, 1.0, 6)), 10.0 ** rng.uniform(-4, 2)
    wave = Along("sinusoid", 1e-6, 1e-6 * (1 + rng.choice([0.0, 3.0])), 0.0, far, waves=rng.uniform(0.5, 3))
    steps = [Block(1e-6 * rng.uniform(-0.4, 5), (far * a, far * b), (-np.inf, np.inf)) for a, b in at.reshape(3, 2)]
    film = Sum((wave, *steps))
    untold = film if seed % 2 else lambda x, y: film(x, y)
    a = rng.uniform(0.0, far, count)
    b, y = a + far * 10.0 ** rng.uniform(-4, -1.5, count), np.zeros(count)
    level = rng.choice([1.0, 0.5, 20.0], count, p=[0.8, 0.1, 0.1]) * film(rng.uniform(a, b), y)
    place = _rises_through(untold, level, a, b, y)
    assert np.abs(place - bisected(film, level, a, b, y)).max() <= 1e-11 * (b - a).max() + 5e-12 * far


def test_films_without_fronts():
    with solve(load_scene({**WEDGE, "n": 9, "U": 0.0})) as s:
        assert s.front_curves() == []
    with solve("problem1", n=9) as s, pytest.raises(InputError, match="ruptures"):
        s.front_curves()


def test_fronts_in_files_whatever_the_ranks(cli, tmp_path):
    for ranks in (1, 3):
        assert cli("solve", "dimpled_pad", "--n", 25, "--output", f"{ranks}.npz", ranks=ranks).status == 0
    one, three = (np.load(tmp_path / f"{ranks}.npz")["fronts"] for ranks in (1, 3))
    assert one.shape[1] == 3 and one[-1, 0] >= 24
    np.testing.assert_allclose(three, one, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("n", [9, 14])
def test_a_supply_of_one_point_is_the_top(n):
    """At rest nothing is above what feeds the film."""
    feed = {"shape": "rectangle", "x": [0.0091, 0.0093], "y": [0.004, 0.0042], "p": 3e5}
    film = [{"shape": "linear", "h_start": 1.2e-5, "h_end": 5e-6}]
    with solve(load_scene({**WEDGE, "U": 0.0, "film": film, "supply": [feed], "n": n})) as s:
        assert s.numbers["p_max"] == pytest.approx(3e5, rel=1e-12)
        assert s.gradient("p_max", "supply.1.p") == {"supply.1.p": pytest.approx(1.0, rel=1e-9)}
