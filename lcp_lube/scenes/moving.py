"""What a march in time needs of a scene that moves: its film at any time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError
from ..problems.film.model import Model
from .formula import Formula
from .scene import as_scene

if TYPE_CHECKING:
    from .motion import MotionTable

# The film at the time t, its journal at [X, Y] in parts of the clearance, or its level at [h_offset] (m), and its pads' tilts.
Models = Callable[[float, Sequence[float] | None], Model]
SPEEDS = ("U", "omega", "speed_rpm")  # keys of the wall's speed
PIECES = 64  # of the time, where the speed changes


def film_of(scene: Any) -> Model | None:
    """The film behind a scene, or what a driver has made of one; None of what is no film."""
    model = getattr(scene, "model", None)
    return model if isinstance(model, Model) else None


def motion_of(scene: Any) -> MotionTable | None:
    """The [motion] of a scene that has one."""
    return getattr(scene, "motion", None)


def models_of(scene: Any) -> Models:
    """The film of a scene of any family, as its [motion] has it.

    Raises
    ------
    InputError : by the function, a number that the scene cannot have, or one that changes the film's extent or its sides.
    """
    table, scene = scene.motion, scene.model_copy()
    scene._shapes = {}  # shapes at rest are made once
    still = replace(scene.model, exact=None)
    travel = travel_of(scene, table)

    def at(t: float, place: Sequence[float] | None) -> Model:
        changes = table.changes(t) if table is not None else {}
        now: Any = scene
        if changes:
            try:
                now = as_scene(scene, changes)
            except InputError as error:
                raise InputError(f"{error} (motion.set at t = {t:g} s)") from None
        now = now.at(t, travel(t), place)
        if not changes:
            extras = getattr(now, "bearing_numbers", None)
            return replace(still, gap=now.gap, shaft=now.turning, extras=extras)
        model = replace(now.model, exact=None, p_unit=still.p_unit)
        if _fixed(model, now.shape) != _fixed(still, scene.shape):
            raise InputError(f"{scene.name}: motion.set: extent, kinds of sides, grooves, supplies and p_c stay as they are")
        return model

    return at


def _fixed(model: Model, shape: Any) -> Any:
    """What a march is about: none of it can change."""
    grooves, c = [(one.start, one.end) for one in model.grooves], getattr(model.shaft, "c", None)
    sides = [side.kind for side in model.sides]
    return shape, model.lengths, model.polar, model.p_c, sides, grooves, c, len(model.supplies)


def travel_of(scene: Any, table: MotionTable | None) -> Callable[[float], float]:
    """How far the wall has come at a time, m; where its speed follows a formula, by Gauss' formula on pieces of the way."""
    key = next((key for key in SPEEDS if table is not None and key in table.set), None)
    if table is None or key is None:
        return lambda t: scene.U * t
    unit: Any = as_scene(scene, {key: 1.0})
    speed, per = Formula(table.set[key], ("t",)), unit.U  # type: ignore[arg-type]
    nodes, weights = np.polynomial.legendre.leggauss(3)
    places = (np.arange(PIECES)[:, None] + 0.5 + 0.5 * nodes) / PIECES

    def travel(t: float) -> float:
        return float(per * t * np.mean(speed(places, places, t * places) @ (0.5 * weights)))

    return travel
