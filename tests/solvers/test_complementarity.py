"""Problems of the user's own and the semismooth method: kinds of J, fixed and free unknowns, hard starts, bad input, ranks."""

import json

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from mpi4py import MPI
from mpi_complementarity import solve_string
from petsc4py import PETSc

from lcp_lube import Complementarity, InputError, solve
from lcp_lube.solvers.semismooth import fischer

M = np.array([[4.0, -1.0, 0.0], [-1.0, 4.0, 0.0], [0.0, -1.0, 4.0]])
Q = np.array([-1.0, 2.0, -3.0])


def linear(J, lower=(0.0, 0.0, 0.0), upper=(np.inf,) * 3, x0=(1.0, 1.0, 1.0)):
    return Complementarity(lambda x: M @ x + Q, J, lower, upper, x0)


@pytest.mark.parametrize(
    "J",
    [
        lambda x: M,
        lambda x: M.tolist(),
        lambda x: sp.csr_array(M),
        lambda x: sp.coo_matrix(M),
        lambda x: PETSc.Mat().createAIJ((3, 3), csr=([0, 2, 4, 6], [0, 1, 0, 1, 1, 2], M[M != 0]), comm=PETSc.COMM_SELF),
        lambda x: PETSc.Mat().createDense((3, 3), array=M.copy(), comm=PETSc.COMM_SELF),
    ],
    ids=["array", "list", "csr", "coo", "aij", "dense"],
)
@pytest.mark.parametrize("method", ["semismooth", "interior", "active-set"])
def test_jacobians(J, method):
    """All kinds of matrices, all methods: x_2 at its bound, the others from two equations."""
    solution = solve(linear(J), method=method)
    assert solution.converged
    assert solution.fields["v"] == pytest.approx([0.25, 0.0, 0.75], abs=1e-8)
    solution.destroy()


def test_free_and_fixed_unknowns():
    """Infinite bounds make an equation, equal ones a given value; with F = 0 for all of it, a linear system."""
    free = solve(linear(lambda x: M, (-np.inf,) * 3))
    assert free.fields["v"] == pytest.approx(np.linalg.solve(M, -Q), abs=1e-10)
    fixed = solve(linear(lambda x: sp.csr_array(M), (-np.inf, 0.5, -np.inf), (np.inf, 0.5, np.inf)))
    assert fixed.converged and fixed.fields["v"] == pytest.approx([0.375, 0.5, 0.875], abs=1e-10)
    boxed = solve(linear(lambda x: M, (0.0,) * 3, (0.1, 1.0, 0.2)))
    assert boxed.fields["v"] == pytest.approx([0.1, 0.0, 0.2], abs=1e-10)


def test_singular_start():
    """F' and the gradient vanish at the start: only a proximal step leaves it."""
    problem = Complementarity(lambda x: x**2 - 1.0, lambda x: np.diag(2.0 * x), [-np.inf], [np.inf], [0.0])
    solution = solve(problem)
    assert solution.converged and abs(solution.fields["v"][0]) == pytest.approx(1.0)
    assert any(step.sigma > 0 for step in solution.steps)  # rho


def test_no_solution():
    """x^2 + 1 = 0 has none, and no method says that it has."""
    problem = Complementarity(lambda x: x**2 + 1.0, lambda x: np.diag(2.0 * x), [-np.inf], [np.inf], [0.5])
    for method in ("semismooth", "interior", "active-set"):
        solution = solve(problem, method=method, stopping={"max_it": 150})
        assert not solution.converged


@settings(max_examples=40, deadline=None)
@given(st.integers(1, 12), st.integers(0, 10**6))
def test_random_monotone_problems(n, seed):
    """Bounds of every kind, a monotone F: the natural residual of the answer is small, and the answers of two methods agree."""
    rng = np.random.default_rng(seed)
    skew = rng.normal(size=(n, n))
    A = skew - skew.T + np.diag(rng.uniform(0.5, 2.0, n))
    b = rng.normal(size=n)
    lower = np.where(rng.random(n) < 0.6, rng.uniform(-1, 0, n), -np.inf)
    upper = np.where(rng.random(n) < 0.4, rng.uniform(0, 1, n), np.inf)
    fixed = rng.random(n) < 0.1
    lower[fixed] = upper[fixed] = 0.3
    problem = Complementarity(
        lambda x: A @ x + b + 0.1 * x**3, lambda x: A + np.diag(0.3 * x**2), lower, upper, rng.normal(size=n)
    )
    answers = []
    for method in ("semismooth", "interior"):
        solution = solve(problem, method=method, stopping={"eps1": 1e-11})
        x = solution.fields["v"]
        assert solution.converged, solution.message
        assert np.max(np.abs(np.clip(A @ x + b + 0.1 * x**3, x - upper, x - lower))) <= 1e-5
        answers.append(x)
        solution.destroy()
    assert np.allclose(*answers, atol=1e-4)


@settings(max_examples=200, deadline=None)
@given(st.floats(-1e8, 1e8), st.floats(-1e8, 1e8))
def test_fischer_burmeister(a, b):
    """phi has the sign of min(a, b) and lies within a factor 2 + sqrt(2) of it, without cancellation."""
    phi, by_a, by_b = (float(value) for value in fischer(np.array(a), np.array(b)))
    least = min(a, b)
    assert np.sign(phi) == np.sign(least) or abs(least) < 1e-300
    assert 0.58 * abs(least) <= abs(phi) * (1 + 1e-12) and abs(phi) <= 3.4143 * abs(least)
    assert 0 <= by_a <= 2 and 0 <= by_b <= 2 and by_a + by_b >= 2 - np.sqrt(2) - 1e-12


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"lower": [0.0, 0.0]}, r"\[2, 3, 3\] entries"),
        ({"lower": [], "upper": [], "x0": []}, "at least 1"),
        ({"lower": [2.0, 0.0, 0.0], "upper": [1.0, 1.0, 1.0]}, "infeasible box"),
        ({"lower": [np.nan, 0.0, 0.0]}, "no number"),
        ({"x0": ["a", "b", "c"]}, "x0: a sequence of real numbers"),
        ({"x0": [[1.0, 1.0, 1.0]]}, r"x0 has shape \(1, 3\)"),
        ({"x0": [np.inf, 1.0, 1.0]}, "no finite value"),
        ({"F": lambda x: x[:2]}, "2 entries, x has 3"),
        ({"F": lambda x: x + 1j}, "real numbers"),
        ({"J": lambda x: M[:2]}, r"shape \(2, 3\)"),
        ({"J": lambda x: sp.csr_array(M[:2])}, r"shape \(2, 3\)"),
        ({"n": 4}, "3 entries on rank 0, which owns 4 of 4"),
    ],
)
def test_bad_input(arguments, words):
    given = {"F": lambda x: M @ x + Q, "J": lambda x: M, "lower": [0.0] * 3, "upper": [np.inf] * 3, "x0": [1.0] * 3}
    with pytest.raises(InputError, match=words):
        solve(Complementarity(**{**given, **arguments}))


def test_pattern_that_changes():
    """A sparse J that drops its zeros is refused in words."""
    patterns = iter([np.eye(3), np.eye(3)])
    with pytest.raises(InputError, match="entries where the first one had none"):
        solve(linear(lambda x: sp.csr_array(next(patterns, M))))


@pytest.mark.parametrize("ranks", [2, 3])
def test_ranks(script, ranks):
    """Distributed callbacks with a PETSc matrix: the same steps and answer as on one rank, by every method."""
    job = script("mpi_complementarity.py", 41, ranks=ranks)
    assert job.status == 0, job.err
    for method, record in json.loads(job.out).items():
        alone = solve_string(method, 41, MPI.COMM_SELF)
        assert record["outcome"] == "converged" and record["first"] == pytest.approx(-0.01, abs=1e-12)
        assert record["iterations"] == alone["iterations"] and record["contact_lower"] == 34
        assert record["sum"] == pytest.approx(alone["sum"], rel=1e-10)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"rtol": 1.0}, "semismooth.rtol"),
        ({"patience": 0}, "at least 1"),
        ({"rise": 1.0}, "above 1"),
        ({"rho": 1.0}, "no such option"),
    ],
)
def test_bad_options(options, words):
    with pytest.raises(InputError, match=words):
        solve(linear(lambda x: M), options=options)
