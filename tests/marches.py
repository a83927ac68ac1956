"""Films in time: built-in scenes, small enough for tests that solve every scene, and a wedge that breathes."""

from typing import Any

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
