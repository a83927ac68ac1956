"""What sources give and a film takes: by how much they differ, and pressures at which they do not."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...base.parallel import Array
from .flows import volume_unit
from .fluid import Law
from .supplies import Supply

if TYPE_CHECKING:
    from .lubrication import LubricationProblem

IDLE, ROUNDINGS = 1e-8, 64  # part of a flow that counts as none; of 2^-53 in a supply's flows
SMALL, SAME = 30, 1e-14  # steps of Newton's method, and of these what rounding is


def balanced(supplies: Sequence[Supply], P: Array, flows: Array, slopes: Array, law: Law | None = None) -> Array | None:
    """Pressures x at which open sources give the flows + slopes (x - P), m3/s; law : their p is `law.pressure` of x."""
    x = P
    for _ in range(SMALL):
        with np.errstate(all="ignore"):
            p, dp = (x, 1.0) if law is None else (law.pressure(x), law.viscosity(law.pressure(x)))  # dp/dq = mu(p)/mu
            taken = flows + slopes @ (x - P)
            off, by_p, by_flow = np.array([one.sought(*at) for one, *at in zip(supplies, p, taken, strict=True)]).T
            matrix = by_flow[:, None] * slopes + np.diag(by_p * dp)
        if not (np.isfinite(matrix).all() and np.isfinite(off).all()):
            return None
        try:
            dx = np.linalg.solve(matrix, -off)
        except np.linalg.LinAlgError:
            return None
        x = x + dx
        if np.max(np.abs(dx)) <= SAME * np.max(np.abs(x)):
            break
    return x if (x > 0.0).all() else None


def supply_defects(problem: LubricationProblem, flows: Sequence[float]) -> list[float]:
    """What each source gives and the film takes differ by, as `Supply.defect` tells; 0 where p is given. Collective.

    flows : of `supply_flows`. A part of what the pressures drive through a supply's own faces is next to nothing.
    """
    held, s = problem.held, problem.scheme
    if held is None or not any(one.open for one in held.supplies):
        return []
    unit, P = volume_unit(problem), np.array([one.p for one in held.supplies])
    P = P if held.law is None else held.law.pressure(P)
    moved = unit * (s.diagonal * held.pressures(problem.p_unit) + np.abs(s.couette_W) + np.abs(s.couette_E))
    pressed = [problem.reduce.sum(np.where(held.owner == k, moved, 0.0)) for k in range(len(flows))]
    largest = max(map(abs, [*flows, *(one.flow or 0.0 for one in held.supplies)]))
    return [
        one.defect(p, flow, largest, IDLE * by, ROUNDINGS * 2.0**-53 * by) if one.open else 0.0
        for one, p, flow, by in zip(held.supplies, P.tolist(), flows, pressed, strict=True)
    ]
