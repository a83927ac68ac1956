"""What is allowed in a scene of a film, and unlikely to be meant: sentences for warnings, not refusals."""

from typing import Any

import numpy as np

from .film_scene import FilmScene
from .scene import Scene

THICK = 0.01  # h/L above which Reynolds' equation is in doubt
DENSITY = 900.0  # kg/m3, of an oil
TURBULENT = 1000.0  # Reynolds number of the gap
STEEL = 3e9  # Pa: more than any bearing surface stands
LONG = 100.0  # times the pad: a profile in another unit
SAMPLES = 33  # points a side at which the film is looked at


def doubts(scene: Scene) -> list[str]:
    """Sentences on the scene's data; none for scenes that are no films."""
    if not isinstance(scene, FilmScene):
        return []
    model, film = scene.model, getattr(scene, "film", None)
    found = _of_the_film(model)
    for k, part in enumerate(film if isinstance(film, list) else [], start=1):
        name = f"film {k} ({part.shape})"
        found += [f"{name}: {text}" for text in _of_a_shape(part, model.lengths)]
    return found + _of_profiles(model)


def too_high(quantities: dict[str, Any]) -> list[str]:
    """A sentence on the largest pressure of a film's quantities, Pa."""
    p_max = quantities.get("p_max")
    if "load" not in quantities or p_max is None or not p_max > STEEL:
        return []
    return [f"p_max = {p_max:.3g} Pa: above 3 GPa no surface holds; are film, speed and viscosity meant so?"]


def _of_the_film(model: Any) -> list[str]:
    """Thickness and Reynolds number, of the median of the film: a deep pocket is no thick film."""
    places = [(np.arange(SAMPLES) + 0.5) / SAMPLES * length for length in model.lengths]
    with np.errstate(all="ignore"):
        h = model.gap(places[0][None, :], places[1][:, None] if len(places) == 2 else np.zeros((1, 1)))
    h = float(np.partition(h, h.size // 2, axis=None)[h.size // 2])  # of an odd number; np.median takes as long as the film
    if not 0 < h < np.inf:
        return []  # the discretisation says where the film is not positive
    found = []
    L = min(model.lengths)
    if h / L > THICK:
        found.append(f"h/L = {h / L:.2g} (median film, shorter side): Reynolds' equation is for films below {THICK:g}")
    reynolds = DENSITY * model.U * h / model.mu
    if reynolds > TURBULENT:
        found.append(
            f"Re = {reynolds:.3g} (median film, {DENSITY:g} kg/m3): films above some {TURBULENT:g} are turbulent, not laminar"
        )
    return found


def _of_a_shape(part: Any, lengths: tuple[float, ...]) -> list[str]:
    """Places that lie beside the pad, where the shape changes nothing."""
    found = []
    for axis, length in zip("xy", lengths, strict=False):
        names = [axis] + ["between", "at"] * (getattr(part, "along", "x") == axis)
        for name in names:
            span = getattr(part, name, None)
            if span is None:
                continue
            start, end = span if isinstance(span, tuple) else (span, span)
            if end < 0 or start > length:
                place = f"{start:g} to {end:g}" if isinstance(span, tuple) else f"{start:g}"
                found.append(f"{name} = {place} m lies outside the pad, 0 to {length:g} m")
    return found


def _of_profiles(model: Any) -> list[str]:
    found = []
    for part in getattr(model.gap, "parts", []):
        for axis, length in zip("xy", model.lengths, strict=False):
            line = getattr(part, axis, None)
            if isinstance(line, np.ndarray) and line.size > 1 and line[-1] - line[0] > LONG * length:
                ratio = (line[-1] - line[0]) / length
                found.append(f"profile: {ratio:.3g} times as long as the pad in {axis}; is unit_x right?")
    return found
