"""Between a grid and the next coarser one with the signs of a solution frozen (`frozen`): what a nonlinear cycle does with
its corrections, and transposed. Arrays as in `kernels`, one right-hand side at a time."""

import numpy as np

from ...base.compiled import kernel
from ...base.parallel import Array
from .fronts import reforms
from .frozen_kernels import Mask
from .transfer import share


@kernel
def sides_of(ky: Array, full: Mask, m: int, out: Array) -> None:
    """Weights of the coarse line south of row m at its points.

    Where the film reforms, what flows back into the cavity returns: a point between that and a coarse point in the full film
    is corrected as the latter.
    """
    for i in range(1, out.size - 1):
        out[i] = share(ky[m, i], ky[m + 1, i], True)
        if full[m, i]:
            if not full[m - 1, i] and full[m + 1, i] and reforms(full, m - 1, i):  # type: ignore[arg-type]
                out[i] = 0.0
            elif not full[m + 1, i] and full[m - 1, i] and reforms(full, m + 1, i):  # type: ignore[arg-type]
                out[i] = 1.0


@kernel
def correct(z: Array, full: Mask, coarse: Array, kx: Array, ky: Array, y0: int, by_x: bool, by_y: bool, fronts: bool) -> None:
    """Add the interpolated coarse grid's answer; with fronts at the full points alone, as `sides_of` says."""
    ny, nx = z.shape[0] - 2, z.shape[1] - 2
    south, north, v = np.zeros(nx + 2), np.zeros(nx + 2), np.zeros(nx + 2)
    for m in range(1, ny + 1):
        j = y0 + m - 1
        if by_y and j % 2 == 0:
            row = j // 2 - y0 // 2
            spread_row(coarse[row], kx, m, by_x, south)
            spread_row(coarse[row + 1], kx, m, by_x, north)
            if fronts:
                sides_of(ky, full, m, v)
            else:
                for i in range(1, nx + 1):
                    v[i] = share(ky[m, i], ky[m + 1, i], True)
            for i in range(1, nx + 1):
                south[i] = v[i] * south[i] + (1.0 - v[i]) * north[i]
        else:
            row = m if not by_y else (j + 1) // 2 - y0 // 2
            spread_row(coarse[row], kx, m, by_x, south)
        if fronts and by_x:
            for i in range(1, nx, 2):
                if full[m, i] and not full[m, i - 1] and full[m, i + 1]:
                    south[i] = south[i + 1]
        for i in range(1, nx + 1):
            if full[m, i] or not fronts:
                z[m, i] += south[i]


@kernel
def restrict(r: Array, full: Mask, kx: Array, ky: Array, out: Array, y0: int, by_x: bool, by_y: bool, ring: bool) -> None:
    """Add to `out` what the residual r of the full points gives to the coarse ones: `correct` with fronts, transposed.

    r is lost.
    """
    ny, nx = r.shape[0] - 2, r.shape[1] - 2
    part, v = np.zeros(nx + 2), np.zeros(nx + 2)
    for m in range(1, ny + 1):
        here = r[m]
        for i in range(1, nx + 1):
            if not full[m, i]:
                here[i] = 0.0
        if by_x:
            for i in range(1, nx, 2):
                if full[m, i] and not full[m, i - 1] and full[m, i + 1]:
                    here[i + 1] += here[i]
                    here[i] = 0.0
        j = y0 + m - 1
        if not by_y:
            gather_row(here, kx, m, by_x, ring, 1.0, out[m])
        elif j % 2 == 1:
            gather_row(here, kx, m, by_x, ring, 0.5, out[(j - 1) // 2 - y0 // 2 + 1])
        else:
            row = j // 2 - y0 // 2
            sides_of(ky, full, m, v)
            for i in range(1, nx + 1):
                part[i] = v[i] * here[i]
                here[i] -= part[i]
            gather_row(part, kx, m, by_x, ring, 0.5, out[row])
            gather_row(here, kx, m, by_x, ring, 0.5, out[row + 1])


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
