"""Where a journal lies under a load: cold starts, lobes, dams, tilted axes, with the attitude given or open."""

import math

import pytest

from lcp_lube import load_scene, solve
from lcp_lube.drivers.loads import attitude
from lcp_lube.drivers.loads.place import touching
from lcp_lube.problems.solution import Outcome

SMALL = {"nx": 144, "ny": 11}


@pytest.mark.parametrize("eccentricity", [0.1, 0.5, 0.97])
@pytest.mark.parametrize("name", ["two_groove_journal", "ring_journal"])
def test_a_load_is_carried_where_newton_puts_the_journal(name, eccentricity):
    """The place from which a load was computed is found from the load, in a handful of solves from a cold start."""
    scene = load_scene(name, **SMALL, eccentricity=eccentricity)
    there = solve(scene)
    values = there.problem.quantities(there.fields)
    there.destroy()
    solution = solve(load_scene(name, **SMALL, balance={"load": values["load"]}))
    found = solution.settings["balance"]
    assert solution.converged and found["carried"] == pytest.approx(values["load"], rel=2e-6)
    assert found["value"] == pytest.approx(eccentricity, rel=1e-5)
    assert solution.settings["attitude_deg"] == pytest.approx(values["attitude_deg"], abs=1e-3)
    assert found["iterations"] <= 4
    warm = solve(load_scene(name, **SMALL, balance={"load": 1.02 * values["load"]}), start=solution)
    assert warm.converged and warm.settings["balance"]["iterations"] <= 4
    warm.destroy()
    solution.destroy()


@pytest.mark.parametrize(
    "name, changes",
    [
        ("lemon_journal", {"eccentricity": 0.97 * touching(load_scene("lemon_journal"), math.radians(40.0))}),
        ("three_lobe_journal", {"eccentricity": 0.1, "L_over_D": 2.0}),
        ("misaligned_journal", {"eccentricity": 0.7}),
        ("dam_journal", {"eccentricity": 0.3, "attitude_deg": None}),  # near the place where it carries nothing
        ("two_groove_journal", {"eccentricity": 0.97, "L_over_D": 1.3}),
    ],
)
def test_four_solves_find_a_place_with_the_attitude_given_or_open(name, changes):
    """On the grid asked for, from a cold start; lobes and a tilted axis are touched at an eccentricity below 1."""
    changes = {"nx": 108, "ny": 15, "attitude_deg": 40.0, **changes}
    there = solve(load_scene(name, changes))
    values = there.problem.quantities(there.fields)
    there.destroy()
    changes["eccentricity"] = 0.5
    solution = solve(load_scene(name, changes, balance={"load": values["load"]}))
    found = solution.settings["balance"]
    solution.destroy()
    assert solution.converged and found["carried"] == pytest.approx(values["load"], rel=2e-6)
    assert found["value"] == pytest.approx(values["eccentricity"], rel=1e-4)
    assert found["iterations"] <= 4 and found["work"] <= 6


@pytest.mark.parametrize(
    ("place", "changes"),
    [
        ((0.4122, 11.8), {"grooves_deg": [333.0], "groove_deg": 14.0}),  # its edge where the film is thin
        ((0.0005, 60.0), {"grooves_deg": [0.0], "p_groove": 1e5}),  # the groove alone carries it
    ],
)
def test_a_groove_near_the_load_of_which_closed_forms_know_nothing(place, changes):
    """The film at a place gives the load; turned so that it is vertical, it is carried with the attitude open."""
    changes = {"nx": 144, "ny": 7, **changes}
    with solve(load_scene("two_groove_journal", changes, eccentricity=place[0], attitude_deg=place[1])) as there:
        force = there.problem.quantities(there.fields)["force"]
    off = math.degrees(math.atan2(-force[1], -force[0]))
    changes["grooves_deg"] = [changes["grooves_deg"][0] - off]
    with solve(load_scene("two_groove_journal", changes, balance={"load": math.hypot(*force)})) as solution:
        assert solution.converged, solution.message
        assert solution.settings["balance"]["carried"] == pytest.approx(math.hypot(*force), rel=2e-6)


def test_a_light_load_opposite_to_what_a_groove_under_pressure_pushes():
    """The film that carries it is a saddle of forces away from every closed form; steps alone end at twenty times the load."""
    values = {"D": 0.0388, "L_over_D": 0.39, "clearance": 2.88e-5, "speed_rpm": 670.0, "mu": 0.0121, "nx": 72, "ny": 5}
    grooves = {"grooves_deg": [4.06], "groove_deg": 28.5, "p_groove": 1.24e6, "p_end": 898.0}
    with solve(load_scene("two_groove_journal", values | grooves, balance={"load": 9.65})) as solution:
        force = solution.problem.quantities(solution.fields)["force"]
        assert solution.converged, solution.message
        assert solution.settings["balance"]["solves"] <= 100
        assert force == pytest.approx((-9.65, 0.0), abs=1e-5 * 9.65)


def test_a_load_beyond_what_a_tilted_journal_carries_until_it_touches():
    solution = solve(load_scene("misaligned_journal", {"nx": 108, "ny": 7, "L_over_D": 1.0, "balance.load": 1e7}))
    assert solution.outcome is Outcome.LOAD_NOT_CARRIED and solution.settings["balance"]["solves"] < 40
    fx, fy = solution.problem.quantities(solution.fields)["force"]
    solution.destroy()
    left = math.hypot(fx + 1e7, fy) / 1e7
    assert 0.0 < left < 1.0 and f"|F + W| = {left:.3g} W" in solution.message


def test_with_effects_from_far_away():
    """A start in oil of 147 degrees, whose thin film has the stiffness of another bearing: along secants it was given up."""
    grid = {"nx": 90, "ny": 5, "balance.tol": 1e-3}
    with (
        solve(load_scene("adiabatic_journal", {**grid, "temperature.T_in": 419.9})) as hot,
        solve(load_scene("adiabatic_journal", grid), start=hot, stopping={"eps1": 1e-3}) as found,
    ):
        assert hot.converged and found.converged, found.message
        assert found.load == pytest.approx(112814.907, rel=1e-3)


def test_attitudes_are_found_where_the_grooves_turn_the_force_back():
    """Oil under pressure beside a slow journal: the force's angle jumps and falls as the attitude goes on."""
    values = {"D": 0.07, "L_over_D": 0.45, "clearance": 6e-5, "speed_rpm": 80.0, "mu": 0.0165, "nx": 36, "ny": 5}
    with solve(load_scene("two_groove_journal", **values, eccentricity=0.5, p_groove=6e5)) as solution:
        fx, fy = solution.problem.quantities(solution.fields)["force"]
        assert solution.converged and fx < 0.0 and abs(fy) < 1e-8 * abs(fx)


def test_a_given_attitude_where_the_groove_holds_up_half_of_the_load():
    """The force's size falls then grows with the eccentricity: from where it falls the place is sought anew."""
    values = {"D": 0.0226, "L_over_D": 0.39, "clearance": 1.39e-5, "speed_rpm": 2075.0, "mu": 0.0103, "nx": 60, "ny": 7}
    grooves = {"grooves_deg": [35.8], "groove_deg": 21.2, "p_groove": 43232.0, "p_end": 2000.0, "attitude_deg": 76.3}
    light, heavy = (load_scene("two_groove_journal", values | grooves, balance={"load": load}) for load in (3.2, 5.8))
    with solve(light) as near, solve(heavy, start=near) as far:
        assert near.converged and far.converged, far.message
        assert far.settings["balance"]["carried"] == pytest.approx(5.8, rel=2e-6)
        assert far.settings["start"] == "cold" and any("from the beginning" in reason for reason in far.settings["why"])


@pytest.mark.parametrize("rpm, asperities", [(3000.0, 0.0), (150.0, 0.5), (10.0, 0.96)])
def test_mixed_lubrication_from_the_film_alone(rpm, asperities):
    """Closed forms of a film put the journal so near the bore that the film has no answer; asperities hold it farther away."""
    scene = load_scene(
        "ring_journal",
        **{"nx": 120, "ny": 11, "D_mm": 47.8, "clearance_um": 23.9, "L_over_D": 0.36, "mu": 6.8e-3, "speed_rpm": rpm},
        balance={"load": 8200.0},
        roughness={"sigma_um": 0.394},
        asperity={"sigma_um": 0.309, "delta_um": 0.6, "E_reduced": 53.3e9, "friction": 0.02},
        roelands={"alpha": 9.5e-9},
    )
    with solve(scene, model="full") as solution:
        assert solution.converged
        assert solution.settings["balance"]["carried"] == pytest.approx(8200.0, rel=2e-6)
        assert solution.settings["balance"]["solves"] <= 20
        carried = solution.problem.quantities(solution.fields)["asperity_load"]
        assert carried / 8200.0 == pytest.approx(asperities, abs=0.05)


@pytest.mark.parametrize(("jump", "found"), [(2e-4, True), (5e-3, False)])
def test_an_attitude_at_which_the_force_jumps_past_the_load(monkeypatch, jump, found):
    """By little it is the place, which is said; by more there is none."""
    force_of = attitude.shaft_force

    def jumps(problem, fields):
        fx, fy = force_of(problem, fields)
        off = math.atan2(-fy, -fx)
        return tuple(-math.hypot(fx, fy) * part(off + math.copysign(jump, off)) for part in (math.cos, math.sin))

    monkeypatch.setattr(attitude, "shaft_force", jumps)
    with solve(load_scene("two_groove_journal", nx=60, ny=5, attitude_deg=None)) as s:
        said = any("but for a jump of its angle" in why for why in s.settings["why"])
        assert s.converged == found and said == found
