"""Warnings: what is allowed and unlikely is said on stderr and in the JSON, and solved all the same."""

import numpy as np
import pytest

from lcp_lube import load_scene
from lcp_lube.registry import scene_names
from lcp_lube.scenes.doubts import doubts, too_high


@pytest.mark.parametrize("name", scene_names())
def test_no_built_in_scene_is_doubted(name):
    assert doubts(load_scene(name)) == []


@pytest.mark.parametrize(
    "scene, changes, words",
    [
        ("problem1", {"h_min": "2mm", "h_max": "5mm", "mu": 1.0}, ["h/L = 0.034"]),
        ("problem1", {"U": 1e6}, ["Re = "]),
        ("pocketed_pad", {"film.pocket.x": ["20mm", "30mm"]}, ["film 2 (pocket): x = 0.02 to 0.03 m lies outside the pad"]),
        (
            "pocketed_pad",
            {"film": {"shape": "step", "height": 1e-5, "at": -0.1}, "h_floor": 1e-5},
            ["film 1 (step): at = -0.1 m"],
        ),
        ("tilting_pad_journal", {"nx": 100}, []),
        ("two_groove_journal", {"nx": 90}, []),
        ("pocketed_pad", {"film.pocket.depth": "1cm"}, []),  # a deep pocket is no thick film
    ],
)
def test_doubts(scene, changes, words):
    found = doubts(load_scene(scene, changes))
    assert len(found) == len(words) and all(text.startswith(word) for text, word in zip(found, words, strict=True))


def test_high_pressures():
    assert too_high({"p_max": 2.9e9, "load": 1.0}) == too_high({"p_max": None, "load": 1.0}) == too_high({"p_max": 1e12}) == []
    assert too_high({"p_max": 3.1e9, "load": 1.0})[0].startswith("p_max = 3.1e+09 Pa")


def test_profiles_of_another_unit_and_a_point_short(tmp_path):
    def scene(ends):
        x = np.linspace(0.0, ends, 51)
        np.savetxt(tmp_path / "h.csv", np.column_stack([x, 10 + x / ends]), delimiter=",")
        (tmp_path / "s.toml").write_text(
            "family = 'bearing'\nL_mm = 50\nU = 1\nfluid = {mu = 0.01}\nfilm = {shape = 'profile', file = 'h.csv'}\n"
        )
        return load_scene(tmp_path / "s.toml")

    assert doubts(scene(50e3)) == ["profile: 1e+03 times as long as the pad in x; is unit_x right?"]
    assert doubts(scene(50)) == doubts(scene(49.98)) == doubts(scene(49.02)) == []
    for short in (48, 20):
        with pytest.raises(ValueError, match="m is needed"):
            doubts(scene(short))


def test_warnings_stand_in_the_json_and_on_stderr(cli):
    run = cli("solve", "problem1", "--n", 20, "--set", "h_min=2mm", "--set", "h_max=5mm", "--set", "mu=1", "--json")
    data = run.json
    assert run.status == 0 and len(data["warnings"]) == 1
    assert run.lines == [f"lcp-lube: warning: {data['warnings'][0]}"]
    assert data["scene_data"]["h_min"] == 2e-3 and data["scene_units"]["h_min"] == "m"
