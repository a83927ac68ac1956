"""Loops of the nonlinear multigrid over one rank's points, compiled when this module is imported: sweeps and balances.

Arrays have a frame of neighbours (`levels.Level`): point (j, i) of the rank stands at z[j + 1, i + 1], its west and east
face at kx[j + 1, i + 1] and kx[j + 1, i + 2], its south and north face at ky[j + 1, i + 1] and ky[j + 2, i + 1]. z > 0 is a
pressure, z < 0 minus the flow of void -b_C r that leaves the cell. With it the balance of a point is

    G_i = sum of k (p_i - p_neighbour) - q_i + q_west,    p = max(z, 0), q = max(-z, 0):

B has the entries -1 and 1, on every level. In a time step cells store void: z < 0 is minus all that becomes of it, and `carry`,
its part that leaves for the next cell, takes the 1's place (carry[0]; carry[1]: what they store more by p = 1, a term on the
diagonal); steady films have carry = None, for which the loops are compiled without it. `fronts` has the loops near the
cavities' edges, `transfer` those between grids.
"""

import numpy as np

from ...base.compiled import kernel, piece
from ...base.parallel import Array
from ...problems.film.cell_loops import carried
from .waiting import await_part, fetch, write

SHIFT = 8  # columns: as many as memory deals with at once, which two threads are not to write to in turn


@kernel
def sweep(
    z: Array,
    kx: Array,
    ky: Array,
    c: Array,
    count: int,
    down: bool,
    carry: Array | None = None,
    ring: bool = False,
    part: int = 0,
    done: Array | None = None,
    west: Array | None = None,
) -> None:
    """`count` nonlinear Gauss-Seidel sweeps in place, every x line along the flow, lines upwards or down.

    Three at a time: the second one follows the first two lines behind, the third one the second. The values are those of
    sweeps one after the other, but memory is passed over once, and three chains of dependent operations overlap. ring: the
    ends of a line are neighbours, and each line that is done brings its frame up to date. part, done, west : of several threads
    (`crew`) which columns are this one's, the lines that each has done, and what arrives from the last columns of each. The
    second sweep's parts begin SHIFT columns west of the first one's, and so on: what they need to the east is their own then,
    and no part waits for the next one, but lest it be more lines ahead than `west` has room for.
    """
    ny, nx = z.shape[0] - 2, z.shape[1] - 2
    step, first = (-1, ny) if down else (1, 1)
    parts = 1 if done is None else done.shape[0]
    start, end, taken = nx * part // parts + 1, nx * (part + 1) // parts + 1, 0
    left, right = SHIFT if part else 0, SHIFT if part + 1 < parts else 0
    at = start - 1 if part else start  # the first column of what follows: the last one of the part before
    t, over, g = np.zeros((3, nx + 2)), np.zeros((5, nx + 2)), np.zeros((5, nx + 2))
    for before in range(0, count, 3):
        fused = min(count - before, 3)
        for s in range(ny + 2 * (fused - 1)):
            m = first + step * s
            if s < ny:
                diagonals(kx, ky, m, at - (fused - 1) * left, end, over, g, s % 5, carry)
            if done is not None and west is not None:
                await_part(done, part + 1, taken + 1 - west.shape[1])
                await_part(done, part - 1, taken + 1)
            for k in range(fused):
                if 0 <= s - 2 * k < ny:
                    arriving(z, kx, ky, c, m - 2 * k * step, at - k * left, end - k * right, t, k, carry)
                    if west is not None and part:
                        t[k, at - k * left] = west[part - 1, taken % west.shape[1], k]
                    if carry is not None:
                        pass_on_part(t, k, g, (s - 2 * k) % 5, carry, m - 2 * k * step, end)
            if carry is None:
                pass_on(t, g, s % 5, (s - 2) % 5, (s - 4) % 5, z, kx, ky, c, m + step, m + 2 * step, at, end, left, right)
            for k in range(fused):
                if 0 <= s - 2 * k < ny:
                    settle(t, k, over, (s - 2 * k) % 5, z, m - 2 * k * step, start - k * left, end - k * right, ring)
            if done is not None and west is not None:
                for k in range(3):
                    west[part, taken % west.shape[1], k] = t[k, end - k * right - 1]
                taken += 1
                write(done, part, taken)


@piece
def diagonals(kx: Array, ky: Array, m: int, at: int, end: int, over: Array, g: Array, slot: int, carry: Array | None) -> None:
    """Of row m, columns at to end - 1: one over the sum of each point's conductances, and what part of its west neighbour's t
    they make arrive.

    Rows are told by their numbers, as a view of a row costs as much as some hundred points; columns are unsigned, as only
    loops in which no index can count from the end are turned into vector instructions.
    """
    for i in range(np.uint32(at), np.uint32(end)):
        gives = 0.0 if carry is None else carry[1, m, i]
        over[slot, i] = 1.0 / ((kx[m, i] + kx[m, i + 1]) + (ky[m, i] + ky[m + 1, i]) + gives)
    for i in range(np.uint32(at + 1), np.uint32(end)):
        g[slot, i] = kx[m, i] * over[slot, i - 1]


@piece
def arriving(
    z: Array, kx: Array, ky: Array, c: Array, m: int, at: int, end: int, t: Array, k: int, carry: Array | None
) -> None:
    """What arrives at these points from all sides but west; at the first one from there too."""
    for i in range(np.uint32(at), np.uint32(end)):
        t[k, i] = (c[m, i] + kx[m, i + 1] * max(z[m, i + 1], 0.0)) + (
            ky[m, i] * max(z[m - 1, i], 0.0) + ky[m + 1, i] * max(z[m + 1, i], 0.0)
        )
    west = z[m, at - 1]
    t[k, at] += west * (kx[m, at] if west > 0.0 else 1.0 if carry is None else carry[0, m, at - 1])


@piece
def pass_on(
    t: Array, g: Array, g1: int, g2: int, g3: int,
    z: Array, kx: Array, ky: Array, c: Array, after: int, beyond: int, at: int, end: int, left: int, right: int,
) -> None:  # fmt: skip
    """Add to each point's t what arrives from the west: void as it is, of a pressure t over the diagonal what the face lets.

    Each step waits for the one before. Meanwhile memory is asked for what the next row, `after`, needs. left, right : how far
    west of a sweep's ends those of the next one are.
    """
    stop = end - 2 * right
    w1, w2, w3 = t[0, at], along(t, 1, g, g2, at - left, at + 1), along(t, 2, g, g3, at - 2 * left, at + 1)
    for i in range(np.uint32(at + 1), np.uint32(stop)):
        if i % 8 == 1:
            fetch(z, beyond, i)
            fetch(kx, after, i)
            fetch(ky, beyond, i)
            fetch(c, after, i)
        if min(w1, w2, w3) > 0.0:  # nearly always all are the same: a branch, which is foreseen, and no choices in the chain
            w1, w2, w3 = t[0, i] + w1 * g[g1, i], t[1, i] + w2 * g[g2, i], t[2, i] + w3 * g[g3, i]
        elif max(w1, w2, w3) <= 0.0:
            w1, w2, w3 = t[0, i] + w1, t[1, i] + w2, t[2, i] + w3
        else:
            w1 = t[0, i] + w1 * (g[g1, i] if w1 > 0.0 else 1.0)
            w2 = t[1, i] + w2 * (g[g2, i] if w2 > 0.0 else 1.0)
            w3 = t[2, i] + w3 * (g[g3, i] if w3 > 0.0 else 1.0)
        t[0, i], t[1, i], t[2, i] = w1, w2, w3
    along(t, 0, g, g1, stop - 1, end)
    along(t, 1, g, g2, stop - 1, end - right)


@piece
def along(t: Array, k: int, g: Array, slot: int, first: int, end: int) -> float:
    """The same of one sweep alone, in the columns behind the first; what arrives at the last."""
    w = t[k, first]
    for i in range(np.uint32(first + 1), np.uint32(end)):
        w = t[k, i] + w * (g[slot, i] if w > 0.0 else 1.0)
        t[k, i] = w
    return w


@piece
def pass_on_part(t: Array, k: int, g: Array, slot: int, carry: Array, m: int, end: int) -> None:
    """The same for one row whose cells store void."""
    for i in range(np.uint32(2), np.uint32(end)):
        t[k, i] += t[k, i - 1] * (g[slot, i] if t[k, i - 1] > 0.0 else carry[0, m, i - 1])


@piece
def settle(t: Array, k: int, over: Array, slot: int, z: Array, m: int, start: int, end: int, ring: bool) -> None:
    """Each point's balance solved: a pressure where something arrives, else the flow of void."""
    for i in range(np.uint32(start), np.uint32(end)):
        z[m, i] = t[k, i] * (over[slot, i] if t[k, i] > 0.0 else 1.0)
    if ring:
        nx = z.shape[1] - 2
        z[m, 0], z[m, nx + 1] = z[m, nx], z[m, 1]


@piece
def relax(z: Array, kx: Array, ky: Array, c: Array, m: int, start: int, end: int, carry: Array | None = None) -> None:
    """The points of row m in columns start to end - 1, one after the other: each balance has one solution."""
    west = z[m, start - 1]
    for i in range(start, end):
        k_W, k_E, k_S, k_N = kx[m, i], kx[m, i + 1], ky[m, i], ky[m + 1, i]
        t = c[m, i] + k_E * max(z[m, i + 1], 0.0) + k_S * max(z[m - 1, i], 0.0) + k_N * max(z[m + 1, i], 0.0)
        t += k_W * west if west > 0.0 else west if carry is None else carry[0, m, i - 1] * west
        gives = 0.0 if carry is None else carry[1, m, i]
        west = t / (k_W + k_E + k_S + k_N + gives) if t > 0.0 else t
        z[m, i] = west


@piece
def balance_at(z: Array, kx: Array, ky: Array, m: int, i: int, carry: Array | None) -> float:
    """G of a point; loops over columns that are unsigned become vector instructions, and go over what they need once."""
    k_W, k_E, k_S, k_N = kx[m, i], kx[m, i + 1], ky[m, i], ky[m + 1, i]
    west, here = z[m, i - np.uint32(1)], z[m, i]
    p = max(here, 0.0)
    # Differences of pressures, which are exact where these hardly differ: in a deep pocket the terms themselves drown all.
    out = (
        (k_W * (p - max(west, 0.0)) + k_E * (p - max(z[m, i + 1], 0.0)))
        + (k_S * (p - max(z[m - 1, i], 0.0)) + k_N * (p - max(z[m + 1, i], 0.0)))
    ) + (min(here, 0.0) - (min(west, 0.0) if carry is None else carry[0, m, i - np.uint32(1)] * min(west, 0.0)))
    return out if carry is None else out + carry[1, m, i] * p


@kernel
def norms(z: Array, kx: Array, ky: Array, c: Array, carry: Array | None, start: int, end: int) -> tuple[float, float]:
    """Sums of squares over rows start to end - 1: of the residual c - G, and of the size of its largest terms."""
    nx = z.shape[1] - 2
    residual, terms = np.zeros(nx + 2), np.zeros(nx + 2)  # sums column by column: vector instructions
    for m in range(start, end):
        for i in range(np.uint32(1), np.uint32(nx + 1)):
            residual[i] += (c[m, i] - balance_at(z, kx, ky, m, i, carry)) ** 2
            diagonal = kx[m, i] + kx[m, i + 1] + ky[m, i] + ky[m + 1, i]
            terms[i] += (abs(c[m, i]) + max(diagonal * z[m, i], -z[m, i])) ** 2
    return residual.sum(), terms.sum()


@kernel
def add_balance(z: Array, kx: Array, ky: Array, c: Array, carry: Array | None, start: int, end: int) -> None:
    """c += G(z) in rows start to end - 1: then z solves the equations of which c held the residual."""
    for m in range(start, end):
        for i in range(np.uint32(1), np.uint32(z.shape[1] - 1)):
            c[m, i] += balance_at(z, kx, ky, m, i, carry)


@kernel
def void(z: Array, leaving: tuple[Array, int, Array, Array], r: Array) -> None:
    """Into r that of z, whose frame is left out; leaving : `strip.by_lines` of b_C, of which one line may stand for all."""
    b_C = np.zeros(z.shape[1])
    for j in range(z.shape[0]):
        carried(leaving, j, b_C)
        b_C[-1] = leaving[3][j]
        for i in range(z.shape[1]):
            here = z[j, i]
            r[j, i] = here / b_C[i] if here < 0.0 else 0.0


@kernel
def pressure(z: Array, p: Array) -> None:
    """Into p that of z, whose frame is left out; p may lie in z's place, none of its points behind the one it is made of."""
    here = np.empty(z.shape[1])
    for j in range(z.shape[0]):
        for i in range(z.shape[1]):
            here[i] = max(z[j, i], 0.0)
        for i in range(z.shape[1]):
            p[j, i] = here[i]
