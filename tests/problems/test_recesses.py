"""Corners of recesses and the fronts behind their cavities: what faces about them have, and what integrals count."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcp_lube import load_scene, solve
from lcp_lube.drivers.motions.coefficients import coefficients
from lcp_lube.problems.film import borne, corners
from lcp_lube.problems.film.edges import corners_of
from lcp_lube.problems.film.recesses import corners_on
from lcp_lube.problems.film.shapes import Block, DimpleArray, Sum
from lcp_lube.problems.film.slopes import by_points
from lcp_lube.problems.film.views import FromHere, MirroredFilm, Travelling

QUARTER = 0.25 * np.pi
WEDGE = {"family": "bearing", "dimension": 2, "L": 0.01, "width": 0.008, "U": 1.0, "fluid": {"mu": 0.02}}
SIDES = ("west", "east", "south", "north")


def field_of(kappa, dry=False):
    one = np.ones(1)
    at, way = np.zeros((2, 1), dtype=np.int64), np.ones((2, 1), dtype=np.int64)
    found = corners.Corners(at, way, np.zeros((2, 1)), np.ones((2, 1)), one * kappa ** (1 / 3), one, np.array([dry]))
    return corners.Field(found)


def on_ray(field, of, radius, phi):
    """At an angle from the middle of the inside, where T and S are negative."""
    angle = phi - 0.75 * np.pi
    return complex(np.ravel(of(np.full((1, 1, 1), radius * np.cos(angle)), np.full((1, 1, 1), radius * np.sin(angle))))[0]).real


@given(st.floats(-3.0, 3.0), st.floats(0.1, 10.0))
def test_s_and_what_flows_are_continuous_at_the_edges(exponent, radius):
    """And s is no plane: its power is below 1 the more the film jumps, never below 2/3."""
    kappa = 10.0**exponent
    field = field_of(kappa)
    assert 2 / 3 - 1e-12 < float(field.power[0, 0, 0]) <= 1.0 + 1e-12
    for edge in (QUARTER, -QUARTER):
        for of in (field.s, field.conjugate):
            inside, outside = (on_ray(field, of, radius, edge * (1.0 + way * 1e-7)) for way in (-1.0, 1.0))
            size = radius ** float(field.power[0, 0, 0]) * max(1.0, kappa)
            assert inside == pytest.approx(outside, abs=1e-5 * size)


def test_beside_a_cavity_s_vanishes_on_both_edges():
    field = field_of(1.0, dry=True)
    assert field.power[0, 0, 0] == 2 / 3
    assert on_ray(field, field.s, 2.0, 0.3) == 0.0
    assert max(abs(on_ray(field, field.s, 2.0, way * QUARTER * 1.0000001)) for way in (-1, 1)) < 1e-5
    assert on_ray(field, field.s, 1.0, np.pi) == pytest.approx(1.0)


def test_corners_are_told_by_films_however_they_are_seen():
    pocket = Block(1e-6, (0.002, 0.005), (0.001, 0.003))
    assert corners_of(pocket).tolist() == [
        [0.002, 0.001, -1, -1],
        [0.002, 0.003, -1, 1],
        [0.005, 0.001, 1, -1],
        [0.005, 0.003, 1, 1],
    ]
    squares = DimpleArray("square", 1e-6, 0.001, 3, 2, (0.0, 0.01), (0.0, 0.01))
    assert corners_of(Sum([pocket, squares])).shape == (4 + 4 * 6, 4)
    assert not corners_of(Block(1e-6, (0.002, 0.005), (-np.inf, np.inf))).size  # no corner in the plane
    assert not corners_of(DimpleArray("round", 1e-6, 0.001, 3, 2, (0.0, 0.01), (0.0, 0.01))).size
    mirrored = corners_of(MirroredFilm(pocket, 0.01))
    assert mirrored[0] == pytest.approx([0.008, 0.001, 1, -1])
    assert corners_of(FromHere(pocket, 0.003, 0.01))[0] == pytest.approx([0.009, 0.001, -1, -1])
    assert not corners_of(Travelling(pocket, 0.001, 0.01)).size  # no grid follows them


def pads(n, depth, pressure=3e5, film=(2e-5, 1e-5)):
    """3 x 3 square pockets in a wedge."""
    squares = {"shape": "dimples", "form": "square", "columns": 3, "rows": 3, "size": 0.0012, "depth": depth}
    parts = [{"shape": "linear", "h_start": film[0], "h_end": film[1]}, squares]
    return {**WEDGE, "film": parts, "nx": n, "ny": n, "sides": dict.fromkeys(SIDES, pressure)}


def told(scene, *names):
    with solve(scene, stopping={"eps1": 1e-9}) as s:
        assert s.converged
        return np.array([s.numbers[name] for name in names])


def errors(of, sizes, limits):
    """Relative errors on grids of these sizes, the limit from two finer ones by second order."""
    coarse, fine = (of(n) for n in limits)
    limit = fine + (fine - coarse) / (((limits[1] + 1) / (limits[0] + 1)) ** 2 - 1)
    return np.abs(np.array([of(n) for n in sizes]) / limit - 1)


def test_deep_recesses_in_full_films_are_of_second_order():
    """Five films deep the load erred by 1.1, 0.6, 0.3 % there, and the largest pressure by as much."""
    found = errors(lambda n: told(load_scene(pads(n, 5e-5)), "pressure_integral", "p_max"), (29, 44, 59), (119, 239))
    assert (found < [[2e-3, 4e-3], [1e-3, 2e-3], [5e-4, 1e-3]]).all(), found


@pytest.mark.parametrize(
    ("name", "changes", "sizes", "most"),
    [
        ("dimpled_pad", {}, (79, 95, 159), [[8e-3, 1e-2], [3e-3, 2e-2], [1e-3, 5e-3]]),
        ("dimpled_pad", {"film.dimples.depth_um": 8.0}, (79, 95, 159), [[8e-3, 1e-2], [4e-3, 1e-2], [1e-3, 5e-3]]),
        ("textured_slider", {"scheme": "face"}, (79, 119, 159), [[5e-3, 2e-2], [5e-3, 2e-2], [2e-3, 2e-2]]),
    ],
)
def test_dimples_that_cavitate(name, changes, sizes, most):
    """The square pad's load erred by 1.1, 0.9, 0.06 %, its p_max by 4 to 5 and 2 %, the slider's load by 3.4, 0.8 %."""
    of = lambda n: told(load_scene(name, {**changes, "nx": n, "ny": n}), "pressure_integral", "p_max")  # noqa: E731
    assert (errors(of, sizes, (319, 479)) < most).all()


def test_a_symmetric_pad_carries_the_ambient_pressure():
    scene = load_scene(pads(37, 2e-5, film=(1e-5, 1e-5)))
    with solve(scene) as s:
        assert s.settings["details"]["revised"] == 0  # faces are made for it, and nothing is cavitated
        assert s.pressure_integral == pytest.approx(3e5 * 0.01 * 0.008, rel=1e-12)


def test_what_needs_no_pressure_has_none():
    """A flat pad with pockets at p = 0: all that the first answer says of its corners is that a cavity comes up to them."""
    scene = load_scene({**pads(25, 2e-5, 0.0, (1e-5, 1e-5)), "ny": 24})
    for how in ({}, {"reduction": False}, {"method": "fas", "reduction": False}):
        with solve(scene, **how) as s:
            assert s.converged and s.pressure_integral < 1e-6 and s.cavitated_fraction > 0.05


@pytest.mark.parametrize("n", [1, 2, 3, 5])
def test_grids_that_no_corner_lies_on_stay_as_they_were(n):
    scene = load_scene(pads(n, 2e-5))
    problem = scene.build()
    state = np.full(problem.grid.local_size, -1.0)
    if corners_on(problem.grid, problem.film, state) is None:
        assert np.array_equal(problem.revised(state).scheme.k_E, problem.scheme.k_E)
    with solve(scene) as s:
        assert s.converged
    problem.destroy()


@pytest.mark.parametrize(("pressure", "depth"), [(1e5, 2e-6), (0.0, 8e-6), (1e6, 3e-5)])
def test_either_way_and_by_any_method_it_is_one_film(pressure, depth):
    film = {
        "film": [
            {"shape": "constant", "h": 2e-6},
            {"shape": "pocket", "depth": depth, "x": [0.002, 0.0055], "y": [0.001, 0.004]},
        ]
    }
    data = {**WEDGE, **film, "nx": 33, "ny": 26, "sides": dict.fromkeys(SIDES, pressure)}
    turned = {**data, "U": -1.0, "film": [film["film"][0], {**film["film"][1], "x": [0.0045, 0.008]}]}
    loads = [solve(load_scene(data), method=method).pressure_integral for method in ("active-set", "fas", "din")]
    loads.append(solve(load_scene(turned)).pressure_integral)
    assert loads == pytest.approx([loads[0]] * 4, rel=1e-6, abs=1e-6)  # of 8 N at 1 bar


def test_ratios_are_positive_and_near_one():
    rng = np.random.default_rng(3)
    for _ in range(40):
        n = int(rng.integers(4, 40))
        scene = load_scene(pads(n, float(10 ** rng.uniform(-8, -2)), film=(float(10 ** rng.uniform(-6, -3)),) * 2))
        problem = scene.build()
        state = rng.choice([-1.0, 0.0, 1.0], problem.grid.local_size)
        changed = problem.revised(state).scheme
        for name in ("k_E", "k_W", "k_S", "k_N"):
            ratio = getattr(changed, name) / getattr(problem.scheme, name)
            assert (ratio >= corners.LEAST**2).all() and (ratio < 4.0).all()
        problem.destroy()


@pytest.fixture(scope="module")
def cavitated():
    with solve("textured_slider", scheme="face", K=3, nx=37, ny=35, stopping={"eps1": 1e-11}) as s:
        yield s


def test_borne_pressures_grow_with_p_and_fall_with_void(cavitated):
    """So that the bands around the answer are bands around its load."""
    problem, p, r = cavitated.problem, cavitated.fields["p"] * cavitated.problem.p_unit, cavitated.fields["r"]
    base, rng = borne.borne(problem, p, r), np.random.default_rng(1)
    assert (base <= p).all() and (base >= 0.0).all() and (base < p).sum() > 50
    for _ in range(10):
        more = p * (1 + rng.random(p.size)) + 1e-3 * p.max() * rng.random(p.size)
        less_void = r * rng.random(p.size)
        assert (borne.borne(problem, more, r) >= base - 1e-12 * p.max()).all()
        assert (borne.borne(problem, p, less_void) >= base - 1e-12 * p.max()).all()


def test_derivatives_of_borne_pressures(cavitated):
    problem, p, r = cavitated.problem, cavitated.fields["p"] * cavitated.problem.p_unit, cavitated.fields["r"]
    rng = np.random.default_rng(2)
    w, at = by_points(problem, lambda x, y: 1.0 + x + 0.0 * y).ravel(), r > 0.0
    by_p, by_r = borne.by_fields(problem, p, r, w)
    total = lambda p, r: float(w @ (borne.borne(problem, p, r) / problem.p_unit))  # noqa: E731
    dp, dr = rng.standard_normal(p.size) * p, rng.standard_normal(r.size) * r
    for found, step in (
        (by_p @ dp / problem.p_unit, lambda e: total(p + e * dp, r)),
        (by_r @ dr, lambda e: total(p, r + e * dr)),
    ):
        assert found == pytest.approx((step(1e-5) - step(-1e-5)) / 2e-5, rel=1e-6)
    assert not by_r[~at].any()
    by_k, by_b = borne.by_coefficients(problem, p, r, w)
    s, e = problem.scheme, 1e-6
    for name, by in (("k_W", by_k), ("b_W", by_b)):
        values = []
        for way in (1, -1):
            other = problem.with_scheme(s, problem.mu)
            other.bare = s.changed(**{name: getattr(s, name) * (1 + way * e)})
            values.append(float(w @ (borne.borne(other, p, r) / problem.p_unit)))
        assert float(np.sum(by * getattr(s, name))) == pytest.approx((values[0] - values[1]) / (2 * e), rel=1e-5)


def test_stiffness_is_that_of_the_loads_told(cavitated):
    with solve("dimpled_pad", nx=41, ny=38, stopping={"eps1": 1e-11}) as s:
        grows = -coefficients(load_scene("dimpled_pad", nx=41, ny=38), s)[0].K[0, 0]
        slope = s.gradient("load", ["h_offset"])["h_offset"]
        loads = [solve("dimpled_pad", nx=41, ny=38, h_offset=way * 1e-11, stopping={"eps1": 1e-12}).load for way in (1, -1)]
        assert grows == pytest.approx(slope, rel=1e-6)
        assert slope == pytest.approx((loads[0] - loads[1]) / 2e-11, rel=1e-5)


def test_what_rounding_leaves_of_no_pressure_is_none():
    """A deep pocket beside dimples on a flat pad: pressures of 1e-19 Pa made corners full ones, and those some 1e-4 Pa."""
    film = [
        {"shape": "constant", "h": 1.26e-5},
        {"shape": "pocket", "depth": 8e-3, "x": [0.0192, 0.0329], "y": [0.0076, 0.0115]},
    ]
    film += [{"shape": "dimples", "form": "square", "columns": 4, "rows": 4, "size": 0.0018, "depth": 3.24e-6}]
    sides = {"west": 0.0, "east": 0.0, "south": "periodic", "north": "periodic"}
    data = {**WEDGE, "L": 0.04, "width": 0.0191, "U": 1.2e-6, "film": film, "nx": 30, "ny": 17, "sides": sides}
    with solve(load_scene(data), method="active-set", reduction=False) as s:
        assert s.converged and s.p_max < 1e-12
