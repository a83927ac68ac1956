"""What a Python user gets: solve by name, path or dictionary, and the Solution."""

from typing import Any

import pytest

import lcp_lube
from lcp_lube import InputError, load_scene, solve
from lcp_lube.registry import SCENE_DIR


def test_the_package_shows_what_there_is() -> None:
    assert set(dir(lcp_lube)) == set(lcp_lube.__all__) >= {"Scene", "Solution", "load_scene", "solve"}


@pytest.mark.parametrize(
    "source",
    ["problem1", SCENE_DIR / "problem1.toml", load_scene("problem1"), {"family": "slider", "n": 100}],
    ids=["name", "path", "scene", "dictionary"],
)
def test_a_scene_is_named_in_any_way_and_changed_by_keywords(source: Any) -> None:
    solution = solve(source, n=30, h_min=1.2e-5, method="active-set")
    assert solution.converged and solution.problem.grid.shape == (30,)
    assert solution.problem.quantities(solution.fields)["min_h"] == pytest.approx(1.2e-5, rel=1e-2)
    solution.destroy()


def test_a_misspelt_argument_is_said_to_be_one() -> None:
    with pytest.raises(InputError, match="metod is neither a key of the scene nor an argument; nearest is method"):
        solve("problem1", metod="din")
