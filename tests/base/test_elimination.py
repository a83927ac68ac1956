"""Elimination without subtraction: every entry right to nearly all digits, whatever the ratio of the entries."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lcp_lube.base.elimination import Elimination


def graded(seed: int, n: int, b: int, decades: float) -> tuple[np.ndarray, np.ndarray]:
    """What unknowns hand to others within a band, and what they lose."""
    rng = np.random.default_rng(seed)
    handed = np.zeros((n, 2 * b + 1))
    for j in range(n):
        for i in range(max(0, j - b), min(n, j + b + 1)):
            if i != j and rng.random() < 0.8:
                handed[j, i - j + b] = 10 ** rng.uniform(-decades, 0)
        handed[j, (1 if j + 1 < n else -1) + b] = 10 ** rng.uniform(-decades, 0)
    loss = np.where(rng.random(n) < 0.3, 10 ** rng.uniform(-decades, 0, n), 0.0)
    loss[-1] = 10 ** rng.uniform(-decades, 0)
    return handed, loss


def exact_solution(handed: np.ndarray, loss: np.ndarray, f: np.ndarray) -> np.ndarray:
    n, b = len(loss), handed.shape[1] // 2
    M = [[Fraction(0)] * n for _ in range(n)]
    for j in range(n):
        M[j][j] += Fraction(float(loss[j]))
        for i in range(max(0, j - b), min(n, j + b + 1)):
            w = Fraction(float(handed[j, i - j + b]))
            M[i][j] -= w
            M[j][j] += w
    x = [Fraction(float(v)) for v in f]
    for k in range(n):
        for i in range(k + 1, n):
            factor = M[i][k] / M[k][k]
            if factor:
                for j in range(k, n):
                    M[i][j] -= factor * M[k][j]
                x[i] -= factor * x[k]
    for k in reversed(range(n)):
        x[k] = (x[k] - sum((M[k][j] * x[j] for j in range(k + 1, n)), Fraction(0))) / M[k][k]
    return np.array([float(v) for v in x])


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6), n=st.integers(2, 12), b=st.integers(1, 4), decades=st.sampled_from([1.0, 8.0, 30.0]))
def test_every_entry_of_the_inverse(seed, n, b, decades):
    handed, loss = graded(seed, n, b, decades)
    f = np.random.default_rng(seed).uniform(0, 1, n)
    found = Elimination(handed.copy(), loss.copy()).solve(f)
    np.testing.assert_allclose(found, exact_solution(handed, loss, f), rtol=1e-13)


def test_two_cells_that_lose_next_to_nothing():
    """w between two cells, loss 1e-25 of it: an LU of the entries is singular."""
    handed, loss = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]), np.array([0.0, 1e-25])
    factors = Elimination(handed.copy(), loss.copy())
    assert factors.singular == -1
    np.testing.assert_allclose(factors.solve(np.array([1e-25, 0.0])), [1.0, 1.0], rtol=1e-14)


@pytest.mark.parametrize("closed", [0, 1])
def test_a_group_without_a_way_out_is_told(closed):
    handed = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    loss = np.array([0.0, 0.0, 1.0]) if closed else np.array([0.0, 1.0, 1.0])
    assert (Elimination(handed, loss).singular >= 0) == bool(closed)
