"""The n-by-n family J(theta), its column scaling, and the Schur complement of the full film."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lcp_lube.api import solve
from lcp_lube.base.options import recipe
from lcp_lube.errors import InputError
from lcp_lube.linear.cavity import CavitySystem
from lcp_lube.linear.full import FullSystem
from lcp_lube.linear.nearnull import near_null
from lcp_lube.linear.reduced import ReducedSystem
from lcp_lube.scenes.scene import load_scene
from lcp_lube.solvers.newton import Stopping

HARD = [("rough", {"nx": 23, "ny": 17, "amplitude": 6e-6}), ("textured_slider", {"K": 1}), ("problem4", {"nx": 9, "ny": 14})]
DIRECT = "umfpack"


def dense(mat):
    rows, columns = mat.getSize()
    return mat.getValues(range(rows), range(columns))


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6), name=st.sampled_from(["problem1", "problem3", "problem4", "rough"]))
def test_j_of_theta_is_a_scaled_m_matrix(seed, name):
    """A diag(theta) - B diag(1 - theta): signs, column dominance, and A's diagonal after scaling."""
    rng = np.random.default_rng(seed)
    problem = load_scene(name, {"n": 7}).build()
    theta = rng.choice([0.0, 1.0, rng.random()], size=problem.size)
    system = ReducedSystem(problem)
    scaling = system.assemble(theta)
    J, A, B = dense(system.mat), dense(problem.A), dense(problem.B)
    np.testing.assert_allclose(J, (A * theta - B * (1 - theta)) * scaling, rtol=1e-13, atol=1e-18)
    np.testing.assert_allclose(np.diag(J), np.diag(A), rtol=1e-13)
    off = J - np.diag(np.diag(J))
    assert (off <= 0).all() and (J.sum(axis=0) >= -1e-13 * np.diag(J)).all()
    assert (np.linalg.inv(J) >= -1e-12 * np.abs(np.linalg.inv(J)).max()).all()
    system.destroy()
    problem.destroy()


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10**6), sign=st.sampled_from([1.0, -1.0]))
def test_reduced_and_full_give_the_same_step(seed, sign):
    rng = np.random.default_rng(seed)
    problem = load_scene("problem4", {"nx": 6, "ny": 5}).build()
    D_p, D_r = sign * rng.random(30), sign * rng.random(30)
    f1, f2 = rng.standard_normal(30) * 1e-5, rng.standard_normal(30)
    with recipe(DIRECT):
        systems = [FullSystem(problem), ReducedSystem(problem)]
        (dp, dr, _), (dp2, dr2, _) = (system.solve(D_p, D_r, f1, f2, 1e-12) for system in systems)
        again = systems[1].resolve(2 * f1, 2 * f2, 1e-12)
    np.testing.assert_allclose(dp2, dp, rtol=1e-7, atol=1e-9 * np.abs(dp).max())
    np.testing.assert_allclose(dr2, dr, rtol=1e-7, atol=1e-9 * np.abs(dr).max())
    np.testing.assert_allclose(again[0], 2 * dp2, rtol=1e-9, atol=1e-12 * np.abs(dp).max())
    for thing in (*systems, problem):
        thing.destroy()


@pytest.mark.parametrize("name, changes", HARD)
@pytest.mark.parametrize("seed", range(4))
def test_cavity_elimination_is_exact(name, changes, seed):
    """The step on the full film alone is the step on J(theta), for any theta in {0, 1}^n."""
    rng = np.random.default_rng(seed)
    problem = load_scene(name, changes).build()
    full = (rng.random(problem.size) < rng.uniform(0.1, 0.9)).astype(float)
    f1 = rng.standard_normal(problem.size) * 1e-6
    with recipe(DIRECT):
        reduced, cavity = ReducedSystem(problem), CavitySystem(problem)
        dp, dr, _ = reduced.solve(1 - full, full, f1, 0 * f1, 1e-12)
        dp2, dr2, _ = cavity.solve(1 - full, full, f1, 0 * f1, 1e-12)
    np.testing.assert_allclose(dp2, dp, atol=1e-9 * np.abs(dp).max())
    np.testing.assert_allclose(dr2, dr, atol=1e-9 * np.abs(dr).max())
    for thing in (reduced, cavity, problem):
        thing.destroy()


def test_all_cavitated_and_all_full():
    problem = load_scene("problem4", {"nx": 8, "ny": 5}).build()
    f1 = np.linspace(-1, 2, 40) * 1e-6
    with recipe(DIRECT):
        for full in (np.zeros(40), np.ones(40)):
            reduced, cavity = ReducedSystem(problem), CavitySystem(problem)
            one, two = (s.solve(1 - full, full, f1, 0 * f1, 1e-12) for s in (reduced, cavity))
            np.testing.assert_allclose(two[0], one[0], atol=1e-11 * max(1.0, np.abs(one[0]).max()))
            np.testing.assert_allclose(two[1], one[1], atol=1e-11 * max(1.0, np.abs(one[1]).max()))
            reduced.destroy()
            cavity.destroy()
    problem.destroy()


def test_near_null_vector_of_a_hard_film():
    """w > 0, and S w is small against diag(S) w but for a few cells; constants leave much more."""
    problem = load_scene("textured_slider", {"K": 2}).build()
    solution = solve(load_scene("textured_slider", {"K": 2}), method="active-set", system="reduced", recipe=DIRECT)
    full = solution.fields["p"] > 0
    with recipe(DIRECT):
        system = CavitySystem(problem)
        system.solve(1.0 - full, full.astype(float), problem.c, 0 * problem.c, 1e-8)
    S, w = system.krylov.mat, system._w[full]
    assert (w > 0).all()

    def row_sums(scaling):
        x, y = S.createVecs()
        x.setArray(scaling)
        S.mult(x, y)
        return np.abs(y.array_r) / (S.getDiagonal().array_r * scaling)

    # S is already times diag(w): ones show what multigrid sees now, 1/w what it saw before.
    after, before = row_sums(np.ones(w.size)), row_sums(1.0 / w)
    assert np.sum(after > 0.1) < 0.5 * np.sum(before > 0.1) and after.max() < 0.5 * before.max()
    system.destroy()
    problem.destroy()
    solution.destroy()


@pytest.mark.hypre
@pytest.mark.parametrize("name, changes", [("textured_slider", {"K": 5}), ("rough", {"n": 150, "amplitude": 4e-6})])
def test_few_krylov_iterations_on_hard_films(name, changes, petsc_options):
    """At most 8 BiCGStab iterations to 1e-8 in every step, where plain multigrid takes ten times that."""
    petsc_options(ksp_rtol=1e-8)
    choices = {"method": "active-set", "system": "cavity", "recipe": "bcgs_amg", "nested": False}
    solution = solve(load_scene(name, changes), **choices)
    assert solution.converged
    assert max(step.linear_iterations for step in solution.steps) <= 8
    solution.destroy()


@pytest.mark.parametrize("problem", ["problem1", "problem2", "problem3"])
def test_din_takes_the_same_iterations_on_both_systems(problem):
    counts = []
    for system in ("full", "reduced"):
        solution = solve(load_scene(problem), method="din", system=system, recipe=DIRECT)
        counts.append((solution.iterations, solution.total("centrality"), solution.total("backtracking")))
        solution.destroy()
    assert counts[0] == counts[1]


def test_problem4_by_din_on_both_systems():
    loose = Stopping(1e-4, 1e-4)
    scene = load_scene("problem4", {"nx": 31, "ny": 24})
    runs = [solve(scene, method="din", system=s, recipe=DIRECT, stopping=loose) for s in ("full", "reduced")]
    assert runs[0].iterations == runs[1].iterations
    np.testing.assert_allclose(runs[0].p, runs[1].p, atol=1e-8)
    for run in runs:
        run.destroy()


def test_nearnull_needs_no_hierarchy_on_a_small_matrix():
    problem = load_scene("problem4", {"nx": 8, "ny": 6}).build()
    i, j = np.tile(np.arange(8), 6), np.repeat(np.arange(6), 8)
    assert (near_null(problem.A, i, j, np.ones(48), 1) > 0).all()
    problem.destroy()


def test_cavity_is_refused_where_it_does_not_fit():
    with pytest.raises(InputError, match="allowed are auto, full, reduced"):
        solve(load_scene("problem4", {"n": 8}), method="din", system="cavity")
