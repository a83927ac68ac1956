"""Between a grid and the next coarser one with the signs of a solution frozen (`frozen`): what a nonlinear cycle does with
its corrections, and transposed. Arrays as in `kernels`, one right-hand side at a time."""

import numpy as np

from ...base.compiled import kernel
from ...base.parallel import Array
from .fronts import reforms
from .frozen_kernels import Mask, transposed_row
from .transfer import coarse_rows, interpolate_row, mix, restrict_row, share, west_shares


@kernel
def sides_of(ky: Array, full: Mask, m: int, out: Array, ring: bool) -> None:
    """Weights of the coarse line south of row m at its points.

    Where the film reforms, what flows back into the cavity returns: a point between that and a coarse point in the full film
    is corrected as the latter.
    """
    for i in range(1, out.size - 1):
        out[i] = share(ky[m, i], ky[m + 1, i], True)
        if full[m, i]:
            if not full[m - 1, i] and full[m + 1, i] and reforms(full, m - 1, i, ring):  # type: ignore[arg-type]
                out[i] = 0.0
            elif not full[m + 1, i] and full[m - 1, i] and reforms(full, m + 1, i, ring):  # type: ignore[arg-type]
                out[i] = 1.0


@kernel
def correct(
    z: Array, full: Mask, coarse: Array, kx: Array, ky: Array, y0: int, by_x: bool, by_y: bool, ring: bool, fronts: bool
) -> None:
    """Add the interpolated coarse grid's answer; with fronts at the full points alone, as `sides_of` says."""
    nx, size = z.shape[1] - 2, coarse.shape[1]
    w, v, south, north = np.zeros(size - 1), np.zeros(nx + 2), np.zeros(nx + 2), np.zeros(nx + 2)
    for m in range(1, z.shape[0] - 1):
        row, last = coarse_rows(y0 + m - 1, y0, m, by_y)
        if by_x:
            west_shares(kx[m], True, w)
        interpolate_row(coarse[row], w, by_x, south)
        if last > row:
            interpolate_row(coarse[last], w, by_x, north)
            if fronts:
                sides_of(ky, full, m, v, ring)
                for i in range(1, nx + 1):
                    south[i] = v[i] * south[i] + (1.0 - v[i]) * north[i]
            else:
                mix(south, north, ky[m], ky[m + 1], True, south)
        if fronts and by_x:
            for i in range(1, nx, 2):
                if full[m, i] and not full[m, i - 1] and full[m, i + 1]:
                    south[i] = south[i + 1]
        for i in range(1, nx + 1):
            if full[m, i] or not fronts:
                z[m, i] += south[i]


@kernel
def restrict(
    l: Array, full: Mask, free: Mask | None, kx: Array, ky: Array, c: Array, carry: Array | None,
    out: Array, y0: int, by_x: bool, by_y: bool, ring: bool,
) -> None:  # fmt: skip
    """Add to `out` what c - J' l of the full points gives to the coarse ones: `correct` with fronts, transposed."""
    nx, size = l.shape[1] - 2, out.shape[1]
    w, line, part, v = np.zeros(size - 1), np.zeros(size), np.zeros(nx + 2), np.zeros(nx + 2)
    here = np.zeros(nx + 2)
    for m in range(1, l.shape[0] - 1):
        transposed_row(l, full, free, kx, ky, c, carry, m, here)
        for i in range(1, nx + 1):
            if not full[m, i]:
                here[i] = 0.0
        if by_x:
            west_shares(kx[m], True, w)
            for i in range(1, nx, 2):
                if full[m, i] and not full[m, i - 1] and full[m, i + 1]:
                    here[i + 1] += here[i]
                    here[i] = 0.0
        row, last = coarse_rows(y0 + m - 1, y0, m, by_y)
        if last > row:
            sides_of(ky, full, m, v, ring)
            for i in range(1, nx + 1):
                part[i] = v[i] * here[i]
                here[i] -= part[i]
            restrict_row(part, w, by_x, ring, line)
            out[row] += 0.5 * line
        restrict_row(here, w, by_x, ring, line)
        out[last] += 0.5 * line if by_y else line
