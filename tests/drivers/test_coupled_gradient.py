"""Derivatives of films with effects by the implicit function: differences of solves, Taylor's test, bad input."""

import numpy as np
import pytest

from lcp_lube import load_scene, solve
from lcp_lube.drivers.gradient import gradients
from lcp_lube.scenes.values import values_of, with_values

TIGHT = {"eps1": 1e-11, "max_it": 200}


def answer(scene, near=None):
    solution = solve(scene, start=near, stopping=TIGHT)
    assert solution.converged, solution.message
    return solution


def off(scene, solution, quantities, keys=None, step=1e-3):
    """Those derivatives that differ from differences of solves, of fourth order."""
    worst = {}
    for one in (found := gradients(scene, solution, quantities, keys)):
        assert one.value == pytest.approx(solution.numbers[one.quantity], rel=1e-6)
    for key in found[0].gradient:
        a = values_of(scene)[key]
        d = step * (abs(a) or {"h_offset": 2e-5}.get(key, 1e5))
        told = {}
        for k in (-2, -1, 1, 2):
            with answer(with_values(scene, {key: a + k * d}), solution) as other:
                told[k] = other.numbers
        for one in found:
            f = {k: numbers[one.quantity] for k, numbers in told.items()}
            slope = (8.0 * (f[1] - f[-1]) - (f[2] - f[-2])) / (12.0 * d)
            error = abs(one.gradient[key] - slope) - 1e-10 * abs(one.value) / d
            if error > 1e-6 * abs(slope):
                worst[key, one.quantity] = error / abs(slope)
    return worst


def test_every_number_of_a_pad():
    """Heat, shear thinning, a liner that gives way, Barus' law and density, all at once."""
    scene = load_scene("lined_pad", n=60)
    with answer(scene) as solution:
        keys = [key for key in values_of(scene) if not key.startswith("sides") and key not in ("fluid.p_c", "shear.tau_0")]
        keys = [key for key in keys if key not in ("temperature.exchange", "shear.least")]  # least values, from above alone
        assert not off(scene, solution, ["load", "p_max", "friction", "temperature_max"], keys, step=1e-4)


def test_through_a_journals_place():
    """The eccentricity and the attitude at which a load is carried, oil carried over in grooves."""
    scene = load_scene("adiabatic_journal", n=40)
    keys = ["temperature.carry_over"]
    with answer(scene) as solution:
        assert not off(scene, solution, ["eccentricity", "attitude_deg", "temperature_max", "friction"], keys)


def test_in_the_plane():
    heat = {"oil": "ISO VG 32", "T_in": 313.0}
    scene = load_scene("two_groove_journal", nx=36, ny=5, temperature=heat, p_groove=2e5, attitude_deg=40.0)
    with answer(scene) as solution:
        assert not off(scene, solution, ["load", "temperature_max", "friction"], ["eccentricity", "temperature.T_in"])


def test_taylor():
    """What is left falls by four when the step is halved."""
    scene = load_scene("lined_pad", n=60)
    with answer(scene) as solution:
        (found,) = gradients(scene, solution, ["load"], ["film.linear.h_end"])
        left = []
        for d in (4e-7, 2e-7, 1e-7):
            with answer(with_values(scene, {"film.linear.h_end": 2e-5 + d}), solution) as other:
                left.append(abs(other.load - solution.load - d * found.gradient["film.linear.h_end"]))
    assert np.log2(np.array(left[:-1]) / left[1:]) == pytest.approx(2.0, abs=0.1)


def test_the_command_on_ranks_and_bad_input(cli):
    words = (
        "sensitivity",
        "lined_pad",
        "--n",
        "40",
        "--quantity",
        "load,temperature_max",
        "--by",
        "U,temperature.T_in",
        "--json",
    )
    found = cli(*words, ranks=2).json
    assert found["elasticity"]["temperature.T_in"] < -5
    scene = load_scene("lined_pad", n=40)
    with solve(scene) as solution:
        both = gradients(scene, solution, ["load", "temperature_max"], ["U", "temperature.T_in"])
    for one, told in zip(both, (found, *found["others"]), strict=True):
        assert told["gradient"] == pytest.approx(one.gradient, rel=1e-6)
    refused = cli("sensitivity", "lined_pad", "--n", "40", "--quantity", "temperature_least")
    assert refused.status == 2 and len(refused.lines) == 1 and "no derivative" in refused.lines[0]
