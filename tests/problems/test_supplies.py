"""Supplies inside a film: exact flows in one dimension, hand formulas of restrictors, what flows in flows out, bad input."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lcp_lube import InputError, load_scene, solve

MU, H, L = 0.02, 4e-5, 0.1
LINE = {"family": "bearing", "L": L, "U": 0.0, "n": 37, "fluid": {"mu": MU}, "film": {"shape": "constant", "h": H}}
PAD = {
    "family": "bearing",
    "dimension": 2,
    "L_mm": 100,
    "width_mm": 60,
    "U": 2.0,
    "nx": 39,
    "ny": 23,
    "fluid": {"mu": MU, "p_supply": 1e5},
    "film": [{"shape": "linear", "h_start_um": 60, "h_end_um": 30}],
}
RECESS = {"shape": "rectangle", "x_mm": [31, 72], "y_mm": [20, 41]}
HOLE = {"shape": "hole", "at_mm": [10, 12], "diameter_mm": 9}
RING = {"family": "grooved_journal", "grooves_deg": [], "nx": 72, "ny": 11}


def answer(data, **how):
    with solve(load_scene(data), **how) as solution:
        return solution.outcome, solution.problem.quantities(solution.fields), dict(solution.settings), solution.certificate


def closes(values):
    """What leaves supplies and sides, in parts of the largest."""
    flows = [*values["supply_flow"], *(-flow for flow in values["flow"].values())]
    return abs(sum(flows)) / max(map(abs, flows))


@pytest.mark.parametrize("x", [(0.05, 0.06), (0.0413, 0.0571), (0.02001, 0.0837)])
@pytest.mark.parametrize("n", [5, 24, 37])
def test_line_of_constant_film_is_exact_wherever_the_edges_lie(x, n):
    """Q = h^3 P/(12 mu l) on both sides of the supply."""
    _, values, *_ = answer({**LINE, "n": n, "supply": [{"x": list(x), "p": 3e5}]})
    each = [H**3 * 3e5 / (12 * MU * length) for length in (x[0], L - x[1])]
    # A supply without a point takes the nearest.
    if any(x[0] <= k * L / (n + 1) <= x[1] for k in range(1, n + 1)):
        assert values["supply_flow"][0] == pytest.approx(sum(each), rel=1e-6)
        assert [values["flow"][side] for side in ("west", "east")] == pytest.approx(each, rel=1e-6)
    assert closes(values) < 1e-12


def test_capillary_orifice_and_flow_by_hand():
    """Pressure ratio of a compensated pad: 1/(1 + G/K) with the film's conductance G; orifice: P G = K sqrt(p_s - P)."""
    x, p_s = (0.04, 0.06), 2e6
    G = 2 * H**3 / (12 * MU * 0.04)
    place = {"x": list(x)}
    for ratio in (0.01, 1.0, 30.0):
        _, values, *_ = answer({**LINE, "supply": [{**place, "restrictor": "capillary", "K": ratio * G, "p_s": p_s}]})
        assert values["supply_p"][0] == pytest.approx(p_s / (1 + 1 / ratio), rel=1e-6)
        K = ratio * G * math.sqrt(p_s)
        _, values, *_ = answer({**LINE, "supply": [{**place, "restrictor": "orifice", "K": K, "p_s": p_s}]})
        P = values["supply_p"][0]
        assert pytest.approx(K * math.sqrt(p_s - P), rel=1e-6) == G * P
        assert values["supply_flow"][0] == pytest.approx(G * P, rel=1e-6)
    outcome, values, settings, _ = answer({**LINE, "supply": [{**place, "flow": 1e-6}]})
    assert outcome == "converged" and values["supply_p"][0] == pytest.approx(1e-6 / G, rel=1e-6)
    assert "found in 2 solves" in " ".join(settings["why"])


@pytest.mark.parametrize("method", ["auto", "active-set", "monotone", "din", "din-pc", "fbn-a", "fbn-i"])
def test_methods_agree(method):
    data = {**PAD, "supply": [{**RECESS, "restrictor": "capillary", "K": 1e-11, "p_s": 1e6}, {**HOLE, "p": 2e5}]}
    outcome, values, _, certificate = answer(data, method=method)
    assert outcome == "converged" and certificate.holds
    assert values["supply_flow"][0] == pytest.approx(1e-11 * (1e6 - values["supply_p"][0]), rel=1e-7)
    _, first, *_ = answer(data)
    assert values["load"] == pytest.approx(first["load"], rel=1e-6)
    assert closes(first) < 1e-10 and closes(values) < 1e-6


@settings(max_examples=25, deadline=None)
@given(
    U=st.sampled_from([-3.0, 0.0, 1e-3, 2.0, 50.0]),
    ends=st.floats(20.0, 200.0),
    p=st.lists(st.floats(0.0, 5e6), min_size=2, max_size=2),
    sides=st.sampled_from(["open", "closed", "ring"]),
)
def test_flows_add_up(U, ends, p, sides):
    """Supplies and sides balance to 1e-10 of the largest, whatever speed, film, pressures and sides are."""
    data = {**PAD, "U": U, "film": [{"shape": "linear", "h_start_um": ends, "h_end_um": 30}]}
    if sides == "closed":
        data["sides"] = {"south": "closed", "west": "closed", "north": 0.0, "east": 0.0}
    if sides == "ring":
        data |= {"film": [{"shape": "journal", "c": ends * 1e-6, "eccentricity": 0.7}]}
        data["sides"] = {"west": "periodic", "east": "periodic"}
    supply = [{**RECESS, "restrictor": "orifice", "K": 1e-9, "p_s": 1.1e5 + p[0], "backflow": True}, {**HOLE, "p": p[1]}]
    outcome, values, *_ = answer({**data, "supply": supply})
    assert outcome in ("converged", "no_solution")  # where the film draws more than the orifice gives
    assert closes(values) < 1e-10


def test_order_with_edges_anywhere():
    """A hole whose edge is no line of the grid: flow and load converge with more than first order."""
    hole = {"shape": "hole", "at_mm": [51, 31], "diameter_mm": 25, "p": 1e6}
    found = [answer({**PAD, "U": 0.0, "nx": n, "ny": n - 3, "supply": [hole]})[1] for n in (20, 40, 80, 160)]
    for name in ("load", "supply_flow"):
        values = np.array([np.ravel(one[name])[0] for one in found])
        errors = np.abs(values[:-1] - values[-1] - (values[-1] - values[-2]) / 3) / values[-1]
        assert np.polyfit(np.log([20, 40, 80]), np.log(errors), 1)[0] < -1.4 and errors[-1] < 6e-4


REACHING = [
    {**PAD, "supply": [{"shape": "axial_groove", "x_mm": [31, 52], "p": 1e6}]},
    {**PAD, "supply": [{"shape": "formula", "where": "0.02 - hypot(x - 0.05, y)", "p": 1e6}]},
    {"family": "grooved_journal", "eccentricity": 0.5, "attitude_deg": 50.0, "p_groove": 3e5, "p_end": 0.0, "groove_deg": 30.0},
]


@pytest.mark.parametrize("data", REACHING)
def test_pressure_at_a_side_that_a_supply_reaches(data):
    """Integrals count the supply's pressure there: with that of the side their order was 1.0 to 1.3, 0.4 to 1.1 % off at 96."""
    grids = [(n, n // 3 - 1) for n in (48, 96, 192, 576)]
    *values, best = [answer({**data, "nx": nx, "ny": ny}, certify=False)[1]["pressure_integral"] for nx, ny in grids]
    errors = np.abs(np.array(values) / best - 1.0)
    assert errors[1] < 3e-3 and np.polyfit(np.log([48, 96, 192]), np.log(errors), 1)[0] < -1.7


@pytest.mark.parametrize("corner", [0.0, 3e-4])
def test_faces_around_the_corners_of_a_recess(corner):
    """Load and flow to 1e-3 at 31 points a side: 6e-3 and 1.2e-2 with differences, which follow r^(2/3) by order 4/3."""
    recess = {"shape": "rectangle", "x_mm": [31.7, 58.2], "y_mm": [17.3, 36.1 + 1e3 * corner], "p": 1e6}
    data = {**PAD, "U": 0.0, "film": [{"shape": "constant", "h": 3e-5}], "fluid": {"mu": MU}, "supply": [recess]}
    coarse, fine = (answer({**data, "nx": n, "ny": n}, certify=False)[1] for n in (31, 255))
    assert coarse["load"] == pytest.approx(fine["load"], rel=1e-3)
    assert coarse["supply_flow"] == pytest.approx(fine["supply_flow"], rel=1e-3)


def test_groove_as_supply_is_the_groove():
    """An axial groove as a table on the ring and as a groove between two films: the same answer."""
    data = {**RING, "grooves_deg": [90.0, 270.0], "attitude_deg": 50.0, "p_groove": 1e5}
    _, ring, *_ = answer(data)
    groove = {"shape": "axial_groove", "extent_deg": 20.0, "p": 1e5}
    tables = [{**groove, "angle_deg": 90.0}, {**groove, "angle_deg": 270.0}]
    # The ring of a journal without grooves begins elsewhere: its points are half a mesh off.
    _, held, *_ = answer({**data, "grooves_deg": [], "supply": tables, "n": 72})
    assert held["load"] == pytest.approx(ring["load"], rel=1e-2)
    assert sum(held["supply_flow"]) == pytest.approx(sum(ring["groove_flow"]), rel=2e-2)


def test_circumferential_groove_parts_the_bearing():
    """A groove round the middle makes two short bearings of it; the load falls, and each half leaks to both sides."""
    data = {**RING, "attitude_deg": 50.0, "L_over_D": 0.5, "ny": 25}
    groove = {"shape": "circumferential_groove", "length_mm": 4, "p": 1e5}
    outcome, values, *_ = answer({**data, "supply": [groove]})
    assert outcome == "converged" and closes(values) < 1e-10
    assert values["side_leakage"] == pytest.approx(values["supply_flow"][0], rel=1e-9)


def test_formula_region_and_turned_wall():
    data = {**PAD, "U": -2.0, "supply": [{"shape": "formula", "where": "0.01 - hypot(x - 0.03, y - 0.02)", "p": 4e5}]}
    _, values, *_ = answer(data)
    same = {**PAD, "U": 2.0, "supply": [{"shape": "hole", "at": [0.07, 0.02], "diameter": 0.02, "p": 4e5}]}
    same["film"] = [{"shape": "linear", "h_start_um": 30, "h_end_um": 60}]
    _, mirrored, *_ = answer(same)
    # Points on the circle are in it or just outside, as rounding has it.
    assert values["load"] == pytest.approx(mirrored["load"], rel=1e-3)
    assert values["supply_flow"] == pytest.approx(mirrored["supply_flow"], rel=1e-3)
    assert closes(values) < 1e-10


def test_a_formula_smaller_than_a_cell_is_where_it_says():
    """As the hole of the same place and size: the point nearest to it."""
    circle = {"shape": "formula", "where": "1e-4 - hypot(x - 0.0303, y - 0.0212)", "p": 4e5}
    hole = {"shape": "hole", "at_mm": [30.3, 21.2], "diameter_mm": 0.2, "p": 4e5}
    found = [answer({**PAD, "supply": [one]})[1]["load"] for one in (circle, hole)]
    assert found[0] == pytest.approx(found[1], rel=1e-3)


def test_fluid_that_depends_on_pressure():
    data = {**PAD, "fluid": {"mu": MU, "p_supply": 1e5, "barus": 2e-8, "density": "dowson-higginson"}}
    data["supply"] = [{**RECESS, "restrictor": "capillary", "K": 1e-12, "p_s": 9e6}]
    outcome, values, *_ = answer(data)
    assert outcome == "converged" and closes(values) < 1e-8
    assert values["supply_flow"][0] == pytest.approx(1e-12 * (9e6 - values["supply_p"][0]), rel=1e-7)


@pytest.mark.parametrize("source", [{"flow": 0.0}, {"restrictor": "capillary", "K": 1e-25, "p_s": 1e9}])
def test_a_blocked_source_is_a_pocket_that_follows_the_film(source):
    """No flow is parted from none by what goes through the film, not by the flow itself."""
    outcome, values, _, certificate = answer({**PAD, "supply": [{**RECESS, **source}]})
    assert outcome == "converged" and certificate.holds
    assert abs(values["supply_flow"][0]) < 1e-10 * max(map(abs, values["flow"].values()))
    assert 1e5 < values["supply_p"][0] < values["p_max"] + 1e5


def test_film_draws_more_than_the_source_gives():
    data = {
        **LINE,
        "U": 5.0,
        "film": {"shape": "linear", "h_start_um": 20, "h_end_um": 80},
        "supply": [{"x": [0.04, 0.06], "flow": 1e-9}],
    }
    outcome, _, _, certificate = answer(data)
    assert outcome == "no_solution" and not certificate.holds


def test_band():
    data = {**PAD, "supply": [{**RECESS, "p": 1e6}, {**HOLE, "p": 2e5}]}
    with solve(load_scene(data), certify=True) as solution:
        assert solution.enclosure.certified and solution.enclosure.bounds["band_p"] < 10.0


@pytest.mark.parametrize("effects", [{}, {"elastic": {"compliance": 2e-13}, "nx": 32, "ny": 7}])
def test_stiffness_of_a_hybrid_bearing_against_differences(effects):
    """K with the pressures behind restrictors following, and effects, against two solves with the journal displaced."""
    from lcp_lube.drivers.motions.coefficients import coefficients

    recess = {"extent_deg": 50.0, "length_mm": 30, "restrictor": "capillary", "K": 3e-11, "p_s": 5e6}
    tables = [{**recess, "angle_deg": angle} for angle in (45.0, 135.0, 225.0, 315.0)]
    scene = load_scene({**RING, "clearance_um": 50, "eccentricity": 0.3, "attitude_deg": 40.0, "supply": tables, **effects})
    ask = {"model": "full", "stopping": {"eps1": 1e-10}} if effects else {}

    def force(scene):
        with solve(scene, **ask) as solution:
            return np.array(solution.problem.quantities(solution.fields)["force"])

    with solve(scene, **ask) as solution:
        (one,) = coefficients(scene, solution)
    at, shift = math.radians(40.0), 1e-4
    f = force(scene)
    along = math.atan2(-f[1], -f[0])
    turn = np.array([[math.cos(along), -math.sin(along)], [math.sin(along), math.cos(along)]])
    K = np.zeros((2, 2))
    for k in range(2):
        ends = []
        for sign in (1.0, -1.0):
            e = 0.3 * np.array([math.cos(at), math.sin(at)])
            e[k] += sign * shift
            there = {"eccentricity": float(np.hypot(*e)), "attitude_deg": math.degrees(math.atan2(e[1], e[0]))}
            ends.append(force(scene.model_copy(update=there)))
        K[:, k] = -(ends[0] - ends[1]) / (2 * shift * scene.clearance)
    assert np.abs(turn @ one.K @ turn.T - K).max() < (1e-4 if effects else 1e-6) * np.abs(K).max()


@pytest.mark.parametrize(
    ("supply", "words"),
    [
        ([{**RECESS, "p": 1e5}, {**RECESS, "p": 2e5}], "supply 1 and supply 2 overlap"),
        ([{"x_mm": [90, 120], "y_mm": [20, 40], "p": 1e5}], "x = 0.09 to 0.12 m lies outside the film"),
        ([{**RECESS, "restrictor": "capillary", "K": 1e-11, "p_s": 1e4}], "more than the film's least pressure"),
        ([{**RECESS, "restrictor": "capillary", "K": 1e-6, "p_s": 1.1e5}], "p_s = 110000: less than the film's pressure there"),
        ([{**RECESS}], "one of p, flow, restrictor is needed"),
        ([{**RECESS, "p": 1e5, "flow": 1.0}], "one of p, flow, restrictor is needed"),
        ([{**RECESS, "p": -1.0}], "at least the cavitation pressure"),
        ([{"shape": "hole", "at_mm": [10, 10], "p": 1e5}], "diameter is missing"),
        ([{"angle_deg": 30.0, "extent_deg": 10.0, "y_mm": [0, 10], "p": 1e5}], "the film is no journal's"),
        ([{**RECESS, "restrictor": "capillary", "p_s": 1e6}], "a restrictor has K and p_s"),
        ([{"shape": "formula", "where": "x - 5", "p": 1e5}], "where = x - 5: positive nowhere in the film"),
    ],
)
def test_bad_input(supply, words):
    with pytest.raises(InputError, match=r"^(scene|bearing): supply") as error:
        solve({**PAD, "supply": supply})
    assert words in str(error.value) and "\n" not in str(error.value)


def test_overlapping_supplies_of_a_line_are_refused_beside_effects_too():
    film = [{"shape": "sinusoid", "h_min": 4e-6, "h_max": 9e-6}]
    line = {"family": "bearing", "L": 0.06, "U": 1.0, "n": 17, "fluid": {"mu": 0.01, "p_supply": 1e5}, "film": film}
    supply = [{"x": [0.028, 0.040], "flow": 7e-6}, {"x": [0.026, 0.029], "flow": 1e-6}]
    for more in ({}, {"temperature": {"beta": 0.03}}):
        with pytest.raises(InputError, match=r"^bearing: supply 1 and supply 2 overlap"):
            solve({**line, "supply": supply, **more})


@pytest.mark.parametrize("start_mm", [0.0, 0.3, 24.0])
def test_a_supply_beside_a_periodic_side_is_one_anywhere(start_mm):
    """A film that does not depend on y and closes in it: where the supply lies, by whole cells, does not matter."""
    sides = {"west": 1e5, "east": 1e5, "south": "periodic", "north": "periodic"}
    data = {**PAD, "ny": 60, "sides": sides}
    place, other = ({"x_mm": [40, 60], "y_mm": [y, y + 19], "p": 3e6} for y in (start_mm, start_mm % 1 + 20))
    _, values, _, certificate = answer({**data, "supply": [place]})
    _, expected, *_ = answer({**data, "supply": [other]})
    assert certificate.holds and certificate.measures["mass_defect"] < 1e-12
    assert values["supply_flow"] == pytest.approx(expected["supply_flow"], rel=1e-9)
    assert values["load"] == pytest.approx(expected["load"], rel=1e-9)
