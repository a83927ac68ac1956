"""The points near fronts, as runs of points of a row, and those of several threads' blocks of lines; arrays as in `kernels`."""

import numpy as np
from numpy.typing import NDArray

from ...base.compiled import piece
from ...base.parallel import Array
from .waiting import await_part, write

BLOCK = 64  # columns that are looked at together


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
def together(points: NDArray[np.int64], thread: int, threads: int, done: Array, near: Array, look: int) -> int:
    """The points of all blocks, once every thread has told of its own."""
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
    ny, nx, rows = z.shape[0] - 2, z.shape[1] - 2, 2 * width + 2
    # The last row with a front to the east or north of each column's point, and where of the last rows there may be any.
    marked = np.full(nx + 2, -rows, dtype=np.int32)
    low, high = np.full(rows, nx + 1), np.zeros(rows, dtype=np.int64)
    full, full_north = np.zeros((2, nx + 2), dtype=np.uint8)
    near, other = np.zeros((2, nx + 3 * rows), dtype=np.uint8)  # of column i at i + at
    at = rows + width
    bottom, begin = bottom if bottom else ny, max(top - width - 1, 1)
    spans, found = np.empty((bottom - top + 65, 3), dtype=np.int32), 0
    positive(z, begin, ring, full)
    for m in range(begin, bottom + width + 1):
        new = m % rows
        low[new], high[new] = nx + 1, 0
        if m <= ny:
            positive(z, min(m + 1, ny), ring, full_north)
            low[new], high[new] = mark_changes(full, full_north, m, marked)
            full, full_north = full_north, full
        row, first, last = m - width, low.min(), high.max()
        if row < top or first > last:
            continue
        near[first : rows + first], other[first : rows + first], near[rows + last + 1 : 2 * rows + last] = 0, 0, 0
        for i in range(np.uint32(rows + first), np.uint32(rows + last + 1)):
            near[i] = marked[i - np.uint32(rows)] > m - rows
        shift = 1  # twice as many columns to the west with every step
        while shift < rows:
            more = min(shift, rows - shift)
            for i in range(np.uint32(rows + first), np.uint32(2 * rows + last)):
                other[i] = near[i] | near[i - np.uint32(more)]
            near, other = other, near
            shift += more
        first, last = first - width, last + width + 1
        if ring and (first < 1 or last > nx):
            near[: at + first], near[at + last + 1 :] = 0, 0
            for i in range(first, 1):
                near[at + i + nx] |= near[at + i]
            for i in range(nx + 1, last + 1):
                near[at + i - nx] |= near[at + i]
            first, last = 1, nx
        first, last = max(first, 1), min(last, nx)
        if found + nx // 2 + 1 > spans.shape[0]:
            spans = np.concatenate((spans, np.empty((spans.shape[0] + nx, 3), dtype=np.int32)))
        i = first
        while i <= last:
            if near[at + i] == 0:
                i += 1
                continue
            begin = i
            while i <= last and near[at + i]:
                i += 1
            spans[found, 0], spans[found, 1], spans[found, 2] = row, begin, i
            found += 1
    return spans, found


@piece
def positive(z: Array, m: int, ring: bool, out: NDArray[np.uint8]) -> None:
    """1 where the film is full in row m; beyond an end of the line as at it."""
    for i in range(np.uint32(out.size)):
        out[i] = 1 if z[m, i] > 0.0 else 0
    if not ring:
        out[-1] = out[-2]


@piece
def mark_changes(full: NDArray[np.uint8], north: NDArray[np.uint8], m: int, out: NDArray[np.int32]) -> tuple[int, int]:
    """m at the points with a front to the east or north of them; columns between which they lie, in steps of BLOCK."""
    nx = out.size - 2
    first, last = nx + 1, 0
    for start in range(1, nx + 1, BLOCK):
        count, end = 0, min(start + BLOCK, nx + 1)
        for i in range(np.uint32(start), np.uint32(end)):
            change = (full[i] ^ full[i + 1]) | (full[i] ^ north[i])
            out[i] = m if change else out[i]
            count += change
        if count:
            first, last = min(first, start), end - 1
    return first, last
