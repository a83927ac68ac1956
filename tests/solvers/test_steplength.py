"""The step-length rules, each alone."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from mpi4py import MPI

from lcp_lube.base.parallel import Reduce
from lcp_lube.solvers.steplength import (
    MAX_HALVINGS,
    Centrality,
    StepLengthError,
    feasible,
    halve_until,
    inexact_decrease,
    reduction,
)

reduce = Reduce(MPI.COMM_SELF)
sizes = st.integers(1, 20)
positive = st.floats(1e-12, 1e6)


@st.composite
def points_and_directions(draw):
    n = draw(sizes)
    x = draw(arrays(float, n, elements=st.one_of(st.just(0.0), positive)))
    return x, draw(arrays(float, n, elements=st.floats(-1e6, 1e6).filter(lambda d: d == 0 or abs(d) > 1e-9)))


@given(points_and_directions(), points_and_directions())
def test_feasible_stays_inside_and_is_the_largest(first, second):
    alpha = feasible(reduce, first, second)
    assert 0 <= alpha <= 1
    for x, dx in (first, second):
        assert (x + alpha * dx >= -4e-16 * np.abs(alpha * dx)).all()  # zero up to rounding
    if alpha < 1:  # the next larger step leaves
        assert any((x + alpha * (1 + 1e-9) * dx < 0).any() or (x[dx < 0] == 0).any() for x, dx in (first, second))


@pytest.mark.parametrize(
    "x, dx, alpha", [([1.0, 2.0], [-4.0, -4.0], 0.25), ([1.0], [3.0], 1.0), ([0.0], [-1.0], 0.0), ([-1e-25], [-1.0], 0.0)]
)
def test_feasible_by_hand(x, dx, alpha):
    assert feasible(reduce, (np.array(x), np.array(dx))) == alpha
    assert feasible(reduce, (np.array([5.0]), np.array([-1.0])), (np.array(x), np.array(dx))) == alpha


@given(st.floats(0, 1), st.floats(0, 1e6))
def test_reduction(alpha, gap):
    """alpha max(0.8, 1 - 100 p'r) of a full step, at most 0.9995 alpha of a shorter one."""
    reduced = reduction(alpha, gap)
    assert 0.8 * alpha <= reduced <= alpha
    if alpha < 1:
        assert reduced <= 0.9995 * alpha
    else:
        assert reduced == max(0.8, 1 - 100 * gap)


@pytest.mark.parametrize("gap, alpha, expected", [(0.0, 1.0, 1.0), (0.0, 0.5, 0.49975), (1e-3, 1.0, 0.9), (1.0, 0.5, 0.4)])
def test_reduction_by_hand(gap, alpha, expected):
    assert reduction(alpha, gap) == pytest.approx(expected, rel=1e-14)


@given(st.floats(1e-3, 1), st.floats(0.1, 0.9), st.integers(0, 30))
def test_halve_until(alpha, theta, cuts):
    """The first accepted of alpha, theta alpha, theta^2 alpha, ..., and how many cuts that took."""
    tried = []

    def accept(a):
        tried.append(a)
        return len(tried) > cuts

    reached, counted = halve_until(accept, alpha, theta)
    assert counted == cuts
    assert reached == tried[-1] == pytest.approx(alpha * theta**cuts, rel=1e-12)


def test_halve_until_gives_up():
    with pytest.raises(StepLengthError, match="alpha fell to"):
        halve_until(lambda alpha: False, 1.0)
    assert halve_until(lambda alpha: alpha < 0.5 ** (MAX_HALVINGS - 2), 1.0)[1] == MAX_HALVINGS - 1


@given(arrays(float, sizes, elements=positive), positive)
def test_centrality_holds_at_the_start(products, norm_F1):
    central = Centrality(reduce, products, products.size, norm_F1)
    assert 0 <= central.tau1 <= 0.99
    assert central.holds(products, norm_F1)


def test_centrality_by_hand():
    """phi = min p r - tau1 gamma p'r/n and psi = p'r - tau2 gamma ||F1||, tau from the start (30)."""
    start = np.array([0.1, 0.3])
    central = Centrality(reduce, start, 2, norm_F1=4.0, gamma=0.5)
    assert central.tau1 == pytest.approx(0.5e-7 * 0.1 / 0.2)
    assert central.tau2 == pytest.approx(1e-7 * 0.4 / 4)
    least = central.tau1 * 0.5 / 2  # of min/sum, where phi = 0; sum is about 1
    assert central.holds(np.array([1.01 * least, 1.0]), 0.0)
    assert not central.holds(np.array([0.99 * least, 1.0]), 0.0)
    most = 2e-6 / (central.tau2 * 0.5)  # of ||F1||, where psi = 0 for p'r = 2e-6
    assert central.holds(np.array([1e-6, 1e-6]), 0.99 * most)
    assert not central.holds(np.array([1e-6, 1e-6]), 1.01 * most)


@pytest.mark.parametrize("products", [[-1e-3, 1.0], [0.0, 1.0], [np.nan, 1.0]])
def test_centrality_refuses_points_on_the_boundary_or_beyond(products):
    assert not Centrality(reduce, np.array([0.1, 0.1]), 2, 1.0).holds(np.array(products), 1.0)


@given(positive, st.floats(1e-6, 1), st.floats(0, 1), st.floats(1e-6, 0.9))
def test_inexact_decrease(norm, alpha, forcing, beta):
    bound = (1 - beta * alpha * (1 - forcing)) * norm
    assert inexact_decrease(norm, bound, alpha, forcing, beta)
    assert inexact_decrease(norm, 0.0, alpha, forcing, beta)
    assert not inexact_decrease(norm, bound * (1 + 1e-12) + 1e-300, alpha, forcing, beta)
    assert not inexact_decrease(norm, np.nan, alpha, forcing, beta)
