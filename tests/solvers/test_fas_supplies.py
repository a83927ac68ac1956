"""Nonlinear multigrid of films with supplies: the active set's answers, few cycles on every grid, pressures that follow."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lcp_lube import load_scene, solve

pytest.importorskip("numba")

PAD = {
    "family": "bearing",
    "dimension": 2,
    "L_mm": 100,
    "width_mm": 60,
    "U": 2.0,
    "fluid": {"mu": 0.02, "p_supply": 1e5},
    "film": [{"shape": "linear", "h_start_um": 30, "h_end_um": 60}],
}
RING = {
    **PAD,
    "film": [{"shape": "journal", "c": 50e-6, "eccentricity": 0.7}],
    "sides": {"west": "periodic", "east": "periodic"},
}
RECESS = {"shape": "rectangle", "x_mm": [31, 72], "y_mm": [20, 41]}
HOLE = {"shape": "hole", "at_mm": [10, 12], "diameter_mm": 9}
PIN = {**HOLE, "diameter_mm": 1e-3, "p": 2e5}  # one point
FILMS = {
    "recess": (PAD, [{**RECESS, "p": 1e6}]),
    "recess and hole": (PAD, [{**RECESS, "p": 1e6}, {**HOLE, "p": 2e5}]),
    "at the cavitation pressure": (PAD, [{**HOLE, "p": 0.0}]),
    "no speed": ({**PAD, "U": 0.0}, [{**RECESS, "p": 1e6}]),
    "over the side": (PAD, [{**RECESS, "x_mm": [0, 20], "y_mm": [0, 30], "p": 1e6}]),
    "beside each other": (PAD, [{**RECESS, "x_mm": [20, 40], "p": 1e6}, {**RECESS, "x_mm": [40.01, 60], "p": 2e5}]),
    "one point": (PAD, [PIN]),
    "over the seam": (RING, [{**RECESS, "x_mm": [-10, 15], "p": 3e5}]),
    "one point on the seam": (RING, [{**PIN, "at_mm": [0, 30]}]),
    "axial groove, one column": (RING, [{"shape": "axial_groove", "x_mm": [10, 10.01], "p": 2e5}]),
    "groove right round": (RING, [{"shape": "circumferential_groove", "y_mm": [29, 31], "p": 2e5}]),
}


def closes(solution):
    """What leaves supplies and sides, in parts of the largest."""
    values = solution.problem.quantities(solution.fields)
    flows = [*values["supply_flow"], *(-flow for flow in values["flow"].values())]
    return abs(sum(flows)) / max(map(abs, flows))


@pytest.mark.parametrize("name", FILMS)
def test_the_active_sets_answer(name):
    film, tables = FILMS[name]
    data = {**film, "nx": 64, "ny": 37, "supply": tables}
    with solve(load_scene(data), method="fas") as ours, solve(load_scene(data), method="active-set") as other:
        assert ours.converged and ours.settings["took_over"] is None, ours.message
        assert ours.iterations <= (40 if "one" in name else 10)
        np.testing.assert_allclose(ours.fields["p"], other.fields["p"], rtol=0, atol=1e-8 * other.fields["p"].max())
        np.testing.assert_allclose(ours.fields["r"], other.fields["r"], rtol=0, atol=1e-6)
        assert closes(ours) < 1e-10


@settings(max_examples=20, deadline=None)
@given(
    nx=st.integers(5, 40),
    ny=st.integers(3, 40),
    U=st.sampled_from([0.0, 1e-3, 2.0, 50.0]),
    ring=st.booleans(),
    boxes=st.lists(st.tuples(*[st.floats(0.0, 1.0)] * 4, st.floats(0.0, 5e6)), min_size=1, max_size=3),
)
def test_supplies_anywhere(nx, ny, U, ring, boxes):
    """Any place and size, cut by sides and seams, few points: flows add up, the answer is the active set's."""
    film, tables = {**(RING if ring else PAD), "U": U, "nx": nx, "ny": ny}, []
    for k, (x, y, a, b, p) in enumerate(boxes):
        low, high = 100 * (x if ring else k / 3 + x / 3 * 0.8), 100 * (x if ring else (k + x * 0.8) / 3)
        tables.append(
            {"x_mm": [low, high + 0.1 + 6 * a], "y_mm": [50 * y, 50 * y + 0.1 + 9.8 * b], "p": p if not ring else 3e5}
        )
    data = {**film, "supply": tables}
    with solve(load_scene(data), method="fas") as ours, solve(load_scene(data), method="active-set") as other:
        assert ours.converged and other.converged
        np.testing.assert_allclose(ours.fields["p"], other.fields["p"], rtol=0, atol=1e-7 * other.fields["p"].max())
        assert closes(ours) < 1e-9  # of what the wall drags along 1e-11 at most, but sides may pass little


@pytest.mark.parametrize("film", [PAD, RING], ids=["pad", "ring"])
def test_cycles_do_not_grow_with_the_grid(film):
    tables = [{**RECESS, "p": 1e6}, {**HOLE, "p": 2e5}]
    cycles = []
    for nx, ny in ((64, 31), (128, 63), (256, 127)):
        with solve(load_scene({**film, "nx": nx, "ny": ny, "supply": tables}), method="fas") as solution:
            assert solution.converged and solution.method == "fas"
            cycles.append(solution.iterations)
    assert max(cycles) <= 10


def test_pressures_follow_in_the_cycles_of_a_steady_film():
    """After one step of Newton's method they are multigrid's unknowns: the pressures of the direct solver's, in two solves."""
    sources = [
        {"restrictor": "capillary", "K": 3e-11, "p_s": 5e6},
        {"restrictor": "orifice", "K": 3e-9, "p_s": 3e6},
        {"flow": 2e-6},
    ]
    places = [{"x_mm": [a, a + 22], "y_mm": [10, 50]} for a in (5, 38, 71)]
    data = {**RING, "nx": 96, "ny": 48, "supply": [{**x, **q} for x, q in zip(places, sources, strict=True)]}
    with solve(load_scene(data), method="active-set") as solution:
        expected = solution.problem.quantities(solution.fields)
    with solve(load_scene(data), method="fas") as solution:
        found = solution.problem.quantities(solution.fields)
        assert solution.converged and closes(solution) < 1e-10
        assert any("found in 2 solves" in why for why in solution.settings["why"])
    for name in ("supply_p", "supply_flow", "load"):
        assert found[name] == pytest.approx(expected[name], rel=1e-8)


def test_a_ring_that_is_hardly_fed_is_handed_over_at_once():
    """What circulates in its cavities no coarse grid sees: four cycles, then an active set from half the points each way."""
    keys = {"nx": 1024, "ny": 65, "attitude_deg": 50.0, "p_end": 1.0, "eccentricity": 0.9, "L_over_D": 2.0}
    with solve("ring_journal", method="fas", reduction=False, **keys) as solution:
        assert solution.converged and solution.settings["took_over"] == "fas"
        assert solution.iterations <= 12
        values = solution.problem.quantities(solution.fields)
    with solve("ring_journal", method="active-set", **keys) as direct:
        assert values["load"] == pytest.approx(direct.problem.quantities(direct.fields)["load"], rel=1e-6)
