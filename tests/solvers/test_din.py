"""DIN: published counts, its parameters and conditions, and how its failures are told."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcp_lube import InputError, load_scene, solve
from lcp_lube.base.stages import Stages
from lcp_lube.output.results import as_dict, finite
from lcp_lube.problems.solution import Outcome
from lcp_lube.solvers import din
from lcp_lube.solvers.job import Job
from lcp_lube.solvers.newton import Stopping


@pytest.fixture
def run():
    """`run("problem1", {"n": 50}, conditions="FB")`: a solution by DIN, destroyed after the test."""
    made = []

    def run(scene="problem1", changes=None, stopping=None, recipe="lu", **options):
        made.append(
            solve(
                load_scene(scene, changes),
                method="din",
                system="full",
                recipe=recipe,
                stopping=stopping,
                options=options,
                nested=False,
            )
        )
        return made[-1]

    yield run
    for solution in made:
        solution.destroy()


def counts(solution):
    return solution.iterations, solution.total("backtracking"), solution.total("centrality")


# Mezzadri and Galligani, tables 2 and 4: n = 100, LAPACK; it, back, cent.
@pytest.mark.parametrize(
    "problem, film, conditions, published",
    [
        (1, "sinusoid", "FCB", (30, 0, 26)),
        (2, "sinusoid", "FCB", (46, 0, 46)),
        (3, "sinusoid", "FCB", (58, 0, 58)),
        (1, "parabola", "FCB", (30, 0, 26)),
        (2, "parabola", "FCB", (46, 0, 46)),
        (3, "parabola", "FCB", (56, 0, 56)),
        (1, "sinusoid", "FB", (16, 0, 0)),
        (2, "sinusoid", "FB", (17, 0, 0)),
        (3, "sinusoid", "FB", (19, 0, 0)),
        (3, "sinusoid", "CB", (51, 0, 79)),
        (1, "sinusoid", "FRCB", (19, 0, 0)),
    ],
)
def test_published_counts(run, problem, film, conditions, published):
    solution = run(f"problem{problem}", {"film": film}, conditions=conditions)
    assert solution.outcome is Outcome.CONVERGED
    assert counts(solution) == published


def test_published_gmres_row(run):
    """Table 10: GMRES and ILU(0), n = 1000, eps = 1e-4: 41 outer and 1779 inner iterations."""
    solution = run("problem1", {"n": 1000}, Stopping(1e-4, 1e-4), "gmres_ilu")
    assert (*counts(solution), solution.total("linear_iterations")) == (41, 0, 41, 1779)


@pytest.mark.parametrize("problem, published", [(1, (15, 7, 0)), (2, (15, 26, 0)), (3, (23, 124, 0))])
def test_starred_runs_are_failures(run, problem, published):
    """Table 4, condition B alone: the method stops content, with negative pressures."""
    solution = run(f"problem{problem}", conditions="B")
    assert counts(solution) == published
    assert solution.steps[-1].norm <= 1e-8 and solution.steps[-1].step_norm <= 1e-8
    assert solution.outcome is Outcome.WRONG_SOLUTION and not solution.converged
    assert "the certificate fails: complementarity" in solution.message
    assert solution.certificate.extremes["min_p"] < -1.0


@pytest.mark.parametrize("mu, p0, iterations", [("mu1", 1.0, 46), ("mu2", 1.0, 46), ("mu2", 1e-5, 35), ("adaptive", 1.0, 46)])
def test_mu_rules_on_problem_2(run, mu, p0, iterations):
    """Table 5, where the rules differ: from (1e-5, 1e-5) mu2 takes 35 iterations; mu1 more than twice as many."""
    solution = run("problem2", mu=mu, p0=p0, r0=p0 if p0 < 1 else 0.1)
    assert solution.converged and solution.iterations == iterations


def test_mu1_stalls_near_the_boundary(run):
    """Table 5: from (1e-15, 1e-15) with mu1 the paper gives up after 500 iterations. So do we, and say so."""
    solution = run("problem2", stopping=Stopping(max_it=60), recipe="superlu", mu="mu1", p0=1e-15, r0=1e-15)
    assert solution.outcome is Outcome.MAX_ITERATIONS and solution.iterations == 60
    assert solution.message.startswith("not converged after 60 iterations with ||F|| = 2.48e-04")
    data = json.loads(json.dumps(finite(as_dict(solution))))
    assert (data["outcome"], data["converged"], data["iterations"]) == ("max_iterations", False, 60)


def test_mu_values():
    assert din.MU_RULES["mu1"](6.0, 5.0, 3) == 2.0
    assert din.MU_RULES["mu2"](6.0, 6.0, 9) == 2.0
    assert din.MU_RULES["adaptive"](0.2, 6.0, 2) == 0.1
    assert din.MU_RULES["adaptive"](0.1, 6.0, 4) == 3.0


@pytest.mark.parametrize("conditions", ["F", "R", "FR", "C", "FC", "RC", "CB", "BCRF", ""])
def test_any_combination_of_conditions(run, conditions):
    """Whatever is switched off, the run ends with an outcome that its certificate bears out."""
    solution = run("problem1", {"n": 20}, Stopping(max_it=60), "superlu", conditions=conditions)
    certificate = solution.certificate
    assert solution.converged == (solution.outcome is Outcome.CONVERGED)
    if solution.converged:
        assert certificate.holds and solution.steps[-1].norm <= 1e-8
    if "F" in conditions:
        assert solution.converged and certificate.extremes["min_p"] >= -1e-9
    if "C" not in conditions:
        assert solution.total("centrality") == 0
    if "B" not in conditions:
        assert solution.total("backtracking") == 0


@given(st.floats(1e-14, 0.9), st.integers(1, 10**8), st.floats(0, 0.99), st.floats(0, 1e3))
def test_forcing_keeps_the_sum_of_forcing_terms_admissible(sigma, n, tau1, tau2):
    """(31): sigma_k > delta_k max(...), and delta_k at most 0.1."""

    class Given:
        options = din.DinOptions()
        problem = type("P", (), {"size": n})
        central = type("C", (), {"tau1": tau1, "tau2": tau2})

    delta = din.DIN.forcing(Given(), sigma)
    root, gamma = np.sqrt(n), 0.5
    worst = max((root + tau1 * gamma) / (1 - tau1 * gamma), (root + tau2 * gamma) / root)
    assert 0 < delta <= 0.1
    assert sigma >= delta * worst * (1 - 1e-14) and (n == 1 or sigma > delta * worst)


@pytest.mark.parametrize(
    "name, value, message",
    [
        ("p0", 0.0, "--p0 0.0: a positive number"),
        ("p0", -1, "--p0 -1.0: a positive number"),
        ("p0", float("nan"), "--p0 nan: a positive number"),
        ("r0", float("inf"), "--r0 inf: a positive number"),
        ("p0", "much", "din.p0 = much: a value of type float is needed"),
        ("p0", True, "din.p0 = True: a value of type float is needed"),
        ("p0", [1], "din.p0 = [1]: a value of type float is needed"),
        ("mu", "mu3", "--mu mu3: allowed are mu1, mu2, adaptive"),
        ("conditions", "FX", "--conditions FX: any combination of the letters F, R, C, B"),
        ("conditions", "FF", "--conditions FF: any combination of the letters F, R, C, B, each once"),
        ("gamma", 1.0, "din.gamma = 1.0: allowed are numbers between 0 and 1"),
        ("theta", 0, "din.theta = 0.0: allowed are numbers between 0 and 1"),
        ("beta", float("nan"), "din.beta = nan: allowed are numbers between 0 and 1"),
        ("sigma_max", -0.5, "din.sigma_max = -0.5: allowed"),
        ("gama", 0.5, "din.gama: method din has no such option; nearest is gamma"),
    ],
)
def test_parameters_out_of_range(run, name, value, message):
    with pytest.raises(InputError) as caught:
        run("problem1", {"n": 5}, **{name: value})
    assert str(caught.value).startswith(message) and "\n" not in str(caught.value)


def test_parameters_change_the_run(run):
    """Each parameter is heeded: another value, another record."""
    base = {"n": 30}
    reference = [(step.norm, step.alpha) for step in run("problem1", base, recipe="superlu").steps]
    for name, value in {"p0": 2.0, "r0": 0.2, "sigma_max": 1e-4, "sigma_factor": 0.1, "theta": 0.7}.items():
        steps = [(step.norm, step.alpha) for step in run("problem1", base, recipe="superlu", **{name: value}).steps]
        assert steps != reference, name


def test_start_from_given_fields(run):
    """`build` takes fields to start from; from an answer moved off the boundary fewer steps are needed."""
    first = run("problem1", {"n": 30}, recipe="superlu")
    problem = first.problem
    start = {name: np.maximum(field, 1e-6) for name, field in first.fields.items()}
    method = din.DIN(Job(problem, Stages(), "reduced", start=start))
    assert np.array_equal(method.p, start["p"]) and method.p is not start["p"]
    assert method.norm < 1e-3
    method.destroy()


def test_a_start_that_overflows_is_told(run):
    solution = run("problem1", {"n": 5}, p0=1e300)
    assert solution.outcome is Outcome.NOT_FINITE and solution.iterations == 0
    assert not solution.certificate.holds and finite(as_dict(solution))["c1"] is None


def test_nan_in_a_step_is_told(run, monkeypatch):
    """A direction with a NaN ends the run as not_finite: no answer is made of it."""
    from lcp_lube.linear.full import FullSystem

    honest = FullSystem.solve

    def spoiled(self, *arguments):
        dp, dr, iterations = honest(self, *arguments)
        dp[3] = np.nan
        return dp, dr, iterations

    monkeypatch.setattr(FullSystem, "solve", spoiled)
    solution = run("problem1", {"n": 8}, conditions="F")
    assert solution.outcome is Outcome.NOT_FINITE and solution.iterations == 1
    assert not solution.certificate.holds and "nan" in solution.certificate.failure
    assert run("problem1", {"n": 8}).outcome is Outcome.STEP_LENGTH  # conditions C and B refuse it for every alpha
