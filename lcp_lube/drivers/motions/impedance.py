"""Stiffness and damping of a film against rigid motions of its walls, by exact linearisation (`response`)."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...base.parallel import Array
from ...problems.film.effects import factors
from ...problems.film.fluid import Law
from ...problems.film.turning import Turning
from ...problems.solution import Solution
from ..effects.frozen import Frozen
from .coupled_response import CoupledResponse
from .response import Change, Response


def rising(x: Array, y: Array) -> Array:
    """dh of a film that is thicker everywhere, by as much."""
    return np.ones(np.broadcast_shapes(x.shape, y.shape))


def displacements(turning: Turning, first: float = 0.0, along: float = 0.0) -> list[Change]:
    """dh of a displacement of the journal along the load and a quarter of a turn ahead.

    first : x of the ring at x = 0, m; along : angle of the load, rad from where theta is counted.
    """

    def towards(angle: float) -> Change:
        return lambda x, y: -np.cos(turning.theta(x + first) - angle) + 0.0 * y

    return [towards(along), towards(along + 0.5 * math.pi)]


def impedance(response: Response | CoupledResponse, frequencies: Sequence[float], stored: bool = True) -> Any:
    """K + i nu C of a film for motions exp(i nu t); the response is freed. Collective.

    Returns an array of shape (frequencies, motions, motions); at nu = 0 (the limit of slow motion) it is K + i C.
    """
    try:
        found = [response.at(nu, stored) if nu else response.stiffness() + 1j * response.damping() for nu in frequencies]
    finally:
        response.destroy()
    return np.array(found)


def stiffness(response: Response | CoupledResponse, rtol: float | None = None) -> Any:
    """K, shape (motions, motions); the response is freed. Collective.

    rtol : of GMRES for what effects make of it; default as for all its digits.
    """
    try:
        if rtol is not None and isinstance(response, CoupledResponse):
            response.rtol = rtol
        return response.stiffness()
    finally:
        response.destroy()


def held(scene: Any, solution: Solution) -> Any:
    """The scene of a solution, its coefficients held where effects act: its stiffness is near enough for Newton's method."""
    if not scene.model.effects:
        return scene
    problem: Any = solution.problem
    frozen = Frozen(scene.with_shape(problem.grid.shape), Law())
    return replace(frozen, by=factors(frozen.build(problem.grid.petsc_comm), problem.cells))
