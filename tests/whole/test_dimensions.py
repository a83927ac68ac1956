"""Dimensional analysis: a scene told in other units of length, time and mass has the same answer, in these units."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lcp_lube.api import solve
from lcp_lube.base.quantity import quantity
from lcp_lube.scenes.scene import load_scene
from lcp_lube.scenes.values import unit_of, values_of, with_values

# Those without formulas in metres, and without named oils.
SCENES = {
    "problem1": {"n": 40},
    "pocketed_pad": {"n": 37},
    "problem4": {"n": 19},
    "dimpled_pad": {"n": 33},
    "long_journal": {"n": 40},
    "journal": {"nx": 40, "ny": 9},
    "two_groove_journal": {"nx": 72, "ny": 7},
    "circumferential_groove_journal": {"nx": 40, "ny": 11},
    "herringbone_journal": {"nx": 120, "ny": 19},
    "tapered_land": {"nx": 17, "ny": 11},
    "step_thrust": {"nx": 17, "ny": 11},
    "spiral_groove": {"nx": 20, "ny": 24},
    "tilting_pad_journal": {"nx": 72, "ny": 5, "eccentricity": 0.3, "balance": None},
}
UNITLESS = {"speed_rpm": (0, 0, -1)}  # by names that tell their unit


def factor(unit, by):
    """What a number of this unit is multiplied by, for the factors of metre, kilogram and second."""
    return np.prod([f**power for f, power in zip(by, quantity(f"1 {unit}").dimension[:3] if unit else (0, 0, 0), strict=True)])


@pytest.mark.parametrize("name", SCENES)
@settings(max_examples=2)  # the simplest of them is no scene in metres, kilograms and seconds
@given(powers=st.tuples(*[st.floats(-3.0, -0.5) | st.floats(0.5, 3.0)] * 3))
def test_units_change_no_answer(name, powers):
    by = np.exp(powers)
    scene = load_scene(name, SCENES[name])
    changes = {}
    for key, value in values_of(scene).items():
        own = UNITLESS.get(key)
        size = np.prod(by**own) if own else factor(unit_of(scene, key), by)
        changes[key] = float(value * size)
    with solve(scene) as one, solve(with_values(scene, changes)) as other:
        assert one.outcome == other.outcome
        units = one.problem.units
        for key in ("load", "p_max", "friction", "power_loss", "cavitated_area", "min_h", "rupture"):
            found, there = one.quantities.get(key), other.quantities.get(key)
            if found is None:
                assert there is None
                continue
            unit = units[key].replace("N m", "J")
            scale = 1e-6 * max(abs(found), one.quantities["load"] if key == "friction" else 0.0)
            np.testing.assert_allclose(there / factor(unit, by), found, rtol=1e-6, atol=scale, err_msg=key)
