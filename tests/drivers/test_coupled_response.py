"""Stiffness and damping of films with effects: the loads of displaced films, what no effect leaves, ranks."""

import math

import numpy as np
import pytest

from lcp_lube import load_scene, solve
from lcp_lube.drivers.motions.coefficients import coefficients

PAD = {"family": "bearing", "L": 0.1, "U": 4.0, "n": 40, "fluid": {"mu": 0.05}}
PAD["film"] = [{"shape": "linear", "h_start": 4e-5, "h_end": 2e-5}]
EFFECTS = {
    "barus, density": {"fluid": {"mu": 0.05, "barus": 2e-8, "density": "dowson-higginson"}},
    "liner": {"elastic": {"compliance": 2e-12}},
    "half space": {"half_space": {"E_reduced": 1e11}},
    "heat, asperities": {"temperature": {"beta": 0.03}, "asperity": {"sigma": 1e-5, "E_reduced": 1e11}},
    "cavity": {"film": [{"shape": "sinusoid", "h_min": 1e-5, "h_max": 4e-5}], "temperature": {"beta": 0.03}},
}
TIGHT = {"eps1": 1e-10}


def found(scene, frequencies=(0.0,)):
    with solve(scene, model="full", stopping=TIGHT) as s:
        assert s.converged, s.message
        return coefficients(scene, s, frequencies)


@pytest.mark.parametrize("name", EFFECTS)
def test_stiffness_of_a_pad(name):
    """What the load does when the film's level is changed, all effects following."""
    data, e, loads = {**PAD, **EFFECTS[name]}, 4e-9, []
    for k in (1, -1):
        with solve(load_scene(data, {"h_offset": k * e}), model="full", stopping=TIGHT) as s:
            loads.append(s.load)
    (one,) = found(load_scene(data))
    assert one.K[0, 0] == pytest.approx((loads[1] - loads[0]) / (2 * e), rel=1e-5) and one.C[0, 0] > 0


def test_no_effect_is_no_change():
    """Effects that do nothing leave K and C, at any frequency."""
    pad = {**PAD, "dimension": 2, "width": 0.06, "nx": 21, "ny": 10, "film": EFFECTS["cavity"]["film"]}
    plain = found(load_scene(pad), (0.0, 300.0))
    for a, b in zip(found(load_scene(pad, {"viscosity.factor": "1"}), (0.0, 300.0)), plain, strict=True):
        np.testing.assert_allclose([a.K, a.C], [b.K, b.C], rtol=1e-5)


def test_stiffness_of_a_journal():
    """A ring with grooves whose films share their oil, and asperities: forces of the journal displaced."""
    data = {"family": "grooved_journal", "nx": 48, "ny": 4, "eccentricity": 0.5, "attitude_deg": 50.0, "p_groove": 1e5}
    data |= {"temperature": {"beta": 0.03}, "asperity": {"sigma": 2e-5, "E_reduced": 1e10}}
    scene = load_scene(data)
    with solve(scene, model="full", stopping=TIGHT) as s:
        (one,), F = coefficients(scene, s), s.force
    angle, step = math.atan2(-F[1], -F[0]), 1e-4
    turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
    change = []
    for axis in turn:
        forces = []
        for k in (1, -1):
            X = np.array(scene.place) + k * step * axis
            moved = {"eccentricity": float(np.hypot(*X)), "attitude_deg": math.degrees(math.atan2(X[1], X[0]))}
            with solve(scene.model_copy(update=moved), model="full", stopping=TIGHT) as s:
                forces.append(np.array(s.force))
        change.append(-turn @ (forces[0] - forces[1]) / (2 * step * scene.clearance))
    np.testing.assert_allclose(one.K, np.transpose(change), rtol=1e-4, atol=1e-5 * np.abs(one.K).max())


def test_on_ranks(cli):
    words = ["coefficients", "lined_pad", "--n", 20, "--model", "elastic", "--json"]
    alone, two = cli(*words), cli(*words, ranks=2)
    assert alone.status == two.status == 0, two.err
    assert two.json["coefficients"][0]["K"] == [pytest.approx(row, rel=1e-5) for row in alone.json["coefficients"][0]["K"]]


def test_equations_that_are_not_solved_are_an_outcome(cli):
    words = ["coefficients", "lined_pad", "--n", 20, "--model", "elastic", "--json", "-coupled_response_ksp_max_it", 1]
    found = cli(*words)
    assert found.status == 1 and found.json["outcome"] == "linear_solver" and "GMRES" in found.json["message"]


def test_a_table_over_speeds_takes_their_options_too(cli):
    words = ["coefficients", "adiabatic_journal", "--n", 40, "--speeds", "1000:1000:1"]
    assert cli(*words, "-coupled_response_ksp_max_it", 500).status == 0
    unread = cli(*words, "-coupled_response_ksp_max_its", 500)
    assert unread.status == 2 and "coupled_response_ksp_max_its" in unread.lines[0]


LINER = {"elastic": {"compliance": 1e-12}}


@pytest.mark.parametrize(
    ("name", "effects"), [("tapered_land", {}), ("tilting_pad_thrust", {}), ("tilting_pad_thrust", LINER)], ids=str
)
def test_stiffness_of_a_thrust_bearing(name, effects):
    """Of all its pads, which follow on their pivots: what another load makes of the film."""
    heights = []
    for load in (1e4 * (1 + 1e-3), 1e4 * (1 - 1e-3), 1e4):
        scene = load_scene(name, {"nx": 11, "ny": 5, **effects, "balance": {"load": load, "tol": 1e-9}})
        with solve(scene, model="full", stopping=TIGHT) as s:
            heights.append(s.settings["balance"]["value"])
            if load == 1e4:
                (one,) = coefficients(scene, s)
    assert one.K[0, 0] == pytest.approx(20.0 / (heights[1] - heights[0]), rel=1e-5) and one.C[0, 0] > 0
