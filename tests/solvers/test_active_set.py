"""Active set, predictor-corrector, nested iteration and the plan behind 'auto'."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from petsc4py import PETSc

from lcp_lube.api import solve
from lcp_lube.drivers.levels import level_shapes
from lcp_lube.errors import InputError
from lcp_lube.output.results import as_dict, summary
from lcp_lube.problems.solution import Outcome
from lcp_lube.scenes.scene import load_scene
from lcp_lube.solvers.newton import Stopping


def run(name, changes=None, **kwargs):
    return solve(load_scene(name, changes or {}), **kwargs)


@pytest.mark.parametrize("name", ["problem1", "problem2", "problem3"])
@pytest.mark.parametrize("scheme", ["nodal", "face", "upwind"])
def test_active_set_ends_at_the_discrete_solution(name, scheme):
    """The answer of DIN converged to rounding, exactly complementary, in few steps."""
    changes = {"n": 73, "scheme": scheme}
    ours, din = run(name, changes, method="active-set"), run(name, changes, method="din")
    assert ours.converged and ours.iterations <= 12
    assert not (ours.fields["p"] * ours.fields["r"]).any() and (ours.fields["p"] >= 0).all() and (ours.fields["r"] >= 0).all()
    np.testing.assert_allclose(ours.fields["p"], din.fields["p"], atol=1e-6)
    np.testing.assert_allclose(ours.fields["r"], din.fields["r"], atol=1e-6)
    assert ours.certificate.measures["residual"] < 1e-12
    ours.destroy()
    din.destroy()


@pytest.mark.parametrize(
    "K, p_max, force, cavitated", [(1, 482112.287892, -230.290207, 484), (4, 529298.978092, -277.726716, 7730)]
)
def test_textured_slider_to_nine_digits(K, p_max, force, cavitated):
    """Benchmark of the FBNS codes: two other codes agree on these digits."""
    solution = run("textured_slider", {"K": K}, method="active-set", nested=False)
    p = solution.fields["p"] * solution.problem.p_unit + 30e3
    assert p.max() == pytest.approx(p_max, rel=1e-11)
    assert np.sum(p - 100e3) * (0.08 / (30 * K + 1)) ** 2 == pytest.approx(force, rel=2e-9)
    assert (solution.fields["r"] > 0).sum() == cavitated
    solution.destroy()


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    amplitude=st.floats(0, 8e-6),
    p=st.sampled_from([0.0, 1e3, 1e5, 1e6]),
    U=st.floats(0.05, 50),
    scheme=st.sampled_from(["face", "upwind"]),
)
def test_rough_films(seed, amplitude, p, U, scheme):
    """Complementarity, r < 1 and mass conservation on any film; the interior method may have to help."""
    sides = {"p_a": p, "p_b": p, "p_side": p}
    changes = {"seed": seed, "amplitude": amplitude, "U": U, "scheme": scheme, "nx": 19, "ny": 22, "cells": 15, **sides}
    solution = run("rough", changes, method="active-set")
    assert solution.converged, solution.message
    assert solution.fields["r"].max() < 1.0 and solution.fields["p"].min() >= 0.0
    assert solution.certificate.measures["mass_defect"] < 1e-7
    solution.destroy()


PRESSED = "problem4", {"n": 24, "p_a": 1e6, "p_b": 1e6, "p_side": 1e6}  # six steps: nothing is known of its front


def test_fallback_takes_over_and_says_so():
    solution = run(*PRESSED, method="active-set", options={"p0": 1.0})
    assert solution.converged and "took over" not in solution.message
    solution.destroy()
    rescued = run(*PRESSED, method="active-set", options={"give_up": 1})  # an option is no wish to fail
    assert rescued.converged and (rescued.method, rescued.asked, rescued.took_over) == ("pivoting", "active-set", "pivoting")
    assert (
        summary(as_dict(rescued))
        .splitlines()[0]
        .startswith("problem4 (24 x 24, scheme nodal) by active-set, from which pivoting took over,")
    )
    given_up = run(*PRESSED, method="active-set", options={"give_up": 1}, rescue=False)
    assert (
        given_up.outcome is Outcome.STALLED
        and "active-set.give_up" in given_up.message
        and given_up.settings["took_over"] is None
    )
    for solution in (rescued, given_up):
        solution.destroy()


def test_fallback_from_a_cycling_start(monkeypatch):
    from lcp_lube.solvers.active_set import ActiveSetOptions

    monkeypatch.setattr(ActiveSetOptions.__init__, "__defaults__", (1.0, 4, 1, 1e-8, 16))  # give up after one step
    solution = run(*PRESSED, method="active-set")
    assert solution.converged and "pivoting took over" in solution.message
    solution.destroy()


@pytest.mark.parametrize("name, n", [("problem1", 100), ("problem2", 100), ("problem1", 1000), ("problem4", 24)])
@pytest.mark.parametrize("system", ["full", "reduced"])
def test_predictor_corrector(name, n, system):
    solution = run(name, {"n": n}, method="din-pc", system=system, recipe="umfpack")
    assert solution.converged and solution.iterations <= 15
    solution.destroy()


@pytest.mark.parametrize("name", ["problem1", "problem2", "problem3"])
def test_predictor_corrector_is_nested_on_fine_grids(name):
    """At most 12 steps for ten thousand points: a start with the layer at the front as thin as a coarse mesh."""
    solution = run(name, {"n": 10_000}, method="din-pc")
    assert solution.converged and len(solution.levels) == 8 and solution.iterations <= 12
    solution.destroy()
    given = run(name, {"n": 1000}, method="din-pc", options={"p0": 2.0})
    assert given.converged and not given.levels, "a start that someone chose is to be used"
    given.destroy()


def test_nested_iteration_ends_where_one_grid_does():
    flat, nested = (run("problem4", {"nx": 181, "ny": 120}, method="active-set", nested=n) for n in (False, True))
    assert [level["nx"] for level in nested.levels] == [44, 90, 181] and not flat.levels
    assert nested.iterations <= flat.iterations
    np.testing.assert_allclose(nested.fields["p"], flat.fields["p"], atol=1e-9)
    flat.destroy()
    nested.destroy()


@pytest.mark.parametrize("name, changes", [("problem4", {"n": 151}), ("rough", {"n": 103}), ("problem3", {"n": 3001})])
def test_sweeps_save_steps(name, changes):
    """At most 3 steps on the finest grid with the sweeps, the same answer as without them."""
    pytest.importorskip("numba")
    ours, plain = (run(name, changes, nested=True, options={"sweeps": k}) for k in (16, 0))
    assert ours.converged and plain.converged
    assert ours.iterations <= 3 and ours.iterations <= plain.iterations
    np.testing.assert_allclose(ours.fields["p"], plain.fields["p"], atol=1e-6)
    ours.destroy()
    plain.destroy()


@pytest.mark.parametrize(
    "name, changes",
    [
        ("dimpled_pad", {"n": 60}),
        ("herringbone_journal", {"n": 40}),
        ("dam_journal", {"nx": 180, "ny": 15}),
        ("lined_pad", {"n": 99}),
    ],
)
def test_small_films_do_without_sweeps(name, changes, monkeypatch):
    """From a start: direct steps of small films cost less than loading the compiler; without a cavity there is no front. What a
    dam presses begins full: taken for empty, it filled by a cell a step."""
    monkeypatch.setattr("lcp_lube.solvers.relaxation.compiled", None)
    solution = run(name, changes)
    assert solution.converged and solution.settings["method"] == "active-set"
    solution.destroy()


def test_sweeps_converge_by_themselves():
    """Nonlinear Gauss-Seidel on an M-function: ||G|| falls to rounding."""
    pytest.importorskip("numba")
    from lcp_lube.solvers.relaxation import Relaxation

    problem = load_scene("problem4", {"nx": 12, "ny": 9}).build()
    p, r = Relaxation(problem)({"p": np.ones(108), "r": np.zeros(108)}, 2000).values()
    assert problem.reduce.norm(problem.flow(p, r)) < 1e-12 * problem.reduce.norm(problem.c)
    assert (p >= 0).all() and (r >= 0).all() and not (p * r).any()
    problem.destroy()


@pytest.mark.parametrize("method", ["din", "din-pc"])
def test_interior_methods_start_inside_on_the_next_grid(method):
    solution = run("problem2", {"n": 211}, method=method, nested=True)
    assert solution.converged and len(solution.levels) == 3
    solution.destroy()


def test_level_shapes():
    assert level_shapes((1023, 511)) == [(63, 31), (127, 63), (255, 127), (511, 255), (1023, 511)]
    assert level_shapes((1023, 511), ranks=100) == [(511, 255), (1023, 511)]
    assert level_shapes((10,)) == [(10,)] and level_shapes((3, 1000)) == [(3, 1000)]


def test_very_fine_line():
    """Steps on the finest of many grids stay few, and rounding in G is not taken for a failure."""
    solution = run("problem3", {"n": 30_011})
    assert solution.converged and solution.iterations <= 3
    solution.destroy()


def test_auto_chooses_and_says_why():
    small, line = run("problem4", {"n": 20}, system="reduced"), run("problem1")
    assert small.settings["method"] == "active-set" and small.settings["recipe"] == "dissection"
    assert line.settings["recipe"] == "banded" and any("tridiagonal" in reason for reason in line.settings["why"])
    din = run("problem1", options={"mu": "mu1"})
    assert din.settings["method"] == "din"
    for solution in (small, line, din):
        solution.destroy()


def test_auto_in_the_plane(monkeypatch):
    """Nonlinear multigrid where its loops are compiled and the grid is not small, else the active set."""
    pytest.importorskip("numba")
    few = run("problem4", {"n": 20})
    assert few.settings["method"] == "active-set" and few.converged
    assert any("10000 points and fewer are solved sooner" in reason for reason in few.settings["why"])
    few.destroy()
    sweeps = run("problem4", {"n": 150})
    assert sweeps.settings["method"] == "fas" and sweeps.converged and sweeps.total("linear_iterations") == 0
    monkeypatch.setattr("lcp_lube.drivers.plan.has_numba", lambda: False)
    steps = run("problem4", {"n": 150})
    assert steps.settings["method"] == "active-set" and steps.converged
    np.testing.assert_allclose(sweeps.fields["p"], steps.fields["p"], atol=1e-6)
    sweeps.destroy()
    steps.destroy()


@pytest.mark.parametrize(
    "missing, recipe", [({"hypre"}, "bcgs_ml"), ({"hypre", "ml"}, "bcgs_gamg"), ({"hypre", "ml", "numba"}, "bcgs_gamg")]
)
@pytest.mark.parametrize("scene, changes", [("problem4", {"n": 150}), ("textured_slider", {"K": 5})])
def test_auto_without_what_it_likes_best(scene, changes, missing, recipe, monkeypatch):
    """The inner solver: another multigrid, array arithmetic for compiled loops; the same answer, and the reason is said."""
    has = PETSc.Sys.hasExternalPackage
    if recipe == "bcgs_ml" and not has("ml"):
        pytest.skip("this PETSc has no ML")
    best = run(scene, changes, method="active-set")
    sys = SimpleNamespace(hasExternalPackage=lambda name: name not in missing and has(name))
    monkeypatch.setattr("lcp_lube.drivers.plan.PETSc", SimpleNamespace(Sys=sys, Options=PETSc.Options))
    if "numba" in missing:
        monkeypatch.setattr("lcp_lube.solvers.relaxation.has_numba", lambda: False)
    solution = run(scene, changes, method="active-set")
    assert solution.converged and solution.settings["recipe"] == recipe and solution.settings["system"] == "cavity"
    assert any("no hypre" in reason for reason in solution.settings["why"])
    assert solution.total("linear_iterations") <= 8 * solution.iterations
    np.testing.assert_allclose(solution.fields["p"], best.fields["p"], atol=1e-6 * best.fields["p"].max())
    best.destroy()
    solution.destroy()


@pytest.mark.parametrize(
    "options, message",
    [({"patience": 0}, "patience"), ({"rtol": 2.0}, "rtol"), ({"p0": -1.0}, "--p0"), ({"nosuch": 1}, "no such option")],
)
def test_options_out_of_range(options, message):
    with pytest.raises(InputError, match=message):
        run("problem1", {"n": 10}, method="active-set", options=options)


def test_constant_film_and_no_flow_to_speak_of():
    """c = 0: norms are absolute, and the answer is the linear pressure."""
    solution = run("problem1", {"h_max": 15e-6, "p_a": 2e6, "p_b": 1e6, "n": 9}, method="active-set")
    assert solution.converged and solution.iterations <= 2
    np.testing.assert_allclose(solution.fields["p"], 2 - np.arange(1, 10) / 10, rtol=1e-12)
    solution.destroy()


def test_not_converged_in_time():
    solution = run(*PRESSED, method="active-set", stopping=Stopping(max_it=2), options={"give_up": 50})
    assert solution.outcome is Outcome.MAX_ITERATIONS and not solution.converged
    solution.destroy()
