"""A journal's place: t = log(s/(1 - s)) of s, its eccentricity over that at which it touches its bore, and the attitude."""

import math
from typing import Any

import numpy as np

from ...base.parallel import Array
from ...problems.film.turning import Turning
from ...scenes.grooved import GroovedJournalScene

WIDEST = 14.0  # of t: s from 1e-6 to 1 - 1e-6
DIRECTIONS = np.linspace(-0.5, 0.5, 2881)[1:-1] * math.pi  # from the attitude, in which the bore may be touched


def touching(scene: GroovedJournalScene, phi: float) -> float:
    """The eccentricity at which a journal displaced towards phi touches its bore, at most 1."""
    bore, turning = scene.model_copy(update={"eccentricity": 0.0}).gap, scene.turning
    x = (phi + DIRECTIONS - turning.start) * turning.R
    room = bore(x[None, :], np.linspace(0.0, turning.B, 5)[:, None]) / (turning.c * np.cos(DIRECTIONS))
    return float(min(1.0, max(room.min(), 1e-6)))


def eccentricity(scene: GroovedJournalScene, t: float, phi: float) -> float:
    return touching(scene, phi) / (1.0 + math.exp(-t))


def moved(scene: Any, t: float, phi: float) -> Any:
    """The scene with its journal there."""
    return scene.model_copy(update={"eccentricity": eccentricity(scene, t, phi), "attitude_deg": math.degrees(phi)})


def place_of(scene: Any, t: float, phi: float) -> Array:
    """The journal's, m."""
    return scene.clearance * eccentricity(scene, t, phi) * np.array([math.cos(phi), math.sin(phi)])


def moves_of(scene: Any, t: float, phi: float) -> Array:
    """How the journal moves (m) with t and with the attitude: columns."""
    d = 1e-5
    ends = place_of(scene, t + d, phi) - place_of(scene, t - d, phi), place_of(scene, t, phi + d) - place_of(scene, t, phi - d)
    return np.stack(ends, axis=1) / (2.0 * d)


def half_film_eccentricity(turning: Turning, mu: float, load: float, long: bool = False) -> float:
    """The eccentricity at which a journal with half a film carries the load, as a start.

    1/W = 1/W_short + 1/W_long, of Ocvirk's short and Sommerfeld's long bearing: between them for every L/D, and near both.
    long : the long one alone, load in N/m.
    """
    e = 1.0 / (1.0 + np.exp(-np.linspace(-0.5 * WIDEST, 0.5 * WIDEST, 561)))
    round_, ratio = 1.0 - e * e, math.inf if long else (turning.B / turning.R) ** 2
    over_short = 1.0 / (0.25 * ratio * e / round_**2 * np.sqrt(16.0 * e * e + np.pi**2 * round_))
    over_long = (2.0 + e * e) * round_ / (6.0 * e * np.sqrt(4.0 * e * e + np.pi**2 * round_))
    unit = mu * turning.omega * turning.R * turning.B * (turning.R / turning.c) ** 2
    return float(np.interp(math.log(load / unit), -np.log(over_short + over_long), e))
