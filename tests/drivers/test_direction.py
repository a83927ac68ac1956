"""A wall that moves to smaller x, and one at rest: the mirror image's answer, and the hydrostatic film's."""

import numpy as np
import pytest

from lcp_lube import load_scene, solve

BEARING = {
    "family": "bearing",
    "L": 0.01,
    "U": 1.0,
    "n": 40,
    "fluid": {"mu": 0.01, "p_c": 0.0},
    "film": [{"shape": "linear", "h_start": 3e-6, "h_end": 1e-6}, {"shape": "pocket", "depth": 1e-6, "x": [0.0062, 0.0081]}],
    "sides": {"west": 1e5, "east": 2e5},
}
MIRRORED = {
    "film": [{"shape": "linear", "h_start": 1e-6, "h_end": 3e-6}, {"shape": "pocket", "depth": 1e-6, "x": [0.0019, 0.0038]}],
    "sides": {"west": 2e5, "east": 1e5},
    "U": -1.0,
}
PLANE = {"dimension": 2, "width": 0.008, "n": 15}


@pytest.mark.parametrize("more, method", [({}, "auto"), ({}, "din"), ({}, "fbn-a"), (PLANE, "auto"), (PLANE, "fas")])
def test_the_other_direction_is_the_mirror_image(more, method):
    there, back = (solve(load_scene({**BEARING, **more, **data}), method=method) for data in ({}, MIRRORED))
    assert there.converged and back.converged
    box = (-1, there.problem.grid.shape[0])
    for name in ("p", "r"):
        expected = there.fields[name].reshape(box)[:, ::-1].ravel()
        np.testing.assert_allclose(back.fields[name], expected, rtol=0, atol=1e-8 * max(np.abs(expected).max(), 1e-3))
    a, b = there.problem.quantities(there.fields), back.problem.quantities(back.fields)
    for name in ("p_max", "load", "power_loss", "friction_coefficient", "cavitated_fraction"):
        assert a[name] == pytest.approx(b[name], rel=1e-7)
    assert a["friction"] == pytest.approx(-b["friction"], rel=1e-7)
    assert a["flow"]["west"] == pytest.approx(b["flow"]["east"], rel=1e-6)
    assert a["p_max_at"][0] == pytest.approx(0.01 - b["p_max_at"][0], rel=1e-9)
    for name in ("rupture", "reformation"):
        assert (a[name] is None) == (b[name] is None)
        assert a[name] is None or a[name] == pytest.approx(0.01 - b[name], abs=1e-9)
    for solution in (there, back):
        solution.destroy()


@pytest.mark.parametrize("method", ["auto", "active-set", "monotone", "din", "din-pc", "fbn-a", "fbn-i"])
def test_at_rest_the_film_is_hydrostatic(method):
    """In 1D p is the integral of h^-3, to the box scheme's second order, and there is no void; small speeds lead there."""
    rest = solve(load_scene({**BEARING, "U": 0.0}), method=method)
    assert rest.converged and np.abs(rest.fields["r"]).max() < 1e-6
    p = rest.fields["p"] * rest.problem.p_unit
    assert np.all((p > 1e5) & (p < 2e5)) and np.all(np.diff(p) > 0)
    exact = rest.problem.exact()
    np.testing.assert_allclose(p, exact.p(rest.problem.grid.x[0]), rtol=5e-3)
    for U in (1e-9, -1e-9):
        slow = solve(load_scene({**BEARING, "U": U}), method=method)
        assert slow.converged
        np.testing.assert_allclose(slow.fields["p"] * slow.problem.p_unit, p, rtol=1e-6)
        slow.destroy()
    rest.destroy()


def test_at_rest_between_equal_pressures_nothing_happens():
    sides = {"west": "periodic", "east": "periodic", "south": 0.0, "north": 0.0}
    solution = solve(load_scene({**BEARING, **PLANE, "U": 0.0, "sides": sides}))
    assert solution.converged and not solution.fields["p"].any() and not solution.fields["r"].any()
    solution.destroy()


def test_exact_solution_of_the_other_direction():
    back = solve(load_scene({**BEARING, **MIRRORED, "n": 400}))
    exact, problem = back.problem.exact(), back.problem
    assert back.converged
    p = back.fields["p"] * problem.p_unit
    assert np.abs(p - exact.p(problem.grid.x[0])).max() < 0.02 * exact.p_max
    back.destroy()


@pytest.mark.parametrize("ranks", [2, 3])
def test_the_other_direction_on_several_ranks(cli, tmp_path, ranks):
    """U < 0: the mirror image is dealt to the ranks, and what is told is turned back on each."""
    (tmp_path / "pad.toml").write_text(
        'family = "bearing"\ndimension = 2\nL = 0.01\nwidth = 0.008\nU = -1.0\nnx = 17\nny = 11\n[fluid]\nmu = 0.01\n'
        '[[film]]\nshape = "linear"\nh_start = 1e-6\nh_end = 3e-6\n[sides]\nwest = 2e5\neast = 1e5\n'
    )
    alone, several = (cli("solve", tmp_path / "pad.toml", "--json", ranks=n) for n in (1, ranks))
    assert alone.status == several.status == 0, several.err
    for name in ("load", "friction", "p_max", "cavitated_fraction"):
        assert several.json[name] == pytest.approx(alone.json[name], rel=1e-9), name
    assert several.json["p_max_at"] == alone.json["p_max_at"]
    assert several.json["flow"]["west"] == pytest.approx(alone.json["flow"]["west"], rel=1e-7)
