"""Derivatives of films whose recesses have corners, without problems near by, are those that the problems say."""

import cornered_films
import numpy as np
import pytest
from cornered_films import drawn, off, own_derivatives

from lcp_lube import solve
from lcp_lube.drivers.derivatives import near_films
from lcp_lube.drivers.derivatives.adjoint import Adjoint
from lcp_lube.problems.film import borne

pytest.importorskip("numba")

ROUNDING = 3e-15  # of the terms, in changes of 1e-5


@pytest.mark.parametrize("seed", range(18))
def test_films_near_by_have_the_lagrangians_of_their_problems(monkeypatch, seed):
    """All of 200 films were within 1e-15; without what fronts and ratios change by, these are off by up to 4e-7."""
    monkeypatch.setattr(near_films, "SMALL", 1)
    worst, found = off(drawn(seed))
    assert worst <= ROUNDING and found >= 9


@pytest.mark.parametrize("ranks", [2, 3])
def test_on_several_ranks(script, ranks):
    job = script("cornered_films.py", ranks=ranks)
    assert job.status == 0, job.err
    assert all(worst <= ROUNDING and found >= 9 for worst, found in job.json)


@pytest.mark.parametrize("seed", range(18, 30))
def test_the_film_s_own_derivative_is_that_of_its_arrays(monkeypatch, seed):
    scene, names = drawn(seed), ["pressure_integral", "friction", "p_max"]
    with solve(scene, reduction=False) as solution:
        fields = own_derivatives(monkeypatch, scene, solution, names)
    for field, other in zip(*fields, strict=True):
        assert field == pytest.approx(other, abs=1e-11 * np.abs(other).max())


def test_drawn_films_have_fronts_and_corners(monkeypatch):
    """So that the others are tests of something."""
    fronts, dry = 0, 0
    for seed in range(24):
        with solve(drawn(seed)) as solution:
            problem, fields = solution.problem.moving, solution.problem.there(solution.fields)
            dry += problem.dry is not None
            found = borne.begun(problem, fields["p"] * problem.p_unit, fields["r"])
            fronts += found is not None and found.at.size > 0
    assert dry >= 15 and fronts >= 5


def test_a_gradient_builds_no_problem(monkeypatch):
    monkeypatch.setattr(near_films, "SMALL", 1)
    scene, built = cornered_films.drawn(18), []
    with solve(scene) as solution:
        adjoint = Adjoint(scene, solution, ["pressure_integral", "friction"])
        monkeypatch.setattr(adjoint, "lagrangians", built.append)
        for key in ("L", "width", "U", "fluid.mu", "film.linear.h_end"):
            adjoint.slopes(key)
        adjoint.destroy()
    assert not built
