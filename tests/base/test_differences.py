"""Derivatives by differences: what rounding hides is found by larger steps, and the error that is told holds the true one."""

import numpy as np

from lcp_lube.base.differences import differences

NOISE = 3e-12


def rough(f, seed=3):
    """f with rounding drawn anew for every value."""
    rng = np.random.default_rng(seed)
    return lambda a: f(a) + NOISE * rng.standard_normal(np.shape(f(a)))


def test_small_slopes_of_what_is_linear_are_found_by_large_steps():
    f = rough(lambda a: np.array([1.0 + 1e-6 * a, 2.0 + a]))
    slope, kink, error = differences(f, 1.0, 1.0, np.array([1e4, 1e4]))
    assert abs(slope[0] - 1e-6) < error[0] < 1e-8
    assert abs(slope[1] - 1.0) < error[1] < 1e-6
    assert not kink.any()


def test_what_bends_holds_its_error():
    """Rounding is seen by one sample: of 60 few errors are larger than they are told, and none by much."""
    exceeded = 0
    for seed in range(20):
        f = rough(lambda a: np.array([a**-3, np.exp(3.0 * a), 1e-3 * np.sin(a)]), seed)
        slope, _, error = differences(f, 1.0, 1.0, np.full(3, 1e5))
        off = np.abs(slope - [-3.0, 3.0 * np.exp(3.0), 1e-3 * np.cos(1.0)])
        assert (off <= 10.0 * error).all()
        exceeded += int(np.sum(off > error))
        assert (error <= 1e-6).all()
    assert exceeded <= 3


def test_what_bends_otherwise_to_either_side():
    slope, kink, error = differences(lambda a: np.array([a + 40.0 * (a - 1.0) * abs(a - 1.0)]), 1.0, 1.0, np.ones(1))
    assert abs(slope[0] - 1.0) <= error[0] <= 1e-6
    assert not kink.any()


def test_nothing_is_nothing():
    slope, _, error = differences(rough(lambda a: np.array([5.0 + 0.0 * a])), 1.0, 1.0, np.array([1e5]))
    assert slope[0] == 0.0
    assert 0.0 < error[0] < 1e-7


def test_a_kink_beside_is_not_one_here():
    slope, kink, error = differences(lambda a: np.array([a + np.minimum(a, 1.0 + 6e-7)]), 1.0, 1.0, np.array([1e4]))
    assert abs(slope[0] - 2.0) <= error[0] < 1e-6
    assert not kink.any()
