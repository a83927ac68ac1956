"""Full multigrid's start on a grid from the next coarser one's answer; arrays as in `kernels`."""

import numpy as np

from ...base.compiled import kernel, piece
from ...base.parallel import Array
from .transfer import coarse_rows, interpolate_row, mix
from .weights import west_shares

SMOOTH = 1.5  # by so much at most conductances of neighbouring faces differ where a film is smooth


@kernel
def interpolate(
    z: Array,
    coarse: Array,
    kx: Array,
    ky: Array,
    y0: int,
    by_x: bool,
    by_y: bool,
    harmonic: bool,
    is_smooth: bool,
    sides: tuple[bool, bool, bool, bool],
    start: int,
    end: int,
) -> None:
    """Rows start to end - 1 of a start from the coarse grid's answer: p and q interpolated one by one, the larger flow decides
    which one a point has.

    Where the film is full, and smooth everywhere (`look`), p is a cubic polynomial's. sides : whether what the frame has to
    the west, east, south and north are sides' pressures, a coarse mesh beyond the last coarse points.
    """
    nx, size, rows, top = z.shape[1] - 2, coarse.shape[1], coarse.shape[0], ky.shape[0] - 2
    w, part, flows = np.zeros(size - 1), np.zeros(size), np.zeros((2, nx + 2))  # flows: p, q
    south, north, bend, step = np.zeros(nx + 2), np.zeros(nx + 2), np.zeros(nx + 2), 2 if by_x else 1
    for m in range(start, end):
        row, last = coarse_rows(y0 + m - 1, y0, m, by_y)
        if by_x:
            west_shares(kx, m, harmonic, not sides[0], w)
        for s in (1, 0):  # p last: its rows are used below
            sign = 1.0 - 2.0 * s
            for n in range(1 + last - row):
                out = north if n else south
                for k in range(size):
                    part[k] = max(sign * coarse[row + n, k], 0.0)
                interpolate_row(part, w, by_x, out)
                if by_x and s == 0 and is_smooth:
                    smooth_row(part, kx, m, sides, out)
            if last > row:
                mix(south, north, ky, m, harmonic, flows[s])
            else:
                flows[s] = south
        if last > row and rows >= 4 and is_smooth:
            r, wa, wb, wc, wd = cubic(row, rows)
            for k in range(np.uint32(size)):
                a, b, c, d = coarse[r, k], coarse[r + 1, k], coarse[r + 2, k], coarse[r + 3, k]
                p = (wa * a + wb * b) + (wc * c + wd * d)
                part[k] = (p if min(min(a, b), min(c, d)) > 0.0 else np.nan) - 0.5 * (coarse[row, k] + coarse[last, k])
            for k in range(size if r == 0 or r + 4 == rows else 0):  # beside sides
                i = min(step * k, nx)
                first, final = r == 0 and sides[2] and ky[1, i] > 0.0, r + 4 == rows and sides[3] and ky[top, i] > 0.0
                a, b, c, d = coarse[r, k], coarse[r + 1, k], coarse[r + 2, k], coarse[r + 3, k]
                full = (a > 0.0 or first) and b > 0.0 and c > 0.0 and (d > 0.0 or final)
                p = (wa * a + wb * b) + (wc * c + wd * d) if full else np.nan
                part[k] = p - 0.5 * (coarse[row, k] + coarse[last, k])
            if sides[0]:  # beyond a side p does not vary along it
                part[0], part[size - 1] = 0.0, 0.0
            interpolate_row(part, w, by_x, bend)
            for i in range(1, nx + 1):
                p = 0.5 * (south[i] + north[i]) + bend[i]
                flows[0, i] = p if p > 0.0 else flows[0, i]
        for i in range(1, nx + 1):
            p, q = flows[0, i], flows[1, i]
            z[m, i] = p if p * (kx[m, i] + kx[m, i + 1] + ky[m, i] + ky[m + 1, i]) > q else -q


@piece
def cubic(k: int, n: int) -> tuple[int, float, float, float, float]:
    """The first of four of n values, at least, and their weights in what the cubic polynomial through them has in the middle
    between values k and k + 1."""
    if k == 0:
        return 0, 0.3125, 0.9375, -0.3125, 0.0625
    if k >= n - 2:
        return n - 4, 0.0625, -0.3125, 0.9375, 0.3125
    return k - 1, -0.0625, 0.5625, 0.5625, -0.0625


@piece
def smooth_row(coarse: Array, kx: Array, m: int, sides: tuple[bool, bool, bool, bool], out: Array) -> None:
    """The pressures of a line between two coarse points where the film is full and smooth."""
    n, last = coarse.size, kx.shape[1] - 2
    west, east = sides[0] and kx[m, 1] > 0.0, sides[1] and kx[m, last] > 0.0
    beside = 2 if not sides[0] and out.size % 2 else 0  # where coarse points round a ring are three meshes apart
    count = min(out.size // 2, n - 1) if n >= 4 else 0
    for k in range(np.uint32(2), np.uint32(max(min(n - 3, count), 2))):
        a, b, c, d = coarse[k - 1], coarse[k], coarse[k + 1], coarse[k + 2]
        p = (-0.0625 * a + 0.5625 * b) + (0.5625 * c - 0.0625 * d)
        out[2 * k + 1] = p if min(min(a, b), min(min(c, d), p)) > 0.0 else out[2 * k + 1]
    for k in range(count):
        if 2 <= k < n - 3 or k < beside or k >= count - beside:
            continue
        r, wa, wb, wc, wd = cubic(k, n)
        a, b, c, d = coarse[r], coarse[r + 1], coarse[r + 2], coarse[r + 3]
        p = (wa * a + wb * b) + (wc * c + wd * d)
        if p > 0.0 and (a > 0.0 or (r == 0 and west)) and b > 0.0 and c > 0.0 and (d > 0.0 or (r + 4 == n and east)):
            out[2 * k + 1] = p


@kernel
def look(kx: Array, ky: Array, start: int, end: int) -> tuple[float, float, int]:
    """Of rows start to end - 1 the sums of the x and of the y faces' conductances; and between how many neighbouring faces, but
    at sides, these differ so much that the film has a step there.

    Beside steps pressures have kinks, and in a deep pocket the weights by conductances keep what differs by next to nothing.
    """
    nx, ny, steps = ky.shape[1] - 2, kx.shape[0] - 2, 0
    x, y = np.zeros(nx + 3), np.zeros(nx + 2)  # column by column: vector instructions
    for m in range(start, end):
        for i in range(np.uint32(1), np.uint32(nx + 2)):
            x[i] += kx[m, i]
        for i in range(np.uint32(2), np.uint32(max(nx, 2))):
            a, b = kx[m, i], kx[m, i + 1]
            steps += (a > SMOOTH * b) | (b > SMOOTH * a)
        for i in range(np.uint32(1), np.uint32(nx + 1)):
            y[i] += ky[m, i]
        if 2 <= m < ny:
            for i in range(np.uint32(1), np.uint32(nx + 1)):
                a, b = ky[m, i], ky[m + 1, i]
                steps += (a > SMOOTH * b) | (b > SMOOTH * a)
    if end == ny + 1:
        y += ky[end]
    return x.sum(), y[1:-1].sum(), steps
