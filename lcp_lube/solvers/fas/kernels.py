"""Loops of the nonlinear multigrid over one rank's points, compiled when this module is imported.

Arrays have a frame of neighbours (`levels.Level`): point (j, i) of the rank stands at z[j + 1, i + 1], its west and east
face at kx[j + 1, i + 1] and kx[j + 1, i + 2], its south and north face at ky[j + 1, i + 1] and ky[j + 2, i + 1]. z > 0 is a
pressure, z < 0 minus the flow of void -b_C r that leaves the cell. With it the balance of a point is

    G_i = sum of k (p_i - p_neighbour) - q_i + q_west,    p = max(z, 0), q = max(-z, 0):

B has the entries -1 and 1, on every level.
"""

import numpy as np
from numpy.typing import NDArray

from ...base.compiled import kernel
from ...base.parallel import Array

REACH = 8  # cells within which a cavity ends, if it does so at the front that is looked at


@kernel
def sweep(z: Array, kx: Array, ky: Array, c: Array, count: int, down: bool) -> None:
    """`count` nonlinear Gauss-Seidel sweeps in place, every x line along the flow, lines upwards or down.

    Three at a time: the second one follows the first a line and a point behind, the third one the second. The values are those
    of sweeps one after the other, but memory is passed over once, and three chains of dependent operations overlap.
    """
    ny, nx = z.shape[0] - 2, z.shape[1] - 2
    step, first = (-1, ny) if down else (1, 1)
    left = count
    if nx > 3:
        diagonals = np.empty((3, nx + 2))
        while left >= 3:
            for s in range(ny + 2):
                m = first + step * s
                if s < ny:
                    inverse_diagonal(kx, ky, m, diagonals[s % 3])
                if 2 <= s < ny:
                    three = (diagonals[s % 3], diagonals[(s - 1) % 3], diagonals[(s - 2) % 3])
                    relax_three(z, kx, ky, c, m, m - step, m - 2 * step, three[0], three[1], three[2])
                    continue
                for lag in range(3):
                    if lag <= s < ny + lag:
                        relax(z, kx, ky, c, m - lag * step, 1, nx + 1)
            left -= 3
    for _ in range(left):
        for s in range(ny):
            relax(z, kx, ky, c, first + step * s, 1, nx + 1)


@kernel
def inverse_diagonal(kx: Array, ky: Array, m: int, out: Array) -> None:
    """One over the sum of the conductances of the points of row m, into out[1:-1]."""
    for i in range(1, out.size - 1):
        out[i] = 1.0 / ((kx[m, i] + kx[m, i + 1]) + (ky[m, i] + ky[m + 1, i]))


@kernel
def relax_three(
    z: Array, kx: Array, ky: Array, c: Array, m1: int, m2: int, m3: int, over1: Array, over2: Array, over3: Array
) -> None:
    """`relax` on the whole of rows m1, m2 and m3, each a point behind the one before; over: one over their diagonals."""
    nx = z.shape[1] - 2
    relax(z, kx, ky, c, m1, 1, 3)
    relax(z, kx, ky, c, m2, 1, 2)
    # Shifted so that one index serves all three; their own, southern and northern rows of z may be one another's.
    z1, z2, z3 = z[m1, 2:], z[m2, 1:], z[m3]
    e1, e2, e3 = z[m1, 3:], z[m2, 2:], z[m3, 1:]
    s1, s2, s3 = z[m1 - 1, 2:], z[m2 - 1, 1:], z[m3 - 1]
    n1, n2, n3 = z[m1 + 1, 2:], z[m2 + 1, 1:], z[m3 + 1]
    c1, c2, c3 = c[m1, 2:], c[m2, 1:], c[m3]
    kw1, kw2, kw3 = kx[m1, 2:], kx[m2, 1:], kx[m3]
    ke1, ke2, ke3 = kx[m1, 3:], kx[m2, 2:], kx[m3, 1:]
    ks1, ks2, ks3 = ky[m1, 2:], ky[m2, 1:], ky[m3]
    kn1, kn2, kn3 = ky[m1 + 1, 2:], ky[m2 + 1, 1:], ky[m3 + 1]
    over1, over2 = over1[2:], over2[1:]
    w1, w2, w3 = z1[0], z2[0], z3[0]
    for i in range(1, nx - 1):
        k1, k2, k3, d1, d2, d3 = kw1[i], kw2[i], kw3[i], over1[i], over2[i], over3[i]
        t1 = c1[i] + ke1[i] * max(e1[i], 0.0) + ks1[i] * max(s1[i], 0.0) + kn1[i] * max(n1[i], 0.0)
        t2 = c2[i] + ke2[i] * max(e2[i], 0.0) + ks2[i] * max(s2[i], 0.0) + kn2[i] * max(n2[i], 0.0)
        t3 = c3[i] + ke3[i] * max(e3[i], 0.0) + ks3[i] * max(s3[i], 0.0) + kn3[i] * max(n3[i], 0.0)
        t1 += w1 * (k1 if w1 > 0.0 else 1.0)
        t2 += w2 * (k2 if w2 > 0.0 else 1.0)
        t3 += w3 * (k3 if w3 > 0.0 else 1.0)
        w1 = t1 * (d1 if t1 > 0.0 else 1.0)
        w2 = t2 * (d2 if t2 > 0.0 else 1.0)
        w3 = t3 * (d3 if t3 > 0.0 else 1.0)
        z1[i], z2[i], z3[i] = w1, w2, w3
    relax(z, kx, ky, c, m2, nx, nx + 1)
    relax(z, kx, ky, c, m3, nx - 1, nx + 1)


@kernel
def relax(z: Array, kx: Array, ky: Array, c: Array, m: int, start: int, end: int) -> None:
    """The points of row m in columns start to end - 1, one after the other: each balance has one solution."""
    west = z[m, start - 1]
    for i in range(start, end):
        k_W, k_E, k_S, k_N = kx[m, i], kx[m, i + 1], ky[m, i], ky[m + 1, i]
        t = c[m, i] + k_E * max(z[m, i + 1], 0.0) + k_S * max(z[m - 1, i], 0.0) + k_N * max(z[m + 1, i], 0.0)
        t += k_W * west if west > 0.0 else west
        west = t / (k_W + k_E + k_S + k_N) if t > 0.0 else t
        z[m, i] = west


@kernel
def relax_pairs(z: Array, kx: Array, ky: Array, c: Array, m: int, start: int, end: int) -> None:
    """`relax`, but a point of full film behind a cavitated one is solved for together with that one.

    What flows back from it into the cavity returns as void: in a deep dimple that is much more than what flows on, and the
    point by itself, which takes the void for given, would hardly move.
    """
    west = z[m, start - 1]
    for i in range(start, end):
        here = z[m, i]
        k_W, k_E, k_S, k_N = kx[m, i], kx[m, i + 1], ky[m, i], ky[m + 1, i]
        t = c[m, i] + k_E * max(z[m, i + 1], 0.0) + k_S * max(z[m - 1, i], 0.0) + k_N * max(z[m + 1, i], 0.0)
        t += k_W * west if west > 0.0 else west
        if here > 0.0 and west <= 0.0 and i > start:
            p = (t - k_W * here) / (k_E + k_S + k_N) if k_E + k_S + k_N > 0.0 else 0.0
            before = west + k_W * (p - here)
            if p > 0.0 and before <= 0.0:
                z[m, i - 1], z[m, i], west = before, p, p
                continue
        west = t / (k_W + k_E + k_S + k_N) if t > 0.0 else t
        z[m, i] = west


@kernel
def relax_front(z: Array, kx: Array, ky: Array, c: Array, count: int, width: int) -> int:
    """`count` sweeps, to and fro, over the points within `width` cells of a front; returns how many points were relaxed.

    Where fronts are rare, and twice as wide a strip takes in less than a tenth of the points, it is that, swept twice as often.
    """
    spans, found = front_spans(z, 2 * width)
    points = (spans[:found, 2] - spans[:found, 1]).sum()
    if points > 0.1 * (z.shape[0] - 2) * (z.shape[1] - 2):
        spans, found = front_spans(z, width)
        points = (spans[:found, 2] - spans[:found, 1]).sum()
    else:
        count *= 2
    for s in range(count):
        for k in range(found):
            at = found - 1 - k if s % 2 == 1 else k
            relax_pairs(z, kx, ky, c, spans[at, 0], spans[at, 1], spans[at, 2])
    return count * points


@kernel
def front_spans(z: Array, width: int) -> tuple[NDArray[np.int32], int]:
    """Row, first column and last column + 1 of the runs of points within `width` cells of a front, and their number."""
    ny, nx = z.shape[0] - 2, z.shape[1] - 2
    rows, pad = 2 * width + 2, 2 * width + 8  # in the masks column i stands at i + pad
    # Fronts to the east or north of the points of the last rows, and the first and last column that they take up.
    ring = np.zeros((rows, nx + 2 * pad), dtype=np.uint8)
    low, high = np.full(rows, nx + 1), np.zeros(rows, dtype=np.int64)
    full, full_north = np.zeros(nx + 2, dtype=np.uint8), np.zeros(nx + 2, dtype=np.uint8)
    crossed, near = np.zeros(nx + 2 * pad, dtype=np.uint8), np.zeros(nx + 2 * pad, dtype=np.uint8)
    spans, found = np.empty((ny + 64, 3), dtype=np.int32), 0
    positive(z[1], full)
    for m in range(1, ny + width + 1):
        new = m % rows
        low[new], high[new] = nx + 1, 0
        if m <= ny:
            positive(z[min(m + 1, ny)], full_north)
            if mark_changes(full, full_north, ring[new, pad:], nx):
                low[new], high[new] = extent(ring[new, pad:], nx)
            full, full_north = full_north, full
        row, first, last = m - width, low.min(), high.max()
        if row < 1 or first > last:
            continue
        start, end = first + pad - width, last + pad + width + 2  # columns that can be near
        crossed[start - width : end + width] = 0
        for r in range(rows):
            if low[r] <= high[r]:
                merge(ring[r, low[r] + pad : high[r] + pad + 1], crossed[low[r] + pad : high[r] + pad + 1])
        near[start:end] = 0
        for shift in range(-width, width + 2):
            merge(crossed[start - shift : end - shift], near[start:end])
        if found + nx // 2 + 1 > spans.shape[0]:
            spans = np.concatenate((spans, np.empty((spans.shape[0] + nx, 3), dtype=np.int32)))
        i, stop = max(first - width, 1), min(last + width + 1, nx)
        while i <= stop:
            if near[i + pad] == 0:
                i += 1
                continue
            begin = i
            while i <= stop and near[i + pad]:
                i += 1
            spans[found, 0], spans[found, 1], spans[found, 2] = row, begin, i
            found += 1
    return spans, found


@kernel
def positive(row: Array, out: NDArray[np.uint8]) -> None:
    """1 where the film is full."""
    for i in range(row.size):
        out[i] = 1 if row[i] > 0.0 else 0


@kernel
def mark_changes(full: NDArray[np.uint8], north: NDArray[np.uint8], out: NDArray[np.uint8], nx: int) -> int:
    """Mark the points with a front to the east or north of them; returns their number."""
    total = 0
    for i in range(1, nx):
        out[i] = (full[i] ^ full[i + 1]) | (full[i] ^ north[i])
        total += out[i]
    out[nx] = full[nx] ^ north[nx]
    return total + out[nx]


@kernel
def extent(mask: NDArray[np.uint8], nx: int) -> tuple[int, int]:
    """First and last column that is marked, of at least one."""
    first, last = 1, nx
    while mask[first] == 0:
        first += 1
    while mask[last] == 0:
        last -= 1
    return first, last


@kernel
def merge(mask: NDArray[np.uint8], into: NDArray[np.uint8]) -> None:
    """into |= mask."""
    for i in range(mask.size):
        into[i] |= mask[i]


@kernel
def balance_row(z: Array, kx: Array, ky: Array, m: int, out: Array) -> None:
    """G of the points of row m into out[1:-1]."""
    for i in range(1, z.shape[1] - 1):
        k_W, k_E, k_S, k_N = kx[m, i], kx[m, i + 1], ky[m, i], ky[m + 1, i]
        west, here = z[m, i - 1], z[m, i]
        p = max(here, 0.0)
        # Differences of pressures, which are exact where these hardly differ: in a deep pocket the terms themselves drown all.
        out[i] = (
            (k_W * (p - max(west, 0.0)) + k_E * (p - max(z[m, i + 1], 0.0)))
            + (k_S * (p - max(z[m - 1, i], 0.0)) + k_N * (p - max(z[m + 1, i], 0.0)))
        ) + (min(here, 0.0) - min(west, 0.0))


@kernel
def norms(z: Array, kx: Array, ky: Array, c: Array) -> tuple[float, float]:
    """Sums of squares over the rank's points: of the residual c - G, and of the size of its largest terms."""
    ny, nx = z.shape[0] - 2, z.shape[1] - 2
    G = np.zeros(nx + 2)
    residual, terms = 0.0, 0.0
    for m in range(1, ny + 1):
        balance_row(z, kx, ky, m, G)
        r, t = 0.0, 0.0
        for i in range(1, nx + 1):
            here = z[m, i]
            size = abs(c[m, i])
            size += (kx[m, i] + kx[m, i + 1] + ky[m, i] + ky[m + 1, i]) * here if here > 0.0 else -here
            r += (c[m, i] - G[i]) ** 2
            t += size * size
        residual += r
        terms += t
    return residual, terms


@kernel
def add_balance(z: Array, kx: Array, ky: Array, c: Array) -> None:
    """c += G(z): the right-hand side whose solution z would be if the residual, which c holds, were zero."""
    G = np.zeros(z.shape[1])
    for m in range(1, z.shape[0] - 1):
        balance_row(z, kx, ky, m, G)
        for i in range(1, z.shape[1] - 1):
            c[m, i] += G[i]


@kernel
def share(a: float, b: float, harmonic: bool) -> float:
    """Weight of the neighbour behind conductance a, 1 minus that of the one behind b, in the interpolation between them."""
    if a + b > 0.0 and (harmonic or a == 0.0 or b == 0.0):
        return a / (a + b)
    return 0.5


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
) -> None:
    """Add to `out` what the rank's rows of the residual c - G(z), or of c, give to the coarse points.

    That is the transposed interpolation, halved where lines are coarsened: a row is a balance per unit width. Coarse points
    stand at the odd rows and columns, counted from 0 over the whole grid; the rank's first row is y0, and row 0 of `out` is
    the coarse line y0 // 2 - 1.
    """
    ny, nx = z.shape[0] - 2, z.shape[1] - 2
    r, coarse = np.zeros(nx + 2), np.zeros(out.shape[1])
    n_coarse = out.shape[1] - 2
    for m in range(1, ny + 1):
        if residual:
            balance_row(z, kx, ky, m, r)
            for i in range(1, nx + 1):
                r[i] = c[m, i] - r[i]
        else:
            r[1:-1] = c[m, 1:-1]
        j = y0 + m - 1
        odd = j % 2 == 1
        row = (j - 1) // 2 - y0 // 2 + 1 if odd else j // 2 - y0 // 2
        if not by_y:
            row = m
        if not by_x:
            coarse[:] = r
        else:
            coarse[:] = 0.0
            for k in range(n_coarse):
                coarse[k + 1] = r[2 * k + 2]
            for i in range(0, nx, 2):
                w = share(kx[m, i + 1], kx[m, i + 2], harmonic)
                coarse[i // 2] += w * r[i + 1]
                coarse[i // 2 + 1] += (1.0 - w) * r[i + 1]
            if wrap:  # periodic in x: what goes to the frame belongs to the last point
                coarse[n_coarse] += coarse[0]
        if not by_y:
            for k in range(out.shape[1]):
                out[row, k] += coarse[k]
        elif odd:
            for k in range(out.shape[1]):
                out[row, k] += 0.5 * coarse[k]
        else:
            for k in range(1, n_coarse + 1):
                i = 2 * k if by_x else k
                w = 0.5 * share(ky[m, i], ky[m + 1, i], harmonic)
                out[row, k] += w * coarse[k]
                out[row + 1, k] += (0.5 - w) * coarse[k]


@kernel
def inject(z: Array, out: Array, y0: int, by_x: bool, by_y: bool) -> None:
    """The values at the coarse points that are among the rank's."""
    sx, sy = 2 if by_x else 1, 2 if by_y else 1
    shift = (1 - y0 % 2 if by_y else 0) + 1  # row of the first coarse line among the rank's
    for J in range(out.shape[0] - 2):
        for k in range(1, out.shape[1] - 1):
            out[J + 1, k] = z[shift + sy * J, sx * k]


@kernel
def reforms(z: Array, m: int, i: int) -> bool:
    """Whether the film is full again soon to the east of point i of row m."""
    east, last = i + 1, min(i + REACH, z.shape[1] - 2)
    while east <= last and z[m, east] <= 0.0:
        east += 1
    return east <= last


@kernel
def correct(
    z: Array, new: Array, old: Array, kx: Array, ky: Array, y0: int, by_x: bool, by_y: bool, harmonic: bool, truncation: int
) -> float:
    """Add the interpolated new - old of the coarse grid; returns the sum of squares of what was added.

    Where the film reforms, what flows back into the cavity returns: a point between that and a coarse point in the full film is
    corrected as the latter, not by a part of it.
    truncation: 0 none; 1 that, and a point that would cross its front stops there; 2 no correction at all at points that
    would, or that have a coarse neighbour that lies, or lay, on the other side.
    """
    ny, nx = z.shape[0] - 2, z.shape[1] - 2
    south, north, e = np.zeros(nx + 2), np.zeros(nx + 2), np.zeros(nx + 2)
    before = -2  # the coarse row whose correction stands in south
    added = 0.0
    for m in range(1, ny + 1):
        j = y0 + m - 1
        row = m if not by_y else ((j + 1) // 2 - y0 // 2 if j % 2 == 1 else j // 2 - y0 // 2)
        if row != before:
            interpolate_row(new[row] - old[row], kx, m, by_x, harmonic, south)
            before = row
        if not by_y or j % 2 == 1:
            e[:] = south
        else:
            interpolate_row(new[row] - old[row], kx, m, by_x, harmonic, south)
            interpolate_row(new[row + 1] - old[row + 1], kx, m, by_x, harmonic, north)
            for i in range(1, nx + 1):
                v = share(ky[m, i], ky[m + 1, i], harmonic)
                e[i] = v * south[i] + (1.0 - v) * north[i]
            if truncation == 1:
                for i in range(1, nx + 1):
                    if z[m, i] > 0.0:
                        if z[m - 1, i] <= 0.0 and z[m + 1, i] > 0.0 and reforms(z, m - 1, i):
                            e[i] = north[i]
                        elif z[m + 1, i] <= 0.0 and z[m - 1, i] > 0.0 and reforms(z, m + 1, i):
                            e[i] = south[i]
            before = -2
        if truncation == 1 and by_x:
            for i in range(1, nx, 2):
                if z[m, i] > 0.0 and z[m, i - 1] <= 0.0 and z[m, i + 1] > 0.0:
                    e[i] = e[i + 1]
        if truncation == 2:
            last = row + (by_y and j % 2 == 0)
            for i in range(1, nx + 1):
                left, right = (i // 2, (i + 1) // 2) if by_x else (i, i)
                full = z[m, i] > 0.0
                for J in (row, last):
                    for k in (left, right):
                        if ((new[J, k] > 0.0) != full or (old[J, k] > 0.0) != full) and new[J, k] != old[J, k]:
                            e[i] = 0.0
        stop = 0.0 if truncation == 2 else 1.0
        for i in range(1, nx + 1):
            here = z[m, i]
            moved = here + e[i]
            if truncation > 0 and (moved > 0.0) != (here > 0.0):
                moved = (1e-300 if here > 0.0 else 0.0) if stop > 0.0 else here
            z[m, i] = moved
            added += (moved - here) ** 2
    return added


@kernel
def interpolate_row(coarse: Array, kx: Array, m: int, by_x: bool, harmonic: bool, out: Array) -> None:
    """A coarse line's values at the points of row m, whose x faces give the weights."""
    if not by_x:
        out[:] = coarse
        return
    for k in range(1, coarse.size - 1):
        out[2 * k] = coarse[k]
    for k in range((out.size - 1) // 2):
        u = share(kx[m, 2 * k + 1], kx[m, 2 * k + 2], harmonic)
        out[2 * k + 1] = u * coarse[k] + (1.0 - u) * coarse[k + 1]


@kernel
def interpolate(z: Array, coarse: Array, kx: Array, ky: Array, y0: int, by_x: bool, by_y: bool, harmonic: bool) -> None:
    """A start from the coarse grid's answer: p and q interpolated one by one, the larger flow decides which one a point has."""
    ny, nx = z.shape[0] - 2, z.shape[1] - 2
    for m in range(1, ny + 1):
        j = y0 + m - 1
        if not by_y:
            a = b = m
        elif j % 2 == 1:
            a = b = (j - 1) // 2 - y0 // 2 + 1
        else:
            a = j // 2 - y0 // 2
            b = a + 1
        for i in range(1, nx + 1):
            if not by_x:
                left = right = i
            elif i % 2 == 0:
                left = right = i // 2
            else:
                left = (i - 1) // 2
                right = left + 1
            u = 0.5 if left == right else share(kx[m, i], kx[m, i + 1], harmonic)
            v = 0.5 if a == b else share(ky[m, i], ky[m + 1, i], harmonic)
            p, q = 0.0, 0.0
            for J, weight_y in ((a, v), (b, 1.0 - v)):
                for k, weight_x in ((left, u), (right, 1.0 - u)):
                    if coarse[J, k] > 0.0:
                        p += weight_x * weight_y * coarse[J, k]
                    else:
                        q -= weight_x * weight_y * coarse[J, k]
            z[m, i] = p if p * (kx[m, i] + kx[m, i + 1] + ky[m, i] + ky[m + 1, i]) > q else -q


@kernel
def series(a: float, b: float) -> float:
    """Conductance of two faces one behind the other."""
    return a * b / (a + b) if a + b > 0.0 else 0.0


@kernel
def coarsen_x_faces(kx: Array, ky: Array, out: Array, y0: int, by_x: bool, by_y: bool, harmonic: bool, beyond: bool) -> None:
    """Conductances of the coarse x faces: in series along x, added up across with the restriction's weights.

    beyond: the last coarse point is the last fine one, and only one fine face lies between it and the side.
    """
    n_rows, n_faces = out.shape[0] - 2, out.shape[1] - 2
    shift = (1 - y0 % 2 if by_y else 0) + 1
    for J in range(n_rows):
        m = shift + (2 * J if by_y else J)
        for f in range(1, n_faces + 1):
            i = 2 * f - 1 if by_x else f  # the face's column, or that of the first of two, between which point i lies
            total = 0.0
            for d in range(-1 if by_y else 0, 2 if by_y else 1):
                k = kx[m + d, i]
                if by_x and not (beyond and f == n_faces):
                    k = series(k, kx[m + d, i + 1])
                at = min(i, ky.shape[1] - 2)
                if d == -1:
                    k *= 1.0 - share(ky[m - 1, at], ky[m, at], harmonic)
                elif d == 1:
                    k *= share(ky[m + 1, at], ky[m + 2, at], harmonic)
                total += k
            out[J + 1, f] = 0.5 * total if by_y else total


@kernel
def coarsen_y_faces(kx: Array, ky: Array, out: Array, y0: int, by_x: bool, by_y: bool, harmonic: bool, beyond: bool) -> None:
    """The same for y faces; where lines are coarsened they are halved, as every row is a balance per unit width."""
    n_faces, n_columns = out.shape[0] - 2, out.shape[1] - 2
    # Row of the even line under the first coarse face; the face south of row m is ky[m].
    shift = (0 if y0 % 2 == 1 else 1) if by_y else 1
    for f in range(1, n_faces + 1):
        m = shift + (2 * f - 2 if by_y else f - 1)
        for k in range(1, n_columns + 1):
            i = 2 * k if by_x else k
            total = 0.0
            for d in range(-1 if by_x else 0, 2 if by_x else 1):
                value = ky[m, i + d]
                if by_y and not (beyond and f == n_faces):
                    value = series(value, ky[m + 1, i + d])
                at = min(m, kx.shape[0] - 2)
                if d == -1:
                    value *= 1.0 - share(kx[at, i - 1], kx[at, i], harmonic)
                elif d == 1:
                    value *= share(kx[at, i + 1], kx[at, i + 2], harmonic)
                total += value
            out[f, k] = 0.5 * total if by_y else total


@kernel
def lost_void(b_C: Array, b_W: Array) -> tuple[float, float]:
    """The largest difference between the void's flow out of a cell and into the next one, and that flow itself, per void."""
    lost, most = 0.0, 0.0
    for j in range(b_C.shape[0]):
        for i in range(1, b_C.shape[1]):
            lost = max(lost, abs(b_W[j, i] + b_C[j, i - 1]))
            most = max(most, abs(b_C[j, i]))
    return lost, most


@kernel
def pressure_and_void(z: Array, b_C: Array) -> tuple[Array, Array]:
    """p and r of z, whose frame is left out."""
    p, r = np.empty(z.shape), np.empty(z.shape)
    for j in range(z.shape[0]):
        for i in range(z.shape[1]):
            here = z[j, i]
            p[j, i] = here if here > 0.0 else 0.0
            r[j, i] = here / b_C[j, i] if here < 0.0 else 0.0
    return p, r
