"""Films in time that no side feeds: closed and periodic all round, rings without feed, and what they hold at t = 0."""

import numpy as np
import pytest
from marches import WEDGE

from lcp_lube import InputError, load_scene, solve

PLANE = {"dimension": 2, "width_mm": 8, "nx": 20, "ny": 9}
SIDES = {
    "closed line": {"sides": {"west": "closed", "east": "closed"}},
    "to smaller x": {"sides": {"west": "closed", "east": "closed"}, "U": -1.0},
    "closed": {**PLANE, "sides": dict.fromkeys(("west", "east", "south", "north"), "closed")},
    "ring": {**PLANE, "sides": {"west": "periodic", "east": "periodic", "south": "closed", "north": "closed"}},
    "periodic": {**PLANE, "sides": dict.fromkeys(("west", "east", "south", "north"), "periodic")},
}
MOTION = {"t_end": 0.02, "steps": 20, "scheme": "euler"}
FLUID = {"fluid": {"mu": 0.01}}


@pytest.mark.parametrize("name", SIDES)
def test_what_a_sealed_film_holds_it_keeps(name):
    """Active set and multigrid agree, and not a drop is lost while the walls breathe."""
    scene = WEDGE | FLUID | SIDES[name] | {"motion": MOTION | {"fill": 0.7}}
    found = {}
    for method in ("active-set", "fas"):
        with solve(load_scene(scene), method=method) as s:
            assert s.converged and s.mass_defect_run <= 1e-10, s.message
            volumes = np.array([row["volume"] for row in s.history])
            assert np.ptp(volumes) <= 1e-12 * volumes[0] and s.history[-1]["p_max"] > 0
            found[method] = s.load
    assert found["fas"] == pytest.approx(found["active-set"], rel=1e-3)


@pytest.mark.parametrize("fill", [1e-2, 1e-5])
def test_an_almost_empty_film_loses_nothing_by_rounding(fill):
    """Where 1 - r is next to nothing it has few digits, of which a march would lose some in every step."""
    scene = WEDGE | FLUID | SIDES["closed line"] | {"film": {"shape": "linear", "h_start": 3e-5, "h_end": 1e-5}}
    with solve(load_scene(scene | {"motion": MOTION | {"fill": fill, "steps": 60}})) as s:
        assert s.converged and s.mass_defect_run <= 1e-10, s.message
        volumes = np.array([row["volume"] for row in s.history])
        assert np.ptp(volumes) <= 1e-12 * volumes[0]


def test_what_is_known_exactly():
    """A wall that comes and goes over a film with void enough moves nothing; nor does a journal in the middle of its ring."""
    plates = WEDGE | FLUID | SIDES["closed"] | {"U": 0.0, "film": {"shape": "formula", "unit": "um", "h": "2 + 0.4*sin(300*t)"}}
    with solve(load_scene(plates | {"motion": MOTION | {"fill": 0.7}})) as s:
        assert s.converged and s.fields["p"].max() == 0.0
        np.testing.assert_allclose(s.fields["r"], 1.0 - 0.7 / (1.0 + 0.2 * np.sin(6.0)), rtol=0, atol=1e-12)
    ring = WEDGE | FLUID | {**PLANE, "sides": {"west": "periodic", "east": "periodic"}}
    with solve(
        load_scene(ring | {"film": {"shape": "journal", "c": 1e-5, "eccentricity": 0.0}, "motion": MOTION | {"fill": 0.8}})
    ) as s:
        np.testing.assert_allclose(s.fields["r"], 0.2, rtol=0, atol=1e-12)
        assert s.converged and s.load == 0.0


def test_a_ring_may_stay_empty_all_round():
    """Beside a source that gives less than it can take: that is the reason, not a certificate that wants a full cell."""
    ring = {
        "family": "bearing",
        "dimension": 2,
        "L": 1.9e-3,
        "width": 1.35e-3,
        "U": 0.614,
        "nx": 3,
        "ny": 11,
        "fluid": {"mu": 0.157},
    }
    ring |= {
        "film": {"shape": "parabola", "h_min": 3.4e-6, "h_max": 1.36e-5},
        "sides": {"west": "periodic", "east": "periodic"},
    }
    ring |= {
        "supply": [{"x": [8e-4, 1.1e-3], "y": [5e-4, 1e-3], "flow": 5e-11}],
        "motion": {"t_end": 1e-3, "steps": 2, "fill": 0.3},
    }
    with solve(load_scene(ring)) as s:
        assert s.outcome == "no_solution" and "draws" in s.message
        assert s.certificate.measures.get("p_error", 0.0) == 0.0


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"motion.fill": 0.99}, "t = .* s: no side has a pressure, and the film has no room for its oil"),
        ({}, "no side has a pressure: that at t = 0 is not determined; give motion.fill"),
        ({"motion.fill": 1.5}, "motion.fill"),
        ({"motion": None}, "no side has a pressure: without one the level of p is open|changes with time"),
    ],
)
def test_what_is_refused(changes, message):
    with pytest.raises(InputError, match=message):
        solve(load_scene(WEDGE | FLUID | SIDES["closed"] | {"motion": MOTION}, changes))
