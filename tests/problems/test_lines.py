"""Grid lines on a film's edges: where they lie, what the discrete problem on them keeps, and the order that they restore."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcp_lube import load_scene, solve
from lcp_lube.problems.film.edges import Around
from lcp_lube.problems.film.lines import UNEVEN, on_edges
from lcp_lube.problems.film.lubrication import LubricationProblem
from lcp_lube.problems.film.reynolds import coefficients
from lcp_lube.problems.grid import OFFSET, Grid
from lcp_lube.problems.transfer import Transfer, interpolated

OPEN, RING = ("open", "open"), ("periodic", "periodic")
KINDS = [OPEN, ("open", "closed"), ("closed", "closed"), ("open", "mirror"), RING]


@given(
    st.integers(3, 200),
    st.lists(st.floats(0.0, 1.0), min_size=1, max_size=12),
    st.sampled_from(KINDS),
)
def test_a_point_on_every_edge(n, edges, ends):
    """n points in ascending order, one on each edge, evenly spaced in between."""
    length = 0.01
    lines = on_edges(n, length, ends, [length * edge for edge in edges])
    if lines is None:
        return
    assert lines.size == n and (np.diff(lines) > 0).all() and lines[0] >= 0 and lines[-1] <= length
    inside = np.array([length * edge for edge in edges if 1e-8 < edge < 1 - 1e-8])
    if inside.size:
        assert np.abs(lines[:, None] - inside).min(axis=0).max() <= 2e-9 * length
    if ends == OPEN:
        around = np.concatenate([[0.0], lines, [length]])
        knots = np.unique(np.concatenate([[0, n + 1], np.searchsorted(around, inside - 1e-10)]))
        for a, b in pairwise(knots):
            steps = np.diff(around[a : b + 1])
            np.testing.assert_allclose(steps, steps.mean(), rtol=1e-6, atol=4e-9 * length)


def test_lines_of_a_symmetric_film_are_symmetric_and_nest():
    edges = [t for k in range(5) for t in (0.4 + 2 * k, 1.6 + 2 * k)]
    for n in (78, 79, 80, 159, 319):
        lines = on_edges(n, 10.0, OPEN, edges)
        np.testing.assert_allclose(lines, 10.0 - lines[::-1], rtol=0, atol=1e-12)
    coarse, fine = (on_edges(n, 10.0, OPEN, edges) for n in (159, 319))
    np.testing.assert_allclose(fine[1::2], coarse, rtol=0, atol=1e-12)
    steps = np.diff(np.concatenate([[0.0], fine, [10.0]]))
    assert steps.max() <= UNEVEN * 10.0 / 320


def test_no_lines_are_moved_where_edges_lie_on_points_or_are_too_many():
    assert on_edges(9, 1.0, OPEN, [0.2, 0.7]) is None and on_edges(49, 1.0, OPEN, [0.2, 0.5]) is None
    assert on_edges(9, 1.0, OPEN, []) is None and on_edges(9, 1.0, OPEN, [-1.0, 0.0, 1.0, 3.0]) is None
    assert on_edges(3, 1.0, OPEN, [0.11, 0.23, 0.35, 0.47, 0.59]) is None


@pytest.mark.parametrize("ends", KINDS)
def test_grid_of_uneven_lines(ends):
    """Cells fill the line, steps join the points, and a grid of even lines given as places is the even grid."""
    n, length = 6, 2.0
    first, last = (OFFSET[end] for end in ends)
    even = (np.arange(n) + first) * (length / (n + first + last - 1.0))
    plain, given_, moved = (
        Grid((n,), (length,), ends=(ends, OPEN), places=(places, None))
        for places in (None, even, even + 0.02 * np.sin(5 * even) * (even < 1.9))
    )
    for name in ("widths", "steps", "nodes_and_faces"):
        for one, other in zip(getattr(plain, name)(0), getattr(given_, name)(0), strict=True):
            apart = np.abs(np.asarray(one) - other)
            assert np.minimum(apart, np.abs(apart - length)).max() < 1e-12
    np.testing.assert_allclose(plain.rims(0), given_.rims(0))
    strips = sum(0.5 * rim for rim, end in zip(moved.rims(0), ends, strict=True) if end == "open")
    assert (moved.widths(0).sum() + strips) * moved.spacing[0] == pytest.approx(length, rel=1e-12)
    for grid in (plain, given_, moved):
        grid.destroy()


@pytest.mark.parametrize("ends", KINDS)
def test_interpolation_is_exact_for_linear_functions(ends):
    rng = np.random.default_rng(3)
    grids = []
    for n in (9, 20):
        places = np.sort(rng.random(n))
        places[-1] = 1.0 if ends[1] == "mirror" else places[-1]
        grids.append(Grid((n, 3), (1.0, 1.0), ends=(ends, OPEN), places=(places, None)))
    coarse, fine = grids
    transfer = Transfer(coarse, fine)
    found = transfer(np.broadcast_to(coarse.x, coarse.box).ravel()).reshape(fine.box)
    inside = (fine.x[0] >= coarse.x[0, 0]) & (fine.x[0] <= coarse.x[0, -1])
    np.testing.assert_allclose(found[:, inside], np.broadcast_to(fine.x, fine.box)[:, inside], rtol=0, atol=1e-12)
    for obj in (transfer, coarse, fine):
        obj.destroy()


@pytest.mark.parametrize("one, other", [((7, 3), (21, 3)), ((40, 2), (17, 2))])
def test_rings_that_begin_elsewhere_are_compared_place_by_place(one, other):
    """x of a journal's ring begins half a mesh before the first point, which lies on the same edge in every one of them."""
    coarse, fine = (Grid(shape, (1.0, 1.0), ends=(("periodic", "periodic"), OPEN)) for shape in (one, other))
    start = -0.5 * np.array([coarse.spacing[0], fine.spacing[0]])
    shift = start[1] - start[0]
    there = np.cos(2 * np.pi * (np.broadcast_to(coarse.x, coarse.box) + start[0])).ravel()
    here = np.cos(2 * np.pi * (np.broadcast_to(fine.x, fine.box) + start[1])).ravel()
    transfer = Transfer(coarse, fine, ahead=shift)
    found = transfer(there)
    np.testing.assert_allclose(found, interpolated(coarse, fine, there, shift), rtol=0, atol=1e-13)
    np.testing.assert_allclose(found, here, rtol=0, atol=0.5 * (np.pi * coarse.spacing[0]) ** 2 + 1e-12)
    assert found[0] == there[0] and np.abs(interpolated(coarse, fine, there, shift + 1.0) - found).max() < 1e-12
    assert np.abs(interpolated(coarse, fine, there) - here).max() > 2.0 * np.abs(found - here).max()
    for obj in (transfer, coarse, fine):
        obj.destroy()


def pad(n: int, **changes) -> object:
    return load_scene("dimpled_pad", {"nx": n, "ny": n, **changes})


def test_methods_agree_on_uneven_lines():
    """Every method solves the same equations: fields agree, certificates hold, half the width is the whole."""
    scene = load_scene("dimpled_pad", {"nx": 44, "ny": 29, "film.dimples.columns": 2, "film.dimples.rows": 1, "U": 2.0})
    first = solve(scene, method="active-set")
    assert isinstance(first.problem, LubricationProblem) and not first.problem.grid.even
    for how in (
        {},
        {"method": "fas"},
        {"method": "din"},
        {"method": "fbn-a"},
        {"method": "monotone"},
        {"method": "active-set", "nested": True},
    ):
        other = solve(scene, **how)
        assert other.converged and other.certificate.holds, how
        np.testing.assert_allclose(other.fields["p"], first.fields["p"], rtol=0, atol=1e-6 * first.fields["p"].max())
        other.destroy()
    first.destroy()


def test_the_square_dimpled_pad():
    """The load of the 5 x 5 pad of square dimples, 6.1969 N above p_c, to 2 % at 80 points a side and 0.1 % at 160."""
    for n, error in ((80, 2e-2), (160, 1e-3)):
        solution = solve(pad(n))
        assert solution.numbers["pressure_integral"] == pytest.approx(6.1969, rel=error)
        solution.destroy()


@pytest.mark.parametrize("n", [12, 25, 40])
def test_drag_beside_edges_along_the_flow(n):
    """A film that varies across the flow alone, full and without pressure: mu U L times the sum of width over film."""
    film = [{"shape": "constant", "h_um": 2.0}, {"shape": "pocket", "depth_um": 3.0, "x_mm": [-1, 11], "y_mm": [2.3, 6.1]}]
    data = {"family": "bearing", "dimension": 2, "L_mm": 10, "width_mm": 10, "U": 1.0, "n": n}
    solution = solve(load_scene({**data, "fluid": {"mu": 0.02, "p_supply": 1e5}, "film": film}))
    exact = 0.02 * 1.0 * 0.01 * (6.2e-3 / 2e-6 + 3.8e-3 / 5e-6)
    assert solution.numbers["friction"] == pytest.approx(exact, rel=1e-9)
    solution.destroy()


def test_area_and_fronts_of_the_cavity():
    """They lie inside the cells: the area of a journal's cavity is of second order, and counted by points it is of first."""
    areas = []
    for nx, ny in ((90, 19), (180, 39), (360, 79)):
        solution = solve(load_scene("journal", {"nx": nx, "ny": ny}))
        areas.append(solution.numbers["cavitated_area"])
        solution.destroy()
    assert areas[0] == pytest.approx(areas[2], rel=5e-3) and areas[1] == pytest.approx(areas[2], rel=5e-4)


def beside_sides(n, ends, U=1.0, film=(2.0, 6.0)):
    """A wedge whose cavity comes near its sides: pressures west, east, south, north (None: closed)."""
    sides = {name: "closed" if p is None else p for name, p in zip(("west", "east", "south", "north"), ends, strict=True)}
    shape = {"shape": "linear", "h_start_um": film[0], "h_end_um": film[1]}
    data = {"family": "bearing", "dimension": 2, "L_mm": 10, "width_mm": 8, "U": U, "n": n, "fluid": {"mu": 0.02}}
    return solve(load_scene({**data, "film": [shape], "sides": sides}), method="active-set", reduction=False)


@pytest.mark.parametrize("p_east", [1e4, 3e4, 1e5])
def test_fronts_before_a_full_side_lie_inside_the_last_cell(p_east):
    """Between closed sides: on any grid at the same place, and the cavity is shorter by what lies behind it."""
    places = []
    for n in (9, 39):
        with beside_sides(n, (1e5, p_east, None, None)) as found, beside_sides(n, (1e5, 0.0, None, None)) as empty:
            places += found.numbers["reformations"]
            shorter = empty.numbers["cavitated_area"] - found.numbers["cavitated_area"]
            assert shorter == pytest.approx((0.01 - places[-1]) * 0.008, rel=1e-6)
    assert 0.01 - places[0] == pytest.approx(0.01 - places[1], rel=5e-3) and places[1] < 0.01


def test_mirrored_films_have_the_same_area():
    areas = []
    for ends, more in (
        ((2e5, 1e5, 1e4, 1e3), {}),
        ((2e5, 1e5, 1e3, 1e4), {}),
        ((1e5, 2e5, 1e4, 1e3), {"U": -1.0, "film": (6.0, 2.0)}),
    ):
        with beside_sides(27, ends, **more) as solution:
            areas.append(solution.numbers["cavitated_area"])
            assert len(solution.front_curves()) > 0
    np.testing.assert_allclose(areas, areas[0], rtol=1e-9)


def test_order_over_places_of_an_edge():
    """Load, friction and area of a pocket anywhere: no place is bad, and the mean falls by 2^1.8 a grid and more."""
    rng = np.random.default_rng(2)
    errors = []
    for t, u in rng.random((4, 2)):
        film = [
            {"shape": "linear", "h_start_um": 2.4, "h_end_um": 2.0},
            {"shape": "pocket", "depth_um": 2.5, "x_mm": [2.0 + t, 5.0 + t], "y_mm": [2.5 + u, 6.5 + u]},
        ]
        data = {"family": "bearing", "dimension": 2, "L_mm": 10, "width_mm": 10, "U": 1.0, "film": film}
        found = []
        for n in (20, 40, 80, 240):
            solution = solve(load_scene({**data, "n": n, "fluid": {"mu": 0.02, "p_supply": 1e5}}))
            found.append([solution.numbers[name] for name in ("pressure_integral", "friction", "cavitated_area")])
            solution.destroy()
        errors.append(np.abs(np.array(found[:3]) / found[3] - 1.0))
    worst, mean = np.max(errors, axis=0), np.sqrt(np.mean(np.square(errors), axis=0))
    assert (worst <= 3.0 * np.median(errors, axis=0) + 1e-4).all()
    assert (np.log2(mean[0] / mean[2]) / 2 > [1.8, 1.5, 1.0]).all()
    assert worst[2, 0] < 1e-3 and worst[2, 1] < 1e-3


@pytest.mark.parametrize("U", [1.0, -1.0])
def test_a_line_on_every_kink(U):
    """Where ramps begin and end, along and across the flow; and the same film the other way round."""
    ramps = [("x", [2.23, 5.1]), ("y", [3.07, 8.9]), ("y", [0.0, 10.0])]
    film = [{"shape": "constant", "h_um": 2.0}]
    film += [{"shape": "linear", "h_start_um": 1.0, "h_end_um": 0.0, "along": axis, "between_mm": ends} for axis, ends in ramps]
    data = {"family": "bearing", "dimension": 2, "L_mm": 10, "width_mm": 10, "U": U, "n": 23, "film": film}
    scene = load_scene({**data, "fluid": {"mu": 0.02, "p_supply": 1e5}})
    model = scene.model if U > 0 else scene.model.mirrored
    for line, places in zip(model.lines((23, 23)), ([2.23e-3, 5.1e-3], [3.07e-3, 8.9e-3]), strict=True):
        places = 0.01 - np.array(places) if U < 0 and places[0] == 2.23e-3 else np.array(places)
        assert np.abs(line[:, None] - places).min(axis=0).max() < 1e-12


def test_a_seam_is_an_edge_where_the_films_ends_differ():
    """The face across it has the two films there in series; where they are alike it is a face as any other."""
    ends = (("periodic", "periodic"), ("open", "open"))
    with_seam, without = (lambda x, y: 1.0 + (x > 0.5) + 0.0 * y), (lambda x, y: 2.0 + np.cos(2.0 * np.pi * x) + 0.0 * y)
    grid = Grid((8, 3), (1.0, 1.0), ends=ends)
    data = {"mu": 1.0 / 6.0, "U": 1.0, "scheme": "face", "p_sides": (0.0,) * 4, "p_unit": 1.0}
    box = coefficients(grid, with_seam, **data)
    np.testing.assert_allclose(box.k_W[:, 0] * grid.steps(0)[0], 1.0 / (0.5 / 8.0 + 0.5), rtol=1e-6)  # half of it each
    assert len(Around(with_seam, grid).edges(0)) == 2 and not Around(without, grid).edges(0)
    grid.destroy()
