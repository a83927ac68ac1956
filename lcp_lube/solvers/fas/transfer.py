"""Between a grid and the next coarser one: residuals and corrections; arrays as in `kernels`."""

import numpy as np

from ...base.compiled import kernel, piece
from ...base.parallel import Array
from .fronts import reforms
from .kernels import balance_at
from .weights import Ways, centre, share, stored_shares, west_shares


@kernel
def restrict(
    z: Array,
    kx: Array,
    ky: Array,
    c: Array,
    out: Array,
    y0: int,
    by_x: bool,
    by_y: bool,
    harmonic: bool,
    wrap: bool,
    residual: bool,
    carry: Array | None = None,
    ways: Ways | None = None,
    start: int = 0,
    end: int = 0,
) -> None:
    """Add to `out` what the rank's rows of the residual c - G(z), or of c, give to the coarse points; to rows start to end - 1.

    That is the transposed interpolation, halved where lines are coarsened: a row is a balance per unit width. Coarse points
    stand at the odd rows and columns, counted from 0 over the whole grid; the rank's first row is y0, and row 0 of `out` is
    the coarse line y0 // 2 - 1. ways : of a film with steps (`steps`).
    """
    ny, nx = z.shape[0] - 2, z.shape[1] - 2
    n_coarse, end = out.shape[1] - 2, end if end else out.shape[0]
    first, last = (2 * (start - 1 + y0 // 2) - y0 + 1, 2 * (end - 1 + y0 // 2) - y0 + 1) if by_y else (start, end - 1)
    parts = np.zeros((2, nx + 2))
    r, w, coarse, south = np.zeros(nx + 2), np.zeros(n_coarse + 1), np.zeros(n_coarse + 2), np.zeros(n_coarse + 2)
    for m in range(max(first, 1), min(last, ny) + 1):
        for i in range(np.uint32(1), np.uint32(nx + 1)):
            r[i] = c[m, i] - balance_at(z, kx, ky, m, i, carry) if residual else c[m, i]
        j = y0 + m - 1
        if ways is not None and j % 2 == 0:
            row = j // 2 - y0 // 2
            to_sides(r, kx, ky, ways, m, wrap, parts)
            for n in range(2):
                if start <= row + n < end:
                    stored_shares(ways, m - 1 + 2 * n, w)
                    restrict_row(parts[n], w, by_x, wrap, coarse)
                    for k in range(1, n_coarse + 1):
                        out[row + n, k] += 0.5 * coarse[k]
            continue
        if ways is not None:
            stored_shares(ways, m, w)
        elif by_x:
            west_shares(kx, m, harmonic, wrap, w)
        restrict_row(r, w, by_x, wrap, coarse)
        if not by_y:
            for k in range(1, n_coarse + 1):
                out[m, k] += coarse[k]
        elif j % 2 == 1:
            row = (j - 1) // 2 - y0 // 2 + 1
            if start <= row < end:
                for k in range(1, n_coarse + 1):
                    out[row, k] += 0.5 * coarse[k]
        else:
            row = j // 2 - y0 // 2
            if by_x:
                for k in range(1, n_coarse + 1):
                    south[k] = share(ky[m, 2 * k], ky[m + 1, 2 * k], harmonic)
            else:
                for k in range(1, n_coarse + 1):
                    south[k] = share(ky[m, k], ky[m + 1, k], harmonic)
            for k in range(1, n_coarse + 1):
                part = 0.5 * south[k] * coarse[k]
                if row >= start:
                    out[row, k] += part
                if row + 1 < end:
                    out[row + 1, k] += 0.5 * coarse[k] - part


@piece
def to_sides(r: Array, kx: Array, ky: Array, ways: Ways, m: int, wrap: bool, parts: Array) -> None:
    """Into parts what r of row m, between two coarse lines, gives to the points of the southern and of the northern one."""
    nx = r.size - 2
    for i in range(1, nx + 1, 2):
        W, E, S, N = centre(kx[m, i], kx[m, i + 1], ky[m, i], ky[m + 1, i])
        parts[0, i], parts[1, i] = S * r[i], N * r[i]
        if i > 1 or wrap:
            r[i - 1 if i > 1 else nx] += W * r[i]
        r[i + 1] += E * r[i]
    for i in range(2, nx + 1, 2):
        parts[0, i] = ways[m, i] * r[i]
        parts[1, i] = r[i] - parts[0, i]


@piece
def restrict_row(r: Array, w: Array, by_x: bool, wrap: bool, out: Array) -> None:
    """What a line's values, zero in the frame, give to the coarse points of a line: `interpolate_row` transposed."""
    if not by_x:
        out[:] = r
        return
    n = out.size - 2
    for k in range(1, n + 1):
        out[k] = r[2 * k] + ((1.0 - w[k - 1]) * r[2 * k - 1] + w[k] * r[2 * k + 1])
    if wrap:  # periodic in x: what goes to the frame belongs to the last point, and of an odd number to the first
        out[n] += w[0] * r[1]
        out[1] += (1.0 - w[n]) * r[2 * n + 1]


@kernel
def inject(z: Array, out: Array, y0: int, by_x: bool, by_y: bool, start: int = 0, end: int = 0) -> None:
    """The values at the coarse points that are among the rank's; rows start + 1 to end."""
    sx, sy = 2 if by_x else 1, 2 if by_y else 1
    shift = (1 - y0 % 2 if by_y else 0) + 1  # row of the first coarse line among the rank's
    for J in range(start, end if end else out.shape[0] - 2):
        for k in range(1, out.shape[1] - 1):
            out[J + 1, k] = z[shift + sy * J, sx * k]


@kernel
def correct(
    z: Array,
    new: Array,
    old: Array,
    kx: Array,
    ky: Array,
    y0: int,
    by_x: bool,
    by_y: bool,
    harmonic: bool,
    truncation: int,
    ring: bool = False,
    unit: float = 1.0,
    start: int = 1,
    end: int = 0,
) -> float:
    """Add the interpolated new - old of the coarse grid; returns the sum of squares of what was added.

    In rows start to end - 1: of the others they see whether the film is full, which is not changed.

    Where the film reforms, what flows back into the cavity returns: a point between that and a coarse point in the full film is
    corrected as the latter, not by a part of it.
    truncation: 0 none; 1 that, and a point that would cross its front stops there; 2 no correction at all at points that
    would, or that have a coarse neighbour that lies, or lay, on the other side.
    unit: the pressure that counts as a flow of void of 1, where a neighbour's correction is of the one and the point's of the
    other.
    """
    nx, size, per_unit = z.shape[1] - 2, new.shape[1], 1.0 / unit
    w, d = np.zeros(size - 1), np.zeros(size)
    south, north, e, added = np.zeros(nx + 2), np.zeros(nx + 2), np.zeros(nx + 2), np.zeros(nx + 2)
    for m in range(start, end if end else z.shape[0] - 1):
        row, last = coarse_rows(y0 + m - 1, y0, m, by_y)
        if by_x:
            west_shares(kx, m, harmonic, ring, w)
        for k in range(size):
            d[k] = alike(new[row, k], unit) - alike(old[row, k], unit)
        interpolate_row(d, w, by_x, south)
        if last > row:
            for k in range(size):
                d[k] = alike(new[last, k], unit) - alike(old[last, k], unit)
            interpolate_row(d, w, by_x, north)
            mix(south, north, ky, m, harmonic, e)
            if truncation == 1:
                follow_across(z, m, south, north, ring, e)
        else:
            e[:] = south
        if truncation == 1 and by_x:
            follow_along(z, m, e)
        if truncation == 2:
            drop(z, m, new, old, row, last, by_x, e)
        for i in range(1, nx + 1):
            here = z[m, i]
            z[m, i] = moved(here, e[i] if here > 0.0 else e[i] * per_unit, truncation)
            added[i] += (z[m, i] - here) ** 2
    return added.sum()


@piece
def follow_across(z: Array, m: int, south: Array, north: Array, ring: bool, e: Array) -> None:
    """Where the film reforms, points of row m corrected as the coarse line in full film beside it is."""
    if not differ(z, m - 1, m + 1):
        return
    for i in range(1, z.shape[1] - 1):
        if z[m, i] > 0.0:
            if z[m - 1, i] <= 0.0 and z[m + 1, i] > 0.0 and reforms(z, m - 1, i, ring):
                e[i] = north[i]
            elif z[m + 1, i] <= 0.0 and z[m - 1, i] > 0.0 and reforms(z, m + 1, i, ring):
                e[i] = south[i]


@piece
def follow_along(z: Array, m: int, e: Array) -> None:
    """The same of points behind a cavitated one, by the next point to the east."""
    for i in range(1, z.shape[1] - 1, 2):
        if z[m, i] > 0.0 and z[m, i - 1] <= 0.0 and z[m, i + 1] > 0.0:
            e[i] = e[i + 1 if i + 1 < z.shape[1] - 1 else 1]


@piece
def drop(z: Array, m: int, new: Array, old: Array, row: int, last: int, by_x: bool, e: Array) -> None:
    """No correction of points with a coarse neighbour that lies, or lay, on the other side of the front."""
    for i in range(1, z.shape[1] - 1):
        left, right = (i // 2, (i + 1) // 2) if by_x else (i, i)
        full = z[m, i] > 0.0
        for J in (row, last):
            for k in (left, right):
                if ((new[J, k] > 0.0) != full or (old[J, k] > 0.0) != full) and new[J, k] != old[J, k]:
                    e[i] = 0.0


@piece
def moved(here: float, by: float, truncation: int) -> float:
    """z after a correction, which stops at a front, or is none there (`correct`)."""
    there = here + by
    if truncation > 0 and (there > 0.0) != (here > 0.0):
        return here if truncation == 2 else 1e-300 if here > 0.0 else -1e-300
    return there


@piece
def alike(z: float, unit: float) -> float:
    """z, of which flows of void are told as pressures."""
    return z if z > 0.0 else unit * z


@piece
def coarse_rows(j: int, y0: int, m: int, by_y: bool) -> tuple[int, int]:
    """Rows of the coarse lines south and north of the fine line j, which is the rank's row m; one where it is among them."""
    if not by_y:
        return m, m
    row = (j + 1) // 2 - y0 // 2
    return row, row + 1 - j % 2


@piece
def differ(z: Array, a: int, b: int) -> bool:
    """Whether two rows are full at different points."""
    count = 0
    for i in range(z.shape[1]):
        count += (z[a, i] > 0.0) != (z[b, i] > 0.0)
    return count > 0


@piece
def interpolate_row(coarse: Array, w: Array, by_x: bool, out: Array) -> None:
    """A coarse line's values at all points of a line; w: `west_shares`."""
    if not by_x:
        out[:] = coarse
        return
    for k in range(out.size // 2):
        out[2 * k] = coarse[k]
        out[2 * k + 1] = w[k] * coarse[k] + (1.0 - w[k]) * coarse[k + 1]


@piece
def mix(south: Array, north: Array, ky: Array, m: int, harmonic: bool, out: Array) -> None:
    """Row m between two lines, by the conductances of the y faces to them."""
    for i in range(1, out.size - 1):
        v = share(ky[m, i], ky[m + 1, i], harmonic)
        out[i] = v * south[i] + (1.0 - v) * north[i]
