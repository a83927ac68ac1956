"""Built-in scenes that go on in time, small enough for tests that solve every scene."""

from typing import Any

SMALL: dict[str, dict[str, Any]] = {
    "squeeze": {"steps": 8},
    "moving_texture": {"motion.steps": 8},
    "dynamic_journal": {"nx": 24, "ny": 3, "motion.steps": 6, "motion.t_end": 6e-4},
}
