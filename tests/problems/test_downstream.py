"""The order of cells along a flow, and what it makes of a film's heat."""

import numpy as np
import pytest

from lcp_lube import load_scene, solve
from lcp_lube.drivers.derivatives.gradient import film_fields
from lcp_lube.problems.film import transport
from lcp_lube.problems.film.downstream import downstream

OIL = {
    "T_in": 323.0,
    "law": "exponential",
    "T": [323.0, 353.0],
    "mu": [0.019, 0.0077],
    "rho": 855.0,
    "specific_heat": 1950.0,
}


def csr_of(dense, kept):
    """CSR arrays with the entries that are kept, zeros among them."""
    rows, columns = np.nonzero(kept)
    pointers = np.searchsorted(rows, np.arange(dense.shape[0] + 1)).astype(np.int32)
    return pointers, columns.astype(np.int32), dense[rows, columns]


@pytest.mark.parametrize("n", [1, 2, 7, 60])
def test_each_row_comes_after_those_that_it_takes_from(n):
    rng = np.random.default_rng(n)
    lower = np.tril(rng.random((n, n)) < 0.2, -1) * -1.0 + np.eye(n)
    mixed = rng.permutation(n)
    dense = lower[np.ix_(mixed, mixed)]
    order = downstream(*csr_of(dense, (dense != 0) | (dense != 0).T), 0)
    assert sorted(order) == list(range(n))
    assert not np.triu(dense[np.ix_(order, order)], 1).any()


def test_a_ring_is_cut_where_it_is_said():
    n = 9
    dense = np.eye(n) - np.roll(np.eye(n), 1, axis=0)  # each takes from the one before, the first from the last
    arrays = csr_of(dense, (dense != 0) | (dense != 0).T)
    assert downstream(*arrays, n - 1).tolist() == list(range(n))
    assert sorted(downstream(*arrays, 0)) == list(range(n))  # anywhere, if nobody says


@pytest.mark.parametrize(("scene", "keys"), [("journal", {"nx": 61, "ny": 15}), ("adiabatic_journal", {"nx": 90, "ny": 11})])
def test_heat_is_carried_in_one_step(monkeypatch, carried, scene, keys):
    """In the order of the grid it takes 6 to 9, and more on finer ones; the temperatures are the same."""
    found = []
    for ordered in (1, 10**9):
        monkeypatch.setattr(transport, "ORDERED", ordered)
        carried.clear()
        more = {} if scene == "adiabatic_journal" else {"temperature": OIL}
        with solve(load_scene(scene, keys | more)) as solution:
            assert solution.converged
            found.append(solution.numbers)
        steps = [one for one, _ in carried]
        assert max(steps) <= 2 if ordered == 1 else max(steps) > 4
    for name in ("temperature_max", "load", "friction"):
        assert found[0][name] == pytest.approx(found[1][name], rel=1e-8)


@pytest.mark.parametrize(("scene", "keys"), [("journal", {"nx": 41, "ny": 9, "temperature": OIL}), ("lined_pad", {"n": 40})])
def test_derivatives_go_up_the_flow(monkeypatch, carried, scene, keys):
    """By the film at every point, with the transposed equations in that order: the same."""
    found, names = [], ["temperature_max", "load"]
    film = load_scene(scene, keys)
    for ordered in (1, 10**9):
        monkeypatch.setattr(transport, "ORDERED", ordered)
        with solve(film, stopping={"eps1": 1e-11, "max_it": 200}) as solution:
            found.append(film_fields(film, solution, names))
    assert any(up for _, up in carried)
    for name in names:
        one, other = (fields[name] for fields in found)
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-6 * np.abs(other).max())
