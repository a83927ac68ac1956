"""Journals with dams, lobes, barrels, grooves and herringbones: laws that hold for them, and what cannot be."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lcp_lube import InputError, load_scene, solve
from lcp_lube.drivers.motions.coefficients import coefficients

SMALL = {"nx": 72, "ny": 9}
AT = {**SMALL, "attitude_deg": 50.0}


def numbers(scene, **keys):
    with solve(scene, **keys) as solution:
        assert solution.converged, solution.message
        return solution.problem.quantities(solution.fields)


@pytest.mark.parametrize(
    "name",
    [
        "dam_journal",
        "three_lobe_journal",
        "circumferential_groove_journal",
        "herringbone_journal",
        "piston_skirt",
        "hybrid_journal",
    ],
)
def test_scenes_converge(name):
    values = numbers(name, nx=72, ny=15)
    assert values["load"] > 0 and values["p_max"] > 0
    if values.get("force"):
        assert abs(values["force"][1]) < 1e-6 * abs(values["force"][0])  # opposite to the load


def test_a_dam_presses_the_journal_away():
    """Without depth it is none; with it the upper half pushes the journal down."""
    none = numbers("dam_journal", **AT, dam_depth=0.0, dam_deg=None)
    plain = numbers("two_groove_journal", **AT, D=0.1, clearance=1e-4, speed_rpm=6000.0, L_over_D=1.0, eccentricity=0.4)
    assert none["force"] == pytest.approx(plain["force"], rel=1e-9)
    dam = numbers("dam_journal", **AT)
    assert dam["force"][0] - none["force"][0] > 0.1 * none["load"]


def test_the_step_of_a_dam_may_lie_between_points():
    """The edge of the dam moves through a cell: the force follows smoothly."""
    forces = [numbers("dam_journal", **AT, dam_deg=[100.0, end])["force"][0] for end in np.linspace(220, 230, 9)]
    assert np.all(np.abs(np.diff(forces, 2)) < 0.3 * np.ptp(forces))


def test_three_lobes_turned_by_a_third():
    turned = {"attitude_deg": 50.0 + 120.0}
    one = numbers("three_lobe_journal", **AT)
    other = numbers("three_lobe_journal", **{**AT, **turned})
    assert other["load"] == pytest.approx(one["load"], rel=1e-9)
    angles = [math.atan2(*values["force"][::-1]) for values in (one, other)]
    assert math.remainder(angles[1] - angles[0] - math.radians(120.0), 2 * math.pi) == pytest.approx(0.0, abs=1e-9)


def test_concentric_herringbone_pumps_and_pushes_nowhere():
    inward = numbers("herringbone_journal", **AT, eccentricity=0.0)
    assert inward["load"] < 1e-6 * inward["pressure_integral"]
    film = {"shape": "herringbone", "depth_um": 20, "count": 12, "angle_deg": -30}
    outward = numbers("herringbone_journal", **AT, eccentricity=0.0, film=[film])
    assert inward["pressure_integral"] > 2.0 * outward["pressure_integral"]


def test_a_herringbone_on_few_points():
    """Load and integral of the pressure, N, to 0.5 % on 20 points a groove and land (limits: 576 points around); with the film
    at the faces' middle 0.7 and 6 %."""
    values = numbers("herringbone_journal", nx=240, ny=79)
    assert values["load"] == pytest.approx(2227.5, rel=5e-3)
    assert values["pressure_integral"] == pytest.approx(6640.0, rel=5e-3)


def test_barrel_is_a_parabola_on_top():
    barrel = numbers("two_groove_journal", **AT, barrel=2e-5)
    film = [{"shape": "parabola", "along": "y", "h_min": 0.0, "h_max": 2e-5}]
    assert barrel["force"] == pytest.approx(numbers("two_groove_journal", **AT, film=film)["force"], rel=1e-12)
    assert barrel["load"] < numbers("two_groove_journal", **AT)["load"]


@settings(max_examples=8, deadline=None)
@given(tilt=st.floats(-1e-3, 1e-3), across=st.floats(-5e-4, 5e-4), preload=st.sampled_from([0.0, 0.3]))
def test_moments_are_odd_in_tilt(tilt, across, preload):
    """The other end up: the same force, the opposite moments."""
    keys = {**AT, "preload": preload, "eccentricity": 0.3}
    one = numbers("misaligned_journal", **keys, tilt=tilt, tilt_across=across)
    other = numbers("misaligned_journal", **keys, tilt=-tilt, tilt_across=-across)
    assert other["force"] == pytest.approx(one["force"], rel=1e-9)
    scale = one["load"] * 0.05
    assert np.add(one["moment"], other["moment"]) == pytest.approx([0.0, 0.0], abs=1e-9 * scale)


def test_misalignment_against_a_finer_grid():
    """Load and moments are of second order: a grid four times finer is a sixteenth of the error away from the truth."""
    sizes = ((90, 11), (180, 23), (360, 47))
    found = [numbers("misaligned_journal", nx=nx, ny=ny, attitude_deg=50.0) for nx, ny in sizes]
    for values in np.array([[one["load"], *one["moment"]] for one in found]).T:
        first, second = np.abs(np.diff(values))
        assert 3.0 < first / second < 6.0
    assert found[1]["load"] == pytest.approx(found[2]["load"], rel=2e-3)
    assert found[1]["moment"] == pytest.approx(found[2]["moment"], rel=1e-2)


def test_stiffness_with_a_dam_against_differences():
    scene = load_scene("dam_journal", AT)
    with solve(scene) as solution:
        (one,) = coefficients(scene, solution)
    at, shift, K = math.radians(50.0), 1e-5, np.zeros((2, 2))
    force = numbers("dam_journal", **AT)["force"]
    along = math.atan2(-force[1], -force[0])
    turn = np.array([[math.cos(along), -math.sin(along)], [math.sin(along), math.cos(along)]])
    for k in range(2):
        ends = []
        for sign in (1.0, -1.0):
            e = scene.eccentricity * np.array([math.cos(at), math.sin(at)])
            e[k] += sign * shift
            there = {"eccentricity": float(np.hypot(*e)), "attitude_deg": math.degrees(math.atan2(e[1], e[0]))}
            ends.append(np.array(numbers("dam_journal", **{**AT, **there})["force"]))
        K[:, k] = -(ends[0] - ends[1]) / (2 * shift * scene.clearance)
    assert np.abs(turn @ one.K @ turn.T - K).max() < 1e-5 * np.abs(K).max()


def test_no_attitude_carries_the_load():
    """A strong dam and a journal near the middle: the film pushes downwards at every attitude."""
    with solve("dam_journal", **SMALL, eccentricity=0.05) as solution:
        assert solution.outcome == "load_not_carried" and "no attitude was found" in solution.message


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"dam_deg": [100.0, 90.0]}, "start < end < start + 360"),
        ({"dam_deg": None}, "a pressure dam has both"),
        ({"film": [{"shape": "herringbone", "depth_um": 5, "count": 4, "angle_deg": 0.0}]}, "above or below 0"),
        ({"grooves_deg": [90.0, 95.0]}, "overlap"),
    ],
)
def test_bad_input(keys, words):
    with pytest.raises(InputError) as error:
        solve("dam_journal", **keys)
    assert words in str(error.value)
