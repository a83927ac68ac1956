"""What closes the balance of a whole film in time after a cycle: one factor for all pressures and voids."""

from typing import Any

import numpy as np

from ...base.parallel import Array
from ...problems.film.flows import volume_unit
from ...problems.film.lubrication import LubricationProblem
from ...problems.film.stored import storing
from ...problems.film.supplies import supply_flows
from ...problems.solution import Fields

SCALED = 1e-3  # the most by which all pressures and voids are scaled
PART, STEPS = 1e-6, 2  # a factor's part, by which it is found beside supplies that follow, and steps for it


def closing(problem: LubricationProblem, fields: Fields, follow: Any = None) -> tuple[float, Array | None]:
    """The part by which pressures grow and voids shrink, or the reverse, so that what enters the film is what it stores.

    Either takes liquid out: together they do wherever any can leave. They change far less than what a cycle leaves. Beside it
    the pressures of supplies that follow, if any (`following.Following`), at which their sources give what the cells beside
    them take. Collective.
    """
    if problem.scheme.storage is None:  # no cell stores what is left
        return 0.0, None if follow is None else follow.P[0]
    volume, held = volume_unit(problem) / problem.scheme.flow_unit, problem.held
    moves = 1.0 if held is None else np.append([float(one.open) for one in held.supplies], 1.0)[held.owner.ravel()]
    lost, taken = [], []
    for part in (0.0, 1.0):
        p, r = (1.0 + part * moves) * fields["p"], (1.0 - part) * fields["r"]
        west, east, south, north = problem.boundary_flows(p, r)
        taken.append(np.array(supply_flows(problem, p, r)))
        lost.append(west - east + south - north + float(np.sum(taken[-1])) / volume - storing(problem, p, r))

    def at(part: float) -> tuple[float, Array | None]:
        rest = lost[0] + part * (lost[1] - lost[0])
        if follow is None:
            return rest, None
        more, new = follow.beside(part, taken[0] + part * (taken[1] - taken[0]))
        return rest + more / volume, new

    part = 0.0
    for _ in range(STEPS):
        rest = at(part)[0]
        slope = (at(part + PART)[0] - rest) / PART
        part -= rest / slope if slope else 0.0
    part = part if abs(part) < SCALED else 0.0
    return part, at(part)[1]
