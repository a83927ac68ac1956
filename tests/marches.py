"""Films in time: built-in scenes, small enough for tests that solve every scene, a wedge that breathes, marches taken up."""

from pathlib import Path
from typing import Any

import pytest

from lcp_lube import Solution, solve
from lcp_lube.scenes.scene import Scene

SMALL: dict[str, dict[str, Any]] = {
    "squeeze": {"steps": 8},
    "moving_texture": {"motion.steps": 8},
    "dynamic_journal": {"nx": 24, "ny": 3, "motion.steps": 6, "motion.t_end": 6e-4},
}
WEDGE: dict[str, Any] = {
    "family": "bearing",
    "L_mm": 10,
    "U": 1.0,
    "n": 30,
    "fluid": {"mu": 0.01, "p_supply": 1e5},
    "film": [
        {"shape": "sinusoid", "h_min_um": 1, "h_max_um": 3, "waves": 2},
        {"shape": "formula", "unit": "um", "h": "0.4*sin(300*t)"},
    ],
    "motion": {"t_end": 0.02, "steps": 20},
}


class Stopped(Exception):
    pass


def taken_up(scene: Scene, path: Path, step: int) -> Solution:
    """The end of a march that was stopped after so many steps, and went on from its checkpoint."""

    def watch(moment: Any) -> None:
        if moment.count == step:
            raise Stopped

    with pytest.raises(Stopped):
        solve(scene, checkpoint=path, every=2, watch=watch)
    return solve(scene, resume=path)
