"""docs/numbers.md explains every key that is printed, and no other; the seconds add up; the echo solves to the same."""

import re
from pathlib import Path

import marches
import pytest

from lcp_lube import load_scene, solve
from lcp_lube.output.results import as_dict
from lcp_lube.registry import scene_names

PAGE = Path(__file__).parents[2] / "docs" / "numbers.md"
SMALL = {
    "textured_slider": {"K": 1},
    "squeeze": {"n": 19, "steps": 8},
    "moving_texture": {"n": 19, **marches.SMALL["moving_texture"]},
    "dynamic_journal": marches.SMALL["dynamic_journal"],
}


def explained():
    """The keys in the first column of the page's tables."""
    rows = [line.split("|")[1] for line in PAGE.read_text().splitlines() if line.startswith("| `")]
    keys = [key for row in rows for key in re.findall(r"`([^`]+)`", row)]
    return keys


def printed(solution):
    data = as_dict(solution)
    solution.destroy()
    return data


@pytest.fixture(scope="module")
def answers():
    """What the built-in scenes print on small grids, and the options that print more."""
    film = {"n": 15, "U": 1.0}
    heat = {"n": 15, "motion.steps": 8, "temperature.beta": 0.03}
    extra = {
        "accuracy": printed(solve("problem1", accuracy=1e-4)),
        "fas": printed(solve("problem4", n=20, method="fas")),
        "certify": printed(solve(load_scene("problem1", {"n": 20}), certify=True)),
        "round": printed(solve(load_scene("dimpled_pad", {"nx": 30, "ny": 30, "film.dimples.form": "round"}))),
        "deep": printed(solve(load_scene("pocketed_pad_2d", {"nx": 14, "ny": 9, "film.pocket.depth": 0.2}))),
        "level": printed(solve("problem1", n=20, motion={"t_end": 0.01, "steps": 2, "set": {"h_offset": "1e-4*t"}})),
        "asperity": printed(solve("lined_pad", n=12, asperity={"sigma": 1e-6, "E_reduced": 1e11})),
        "warm": printed(solve(load_scene("moving_texture", heat), model="full")),
        "balance": printed(solve(load_scene("pocketed_pad", {**film, "balance.load": 3e4}))),
    }
    return {
        name: printed(solve(load_scene(name, SMALL.get(name, {"n": 60 if name.endswith("_journal") else 12}))))
        for name in scene_names()
    } | extra


def test_every_key_is_explained_once(answers):
    keys = explained()
    once = [key for key in keys if key != "balance"]
    assert len(once) == len(set(once))
    assert {key for data in answers.values() for key in data} == set(keys)


def test_seconds_add_up(answers):
    for name, data in answers.items():
        parts = dict(data["time_s"])
        total = parts.pop("total")
        assert all(part >= 0 for part in parts.values()), name
        assert sum(parts.values()) == pytest.approx(total, rel=1e-9), name
    assert answers["fas"]["time_s"]["cycles"] > 0  # multigrid solves no linear systems


def test_the_echo_solves_to_the_same_numbers(answers):
    """It is a scene in SI with all of its values, those that follow from others left out."""
    for name in ("problem3", "journal", "pocketed_pad_2d", "squeeze", "poisson_cubic"):
        data = answers[name]
        echo = dict(data["scene_data"])
        for key in ("L", "U", "width", "p_unit") if name == "journal" else ():
            del echo[key]
        again = printed(solve(load_scene(echo)))
        assert again["scene_data"] == data["scene_data"]
        for key in ("p_max", "load", "sigma", "sum_v"):
            if data.get(key) is not None:
                assert again[key] == pytest.approx(data[key], rel=1e-9), (name, key)


def test_the_echo_has_what_was_set_and_in_metres():
    data = printed(solve(load_scene("pocketed_pad", {"n": 20, "film.pocket.depth_um": 3.0})))["scene_data"]
    assert data["film"][-1]["depth"] == 3e-6 and data["n"] == 20


def test_the_echo_is_of_the_last_grid_and_of_the_value_that_was_found(answers):
    assert answers["accuracy"]["scene_data"]["nx"] == answers["accuracy"]["nx"] and "n" not in answers["accuracy"]["scene_data"]
    assert answers["balance"]["scene_data"]["h_offset"] == answers["balance"]["balance"]["value"] != 0


@pytest.mark.parametrize("name", ["pocketed_pad_2d"])
def test_all_solves_of_a_fluid_count(name):
    """The first of several took a part of the time only."""
    solution = solve(load_scene(name, {"nx": 49, "ny": 19}), method="fas")
    assert solution.settings["details"]["fluid_solves"] > 1
    cycles = as_dict(solution)["time_s"]["cycles"]
    first = sum(level["time_s"] for level in solution.levels)
    assert cycles > 0 and first > 0 and sum(as_dict(solution)["time_s"].values()) >= cycles
    solution.destroy()
