"""What the decision leaves out changes the quantity by less than the tolerance when it is solved for, over many scenes."""

from functools import cache

import numpy as np
import pytest

from lcp_lube import InputError, load_scene, solve
from lcp_lube.drivers.effects.decision import sentence
from lcp_lube.drivers.effects.look import FREE, PART, coarse_shape, first_shape

SLIDER = {"shape": "linear", "h_start": 4e-5, "h_end": 2e-5}
PAD = {"family": "bearing", "L": 0.1, "U": 5.0, "n": 999, "fluid": {"mu": 0.02, "p_supply": 1e5}, "film": [SLIDER]}
WIDE = {**PAD, "dimension": 2, "width": 0.08, "nx": 79, "ny": 39}
WARM, COOL = {"beta": 0.03, "T_in": 320.0}, {"beta": 1e-4, "T_in": 320.0}
FLUID = {"mu": 0.02, "p_supply": 1e5, "barus": 2e-8, "density": "dowson-higginson"}
CAVITY = [{"shape": "sinusoid", "h_min": 8e-6, "h_max": 2e-5}]
SCENES = {
    "all laws": {**PAD, "fluid": FLUID, "temperature": WARM, "shear": {"law": "eyring", "tau_0": 5e4}},
    "weak laws": {**PAD, "fluid": {**FLUID, "barus": 1e-11}, "temperature": COOL, "shear": {"law": "eyring", "tau_0": 1e7}},
    "cavity": {**PAD, "film": CAVITY, "fluid": FLUID, "temperature": WARM},
    "cavity, weak": {**PAD, "film": CAVITY, "U": 0.05, "fluid": FLUID, "temperature": WARM},
    "liner": {**PAD, "elastic": {"compliance": 1e-13}, "roughness": {"sigma": 4e-7}},
    "soft liner": {**PAD, "elastic": {"compliance": 2e-12}, "roughness": {"sigma": 3e-6}},
    "wide": {**WIDE, "fluid": FLUID, "temperature": WARM},
    "wide, slow": {
        **{**WIDE, "nx": 119, "ny": 47, "U": 0.02},
        **{"fluid": FLUID, "temperature": WARM, "elastic": {"compliance": 1e-12}},
    },
    "friction": {**WIDE, "fluid": FLUID, "temperature": COOL, "quantity": "friction"},
    "pocketed_pad_2d": {"scene": "pocketed_pad_2d", "nx": 119, "ny": 47},
    "balance": {**PAD, "fluid": FLUID, "temperature": COOL, "balance": {"load": 3e5}},
    "adiabatic_journal": {"scene": "adiabatic_journal", "n": 300},
    "lined_pad": {"scene": "lined_pad", "n": 999},
}


@cache
def answer(name, model):
    """The quantity, its value, and the model."""
    data = dict(SCENES[name])
    quantity = data.pop("quantity", None)
    scene = load_scene(data.pop("scene"), data) if "scene" in data else load_scene(data)
    with solve(scene, model=model) as s:
        assert s.converged, s.message
        found = s.settings.get("balance")
        return (found["value"] if found else s.numbers[quantity or "load"]), s.settings["model"]


@pytest.mark.parametrize("name", SCENES)
def test_what_is_left_out_does_not_count(name):
    value, model = answer(name, "auto")
    full, _ = answer(name, "full") if model["left_out"] else (value, None)
    assert value == pytest.approx(full, rel=model["tolerance"])
    assert all(abs(effect) < PART * model["tolerance"] for effect in model["left_out"].values())
    counted = [effect for name, effect in model["kept"].items() if effect is not None and name not in FREE]
    assert all(abs(effect) >= PART * model["tolerance"] for effect in counted)


@pytest.mark.parametrize("name", SCENES)
def test_first_order_is_near(name):
    """What each effect changes, against the solve with it and without: sign and size. Barus' law is there all the while."""
    found = answer(name, "auto")[1]["kept"]
    free = [one for one in found if one in FREE]
    plain, _ = answer(name, ",".join(free) or "least")
    for effect, told in found.items():
        alone, _ = answer(name, ",".join({*free, effect})) if effect not in free else (plain, None)
        plain_of = answer(name, "least")[0] if effect in free else plain
        assert np.log1p(told) == pytest.approx(np.log(alone / plain_of), rel=0.35, abs=1e-3), (effect, found)


def test_the_work_of_the_decision():
    """In parts of the solve's with all effects, which it spares or is spared of: on its own grid one transposed solve, which is
    about a film, or two where the answer is looked at; on a coarser one less than is promised."""
    for name, own in (("weak laws", True), ("cavity, weak", True), ("wide, slow", False), ("friction", False)):
        data = {key: value for key, value in SCENES[name].items() if key != "quantity"}
        with solve(data) as s, solve(data, model="full") as full:
            spared = full.settings["details"]["coupling_work"]
            mine = s.settings["details"].get("coupling_work", s.problem.unknowns)
            model = s.settings["model"]
            spent = model["share_of_work"] * mine
            assert model["left_out"] and spent <= (2 * full.problem.unknowns if own else 0.15 * spared)
            assert sentence(model).startswith("left out: ") and "%" in sentence(model)


def test_where_films_are_looked_at():
    assert first_shape((999,)) == (999,) and first_shape((40, 50)) == (40, 50)
    assert first_shape((9999,)) == (9999,) and first_shape((9999,), sought=True) == (600,)
    for shape in ((99999,), (400, 300), (4000, 8), (2047, 2047)):
        coarse = first_shape(shape)
        assert np.prod(coarse) <= max(0.05 * np.prod(shape), 1000) and coarse[-1] >= 6


def test_effects_are_left_out_and_kept():
    assert set(answer("weak laws", "auto")[1]["left_out"]) == {"density", "temperature", "shear"}
    strong = answer("all laws", "auto")[1]
    assert "temperature" in strong["kept"] and strong["kept"]["temperature"] < -0.05 and strong["kept"]["barus"] > 0


def test_effects_that_cancel():
    """To first order this viscosity changes nothing: more of it here is less of it there. To second order it counts."""
    scene = {**PAD, "viscosity": {"factor": "1 + 0.3*sin(62.83*x + 2.555)"}}
    with solve(scene) as s, solve(scene, model="least") as least:
        told = s.settings["model"]["kept"]["viscosity"]
        assert told == pytest.approx(s.load / least.load - 1.0, rel=0.05) and abs(told) > PART * 0.01


def test_an_area_on_a_coarse_grid():
    """It goes in parts of a cell there: a tenth of 1e-4 of it does not show, and nothing is left out for that."""
    scene = {**WIDE, "film": CAVITY, "viscosity": {"factor": "1 + 0.001*sin(60*x)"}}
    with solve(scene, quantity="cavitated_area", accuracy=0.02, finest=(79, 39)) as s:
        assert s.settings["model"]["kept"] == {"viscosity": None} and "cavitated_area" in s.settings["model"]["reason"]


def test_the_film_that_was_looked_at_is_the_first_of_the_loop():
    """It takes as many films, that one among them, as a loop that is told which effects count, and fewer of its own."""
    with solve(SCENES["all laws"]) as s, solve(SCENES["all laws"], model=",".join(s.settings["model"]["kept"])) as named:
        films = [one.settings["details"]["fluid_solves"] for one in (s, named)]
        assert films[0] == films[1] and s.load == pytest.approx(named.load, rel=1e-7)


def test_a_value_that_is_next_to_nothing():
    """The film as it is carries the load, the level that is found is next to 0: in parts of it all effects are huge."""
    film = [{"shape": "sinusoid", "h_min": 1.0558600561641131e-05, "h_max": 2.8870516946439532e-05}]
    pad = {"family": "bearing", "L": 0.13882698275020075, "U": 0.38099638231809113, "n": 777, "film": film}
    pad |= {"fluid": {"mu": 0.04989193546328417, "barus": 5.9e-11}, "temperature": {"T_in": 297.66, "beta": 1.66e-5}}
    with solve({**pad, "balance": {"load": 1.9009e5}}) as s:
        assert s.converged and not s.settings["model"]["left_out"] and abs(s.settings["balance"]["value"]) < 1e-7


def test_the_slope_of_a_load_that_was_found():
    """By what the search has seen, for the decision: as two films near it have it."""
    pad = {**PAD, "n": 99, "fluid": {"mu": 0.02, "p_supply": 1e5}, "balance": {"load": 3e5}}
    with solve(pad) as s:
        at, told = s.settings["balance"]["value"], s.settings["load_slope"]
    loads = []
    for level in (at - 1e-8, at + 1e-8):
        with solve({**pad, "balance": None, "h_offset": level}) as s:
            loads.append(s.load)
    assert told == pytest.approx((loads[1] - loads[0]) / 2e-8, rel=0.02) and told < 0.0


def test_a_load_is_sought_from_where_the_look_found_it():
    """On a coarse grid it is found without effects; what they change of it says where the search on the scene's own begins."""
    scene = {**SCENES["balance"], "n": 3999}
    with solve(scene) as s, solve(scene, model=",".join(s.settings["model"]["kept"])) as named:
        assert s.settings["model"]["grid"] == [600]
        found, told = (one.settings["balance"] for one in (s, named))
        assert found["solves"] < told["solves"] and found["value"] == pytest.approx(told["value"], rel=1e-5)


def test_least_and_named():
    plain = load_scene({**SCENES["cavity"], "fluid": {"mu": 0.02, "p_supply": 1e5}, "temperature": None})
    with solve(plain) as reference, solve(SCENES["cavity"], model="least") as least:
        assert least.load == pytest.approx(reference.load, rel=1e-9) and "model" not in reference.settings
    with solve(SCENES["cavity"], model="temperature, barus") as s:
        assert set(s.settings["model"]["left_out"]) == {"density"} and s.temperature_max > 320.0


def test_an_oil_without_its_temperature():
    """The viscosity is that of T_in."""
    scene = load_scene("lined_pad", {"n": 60})
    with solve(scene, model="least") as s:
        assert s.solved_scene.data_si()["temperature"]["oil"] == "ISO VG 68"
        assert s.problem.mu == pytest.approx(scene.temperature.own_mu)


def test_small_grids_have_all_effects():
    with solve({**SCENES["all laws"], "n": 30}) as s:
        assert set(s.settings["model"]["kept"]) == {"barus", "density", "temperature", "shear"}
        assert "so small" in s.settings["model"]["reason"]
    assert coarse_shape((30,), 3) is None and coarse_shape((999,), 3) == (33,)
    nx, ny = coarse_shape((199, 79), 3)
    assert nx * ny * 3 <= 0.1 * 199 * 79


def test_asked_accuracy_is_the_tolerance():
    with solve(SCENES["all laws"], accuracy=0.2) as s:
        assert s.converged and s.settings["model"]["tolerance"] == 0.2 and "density" in s.settings["model"]["left_out"]


@pytest.mark.parametrize(
    "model, message",
    [
        ("temprature", "--model temprature: allowed are auto, full, least.*nearest is temperature"),
        ("auto,shear", "--model auto, shear: auto goes alone"),
        ("elastic", "has no data for it; it has barus, density, temperature, shear"),
    ],
)
def test_refused(model, message):
    with pytest.raises(InputError, match=message):
        solve(SCENES["all laws"], model=model)
