"""The certificate: from the problem's data alone, it holds for solutions and for nothing else."""

from itertools import product

import numpy as np
import pytest
from films import Wave, make_problem
from hypothesis import given
from hypothesis import strategies as st

from lcp_lube import load_scene, solve
from lcp_lube.problems.certificate import Certificate, certificate_tol
from lcp_lube.problems.film import certify
from lcp_lube.problems.film.cell_loops import loop_misfits
from lcp_lube.problems.film.certify import cell_misfits, misfits, p_error, surely_empty
from lcp_lube.problems.film.flows import friction
from lcp_lube.problems.film.strip import frames


@pytest.fixture(scope="module")
def solution():
    found = solve(load_scene("problem2", {"n": 60}), method="active-set", nested=False)
    assert found.converged
    yield found
    found.destroy()


def test_holds_for_the_solution(solution):
    certificate = solution.certificate
    assert certificate.holds and certificate.failure == ""
    assert set(certificate.measures) == {"residual", "complementarity", "mass_defect"}
    assert max(certificate.measures.values()) < 1e-10
    assert certificate.extremes["min_p"] == pytest.approx(0, abs=1e-3)  # Pa
    assert certificate.extremes["min_r"] == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize(
    "spoil, broken",
    [
        (lambda p, r: (p * 1.01, r), "residual"),
        (lambda p, r: (p, r * 1.1), "residual"),
        (lambda p, r: (p - 0.1, r), "complementarity"),
        (lambda p, r: (p, r - 0.01), "complementarity"),
        (lambda p, r: (p + 0.1, r + 0.1), "complementarity"),
        (lambda p, r: (np.append(p[:-1], p[-1] + 0.5), r), "mass_defect"),
        (lambda p, r: (0 * p, 0 * r), "residual"),
        (lambda p, r: (np.where(p == p.max(), np.nan, p), r), "complementarity"),
        (lambda p, r: (p, np.where(r == r.max(), np.nan, r)), "complementarity"),
        (lambda p, r: (p, np.where(r == r.max(), np.inf, r)), "residual"),
        (lambda p, r: (1e200 * p, r), "residual"),
    ],
)
def test_fails_for_what_is_no_solution(solution, spoil, broken):
    p, r = spoil(solution.fields["p"].copy(), solution.fields["r"].copy())
    with np.errstate(all="ignore"):
        certificate = solution.problem.certify({"p": p, "r": r}, 1e-8)
    assert not certificate.holds and broken in certificate.failure


@given(st.integers(0, 59), st.floats(1e-3, 1e3))
def test_fails_for_one_wrong_point(solution, k, size):
    """A single pressure moved by a thousandth of the largest is seen."""
    p = solution.fields["p"].copy()
    p[k] += size * p.max()
    assert not solution.problem.certify({"p": p, "r": solution.fields["r"]}, 1e-8).holds


def test_does_not_depend_on_units():
    """The same fields in another pressure unit: the same measures."""
    film = Wave("sinusoid", "convergent-divergent", 15e-6, 25e-6, 0, 0.1)
    random = np.random.default_rng(0)
    p, r = random.uniform(0, 5, 20), random.uniform(0, 0.5, 20)
    measures = []
    for unit in (1e6, 1e3):
        problem = make_problem((20,), film, p_sides=(1e6, 2e5, 0, 0), p_unit=unit)
        measures.append(problem.certify({"p": p * 1e6 / unit, "r": r}, 1e-8).measures)
        problem.destroy()
    assert measures[0] == pytest.approx(measures[1], rel=1e-9)


def test_tolerance_follows_eps1_by_one_rule():
    assert certificate_tol(1e-8) == pytest.approx(1e-4)
    assert certificate_tol(1e-4) == pytest.approx(1e-2)
    assert certificate_tol(0.5) == 1e-2  # nobody would call more a solution
    assert certificate_tol(1e-30) == 1e-7  # rounding


def test_failure_names_what_is_broken():
    certificate = Certificate({"residual": 1.0, "complementarity": 1e-9, "mass_defect": float("nan")}, 1e-4)
    assert certificate.failure == "residual 1.00e+00 > 1.0e-04, mass_defect nan > 1.0e-04"
    assert Certificate({}, 1e-4).holds


FED = {
    "family": "bearing",
    "L": 0.01,
    "n": 24,
    "fluid": {"mu": 0.01},
    "film": {"shape": "linear", "h_start": 3e-6, "h_end": 1e-6},
}
RING = {"shape": "journal", "c": 5e-6, "eccentricity": 0.6}
NEXT_TO_NOTHING_FLOWS = {
    "closed at the east": {"U": 1.0, "sides": {"west": 2e5, "east": "closed"}},
    "closed at the west": {"U": -1.0, "sides": {"west": "closed", "east": 2e5}},
    "closed, slow": {"U": 1e-10, "sides": {"west": 2e5, "east": "closed"}},
    "closed, deep pocket": {
        "U": 1.0,
        "film": [FED["film"], {"shape": "pocket", "depth": 1e-3, "x": [0.003, 0.007]}],
        "sides": {"west": 2e5, "east": "closed"},
    },
    "ring": {
        "U": 1.0,
        "dimension": 2,
        "n": 9,
        "film": RING,
        "sides": {"west": "periodic", "east": "periodic", "south": 3e5, "north": "closed"},
    },
}
SPOILT = {
    "scaled": lambda a: a * 1.01,
    "shifted": lambda a: a + 0.01 * np.abs(a).max(),
    "negative": lambda a: -a,
    "zero": lambda a: 0.0 * a,
    "one point": lambda a: np.where(np.arange(a.size) == np.argmax(a), 0.9 * a, a),
    "turned round": lambda a: np.roll(a, a.size // 3),
    "NaN": lambda a: np.where(np.arange(a.size) == a.size // 2, np.nan, a),
}


@pytest.mark.parametrize("name", NEXT_TO_NOTHING_FLOWS)
def test_where_next_to_nothing_flows_through(name):
    """A mass defect knows its own rounding; what is no solution still breaks the certificate."""
    found = solve(load_scene({**FED, **NEXT_TO_NOTHING_FLOWS[name]}), method="active-set")
    assert found.converged, found.message
    p, r = found.fields["p"], found.fields["r"]
    for damage, spoil in SPOILT.items():
        if name == "closed, slow" and damage == "turned round":
            continue  # p is the side's everywhere, to 1e-9
        with np.errstate(all="ignore"):
            assert not found.problem.certify({"p": spoil(p), "r": r}, 1e-8).holds, damage
    assert not found.problem.certify({"p": p, "r": r + 0.01}, 1e-8).holds
    found.destroy()


EMPTY = {"shape": "linear", "h_start": 1e-6, "h_end": 3e-6}
STARVED = [EMPTY, {"shape": "pocket", "depth": 1e-6, "x": [0.003, 0.006]}]  # narrower behind it, but not than where it begins


@pytest.mark.parametrize("dimension", [1, 2])
@pytest.mark.parametrize(
    "film, surely", [(EMPTY, True), (STARVED, True), ({**EMPTY, "h_end": 1e-6}, False), (FED["film"], False)]
)
def test_films_that_are_surely_empty(film, surely, dimension, monkeypatch):
    """Their voids say that there is no pressure: no factorisation is asked, which says the same."""
    size = {"dimension": 2, "n": 9, "sides": {"west": 0.0, "east": 0.0, "south": 0.0, "north": 0.0}} if dimension == 2 else {}
    found = solve(load_scene({**FED, "U": 1.0, "film": film, "sides": {"west": 0.0, "east": 0.0}, **size}), method="active-set")
    problem, p, r = found.problem, found.fields["p"], found.fields["r"]
    assert found.converged and surely_empty(problem, p, r) == surely
    assert not surely_empty(problem, p + 1e-12, r) and not surely_empty(problem, 0.0 * p, np.roll(r, 1) + 0.01)
    if surely:
        assert p_error(problem, p, r) == 0.0
        monkeypatch.setattr(certify, "surely_empty", lambda *_: False)
        assert p_error(problem, p, r) == 0.0
    found.destroy()


def one_by_one(p, r, k_W, k_E, k_S, k_N, b_C, b_W, c, held, p_max, above):
    """`certify.cell_misfits` cell by cell."""
    ny, nx = c.shape
    sums, worst, gap = np.zeros(6), 0.0, 0.0
    for j in range(ny):
        for i in range(nx):
            here, west, east, south, north = p[j + 1, i + 1], p[j + 1, i], p[j + 1, i + 2], p[j, i + 1], p[j + 2, i + 1]
            w, e, s, n = k_W[j, i], k_E[j, i], k_S[j, i], k_N[j, i]
            if held.size and held[j, i]:
                west = east = south = north = 0.0
            x, y = w * (here - west) + e * (here - east), s * (here - south) + n * (here - north)
            own, entering = b_C[j, i] * r[j + 1, i + 1], b_W[j, i] * r[j + 1, i]
            a, b, k = x + y, own + entering, w + e + s + n
            left = a + b - c[j, i]
            sums += a * a, b * b, left * left, (k * here) ** 2, b_C[j, i] ** 2, k * (abs(here) + above)
            terms = k * abs(here) + w * abs(west) + e * abs(east) + s * abs(south) + n * abs(north)
            excess = abs(left) - 8 * 2.0**-53 * (terms + abs(b_C[j, i]) + abs(b_W[j, i]) + abs(c[j, i]))
            if excess > 0.0:
                moved = k * p_max if p_max > 0.0 else -b_C[j, i]  # all void: there is no other measure
                if here < r[j + 1, i + 1] * p_max:
                    moved = min(moved, -b_C[j, i])
                worst = max(worst, excess / moved if moved > 0.0 else np.inf)
            gap = max(gap, abs(min(here / (p_max or 1.0), r[j + 1, i + 1] / min(max(-k * p_max / b_C[j, i], 1e-200), 1.0))))
    return [*sums, worst, gap]


def by_loops(p, r, k_W, k_E, k_S, k_N, b_C, b_W, c, held, p_max, above):
    """`cell_loops.loop_misfits`, by a line and some columns at a time, of conductances of cells that have the same faces."""
    kx, ky, framed = frames(k_W, k_E, k_S, k_N, c)
    carried = [
        lambda j, b=b, at=at: (2.0 * b[j : j + 1], 0, np.full(1, 0.5), b[j : j + 1, at]) for b, at in ((b_C, -1), (b_W, 0))
    ]
    found = [
        loop_misfits(p[j : j + 3], r[j : j + 3], kx, ky, *(one(j) for one in carried), framed, p_max, above, j, *columns)
        for j in range(len(c))
        for columns in ((0, 4), (4, 10))
    ]
    sums, most, least = (np.array(part) for part in zip(*found, strict=True))
    return sums.sum(axis=0), most.max(axis=0), least.min()


@pytest.mark.parametrize("look", [cell_misfits, by_loops])
def test_arrays_and_loops_measure_what_each_cell_does(look):
    random = np.random.default_rng(3)
    p, r = random.uniform(0, 1e3, (2, 9, 12))
    r[r < 500] = 0.0
    kx, ky = random.uniform(1e-3, 1, (7, 11)), random.uniform(1e-3, 1, (8, 10))
    scheme = (kx[:, :-1], kx[:, 1:], ky[:-1], ky[1:])
    carried, c = -random.uniform(0, 1, (2, 7, 10)), random.uniform(-1, 1, (7, 10))
    masks = (np.zeros((0, 0), dtype=bool), random.uniform(0, 1, (7, 10)) < 0.2)
    for p_max, above, held in product((1e3, 1e-3, 0.0), (0.0, 1.0), masks if look is cell_misfits else masks[:1]):
        cells = one_by_one(p, r, *scheme, *carried, c, held, p_max, above)
        *found, least = look(p, r, *scheme, *carried, c, held, p_max, above)
        np.testing.assert_allclose(np.concatenate(found), cells, rtol=1e-10)
        assert least == -carried[0].max()
        assert min(cells[-2:]) > 0
    for field in (p, r):
        field[4, 5] = np.nan
        sums, (_, gap), _ = look(p, r, *scheme, *carried, c, masks[0], 1e3, 0.0)
        assert np.isnan(sums[2]) and np.isnan(gap)
        field[4, 5] = 0.0


@pytest.mark.parametrize(
    "name, keys",
    [
        ("journal", {}),
        ("problem4", {"p_a": 2e5, "scheme": "upwind"}),
        ("textured_slider", {"K": 3}),
        ("pocketed_pad_2d", {}),
        ("step_thrust", {}),
    ],
)
def test_large_films_are_read_by_loops(name, keys):
    """One film's misfits and friction, by arrays and by loops."""
    found = solve(load_scene(name, {"nx": 40, "ny": 21, **keys}), method="active-set", nested=False)
    problem, p, r = found.problem, found.fields["p"] * 1.001, found.fields["r"]
    levers = [1.0] if problem.grid.polar is None else [1.0, problem.grid.polar[0] + problem.grid.y]

    def read():
        return [*misfits(problem, p, r, 2.0, 1.0), *(friction(problem, p * problem.p_unit, r, lever) for lever in levers)]

    by_arrays = read()
    problem.many = 1
    np.testing.assert_allclose(read(), by_arrays, rtol=1e-11)
    found.destroy()


def test_blocks_of_cells_measure_what_all_together_do(solution, monkeypatch):
    p, r = solution.fields["p"] * 1.01, solution.fields["r"]
    whole = misfits(solution.problem, p, r, 2.0)
    monkeypatch.setattr("lcp_lube.problems.film.certify.BLOCK", 7)
    np.testing.assert_allclose(misfits(solution.problem, p, r, 2.0), whole, rtol=1e-12)
    film = make_problem((9, 8), Wave("sinusoid", "convergent-divergent", 15e-6, 25e-6, 0, 0.1))
    p, r = np.random.default_rng(1).uniform(0, 1, (2, 72))
    blocks = misfits(film, p, r, 1.0)
    monkeypatch.undo()
    np.testing.assert_allclose(blocks, misfits(film, p, r, 1.0), rtol=1e-12)
    film.destroy()


def test_void_counts_as_the_flow_that_pressures_drive():
    """Beside pressures that push next to nothing, a void of 1e-9 may be all that they drive; none counts below itself."""
    problem = make_problem((20,), Wave("sinusoid", "convergent-divergent", 15e-6, 25e-6, 0, 0.1), p_sides=(1e6, 2e5, 0, 0))
    p, r = np.full(20, 1e10), np.full(20, 1e-9)
    weak = misfits(problem, p, r, 1e-9).gap
    assert weak > 1e-6 and misfits(problem, p, r, 1e9).gap == 1e-9
    assert misfits(problem, p, r, 2e-9).gap == pytest.approx(0.5 * weak)
    problem.destroy()
