"""Between a grid and the next coarser one with the signs of a solution frozen (`frozen`): what a nonlinear cycle does with
its corrections, and transposed. Arrays as in `kernels`, one right-hand side at a time."""

import numpy as np

from ...base.compiled import kernel, piece
from ...base.parallel import Array
from .fronts import reforms
from .frozen_kernels import Mask, transposed_row
from .transfer import coarse_rows, interpolate_row, mix
from .weights import share, west_shares


@piece
def sides_of(ky: Array, full: Mask, m: int, out: Array, ring: bool) -> None:
    """Weights of the coarse line south of row m at its points.

    Where the film reforms, what flows back into the cavity returns: a point between that and a coarse point in the full film
    is corrected as the latter.
    """
    fronts = 0
    for i in range(1, out.size - 1):
        out[i] = share(ky[m, i], ky[m + 1, i], True)
        fronts += full[m, i] & (full[m - 1, i] != full[m + 1, i])
    for i in range(1, out.size - 1 if fronts else 1):
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
    nx, size, one = z.shape[1] - 2, coarse.shape[1], z.dtype.type(1)
    w, (v, south, north) = np.zeros(size - 1, z.dtype), np.zeros((3, nx + 2), z.dtype)
    for m in range(1, z.shape[0] - 1):
        row, last = coarse_rows(y0 + m - 1, y0, m, by_y)
        if by_x:
            west_shares(kx, m, True, ring, w)
        interpolate_row(coarse[row], w, by_x, south)
        if last > row:
            interpolate_row(coarse[last], w, by_x, north)
            if fronts:
                sides_of(ky, full, m, v, ring)
                for i in range(1, nx + 1):
                    south[i] = v[i] * south[i] + (one - v[i]) * north[i]
            else:
                mix(south, north, ky, m, True, south)
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
    w, v, here = np.zeros(size - 1, l.dtype), np.zeros(nx + 2, l.dtype), np.zeros(nx + 2, l.dtype)
    for m in range(1, l.shape[0] - 1):
        transposed_row(l, full, free, kx, ky, c, carry, m, here)
        fronts = 0
        for i in range(1, nx + 1):
            here[i] *= full[m, i]
        for i in range(1, nx + 1):
            fronts += full[m, i] > full[m, i - 1]
        if by_x:
            west_shares(kx, m, True, ring, w)
            for i in range(1, nx if fronts else 1, 2):
                if full[m, i] and not full[m, i - 1] and full[m, i + 1]:
                    here[i + 1] += here[i]
                    here[i] = 0.0
        row, last = coarse_rows(y0 + m - 1, y0, m, by_y)
        if last > row:
            sides_of(ky, full, m, v, ring)
            deal(here, v, w, by_x, ring, out[row], out[last])
        else:
            deal_to_one(here, w, by_x, ring, 0.5 if by_y else 1.0, out[last])


@kernel
def hand_on(c: Array, full: Mask, carry: Array | None, out: Array, y0: int, by_x: bool, by_y: bool) -> None:
    """Of J' l = c, what coarse points in a cavity ask for: what the next point asks of them too, as l_i - carry l_east = c_i.

    At its end they go on for as long, that what the full film is given there, k (l_i - l_east), be that of the fine grid.
    """
    sx, sy = 2 if by_x else 1, 2 if by_y else 1
    shift = (1 - y0 % 2 if by_y else 0) + 1  # as in `transfer.inject`
    for J in range(out.shape[0] - 2):
        m = shift + sy * J
        for k in range(1, out.shape[1] - 1):
            i = sx * k
            if not full[m, i]:
                after = c[m, i] if full[m, i + 1] else c[m, i + 1]
                if carry is not None:
                    after *= carry[m, i]
                out[J + 1, k] = c[m, i] + (after if by_x else c.dtype.type(0))


@piece
def deal(r: Array, v: Array, w: Array, by_x: bool, ring: bool, south: Array, north: Array) -> None:
    """Half of what a line between two coarse ones, zero in the frame, gives to the points of these, v of it to the south."""
    half, one = r.dtype.type(0.5), r.dtype.type(1)
    if not by_x:
        for i in range(1, r.size - 1):
            part = v[i] * r[i]
            south[i] += half * part
            north[i] += half * (r[i] - part)
        return
    for k in range(1, south.size - 1):
        west, east = half * (one - w[k - 1]) * r[2 * k - 1], half * w[k] * r[2 * k + 1]
        part = v[2 * k] * (half * r[2 * k]) + (v[2 * k - 1] * west + v[2 * k + 1] * east)
        south[k] += part
        north[k] += half * r[2 * k] + (west + east) - part
    if ring:  # what goes to the frame belongs to the last point, and to the first
        first = half * w[0] * r[1]
        south[-2] += v[1] * first
        north[-2] += (one - v[1]) * first
        at = 2 * w.size - 1
        last = half * (one - w[-1]) * r[at]
        south[1] += v[at] * last
        north[1] += (one - v[at]) * last


@piece
def deal_to_one(r: Array, w: Array, by_x: bool, ring: bool, part: float, out: Array) -> None:
    """That part of what a line on a coarse one gives to its points."""
    one, some = r.dtype.type(1), r.dtype.type(part)
    if not by_x:
        out += some * r
        return
    for k in range(1, out.size - 1):
        out[k] += some * (r[2 * k] + ((one - w[k - 1]) * r[2 * k - 1] + w[k] * r[2 * k + 1]))
    if ring:
        out[-2] += some * w[0] * r[1]
        out[1] += some * (one - w[-1]) * r[2 * w.size - 1]
