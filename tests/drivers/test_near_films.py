"""What a derivative needs of films near by, without their problems, is what their problems say."""

import numpy as np
import pytest
from cornered_films import own_derivatives

from lcp_lube import solve
from lcp_lube.drivers.derivatives import adjoint as adjoint_module
from lcp_lube.drivers.derivatives import near_films
from lcp_lube.drivers.derivatives.adjoint import Adjoint
from lcp_lube.drivers.derivatives.equations import Equations, fields_of
from lcp_lube.problems.film import slopes
from lcp_lube.problems.film.flows import SIDES
from lcp_lube.scenes.scene import load_scene
from lcp_lube.scenes.values import values_of, with_values

pytest.importorskip("numba")

SCENES = {
    "problem4": {"nx": 33, "ny": 20},  # nodal
    "upwind": {"scheme": "upwind"},
    "fed": {"nx": 33, "ny": 20},
    "law": {"nx": 33, "ny": 20, "fluid.barus": 1.2e-8, "fluid.density": "dowson-higginson"},
    "steps": {"nx": 31, "ny": 33},
    "cut": {"nx": 32, "ny": 30},
    "turned": {"U": -1.0},
    "journal": {"nx": 40, "ny": 9},
    "thrust": {},
    "hybrid": {"nx": 60, "ny": 13},
    "holes": {},
    "seam": {},  # a ring whose ends are of different heights
    "rims": {"nx": 30, "ny": 28, "film.dimples.form": "round"},
    "inlet": {},  # lines that rupture where they come in beside one that does not
}
HOLES = {"family": "bearing", "dimension": 2, "L": 0.06, "width": 0.04, "U": 1.5, "nx": 48, "ny": 34}
HOLES |= {"film": [{"shape": "linear", "h_start": 3e-5, "h_end": 2e-5}], "fluid": {"mu": 0.03, "p_supply": 1e4}}
HOLE = {"shape": "hole", "at": [0.019, 0.021], "diameter": 0.009, "p": 8e5}
HOLES["supply"] = [HOLE, {"shape": "rectangle", "x": [0.036, 0.047], "y": [0.012, 0.026], "flow": 4e-6}]
RING = {key: HOLES[key] for key in ("family", "dimension", "L", "width", "U", "nx", "ny", "film", "fluid")}
RING["sides"] = {"west": {"kind": "periodic"}, "east": {"kind": "periodic"}}
STEPS = {"family": "bearing", "dimension": 2, "L": 0.01, "width": 0.01, "U": 1.0, "nx": 31, "ny": 29, "fluid": {"mu": 0.01}}
EDGES = [{"shape": "step", "height": 2e-6, "at": 0.004}, {"shape": "step", "height": -1e-6, "at": 0.0031, "along": "y"}]
EDGES += [{"shape": "pocket", "depth": 2e-6, "x": [0.0061, 0.0083]}]  # edges both ways, and no corner of a recess
STEPS |= {"film": [{"shape": "constant", "h": 4e-6}, *EDGES], "sides": dict.fromkeys(SIDES, 1e5)}
FED_FILM = [{"shape": "linear", "h_start": 5e-6, "h_end": 4e-6}, *EDGES]
FED = {"fluid": {"mu": 0.01, "p_supply": 1e5}, "sides": {}, "film": FED_FILM}
OPENS = [{"shape": "parabola", "h_max": 4e-6, "h_min": 9e-6}]
BASES = {
    "steps": (STEPS, {}),
    "upwind": ("problem4", {"nx": 33, "ny": 20}),
    "fed": ({**STEPS, **FED}, {}),
    "cut": (STEPS, {}),
    "turned": (STEPS, {}),
    "law": ({**STEPS, **FED}, {}),
    "thrust": ("tapered_land", {"nx": 30, "ny": 17}),
    "hybrid": ("hybrid_journal", {}),
    "holes": (HOLES, {}),
    "seam": (RING, {}),
    "rims": ("dimpled_pad", {}),
    "inlet": ({**STEPS, "film": OPENS, "sides": {"north": {"p": 2e5}}}, {}),
}


def made(name):
    base, start = BASES.get(name, (name, {}))
    return load_scene(base, **{**start, **SCENES[name]})


@pytest.mark.parametrize("name", SCENES)
def test_films_near_by_have_the_lagrangians_of_their_problems(monkeypatch, name):
    monkeypatch.setattr(near_films, "SMALL", 1)
    scene = made(name)
    with solve(scene, reduction=False) as solution:
        more = ["friction_torque"] if name == "thrust" else ["moment_y"]
        kinds = [kind for pair in solution.problem.grid.ends for kind in pair]
        more += [f"flow_{side}" for side, kind in zip(SIDES, kinds, strict=True) if kind == "open"]
        adjoint = Adjoint(scene, solution, ["load", "p_max", "friction", *more])
        sizes, found = np.array(list(adjoint.sizes.values())), 0
        for key, value in values_of(adjoint.scene).items():
            if not value:
                continue
            others = [with_values(adjoint.scene, {key: value * (1 + part)}) for part in (1e-5, -1e-5)]
            quick = [adjoint.near.lagrangians(other) for other in others]
            if quick[0] is not None:
                found += 1
                slow = [adjoint.lagrangians(other) for other in others]
                assert (np.abs((quick[0] - quick[1]) - (slow[0] - slow[1])) <= 1e-13 * sizes).all(), key
        for k, P in enumerate(adjoint.pressures):  # of supplies
            others = [[*adjoint.pressures[:k], P * (1 + part), *adjoint.pressures[k + 1 :]] for part in (1e-5, -1e-5)]
            quick, slow = ([of(adjoint.scene, P) for P in others] for of in (adjoint.near.lagrangians, adjoint.lagrangians))
            assert (np.abs((quick[0] - quick[1]) - (slow[0] - slow[1])) <= 1e-13 * sizes).all()
        adjoint.destroy()
    assert found >= 6


@pytest.mark.parametrize("name", SCENES)
def test_the_film_s_own_derivative_is_that_of_its_arrays(monkeypatch, name):
    scene, names = made(name), ["load", "friction", "friction_torque" if name == "thrust" else "p_max"]
    with solve(scene) as solution:  # some of them on half of the width
        fields = own_derivatives(monkeypatch, scene, solution, names)
    for field, other in zip(*fields, strict=True):
        assert field == pytest.approx(other, abs=1e-12 * np.abs(other).max())


@pytest.mark.parametrize("name", ["problem4", "upwind", "fed", "steps", "turned", "journal", "thrust"])
def test_drag_and_its_derivatives_in_one_pass_are_those_of_arrays(monkeypatch, name):
    scene, names = made(name), ["friction", "friction_torque"] if name == "thrust" else ["friction"]
    with solve(scene, reduction=False) as solution:
        equations, (p, r) = Equations(scene), fields_of(solution)
        arrays = [equations.slope(p, r, name) for name in names]
        monkeypatch.setattr(slopes, "SMALL", 1)
        passes, values = [equations.slope(p, r, name) for name in names], equations.numbers(p, r, names)
        equations.destroy()
    for name, one, other in zip(names, passes, arrays, strict=True):
        assert np.isnan(other.value)
        assert one.value == pytest.approx(values[name], rel=1e-13)
        for a, b in ((one.p, other.p), (one.r, other.r)):
            assert a == pytest.approx(b, abs=1e-12 * np.abs(b).max())


def test_drag_and_flows_build_no_problem(monkeypatch):
    monkeypatch.setattr(near_films, "SMALL", 1)
    scene, built = load_scene(STEPS, {"fluid.barus": 1e-8, "fluid.density": "dowson-higginson"}), []
    with solve(scene) as solution:
        adjoint = Adjoint(scene, solution, ["friction", "side_leakage"])
        monkeypatch.setattr(adjoint, "lagrangians", built.append)
        for key in (key for key in values_of(scene) if not key.startswith("sides")):  # films full at the sides stay so
            adjoint.slopes(key)
        adjoint.destroy()
    assert not built


def test_a_load_that_nearly_cancels_has_an_adjoint_that_is_as_good(monkeypatch):
    film = [{"shape": "constant", "h": 5.2e-6}, {"shape": "dimples", "form": "square", "columns": 4, "rows": 3}]
    film[1] |= {"depth": 2.6e-6, "size": 3.9e-3}
    data = {"family": "bearing", "dimension": 2, "L": 0.048, "width": 0.0176, "U": 2.2, "film": film, "nx": 90, "ny": 60}
    scene, found = load_scene(data | {"fluid": {"mu": 0.022, "p_supply": 4.3e5}}), []
    with solve(scene, method="fas") as solution:
        for _ in range(2):
            adjoint = Adjoint(scene, solution, ["load"])
            keys = ("L", "U", "fluid.mu", "film.constant.h", "film.dimples.depth")
            found.append(np.array([adjoint.slopes(key)[0]["load"] * adjoint.value(key) for key in keys]))
            adjoint.destroy()
            monkeypatch.setattr(adjoint_module, "FEWER", 10**9)  # factors
            monkeypatch.setattr(adjoint_module, "SMALL", 10**9)
        load, carried = solution.numbers["load"], solution.numbers["pressure_integral"]
    assert abs(load) < 0.02 * carried
    # Elasticities, of which one is small itself: 2e-7 on some processors, 5e-6 where lambda is as good as of other loads.
    assert np.abs(found[0] - found[1]).max() <= 1e-6 * abs(load)


def test_a_fluid_that_grows_thicker_with_pressure_is_told_by_the_adjoint_s_own_equation(monkeypatch):
    monkeypatch.setattr(near_films, "SMALL", 1)
    slopes = []
    with solve(load_scene(RING)) as solution:
        for slight in (1e-2, -1.0):
            monkeypatch.setattr(near_films, "SLIGHT", slight)
            slopes.append(solution.gradient("load", "fluid.barus")["fluid.barus"])
    assert slopes[0] == pytest.approx(slopes[1], rel=1e-8)


def test_a_supply_of_a_fluid_with_a_law_is_given_a_pressure_and_no_q(monkeypatch):
    """By exp(b p) = 1.04 the derivatives were too large."""
    monkeypatch.setattr(near_films, "SMALL", 1)
    scene = load_scene(HOLES, {"fluid.barus": 1e-8, "supply.1.p": 4e6})
    with solve(scene) as solution:
        slope = solution.gradient("load", "supply.1.p")["supply.1.p"]
    loads = [solve(with_values(scene, {"supply.1.p": 4e6 + way}), stopping={"eps1": 1e-11}).load for way in (400.0, -400.0)]
    assert slope == pytest.approx((loads[0] - loads[1]) / 800.0, rel=1e-5)
