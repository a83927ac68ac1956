"""--accuracy: the estimate against exact solutions, where the ladder ends, what is refused."""

import math
from itertools import product

import numpy as np
import pytest
from films import FilmScene, L, Pieces, random_films

from lcp_lube.api import solve
from lcp_lube.drivers.accuracy.estimate import Traits, estimate, is_known, known_line, of_pair
from lcp_lube.drivers.accuracy.rungs import finer, first_rung, first_shape, round_ring, rungs_up
from lcp_lube.drivers.accuracy.unseen import misplaced_film
from lcp_lube.drivers.loads import attitude
from lcp_lube.errors import InputError
from lcp_lube.problems.solution import Outcome
from lcp_lube.registry import scene_names
from lcp_lube.scenes.scene import load_scene


def estimated(values, misplaced, name=""):
    """From grids whose spacing halves."""
    return estimate(values, misplaced, [2.0**k for k in range(len(values))], name)


def exact_scenes():
    """Every built-in scene with an exact solution, and some with other data."""
    variants = {
        **{f"problem{k}": [{}, {"film": "parabola"}] for k in (1, 2, 3)},
        "long_journal": [{"eccentricity": e} for e in (0.2, 0.5, 0.9)],
    }
    for name in scene_names():
        for changes in variants.get(name, [{}]):
            scene = load_scene(name, changes)
            moves = getattr(scene, "motion", None) is not None  # then what is exact is not the film's answer
            exact = scene.exact() if hasattr(scene, "exact") and not moves else None
            if exact is not None:
                yield scene, exact


def errors(cases, quantity, tol, all_reach=True):
    """Estimated and true relative errors, and whether edges lie inside cells, shape (cases, 3); of runs that reach `tol`."""
    out = []
    for scene, exact in cases:
        if getattr(exact, {"pressure_integral": "load"}.get(quantity, quantity)) == 0:
            continue  # an empty film: no relative error
        solution = solve(scene, accuracy=tol, quantity=quantity)
        problem = solution.problem
        truth = exact.p_max + problem.p_c if quantity == "p_max" else exact.load
        value = solution.numbers[quantity]
        edges = misplaced_film(problem) > 0
        solution.destroy()
        if not all_reach and solution.outcome is Outcome.ACCURACY:
            continue
        assert solution.outcome is Outcome.CONVERGED, f"{scene.name}: {solution.message}"
        assert solution.settings["accuracy_grid_value"] == solution.levels[-1]["value"]
        assert solution.settings["accuracy_extrapolated"] == (value != solution.levels[-1]["value"])
        out.append((solution.settings["accuracy_estimate"], abs(value / truth - 1), edges))
    return np.array(out)


@pytest.mark.parametrize("quantity, tol", list(product(["pressure_integral", "p_max"], [1e-2, 1e-3])))
def test_estimate_against_exact_solutions(quantity, tol):
    """The true error is below the estimate in 95 % of the runs and more, and the estimate within four times of it in the
    median."""
    estimate, true, edges = errors([*exact_scenes(), *random_films(30, seed=11)], quantity, tol).T
    assert len(true) >= 35
    assert np.all(estimate <= tol)
    assert np.mean(true <= estimate + 1e-12) >= 0.95
    inexact = (true > 1e-12) & (edges == 0)  # a largest pressure that is a side's is exact on every grid
    assert inexact.sum() >= 8
    assert 1 <= np.median(estimate[inexact] / true[inexact]) <= 4


def pocketed_films(count, seed):
    """Wedges with pockets whose edges lie anywhere in a cell."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        start = rng.uniform(1e-6, 5e-6)
        film = [{"shape": "linear", "h_start": start, "h_end": start * rng.uniform(0.4, 1.0)}]
        for _ in range(rng.integers(1, 4)):
            a = rng.uniform(0.05, 0.8)
            b = min(a + rng.uniform(0.02, 0.4), 0.97)
            film.append({"shape": "pocket", "depth": start * rng.uniform(0.2, 5.0), "x": [0.02 * a, 0.02 * b]})
        fluid, U = {"mu": 0.01, "p_supply": 1e5}, float(rng.uniform(0.1, 5.0))
        scene = load_scene({"family": "bearing", "L": 0.02, "U": U, "fluid": fluid, "film": film, "n": 100})
        yield scene, scene.exact()


@pytest.mark.parametrize("quantity", ["pressure_integral", "p_max"])
def test_films_with_edges(quantity):
    """Of 60 films at 1e-2 and 1e-3, 98 to 100 % had errors below the estimate."""
    estimate, true, _ = errors(pocketed_films(25, seed=3), quantity, 1e-2, all_reach=False).T
    assert len(true) >= 22  # others say that they did not get there
    assert np.all(estimate <= 1e-2) and np.mean(true <= estimate + 1e-12) >= 0.9
    assert np.max(true) <= 1e-2


def test_edges_inside_cells_do_not_fall_by_second_order():
    """pocketed_pad_2d, 11 x 4 points and on, edges inside cells: p_max and load turn on finer grids, after a small
    difference by chance; the extrapolated values' errors say so."""
    p_max = [8122699.59, 9039495.88, 9007987.4, 8936618.1, 8956709.55, 8959231.28, 8948441.03, 8942365.7]
    load = [329.898716, 348.401157, 348.783722, 348.374936, 348.794914, 348.886526, 348.719749, 348.621535]
    for values in (p_max, load):
        for k in range(4, len(values)):
            found = estimated(values[:k], [0.0] * k)
            assert found.error > 0.5 * abs(found.value - values[-1]), k


def test_the_load_of_a_shaft_is_its_force():
    """The tolerance is about what the journal carries, not about the integral of the pressure."""
    solution = solve(load_scene("long_journal"), accuracy=1e-4)
    found = solution.problem.quantities(solution.fields)
    solution.destroy()
    assert solution.levels[-1]["value"] == found["load"] == np.hypot(*found["force"])
    assert found["sommerfeld"] == pytest.approx(3.22777817, rel=1e-4)


def test_the_force_of_a_shaft_is_as_large_as_its_extrapolated_load():
    with solve(load_scene("journal"), accuracy=2e-2) as solution:
        found, grid = solution.numbers, solution.problem.quantities(solution.fields)
        assert solution.settings["accuracy_extrapolated"] and found["load"] != grid["load"]
        assert np.hypot(*found["force"]) == pytest.approx(found["load"], rel=1e-12)
        assert found["friction_coefficient"] * found["load"] == pytest.approx(found["friction"], rel=1e-12)
        assert found["sommerfeld"] / found["load"] == pytest.approx(grid["sommerfeld"] / grid["load"], rel=1e-12)
        assert np.cross(found["force"], grid["force"]) == pytest.approx(0.0, abs=1e-9 * found["load"] ** 2)


def test_no_grid_finer_than_needed():
    """The grid before the last one was not known to be good enough; a coarser tolerance ends sooner."""
    sizes = []
    for tol in (1e-1, 1e-3, 1e-5, 1e-6):
        solution = solve(load_scene("problem1"), accuracy=tol)
        solution.destroy()
        estimates = [level["estimate"] for level in solution.levels]
        assert estimates[-1] <= tol
        assert all(estimate > tol for estimate in estimates[:-1])
        sizes.append(solution.levels[-1]["nx"])
    assert sizes == sorted(sizes)
    assert sizes[0] < sizes[-1] <= 2000


@pytest.mark.parametrize("scene, tol", [("problem4", 1e-2), ("journal", 1e-2)])
def test_plane_film(scene, tol):
    """A 2D load against that of a grid with some 250 points along x."""
    solution = solve(load_scene(scene), accuracy=tol)
    value = solution.levels[-1]["value"]
    solution.destroy()
    fine = solve(load_scene(scene, {"nx": 255, "ny": 127 if scene == "problem4" else 63}))
    truth = fine.problem.quantities(fine.fields)["load"]
    fine.destroy()
    assert abs(value / truth - 1) <= tol
    assert solution.levels[-1]["nx"] < 100


@pytest.mark.parametrize(
    "scene, quantity", [("obstacle_ball", "sum_v"), ("bratu", "max_v"), ("poisson_cubic", "sum_v"), ("ehl_line", "k")]
)
def test_scenes_that_are_no_films(scene, quantity):
    solution = solve(load_scene(scene, {"n": 40}), accuracy=2e-2, quantity=quantity)
    solution.destroy()
    assert solution.converged
    assert len({level["nx"] for level in solution.levels}) == len(solution.levels) >= 3


def test_other_methods():
    values = []
    for method in ("din", "din-pc", "active-set"):
        solution = solve(load_scene("problem3"), accuracy=1e-2, method=method)
        solution.destroy()
        assert solution.converged
        values.append(solution.levels[-1]["value"])
    assert values == pytest.approx([values[0]] * 3, rel=1e-3)


def test_estimates_by_hand():
    """Second order without noise is extrapolated to the limit; a vanishing difference proves nothing; nor do two values."""
    clean = estimated([1 + 0.3 / 4.0**k for k in range(5)], [0.0] * 5)
    assert clean.extrapolated and clean.value == pytest.approx(1.0, rel=1e-12) and clean.relative < 1e-3
    first = [1 + 0.3 / 2.0**k for k in range(6)]
    found = estimated(first, [0.0] * 6)
    assert abs(found.value - 1) <= found.error <= 4 * abs(found.value - 1)
    assert estimated([1.0, 1.1], [0.0] * 2).relative == math.inf
    assert estimated([1.0, 1.0, 1.0], [0.0] * 3).relative == 0.0
    assert estimated([1.0, 1.0, 1.0], [0.1, 0.05, 0.02]).relative >= 0.02
    assert estimated([1.0, math.nan, 1.1], [0.0] * 3).relative == math.inf
    assert estimated([1.2, 1.04, 1.04], [0.0] * 3).relative >= 0.16 / 4 / 3
    assert estimated([1.2, 1.04, 1.04, 1.04], [0.0] * 4).relative >= 0.16 / 16 / 3


def test_grids_that_did_not_see_the_edges_are_left_out():
    """Loads of the textured slider: with edges inside cells the first three say nothing of grids whose lines lie on them."""
    loads, shares = [-233.4, 353.6, -14.8, -246.51, -259.81, -264.61], [0.5, 0.4, 0.2, 0.0, 0.0, 0.0]
    found = estimated(loads, shares)
    assert found == estimated(loads[3:], [0.0] * 3) and found.extrapolated
    assert found.relative < 0.02 < estimated(loads, [0.0] * 6).relative
    assert estimated(loads[:5], shares[:5]).relative > 0.1  # two are too few to go by


def test_jump_is_seen_where_values_do_not_show_it():
    """A step off the faces by the same length on several grids: equal values, and an estimate that is not fooled."""
    film = Pieces("steps", (0.0, 0.63 * L, L), (2e-5, 1e-5, 1e-5))
    for n in (24, 49):
        problem = FilmScene.of(film, n=n, scheme="nodal").build()
        share = misplaced_film(problem)
        # Between points and faces h^-3 is off by up to half a spacing of it.
        assert 0 < share <= 0.5 * (1e5**3 - (5e4) ** 3) * problem.grid.spacing[0] / (0.37 * L * 1e5**3 + 0.63 * L * 5e4**3)
        problem.destroy()
    smooth = FilmScene.of(Pieces("smooth", (0.0, 0.5 * L, L), (2e-5, 1e-5, 2e-5)), n=49, scheme="nodal").build()
    assert misplaced_film(smooth) == 0
    smooth.destroy()


def test_first_shape():
    """A hundred points or so, fewer where the finest grid allowed leaves no room for three; in 1D two dozens."""
    assert first_shape((100, 100)) == (11, 11)
    assert first_shape((360, 79)) == (44, 9)
    assert first_shape((3, 3)) == (3, 3)
    assert first_shape((20, 20), finest=(20, 20)) == (9, 9)
    assert first_shape((100,)) == (24,)
    assert first_shape((100,), few=64) == (100,)


def test_grids_begin_where_lines_lie_on_all_edges():
    assert first_shape((600, 600), fewest=(81, 81)) == (80, 80)
    assert first_shape((60, 60), fewest=(81, 81)) == first_shape((60, 60))
    assert first_shape((600, 600), fewest=(81, 81), finest=(60, 60)) == first_shape((600, 600), finest=(60, 60))


def test_rungs():
    """Twice the points from grid to grid; every other one has half the spacing."""
    assert [finer((80, 80), (81.0, 81.0), k)[0] for k in range(5)] == [80, 114, 161, 229, 323]
    assert finer((12,), (13.0,), 1) == (25,)
    assert finer((10, 10), (10.0, 11.0), 2) == (20, 21)  # a ring has as many meshes as points


def test_grids_that_an_estimate_leaves_out():
    """None before three values, nor while they are far off; at most half the spacing at once, but where the error is known
    or each two grids have an estimate."""
    assert rungs_up([math.inf, math.inf], 1e-2, False, 2) == 1
    assert rungs_up([math.inf, math.inf, 9e-2], 1e-2, False, 2) == 2
    assert rungs_up([math.inf, math.inf, 1.1e-2], 1e-2, False, 2) == 1
    assert rungs_up([5e-2], 1e-2, True, 1) == 1 and rungs_up([1e-4], 1e-8, True, 1) == 7
    assert rungs_up([math.inf], 1e-2, False, 2, True) == 2  # half the spacing
    assert rungs_up([math.inf, 1.9e-2], 1e-2, False, 2, True) == 1  # twice the points
    assert rungs_up([math.inf, 2.1e-2], 1e-2, False, 2, True) == 2
    assert rungs_up([math.inf, 4e-3], 1e-4, False, 2, True) == rungs_up([math.inf, 5e-2], 1e-4, False, 2, True) == 5
    assert rungs_up([math.inf, 1.5e-2, 1.1e-2], 1e-2, False, 2, True) == 1
    assert rungs_up([math.inf, 4e-2], 1e-2, False, 2, True) == rungs_up([math.inf, 9e-2, 4e-2], 1e-2, False, 2, True) == 2


def test_first_grid_by_tolerance():
    """Twice the points for each tenth of the tolerance, four times at most, or where stretches are narrow."""
    assert [first_rung(tol, False) for tol in (0.1, 1e-2, 3e-3, 1e-3, 3e-4, 1e-6)] == [0, 0, 1, 1, 2, 2]
    assert first_rung(1e-2, True) == 2


def known_numbers(problem):
    line, fields = known_line(problem)
    return line.quantities(fields)


def test_what_a_line_is_known_by():
    """Quadrature knows a steady line; not one in time, nor one that heat acts on."""
    for n in (7, 100):
        pad = load_scene("pocketed_pad", {"n": n})
        assert is_known(pad) and known_numbers(pad.build())["load"] == pytest.approx(34165.70098, rel=1e-9)
    assert is_known(load_scene("pocketed_pad", {"scheme": "face", "fluid.barus": 1e-8}))
    assert not is_known(load_scene("moving_texture")) and not is_known(load_scene("lined_pad"))
    for scene in ("problem1", "problem3"):  # whatever the scheme that it is solved with, and whichever way it moves
        nodal, turned = load_scene(scene), load_scene(scene, {"U": -4.0})
        face = known_numbers(nodal.model_copy(update={"scheme": "face"}).build())
        assert known_numbers(nodal.build())["load"] == pytest.approx(face["load"], rel=1e-12)
        assert is_known(turned) and np.isfinite(known_numbers(turned.build())["load"])


def test_numbers_of_a_ladder_are_taken_when_they_are_asked_for():
    """The load of each grid alone; the rest, and estimates of it, at the first look, and the same on any way to them."""
    with solve("journal", accuracy=1e-2) as solution:
        assert "numbers" not in vars(solution)
        numbers, estimates = solution.numbers, solution.estimates
    assert numbers["load"] == estimates["load"]["value"] != solution.settings["accuracy_grid_value"]
    assert numbers["load"] == pytest.approx(np.hypot(*numbers["force"]), rel=1e-12)
    assert {"friction", "p_max", "sommerfeld"} < set(estimates) and "cavitated_area" not in estimates  # of two grids
    assert all(one["error"] >= 0.0 for one in estimates.values())


def test_estimate_of_two_grids():
    """Values that agree by chance have an estimate by what the pressure changed; the answer has 3/4 of the correction."""
    found = of_pair([1.0, 1.3], [0.0, 0.0], [16.0, 32.0], 0.1, "load")
    assert found.value == pytest.approx(1.375) and found.error == pytest.approx(1.4 * 0.3 / 3) and found.extrapolated
    assert of_pair([1.0, 1.0], [0.0, 0.0], [16.0, 32.0], 0.1, "load").error == pytest.approx(1.4 * 0.1 / 3)
    assert of_pair([1.0, 1.3], [0.0, 0.0], [16.0, 32.0], 0.1, "load", full=True).error == pytest.approx(0.7 * 0.3 / 3)
    assert of_pair([1.0, 1.3], [0.0, 0.0], [16.0, 32.0], 0.1, "load", film=Traits(rims=True)).error == pytest.approx(
        1.7 * 1.4 * 0.3 / 3
    )
    assert of_pair([1.0, 1.3], [0.0, 0.0], [16.0, 32.0], 0.1, "load", film=Traits(corners=True)).error == pytest.approx(
        1.2 * 1.4 * 0.3 / 3
    )
    assert of_pair([1.0, 1.3], [0.0, 0.0], [16.0, 32.0], 0.1, "p_max", film=Traits(corners=True)).error == pytest.approx(
        3 * 0.3 / 3
    )
    assert of_pair([1.0, 1.0], [0.0, 0.0], [16.0, 32.0], 0.1, "friction").error == pytest.approx(3 * 0.03 / 3)
    assert of_pair([1.0], [0.0], [16.0], 0.1, "load").error == math.inf
    assert of_pair([1.0, 1.1], [0.0, 0.0], [16.0, 32.0], 0.1, "cavitated_area").error == math.inf


def test_third_grid_tells_of_the_order():
    """Corrections that fall by second order leave an estimate of half its size; others one that is larger, by a fourth root."""
    sizes = [16.0, 32.0, 64.0]
    two = of_pair([1.16, 1.04], [0.0] * 2, sizes[1:], 0.1, "load").error
    assert of_pair([1.64, 1.16, 1.04], [0.0] * 3, sizes, 0.1, "load").error == pytest.approx(1.5 * 0.02**0.25 * two)
    assert of_pair([1.16, 1.16, 1.04], [0.0] * 3, sizes, 0.1, "load").error == pytest.approx(1.5 * two)
    far = of_pair([1.64, 1.3, 1.16], [0.0] * 3, [16.0, 23.0, 32.0], 0.1, "load", -3)  # with the grid of twice the spacing
    assert far.value == pytest.approx(1.16 - 0.75 * 0.16) and 0.5 * 1.4 * 0.16 < far.error < 1.4 * 0.16
    assert of_pair([math.nan, 1.16, 1.04], [0.0] * 3, sizes, 0.1, "load").error == two


def test_errors_of_areas_are_a_sample():
    """The root mean square of corrections of order 3/2; none where the values agree."""
    off = [0.4, -0.2, 0.1, -0.05]
    found = estimated([1 + one for one in off], [0.0] * 4, "cavitated_area")
    moves = np.diff(off) / (2**1.5 - 1) * np.array([2**-3.0, 2**-1.5, 1.0])
    assert found.error == pytest.approx(1.8 * np.sqrt(np.mean(moves**2))) and found.extrapolated
    assert abs(found.value - 1) <= found.error <= 4 * abs(found.value - 1)
    assert estimated([1.0, 1.0, 1.0], [0.0] * 3, "cavitated_area").relative == 0.0


@pytest.mark.parametrize("form, truth, most", [("square", 6.1981, 160), ("round", 7.0775, 224)])
def test_pads_whose_errors_cancel_in_each_dimple(form, truth, most):
    """Pressures change by far more than the load: 1 % of it takes few points (round: 159 are told as 1.02 %, and are 0.26)."""
    with solve(load_scene("dimpled_pad", {"film.dimples.form": form}), accuracy=1e-2, quantity="pressure_integral") as solution:
        assert solution.converged and solution.problem.grid.shape[0] <= most
        assert abs(solution.numbers["pressure_integral"] / truth - 1) <= solution.settings["accuracy_estimate"]


def test_textured_slider_of_narrow_rims():
    """Twenty cells a side, rims a mesh of 601 wide: 1 % of the load, -264.85 N, on at most 480 points a side."""
    solution = solve(load_scene("textured_slider", {"K": 20, "scheme": "face"}), accuracy=1e-2)
    solution.destroy()
    assert solution.converged and solution.problem.grid.shape[0] <= 480
    assert abs(solution.numbers["load"] / -264.85 - 1) <= solution.settings["accuracy_estimate"] <= 1e-2


@pytest.mark.parametrize(
    "tol, quantity, words",
    [
        (0.0, None, "allowed are relative errors"),
        (math.nan, None, "allowed are relative errors"),
        (1e-3, "pmax", "nearest is p_max"),
        (1e-3, "flow", "no such number"),
    ],
)
def test_bad_input(tol, quantity, words):
    with pytest.raises(InputError, match=words):
        solve(load_scene("problem1"), accuracy=tol, quantity=quantity)


def test_out_of_memorys_reach_is_refused(cli):
    run = cli("solve", "problem4", "--accuracy", "1e-9")
    assert run.status == 2
    assert len(run.lines) == 1
    assert "--accuracy 1e-09" in run.err
    assert "GB are available" in run.err


def test_command_line(cli):
    run = cli("solve", "problem2", "--accuracy", "1e-3", "--quantity", "p_max", "--json", "--explain")
    assert run.status == 0
    data = run.json
    assert data["accuracy_quantity"] == "p_max"
    assert data["accuracy_estimate"] <= 1e-3
    assert data["levels"][-1]["value"] == pytest.approx(data["p_max"])
    assert data["levels"][-1]["nx"] == data["nx"]
    grids = [line.split() for line in run.lines if line.strip()[0].isdigit()]
    assert [int(words[0]) for words in grids] == [level["nx"] for level in data["levels"]]


def test_finest_grid_allowed(cli):
    run = cli("solve", "problem1", "--accuracy", "1e-6", "--n", 60, "--json")
    assert run.status == 1
    assert run.json["outcome"] == "accuracy_not_reached"
    assert run.json["nx"] <= 60
    assert "60 is not allowed" in run.json["message"]
    run = cli("solve", "problem4", "--accuracy", "1e-7", "--n", 45)
    assert run.status == 1 and "; extrapolated to " in run.out and ", this grid's own is " in run.out
    run = cli("solve", "problem1", "--quantity", "load")
    assert run.status == 2
    assert "--accuracy TOL is needed" in run.err


@pytest.mark.parametrize("ranks", [2, 3])
def test_ranks(cli, ranks):
    one = cli("solve", "problem4", "--accuracy", "2e-2", "--json").json
    more = cli("solve", "problem4", "--accuracy", "2e-2", "--json", ranks=ranks).json
    assert more["converged"]
    assert [level["nx"] for level in more["levels"]] == [level["nx"] for level in one["levels"]]
    assert more["load"] == pytest.approx(one["load"], rel=1e-6)


def test_rings_whose_edges_lie_on_points():
    """All grids of a ladder are multiples of the meshes that put every groove's edge on a point, where so few will do."""
    scene = load_scene("two_groove_journal")
    first, unit = round_ring(scene, (89, 5))
    assert (first, unit) == ((90, 5), 18)  # edges at 0, 20, 180, 200 degrees
    assert all(finer(first, (90.0, 6.0), k, unit)[0] % 18 == 0 for k in range(8))
    assert [finer(first, (90.0, 6.0), k, unit)[0] for k in (2, 4)] == [180, 360]
    assert round_ring(scene, (89, 5), finest=(89, 5)) == ((89, 5), 1)
    odd = load_scene("two_groove_journal", {"groove_deg": 13.7})
    assert round_ring(odd, (89, 5)) == ((89, 5), 1)
    assert round_ring(load_scene("journal"), (89, 19)) == ((89, 19), 1)


def test_a_load_on_a_ring_with_grooves_to_a_per_cent():
    """Edges 30 degrees wide at 80, 200 and 310: 288 points around, where grids that miss the edges take 712."""
    scene = load_scene("two_groove_journal", {"groove_deg": 30, "grooves_deg": [80, 200, 310]})
    with solve(scene, accuracy=1e-2) as found:
        assert found.converged and found.problem.grid.shape == (288, 15)
        assert abs(found.load / 1554.3 - 1) < 1e-2  # limit of 720 and 1440 points around


@pytest.mark.parametrize("name", ["lemon_journal", "two_groove_journal"])
def test_rings_of_several_sizes_are_compared_place_by_place(name):
    """What the pressure changes by falls by second order: beside grids that begin half a mesh apart it was of first order, and
    the estimate tenfold."""
    with solve(name, accuracy=1e-3) as solution, solve(name, nx=1440, ny=95) as fine:
        assert solution.converged and solution.problem.grid.shape[0] <= 1100
        assert abs(solution.load / fine.load - 1.0) <= solution.settings["accuracy_estimate"]
        sizes, seen = ([level[key] for level in solution.levels] for key in ("nx", "estimate"))
    assert seen[2] < 1.5 * seen[1] * (sizes[1] / sizes[2]) ** 2


def test_searches_go_on_from_the_grid_before(monkeypatch):
    guesses = []
    first = attitude.half_film_attitude
    monkeypatch.setattr(attitude, "half_film_attitude", lambda e: guesses.append(e) or first(e))
    with solve("two_groove_journal", accuracy=1e-2) as solution:
        assert solution.converged and len(solution.levels) >= 3 and len(guesses) == 1


def test_viscosity_by_shear_in_films_between_grooves():
    """The unit of their pressures is one number, whatever the viscosity from point to point."""
    shear = {"law": "eyring", "tau_0": 1.4e4}
    scene = load_scene("dam_journal", {"nx": 84, "ny": 12, "attitude_deg": 76.5, "eccentricity": 0.35, "shear": shear})
    with solve(scene, accuracy=0.03, model="full") as found:
        assert found.converged


def test_a_film_that_carries_nothing_ends_early_and_says_so():
    """A dimple in a flat film, no pressure around: its load is rounding, which no grid brings to a per cent."""
    film = [{"shape": "constant", "h": 5e-6}, {"shape": "dimples", "depth": 3e-6, "columns": 1, "rows": 1, "size": 3e-3}]
    data = {"family": "bearing", "dimension": 2, "L": 0.01, "width": 0.01, "U": 1.0, "n": 60, "film": film}
    with solve({**data, "fluid": {"mu": 0.01, "p_supply": 0.0}}, accuracy=1e-2) as found:
        assert abs(found.load) < 1e-9
        assert found.problem.grid.size < 300**2
        assert found.converged or (found.outcome == "accuracy_not_reached" and "rounding" in found.message)


RING_AT_REST = {
    "U": -1.06,
    "n": 3,
    "scheme": "face",
    "fluid": {"mu": 1.5e-3, "density": "dowson-higginson"},
    "sides": {"west": "periodic", "east": "periodic"},
    "supply": [{"x": [0.0023, 0.0025], "restrictor": "orifice", "p_s": 7e5, "K": 5e-9, "backflow": True}],
}


@pytest.mark.parametrize("more", [{"scheme": "face"}, {"scheme": "upwind"}, RING_AT_REST], ids=["face", "upwind", "ring"])
def test_a_line_in_which_nothing_happens_ends_early_and_says_so(more):
    data = {"family": "bearing", "dimension": 1, "L": 0.004, "U": 18.0, "n": 2, "fluid": {"mu": 0.03}}
    with solve({**data, "film": [{"shape": "constant", "h": 2e-5}], **more}, accuracy=1e-2) as found:
        assert abs(found.load) < 1e-9
        assert len(found.levels) == 2
        assert found.outcome == "accuracy_not_reached"


def test_upwind_is_of_first_order():
    """Its textures' loads go up and down by per cents from grid to grid: two that agree by chance once told 0.6 % of 5."""
    sizes = [10.0, 20.0, 40.0, 80.0]
    best = estimate([3.0 + 1.0 / size for size in sizes], [0.0] * 4, sizes, film=Traits(order=1.0))
    assert best.extrapolated and best.value == pytest.approx(3.0, abs=1e-12)
    with solve("textured_slider", accuracy=1e-2, finest=(500, 500)) as solution:
        assert solution.outcome == "accuracy_not_reached" and solution.settings["accuracy_estimate"] > 0.02


def test_no_value_on_two_grids_is_no_nothing():
    """A dam's pressure is far greater than what so small an eccentricity turns: there is no attitude on any of three grids."""
    found = solve(load_scene("dam_journal", {"eccentricity": 0.2, "L_over_D": 0.3, "groove_deg": 34.6}), accuracy=1e-2)
    assert found.outcome is Outcome.LOAD_NOT_CARRIED
    assert len(found.levels) == 3
