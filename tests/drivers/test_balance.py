"""Load balance: round trips with direct solves, its bounded search, loads that no film carries."""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lcp_lube import load_scene, solve
from lcp_lube.drivers.loads.balance import MOST_SOLVES, carried
from lcp_lube.drivers.loads.root import Search
from lcp_lube.errors import InputError
from lcp_lube.problems.solution import Outcome
from lcp_lube.scenes.bearing import BearingScene
from lcp_lube.scenes.scene import parse_changes
from lcp_lube.studies.compare import compare


def direct(name, changes):
    """The load that a film carries."""
    solution = solve(load_scene(name, changes))
    assert solution.converged
    load = carried(solution.problem.quantities(solution.fields))
    solution.destroy()
    return load


def balance(name, changes, near=None):
    """The found settings, outcome, message and quantities of a balance."""
    solution = solve(load_scene(name, changes), start=near)
    values = solution.problem.quantities(solution.fields)
    found = solution.settings["balance"], solution.outcome, solution.message, values
    solution.destroy()
    return found


@settings(max_examples=15)
@given(st.floats(0.02, 0.98), st.sampled_from([0.0, 1e5]))
def test_journals_round_trip(eccentricity, p_groove):
    """The eccentricity of a direct solve is found from its load; pressure in the groove, on the sides, is a part of it."""
    data = {"nx": 31, "ny": 7, "p_a": p_groove, "p_b": p_groove}
    load = direct("journal", {**data, "eccentricity": eccentricity})
    found, outcome, message, values = balance("journal", {**data, "balance": {"load": load}})
    assert outcome is Outcome.CONVERGED, message
    assert found["vary"] == "eccentricity" and found["load"] == load
    assert found["value"] == pytest.approx(eccentricity, rel=1e-5)
    assert found["carried"] == pytest.approx(load, rel=2e-6) == values["load"]
    assert found["iterations"] == found["solves"] <= 4


@settings(max_examples=15)
@given(st.floats(-13e-6, 8e-6), st.sampled_from(["problem1", "problem2"]))
def test_films_round_trip(level, name):
    """The level of a film is found from its load, from a tenth of the film to half as much again."""
    load = direct(name, {"n": 60, "h_offset": level})
    found, outcome, message, _ = balance(name, {"n": 60, "balance.load": load})
    assert outcome is Outcome.CONVERGED, message
    assert found["vary"] == "h_offset"
    # The load is what is sought: of two levels that carry the same one, either will do.
    assert direct(name, {"n": 60, "h_offset": found["value"]}) == pytest.approx(load, rel=1e-5)
    assert found["iterations"] <= 4


def test_the_exact_long_bearing():
    """The load of the exact solution at eccentricity 0.5 (So 3.22777817) gives it back on any grid, to the load's digits."""
    load = 3.22777817 * 0.1 * 0.02 * 100 / 1e-3**2
    errors = [abs(balance("long_journal", {"n": n, "balance.load": load})[0]["value"] - 0.5) for n in (20, 50)]
    assert max(errors) < 1e-7


@pytest.mark.parametrize("vary, interval", [("mu", [1e-3, 1.0]), ("omega", [1.0, 1e4]), ("psi", [1e-4, 1e-2])])
def test_other_keys_need_a_range(vary, interval):
    """The load grows with viscosity and speed and falls with the clearance; each is found, from far away."""
    data = {"nx": 31, "ny": 7, "balance": {"load": 1e3, "vary": vary, "range": interval}}
    found, outcome, message, values = balance("journal", data)
    assert outcome is Outcome.CONVERGED, message
    assert interval[0] < found["value"] < interval[1] and values["load"] == pytest.approx(1e3, rel=2e-6)
    with pytest.raises(InputError, match=r"journal: balance.range is needed for balance.vary"):
        balance("journal", {**data, "balance": {"load": 1e3, "vary": vary}})


@pytest.mark.parametrize(
    "name, changes, end",
    [
        ("journal", {"nx": 31, "ny": 7, "balance.load": 1e12}, 0.9999),
        ("journal", {"nx": 31, "ny": 7, "balance": {"load": 1e5, "range": [0.1, 0.8]}}, 0.8),
        ("journal", {"nx": 31, "ny": 7, "balance": {"load": 1e2, "range": [0.1, 0.8]}}, 0.1),
        ("textured_slider", {"K": 1, "balance.load": 100.0}, None),  # it sucks: no load at any level
    ],
)
def test_a_load_that_cannot_be_carried(name, changes, end):
    found, outcome, message, _ = balance(name, changes)
    assert outcome is Outcome.LOAD_NOT_CARRIED and found["iterations"] < MOST_SOLVES
    assert end is None or found["value"] == pytest.approx(end, rel=1e-3)
    assert "asked for; the nearest of" in message
    assert end is None or f"{end:.8g}" in message.split("balance.range was")[1]


def test_coarse_grids_come_first():
    """On a large grid a few solves are left for the last one; without nested iteration all are there."""
    changes = {"nx": 127, "ny": 63, "balance.load": 5e3}
    nested = balance("journal", changes)[0]
    solution = solve(load_scene("journal", changes), nested=False)
    plain = solution.settings["balance"]
    solution.destroy()
    assert nested["iterations"] <= 2 <= plain["iterations"] == plain["solves"] == plain["work"] <= 4
    assert nested["iterations"] < nested["work"] <= 2.6 < nested["solves"]
    assert nested["value"] == pytest.approx(plain["value"], rel=1e-5)


@given(
    root=st.floats(-8, 8),
    start=st.floats(-9, 9),
    slope=st.sampled_from([-2.0, 1.0]),
    bend=st.floats(-0.9, 0.9),
    falling=st.booleans(),
    scale=st.floats(0.1, 5.0),
)
def test_the_search_finds_every_root_of_a_monotone_function(root, start, slope, bend, falling, scale):
    """Whatever slope it is told to begin with; with kinks, as fronts that move make them."""

    def g(t):
        s = t - root
        value = scale * (s + bend * abs(s) * 0.9 + 0.05 * np.sin(3 * s) * (1 - abs(bend)))
        return -value if falling else value

    search = Search(-9.5, 9.5, slope)
    t = start
    for _ in range(60):
        search.add(t, g(t))
        if abs(g(t)) < 1e-9:
            return
        target = search.next()
        if target is None:
            break
        t = target
        assert -9.5 <= t <= 9.5
    raise AssertionError(f"not found: {search.points[-4:]}")


def test_the_search_gives_up():
    """No root: both ends were tried, and what lies between; where all that is known is that the value is too small, too."""
    search = Search(0.0, 10.0, 1.0)
    t, count = 1.0, 0
    while t is not None:
        search.add(t, -1.0 / (1.0 + t))
        t, count = search.next(), count + 1
    assert {0.0, 10.0} <= {point[0] for point in search.points} and count < 20
    search = Search(-10.0, 10.0, -2.0)
    t = 0.0
    while t is not None:
        search.add(t, -np.inf)
        t = search.next()
    assert {-10.0, 10.0} <= {point[0] for point in search.points} and len(search.points) < 25


def test_command(cli, tmp_path):
    words = ["journal", "--nx", 31, "--ny", 9]
    data = cli("solve", *words, "--set", "balance.load=5000", "--json").json
    assert set(data["balance"]) == {"vary", "value", "load", "carried", "iterations", "solves", "work"}
    again = cli("solve", *words, "--set", f"eccentricity={data['balance']['value']}", "--json").json
    assert again["load"] == pytest.approx(5000, rel=2e-6)
    assert again["attitude_deg"] == pytest.approx(data["attitude_deg"], rel=1e-6)
    (tmp_path / "my.toml").write_text('family = "slider"\nn = 40\n[balance]\nload = 1e12\n')
    done = cli("solve", "my.toml", "--set", "balance.range=[-1e-5, 1e-5]")
    assert done.status == 1 and done.out.splitlines()[1].startswith("load_not_carried: ")
    same = cli("solve", *words, "--set", "balance.load=5000", "--json", ranks=2).json
    assert same["balance"]["value"] == pytest.approx(data["balance"]["value"], rel=1e-6)


@pytest.mark.parametrize(
    "scene, change, message",
    [
        ("journal", "balance.load=-1", "balance.load = -1"),
        ("journal", "balance={load = 1.0, lode = 1}", "balance.lode"),
        ("journal", "balance.range=[0.5, 0.2]", "balance"),
        ("bratu", "balance.load=1", "balance"),
        ("problem1", "balance.vary=U", "balance.load is missing"),
    ],
)
def test_bad_input(scene, change, message):
    with pytest.raises(InputError, match=re.escape(message)):
        load_scene(scene, parse_changes([change]))


def test_ranges_outside_the_domain():
    for name, table, message in (
        ("journal", {"load": 1e3, "range": [0.0, 0.5]}, "allowed for eccentricity"),
        ("journal", {"load": 1e3, "range": [0.5, 1.5]}, "allowed for eccentricity"),
        ("problem1", {"load": 1e3, "range": [-1e-3, 1e-3]}, "allowed for h_offset"),
    ):
        with pytest.raises(InputError, match=message):
            balance(name, {"n": 20, "balance": table})


def test_a_neighbour_with_a_thicker_film():
    """Its level would close this one's film: the search begins at the scene's own."""
    near = solve(load_scene("problem1", {"n": 30, "h_min": 30e-6, "h_max": 60e-6, "balance.load": 8e5}))
    assert near.settings["balance"]["value"] < -15e-6
    found, outcome, _, _ = balance("problem1", {"n": 30, "balance.load": 2e5}, near)
    assert outcome is Outcome.CONVERGED and found["carried"] == pytest.approx(2e5, rel=2e-6)
    near.destroy()


def test_a_balance_is_never_silently_left_out():
    """Nor by commands that make one solve a row."""
    rows = compare(load_scene("journal", {"nx": 20, "ny": 5, "balance.load": 1e3}), ["active-set", "fas"])
    assert [row["balance"]["carried"] == pytest.approx(1e3, rel=2e-6) for row in rows] == [True, True]


def test_with_accuracy_it_is_the_value_that_counts(cli):
    """The load is given; what finer grids change is the eccentricity that carries it."""
    done = cli("solve", "journal", "--set", "balance.load=1e3", "--accuracy", 1e-2, "--json")
    fine = cli("solve", "journal", "--set", "balance.load=1e3", "--set", "nx=320", "--set", "ny=80", "--json")
    assert done.status == fine.status == 0 and done.json["accuracy_quantity"] == "eccentricity"
    assert done.json["balance"]["value"] == pytest.approx(fine.json["balance"]["value"], rel=1e-2)
    assert done.json["accuracy_estimate"] <= 1e-2


def test_not_with_checkpoints(cli):
    done = cli("solve", "journal", "--set", "balance.load=1e3", "--checkpoint", "c.chk")
    assert done.status == 2 and "--checkpoint: not for scene journal (balance)" in done.lines[0]


@given(st.floats(-3.9, 3.9), st.floats(0.2, 0.8), st.booleans())
def test_a_root_behind_a_hump_is_found(place, height, wrong):
    """g with one hump, wherever the search begins and whatever it is told; what lies below its top is found."""

    def g(t):
        return 1.0 - (t - place) ** 2 / 4.0 - height

    search, t, count = Search(-4.6, 4.6, 2.0 if wrong else -2.0), 0.0, 0
    while t is not None and abs(g(t)) > 1e-9 and count < 40:
        search.add(t, g(t))
        t, count = search.next(), count + 1
    assert t is not None and abs(g(t)) <= 1e-9


def test_what_cannot_be_evaluated_is_left():
    """Beyond 3 there is nothing: the search stays on its side, and ends."""
    search, t, asked = Search(-5.0, 5.0, 1.0), 0.0, []
    while t is not None:
        asked.append(t)
        search.leave(t, 0.0) if t > 3.0 else search.add(t, t - 10.0)
        t = search.next()
    assert max(a for a in asked if a <= 3.0) > 1.0 and len(asked) < 20


def test_a_load_that_cavitation_limits():
    """Dimples suck as the film gets thin: the load has a largest value, below which two levels carry it."""
    data = {
        "dimension": 2, "L_mm": 20, "U": 2.0, "nx": 39, "ny": 15, "fluid": {"mu": 0.02, "p_supply": 1e5},
        "film": [{"shape": "constant", "h_um": 8}, {"shape": "pocket", "depth_um": 10, "x_mm": [2, 9], "y_mm": [3, 17]}],
    }  # fmt: skip
    top = 0.0
    for level in np.linspace(-7e-6, 30e-6, 38):
        solution = solve(BearingScene(**{**data, "h_offset": float(level)}))
        top = max(top, carried(solution.problem.quantities(solution.fields)))
        solution.destroy()
    for part, outcome in ((0.9, Outcome.CONVERGED), (1.1, Outcome.LOAD_NOT_CARRIED)):
        solution = solve(BearingScene(**{**data, "balance": {"load": part * top}}))
        assert solution.outcome is outcome, solution.message
        found = solution.settings["balance"]
        assert found["carried"] == pytest.approx(part * top if part < 1 else top, rel=2e-6 if part < 1 else 0.1)
        assert found["solves"] <= MOST_SOLVES
        solution.destroy()


def test_a_film_thinnest_at_a_side_stays_positive_on_every_grid():
    """A wedge whose thin end no coarse point sees, under pressures that carry nearly all: the search goes to thin films."""
    data = {
        "dimension": 2, "L": 0.041, "width": 0.014, "U": -1.9, "nx": 32, "ny": 47, "fluid": {"mu": 0.0056},
        "film": [{"shape": "linear", "h_start": 9e-6, "h_end": 13e-6}],
        "sides": {"west": 1.5e6, "east": 2.7e5, "south": 1e5, "north": 5.4e5},
    }  # fmt: skip
    with solve(BearingScene(**data, h_offset=5e-5)) as there:
        load = carried(there.problem.quantities(there.fields))
    with solve(BearingScene(**data, balance={"load": load})) as solution:
        assert solution.converged, solution.message
        assert solution.settings["balance"]["carried"] == pytest.approx(load, rel=2e-6)


def test_the_range_may_have_a_unit():
    """That of the key that varies."""
    from lcp_lube import InputError, load_scene

    for ends in ([1e-6, 40e-6], ["1um", "0.04 mm"], ["1um", 40e-6]):
        scene = load_scene("pocketed_pad", {"balance.load": 3e4, "balance.vary": "h_offset", "balance.range": ends})
        assert scene.balance.range == (1e-6, 40e-6)
    for vary, ends in (("h_offset", ["1 s", "2 s"]), ("film.journal.eccentricity", ["1um", "2um"])):
        with pytest.raises(InputError, match="is needed, not a"):
            load_scene("pocketed_pad", {"balance.load": 2e3, "balance.vary": vary, "balance.range": ends})


@pytest.mark.parametrize("load, eccentricity", [(63721.4, 0.806), (25000.0, 0.69)])
def test_a_hot_journal_is_found(load, eccentricity):
    """Oil much thinner than what is supplied: the stiffness is that of the film with its own viscosities, and a place without
    a steady temperature is left."""
    data = {
        "family": "grooved_journal", "D_mm": 157.26, "clearance_um": 67.58, "speed_rpm": 3377, "L_over_D": 1.004,
        "grooves_deg": [], "nx": 60, "ny": 11, "p_end": 13041.0, "balance": {"load": load},
        "temperature": {"oil": "ISO VG 68", "T_in": 308.11, "exchange": 595.1},
    }  # fmt: skip
    with solve(data, model="full") as s:
        found = s.settings["balance"]
        assert s.converged and found["solves"] <= 12
        assert found["value"] == pytest.approx(eccentricity, rel=0.05) and found["carried"] == pytest.approx(load, rel=2e-6)


def test_a_first_film_without_an_answer():
    """At the eccentricity of the file the viscosity grows without bound: the search goes on towards less load."""
    film, fluid = {"shape": "journal", "c": 2.7e-5, "eccentricity": 0.6}, {"mu": 0.088, "barus": 1.4e-8}
    data = {"family": "bearing", "L": 0.25, "U": 2.5, "n": 60, "fluid": fluid, "film": film}
    load = direct(data, {"film.1.eccentricity": 0.3})
    with pytest.raises(AssertionError):
        direct(data, {})
    found, outcome, message, _ = balance(data, {"balance.load": load, "balance.vary": "film.1.eccentricity"})
    assert outcome is Outcome.CONVERGED, message
    assert found["value"] == pytest.approx(0.3, rel=1e-5) and found["iterations"] <= 8
