"""Derivatives of every quantity by every number of every bearing scene: differences of solves, laws, ranks, bad input."""

import contextlib
import json
import math

import numpy as np
import pytest

from lcp_lube import InputError, load_scene, registry, solve
from lcp_lube.cli.arguments import parse
from lcp_lube.cli.main import run
from lcp_lube.drivers import supply_search
from lcp_lube.drivers.derivatives import adjoint as adjoint_module
from lcp_lube.drivers.derivatives import near_films
from lcp_lube.drivers.derivatives.adjoint import Adjoint
from lcp_lube.drivers.derivatives.film_gradient import FilmGradient, areas
from lcp_lube.drivers.derivatives.goal_error import finer_shape, goal_error
from lcp_lube.drivers.derivatives.gradient import gradients
from lcp_lube.drivers.loads import attitude
from lcp_lube.drivers.motions import linearised
from lcp_lube.problems.film import slopes
from lcp_lube.problems.film.known import known_fields
from lcp_lube.scenes.values import key_of, values_of, with_values

# No two alike: lines are dealt to the stretches between edges, and equal stretches would take turns.
PLACES = zip((43.0, 137.0, 224.0, 316.0), (51.0, 47.0, 44.0, 53.0), (61e-3, 57e-3, 53e-3, 67e-3), strict=True)
RECESSES = {
    f"supply.{k}.{key}": value
    for k, place in enumerate(PLACES, start=1)
    for key, value in zip(("angle_deg", "extent_deg", "length"), place, strict=True)
}
# Grids on which no edge of a film lies on a point or a face.
SMALL = {
    "problem1": {"n": 40},
    "problem2": {"n": 40, "p_b": 1.3e6},
    "problem3": {"n": 40, "p_b": 1.3e6},
    "problem4": {"n": 14, "p_side": 1e4},
    "pocketed_pad": {"n": 42},
    "parabolic_slider": {"n": 40},
    "long_journal": {"n": 47},
    "journal": {"nx": 36, "ny": 9},
    "two_groove_journal": {"nx": 36, "ny": 5},
    "ring_journal": {"nx": 36, "ny": 5},
    "lemon_journal": {"nx": 36, "ny": 5},
    "misaligned_journal": {"nx": 36, "ny": 5},
    "hybrid_journal": {"nx": 37, "ny": 7} | RECESSES,
    "tapered_land": {"nx": 20, "ny": 7},
    "dimpled_pad": {"nx": 25, "ny": 11},
    "textured_slider": {"K": 1},
    "rough": {"n": 21},
    "pocketed_pad_2d": {"nx": 22, "ny": 11},
}
TOL, STEP = 1e-6, 2e-5
FEW = ("mu", "fluid.mu", "U", "L", "D", "h_min", "film.pocket.depth", "film.dimples.size", "fluid.barus", "p_b", "clearance")


@pytest.fixture(autouse=True)
def exact_attitudes(monkeypatch):
    monkeypatch.setattr(supply_search, "TOLERANCE", 1e-13)
    monkeypatch.setattr(attitude, "TOLERANCE", 1e-12)  # differences of solves are to be good to many digits
    monkeypatch.setattr(attitude, "PART", 1e-4)


def solved(name, **changes):
    scene = load_scene(name, {**SMALL[name], **changes})
    return scene, answer(scene)


def answer(scene, near=None):
    law = scene.model.law is not None
    solution = solve(scene, method="active-set", start=near, stopping={"eps1": 1e-12 if law else 1e-8})
    assert solution.converged, solution.message
    return solution


def numbers(scene, near=None):
    """All numbers with a derivative, of a solve."""
    solution = answer(scene, near)
    adjoint = Adjoint(scene, solution, [])
    found = adjoint.equations.report(adjoint.numbers) | {key: adjoint.value(key) for key in adjoint.found}
    adjoint.destroy()
    solution.destroy()
    return found


def by_solves(scene, near, key, value, step):
    """Central differences; of third order to one side where the other has no values."""

    def at(k):
        return numbers(with_values(scene, {key: value + k * step}), near)

    try:
        low, high = at(-1), at(1)
        return {q: (high[q] - low[q]) / (2 * step) for q in low}
    except InputError:
        pass
    for side in (1, -1):
        try:
            v = [at(side * k) for k in range(4)]
        except InputError:
            continue
        return {q: side * (-11 * v[0][q] + 18 * v[1][q] - 9 * v[2][q] + 2 * v[3][q]) / (6 * step) for q in v[0]}
    raise AssertionError(f"{key} has no values on either side")


def compare(scene, solution, keys=None, step=STEP, switching=False):
    """All derivatives but those with two sides, against differences of solves; switching: cells may stand at their front."""
    adjoint = Adjoint(scene, solution, [])
    report = adjoint.equations.report(adjoint.numbers)
    values = {**values_of(adjoint.scene), **({"balance.load": scene.balance.load} if scene.balance is not None else {})}
    problem = solution.problem
    # What a difference of solves knows of a number that is small beside the terms it is made of.
    flow = abs(problem.U) * report["min_h"] * (problem.grid.lengths[-1] if problem.grid.dim == 2 else 1.0)
    sizes = {name: flow for name in report if "flow" in name or "leakage" in name}
    sizes |= {
        name: abs(report["pressure_integral"]) * max(problem.grid.lengths) for name in report if name.startswith("moment")
    }
    sizes |= {"force_y": abs(report["pressure_integral"])}
    found = gradients(scene, solution, [*report, *adjoint.found], keys)
    off = []
    for key in found[0].gradient:
        if key == "fluid.barus" and known_fields(problem) is not None:
            continue  # numbers of a line are free of the grid's error, those of a fluid with a law are not: at 0 they part
        scale = abs(values[key]) or adjoint.scale(key)
        slopes = by_solves(scene, solution, key, values[key], step * scale)
        for one in found:
            if one.quantity.startswith("supply_misfit"):
                continue  # which is 0
            name, ours = one.quantity, one.gradient[key]
            noise = (
                5e-12 * max(abs(report[name] if name in report else adjoint.value(name)), sizes.get(name, 0.0)) / (step * scale)
            )
            if switching and one.switching:  # the difference is the mean of both sides', which part by no more than is told
                largest = max(map(abs, filter(None, one.elasticity.values())), default=1.0)
                noise += one.switching_gap * largest * abs(one.value) / scale
            if key not in one.one_sided and not abs(ours - slopes[name]) <= TOL * abs(slopes[name]) + noise:
                off.append((name, key, ours, slopes[name], noise))
    adjoint.destroy()
    assert not off
    return found


@pytest.mark.parametrize("name", SMALL)
def test_every_number_by_every_number(name):
    scene, solution = solved(name)
    few = ("clearance", "D", "speed_rpm", "supply.1.extent_deg", "supply.1.length", "supply.1.K", "supply.1.p_s")
    found = compare(scene, solution, few if name == "hybrid_journal" else None)
    assert found[0].switching == 0
    values = solution.numbers
    for one in found:
        if values.get(one.quantity) is not None:
            assert one.value == pytest.approx(values[one.quantity], rel=1e-9, abs=1e-9 * abs(values["pressure_integral"]))


@pytest.mark.parametrize("seed", [4, 13, 53, 82, 89, 107])
def test_scenes_with_other_numbers(seed):
    """Four numbers of a scene drawn anew, two others as parameters: tops between points and sides, ties, whatever comes."""
    rng = np.random.default_rng(seed)
    name = list(SMALL)[seed % len(SMALL)]
    scene = load_scene(name, SMALL[name])
    values = values_of(scene)
    for key in rng.permutation([key for key, value in values.items() if value])[:4]:
        with contextlib.suppress(InputError):  # not every number may be any
            scene = with_values(scene, {key: values[key] * math.exp(0.2 * rng.standard_normal())})
    compare(scene, answer(scene), [str(key) for key in rng.permutation(list(values))[:2]], 4e-6, switching=True)


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("pocketed_pad", {"balance.load": 30000.0, "balance.tol": 1e-11}),
        ("problem1", {"balance.load": 2e5, "balance.vary": "mu", "balance.range": [1e-3, 1.0], "balance.tol": 1e-11}),
        ("two_groove_journal", {"balance.load": 2000.0, "balance.tol": 1e-11}),
        ("problem2", {"U": -5.0}),
        ("pocketed_pad", {"fluid.barus": 1e-8, "fluid.density": "dowson-higginson", "U": -0.7}),
        ("dimpled_pad", {"sides.north": "symmetry", "sides.east": "closed"}),
        ("problem1", {"scheme": "upwind"}),
        ("problem2", {"scheme": "face", "mean_cubes": True, "U": 0.0}),
    ],
)
def test_through_what_was_found_and_what_stands_around_it(name, changes):
    """Balances, the implicit function theorem; turned films; fluids with laws; walls; other schemes."""
    scene = load_scene(name, {**SMALL[name], **changes})
    solution = answer(scene)
    few = [key for key in FEW if key in values_of(scene) and (scene.balance is None or key != scene.balance.vary)]
    found = compare(scene, solution, [*few, *(["balance.load"] if scene.balance else [])])
    if scene.balance is not None:
        load = next(one for one in found if one.quantity == "load")
        assert load.gradient["balance.load"] == pytest.approx(1.0) and not any(
            v for k, v in load.gradient.items() if k != "balance.load"
        )
        assert solution.gradient("load", ["balance.load"]) == {"balance.load": pytest.approx(1.0)}
    solution.destroy()


@pytest.mark.parametrize("name", ["problem1", "pocketed_pad", "journal", "dimpled_pad", "pocketed_pad_2d", "textured_slider"])
def test_the_films_own_derivative(name):
    """A film lifted everywhere by the same is h_offset; one lifted by a bump is met to second order (Taylor's test)."""
    scene, solution = solved(name)
    report = ["load", "friction", "p_max", "flow_west"]
    adjoint = Adjoint(scene, solution, report)
    film = FilmGradient(adjoint)
    grid = adjoint.equations.grid
    for name, one in zip(report, gradients(scene, solution, report, ["h_offset"]), strict=True):
        lifted = grid.reduce.dot(film.field(name), areas(grid).ravel())
        # Of a line the number's derivative is the film's, the field's that of the equations on this grid.
        rel = 1e-8 if adjoint.equations.constant.integrals is None else 2e-2
        assert lifted == pytest.approx(one.gradient["h_offset"], rel=rel, abs=1e-9 * abs(one.value) / 1e-6)
    adjoint.destroy()


def test_the_films_own_derivative_beside_a_supply():
    """Of a line, whose numbers are free of the grid's error: at the points it has one, of second order."""
    data = {"family": "bearing", "L": 0.1, "U": 5.0, "fluid": {"mu": 0.02, "p_supply": 1e5}}
    data |= {"film": [{"shape": "linear", "h_start": 4e-5, "h_end": 2e-5}]}
    data |= {"supply": [{"shape": "rectangle", "x": [0.045, 0.055], "p": 5e5}]}
    off = []
    for n in (99, 199):
        with solve(load_scene({**data, "n": n})) as s:
            lifted = s.problem.reduce.dot(s.film_gradient("load"), areas(s.problem.grid).ravel())
            off.append(lifted / s.gradient("load", ["h_offset"])["h_offset"] - 1.0)
    assert abs(off[0]) < 1e-3 and off[0] / off[1] == pytest.approx(4.0, rel=0.02)


def test_taylor():
    """The error of the linear forecast falls by four when the step is halved."""
    scene, solution = solved("pocketed_pad")
    key, value = "film.linear.h_end", scene.film[0].h_end
    slope = solution.gradient("load", [key])[key]
    here = numbers(scene)["load"]
    errors = []
    for step in (4e-4, 2e-4, 1e-4):
        errors.append(numbers(with_values(scene, {key: value * (1 + step)}))["load"] - here - slope * value * step)
    assert np.log2(np.abs(errors[:-1]) / np.abs(errors[1:])) == pytest.approx([2.0, 2.0], abs=0.05)


@pytest.mark.parametrize("name", ["problem1", "problem4", "long_journal"])
def test_the_scaling_law(name):
    """Without pressures at the sides p goes with mu U L/h^2: the sum of h dQ/dh is -2 loads, by keys and in the field."""
    scene, solution = solved(name, **({"p_side": 0.0, "n": 60} if name == "problem4" else {}))
    adjoint = Adjoint(scene, solution, ["load"])
    field, grid = FilmGradient(adjoint).field("load"), adjoint.equations.grid
    total = grid.reduce.sum(field * areas(grid).ravel() * solution.problem.scheme.h.ravel())
    assert total == pytest.approx(-2.0 * solution.load, rel=1e-2)
    (one,) = gradients(scene, solution, ["load"])
    keys = ["h_min", "h_max"] if name.startswith("problem") else ["psi"]
    assert sum(one.elasticity[key] for key in keys) == pytest.approx(-2.0, rel=1e-9)
    assert one.elasticity["mu"] == pytest.approx(1.0, rel=1e-9)
    adjoint.destroy()
    solution.destroy()


@pytest.mark.parametrize("least", [registry.SMALL, 0])
def test_a_layer_as_thick_as_the_land_it_comes_from(least, monkeypatch):
    """It fills the strip beside the pocket whatever the scene's numbers are: no kink of the friction, though one of its law."""
    for module in (near_films, slopes):
        monkeypatch.setattr(module, "SMALL", least)  # 0: films near by are sums over their faces
    data = {"family": "bearing", "dimension": 2, "n": 10, "L": 0.01, "width": 0.01, "U": 1.0, "fluid": {"mu": 0.02}}
    pocket = {"shape": "pocket", "depth": 8e-6, "x": [3e-4, 6.3e-3], "y": [4e-4, 9.7e-3]}
    data |= {"film": [{"shape": "constant", "h": 1e-5}, pocket]}
    scene = load_scene({**data, "sides": {"west": 0.0, "east": 1e5, "south": 0.0, "north": 0.0}})
    solution = answer(scene)
    keys = ["width", "film.pocket.depth", "film.pocket.y.2", "film.constant.h"]
    (friction,) = gradients(scene, solution, ["friction"], keys)
    for key in keys:
        value = values_of(scene)[key]
        difference = by_solves(scene, solution, key, value, STEP * value)["friction"]
        assert abs(friction.elasticity[key] - difference * value / friction.value) < TOL, key
    assert not friction.one_sided and not friction.uncertain
    solution.destroy()


def test_edges_on_points_have_a_derivative_to_each_side():
    # Its first edge on a point, the second on another; with scheme face the numbers of a line know edges to their place.
    scene = load_scene("pocketed_pad", n=49, scheme="nodal")
    solution = solve(scene)
    load, friction = gradients(scene, solution, ["load", "friction"], ["film.pocket.x.1", "fluid.mu"])
    assert load.one_sided["film.pocket.x.1"] > 0 and "fluid.mu" not in load.one_sided
    assert math.isfinite(friction.gradient["fluid.mu"])
    solution.destroy()


def test_edges_across_the_lines_have_no_derivative():
    """By the angle of spirals a load changes in steps: its chords have any sign. By their depth it has a slope."""
    scene = load_scene("spiral_groove", nx=40, ny=20)
    with solve(scene) as solution:
        (found,) = gradients(scene, solution, ["load"])
        assert {"angle_deg", "ratio", "seal"} <= set(found.held) and "on this grid" in found.held["angle_deg"]
        with pytest.raises(InputError, match="no derivative on this grid"):
            solution.gradient("load", ["angle_deg"])
        depths = {}
        for k in (-1, 1):
            with solve(with_values(scene, {"taper": scene.taper * (1 + 1e-4 * k)})) as other:
                depths[k] = other.load
    assert found.gradient["taper"] == pytest.approx((depths[1] - depths[-1]) / (2e-4 * scene.taper), rel=1e-6)


def test_round_rims_have_no_derivative(monkeypatch):
    """They are looked for at places between two points: by their size L has steps alone (a load was told to have slope 0)."""
    looks, own = [], Adjoint.lagrangians
    monkeypatch.setattr(Adjoint, "lagrangians", lambda self, scene, *more: looks.append(scene) or own(self, scene, *more))
    scene = load_scene("dimpled_pad", {"nx": 30, "ny": 29, "film.dimples.form": "round"})
    with solve(scene) as solution:
        (found,) = gradients(scene, solution, ["load"], ["film.dimples.size", "film.dimples.depth"])
    assert "on this grid" in found.held["film.dimples.size"] and set(found.gradient) == {"film.dimples.depth"}
    depths = [scene.film[1].depth for scene in looks]
    assert len(set(depths)) == 3  # the rims stay: no chords of many widths beside both sides


def test_where_lines_of_points_are_laid_anew_is_told():
    """By a recess's length edges part that shared a line of points; by its extent a line more lies in it than in others."""
    scene, key = load_scene("hybrid_journal", nx=90, ny=21), "supply.1.extent_deg"
    loads = {}
    with solve(scene) as solution:
        (found,) = gradients(scene, solution, ["load"], [key, "supply.1.angle_deg", "supply.1.length"])
        for part in (-2e-4, -1e-4, 0.0, 1e-4):
            with solve(with_values(scene, {key: 50.0 * (1 + part)})) as other:
                loads[part] = other.load
    behind = (3 * loads[0.0] - 4 * loads[-1e-4] + loads[-2e-4]) / (2e-4 * 50.0)
    assert found.gradient[key] == pytest.approx(behind, rel=1e-6)
    assert found.one_sided == {key: math.inf} and loads[1e-4] - loads[0.0] > 10 * (loads[0.0] - loads[-1e-4])
    assert "share a line of points" in found.held["supply.1.length"]


def test_even_lines_that_lie_on_edges_go_with_them():
    """Beside the scene's own value other lines are laid, at which a load jumps (a slope was told to be ten times too large)."""
    scene, key = load_scene("pocketed_pad_2d"), "film.pocket.x.1"  # 199 x 79, an edge on every 20th line
    with solve(scene) as solution:
        (found,) = gradients(scene, solution, ["load"], [key])
    ends = []
    for sign in (-1, 1):
        with solve(with_values(scene, {key: scene.film[1].x[0] * (1 + 1e-4 * sign)})) as other:
            ends.append(other.load)
    assert found.gradient[key] == pytest.approx((ends[1] - ends[0]) / (2e-4 * scene.film[1].x[0]), rel=1e-2)
    assert found.one_sided == {key: math.inf}


def test_cells_about_to_change_are_counted():
    """A film at rest without pressures: p = r = 0 everywhere; and two points that tie for the largest pressure."""
    scene = load_scene("problem1", n=21, U=0.0)
    solution = solve(scene)
    (one,) = gradients(scene, solution, ["pressure_integral"], ["p_a", "mu"])
    assert one.switching == 21 and one.gradient["mu"] == 0.0
    solution.destroy()
    symmetric = load_scene("problem4", n=14)
    tied = solve(symmetric, method="active-set")
    (one,) = gradients(symmetric, tied, ["p_max"], ["mu"])
    assert one.switching == 1 and one.elasticity["mu"] == pytest.approx(1.0, rel=1e-9)
    tied.destroy()


def test_keys():
    scene = load_scene("pocketed_pad")
    assert key_of(scene, "film.2.depth") == key_of(scene, "film.depth") == key_of(scene, "depth") == "film.pocket.depth"
    moved = with_values(scene, {"film.pocket.x.1": 2.5e-3, "film.pocket.x.2": 5.5e-3, "fluid.mu": 0.02})
    assert moved.film[1].x == (2.5e-3, 5.5e-3) and moved.fluid.mu == 0.02
    for text, message in (
        ("n", "a count"),
        ("film.pocket.x", "say which"),
        ("scheme", "no number"),
        ("fluid.nu", "nearest is fluid.mu"),
    ):
        with pytest.raises(InputError, match=message):
            key_of(scene, text)


@pytest.mark.parametrize(
    ("ranks", "name", "changes", "method", "keys"),
    [
        (3, "two_groove_journal", {"nx": 36, "ny": 11}, "auto", "mu,D,p_end"),
        (2, "dimpled_pad", {"nx": 75, "ny": 70}, "fas", "fluid.mu,film.dimples.depth,U"),  # lambda by multigrid, too
    ],
)
def test_ranks(cli, ranks, name, changes, method, keys):
    scene = load_scene(name, changes)
    with solve(scene, method=method) as solution:
        alone = gradients(scene, solution, ["load"], keys.split(","))[0].gradient
    words = [word for key, value in changes.items() for word in ("--set", f"{key}={value}")] + ["--method", method]
    together = cli("sensitivity", name, *words, "--by", keys, "--quantity", "load,friction", "--json", ranks=ranks)
    assert together.status == 0, together.err
    assert together.json["gradient"] == pytest.approx(alone, rel=5e-7)  # each lambda is found to 1e-7


def run_here(*words):
    """The command in this process: its checks, without a start of Python for each."""
    return run(parse(list(map(str, words))))


def test_the_command(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words = ("--nx", 33, "--ny", 15, "--plot", "a.png", "--output", "a.npz", "--errors", "e.png", "--json")
    assert run_here("sensitivity", "pocketed_pad_2d", *words) == 0
    data = json.loads(capsys.readouterr().out)
    assert {"quantity", "value", "gradient", "elasticity", "grid_error"} <= set(data)
    assert all((tmp_path / name).stat().st_size > 10_000 for name in ("a.png", "e.png"))
    assert np.load(tmp_path / "a.npz")["dload_dh"].shape == (15, 33)
    assert next(iter(data["elasticity"])) == max(data["elasticity"], key=lambda key: abs(data["elasticity"][key] or 0.0))
    assert (
        run_here("sensitivity", "journal", "--nx", 36, "--ny", 9, "--quantity", "friction_coefficient", "--plot", "b.png") == 0
    )
    assert "eccentricity" in capsys.readouterr().out and (tmp_path / "b.png").is_file()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("pocketed_pad", "--by", "film.pocket.depht"), "nearest is"),
        (("pocketed_pad", "--quantity", "iterations"), "derivatives are known of"),
        (("pocketed_pad", "--quantity", "fricton"), "nearest is friction"),
        (("bratu",), "gradients are of films"),
        (("squeeze",), "no derivatives in time through events"),
        (("pocketed_pad", "--plot", "a.npz"), "--plot"),
        (("pocketed_pad", "--errors", "a.npz"), "a.npz"),
        (("pocketed_pad", "--errors", "a.png"), "films in the plane"),
        (("hybrid_journal", "--by", "mu", "--errors", "a.png"), "without supplies"),
    ],
)
def test_bad_input(words, message):
    with pytest.raises(InputError, match=message):
        run_here("sensitivity", *words)


def test_bad_input_is_one_line(cli):
    done = cli("sensitivity", "pocketed_pad", "--by", "n")
    assert done.status == 2 and "a count, which has no derivative" in done.lines[0] and len(done.lines) == 1


def test_the_errors_of_cells_are_the_largest_pressures():
    """Most of it: reading it off the points adds the rest."""
    scene = load_scene("dimpled_pad", nx=79, ny=79)
    with solve(scene) as solution, solve(scene.with_shape(finer_shape(solution))) as finer:
        found = goal_error(scene, solution, finer, "p_max")
        truth = solve(scene, nx=319, ny=319)
        error = solution.p_max - truth.p_max
        truth.destroy()
        assert 0.3 < found.error / error < 3.0 and 0.5 < found.cells / found.error < 1.5
        assert reduced(found.field, solution) == pytest.approx(found.cells, rel=1e-9) and found.worst < 0.1


def test_the_errors_of_cells_of_a_ring():
    """Its finer one begins half a mesh elsewhere: what cells did was seven times the error then, with the other sign."""
    with solve("three_lobe_journal", n=180) as solution:
        scene = solution.solved_scene
        with solve(scene.with_shape(finer_shape(solution))) as finer:
            found = goal_error(scene, solution, finer, "p_max")
    assert 0.6 < found.cells / found.error < 1.2


def reduced(field, solution):
    return float(field.sum()) * solution.problem.grid.cell


@pytest.mark.parametrize(
    ("name", "halved", "limit"),
    [("dimpled_pad", False, {}), ("problem4", True, {}), ("problem4", True, {"DROP": 0.1}), ("dimpled_pad", False, {"FEW": 1})],
)
def test_large_films_have_the_same_adjoint(monkeypatch, name, halved, limit):
    """By multigrid, on half the width too, as by factors of the whole: to what its cycles end at. Those in single precision
    begin anew with what is left, and those in double precision take over where they do not get there."""
    pytest.importorskip("numba")
    from lcp_lube.solvers.fas import frozen

    for key, value in limit.items():
        monkeypatch.setattr(frozen, key, value)
    scene = load_scene(name, nx=70, ny=61)
    solution = solve(scene, method="fas") if not halved else solve(scene)
    assert (solution.settings["details"].get("reduction") == "mirror") is halved
    found = []
    for least in (10**9, 100):
        monkeypatch.setattr(linearised, "SMALL", least)
        monkeypatch.setattr(adjoint_module, "SMALL", least)
        monkeypatch.setattr(adjoint_module, "FEWER", least)
        adjoint = Adjoint(scene, solution, ["load", "friction", "flow_east", "flow_south"])
        found.append(dict(adjoint.lambdas))
        adjoint.destroy()
    for part, exact in found[0].items():
        assert found[1][part] == pytest.approx(exact, abs=5e-7 * np.abs(exact).max()), part
    solution.destroy()


@pytest.mark.parametrize(("name", "n"), [("problem4", 191), ("dimpled_pad", 255), ("journal", 360)])
def test_frictions_adjoint_begins_near(monkeypatch, name, n):
    """Cavities ask something of lambda too, which the coarser grids are told: they start it within some per cent."""
    pytest.importorskip("numba")
    from lcp_lube.solvers.fas import frozen

    answers, solved = [], frozen.Frozen._improved

    def heard(self, *given):
        start, settled = self.at.copy(), solved(self, *given)
        answers.append((start, self.at.copy(), settled))
        return settled

    monkeypatch.setattr(frozen.Frozen, "_improved", heard)
    scene = load_scene(name)
    scene = scene.with_shape((n, n * scene.shape[1] // scene.shape[0]))
    with solve(scene, method="fas") as solution:
        Adjoint(scene, solution, ["friction"]).destroy()
    start, (_, lam, settled) = answers[0][0], answers[-1]
    assert settled and np.linalg.norm(start - lam) < 0.06 * np.linalg.norm(lam)
