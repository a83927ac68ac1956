"""Active set for box-constrained problems: both bounds, multigrid, nested iteration, ranks."""

import numpy as np
import pytest
from box_problems import BOTH, affine, obstacle

from lcp_lube.api import solve
from lcp_lube.base.options import recipe
from lcp_lube.errors import InputError
from lcp_lube.linear.box import BoxSystem
from lcp_lube.scenes.scene import load_scene


@pytest.mark.parametrize("n, lower, upper, sum_v", [(64, 49, 743, 0.18903751), (256, 661, 11112, 0.18914745)])
def test_both_bounds_touched(n, lower, upper, sum_v):
    """Contact counts and sums of an independent solver; n = 64 by a direct solver from v0, n = 256 nested by multigrid."""
    solution = obstacle({**BOTH, "n": n})
    found = solution.problem.quantities(solution.fields)
    assert solution.converged
    assert (found["contact_lower"], found["contact_upper"]) == (lower, upper)
    assert found["sum_v"] == pytest.approx(sum_v, abs=6e-9)
    assert found["max_v"] == 0.3
    assert solution.certificate.extremes["natural_residual"] < 1e-10
    assert solution.settings["recipe"] == ("multigrid" if n == 256 else "umfpack") and bool(solution.levels) == (n == 256)
    solution.destroy()


def test_the_answer_is_exactly_complementary():
    """v in the bounds to the bit; f = 0 off the contact to rounding."""
    solution = obstacle({**BOTH, "n": 40}, stopping={"eps1": 1e-12})
    problem, v = solution.problem, solution.fields["v"]
    f = problem.residual(v)
    assert (v >= problem.lower).all() and (v <= problem.upper).all()
    free = (v > problem.lower) & (v < problem.upper)
    assert 0 < free.sum() < v.size and np.abs(f[free]).max() < 1e-14
    assert (f[v == problem.lower] >= 0).all() and (f[v == problem.upper] <= 0).all()
    solution.destroy()


def test_steps_and_cycles_stay_bounded_as_the_grid_is_refined():
    solution = obstacle({**BOTH, "n": 255}, nested=True, recipe="multigrid")
    assert solution.converged
    assert [level["nx"] for level in solution.levels] == [31, 63, 127, 255]
    for level in solution.levels[1:]:
        assert level["iterations"] <= 6 and level["linear_iterations"] <= 18
    solution.destroy()


@pytest.mark.parametrize("n", [64, 99, 127])
def test_multigrid_does_what_the_direct_solver_does(n, petsc_options):
    """Also between grids that do not nest, and with fewer levels; all solve the same linear systems."""
    reference = obstacle({**BOTH, "n": n}, recipe="umfpack", stopping={"eps1": 1e-12})
    for levels in (None, 2):
        if levels:
            petsc_options(pc_mg_levels=levels)
        solution = obstacle({**BOTH, "n": n}, recipe="multigrid", stopping={"eps1": 1e-12})
        assert solution.converged and solution.settings["pc_type"] == "mg"
        np.testing.assert_allclose(solution.fields["v"], reference.fields["v"], atol=1e-12)
        solution.destroy()
    reference.destroy()


def test_multigrid_on_the_upper_branch():
    """f' is indefinite there."""
    solution = obstacle({"n": 64, "lambda": 6, "v0": 2}, recipe="multigrid")
    assert solution.converged
    assert solution.problem.quantities(solution.fields)["max_v"] == pytest.approx(2.2379592, abs=1e-6)
    solution.destroy()


def test_interior_point_by_multigrid():
    solution = obstacle({**BOTH, "n": 127}, method="interior", recipe="multigrid")
    assert solution.converged and solution.total("linear_iterations") < 10 * solution.iterations
    solution.destroy()


def test_held_and_shifted_systems():
    """Against NumPy, rows with a diagonal that is not positive among them."""
    rng = np.random.default_rng(3)
    M = rng.normal(size=(8, 8))
    M[2, 2] = -1.0
    problem = affine(M, np.zeros(8), -1, 1)
    held = np.array([True, False, True, False, False, True, False, False])
    rhs, shift = rng.normal(size=8), rng.random(8)
    with recipe("lu"):
        system = BoxSystem(problem)
        system.linearise(problem.v0)
        x, _ = system.solve(rhs, 1e-12, held=held)
        y, _ = system.solve(rhs, 1e-12, shift=shift)
        z, _ = system.solve(rhs, 1e-12)
        system.destroy()
    np.testing.assert_array_equal(x[held], rhs[held])
    np.testing.assert_allclose((M @ x)[~held], rhs[~held], atol=1e-12)
    np.testing.assert_allclose(M @ y + shift * y, rhs, atol=1e-12)
    np.testing.assert_allclose(M @ z, rhs, atol=1e-12)
    problem.destroy()


def test_newton_without_bounds_in_contact_is_newton():
    """No bound is touched on the lower branch: as many steps as without bounds, and quadratic convergence."""
    with_bounds, without = (
        obstacle({"n": 33, "lambda": 5, **bounds}, stopping={"eps1": 1e-12})
        for bounds in ({}, {"v_lower": -np.inf, "v_upper": np.inf})
    )
    assert [step.norm for step in with_bounds.steps] == [step.norm for step in without.steps]
    norms = [step.norm for step in with_bounds.steps]
    assert norms[-2] < 10 * norms[-3] ** 2
    with_bounds.destroy()
    without.destroy()


@pytest.mark.parametrize("recipe_name", [pytest.param("bcgs_amg", marks=pytest.mark.hypre), "bcgs_ilu", "bcgs_jacobi"])
def test_any_inner_solver(recipe_name):
    solution = obstacle({**BOTH, "n": 31}, recipe=recipe_name)
    assert solution.converged and solution.total("linear_iterations") > 0
    solution.destroy()


def test_start_from_fields_of_another_grid():
    """prolong moves a coarse answer into the bounds; zero on the boundary, so that v does not overshoot there."""
    coarse = obstacle({**BOTH, "n": 15})
    fine = load_scene("obstacle_bratu", {**BOTH, "n": 31}).build()
    v = fine.prolong(coarse.problem, coarse.fields, False)["v"]
    assert (v >= fine.lower).all() and (v <= fine.upper).all()
    reference = obstacle({**BOTH, "n": 31})
    assert np.abs(v - reference.fields["v"]).max() < 0.01
    for obj in (coarse, fine, reference):
        obj.destroy()


@pytest.mark.parametrize("changes", [{"lambda": 7, "v0": 1}, {"lambda": 9, "v0": 0.5, "v_upper": 8}, {"lambda": 20, "v0": 1}])
def test_where_no_step_decreases_the_flow_of_the_energy_goes_on(changes):
    """Beyond the turning point v rises past where f is smallest to the upper obstacle."""
    solution = obstacle({"n": 24, **changes}, rescue=False, nested=False)
    assert solution.converged and solution.problem.quantities(solution.fields)["contact_upper"] > 0
    norms = np.array([step.norm for step in solution.steps])
    assert (np.diff(norms) > 0).any()
    solution.destroy()


@pytest.mark.parametrize("n", [5, 9])
def test_a_start_that_is_the_answer_but_for_rounding(n):
    """Contact everywhere, on a coarser grid too: nothing is left that could decrease."""
    solution = obstacle({"nx": n, "ny": 64, "lambda": 0, "v_lower": 0.5, "v_upper": 1, "v0": 0}, rescue=False)
    assert solution.converged and (solution.fields["v"] == 0.5).all()
    solution.destroy()


def test_refusals():
    with pytest.raises(InputError, match=r"active-set.rtol = 2"):
        obstacle({"n": 8}, options={"rtol": 2.0})
    with pytest.raises(InputError, match="p0"):
        obstacle({"n": 8}, options={"p0": 2.0})
    problem, other = affine(np.eye(2), np.ones(2), 0, 1), affine(np.eye(3), np.ones(3), 0, 1)
    with pytest.raises(InputError, match="no coarser grids"):
        problem.prolong(other, {"v": other.v0}, False)
    assert np.array_equal(problem.prolong(problem, {"v": problem.v0}, False)["v"], problem.v0)
    problem.destroy()
    other.destroy()


@pytest.mark.parametrize("ranks, n, how", [(3, 50, []), (2, 101, ["--nested", "--recipe", "multigrid"])])
def test_ranks_agree(cli, ranks, n, how):
    """Sizes that no number of ranks divides: the same contact, the same v, as many steps."""
    words = ["solve", "obstacle_bratu", "--n", n, "--set", "v_upper=0.3", "--set", f"v_lower={BOTH['v_lower']}", *how, "--json"]
    one, many = cli(*words).json, cli(*words, ranks=ranks).json
    assert one["converged"] and many["converged"] and many["ranks"] == ranks
    for key in ("contact_lower", "contact_upper"):
        assert many[key] == one[key], key
    assert abs(many["iterations"] - one["iterations"]) <= (1 if how else 0)
    assert many["contact_lower"] > 0 and many["contact_upper"] > 0
    for key in ("sum_v", "max_v"):
        assert many[key] == pytest.approx(one[key], rel=1e-8)
    if how:
        assert abs(many["linear_iterations"] - one["linear_iterations"]) <= 6


@pytest.mark.parametrize("n, lower", [(20, 0.0), (64, 0.0), (63, "-inf"), (20, -1.0)])
@pytest.mark.parametrize("method", ["auto", "semismooth", "fas", "active-set", "interior"])
def test_where_nothing_drives_zero_is_the_answer(n, lower, method):
    """lambda = 0, v = 0 on the boundary: what is left of v is measured by the start, not by itself."""
    if method == "interior":
        with pytest.raises(InputError, match="nothing drives v, and v = 0 is the answer"):
            solve("obstacle_bratu", **{"n": n, "lambda": 0.0, "v_lower": float(lower)}, method=method)
        return
    with solve("obstacle_bratu", **{"n": n, "lambda": 0.0, "v_lower": float(lower)}, method=method) as s:
        assert s.converged and abs(s.max_v) < 1e-6, s.message
        assert s.steps[-1].step_norm < 1001.0 and s.settings["took_over"] is None
