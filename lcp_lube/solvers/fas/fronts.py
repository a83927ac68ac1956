"""Fronts, where the film ruptures or reforms: the points near them, and sweeps over these alone; arrays as in `kernels`."""

import numpy as np
from numpy.typing import NDArray

from ...base.compiled import kernel, piece
from ...base.parallel import Array

REACH = 8  # cells within which a cavity ends, if it does so at the front that is looked at
RARE, WIDER = 0.1, 5  # part of the points that a strip this many times as wide may take
OVER, LAST = 1.7, 2  # overrelaxation of the sweeps near fronts, but for so many that leave smooth what remains


@piece
def relax_pairs(
    z: Array,
    kx: Array,
    ky: Array,
    c: Array,
    m: int,
    start: int,
    end: int,
    carry: Array | None = None,
    ring: bool = False,
    over: float = 1.0,
) -> None:
    """`relax`, but a point of full film behind a cavitated one is solved for together with that one.

    What flows back from it into the cavity returns as void: in a deep dimple that is much more than what flows on, and the
    point by itself, which takes the void for given, would hardly move. over : by how much more than what its balance asks for
    a point moves that was full and stays so.
    """
    nx = z.shape[1] - 2
    west = z[m, start - 1]
    for i in range(start, end):
        here = z[m, i]
        k_W, k_E, k_S, k_N = kx[m, i], kx[m, i + 1], ky[m, i], ky[m + 1, i]
        t = c[m, i] + k_E * max(z[m, i + 1], 0.0) + k_S * max(z[m - 1, i], 0.0) + k_N * max(z[m + 1, i], 0.0)
        passed, gives = (1.0, 0.0) if carry is None else (carry[0, m, i - 1], carry[1, m, i])
        t += k_W * west if west > 0.0 else passed * west
        if here > 0.0 and west <= 0.0 and (i > start or (ring and i == 1)):
            sent = k_E + k_S + k_N if carry is None else k_E + k_S + k_N + (1.0 - passed) * k_W + gives
            p = (t - passed * k_W * here) / sent if sent > 0.0 else 0.0
            before = west + k_W * (p - here)
            if p > 0.0 and before <= 0.0:
                z[m, i - 1 if i > 1 else nx], z[m, i], west = before, p, p
                continue
        west = t / (k_W + k_E + k_S + k_N + gives) if t > 0.0 else t
        if over > 1.0 and west > 0.0 and here > 0.0:
            further = here + over * (west - here)
            west = further if further > 0.0 else west
        z[m, i] = west
    if ring and (start == 1 or end == nx + 1):
        z[m, 0], z[m, nx + 1] = z[m, nx], z[m, 1]


@kernel
def relax_front(
    z: Array,
    kx: Array,
    ky: Array,
    c: Array,
    count: int,
    width: int,
    carry: Array | None = None,
    held: NDArray[np.bool_] | None = None,
    slips: NDArray[np.bool_] | None = None,
    ring: bool = False,
    more: bool = False,
) -> int:
    """`count` sweeps, to and fro, over the points within `width` cells of a front; returns how many points were relaxed.

    held : points that are left out; slips : those of them about which points are swept as they are at fronts; ring : the
    ends of a line are neighbours, and kept so; more : further sweeps follow, once other ranks have heard of these.

    Where fronts are rare, and strips of twice or WIDER times the width take in less than a tenth of the points, it is these,
    swept twice as often. Only in steady films without supplies the sweeps overrelax, and strips are more than twice as wide.
    """
    plain = carry is None and held is None
    wider, most = (WIDER, OVER) if plain else (2, 1.0)
    nx = z.shape[1] - 2
    seen, rare = z if slips is None else np.where(slips, -1.0, z), RARE * (z.shape[0] - 2) * nx
    spans, found = front_spans(seen, wider * width, ring)
    points = (spans[:found, 2] - spans[:found, 1]).sum()
    if points <= 0.5 * wider * rare:
        count *= 2
    if points > rare:
        spans, found = front_spans(seen, 2 * width if points <= 0.5 * wider * rare else width, ring)
        points = (spans[:found, 2] - spans[:found, 1]).sum()
    if held is not None:
        spans, found = without(spans, found, held)
    for s in range(count):
        over = most if more or s < count - LAST else 1.0
        for k in range(found):
            at = found - 1 - k if s % 2 == 1 else k
            relax_pairs(z, kx, ky, c, spans[at, 0], spans[at, 1], spans[at, 2], carry, ring, over)
    return count * points


@piece
def without(spans: NDArray[np.int32], found: int, held: NDArray[np.bool_]) -> tuple[NDArray[np.int32], int]:
    """What is left of spans without the points that are held."""
    out, n = np.empty((2 * found + 64, 3), dtype=np.int32), 0
    for k in range(found):
        m, i, stop = spans[k, 0], spans[k, 1], spans[k, 2]
        while i < stop:
            begin = i
            while i < stop and not held[m, i]:
                i += 1
            if i > begin:
                if n == out.shape[0]:
                    out = np.concatenate((out, np.empty((n, 3), dtype=np.int32)))
                out[n, 0], out[n, 1], out[n, 2] = m, begin, i
                n += 1
            i += 1
    return out, n


@piece
def front_spans(z: Array, width: int, ring: bool = False) -> tuple[NDArray[np.int32], int]:
    """Row, first column and last column + 1 of the runs of points within `width` cells of a front, and their number.

    ring : the first and the last column are neighbours.
    """
    ny, nx = z.shape[0] - 2, z.shape[1] - 2
    rows, pad = 2 * width + 2, 2 * width + 8  # in the masks column i stands at i + pad
    # Fronts to the east or north of the points of the last rows, and the first and last column that they take up.
    marks = np.zeros((rows, nx + 2 * pad), dtype=np.uint8)
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
            if mark_changes(full, full_north, marks[new, pad:], nx, ring):
                low[new], high[new] = extent(marks[new, pad:], nx)
            full, full_north = full_north, full
        row, first, last = m - width, low.min(), high.max()
        if row < 1 or first > last:
            continue
        start, end = first + pad - width, last + pad + width + 2  # columns that can be near
        crossed[start - width : end + width] = 0
        for r in range(rows):
            if low[r] <= high[r]:
                merge(marks[r, low[r] + pad : high[r] + pad + 1], crossed[low[r] + pad : high[r] + pad + 1])
        near[start:end] = 0
        for shift in range(-width, width + 2):
            merge(crossed[start - shift : end - shift], near[start:end])
        first, last = max(first - width, 1), min(last + width + 1, nx)
        if ring and (start <= pad or end > nx + pad + 1):
            near[:start], near[end:] = 0, 0
            merge(near[: pad + 1], near[nx : nx + pad + 1])
            merge(near[nx + pad + 1 :], near[pad + 1 :])
            first, last = 1, nx
        if found + nx // 2 + 1 > spans.shape[0]:
            spans = np.concatenate((spans, np.empty((spans.shape[0] + nx, 3), dtype=np.int32)))
        i, stop = first, last
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


@piece
def positive(row: Array, out: NDArray[np.uint8]) -> None:
    """1 where the film is full."""
    for i in range(row.size):
        out[i] = 1 if row[i] > 0.0 else 0


@piece
def mark_changes(full: NDArray[np.uint8], north: NDArray[np.uint8], out: NDArray[np.uint8], nx: int, ring: bool) -> int:
    """Mark the points with a front to the east or north of them; returns their number."""
    total = 0
    for i in range(1, nx):
        out[i] = (full[i] ^ full[i + 1]) | (full[i] ^ north[i])
        total += out[i]
    out[nx] = full[nx] ^ north[nx]
    if ring:
        out[nx] |= full[nx] ^ full[nx + 1]
    return total + out[nx]


@piece
def extent(mask: NDArray[np.uint8], nx: int) -> tuple[int, int]:
    """First and last column that is marked, of at least one."""
    first, last = 1, nx
    while mask[first] == 0:
        first += 1
    while mask[last] == 0:
        last -= 1
    return first, last


@piece
def merge(mask: NDArray[np.uint8], into: NDArray[np.uint8]) -> None:
    """into |= mask."""
    for i in range(mask.size):
        into[i] |= mask[i]


@piece
def reforms(z: Array, m: int, i: int, ring: bool) -> bool:
    """Whether the film is full again soon to the east of point i of row m."""
    nx = z.shape[1] - 2
    for east in range(i + 1, min(i + REACH, i + nx if ring else nx) + 1):
        if z[m, east if east <= nx else east - nx] > 0.0:
            return True
    return False
