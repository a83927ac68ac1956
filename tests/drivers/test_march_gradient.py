"""Derivatives of films that go on in time: the adjoint of the march against differences of marches."""

from dataclasses import replace

import numpy as np
import pytest

from lcp_lube import solve
from lcp_lube.drivers import supply_search
from lcp_lube.drivers.derivatives import march_films
from lcp_lube.drivers.derivatives.gradient import check, film_fields, gradients
from lcp_lube.drivers.derivatives.march_gradient import MarchGradient, means
from lcp_lube.drivers.marches import rotor
from lcp_lube.drivers.marches.march_course import Course, Trace
from lcp_lube.errors import InputError
from lcp_lube.problems.film.contact import areas
from lcp_lube.problems.film.views import LiftedFilm
from lcp_lube.scenes.scene import load_scene
from lcp_lube.scenes.values import values_of, with_values

PUSH = ["2000*exp(-400*(mod(50*t,1)-0.1)^2)", "900.0"]
TEXTURE = {"t_end": 0.01, "steps": 5}
FREE = {"t_end": 0.002, "steps": 3, "free": True, "mass": 15.0, "load": PUSH}
AT = {"position": 2e-7, "velocity": 1e-5}
PADS = {"balance": None, "nx": 8, "ny": 4}
ROCKED = {"set": {"h_offset": "2e-6*sin(800*t)"}, "pad_inertia": 1e-4}
ON_A_COURSE = {"t_end": 0.002, "steps": 4, "journal": ["0.5 + 0.2*cos(400*t)", "0.2*sin(400*t)"]}
SUPPLIES = [
    {"x_mm": [12.3, 14.1], "restrictor": "capillary", "K": 1e-11, "p_s": 8e6, "backflow": True},
    {"x_mm": [2.1, 2.9], "flow": 2e-6},
]
TIGHT = {"eps1": 1e-12}  # of a fluid with a density the loop ends by it
DENSE = {"fluid.density": "dowson-higginson", "fluid.barus": 2e-8}
CASES = {
    "texture": ("moving_texture", {"n": 40, "motion": TEXTURE}, ["fluid.mu", "film.constant.h", "fluid.p_supply"]),
    "euler": ("moving_texture", {"n": 40, "motion": {**TEXTURE, "scheme": "euler", "start": "full"}}, ["fluid.mu"]),
    "barus": ("moving_texture", {"n": 40, "fluid.barus": 2e-8, "motion": TEXTURE}, ["fluid.barus", "fluid.mu"]),
    "supplies": (
        "moving_texture",
        {"n": 40, "motion": TEXTURE, "supply": SUPPLIES},
        ["fluid.mu", "supply.1.K", "supply.2.flow"],
    ),
    "orifice, barus, euler": (
        "moving_texture",
        {
            "n": 40,
            "motion": {**TEXTURE, "scheme": "euler"},
            "fluid.barus": 2e-8,
            "supply": [{**SUPPLIES[0], "restrictor": "orifice", "K": 1e-8}],
        },
        ["supply.1.p_s", "fluid.barus"],
    ),
    "course": ("dynamic_journal", {"nx": 24, "motion": ON_A_COURSE}, ["film.journal.c", "U", "sides.south.p"]),
    "free": (
        "dynamic_journal",
        {"nx": 16, "ny": 4, "motion": {**FREE, "start": "full", "position": [0.5, 0.5]}},
        ["motion.mass", "motion.position.1", "film.journal.c"],
    ),
    "supplies, density": (
        "moving_texture",
        {"n": 40, "motion": TEXTURE, "supply": SUPPLIES, **DENSE},
        ["fluid.mu", "supply.2.flow"],
    ),
    "free, a supply that follows": (
        "dynamic_journal",
        {
            "nx": 16,
            "ny": 4,
            "motion": {**FREE, "start": "full", "position": [0.5, 0.5]},
            "supply": [{"x_mm": [21.3, 39.1], "y_mm": [2.6, 7.4], "restrictor": "capillary", "K": 1e-12, "p_s": 2e6}],
        },
        ["motion.mass", "supply.1.K", "film.journal.c"],
    ),
    "free level": (
        "moving_texture",
        {
            "n": 40,
            "U": 0.5,
            "motion": {**TEXTURE, "steps": 5, "free": True, "mass": 3.0, "load": "400*(1+0.3*sin(300*t))", **AT},
        },
        ["motion.mass", "motion.position", "motion.velocity", "fluid.mu"],
    ),
    "density, texture": (
        "moving_texture",
        {"n": 40, "motion": TEXTURE, **DENSE},
        ["fluid.mu", "fluid.barus", "fluid.p_supply", "film.constant.h"],
    ),
    "density, free": (
        "dynamic_journal",
        {"nx": 16, "ny": 4, "motion": {**FREE, "start": "full", "position": [0.5, 0.5]}, **DENSE},
        ["motion.mass", "film.journal.c"],
    ),
    "round edges": (
        "moving_texture",
        {"dimension": 2, "width_mm": 10, "nx": 12, "ny": 8, "film.dimples.rows": 2, "film.dimples.columns": 3}
        | {"film.dimples.size_mm": 3.0, "fluid.p_supply": 1e3, "motion": {"t_end": 0.003, "steps": 2}},
        ["fluid.mu"],
    ),
    "a layer as thick as the land it comes from": (
        "moving_texture",
        {
            "dimension": 2,
            "n": 9,
            "width_mm": 10,
            "sides": {"west": 0.0, "east": 1e5, "south": 0.0, "north": 0.0},
            "film": [
                {"shape": "constant", "h_um": 10},
                {"shape": "pocket", "depth_um": 8, "x_mm": [0.6, 12.6], "y_mm": [0.4, 9.7]},
            ],
            "motion": {**TEXTURE, "steps": 3, "set": {"U": "1 + 5*t"}},
        },
        ["width", "film.pocket.depth"],
    ),
    "to smaller x": (
        "moving_texture",
        {
            "n": 30,
            "U": -2.0,
            "fluid.barus": 2e-8,
            "motion": {"t_end": 0.0071, "steps": 4},
            "supply": [{"x_mm": [2.1, 2.9], "p": 3e5}],
        },
        ["U", "supply.1.p"],
    ),
    "partly filled": ("moving_texture", {"n": 30, "motion": {**TEXTURE, "steps": 4, "fill": 0.8}}, ["motion.fill"]),
    "pads that follow": ("tilting_pad_thrust", {**PADS, "motion": {"t_end": 0.002, "steps": 2, **ROCKED}}, ["mu"]),
    "free, steady start": ("dynamic_journal", {"nx": 16, "ny": 4, "motion": FREE}, ["film.journal.eccentricity"]),
}


def numbers(solution, names):
    assert solution.converged
    known = {**solution.history[-1], **means(solution.history)}
    return np.array([known[name] for name in names])


def marched(scene, names):
    with solve(scene, stopping=TIGHT) as solution:
        return numbers(solution, names)


@pytest.mark.parametrize("case", CASES)
def test_against_differences_of_marches(case, monkeypatch):
    monkeypatch.setattr(rotor, "TOL", 1e-11)
    monkeypatch.setattr(supply_search, "TOLERANCE", 1e-13)
    name, changes, keys = CASES[case]
    scene, names = load_scene(name, **changes), ["load", "mean_load", "friction", "mean_friction", "p_max"]
    trace = Trace()
    with solve(scene, watch=trace, stopping=TIGHT) as solution:
        found = gradients(scene, solution, names, keys, trace)
        assert [one.value for one in found] == pytest.approx(numbers(solution, names), rel=1e-12)
    for key in keys:
        value = values_of(scene)[key]
        d = 2e-6 * (abs(value) or 1.0)
        low, high = (marched(with_values(scene, {key: value + m * d}), names) for m in (-1, 1))
        slopes = (high - low) / (2.0 * d)  # d^2 is far below what is asked for
        for one, slope in zip(found, slopes, strict=True):
            noise = 1e-11 * abs(one.value) / d
            assert abs(one.gradient[key] - slope) <= 1e-6 * abs(slope) + noise, (key, one.quantity)


def test_taylor_and_the_march_is_marched_again_without_a_trace():
    scene, key = load_scene("moving_texture", n=40, motion=TEXTURE), "film.constant.h"
    with solve(scene) as solution:
        slope, here = solution.gradient("load", [key])[key], marched(scene, ["load"])[0]
    h, errors = 6e-6, []
    for step in (4e-4, 2e-4):
        errors.append(marched(with_values(scene, {key: h * (1 + step)}), ["load"])[0] - here - slope * h * step)
    assert np.log2(abs(errors[0] / errors[1])) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("changes", [{"elastic": {"compliance": 1e-14}}, {"motion": {**TEXTURE, "set": {"U": "2*cos(600*t)"}}}])
def test_what_has_no_derivative_in_time_is_said(changes):
    scene = load_scene("moving_texture", **{"n": 20, **changes})
    with pytest.raises(InputError, match=r"no derivatives in time (through effects|where the wall turns back)"):
        check(scene)
        with solve(scene) as solution:
            gradients(scene, solution, ["load"], ["fluid.mu"])


@pytest.mark.parametrize("U", [2.0, -2.0])
def test_films_of_all_steps_at_once_are_those_step_by_step(U, monkeypatch):
    scene, trace = load_scene("moving_texture", n=30, U=U, motion={**TEXTURE, "fill": 0.9}), Trace()
    with solve(scene, watch=trace) as solution:
        course = Course(scene, trace, solution.problem.grid.petsc_comm)
        found = march_films.films_of(course)
        assert march_films._at_once(course, np.zeros((1, 2))).shape == (5, 2)
        monkeypatch.setattr(march_films, "_at_once", lambda course, places: np.zeros((0, 0)))
        others = march_films.films_of(course)
    assert all(np.array_equal(getattr(found, name), value) for name, value in vars(others).items())


@pytest.mark.parametrize("case", ["to smaller x", "free"])
def test_the_films_own_derivative(case, monkeypatch):
    """In a drawn direction, by differences of marches whose film is another at all times; in sum that by its level."""
    monkeypatch.setattr(rotor, "TOL", 1e-11)
    monkeypatch.setattr(supply_search, "TOLERANCE", 1e-13)
    name, changes, _ = CASES[case]
    scene = load_scene(name, **{**changes, "motion": {**changes["motion"], "start": "full"}})
    names, trace, models = ["load", "mean_friction"], Trace(), type(scene).models
    with solve(scene, watch=trace, stopping=TIGHT) as solution:
        grid, fields = solution.problem.grid, film_fields(scene, solution, names, trace)
        found = gradients(scene, solution, names, ["h_offset"], trace)
        d = 1e-5 * solution.problem.scheme.h.min() * np.random.default_rng(1).uniform(-1.0, 1.0, grid.local_size)
        ends = []
        for way in (-1.0, 1.0):

            def lifted(t, place, way=way):
                model = models(scene)(t, place)
                return replace(model, gap=LiftedFilm.of(model.gap, grid, way * d))

            monkeypatch.setattr(type(scene), "models", lambda self: lifted)
            ends.append(marched(scene, names))
        for one, slope in zip(found, 0.5 * (ends[1] - ends[0]), strict=True):
            parts = fields[one.quantity].ravel() * areas(grid).ravel()
            assert parts.sum() == pytest.approx(one.gradient["h_offset"], rel=1e-8)
            assert parts @ d == pytest.approx(slope, rel=1e-6)


def test_by_the_speed_of_a_texture_the_mean_of_both_sides_is_the_limit_of_differences():
    """At the end its edges lie on points of the grid: a kink, by which central differences err in proportion to their step."""
    scene, names = load_scene("moving_texture", n=60, motion={"t_end": 0.01, "steps": 12}), ["load", "mean_load", "friction"]
    trace = Trace()
    with solve(scene, watch=trace) as solution:
        found = gradients(scene, solution, names, ["U"], trace)
    U, errors = values_of(scene)["U"], []
    for step in (1e-5, 1e-6):
        low, high = (marched(with_values(scene, {"U": U * (1 + way * step)}), names) for way in (-1, 1))
        slopes = (high - low) / (2 * U * step)
        errors.append(np.array([abs(one.gradient["U"] / slope - 1) for one, slope in zip(found, slopes, strict=True)]))
    assert found[0].one_sided["U"] > 1e-2 * abs(found[0].gradient["U"])
    assert errors[0].max() > 1e-5 > errors[1].max()  # a kink is found by differences of L, to some 1e-6


def test_lines_of_points_that_are_laid_anew_go_with_the_edges():
    """A march that has come to rest has the derivatives of the film at rest, whose edges lie on even lines."""
    changes, keys = {"nx": 59, "ny": 19, "fluid.barus": 0.0}, ["film.pocket.x.1", "L"]
    rest = load_scene("pocketed_pad_2d", changes)
    march = load_scene("pocketed_pad_2d", {**changes, "motion": {"t_end": 50.0, "steps": 3}})
    with solve(rest) as one, solve(march) as two:
        (steady,), (last,) = (gradients(scene, s, ["load"], keys) for scene, s in ((rest, one), (march, two)))
    assert last.one_sided == steady.one_sided == dict.fromkeys(keys, np.inf)
    assert last.gradient == pytest.approx(steady.gradient, rel=1e-6)


def test_films_near_by_of_a_march_have_the_lagrangians_of_their_problems():
    """Also where edges that travel cut faces, and with void from one step to the next."""
    film = [{"shape": "constant", "h": 5e-6}, {"shape": "dimples", "moves": True, "depth": 5e-6, "size": 1.7e-3, "columns": 4}]
    motion = {"t_end": 0.01, "steps": 4}
    scene, trace = load_scene("moving_texture", {"n": 31, "fluid.barus": 2e-8, "film": film, "motion": motion}), Trace()
    with solve(scene, watch=trace) as solution:
        adjoint = MarchGradient(scene, solution, ["load", "friction"], trace)
        courses = {}
        for key in ("L", "U", "film.dimples.size", "fluid.barus", "fluid.p_supply"):
            value = values_of(scene)[key]
            some = [with_values(scene, {key: value * (1.0 + part)}) for part in (1e-5, -1e-5)]
            courses[key] = [Course(one, trace, adjoint.comm, adjoint.course) for one in some]
        quick = {key: [adjoint.lagrangians(course) for course in pair] for key, pair in courses.items()}
        assert adjoint._films is not None and all(adjoint._films.sums(course) is not None for course in courses["L"])
        adjoint.__dict__["_films"] = None
        sizes = np.array(list(adjoint.sizes.values()))
        for key, pair in courses.items():
            slow = [adjoint.lagrangians(course) for course in pair]
            assert (np.abs(quick[key][0] - quick[key][1] - (slow[0] - slow[1])) <= 1e-13 * sizes).all(), key
        adjoint.destroy()
