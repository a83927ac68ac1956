"""Fronts by sums along lines: those of the answer in 1D, a start that saves steps in the plane."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lcp_lube import load_scene, solve
from lcp_lube.solvers.line_start import full_along

ENDS = st.sampled_from([{}, {"p_in": 3e5}, {"p_out": 1e6}, {"p_in": 1e6, "p_out": 2e4}])
CLOSED = st.sampled_from([{"sides": {side: {"kind": "closed"}}} for side in ("west", "east")])
place = st.floats(0.0, 0.1)
pocket = st.tuples(place, place, st.floats(0.1, 10.0)).filter(lambda t: abs(t[0] - t[1]) > 1e-3)
wave = st.tuples(st.integers(1, 9), st.floats(0.1, 10.0))


def line(ratio, pockets, waves, n, U, ends):
    film = [{"shape": "wedge", "h_start": ratio * 1e-5, "h_end": 1e-5}]
    film += [{"shape": "pocket", "x": sorted([a, b]), "depth": depth * 1e-5} for a, b, depth in pockets]
    film += [{"shape": "sinusoid", "h_min": 0.0, "h_max": h * 1e-5, "waves": k} for k, h in waves]
    return {"family": "bearing", "L": 0.1, "U": U, "n": n, "fluid": {"mu": 0.02}, "film": film, **ends}


@settings(max_examples=60, deadline=None)
@given(
    st.floats(0.3, 3.0),
    st.lists(pocket, max_size=3),
    st.lists(wave, max_size=2),
    st.integers(1, 120),
    st.sampled_from([1e-3, 1.0, 50.0]),
    st.one_of(ENDS, CLOSED),
)
def test_a_line_has_these_fronts(ratio, pockets, waves, n, U, ends):
    """One step, whatever the film: signs that are left to it are of pressures or voids that are rounding."""
    with solve(line(ratio, pockets, waves, n, U, ends), method="active-set", reduction=False, rescue=False) as s:
        full, p, r = full_along(s.problem), s.fields["p"], s.fields["r"]
        if full is None:  # nothing presses it
            assert s.converged and p.max() <= 1e-9
            return
        assert s.converged and s.iterations <= 2
        assert np.all(p[~full] <= 1e-9 * max(p.max(), 1e-30)) and np.all(r[full] <= 1e-9)


@pytest.mark.parametrize("n", [5, 31, 1000])
def test_on_several_ranks(cli, n, tmp_path):
    (tmp_path / "s.toml").write_text(
        'family = "bearing"\nL = 0.1\nU = 2.0\nfluid.mu = 0.02\n[[film]]\nshape = "constant"\nh = 1e-5\n'
        '[[film]]\nshape = "sinusoid"\nh_min = 0.0\nh_max = 2e-5\nwaves = 7\n'
    )
    runs = [cli("solve", "s.toml", "--n", n, "--set", "p_in=1e5", "--json", ranks=ranks).json for ranks in (1, 2, 3)]
    assert [run["iterations"] for run in runs] == [1, 1, 1]
    for run in runs[1:]:
        assert run["load"] == pytest.approx(runs[0]["load"], rel=1e-10)


@pytest.mark.parametrize("name, steps", [("textured_slider", 2), ("dimpled_pad", 6), ("rough", 6)])
def test_dimples_are_nearly_lines(name, steps):
    """Pockets hold their cavities, and the land between them carries one flow: 6, 9 and 8 steps without."""
    with solve(load_scene(name, {"nx": 100, "ny": 50}), method="active-set", nested=False, reduction=False) as s:
        assert s.converged and s.iterations <= steps


NARROW = {"width_over_diameter": 0.2}
FLAT = {"fluid.p_supply": 0.0}  # needs no pressure: what its sums leave is rounding


@pytest.mark.parametrize(
    "name, changes", [("journal", NARROW), ("piston_skirt", {}), ("ring_journal", {}), ("dimpled_pad", FLAT)]
)
def test_lines_that_exchange_much_tell_nothing(name, changes):
    problem = load_scene(name, {**changes, "nx": 40, "ny": 30}).build()
    assert full_along(problem) is None
    problem.destroy()
