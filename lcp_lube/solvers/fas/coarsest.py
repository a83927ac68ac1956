"""The coarsest grid of nonlinear multigrid in use: solved to rounding (`exact`), on every rank.

The factors of its Jacobian are kept: as cycles end, the signs of z are those of the visit before.
"""

import numpy as np

from . import exact
from .levels import Level, empty

MOST_ENTRIES = 9_000_000  # of a banded matrix that is eliminated


def solve(level: Level) -> bool:
    """Newton's method on a level, on every rank if it is dealt to several; whether it settled. Collective."""
    comm, nx, n = level.comm, level.nx, level.ny
    if nx * n * (4 * min(nx, n) + 1) > MOST_ENTRIES:  # an odd number of lines between periodic sides of y
        return False
    if level.factors is None:
        room = np.empty((nx * n, exact.entries(nx, n, *level.periodic)))
        level.factors = room, np.zeros((n + 2, nx + 2), dtype=np.int8)
    if comm is None or not level.split:
        return exact.solve(level.z, level.kx, level.ky, level.c, *level.periodic, level.carry, level.held, *level.factors)
    whole = empty(nx, n, 0, n, None, False, level.periodic)
    whole.carry = None if level.carry is None else np.zeros((2, *whole.z.shape))
    whole.held = None if level.held is None else np.zeros(whole.z.shape, dtype=bool)
    for name in ("z", "c", "kx", "ky", *(name for name in ("carry", "held") if getattr(whole, name) is not None)):
        mine, out = getattr(level, name), getattr(whole, name)
        rows = mine[..., 1 if level.y0 else 0 : level.y1 - level.y0 + 1 if level.y1 < n else None, :]
        np.concatenate(comm.allgather(np.ascontiguousarray(rows)), axis=-2, out=out)
    settled = exact.solve(whole.z, whole.kx, whole.ky, whole.c, *level.periodic, whole.carry, whole.held, *level.factors)
    level.z[:] = whole.z[level.y0 : level.y1 + 2]
    return settled
