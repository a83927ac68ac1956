"""Weights of interpolation between a grid and the next coarser one, by conductances; arrays as in `kernels`."""

import numpy as np
from numpy.typing import NDArray

from ...base.compiled import piece
from ...base.parallel import Array

Ways = NDArray[np.float32]


@piece
def share(a: float, b: float, harmonic: bool) -> float:
    """Weight of the neighbour behind conductance a, 1 minus that of the one behind b, in the interpolation between them."""
    return a / (a + b) if a + b > 0.0 and (harmonic or a == 0.0 or b == 0.0) else 0.5


@piece
def series(a: float, b: float) -> float:
    """Conductance of two faces one behind the other; one that lies in a supply, -1, resists nothing (`held.marked`)."""
    total = a + b
    both = a * b / total if total > 0.0 else 0.0
    return max(a, b, 0.0) if min(a, b) < 0.0 else both


@piece
def west_shares(kx: Array, m: int, harmonic: bool, ring: bool, out: Array) -> None:
    """Weights of the west neighbours of the points of row m between two coarse ones, and behind the last one.

    Round a ring of an odd number of points the last one and the first lie between the same two coarse ones.
    """
    n = min(out.size, (kx.shape[1] - 1) // 2)
    for k in range(n):
        out[k] = share(kx[m, 2 * k + 1], kx[m, 2 * k + 2], harmonic)
    out[n:] = 0.5
    if ring and kx.shape[1] % 2 == 0:
        before, seam, behind = kx[m, 2 * n - 1], kx[m, 1], kx[m, 2]
        out[0] = share(series(before, seam), behind, harmonic)
        out[n - 1] = share(before, series(seam, behind), harmonic)


@piece
def stored_shares(ways: Ways, m: int, out: Array) -> None:
    """The same as `steps` has made them."""
    n = min(out.size, ways.shape[1] // 2)
    for k in range(n):
        out[k] = ways[m, 2 * k + 1]
    out[n:] = 0.5


@piece
def centre(W: float, E: float, S: float, N: float) -> tuple[float, float, float, float]:
    """Weights of the four neighbours of a point between four coarse ones, by the conductances to them."""
    total = W + E + S + N
    over = 1.0 / total if total > 0.0 else 0.0
    return W * over, E * over, S * over, N * over
