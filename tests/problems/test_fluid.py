"""Fluids that depend on the pressure: the laws, an exact case, the figures of Bertocchi's pad, and what is refused."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcp_lube import InputError, load_scene, solve
from lcp_lube.problems.film.effects import factors, scaled
from lcp_lube.problems.film.exact import exact_solution
from lcp_lube.problems.film.fluid import Law

BOTH = Law(2e-8, True)
pressures = st.floats(0, 1e9)


@given(pressures, pressures)
def test_laws(a, b):
    p = np.array([a, b])
    np.testing.assert_allclose(BOTH.pressure(BOTH.reduced(p)), p, rtol=1e-6, atol=1e-6)
    mobility = BOTH.mobility(p, p[::-1].copy())
    assert mobility[0] == pytest.approx(mobility[1], rel=1e-9)
    between = np.sort(1.0 / BOTH.viscosity(p))
    assert between[0] * (1 - 1e-9) <= mobility[0] <= between[1] * (1 + 1e-9)
    if abs(a - b) > 1:
        q = BOTH.reduced(p)
        assert mobility[0] == pytest.approx((q[1] - q[0]) / (b - a), rel=1e-4, abs=1e-12)
    assert (BOTH.density(p) >= 1).all() and (BOTH.density(p) <= 1.66).all()
    assert (Law().density(p) == 1).all() and (Law().viscosity(p) == 1).all() and (Law().reduced(p) == p).all()


def test_barus_against_the_exact_solution():
    """q is the pressure of a fluid of constant viscosity between the q of the sides' pressures."""
    b = 3e-8
    scene = load_scene("pocketed_pad", {"fluid.barus": b, "n": 399})
    q_side = -np.expm1(-b * 1e5) / b
    exact = exact_solution(scene.gap, scene.L, 0.01, 1.0, q_side, q_side)
    solution = solve(scene)
    quantities = solution.problem.quantities(solution.fields)
    assert solution.converged and solution.settings["details"]["fluid_solves"] == 1 and scene.exact() is None
    assert quantities["p_max"] == pytest.approx(-np.log1p(-b * exact.p_max) / b, rel=1e-6)
    assert quantities["p_max"] > 1.1 * load_scene("pocketed_pad").exact().p_max
    assert quantities["reformation"] == pytest.approx(exact.reformation, abs=scene.L / 400)
    assert quantities["flow"]["east"] == pytest.approx(0.5 * exact.Q, rel=1e-6)
    solution.destroy()


def found(changes):
    solution = solve(load_scene("pocketed_pad_2d", changes))
    assert solution.converged, solution.message
    quantities = solution.problem.quantities(solution.fields)
    solution.destroy()
    return quantities, solution


@pytest.mark.parametrize("nx, ny, p_max, load", [(99, 39, 8.8695e6, 330.06), (199, 79, 8.9072e6, 329.19)])
def test_bertocchis_pad(nx, ny, p_max, load):
    """Another code on grids of 100 x 40 and 200 x 80 cells, of first order at the pocket; p_max tends to 8.94 MPa."""
    quantities, solution = found({"nx": nx, "ny": ny})
    assert quantities["p_max"] == pytest.approx(p_max, rel=9e-3 if nx < 100 else 5e-3)
    assert quantities["p_max"] == pytest.approx(8.94e6, rel=2e-3)
    assert quantities["load"] == pytest.approx(load, rel=8e-3 if nx < 100 else 3e-3)
    assert 2 < solution.settings["details"]["fluid_solves"] < 8
    assert solution.certificate.measures["residual"] < 1e-8 and solution.certificate.measures["mass_defect"] < 1e-8


def test_multigrids_own_tolerance_is_not_the_couplings():
    """From 10,000 points on fas is taken, which stops at 1e-11: the density counts as found by what was asked for."""
    with solve(load_scene("pocketed_pad_2d", {"nx": 399, "ny": 159})) as solution:
        assert solution.converged and solution.method == "fas", solution.message
        assert solution.p_max == pytest.approx(8.94e6, rel=2e-3)


def test_a_wide_pad_is_the_papers():
    quantities, _ = found({"width": 0.3, "film.pocket.y": [0.045, 0.255]})
    assert quantities["p_max"] == pytest.approx(41.81e6, rel=5e-3)


def test_density_alone_carries_mass():
    """Through every cross-section of a 1D film the same mass; without the law the density's factor is missing."""
    scene = load_scene("pocketed_pad", {"fluid.density": "dowson-higginson", "fluid.p_supply": 5e7, "n": 99})
    solution = solve(scene)
    west, east, *_ = solution.problem.boundary_flows(solution.fields["p"], solution.fields["r"])
    assert solution.converged and west == pytest.approx(east, rel=1e-9) and not solution.fields["r"].any()
    plain = solve(load_scene("pocketed_pad", {"fluid.p_supply": 5e7, "n": 99}))
    ratio = west / plain.problem.boundary_flows(plain.fields["p"], plain.fields["r"])[0]
    assert ratio == pytest.approx(Law(0.0, True).density(np.array(5e7)), rel=2e-3)
    for one in (solution, plain):
        one.destroy()


def test_a_line_of_symmetry_and_a_periodic_film():
    whole, _ = found({"nx": 49, "ny": 20})
    half, _ = found({"nx": 49, "ny": 10, "width": 0.005, "sides.north": "symmetry", "film.pocket.y": [1.5e-3, 1.0]})
    for key in ("load", "friction"):
        assert 2 * half[key] == pytest.approx(whole[key], rel=1e-7)
    ring = {"sides.west": "periodic", "sides.east": "periodic", "nx": 49, "ny": 20, "fluid.p_supply": 3e5}
    assert found(ring)[0]["load"] > 0


def test_a_law_without_effect_changes_nothing():
    """Terms cost nothing where a scene does not name them; named with b ~ 0 they give the same answer."""
    plain, tiny = (solve(load_scene("pocketed_pad", {"fluid.barus": b, "n": 60})) for b in (0.0, 1e-20))
    assert "fluid_solves" not in plain.settings["details"] and tiny.settings["details"]["fluid_solves"] == 1
    np.testing.assert_allclose(tiny.fields["p"], plain.fields["p"], rtol=1e-9)
    problem = scaled(plain.problem, factors(plain.problem, {}))
    for name in ("k_W", "k_E", "b_C", "b_W", "c"):
        np.testing.assert_allclose(getattr(problem.scheme, name), getattr(plain.problem.scheme, name), rtol=1e-14)
    for one in (plain, tiny):
        one.destroy()


def test_no_pressure_carries_the_flow():
    solution = solve(load_scene("pocketed_pad", {"fluid.barus": 1e-6}))
    assert not solution.converged and str(solution.outcome) == "no_solution"
    assert "viscosity grows without bound (barus = 1e-06 1/Pa)" in solution.message
    solution.destroy()


def test_from_a_neighbours_answer():
    first = solve(load_scene("pocketed_pad_2d", {"nx": 49, "ny": 19}))
    near = load_scene("pocketed_pad_2d", {"nx": 49, "ny": 19, "U": 1.01})
    warm, cold = solve(near, start=first), solve(near)
    assert warm.converged
    np.testing.assert_allclose(warm.fields["p"], cold.fields["p"], rtol=0, atol=1e-6 * cold.fields["p"].max())
    for one in (first, warm, cold):
        one.destroy()


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"fluid.barus": -1e-8}, "fluid.barus = -1e-08: allowed is greater than or equal to 0"),
        ({"fluid.density": "dowson"}, "fluid.density = dowson: allowed is 'constant' or 'dowson-higginson'"),
        ({"scheme": "upwind"}, "scheme = upwind: fluid.density = dowson-higginson needs scheme = face"),
    ],
)
def test_refused(changes, message):
    with pytest.raises(InputError, match=message):
        solve(load_scene("pocketed_pad_2d", {"nx": 9, "ny": 9, **changes}))


def test_on_two_ranks(cli):
    words = ["solve", "pocketed_pad_2d", "--json", "--nx", 41, "--ny", 19, "--method", "active-set"]
    alone, two = cli(*words), cli(*words, ranks=2)
    assert alone.status == two.status == 0, two.err
    for key in ("load", "p_max", "friction", "cavitated_fraction"):
        assert two.json[key] == pytest.approx(alone.json[key], rel=1e-7)
