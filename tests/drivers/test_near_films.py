"""What a derivative needs of films near by, without their problems, is what their problems say."""

import numpy as np
import pytest

from lcp_lube import solve
from lcp_lube.drivers import film_gradient, near_films
from lcp_lube.drivers.adjoint import Adjoint
from lcp_lube.drivers.film_gradient import FilmGradient
from lcp_lube.scenes.scene import load_scene
from lcp_lube.scenes.values import values_of, with_values

pytest.importorskip("numba")

SCENES = {
    "problem4": {"nx": 33, "ny": 20},  # nodal
    "upwind": {"scheme": "upwind"},
    "fed": {"fluid.barus": 0.0, "fluid.density": "constant"},
    "law": {},
    "dimpled_pad": {"nx": 31, "ny": 33},
    "cut": {"nx": 32, "ny": 30},
    "turned": {"U": -1.0},
    "journal": {"nx": 40, "ny": 9},
    "thrust": {},
}
BASES = {
    "upwind": ("problem4", {"nx": 33, "ny": 20}),
    "fed": ("pocketed_pad_2d", {"nx": 33, "ny": 20}),
    "cut": ("dimpled_pad", {}),
    "turned": ("dimpled_pad", {"nx": 31, "ny": 29}),
    "law": ("pocketed_pad_2d", {"nx": 33, "ny": 20}),
    "thrust": ("tapered_land", {"nx": 30, "ny": 17}),
}


def made(name):
    base, start = BASES.get(name, (name, {}))
    return load_scene(base, **{**start, **SCENES[name]})


@pytest.mark.parametrize("name", SCENES)
def test_films_near_by_have_the_lagrangians_of_their_problems(monkeypatch, name):
    monkeypatch.setattr(near_films, "SMALL", 1)
    scene = made(name)
    with solve(scene, reduction=False) as solution:
        drags = ["friction"] if name != "fed" else []  # a fluid with a law drags by its own viscosity
        drags += ["friction_torque"] if name == "thrust" else []
        adjoint = Adjoint(scene, solution, ["load", "p_max", *drags])
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
        adjoint.destroy()
    assert (found >= 2) is (name != "law")  # of a fluid with a law they are not known


@pytest.mark.parametrize("name", SCENES)
def test_the_film_s_own_derivative_is_that_of_its_arrays(monkeypatch, name):
    scene = made(name)
    with solve(scene, reduction=False) as solution:
        fields = []
        for least in (1, 10**9):
            monkeypatch.setattr(film_gradient, "SMALL", least)
            adjoint = Adjoint(scene, solution, ["load"])
            fields.append(FilmGradient(adjoint).field("load"))
            adjoint.destroy()
    assert fields[0] == pytest.approx(fields[1], abs=1e-12 * np.abs(fields[1]).max())


def test_friction_builds_a_problem_for_a_law_s_number_alone(monkeypatch):
    monkeypatch.setattr(near_films, "SMALL", 1)
    scene, built = made("dimpled_pad"), []
    with solve(scene, reduction=False) as solution:
        adjoint = Adjoint(scene, solution, ["friction"])
        slow = adjoint.lagrangians
        monkeypatch.setattr(adjoint, "lagrangians", lambda other: built.append(values_of(other)["fluid.barus"]) or slow(other))
        for key in (key for key in values_of(scene) if not key.startswith("sides")):  # films full at the sides stay so
            adjoint.slopes(key)
        adjoint.destroy()
    assert 0 < np.count_nonzero(built) <= 4  # by Barus' number the viscosity, 0 there, grows with pressure
    assert built.count(0.0) == 1  # the scene itself
