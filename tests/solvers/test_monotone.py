"""The monotone method: supersolutions that fall to the solution on every film, and the last resort where all else fails."""

import numpy as np
import pytest
from films import dense, knots, make_problem, pressures, schemes, shapes
from hypothesis import given, settings
from hypothesis import strategies as st

from lcp_lube.api import solve
from lcp_lube.base.options import recipe
from lcp_lube.base.stages import Stages
from lcp_lube.errors import InputError
from lcp_lube.problems.solution import Outcome
from lcp_lube.scenes.scene import load_scene
from lcp_lube.solvers.job import Job
from lcp_lube.solvers.monotone import ModelSystem, Monotone
from lcp_lube.solvers.newton import Stopping, iterate


def run(problem, start=None, sweeps=0, watch=None):
    with recipe("umfpack"):
        method = Monotone(Job(problem, Stages(), "reduced", {"sweeps": sweeps}, start=start))
        ended = iterate(method, Stopping(max_it=problem.size + 2), (lambda k, step: watch(method)) if watch else None)
        method.destroy()
    return method, *ended


@settings(max_examples=60)
@given(shape=shapes, film=knots(100), scheme=schemes, p_sides=pressures)
def test_every_film_ends_from_above(shape, film, scheme, p_sides):
    """From no start at all: supersolutions (G >= 0) that only fall, a policy that only grows, at most n + 1 of them."""
    problem = make_problem(shape, film, scheme, p_sides)
    seen = []

    def watch(method):
        p, r = (method.fields[name] for name in "pr")
        size = method.form.diagonal * np.abs(method.z) + np.abs(problem.c)
        assert (problem.flow(p, r) >= -1e-11 * size.max()).all()
        if seen:
            assert (method.z <= seen[-1][0] + 1e-11 * np.abs(method.z).max()).all() and (seen[-1][1] <= method.cavity).all()
        seen.append((method.z.copy(), method.cavity.copy()))

    method, outcome, message, steps = run(problem, watch=watch)
    assert outcome is Outcome.CONVERGED and len(steps) <= problem.size + 1, message
    assert problem.certify(method.fields, 1e-8).holds
    problem.destroy()


@settings(max_examples=40)
@given(shape=shapes, film=knots(100), p_sides=pressures, seed=st.integers(0, 2**31), sweeps=st.sampled_from([0, 5]))
def test_any_start_ends_at_the_same_answer(shape, film, p_sides, seed, sweeps):
    """Random phases to start from, wrong ones among them, and starts that are no numbers."""
    problem = make_problem(shape, film, "face", p_sides)
    noise = np.random.default_rng(seed)
    cold = run(problem)[0].fields
    for z in (noise.normal(size=problem.size), np.full(problem.size, np.nan)):
        method, outcome, message, _ = run(problem, {"p": np.maximum(z, 0), "r": np.maximum(-z, 0)}, sweeps)
        assert outcome is Outcome.CONVERGED, message
        np.testing.assert_allclose(method.fields["p"], cold["p"], atol=1e-10 * max(cold["p"].max(), 1.0))
        np.testing.assert_allclose(method.fields["r"], cold["r"], atol=1e-10 * max(cold["r"].max(), 1.0))
    problem.destroy()


@settings(max_examples=40)
@given(shape=shapes, film=knots(100), scheme=schemes, seed=st.integers(0, 2**31))
def test_models_have_m_matrices(shape, film, scheme, seed):
    """For all policies: nonpositive off the diagonal, nonnegative column sums, a nonnegative inverse."""
    problem = make_problem(shape, film, scheme)
    noise = np.random.default_rng(seed)
    cavity = noise.random(problem.size) < 0.5
    full = ~cavity & (noise.random(problem.size) < 0.5)
    with recipe("umfpack"):
        system = ModelSystem(problem, Stages())
        system.solve_model(cavity, full, 1e-8)
        J = dense(system.mat)
        system.destroy()
    off = J - np.diag(np.diag(J))
    assert (off <= 0).all() and (J.sum(axis=0) >= -1e-12 * np.diag(J).max()).all()
    assert (np.linalg.inv(J) >= -1e-12 * np.abs(np.linalg.inv(J)).max()).all()
    problem.destroy()


HARD = {  # films on which plain Newton steps cycle, or that need dozens of them
    "deep dimples": ("textured_slider", {"K": 1, "depth": 135e-6, "scheme": "face"}),
    "rough": ("rough", {"n": 40, "amplitude": 8e-6, "seed": 3}),
    "rougher": ("rough", {"nx": 37, "ny": 30, "amplitude": 12e-6, "cells": 20, "seed": 11}),
    "reformation": ("problem3", {"n": 400}),
    "many fronts": ("problem4", {"n": 40, "p_a": 1e5, "p_b": 1e5, "p_side": 1e5}),
}


@pytest.mark.parametrize("film", HARD)
def test_hard_films(film):
    solution = solve(load_scene(*HARD[film]), method="monotone", certify=True)
    assert solution.converged and solution.enclosure.certified, solution.message
    solution.destroy()


@pytest.mark.parametrize("film", HARD)
def test_last_resort_of_auto(film, monkeypatch):
    """With all that stands before it made to fail, the answer is still found, and the message tells how."""
    from lcp_lube.solvers.active_set import ActiveSet
    from lcp_lube.solvers.din_pc import DinPc
    from lcp_lube.solvers.fas.driver import Fas
    from lcp_lube.solvers.pivoting import Pivoting
    from lcp_lube.solvers.steplength import StepLengthError

    def fail(self):
        raise StepLengthError("made to fail")

    monkeypatch.setattr(ActiveSet, "advance", fail)
    monkeypatch.setattr(DinPc, "advance", fail)
    monkeypatch.setattr(Fas, "advance", fail)
    monkeypatch.setattr(Pivoting, "advance", fail)
    solution = solve(load_scene(*HARD[film]))
    assert solution.converged, solution.message
    assert solution.settings["method"] == "monotone"
    assert solution.message.count("made to fail") >= 1
    solution.destroy()


@pytest.mark.parametrize("words, ranks", [("problem1 --n 101", 3), ("problem4 --nx 33 --ny 41", 2)])
def test_on_several_ranks(cli, words, ranks):
    name, *changes = words.replace("--", "").split()
    numbers = {key: int(value) for key, value in zip(changes[::2], changes[1::2], strict=True)}
    alone = solve(load_scene(name, numbers), method="active-set")
    several = cli("solve", *words.split(), "--method", "monotone", "--json", ranks=ranks).json
    assert several["converged"]
    assert several["load"] == pytest.approx(alone.problem.quantities(alone.fields)["load"], rel=1e-10)
    alone.destroy()


@pytest.mark.parametrize(
    "options, message", [({"sweeps": -1}, "sweeps"), ({"rtol": 0.0}, "rtol"), ({"p0": 1.0}, "no such option")]
)
def test_options_out_of_range(options, message):
    with pytest.raises(InputError, match=message):
        solve(load_scene("problem1", {"n": 10}), method="monotone", options=options)
