"""Pressures at which what sources give is what a film takes."""

from collections.abc import Sequence

import numpy as np

from ...base.parallel import Array
from .fluid import Law
from .supplies import Supply

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
