"""Iterates of slow cycles mixed so that their residuals cancel: what Krylov's methods do for cycles that are linear.

Deep pockets that coarse grids do not see leave a few slow modes, one pressure for each pocket's full part, while hardly a sign
still changes. The mixture is that of the last iterates with the least residual, at the points whose signs all of them share.
Others stay, and what that does to the balances beside them front sweeps put right. It is kept if ||G|| is less after these.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.compiled import kernel, piece
from ...base.parallel import Array
from . import held
from .kernels import balance_at
from .loops import by_inner_rows

KEPT = 4  # iterates, the newest among them
GAIN = 0.5  # part of ||G|| that a mixture has to promise: what it costs, and what fronts take of it
SETTLED = 1e-3  # part of the points at which signs may differ
RANK = 1e-12  # of the differences' inner products, relative: less is rounding


class Mixing:
    """The last iterates of a level, and their residuals. A checkpoint has none of them: a run taken up again begins anew."""

    def __init__(self, level: Any):
        self._level = level
        self._room = np.zeros((0, 2, 0, 0))  # z and residual of each; rows of the frame are not kept
        self._order: list[int] = []  # where iterates lie, the newest last

    def forget(self) -> None:
        self._order = []

    def improve(self, sweep_fronts: Callable[[Any], None]) -> bool:
        """Put a mixture of the iterates so far and the level's z in its place, if it is better. Collective."""
        level, z = self._level, self._level.z
        if not self._room.size:
            self._room = np.empty((KEPT, 2, *z.shape))
        own = self._look()
        if len(self._order) < 2:
            return False
        weights, promised, unsettled = self._weights()
        if unsettled > SETTLED * level.nx * level.ny:
            self._order = self._order[-1:]
            return False
        if not promised <= GAIN**2 * own:
            return False
        order = np.array(self._order)
        by_inner_rows(lambda start, end: mix(z, self._room, order, weights, start, end), z)
        level.share(z)
        sweep_fronts(level)
        if self._look() < own:
            del self._order[-2]
            return True
        z[1:-1] = self._room[self._order[-2], 0, 1:-1]
        level.share(z)
        self._order.pop()
        return False

    def _look(self) -> float:
        """Keep z and its residual, in the oldest one's place if there is no other; the sum of this one's squares."""
        level = self._level
        held.settle(level)
        self._order = self._order[1 - KEPT :]
        self._order.append(next(k for k in range(KEPT) if k not in self._order))
        given = level.z, level.kx, level.ky, level.c, level.carry, self._room[self._order[-1]]
        level.work += level.nx * (level.z.shape[0] - 2)
        return float(self._sum(by_inner_rows(lambda start, end: np.array(look(*given, start, end)), level.z)))

    def _weights(self) -> tuple[Array, float, float]:
        """Of all iterates but the newest, which has the rest of 1; what they leave where all signs agree; and at how many
        points these do not."""
        level, order = self._level, np.array(self._order)
        n = len(order) - 1
        found = self._sum(by_inner_rows(lambda start, end: products(self._room, order, start, end), level.z))
        level.work += level.nx * (level.z.shape[0] - 2)
        A, b = found[:n, :n], found[:n, n]
        scale = np.where(np.diag(A) > 0.0, np.sqrt(np.diag(A)), 1.0)
        weights = -np.linalg.lstsq(A / np.outer(scale, scale), b / scale, rcond=RANK)[0] / scale
        return weights, float(found[n, n] + 2.0 * weights @ b + weights @ A @ weights), float(found[n + 1, 0])

    def _sum(self, parts: list[Array]) -> Array:
        total, level = np.sum(parts, axis=0), self._level
        return total if level.comm is None else level.comm.allreduce(total)


@kernel
def look(z: Array, kx: Array, ky: Array, c: Array, carry: Array | None, out: Array, start: int, end: int) -> float:
    """Into out z and c - G(z) of rows start to end - 1; the sum of this one's squares."""
    squares, rest = np.zeros(z.shape[1]), np.zeros(z.shape[1])
    for m in range(start, end):
        for i in range(np.uint32(1), np.uint32(z.shape[1] - 1)):
            rest[i] = c[m, i] - balance_at(z, kx, ky, m, i, carry)
            squares[i] += rest[i] * rest[i]
        out[0, m], out[1, m] = z[m], rest
    return squares.sum()


@piece
def agreeing(room: Array, order: NDArray[np.int64], m: int, out: Array) -> None:
    """1 where all iterates are full in row m, -1 where all are cavitated, else 0."""
    for i in range(np.uint32(1), np.uint32(room.shape[3] - 1)):
        out[i] = 1.0 if room[order[0], 0, m, i] > 0.0 else -1.0
    for k in order[1:]:
        for i in range(np.uint32(1), np.uint32(room.shape[3] - 1)):
            out[i] = out[i] if (room[k, 0, m, i] > 0.0) == (out[i] > 0.0) else 0.0


@kernel
def products(room: Array, order: NDArray[np.int64], start: int, end: int) -> Array:
    """Inner products of the residuals' differences from the newest one, and of that, over points whose signs agree; and, below
    them, how many do not."""
    n, width, unsettled = order.size - 1, room.shape[3], 0
    signs, d, sums = np.zeros(width), np.zeros((n + 1, width)), np.zeros((n + 1, n + 1, width))
    for m in range(start, end):
        agreeing(room, order, m, signs)
        for i in range(np.uint32(1), np.uint32(width - 1)):
            unsettled += signs[i] == 0.0
        for i in range(np.uint32(1), np.uint32(width - 1)):
            d[n, i] = room[order[n], 1, m, i] if signs[i] != 0.0 else 0.0
        for k in range(n):
            for i in range(np.uint32(1), np.uint32(width - 1)):
                d[k, i] = room[order[k], 1, m, i] - d[n, i] if signs[i] != 0.0 else 0.0
        for k in range(n + 1):
            for q in range(k + 1):
                for i in range(np.uint32(1), np.uint32(width - 1)):
                    sums[k, q, i] += d[k, i] * d[q, i]
    out = np.zeros((n + 2, n + 1))
    out[n + 1, 0] = unsettled
    for k in range(n + 1):
        for q in range(k + 1):
            out[k, q] = out[q, k] = sums[k, q].sum()
    return out


@kernel
def mix(z: Array, room: Array, order: NDArray[np.int64], weights: Array, start: int, end: int) -> None:
    """The newest iterate plus weights times the others' differences from it, where no sign is another then."""
    signs, new = np.zeros(z.shape[1]), np.zeros(z.shape[1])
    for m in range(start, end):
        agreeing(room, order, m, signs)
        new[:] = z[m]
        for k in range(weights.size):
            for i in range(np.uint32(1), np.uint32(z.shape[1] - 1)):
                new[i] += weights[k] * (room[order[k], 0, m, i] - z[m, i])
        for i in range(np.uint32(1), np.uint32(z.shape[1] - 1)):
            z[m, i] = new[i] if signs[i] != 0.0 and (new[i] > 0.0) == (signs[i] > 0.0) else z[m, i]
