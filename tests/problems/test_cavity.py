"""Which points are cavitated: one threshold, whatever rounding or a method leaves in p and r."""

import tomllib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcp_lube import load_scene, solve
from lcp_lube.problems.film.cavity import cavitated, cavity_sign

FULL = 'family = "bearing"\nL_mm = 10\nU = 1\nnx = 9\n[fluid]\nmu = 0.01\n[film]\nshape = "constant"\nh_um = 10\n'
CLOSED = """family = "bearing"
dimension = 2
L_mm = 10
width_mm = 6
U = 1.5
nx = 9
ny = 7
[fluid]
mu = 0.02
p_supply = 1e5
[film]
shape = "linear"
h_start_um = 15
h_end_um = 20
[sides]
west = "closed"
south = "closed"
"""


def quantities(problem, p, r):
    """What is read off the fields, as numbers."""
    found = problem.quantities({"p": p, "r": r})
    return {name: value for name, value in found.items() if name not in ("p_max_at", "min_h_at", "flow")}


@pytest.fixture(scope="module")
def films(tmp_path_factory):
    """Two films: full at zero pressure everywhere, and mostly cavitated behind closed sides."""
    folder = tmp_path_factory.mktemp("films")
    solutions = []
    for name, text in (("full", FULL), ("closed", CLOSED)):
        (folder / f"{name}.toml").write_text(text)
        solutions.append(solve(load_scene(folder / f"{name}.toml"), method="active-set"))
    yield solutions
    for solution in solutions:
        solution.destroy()


@given(r=st.sampled_from([0.0, 1e-300, 1e-167, 1e-20, 1e-12]), p=st.sampled_from([0.0, 1e-300, 1e-20]))
def test_no_pressure_and_no_void_is_a_full_film(films, r, p):
    problem, n = films[0].problem, films[0].problem.size
    found = quantities(problem, np.full(n, p), np.full(n, r))
    assert found["cavitated_fraction"] == 0.0 and found["rupture"] is None and found["reformation"] is None


@given(seed=st.integers(0, 10**6), size=st.sampled_from([1e-9, 1e-12, 1e-30]))
def test_traces_change_nothing(films, seed, size):
    """An interior method ends beside the bounds, with p > 0 in the cavity and r > 0 in the full film."""
    solution = films[1]
    assert (
        solution.converged
        and 0.3 < quantities(solution.problem, solution.fields["p"], solution.fields["r"])["cavitated_fraction"] < 1.0
    )
    traces = size * np.random.default_rng(seed).random((2, solution.problem.size))
    p = np.where(solution.fields["p"] > 0, solution.fields["p"], traces[0] * solution.fields["p"].max())
    r = np.where(solution.fields["r"] > 0, solution.fields["r"], traces[1])
    one, two = quantities(solution.problem, solution.fields["p"], solution.fields["r"]), quantities(solution.problem, p, r)
    for name in ("cavitated_fraction", "cavitated_area"):
        assert one[name] == two[name]
    for name in ("friction", "load", "rupture", "reformation"):
        assert two[name] == pytest.approx(one[name], rel=1e-6)


def test_what_an_iteration_leaves_of_no_pressure_fills_no_film():
    """Every cell has void, and the largest pressure is dust, which is not a film's scale."""
    with solve(load_scene(tomllib.loads(FULL))) as s:
        p, r = np.array([1e-9, 3e-9, 0.0]), np.array([0.07, 0.17, 0.0])
        assert list(cavitated(s.problem.reduce, p, r)) == [True, True, False]
        assert list(cavity_sign(s.problem.reduce, p, r) < 0) == [True, True, False]
