"""Loops of the transposed film's multigrid (`adjoint`) over one rank's points, compiled when this module is imported.

Arrays have the frame of `kernels`. `full` says where the film is full. A point's row of J' is there

    sum of k (l_i - l_neighbour) = b_i,        and in the cavity        l_i - l_east = b_i:

void hands what is asked of it on to the east. All loops run from the outlet to the inlet, so that cavities are right at once.
"""

import numpy as np
from numpy.typing import NDArray

from ...base.compiled import kernel
from ...base.parallel import Array
from .fronts import reforms
from .transfer import share

Mask = NDArray[np.bool_]


@kernel
def sweep(l: Array, full: Mask, kx: Array, ky: Array, b: Array, down: bool) -> None:
    """One Gauss-Seidel sweep in place, each x line against the flow, lines upwards or down."""
    ny, nx = l.shape[0] - 2, l.shape[1] - 2
    given, east = np.empty(nx + 2), np.empty(nx + 2)
    for s in range(ny):
        m = ny - s if down else 1 + s
        for i in range(1, nx + 1):  # a loop of its own: it needs no neighbour's new value, and goes by vectors
            k_W, k_E, k_S, k_N = kx[m, i], kx[m, i + 1], ky[m, i], ky[m + 1, i]
            over = 1.0 / ((k_W + k_E) + (k_S + k_N))
            t = over * (b[m, i] + k_W * l[m, i - 1] + k_S * l[m - 1, i] + k_N * l[m + 1, i])
            given[i] = t if full[m, i] else b[m, i]
            east[i] = over * k_E if full[m, i] else 1.0
        value = l[m, nx + 1]
        for i in range(nx, 0, -1):
            value = given[i] + east[i] * value
            l[m, i] = value


@kernel
def residual_row(l: Array, full: Mask, kx: Array, ky: Array, b: Array, m: int, out: Array) -> None:
    """b - J' l of the points of row m into out[1:-1]."""
    for i in range(1, l.shape[1] - 1):
        here, east = l[m, i], l[m, i + 1]
        flows = (kx[m, i] * (here - l[m, i - 1]) + kx[m, i + 1] * (here - east)) + (
            ky[m, i] * (here - l[m - 1, i]) + ky[m + 1, i] * (here - l[m + 1, i])
        )
        out[i] = b[m, i] - (flows if full[m, i] else here - east)


@kernel
def residual(l: Array, full: Mask, kx: Array, ky: Array, b: Array, out: Array) -> None:
    """b - J' l at all of the rank's points."""
    for m in range(1, l.shape[0] - 1):
        residual_row(l, full, kx, ky, b, m, out[m])


@kernel
def restrict(
    l: Array, full: Mask, kx: Array, ky: Array, b: Array, out: Array, y0: int, by_x: bool, by_y: bool, ring: bool
) -> None:
    """Add to `out` what the residual of the full points gives to the coarse ones: `kernels.correct` transposed."""
    ny, nx = l.shape[0] - 2, l.shape[1] - 2
    r, part = np.zeros(nx + 2), np.zeros(nx + 2)
    for m in range(1, ny + 1):
        residual_row(l, full, kx, ky, b, m, r)
        for i in range(1, nx + 1):
            if not full[m, i]:
                r[i] = 0.0
        if by_x:
            for i in range(1, nx, 2):
                if full[m, i] and not full[m, i - 1] and full[m, i + 1]:
                    r[i + 1] += r[i]
                    r[i] = 0.0
        j = y0 + m - 1
        if not by_y:
            gather_row(r, kx, m, by_x, ring, 1.0, out[m])
        elif j % 2 == 1:
            gather_row(r, kx, m, by_x, ring, 0.5, out[(j - 1) // 2 - y0 // 2 + 1])
        else:
            row = j // 2 - y0 // 2
            for i in range(1, nx + 1):
                v = share(ky[m, i], ky[m + 1, i], True)
                if full[m, i]:
                    if not full[m - 1, i] and full[m + 1, i] and reforms(full, m - 1, i):  # type: ignore[arg-type]
                        v = 0.0
                    elif not full[m + 1, i] and full[m - 1, i] and reforms(full, m + 1, i):  # type: ignore[arg-type]
                        v = 1.0
                part[i] = v * r[i]
                r[i] -= part[i]
            gather_row(part, kx, m, by_x, ring, 0.5, out[row])
            gather_row(r, kx, m, by_x, ring, 0.5, out[row + 1])


@kernel
def gather_row(r: Array, kx: Array, m: int, by_x: bool, ring: bool, factor: float, out: Array) -> None:
    """Add a line's values, times the factor, to the coarse points of a line: `spread_row` transposed."""
    n = out.size - 2
    if not by_x:
        for k in range(1, n + 1):
            out[k] += factor * r[k]
        return
    for k in range(1, n + 1):
        out[k] += factor * r[2 * k]
    for k in range((r.size - 1) // 2):
        u = share(kx[m, 2 * k + 1], kx[m, 2 * k + 2], True)
        value = factor * r[2 * k + 1]
        to = n if ring and k == 0 else k
        out[to] += u * value
        out[k + 1] += (1.0 - u) * value


@kernel
def correct(l: Array, coarse: Array, kx: Array, ky: Array, y0: int, by_x: bool, by_y: bool) -> None:
    """Add the interpolated coarse grid's answer."""
    ny, nx = l.shape[0] - 2, l.shape[1] - 2
    south, north = np.zeros(nx + 2), np.zeros(nx + 2)
    for m in range(1, ny + 1):
        j = y0 + m - 1
        if by_y and j % 2 == 0:
            row = j // 2 - y0 // 2
            spread_row(coarse[row], kx, m, by_x, south)
            spread_row(coarse[row + 1], kx, m, by_x, north)
            for i in range(1, nx + 1):
                v = share(ky[m, i], ky[m + 1, i], True)
                l[m, i] += v * south[i] + (1.0 - v) * north[i]
        else:
            row = m if not by_y else (j + 1) // 2 - y0 // 2
            spread_row(coarse[row], kx, m, by_x, south)
            for i in range(1, nx + 1):
                l[m, i] += south[i]


@kernel
def spread_row(coarse: Array, kx: Array, m: int, by_x: bool, out: Array) -> None:
    """A coarse line's values at the points of row m, whose x faces give the weights."""
    if not by_x:
        out[:] = coarse
        return
    for k in range(1, coarse.size - 1):
        out[2 * k] = coarse[k]
    for k in range((out.size - 1) // 2):
        u = share(kx[m, 2 * k + 1], kx[m, 2 * k + 2], True)
        out[2 * k + 1] = u * coarse[k] + (1.0 - u) * coarse[k + 1]
