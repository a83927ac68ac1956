"""The points near fronts, as runs of points of a row, and those of several threads' blocks of lines; arrays as in `kernels`."""

import numpy as np
from numpy.typing import NDArray

from ...base.compiled import piece
from ...base.parallel import Array
from .waiting import await_part, write


@piece
def spans_of_blocks(
    z: Array, width: int, ring: bool, thread: int, threads: int, blocks: int
) -> tuple[NDArray[np.int32], NDArray[np.int64], NDArray[np.int64]]:
    """`front_spans` of a thread's blocks of lines, where those of each block begin, and how many points are theirs."""
    ny = z.shape[0] - 2
    at, points = np.zeros(blocks + 1, dtype=np.int64), np.zeros(blocks, dtype=np.int64)
    spans = np.empty((0, 3), dtype=np.int32)
    for b in range(blocks):
        at[b + 1] = at[b]
        if b // 2 % threads == thread:
            more, found = front_spans(z, width, ring, ny * b // blocks + 1, ny * (b + 1) // blocks)
            spans = np.concatenate((spans, more[:found])) if b else more[:found]
            at[b + 1] += found
            points[b] = (more[:found, 2] - more[:found, 1]).sum()
    return spans, at, points


@piece
def together(points: NDArray[np.int64], thread: int, threads: int, done: Array | None, near: Array | None, look: int) -> int:
    """The points of all blocks, once every thread has told of its own."""
    if done is None or near is None:
        return int(points.sum())
    for b in range(points.size):
        if b // 2 % threads == thread:
            near[look - 1, b] = points[b]
            write(done, b, look)
    for b in range(points.size):
        await_part(done, b, look)
    return int(near[look - 1].sum())


@piece
def without(
    spans: NDArray[np.int32], at: NDArray[np.int64], held: NDArray[np.bool_]
) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """What is left of spans without the points that are held, and of where those of each block begin."""
    out, n, begins = np.empty((2 * len(spans) + 64, 3), dtype=np.int32), 0, np.zeros_like(at)
    for k in range(len(spans)):
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
        for b in range(1, at.size):
            if k < at[b]:
                begins[b] = n
    return out, begins


@piece
def front_spans(z: Array, width: int, ring: bool = False, top: int = 1, bottom: int = 0) -> tuple[NDArray[np.int32], int]:
    """Row, first column and last column + 1 of the runs of points within `width` cells of a front, and their number.

    ring : the first and the last column are neighbours. top, bottom : the rows that are asked for; 0: up to the last one.
    """
    ny, nx = z.shape[0] - 2, z.shape[1] - 2
    rows, pad = 2 * width + 2, 2 * width + 8  # in the masks column i stands at i + pad
    # Fronts to the east or north of the points of the last rows, and the first and last column that they take up.
    marks = np.zeros((rows, nx + 2 * pad), dtype=np.uint8)
    low, high = np.full(rows, nx + 1), np.zeros(rows, dtype=np.int64)
    full, full_north = np.zeros(nx + 2, dtype=np.uint8), np.zeros(nx + 2, dtype=np.uint8)
    crossed, near = np.zeros(nx + 2 * pad, dtype=np.uint8), np.zeros(nx + 2 * pad, dtype=np.uint8)
    bottom, begin = bottom if bottom else ny, max(top - width - 1, 1)
    spans, found = np.empty((bottom - top + 65, 3), dtype=np.int32), 0
    positive(z[begin], full)
    for m in range(begin, bottom + width + 1):
        new = m % rows
        low[new], high[new] = nx + 1, 0
        if m <= ny:
            positive(z[min(m + 1, ny)], full_north)
            if mark_changes(full, full_north, marks[new, pad:], nx, ring):
                low[new], high[new] = extent(marks[new, pad:], nx)
            full, full_north = full_north, full
        row, first, last = m - width, low.min(), high.max()
        if row < top or first > last:
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
