"""Fronts, where the film ruptures or reforms: sweeps over the points near them (`front_points`); arrays as in `kernels`."""

import numpy as np
from numpy.typing import NDArray

from ...base.compiled import kernel, piece
from ...base.parallel import Array
from .front_points import spans_of_blocks, together, without
from .waiting import await_part, fetch, write

REACH = 8  # cells within which a cavity ends, if it does so at the front that is looked at
RARE, WIDER = 0.1, 5  # part of the points that a strip this many times as wide may take
VERY = 0.2  # and the part of that, of a strip which is then made twice as wide once more
OVER, LAST = 1.8, 2  # overrelaxation of the sweeps near fronts, but for so many that leave smooth what remains
DENSE = 0.5  # part of the points beyond which half as many sweeps do
AHEAD = 2  # rows for whose points memory is asked before their turn
FUSED = 5  # sweeps that go over rows in one pass
NEAR = 16  # points between two runs of a row that cost less than a loop of its own for each


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
    work: Array | None = None,
) -> None:
    """`relax`, but a point of full film behind a cavitated one is solved for together with that one.

    What flows back from it into the cavity returns as void: in a deep dimple that is much more than what flows on, and the
    point by itself, which takes the void for given, would hardly move. over : by how much more than what its balance asks for
    a point moves that was full and stays so. work : room for four numbers a column.

    What no point to the west has a say in is made first, by vector instructions: then from point to point in full film one
    multiplication and addition waits for the one before.
    """
    room = np.empty((4, z.shape[1])) if work is None else work
    prepare(z, kx, ky, c, m, start, end, carry, over, room)
    pass_along(z, kx, ky, m, start, end, carry, ring, over, room)


@piece
def prepare(
    z: Array, kx: Array, ky: Array, c: Array, m: int, start: int, end: int, carry: Array | None, over: float, work: Array
) -> None:
    """Of `relax_pairs` what no point to the west has a say in."""
    for i in range(np.uint32(start), np.uint32(end)):
        gives = 0.0 if carry is None else carry[1, m, i]
        work[0, i] = (c[m, i] + kx[m, i + 1] * max(z[m, i + 1], 0.0)) + (
            ky[m, i] * max(z[m - 1, i], 0.0) + ky[m + 1, i] * max(z[m + 1, i], 0.0)
        )
        work[1, i] = 1.0 / ((kx[m, i] + kx[m, i + 1]) + (ky[m, i] + ky[m + 1, i]) + gives)
        work[2, i] = over * (work[0, i] * work[1, i]) + (1.0 - over) * z[m, i]
        work[3, i] = over * (kx[m, i] * work[1, i])


@piece
def pass_along(
    z: Array, kx: Array, ky: Array, m: int, start: int, end: int, carry: Array | None, ring: bool, over: float, work: Array
) -> None:
    """And what goes from point to point."""
    nx = z.shape[1] - 2
    west = z[m, start - 1]
    for i in range(start, end):
        here = z[m, i]
        if west > 0.0:
            arrives = work[0, i] + kx[m, i] * west
            further = work[2, i] + work[3, i] * west
            west = arrives
            if arrives > 0.0:
                west = further if here > 0.0 and further > 0.0 else arrives * work[1, i]
            z[m, i] = west
            continue
        passed, gives = (1.0, 0.0) if carry is None else (carry[0, m, i - 1], carry[1, m, i])
        arrives = work[0, i] + passed * west
        if here > 0.0 and (i > start or (ring and i == 1)):
            k_W, k_E, k_S, k_N = kx[m, i], kx[m, i + 1], ky[m, i], ky[m + 1, i]
            sent = k_E + k_S + k_N if carry is None else k_E + k_S + k_N + (1.0 - passed) * k_W + gives
            p = (arrives - passed * k_W * here) / sent if sent > 0.0 else 0.0
            before = west + k_W * (p - here)
            if p > 0.0 and before <= 0.0:
                z[m, i - 1 if i > 1 else nx], z[m, i], west = before, p, p
                continue
        west = arrives * work[1, i] if arrives > 0.0 else arrives
        if west > 0.0 and here > 0.0:
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
    carry: Array | None,
    held: NDArray[np.bool_] | None,
    slips: NDArray[np.bool_] | None,
    ring: bool,
    more: bool,
    often: bool,
    thread: int,
    threads: int,
    done: Array,
    near: Array,
) -> int:
    """`count` sweeps, to and fro, over the points within `width` cells of a front; returns how many points were relaxed.

    held : points that are left out; slips : those of them about which points are swept as they are at fronts; ring : the
    ends of a line are neighbours, and kept so; more : further sweeps follow, once other ranks have heard of these.

    Where fronts are rare, and strips of twice or WIDER times the width take in less than a tenth of the points, it is these;
    often : swept twice as often then. Only in steady films without supplies the sweeps overrelax, and strips are more than
    twice as wide. Where most points are near a front they are swept half as often: coarse grids, not fronts, are in want there.

    done, near : of the blocks of lines into which large grids are divided, every second one first, then those between, so that
    no two neighbours are at work at once: how often each has been swept, and its points in both strips; thread : the one of so
    many that this is, with pairs of blocks of its own.
    """
    plain = carry is None and held is None
    wider, most = (WIDER, OVER) if plain else (2, 1.0)
    ny, nx = z.shape[0] - 2, z.shape[1] - 2
    seen, rare = z if slips is None else np.where(slips, -1.0, z), RARE * ny * nx
    blocks = done.shape[0]
    spans, at, own = spans_of_blocks(seen, wider * width, ring, thread, threads, blocks)
    looks, points = 1, together(own, thread, threads, done, near, 1)
    if often and points <= 0.5 * wider * rare:
        count *= 2
    very = often and plain and points <= VERY * rare
    if very or points > rare:
        count, width = (2 * count, 2 * wider * width) if very else (count, 2 * width if points <= 0.5 * wider * rare else width)
        spans, at, own = spans_of_blocks(seen, width, ring, thread, threads, blocks)
        looks, points = 2, together(own, thread, threads, done, near, 2)
    if plain and points > DENSE * ny * nx:
        count = (count + 1) // 2
    if held is not None:
        spans, at = without(spans, at, held)
    of_row, work = first_spans(spans, at, ny), np.empty((4, nx + 2))
    most_fused = FUSED if plain else 1
    for turn in range((count + most_fused - 1) // most_fused):
        before, step = turn * most_fused, -1 if turn % 2 == 1 else 1
        fused = min(count - before, most_fused)
        for half in range(min(blocks, 2)):
            for b in range(2 * thread + half, blocks, 2 * threads):
                await_part(done, b - 1, looks + turn + half)
                await_part(done, b + 1, looks + turn + half)
                top, bottom = ny * b // blocks + 1, ny * (b + 1) // blocks
                lines, first = bottom + 1 - top, bottom if step < 0 else top
                for s in range(lines + fused - 1):
                    m = first + step * (s + AHEAD)
                    if top <= m <= bottom:
                        for n in range(of_row[m], of_row[m + 1]):
                            bring_near(z, kx, ky, c, m, spans[n, 1], spans[n, 2], step)
                    for k in range(max(s + 1 - lines, 0), min(s + 1, fused)):
                        m, over = first + step * (s - k), most if more or before + k < count - LAST else 1.0
                        relax_row(z, kx, ky, c, m, spans, of_row[m], of_row[m + 1], carry, ring, over, step, work)
                write(done, b, looks + turn + 1)
    return count * points


@piece
def relax_row(
    z: Array, kx: Array, ky: Array, c: Array, m: int, spans: NDArray[np.int32], begin: int, end: int, carry: Array | None,
    ring: bool, over: float, step: int, work: Array,
) -> None:  # fmt: skip
    """`relax_pairs` of the runs begin to end - 1, those of row m, prepared together where they are near each other; step -1:
    from the last one on."""
    n = begin if step > 0 else end - 1
    while begin <= n < end:
        beyond = n + step
        while begin <= beyond < end:
            west, east = min(beyond - step, beyond), max(beyond - step, beyond)
            if spans[east, 1] - spans[west, 2] > NEAR:
                break
            beyond += step
        first, last = min(n, beyond - step), max(n, beyond - step)
        prepare(z, kx, ky, c, m, spans[first, 1], spans[last, 2], carry, over, work)
        while n != beyond:
            pass_along(z, kx, ky, m, spans[n, 1], spans[n, 2], carry, ring, over, work)
            n += step


@piece
def first_spans(spans: NDArray[np.int32], at: NDArray[np.int64], ny: int) -> NDArray[np.int64]:
    """Where the spans of each row begin; at : those of the blocks, of which only a thread's own have any."""
    out = np.zeros(ny + 3, dtype=np.int64)
    for n in range(at[-1]):
        out[spans[n, 0] + 1] = n + 1
    for m in range(1, ny + 3):
        out[m] = max(out[m], out[m - 1])
    return out


@piece
def bring_near(z: Array, kx: Array, ky: Array, c: Array, m: int, start: int, end: int, step: int) -> None:
    """Ask memory for what the points of a run need, whose line no loop would foresee. step : of the lines, 1 or -1."""
    for i in range(start, end, 8):
        fetch(z, m + step, i)
        fetch(kx, m, i)
        fetch(ky, m + (step > 0), i)
        fetch(c, m, i)


@piece
def reforms(z: Array, m: int, i: int, ring: bool) -> bool:
    """Whether the film is full again soon to the east of point i of row m."""
    nx = z.shape[1] - 2
    for east in range(i + 1, min(i + REACH, i + nx if ring else nx) + 1):
        if z[m, east if east <= nx else east - nx] > 0.0:
            return True
    return False
