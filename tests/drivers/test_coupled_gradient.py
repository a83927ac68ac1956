"""Derivatives of films with effects by the implicit function: differences of solves, Taylor's test, bad input."""

from dataclasses import replace

import numpy as np
import pytest

from lcp_lube import load_scene, solve
from lcp_lube.drivers.derivatives.coupled_gradient import CoupledGradient
from lcp_lube.drivers.derivatives.gradient import film_fields, gradients
from lcp_lube.drivers.derivatives.transposed import CoupledFilm
from lcp_lube.problems.film.contact import areas
from lcp_lube.problems.film.views import LiftedFilm
from lcp_lube.scenes.effects.named import without
from lcp_lube.scenes.values import values_of, with_values

TIGHT = {"eps1": 1e-11, "max_it": 200}
# No two alike, and no edge on a point.
PLACES = zip((43.0, 137.0, 224.0, 316.0), (51.0, 47.0, 44.0, 53.0), (61e-3, 57e-3, 53e-3, 67e-3), strict=True)
RECESSES = {
    f"supply.{k}.{key}": value
    for k, place in enumerate(PLACES, start=1)
    for key, value in zip(("angle_deg", "extent_deg", "length"), place, strict=True)
}


def answer(scene, near=None):
    solution = solve(scene, start=near, stopping=TIGHT)
    assert solution.converged, solution.message
    return solution


def off(scene, solution, quantities, keys=None, step=2e-4):
    """Those derivatives that differ from differences of solves."""
    worst = {}
    for one in (found := gradients(scene, solution, quantities, keys)):
        assert one.value == pytest.approx(solution.numbers[one.quantity], rel=1e-6)
    for key in found[0].gradient:
        a = values_of(scene)[key]
        d = step * (abs(a) or {"h_offset": 2e-5}.get(key, 1e5))
        told = {}
        for k in (-1, 1):
            with answer(with_values(scene, {key: a + k * d}), solution) as other:
                told[k] = other.numbers
        for one in found:
            slope = (told[1][one.quantity] - told[-1][one.quantity]) / (2.0 * d)
            error = abs(one.gradient[key] - slope) - 2e-11 * abs(one.value) / d
            if error > 1e-6 * abs(slope):
                worst[key, one.quantity] = error / abs(slope)
    return worst


def test_every_number_of_a_pad():
    """Heat, shear thinning, a liner that gives way, Barus' law and density, all at once."""
    scene = load_scene("lined_pad", n=60)
    with answer(scene) as solution:
        keys = [key for key in values_of(scene) if not key.startswith("sides") and key not in ("fluid.p_c", "shear.tau_0")]
        keys = [key for key in keys if key not in ("temperature.exchange", "shear.least")]  # least values, from above alone
        assert not off(scene, solution, ["load", "p_max", "friction", "temperature_max"], keys)


def test_a_wall_that_moves_to_smaller_x():
    """By equations of the mirror image: its numbers are those of the film with -U, and dQ/dh is turned back with the fields."""
    ends = {"film.linear.h_start_um": 20, "film.linear.h_end_um": 40, "U": -4.0, "p_in": 3e5}
    scene = load_scene("lined_pad", {"n": 24, **ends})
    image = load_scene("lined_pad", {"n": 24, "p_out": 3e5})
    names = ["load", "friction", "temperature_max"]
    with answer(scene) as solution, answer(image) as other:
        assert not off(scene, solution, names, ["U", "film.linear.h_end", "temperature.T_in", "p_in"])
        fields, others = film_fields(scene, solution, names), film_fields(image, other, names)
        for name, sign in zip(names, (1.0, -1.0, 1.0), strict=True):
            assert np.abs(fields[name][::-1] - sign * others[name]).max() < 1e-5 * np.abs(fields[name]).max(), name


def test_by_the_level_of_a_film_that_is_nearly_all_cavitated():
    """A change of the level hardly moves its equations: one that did would be so large that they bend."""
    ends = {"film.linear.h_start_um": 17.4, "film.linear.h_end_um": 58.2, "U": 7.3, "L_mm": 51.5, "p_in": 3e5, "p_out": 0.0}
    scene = without(load_scene("lined_pad", {"n": 48, "fluid.barus": 0.0, **ends}), ["temperature", "elastic"])
    with answer(scene) as solution:
        assert not off(scene, solution, ["load"], ["h_offset"], step=1e-5)


def test_through_a_journals_place():
    """The eccentricity and the attitude at which a load is carried, oil carried over in grooves."""
    scene = load_scene("adiabatic_journal", {"n": 40, "balance.tol": 1e-11})  # of the differences
    keys = ["temperature.carry_over"]
    with answer(scene) as solution:
        assert not off(scene, solution, ["eccentricity", "attitude_deg", "temperature_max", "friction"], keys)


def test_in_the_plane():
    heat = {"oil": "ISO VG 32", "T_in": 313.0}
    scene = load_scene("two_groove_journal", nx=36, ny=5, temperature=heat, p_groove=2e5, attitude_deg=40.0)
    with answer(scene) as solution:
        assert not off(scene, solution, ["load", "temperature_max", "friction"], ["eccentricity", "temperature.T_in"])


def test_taylor():
    """What is left falls by four when the step is halved."""
    scene = load_scene("lined_pad", n=60)
    with answer(scene) as solution:
        (found,) = gradients(scene, solution, ["load"], ["film.linear.h_end"])
        left = []
        for d in (4e-7, 2e-7, 1e-7):
            with answer(with_values(scene, {"film.linear.h_end": 2e-5 + d}), solution) as other:
                left.append(abs(other.load - solution.load - d * found.gradient["film.linear.h_end"]))
    assert np.log2(np.array(left[:-1]) / left[1:]) == pytest.approx(2.0, abs=0.1)


PAD = {"nx": 13, "ny": 11, "fluid.barus": 0.0}
HEAT = {"temperature": {"beta": 0.02, "T_in": 320.0, "model": "effective"}, "roelands": {"z": 0.6}}
SOFT = {"half_space": {"E_reduced": 2e10}, "asperity": {"sigma": 5e-6, "E_reduced": 1e11}}
FED = {**RECESSES, "nx": 25, "ny": 5, "attitude_deg": 20.0, "roughness": {"sigma": 2e-6}}
ROUND = {"nx": 21, "ny": 21, "film.2.form": "dome", "film.2.columns": 2, "film.2.rows": 2, "film.2.size_mm": 3.0}


@pytest.mark.parametrize(
    ("name", "changes", "quantities"),
    [
        ("lined_pad", {"n": 24}, ["load", "p_max", "friction", "temperature_max"]),
        ("pocketed_pad_2d", {**PAD, **HEAT}, ["friction", "flow_east", "temperature_out"]),
        ("pocketed_pad_2d", {**PAD, **SOFT}, ["load", "asperity_load"]),
        ("hybrid_journal", FED, ["load", "supply_flow_2"]),
        ("dimpled_pad", {**ROUND, "roughness": {"sigma": 1e-7}}, ["load", "friction"]),
    ],
)
def test_the_films_own_derivative(name, changes, quantities):
    """Of a film that is thicker everywhere; pressures of supplies follow."""
    scene = load_scene(name, changes)
    with answer(scene) as solution:
        fields, problem = film_fields(scene, solution, quantities), solution.problem
        keys = {"h_offset": 1.0}
        if name == "hybrid_journal":  # with the journal where it is
            keys = {"clearance": 1.0, "eccentricity": -scene.eccentricity / scene.clearance}
        for one in gradients(scene, solution, quantities, list(keys)):
            expected = sum(part * one.gradient[key] for key, part in keys.items())
            assert fields[one.quantity].ravel() @ areas(problem.grid).ravel() == pytest.approx(expected, rel=1e-6), one.quantity


def test_of_a_film_with_effects_that_is_changed_here_and_there():
    """By what equations and numbers change by along a film's change that is another at each point, and one solve with it."""
    scene, names = load_scene("lined_pad", n=24), ["load", "friction", "temperature_max"]
    with answer(scene) as solution:
        gradient = CoupledGradient(scene, solution, names)
        base, model = gradient.loop.base, gradient.loop.frozen.constant
        grid, here = base.grid, (np.zeros(gradient.n), gradient.x)
        dh, R, told = np.cos(np.arange(24.0)) * 1e-5 * base.scheme.h.min(), [], []
        for d in (dh, -dh):
            film = replace(model, gap=LiftedFilm.of(model.gap, grid, d)).build(grid.shape, grid.petsc_comm, grid)
            R.append(gradient._system(*here, film)[0])
            told.append(gradient._numbers(gradient.loop, *here, film))
        along = gradient._numbers_along(gradient._settled(0.5 * (R[1] - R[0]), 0.0, 0.0))[0]
        film = CoupledFilm(gradient)
        for name in names:
            expected = along[name] + 0.5 * (told[0][name] - told[1][name])
            assert np.dot(film.field(name) * areas(grid).ravel(), dh) == pytest.approx(expected, rel=1e-6)


def test_the_command_on_ranks_and_bad_input(cli, tmp_path):
    """A number that is zero has a step that is seen: 1 K more by exchange is 1e-12 of the load, and its derivative is not that
    of rounding; what has no effect has none."""
    keys, quantities = ["U", "temperature.T_in", "temperature.exchange", "shear.least"], ["load", "temperature_max"]
    words = ("sensitivity", "lined_pad", "--n", "40", "--quantity", ",".join(quantities), "--by", ",".join(keys), "--json")
    found = cli(*words, "--output", tmp_path / "film.npz", ranks=2, timeout=300).json
    assert found["elasticity"]["temperature.T_in"] < -5
    scene = load_scene("lined_pad", n=40)
    with solve(scene) as solution:
        both = gradients(scene, solution, quantities, keys)
        field = solution.film_gradient("load")
    assert field.shape == (40,)
    assert np.load(tmp_path / "film.npz")["dload_dh"] == pytest.approx(field, rel=1e-6, abs=1e-8 * np.abs(field).max())
    for one, told in zip(both, (found, *found["others"]), strict=True):
        assert told["gradient"] == pytest.approx(one.gradient, rel=1e-6)
    one, two = both[0].gradient, found["gradient"]
    assert two["temperature.exchange"] == pytest.approx(one["temperature.exchange"], rel=1e-8)
    assert one["shear.least"] == two["shear.least"] == 0.0
    loads = {}
    for exchange in (0.0, 50.0, 100.0):
        with answer(load_scene("lined_pad", {"n": 40, "temperature.exchange": exchange})) as solution:
            loads[exchange] = solution.load
    slope = (4.0 * loads[50.0] - loads[100.0] - 3.0 * loads[0.0]) / 100.0
    assert one["temperature.exchange"] == pytest.approx(slope, rel=1e-4)
    refused = cli("sensitivity", "lined_pad", "--n", "40", "--quantity", "temperature_least")
    assert refused.status == 2 and len(refused.lines) == 1 and "no derivative" in refused.lines[0]


def test_supplies_whose_pressures_follow():
    """Behind capillaries and by flow, with heat: the sources' own numbers too."""
    heat = {"oil": "ISO VG 32", "T_in": 313.0}
    scene = load_scene("hybrid_journal", {**RECESSES, "nx": 37, "ny": 7, "attitude_deg": 20.0, "temperature": heat})
    with answer(scene) as solution:
        quantities = ["load", "temperature_max", "supply_flow_2", "supply_p_1"]
        found = gradients(scene, solution, quantities, ["supply.1.K", "supply.2.p_s", "clearance"])
        for key, slopes in found[0].gradient.items():
            a, told = values_of(scene)[key], []
            for k in (-1, 1):
                with answer(with_values(scene, {key: a * (1 + 1e-4 * k)}), solution) as other:
                    n = other.numbers
                    told.append(np.array([n["load"], n["temperature_max"], n["supply_flow"][1], n["supply_p"][0]]))
            slopes = (told[1] - told[0]) / (2e-4 * a)
            least = 2e-6 * np.abs(told[0] / a)  # sources and film agree to 1e-10 of a flow
            for one, slope, small in zip(found, slopes, least, strict=True):
                assert one.gradient[key] == pytest.approx(slope, rel=1e-6, abs=small), (one.quantity, key)


def test_of_a_very_soft_wall():
    """GMRES with the film's inverse alone breaks down there; with the wall's answer to the film's beside it it does not."""
    film = [{"shape": "sinusoid", "h_min": 8e-6, "h_max": 3e-5}]
    data = {"family": "bearing", "dimension": 2, "L": 0.02, "width": 0.025, "U": 1.3, "nx": 60, "ny": 24, "film": film}
    data |= {"fluid": {"mu": 0.08, "p_supply": 1e5}, "elastic": {"compliance": 2e-10}}
    loads = []
    for compliance in (1.999e-10, 2.001e-10):
        with solve({**data, "elastic": {"compliance": compliance}}, model="full") as s:
            loads.append(s.load)
    with solve(data, model="full") as s:
        found = s.gradient("load", ["elastic.compliance"])["elastic.compliance"]
    assert found == pytest.approx((loads[1] - loads[0]) / 2e-13, rel=1e-4)


def slopes_to_both_sides(scene, solution, key, d):
    f = {0: solution.load}
    for k in (-2, -1, 1, 2):
        with answer(with_values(scene, {key: values_of(scene)[key] + k * d}), solution) as other:
            f[k] = other.load
    return [side * (-1.5 * f[0] + 2.0 * f[side] - 0.5 * f[2 * side]) / d for side in (-1, 1)]


def test_kinks_and_jumps_are_told():
    """A pocket's edges on points: by the first a load has a slope to each side, by the second it jumps."""
    heat, edges = {"beta": 0.03, "T_in": 320.0}, ["film.pocket.x.1", "film.pocket.x.2"]
    scene = load_scene("pocketed_pad", n=49, temperature=heat, elastic={"compliance": 1e-13})
    with answer(scene) as solution:
        (one,) = gradients(scene, solution, ["load"], [*edges, "fluid.mu"])
        below, above = slopes_to_both_sides(scene, solution, edges[0], 1e-7)
        onto, behind = slopes_to_both_sides(scene, solution, edges[1], 1e-7)
    assert one.gradient[edges[0]] == pytest.approx(0.5 * (below + above), rel=1e-5)
    assert one.one_sided == {edges[0]: pytest.approx(abs(above - below), rel=1e-3), edges[1]: np.inf}
    assert abs(onto) > 20 * abs(behind)


def test_cells_about_to_change_are_counted_with_effects():
    """A film at rest that no pressure fills: p = r = 0 everywhere."""
    scene = load_scene("problem1", n=21, U=0.0, roughness={"sigma": 1e-6})
    with solve(scene) as solution:
        (one,) = gradients(scene, solution, ["pressure_integral"], ["p_a"])
    assert one.switching == 21 and one.switching_gap >= 0.0


def test_lines_of_points_that_are_laid_anew_go_with_the_edges():
    """Edges on even lines: a little further the lines are others; a wall that hardly gives way, and a stiff one."""
    scene, keys = load_scene("pocketed_pad_2d", {"nx": 59, "ny": 19, "fluid.barus": 0.0}), ["film.pocket.x.1", "L"]
    with solve(scene) as stiff, solve(load_scene(scene, elastic={"compliance": 1e-19}), model="full") as soft:
        (one,) = gradients(scene, stiff, ["load"], keys)
        (two,) = gradients(soft.solved_scene, soft, ["load"], keys)
    assert two.one_sided == one.one_sided == dict.fromkeys(keys, np.inf)
    assert two.gradient == pytest.approx(one.gradient, rel=1e-4)
