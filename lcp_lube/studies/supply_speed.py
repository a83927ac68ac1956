"""Stability against load: supply pressure and speed, from a film that is full everywhere to one that is nearly all cavity."""

from collections.abc import Iterator
from functools import partial

from .map_picture import Axis, Panels
from .outcome_map import Case, OutcomeMap, methods, tallies

SPEEDS = (1e-3, 1e-2, 0.1, 1, 10, 100, 1000)  # m/s
PRESSURES = (0, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7)  # Pa, on all sides
SCENES = {"problem1": {"n": 100}, "textured_slider": {"K": 1, "n": 30}}

X, Y = Axis("U", "speed U in m/s", "U"), Axis("p", "supply pressure in Pa", "p")


def cases(quick: bool) -> Iterator[Case]:
    """quick: two by two on the line."""
    for scene, fixed in SCENES.items():
        if quick and scene != "problem1":
            return
        for method in methods():
            for U in SPEEDS[::5] if quick else SPEEDS:
                for p in PRESSURES[::5] if quick else PRESSURES:
                    sides = {"p_a": p, "p_b": p} | ({"p_side": p} if scene != "problem1" else {})
                    changes = {**fixed, "U": U, **sides}
                    yield Case({"scene": scene, "method": method, "U": U, "p": p}, scene, changes, {"method": method})


sentence = partial(tallies, by=("method",), axes=(X, Y))
chart = OutcomeMap("supply_speed", cases, Panels("method", "scene"), X, Y, sentence).chart
