"""The inexact interior point method: table 1, the elimination, bounds of every kind."""

import csv
from pathlib import Path

import numpy as np
import pytest
from box_problems import BOTH, affine, obstacle
from hypothesis import given, settings
from hypothesis import strategies as st

from lcp_lube.base.options import recipe
from lcp_lube.base.stages import Stages
from lcp_lube.errors import InputError
from lcp_lube.problems.solution import Outcome
from lcp_lube.solvers.box_active_set import BoxActiveSet
from lcp_lube.solvers.interior import Interior
from lcp_lube.solvers.job import Job
from lcp_lube.solvers.newton import Stopping, iterate

TABLE = Path(__file__).parents[2] / "benchmarks" / "published" / "bergamaschi_zilli" / "table1.csv"
PRINTED = [row for row in csv.DictReader(TABLE.read_text().splitlines()) if int(row["n"]) <= 4096]


@pytest.mark.parametrize(
    "row", [row for row in PRINTED if row["nonlinear_it"] != "fail"], ids=lambda r: f"{r['lambda']}-{r['n']}"
)
def test_table_1(row):
    """Nonlinear iterations to the digit, linear ones within 7 % (lambda = 6: the other branch, and the count by chance)."""
    n = int(row["n"]) ** 0.5
    solution = obstacle({"n": int(n), "lambda": float(row["lambda"]), "v0": 1}, method="interior", recipe="bcgs_jacobi")
    assert solution.converged, solution.message
    assert solution.iterations == int(row["nonlinear_it"])
    assert solution.total("linear_iterations") == pytest.approx(int(row["linear_it"]), rel=0.07)
    assert solution.steps[-1].norm <= 8e-8
    solution.destroy()


def test_lambda_10_fails_from_the_papers_start_and_is_solved_in_contact():
    fails = obstacle({"n": 32, "lambda": 10, "v0": 1}, method="interior", recipe="bcgs_jacobi")
    assert fails.outcome is Outcome.STEP_LENGTH and "v_upper" in fails.message and "v0" in fails.message
    fails.destroy()
    solution = obstacle({"n": 64, "lambda": 10, "v0": 2}, method="interior", recipe="bcgs_jacobi")
    found = solution.problem.quantities(solution.fields)
    assert solution.converged and found["contact_upper"] == 1828 and found["contact_lower"] == 0
    assert found["max_v"] == pytest.approx(4, abs=1e-6)
    solution.destroy()


@pytest.mark.parametrize("lower, upper", [(-1.0, 2.0), (-np.inf, 2.0), (-1.0, np.inf), (-np.inf, np.inf)])
def test_the_step_solves_all_five_equations(lower, upper):
    """The condensed step against H' d = -H + sigma mu e, from a point with all residuals other than zero."""
    rng = np.random.default_rng(1)
    M = rng.normal(size=(7, 7)) + 7 * np.eye(7)
    problem = affine(M, rng.normal(size=7), lower, upper)
    with recipe("lu"):
        run = Interior(Job(problem, Stages()))
        has1, has2 = np.isfinite(problem.lower), np.isfinite(problem.upper)
        for name, has in (("s1", has1), ("s2", has2), ("z1", has1), ("z2", has2)):
            getattr(run.at, name)[has] *= 1 + rng.random(has.sum())
        run.H = run._H(run.at)
        run.norm = np.linalg.norm(np.concatenate(run.H))
        old, H = run.at, run.H
        mu = (H[1].sum() + H[2].sum()) / max(has1.sum() + has2.sum(), 1)
        step = run.advance()
        d = {name: (getattr(run.at, name) - getattr(old, name)) / step.alpha for name in ("v", "s1", "s2", "z1", "z2")}
        run.destroy()
    assert step.sigma == pytest.approx(min(0.2, mu))
    target = step.sigma * mu
    np.testing.assert_allclose(M @ d["v"] - d["z1"] + d["z2"], -H[0], atol=1e-11)
    for s, z, ds, dz, products, has in (
        (old.s1, old.z1, d["s1"], d["z1"], H[1], has1),
        (old.s2, old.z2, d["s2"], d["z2"], H[2], has2),
    ):
        np.testing.assert_allclose(z * ds + s * dz, np.where(has, target - products, 0.0), atol=1e-11)
    np.testing.assert_allclose(np.where(has1, d["v"], 0.0) - d["s1"], -H[3], atol=1e-11)
    np.testing.assert_allclose(-np.where(has2, d["v"], 0.0) - d["s2"], -H[4], atol=1e-11)
    problem.destroy()


def test_both_bounds_agree_with_the_active_set():
    reference = obstacle({**BOTH, "n": 32}, stopping={"eps1": 1e-12})
    solution = obstacle({**BOTH, "n": 32}, method="interior", stopping={"eps1": 1e-11})
    assert solution.converged and reference.converged
    np.testing.assert_allclose(solution.fields["v"], reference.fields["v"], atol=2e-8)
    contact = [s.problem.quantities(s.fields) for s in (reference, solution)]
    assert contact[0]["contact_lower"] == contact[1]["contact_lower"] > 0
    assert contact[0]["contact_upper"] == contact[1]["contact_upper"] > 0
    reference.destroy()
    solution.destroy()


BOUND = st.one_of(st.floats(-3, 3), st.none())


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    bounds=st.lists(st.tuples(BOUND, st.one_of(st.floats(0.05, 4), st.none())), min_size=1, max_size=9),
)
def test_any_box_affine_and_monotone(seed, bounds):
    """Positive definite M, any mix of bounds: both methods reach the one solution."""
    rng = np.random.default_rng(seed)
    n = len(bounds)
    lower = np.array([-np.inf if low is None else low for low, _ in bounds])
    upper = np.array([np.inf if width is None else (0.0 if low is None else low) + width for low, width in bounds])
    M = rng.uniform(-1, 1, size=(n, n)) / n + 2 * np.eye(n)
    q = 5 * rng.normal(size=n)
    answers = []
    with recipe("lu"):
        for build_method in (Interior, BoxActiveSet):
            problem = affine(M, q, lower, upper)
            run = build_method(Job(problem, Stages(), "jacobian"))
            outcome, message, _ = iterate(run, Stopping(1e-11, np.inf, 100))
            assert outcome is Outcome.CONVERGED, message
            v = run.fields["v"]
            assert (v >= lower).all() and (v <= upper).all()
            answers.append(v)
            run.destroy()
            problem.destroy()
    np.testing.assert_allclose(*answers, atol=1e-7)
    f = M @ answers[1] + q
    assert np.abs(np.clip(f, answers[1] - upper, answers[1] - lower)).max() < 1e-9


def test_refusals():
    with pytest.raises(InputError, match=r"interior.beta = 3"):
        obstacle({"n": 8}, method="interior", options={"beta": 3.0})
    with pytest.raises(InputError, match=r"interior.z0 = -1"):
        obstacle({"n": 8}, method="interior", options={"z0": -1})
    with pytest.raises(InputError, match="v_lower = v_upper"):
        obstacle({"n": 8, "v_lower": 1, "v_upper": 1}, method="interior")
