"""Films that rupture at the side they come in by: faces there made for it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lcp_lube import load_scene, solve
from lcp_lube.problems.film.cavity import Inlet
from lcp_lube.problems.film.inlets import LOOKS, made_at_inlet

L = 0.01


def opening(n: int, **changes):
    """A film that opens from a side without pressure and closes again, thicker towards north; pressures at two others."""
    film = [{"shape": "formula", "h": f"3e-6*(1 + 0.6*x/{L} - 0.9*(x/{L})^2 + 0.1*y/{L})"}]
    sides = {"west": 0.0, "east": 1e5, "south": 1e5, "north": 0.0}
    data = {"family": "bearing", "dimension": 2, "L": L, "width": L, "U": 0.5, "fluid": {"mu": 0.05}, "film": film, "n": n}
    return load_scene({**data, "sides": sides, **changes})


def load_of(scene, **how) -> float:
    with solve(scene, stopping={"eps1": 1e-9}, **how) as solution:
        assert solution.converged
        return float(solution.numbers["pressure_integral"])


def test_second_order():
    """Of first order without: 2.8 % at 47 points a side, and half of that with twice the points."""
    loads = np.array([load_of(opening(n)) for n in (23, 47, 95, 191)])
    changes = np.diff(loads)
    limit = loads[-1] + changes[-1] / 3
    assert np.all(np.abs(changes[:-1] / changes[1:]) > 3.3)
    assert abs(loads[1] / limit - 1) < 4e-3


def test_the_face_lets_through_the_least_flow():
    """What a film carries up to a front in its first cell, by a fine look; whole faces where the film closes."""
    nodes, y, rows = np.array([0.0, 1.0, 2.0]), np.zeros(1), np.ones((1, 1), dtype=bool)
    ones = np.ones((1, 2))
    for film, driven in (
        (lambda x, y: 1 + x + 0 * y, 0.0),
        (lambda x, y: 1 + x + 0 * y, 0.02),
        (lambda x, y: 2 - x + 0 * y, 0.0),
    ):
        C, H = made_at_inlet(film, nodes, y, Inlet(rows, driven), ones, ones)
        x = (np.arange(20_000) + 0.5) / 20_000
        h = film(x, 0.0)
        flows = (driven + np.cumsum(h**-2.0) / x.size) / (np.cumsum(h**-3.0) / x.size)
        assert H[0, 0] + driven * C[0, 0] == pytest.approx(flows.min(), rel=1.0 / LOOKS**2)
        assert C[0, 1] == H[0, 1] == 1.0
    assert H[0, 0] == pytest.approx((1 - 1 / 2) / ((1 - 1 / 4) / 2), rel=1e-3)  # of the last: 2 - x, in series
    assert made_at_inlet(film, nodes, y, Inlet(~rows, 0.0), ones, ones) == (ones, ones)


def test_whichever_way_round_and_by_any_method():
    """The mirror image under a wall that moves the other way, half of a film, other methods: the same load."""
    whole = load_of(opening(31))
    sides = {"west": 1e5, "east": 0.0, "south": 1e5, "north": 0.0}
    film = [{"shape": "formula", "h": f"3e-6*(1 + 0.6*({L} - x)/{L} - 0.9*(1 - x/{L})^2 + 0.1*y/{L})"}]
    assert load_of(opening(31, U=-0.5, film=film, sides=sides)) == pytest.approx(whole, rel=1e-9)
    for method in ("active-set", "fas"):
        assert load_of(opening(31), method=method) == pytest.approx(whole, rel=1e-7)
    even = {"film": [{"shape": "formula", "h": f"3e-6*(1 + 0.6*x/{L} - 0.9*(x/{L})^2)"}], "sides": dict.fromkeys(sides, 0.0)}
    assert load_of(opening(31, **even)) == pytest.approx(load_of(opening(31, **even), reduction=False), rel=1e-8)


def test_films_that_do_not_rupture_there_are_left_as_they_are():
    film = [{"shape": "linear", "h_start": 6e-6, "h_end": 3e-6}]
    with solve(opening(15, film=film)) as solution:
        assert "revised" not in solution.settings["details"] and not solution.problem.remade
    with solve(opening(15)) as solution:
        rows = solution.fields["r"].reshape(15, 15)[:, 0] > 0
        assert solution.settings["details"]["revised"] >= rows.sum() > 0 and solution.problem.remade


@pytest.mark.parametrize("name", ["mu", "U", "p_east"])
def test_derivatives_are_those_of_differences_with_faces_held(name):
    """By what changes the load; the front moves, but the flow is least there."""
    scene = opening(31)
    key = {"mu": "fluid.mu", "U": "U", "p_east": "sides.east.p"}[name]
    value = {"mu": 0.05, "U": 0.5, "p_east": 1e5}[name]
    with solve(scene, stopping={"eps1": 1e-11}) as solution:
        slope = solution.gradient("pressure_integral", [key])[key]
    step = 1e-4 * value
    ends = [
        solve(load_scene(scene, {key: value + k * step}), stopping={"eps1": 1e-11}).numbers["pressure_integral"]
        for k in (-1, 1)
    ]
    assert slope == pytest.approx((ends[1] - ends[0]) / (2 * step), rel=1e-5)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6), driven=st.floats(0, 10))
def test_faces_are_positive_and_carry_no_more_than_the_thickest_film(seed, driven):
    rng = np.random.default_rng(seed)
    a = rng.uniform(-0.9, 3, 3)
    film = lambda x, y: 1e-6 * (1.05 + np.maximum(a[0] * x + a[1] * x**2, -1) + 0.3 * np.sin(a[2] * y))  # noqa: E731
    y, rows = rng.random(4), rng.random((4, 1)) > 0.3
    C, H = made_at_inlet(film, np.array([0.0, 0.5, 1.0]), y, Inlet(rows, driven), np.ones((4, 2)), np.ones((4, 2)))
    thickest = film(np.linspace(0, 0.5, 99)[None], y[:, None]).max(axis=1)
    assert (C > 0).all() and (H > 0).all() and (H[rows[:, 0], 0] <= thickest[rows[:, 0]] * (1 + 1e-12)).all()


def test_on_ranks(cli, tmp_path):
    """As alone, on lines that the ranks do not divide."""
    (tmp_path / "wave.toml").write_text(
        f"""family = "bearing"\ndimension = 2\nL = {L}\nwidth = {L}\nU = 0.5\nn = 23
[fluid]\nmu = 0.05\n[sides]\nwest = 0.0\neast = 1e5\nsouth = 1e5\nnorth = 0.0
[[film]]\nshape = "formula"\nh = "3e-6*(1 + 0.6*x/{L} - 0.9*(x/{L})^2 + 0.1*y/{L})"\n"""
    )
    loads = [cli("solve", "wave.toml", "--json", ranks=ranks).json["load"] for ranks in (1, 2, 3)]
    assert loads[1:] == pytest.approx([loads[0]] * 2, rel=1e-9) and loads[0] > 0
