"""Stiffness and damping of a film against rigid motions of its walls, by exact linearisation (`response`)."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..problems.film.lubrication import LubricationProblem
from ..problems.film.model import Model
from ..problems.film.turning import Turning
from ..problems.solution import Fields
from .response import Change, Response

Mode = Change  # dh of a rigid motion of a wall, by its coordinate, of x and y (m)


def displacements(turning: Turning, first: float) -> list[Mode]:
    """dh of a displacement of the journal along the load and a quarter of a turn ahead; first : x of the ring at x = 0, m."""

    def towards(angle: float) -> Mode:
        return lambda x, y: -np.cos(turning.theta(x + first) - angle) + 0.0 * y

    return [towards(0.0), towards(0.5 * math.pi)]


def impedance(
    problem: LubricationProblem, model: Model, fields: Fields, modes: Sequence[Mode], frequencies: Sequence[float]
) -> Any:
    """-d(integral of p g_i)/de_j of one film for motions exp(i nu t) of its modes g, i.e. K + i nu C. Collective.

    Returns an array of shape (frequencies, modes, modes); at nu = 0 (the limit of slow motion) it is K + i C.
    """
    response = Response(problem, model, fields, modes)
    try:
        return np.array([response.at(nu) if nu else response.stiffness() + 1j * response.damping() for nu in frequencies])
    finally:
        response.destroy()
