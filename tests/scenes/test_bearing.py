"""Bearings from scene files: sides of every kind, films of every shape, against exact solutions and laws."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from films import dense
from hypothesis import given, settings
from hypothesis import strategies as st

from lcp_lube import InputError, load_scene, solve
from lcp_lube.problems.film.edges import face_film, pairs
from lcp_lube.problems.film.model import Model, Side
from lcp_lube.problems.film.shapes import Block, Sum
from lcp_lube.problems.grid import Grid
from lcp_lube.problems.transfer import Transfer
from lcp_lube.registry import SHAPES
from lcp_lube.scenes.bearing import BearingScene
from lcp_lube.scenes.formula import Formula

FEW = settings(max_examples=25, deadline=None)
L, WIDTH = 0.01, 0.006
OPEN = Side(p=1e5)


def bearing(**data):
    """A wedge with a pocket, 1D unless told otherwise."""
    film = [{"shape": "linear", "h_start_um": 3, "h_end_um": 1}, {"shape": "pocket", "depth_um": 1, "x_mm": [2, 5]}]
    return BearingScene(**{"L": L, "U": 1.0, "n": 40, "fluid": {"mu": 0.01, "p_supply": 1e5}, "film": film, **data})


def flat(**data):
    return bearing(**{"dimension": 2, "width": WIDTH, "nx": 14, "ny": 9, **data})


def found(scene, **how):
    """p (Pa above p_c) and r as arrays on the grid, and the quantities."""
    solution = solve(scene, method="active-set", recipe="superlu", nested=False, **how)
    assert solution.converged, solution.message
    shape = scene.shape[::-1]
    p, r = (solution.fields[name].reshape(shape) for name in "pr")
    quantities = solution.problem.quantities(solution.fields)
    p = p * solution.problem.p_unit
    solution.destroy()
    return p, r, quantities


def test_pocketed_pad_is_fowells():
    exact = load_scene("pocketed_pad").exact()
    assert exact.rupture == 2e-3 and exact.reformation == pytest.approx(3.6112626558e-3, rel=1e-10)
    assert exact.p_max == pytest.approx(9_808_818.754, abs=1e-3) and exact.x_max == pytest.approx(5e-3)
    assert exact.load - 1e5 * 0.01 == pytest.approx(34_165.70098, abs=1e-5)
    assert exact.r(2.5e-3) == pytest.approx(1 - exact.Q / (1.0 * (1.05e-6 - 0.05e-6 * 0.25 + 1e-6)), rel=1e-12)
    assert exact.r(np.nextafter(2e-3, 1)) == pytest.approx(0.4872906839, abs=1e-10)
    slow = load_scene("pocketed_pad", {"U": 0.02}).exact()
    assert slow.rupture is None and slow.load - 1e3 == pytest.approx(1333.4520, abs=1e-4)
    np.testing.assert_allclose(slow.p([2e-3, 5e-3]), [40_621.8837, 451_923.9105], atol=1e-4)


def test_parabolic_slider_exact():
    exact = load_scene("parabolic_slider").exact()
    assert exact.rupture / 0.0762 == pytest.approx(0.67893443, abs=1e-8) and exact.reformation is None
    assert exact.p_max == pytest.approx(3_591_787.27, abs=1e-2) and exact.load == pytest.approx(101_349.500, abs=1e-3)
    assert load_scene("parabolic_slider", {"p_out": 1e6}).exact().reformation is not None


@pytest.mark.parametrize("name", ["pocketed_pad", "parabolic_slider"])
@pytest.mark.parametrize("n", [49, 99, 103, 200])
def test_exact_on_any_grid(name, n):
    """Scheme face in 1D: the load is the film's own, wherever edges and fronts lie in their cells."""
    exact = load_scene(name).exact()
    assert found(load_scene(name, {"n": n}))[2]["pressure_integral"] == pytest.approx(exact.load, rel=1e-9)


@pytest.mark.parametrize("start", [49, 50, 53, 56])
def test_edges_may_lie_anywhere_in_a_full_film(start):
    """A pocket whose edges lie inside cells: still of second order, each n by itself."""
    exact, sizes = load_scene("pocketed_pad", {"U": 0.02}).exact(), [start * 2**k for k in range(4)]
    errors = [
        abs(found(load_scene("pocketed_pad", {"U": 0.02, "n": n}))[2]["pressure_integral"] / exact.load - 1) for n in sizes
    ]
    assert max(error * n**2 for error, n in zip(errors, sizes, strict=True)) < 2.0, errors


def test_edges_inside_cells_where_the_film_ruptures():
    """First order there, for only the part before the edge resists."""
    exact = load_scene("pocketed_pad").exact()
    for n in (100, 102, 203, 403):
        assert found(load_scene("pocketed_pad", {"n": n}))[2]["pressure_integral"] == pytest.approx(exact.load, rel=0.8 / n)


def test_pieces_side_by_side_and_in_series():
    """A step across the flow: C is the mean of cubes; along it: the harmonic one; H follows from Int h^-2 / Int h^-3."""

    def step(t, s):
        return np.where(t + 0.0 * s < 1.3, 1.0, 2.0)

    nodes, faces, lines = pairs(np.array([0.0, 1.0, 2.0, 3.0])), np.array([0.5, 1.5, 2.5]), np.array([0.0, 1.0])
    cubes, films = face_film(step, nodes, faces, lines, [1.3], [], np.ones((2, 2)))
    series = 1.0 / (0.3 + 0.7 / 8)
    np.testing.assert_allclose(cubes, [[1.0, series, 8.0]] * 2, rtol=1e-14)
    np.testing.assert_allclose(films, [[1.0, series * (0.3 + 0.7 / 4), 2.0]] * 2, rtol=1e-14)
    cubes, films = face_film(lambda t, s: step(s, t), nodes, faces, lines, [], [1.3], np.ones((2, 2)))
    np.testing.assert_allclose(cubes, [[1.0] * 3, [0.8 + 0.2 * 8] * 3], rtol=1e-14)
    np.testing.assert_allclose(films, [[1.0] * 3, [0.8 + 0.2 * 2] * 3], rtol=1e-14)
    narrow = lambda t, s: np.where((t > 1.2) & (t < 1.6), 2.0, 1.0) + 0 * s  # noqa: E731
    two = face_film(narrow, nodes, faces, lines, [1.2, 1.6], [], np.ones((2, 2)))
    np.testing.assert_allclose(two[0][0], [1.0, 1.0 / (0.6 + 0.4 / 8), 1.0], rtol=1e-14)


def test_no_cavitation_is_one_linear_solve():
    solution = solve(load_scene("pocketed_pad", {"U": 0.02}))
    assert solution.converged and solution.iterations == 1 and not solution.fields["r"].any()
    np.testing.assert_allclose(solution.problem.quantities(solution.fields)["load"], 1333.4520, rtol=1e-5)
    solution.destroy()


def test_a_dead_end_presses_everything_back():
    """East closed: Q = 0, so p = p_in + Int 6 mu U/h^2; for a wedge that is 6 mu U L/(h_0 - h_1) (1/h - 1/h_0)."""
    film = {"shape": "wedge", "h_start_um": 3, "h_end_um": 2}
    p, r, quantities = found(bearing(film=film, sides={"east": "closed"}, n=200))
    x = (np.arange(200) + 1) * L / 200.5
    h = 3e-6 - 1e-6 * x / L
    exact = 1e5 + 6 * 0.01 * L / 1e-6 * (1 / h - 1 / 3e-6)
    np.testing.assert_allclose(p[0] if p.ndim == 2 else p, exact, rtol=1e-4)
    assert not r.any() and abs(quantities["flow"]["west"]) < 1e-15 and quantities["flow"]["east"] == 0


def test_behind_a_wall_there_is_void():
    """West closed: a cavity without fluid begins at the wall, and the film is full only where the east side fills it."""
    p, r, quantities = found(bearing(film={"shape": "constant", "h_um": 2}, sides={"west": "symmetry"}, U=0.02))
    assert r[0] == pytest.approx(1.0) and p[0] == 0 and p[-1] > 0 and quantities["flow"]["east"] == pytest.approx(0, abs=1e-16)


@pytest.mark.parametrize("kind", ["symmetry", "closed", "periodic"])
@pytest.mark.parametrize("ny", [3, 4])
def test_two_dimensions_without_leakage_are_one(kind, ny):
    data = {"scheme": "nodal", "nx": 49}  # scheme face knows more of a line than of a plane
    line, r_line, one = found(bearing(**data))
    p, r, two = found(bearing(**data, dimension=2, width_mm=6, ny=ny, sides={"south": kind, "north": kind}))
    np.testing.assert_allclose(p, np.broadcast_to(line, (ny, 49)), rtol=0, atol=1e-10 * line.max())
    np.testing.assert_allclose(r, np.broadcast_to(r_line, (ny, 49)), rtol=0, atol=1e-10)
    for key in ("load", "friction", "p_max", "cavitated_fraction"):
        assert two[key] == pytest.approx(one[key] * (WIDTH if key in ("load", "friction") else 1.0), rel=1e-10)


@pytest.mark.parametrize("side", ["south", "north"])
def test_half_the_width_with_a_line_of_symmetry(side):
    whole, r_whole, all_of_it = found(bearing(dimension=2, width=WIDTH, nx=14, ny=10))
    # The closed side lies on the faces between lines 5 and 6: half the width, 5 lines, 5.5 spacings.
    p, r, half = found(bearing(dimension=2, width=WIDTH / 2, nx=14, ny=5, sides={side: "symmetry"}))
    lines = slice(0, 5) if side == "north" else slice(5, 10)
    np.testing.assert_allclose(p, whole[lines], rtol=0, atol=1e-10 * whole.max())
    np.testing.assert_allclose(r, r_whole[lines], rtol=0, atol=1e-10)
    for key in ("load", "friction"):
        assert 2 * half[key] == pytest.approx(all_of_it[key], rel=1e-10)


def test_void_that_enters():
    film, sides = {"shape": "constant", "h_um": 2}, {"west": {"p": 0.0, "r": 0.3}, "east": 1e5}
    solution = solve(bearing(film=film, sides=sides, U=5.0), nested=False)
    assert solution.converged and solution.fields["r"].max() == pytest.approx(0.3)
    west, east, *_ = solution.problem.boundary_flows(solution.fields["p"], solution.fields["r"])
    assert west == pytest.approx(0.7 * 5.0 * 2e-6, rel=1e-12) and east == pytest.approx(west, rel=1e-10)
    solution.destroy()


def ring(shift=0.0, **data):
    film = {"shape": "journal", "c_um": 5, "eccentricity": 0.6, "widest": shift}
    around = {"west": "periodic", "east": "periodic"}
    return flat(**{"film": film, "sides": around, "fluid": {"mu": 0.01, "p_supply": 3e5}, **data})


@FEW
@given(st.integers(1, 13), st.sampled_from(["face", "nodal", "upwind"]))
def test_a_periodic_film_may_be_cut_open_anywhere(cells, scheme):
    p, r, quantities = found(ring(scheme=scheme))
    p_moved, r_moved, moved = found(ring(cells * L / 14, scheme=scheme))
    np.testing.assert_allclose(np.roll(p, cells, axis=1), p_moved, rtol=0, atol=1e-9 * p.max())
    np.testing.assert_allclose(np.roll(r, cells, axis=1), r_moved, rtol=0, atol=1e-9)
    assert r.max() > 0.1 and moved["load"] == pytest.approx(quantities["load"], rel=1e-9)
    assert quantities["flow"]["west"] == quantities["flow"]["east"] == 0


sides_along = st.sampled_from([(OPEN, OPEN), (Side("closed"), OPEN), (OPEN, Side("closed")), (Side("periodic"),) * 2])
sides_across = st.sampled_from([(OPEN, OPEN), (Side("closed"), OPEN), (OPEN, Side("mirror")), (Side("periodic"),) * 2])
films = st.sampled_from(
    [
        "3e-6 - 100e-6*x",
        "2e-6 + 1e-6*sin(700*x)*cos(600*y)",
        "1e-6 + where(x < 0.004, 2e-6, 0)",
        Block(3e-6, (0.0019, 0.0051), (0.0011, 0.004)),
    ]
)


def model(along, across, film, scheme):
    gap = Formula(film) if isinstance(film, str) else Sum([Block(1e-6, (-1, 1), (-1, 1)), film])
    return Model((L, WIDTH), (*along, *across), gap, 0.01, 1.0, 0.0, 1e7, scheme)


def has_pressure(sides):
    return any(side.kind == "open" for side in sides)


@FEW
@given(sides_along, sides_across, films, st.sampled_from(["face", "nodal", "upwind"]))
def test_matrices_keep_their_signs_and_sums(along, across, film, scheme):
    """A symmetric with column sums >= 0, zero where no open side is near; -B with column sums >= 0."""
    if not has_pressure(along + across):
        with pytest.raises(InputError, match="no side has a pressure"):
            model(along, across, film, scheme)
        return
    problem = model(along, across, film, scheme).build((6, 5))
    A, B = dense(problem.A), dense(problem.B)
    np.testing.assert_allclose(A, A.T, rtol=1e-12)
    for M in (A, -B):
        diagonal = np.diag(M)
        assert (M - np.diag(diagonal) <= 0).all() and (diagonal > 0).all()
        assert (M.sum(axis=0) >= -1e-12 * diagonal).all()
    assert np.linalg.eigvalsh(A).min() > 0
    closed = A.sum(axis=0).reshape(5, 6)[1:-1, 1:-1]
    np.testing.assert_allclose(closed, 0, atol=1e-12 * A.max())
    problem.destroy()


@FEW
@given(sides_along, sides_across, films)
def test_what_enters_leaves(along, across, film):
    if not has_pressure(along + across):
        return
    problem = model(along, across, film, "face").build((7, 6))
    rng = np.random.default_rng(1)
    p = rng.random(problem.size)
    r = rng.random(problem.size).reshape(6, 7)
    r[:, -1] = 0  # at a closed east side r has no flow of its own
    r = r.ravel()
    west, east, south, north = problem.boundary_flows(p, r)
    total = problem.flow(p, r).sum()
    assert total == pytest.approx(east - west + north - south, abs=1e-10 * np.abs(problem.c).max() * problem.size + 1e-18)
    problem.destroy()


def test_interpolation_between_grids_with_any_sides():
    """Exact for linear functions between the points, and round a period."""
    for ends in (("closed", "open"), ("closed", "closed"), ("open", "mirror"), ("periodic", "periodic")):
        coarse, fine = (Grid((n, n - 1), (1.0, 1.0), ends=(("open", "open"), ends)) for n in (12, 23))
        transfer = Transfer(coarse, fine)
        smooth = [np.sin(2 * np.pi * grid.y) if "periodic" in ends else grid.y for grid in (coarse, fine)]
        given, expected = (np.broadcast_to(s, grid.box).ravel() for s, grid in zip(smooth, (coarse, fine), strict=True))
        error = np.abs(transfer(given) - expected).reshape(fine.box)
        inside = (fine.y[:, 0] >= coarse.y[0, 0]) & (fine.y[:, 0] <= coarse.y[-1, 0])
        assert error[inside].max() < 1e-12 if "periodic" not in ends else error.max() < 0.05
        for obj in (transfer, coarse, fine):
            obj.destroy()


# Films


def film_values(film, x, y=None, **data):
    scene = bearing(film=film, **data)
    return scene.gap(np.asarray(x), None if y is None else np.asarray(y))


@pytest.mark.parametrize(
    "film, x_mm, h_um",
    [
        ({"shape": "constant", "h_um": 7}, [0, 5], [7, 7]),
        ({"shape": "linear", "h_start_um": 4, "h_end_um": 2, "between_mm": [2, 4]}, [0, 2, 3, 4, 9], [4, 4, 3, 2, 2]),
        ({"shape": "parabola", "h_min_um": 1, "h_max_um": 5}, [0, 2.5, 5, 10], [5, 2, 1, 5]),
        ({"shape": "sinusoid", "h_min_um": 1, "h_max_um": 3, "waves": 2}, [0, 1.25, 2.5, 5], [3, 2, 1, 3]),
        ([{"shape": "constant", "h_um": 1}, {"shape": "step", "height_um": 2, "at_mm": 5}], [4.99, 5, 6], [1, 3, 3]),
        ({"shape": "journal", "c_um": 10, "eccentricity": 0.5, "widest_mm": 2.5}, [2.5, 5, 7.5], [15, 10, 5]),
        ({"shape": "formula", "h": "2 + x/0.01", "unit": "um"}, [0, 5], [2, 2.5]),
        (
            [{"shape": "constant", "h_um": 1}, {"shape": "dimples", "depth_um": 1, "size_mm": 1, "columns": 2, "form": "dome"}],
            [2.5, 2.75, 3, 5, 7.5],
            [2, 1.75, 1, 1, 2],
        ),
    ],
)
def test_shapes(film, x_mm, h_um):
    np.testing.assert_allclose(film_values(film, np.array(x_mm) * 1e-3), np.array(h_um) * 1e-6, rtol=1e-9)


def test_shapes_in_two_dimensions():
    base = {"shape": "constant", "h_um": 1}
    pocket = {"shape": "pocket", "depth_um": 2, "x_mm": [2, 4], "y_mm": [1, 5]}
    h = film_values([base, pocket], np.array([[1e-3, 3e-3]]), np.array([[0.5e-3], [3e-3]]), dimension=2, width=WIDTH)
    np.testing.assert_allclose(h, [[1e-6, 1e-6], [1e-6, 3e-6]])
    square = {"shape": "dimples", "depth_um": 2, "size_mm": 1, "columns": 2, "rows": 2, "form": "square"}
    h = film_values(
        [base, square], np.array([[2.5e-3, 2.9e-3]]), np.array([[1.5e-3], [1.9e-3], [3e-3]]), dimension=2, width=WIDTH
    )
    np.testing.assert_allclose(h, 1e-6 * np.array([[3, 3], [3, 3], [1, 1]]))
    tilt = {"shape": "wedge", "along": "y", "h_start_um": 1, "h_end_um": 3}
    np.testing.assert_allclose(film_values(tilt, 0.0, [0, WIDTH / 2, WIDTH], dimension=2, width=WIDTH), [1e-6, 2e-6, 3e-6])


def test_roughness_has_its_standard_deviation_and_its_seed():
    rough = {"shape": "roughness", "sigma_um": 0.1, "cells": 60}
    x, y = np.linspace(0, L, 300)[None, :], np.linspace(0, WIDTH, 300)[:, None]
    one, same, other = (film_values({**rough, "seed": seed}, x, y, dimension=2, width=WIDTH) for seed in (1, 1, 2))
    assert one.std() == pytest.approx(1e-7, rel=0.1) and (one == same).all() and not np.allclose(one, other)


def test_a_sum_has_the_extrema_that_its_parts_have_not():
    film = [{"shape": "sinusoid", "h_min_um": 1, "h_max_um": 3}, {"shape": "linear", "h_start_um": 2, "h_end_um": 0}]
    gap = bearing(film=film).gap
    x = np.linspace(0, L, 100_001)
    inside = [b for b in gap.breakpoints() if 0 < b < L]
    for place in (x[np.argmin(gap(x))], x[np.argmax(gap(x))]):
        assert min(abs(b - place) for b in [*inside, 0, L]) < 2e-7
    scene = bearing(film=film, n=400)
    quantities = found(scene)[2]
    exact = scene.exact()
    assert quantities["pressure_integral"] == pytest.approx(exact.load, rel=1e-4) and quantities["p_max"] == pytest.approx(
        exact.p_max, rel=1e-4
    )


def test_no_exact_solution_is_claimed_where_kinks_are_not_known():
    assert bearing(film={"shape": "formula", "h": "2e-6"}).exact() is None
    assert bearing(h_floor_um=1.5).exact() is None and flat().exact() is None


# Profiles


def profile(tmp_path, text, **keys):
    (tmp_path / "height.csv").write_text(text)
    scene = tmp_path / "measured.toml"
    more = "".join(f"{key} = {json.dumps(value)}\n" for key, value in keys.items())
    scene.write_text(
        'family = "bearing"\nL_mm = 10\nU = 1\nn = 50\n[fluid]\nmu = 0.01\n[film]\nshape = "profile"\nfile = "height.csv"\n'
        + more
    )
    return scene


def test_a_measured_profile_is_the_film(tmp_path):
    rows = "\n".join(f"{x},{3 - 0.2 * x}" for x in range(11))
    scene = load_scene(profile(tmp_path, f"# measured\nx,h\n{rows}\n\n"))
    wedge = bearing(film={"shape": "linear", "h_start_um": 3, "h_end_um": 1}, n=50, fluid={"mu": 0.01})
    np.testing.assert_allclose(found(scene)[0], found(wedge)[0], rtol=1e-9)
    assert scene.exact().load == pytest.approx(wedge.exact().load, rel=1e-9)
    cubic = load_scene(profile(tmp_path, f"{rows}\n", interpolation="cubic"))
    np.testing.assert_allclose(cubic.gap(np.linspace(0, L, 7)), wedge.gap(np.linspace(0, L, 7)), rtol=1e-9)


def test_a_profile_in_two_dimensions(tmp_path):
    x, y = np.meshgrid(np.linspace(0, L, 6), np.linspace(0, WIDTH, 4))
    h = 2.0 + 100 * x + 50 * y
    np.save(tmp_path / "h.npy", h)
    np.savetxt(tmp_path / "h.csv", np.stack([x * 1e3, y * 1e3, h], axis=-1).reshape(-1, 3)[::-1], delimiter=";", header="x;y;h")
    for name in ("h.npy", "h.csv"):
        film = [{"shape": "profile", "file": str(tmp_path / name)}]
        values = film_values(film, x, y, dimension=2, width=WIDTH)
        np.testing.assert_allclose(values, h * 1e-6, rtol=1e-12)
        cubic = film_values([{**film[0], "interpolation": "cubic"}], x[:, ::2], y[:, ::2], dimension=2, width=WIDTH)
        np.testing.assert_allclose(cubic, h[:, ::2] * 1e-6, rtol=1e-12)


@pytest.mark.parametrize(
    "text, keys, message",
    [
        ("0,1\n5,\n10,1\n", {}, "line 2: '5,': a row of numbers is missing"),
        ("0,1\n\n10,1\n", {}, "line 2: '': a row of numbers is missing"),
        ("0,1\n5,nan\n10,1\n", {}, "line 2: '5,nan': a value is no finite number"),
        ("0,1\n5,1,1\n10,1\n", {}, "line 2: 3 values"),
        ("0,1\n9,1\n", {}, "x from 0 to 0.009 m; 0 to 0.01 m is needed"),
        ("0,1\n", {}, "1 rows; 2 and more are needed"),
        ("", {}, "0 rows"),
        ("".join(f"{x},1\n" for x in range(11) if x != 4), {}, "a row is missing after x = 3"),
        ("0,0,1\n10,0,1\n0,1,1\n", {}, "the row for x = 10, y = 1 is missing"),
        ("0,1\n10,1\n10,2\n", {}, "some points are there twice"),
        ("0,1\n5,2\n10,1\n", {"interpolation": "cubic"}, "3 points in x; cubic interpolation needs 4"),
        ("0,1\n5,-2\n10,1\n", {}, "film -2e-06 m at x = 0.00"),
    ],
)
def test_profiles_refused(tmp_path, text, keys, message):
    with pytest.raises(InputError) as caught:
        load_scene(profile(tmp_path, text, **keys)).build()
    assert message in str(caught.value) and "\n" not in str(caught.value)


def test_profile_files_refused(tmp_path):
    np.save(tmp_path / "bad.npy", np.array([1.0, np.nan, 1.0]))
    np.save(tmp_path / "words.npy", np.array(["a", "b"]))
    (tmp_path / "torn.npy").write_bytes(b"\x93NUMPY nothing")
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00\x01")
    for name, message in {
        "bad.npy": "h is nan at x = 0.005",
        "words.npy": "numbers are needed",
        "torn.npy": "no array of numbers",
        "binary.csv": "not a text file",
        "missing.csv": "No such file",
        "h.txt": "allowed are .csv, .npy, .tif",
    }.items():
        with pytest.raises(InputError, match=message):
            bearing(film={"shape": "profile", "file": str(tmp_path / name)}).build()


# What is refused


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"film.pocket.depht": 1}, "pocketed_pad: unknown key film.pocket.depht; nearest is depth"),
        ({"film.poket.depth": 1}, "--set film.poket.depth: no entry is poket; there are linear, pocket; nearest is pocket"),
        ({"film.3.h": 1}, "--set film.3.h: entries 1 to 2 are there"),
        ({"film.shape": "dome"}, "--set film.shape: 2 entries have shape; say which"),
        ({"film.1.shape": "poket"}, "pocketed_pad: film.1.shape = poket: allowed are constant, "),
        ({"film": [{"depth": 1}]}, "pocketed_pad: film.1: shape is missing; allowed are constant, "),
        ({"film": []}, "pocketed_pad: film = []: "),
        ({"film.pocket.depth": "deep"}, "pocketed_pad: film.pocket.depth = deep: allowed is a valid number"),
        ({"film.pocket.x_mm": [5, 2]}, "pocketed_pad: film.pocket: x = [0.005, 0.002]: start < end is needed"),
        ({"sides.west": "periodic"}, "pocketed_pad: sides.west is periodic, sides.east is not: both of them or none"),
        ({"sides.west": "wall"}, "pocketed_pad: sides.west.kind = wall: allowed is 'pressure', 'symmetry', "),
        ({"sides.wets.p": 1}, "pocketed_pad: unknown key sides.wets; nearest is west"),
        ({"sides.north": 1e5}, "pocketed_pad: sides.north: the scene is one-dimensional"),
        ({"sides.west.p": 2e5, "p_in": 1e5}, "pocketed_pad: p_in and sides.west are both given"),
        ({"sides.west": {"kind": "closed", "p": 1e5}}, "pocketed_pad: sides.west: p = 100000: the side is closed"),
        ({"fluid.p_c": 2e5}, "pocketed_pad: sides.west: p = 100000: at least the cavitation pressure p_c = 200000 is needed"),
        ({"fluid.nu": 1}, "pocketed_pad: unknown key fluid.nu; nearest is mu"),
        ({"fluid.mu": 0}, "pocketed_pad: fluid.mu = 0: allowed is greater than 0"),
        ({"fluid": {}}, "pocketed_pad: fluid.mu is missing"),
        ({"L_cm": 1}, "pocketed_pad: unknown key L_cm"),
        ({"U_mm": 1}, "pocketed_pad: unknown key U_mm"),
        ({"dni.gamma": 1}, "--set dni.gamma: dni is no table of the scene, and no method; nearest is din"),
    ],
)
def test_refused_values(changes, message):
    with pytest.raises(InputError) as caught:
        load_scene("pocketed_pad", changes)
    assert str(caught.value).startswith(message) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"film.pocket.depth": -3e-6}, r"^pocketed_pad: film -1.975e-06 m at x = 0.005 m: it must be positive everywhere$"),
        ({"film": {"shape": "formula", "h": "log(x - 0.005)"}}, r"film no number at x = 0 m"),
        ({"sides.west": "closed", "sides.east": "closed"}, "no side has a pressure"),
        ({"sides.west": "periodic", "sides.east": "periodic"}, "no side has a pressure"),
        ({"sides.west.r": 0.2}, r"sides.west.r = 0.2: void enters by the west side alone, and there at p = p_c"),
        ({"sides.east.r": 0.2, "fluid.p_supply": 0.0}, r"sides.east.r = 0.2: void enters"),
    ],
)
def test_refused_when_built(changes, message):
    with pytest.raises(InputError, match=message):
        load_scene("pocketed_pad", changes).build()


@pytest.mark.parametrize("text", ["__import__('os')", "x.real", "open('f')", "lambda: 1", "h*2", "x if x", "[1]", "exec('1')"])
def test_formulas_may_only_calculate(text):
    with pytest.raises(InputError) as caught:
        load_scene("pocketed_pad", {"film": {"shape": "formula", "h": text}})
    assert "formula" in str(caught.value) and "\n" not in str(caught.value)


def test_both_units_at_once_are_refused(tmp_path):
    file = tmp_path / "two.toml"
    file.write_text('family = "bearing"\nL = 0.01\nL_mm = 10\nU = 1\n[fluid]\nmu = 1\n[film]\nshape = "constant"\nh = 1e-5\n')
    with pytest.raises(InputError, match=r"two\.toml: L and L_mm are both given: one of them is allowed$"):
        load_scene(file)


def test_periodic_along_the_flow_needs_to_be_fed():
    with pytest.raises(InputError, match="nothing feeds the film"):
        ring(fluid={"mu": 0.01}).build()
    with pytest.raises(InputError, match="at least 3 points between periodic sides"):
        ring(nx=2).build()


# Changes of single values


def test_changes_reach_into_tables():
    scene = load_scene("pocketed_pad", {"film.pocket.depth": 2e-6, "film.h_end_um": 0.5, "sides.west": 2e5, "bearing.U": 3.0})
    assert scene.film[1].depth == 2e-6 and scene.film[0].h_end == 5e-7 and scene.U == 3.0 and scene.sides.west.p == 2e5
    assert load_scene("pocketed_pad", {"sides.east.p": 3e5}).sides.east.p == 3e5
    assert load_scene("pocketed_pad", {"film.2.depth_mm": 0.01}).film[1].depth == 1e-5
    assert load_scene("journal", {"journal.eccentricity": 0.7}).eccentricity == 0.7


def test_units_round_once():
    """1.05 um is 1.05e-6 m, to the last bit."""
    film = load_scene("pocketed_pad").film
    assert film[0].h_start == 1.05e-6 and film[1].x == (0.002, 0.005) and load_scene("parabolic_slider").L == 0.0762


@pytest.mark.parametrize("given, chosen", [("din.gamma=0.4", "active-set"), ("din.gamma=0.4", "auto")])
def test_another_methods_option_is_not_ignored(cli, given, chosen):
    run = cli("solve", "problem1", "--set", given, "--method", chosen)
    assert run.status == 2 and run.lines == [
        f"lcp-lube: --set din.gamma: an option of method din, and the method is {chosen}; add --method din"
    ]


# Documentation, and anything at all

BLOCKS = re.findall(r"```toml\n(.*?)```", (Path(__file__).parents[2] / "docs" / "scene_files.md").read_text(), re.S)


@pytest.mark.parametrize("block", BLOCKS)
def test_documented_scenes(tmp_path, block):
    (tmp_path / "documented.toml").write_text(block)
    solution = solve(load_scene(tmp_path / "documented.toml"))
    assert solution.converged and len(BLOCKS) == 6
    solution.destroy()


def test_documented_shapes_are_all():
    text = (Path(__file__).parents[2] / "docs" / "scene_files.md").read_text()
    for name in SHAPES:
        assert f"`{name}`" in text, name


values = st.one_of(
    st.none(), st.booleans(), st.integers(-3, 300), st.floats(), st.text(max_size=5), st.lists(st.floats(), max_size=3)
)
KEYS = [
    "film",
    "film.pocket",
    "film.1.shape",
    "film.pocket.x",
    "film.h_start_um",
    "sides",
    "sides.west",
    "sides.east.p",
    "fluid",
]
KEYS += [
    "fluid.mu",
    "fluid.p_c",
    "U",
    "L",
    "L_um",
    "p_in",
    "dimension",
    "ny",
    "scheme",
    "p_unit",
    "h_floor",
    "sides.west.r",
    "a.b",
]


@settings(max_examples=150, deadline=None)
@given(
    st.dictionaries(st.sampled_from(KEYS), st.one_of(values, st.dictionaries(st.sampled_from(["p", "h"]), values)), max_size=3)
)
def test_any_values_make_a_problem_or_one_line(changes):
    """Never another exception, whatever a file holds."""
    try:
        problem = load_scene("pocketed_pad", {"n": 5, **changes}).build()
    except InputError as error:
        assert len(str(error).splitlines()) == 1
    else:
        assert problem.scheme.h.min() > 0
        problem.destroy()


@pytest.mark.parametrize("h_end, found", [("0", "0 m"), ("-1nm", "-1e-09 m")])
@pytest.mark.parametrize("dimension", [1, 2])
def test_a_film_that_touches_at_a_side_is_refused(h_end, found, dimension):
    """Between the last point and the side no point or face of the grid sees it."""
    film = {"shape": "linear", "h_start": "20um", "h_end": h_end}
    data = {"family": "bearing", "dimension": dimension, "L": 0.01, "U": 1.0, "n": 9, "fluid": {"mu": 0.01}}
    data |= {"width": 0.01} if dimension == 2 else {}
    with pytest.raises(InputError, match=f"film {found} at x = 0.01.* it must be positive everywhere"):
        solve(data | {"film": film})
