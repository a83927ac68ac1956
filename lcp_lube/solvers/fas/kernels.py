"""Loops of the nonlinear multigrid over one rank's points, compiled when this module is imported: sweeps and balances.

Arrays have a frame of neighbours (`levels.Level`): point (j, i) of the rank stands at z[j + 1, i + 1], its west and east
face at kx[j + 1, i + 1] and kx[j + 1, i + 2], its south and north face at ky[j + 1, i + 1] and ky[j + 2, i + 1]. z > 0 is a
pressure, z < 0 minus the flow of void -b_C r that leaves the cell. With it the balance of a point is

    G_i = sum of k (p_i - p_neighbour) - q_i + q_west,    p = max(z, 0), q = max(-z, 0):

B has the entries -1 and 1, on every level. In a time step cells store void: z < 0 is minus all that becomes of it, and `carry`,
its part that leaves for the next cell, takes the 1's place; steady films have carry = None, for which the loops are compiled
without it. `fronts` has the loops near the cavities' edges, `transfer` those between grids.
"""

import numpy as np

from ...base.compiled import kernel
from ...base.parallel import Array
from .waiting import await_part, write


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
    (`crew`) which columns are this one's, the lines that each has done, and what arrives from the last columns of each.
    """
    ny, nx = z.shape[0] - 2, z.shape[1] - 2
    step, first = (-1, ny) if down else (1, 1)
    parts = 1 if done is None else done.shape[0]
    own = 1 if part else 0  # column 0 of what follows is the last one of the part before
    at, taken = nx * part // parts - own, 0
    n = nx * (part + 1) // parts - at
    t, over, g = np.zeros((3, n)), np.zeros((5, n)), np.zeros((5, n))
    for before in range(0, count, 3):
        fused = min(count - before, 3)
        for s in range(ny + 2 * (fused - 1)):
            if s < ny:
                m = first + step * s
                diagonals(kx[m, at:], ky[m, at:], ky[m + 1, at:], over[s % 5], g[s % 5])
            if done is not None:
                await_part(done, part + 1, taken - 1)
                await_part(done, part - 1, taken + 1)
            for k in range(fused):
                if 0 <= s - 2 * k < ny:
                    arriving(z, kx, ky, c, first + step * (s - 2 * k), t[k], at, carry)
                    if west is not None and part:
                        t[k, 0] = west[part - 1, taken % west.shape[1], k]
                    if carry is not None:
                        pass_on_part(t[k], g[(s - 2 * k) % 5], carry[first + step * (s - 2 * k)])
            if carry is None:
                pass_on(t[0], t[1], t[2], g[s % 5], g[(s - 2) % 5], g[(s - 4) % 5])
            for k in range(fused):
                if 0 <= s - 2 * k < ny:
                    settle(t[k, own:], over[(s - 2 * k) % 5, own:], z[first + step * (s - 2 * k), at + own :], ring)
            if done is not None and west is not None:
                west[part, taken % west.shape[1], :3] = t[:, -1]
                taken += 1
                write(done, part, taken)


@kernel
def diagonals(k_x: Array, k_S: Array, k_N: Array, over: Array, g: Array) -> None:
    """Of a row: one over the sum of each point's conductances, and what part of its west neighbour's t they make arrive."""
    for i in range(over.size):
        over[i] = 1.0 / ((k_x[i + 1] + k_x[i + 2]) + (k_S[i + 1] + k_N[i + 1]))
    for i in range(1, g.size):
        g[i] = k_x[i + 1] * over[i - 1]


@kernel
def arriving(z: Array, kx: Array, ky: Array, c: Array, m: int, t: Array, at: int, carry: Array | None = None) -> None:
    """What arrives at the points of row m from column `at` on, from all sides but west; at the first one from there too."""
    k_x, source, z_S, here, z_N = kx[m, at:], c[m, at:], z[m - 1, at:], z[m, at:], z[m + 1, at:]
    k_S, k_N = ky[m, at:], ky[m + 1, at:]
    for i in range(t.size):
        t[i] = (source[i + 1] + k_x[i + 2] * max(here[i + 2], 0.0)) + (
            k_S[i + 1] * max(z_S[i + 1], 0.0) + k_N[i + 1] * max(z_N[i + 1], 0.0)
        )
    t[0] += z[m, at] * (kx[m, at + 1] if z[m, at] > 0.0 else 1.0 if carry is None else carry[m, at])


@kernel
def pass_on(t1: Array, t2: Array, t3: Array, g1: Array, g2: Array, g3: Array) -> None:
    """Add to each point's t what arrives from the west: void as it is, of a pressure t over the diagonal what the face lets."""
    w1, w2, w3 = t1[0], t2[0], t3[0]
    for i in range(1, t1.size):
        if min(w1, w2, w3) > 0.0:  # nearly always all are the same: a branch, which is foreseen, and no choices in the chain
            w1, w2, w3 = t1[i] + w1 * g1[i], t2[i] + w2 * g2[i], t3[i] + w3 * g3[i]
        elif max(w1, w2, w3) <= 0.0:
            w1, w2, w3 = t1[i] + w1, t2[i] + w2, t3[i] + w3
        else:
            w1 = t1[i] + w1 * (g1[i] if w1 > 0.0 else 1.0)
            w2 = t2[i] + w2 * (g2[i] if w2 > 0.0 else 1.0)
            w3 = t3[i] + w3 * (g3[i] if w3 > 0.0 else 1.0)
        t1[i], t2[i], t3[i] = w1, w2, w3


@kernel
def pass_on_part(t: Array, g: Array, carry: Array) -> None:
    """The same for one row whose cells store void."""
    for i in range(1, t.size):
        t[i] += t[i - 1] * (g[i] if t[i - 1] > 0.0 else carry[i])


@kernel
def settle(t: Array, over: Array, z: Array, ring: bool) -> None:
    """Each point's balance solved: a pressure where something arrives, else the flow of void."""
    for i in range(t.size):
        z[i + 1] = t[i] * (over[i] if t[i] > 0.0 else 1.0)
    if ring:
        z[0], z[t.size + 1] = z[t.size], z[1]


@kernel
def relax(z: Array, kx: Array, ky: Array, c: Array, m: int, start: int, end: int, carry: Array | None = None) -> None:
    """The points of row m in columns start to end - 1, one after the other: each balance has one solution."""
    west = z[m, start - 1]
    for i in range(start, end):
        k_W, k_E, k_S, k_N = kx[m, i], kx[m, i + 1], ky[m, i], ky[m + 1, i]
        t = c[m, i] + k_E * max(z[m, i + 1], 0.0) + k_S * max(z[m - 1, i], 0.0) + k_N * max(z[m + 1, i], 0.0)
        t += k_W * west if west > 0.0 else west if carry is None else carry[m, i - 1] * west
        west = t / (k_W + k_E + k_S + k_N) if t > 0.0 else t
        z[m, i] = west


@kernel
def balance_row(z: Array, kx: Array, ky: Array, m: int, out: Array, carry: Array | None = None) -> None:
    """G of the points of row m into out[1:-1]."""
    for i in range(1, z.shape[1] - 1):
        k_W, k_E, k_S, k_N = kx[m, i], kx[m, i + 1], ky[m, i], ky[m + 1, i]
        west, here = z[m, i - 1], z[m, i]
        p = max(here, 0.0)
        # Differences of pressures, which are exact where these hardly differ: in a deep pocket the terms themselves drown all.
        out[i] = (
            (k_W * (p - max(west, 0.0)) + k_E * (p - max(z[m, i + 1], 0.0)))
            + (k_S * (p - max(z[m - 1, i], 0.0)) + k_N * (p - max(z[m + 1, i], 0.0)))
        ) + (min(here, 0.0) - (min(west, 0.0) if carry is None else carry[m, i - 1] * min(west, 0.0)))


@kernel
def norms(z: Array, kx: Array, ky: Array, c: Array, carry: Array | None, start: int, end: int) -> tuple[float, float]:
    """Sums of squares over rows start to end - 1: of the residual c - G, and of the size of its largest terms."""
    nx = z.shape[1] - 2
    G, residual, terms = np.zeros(nx + 2), np.zeros(nx + 2), np.zeros(nx + 2)  # sums column by column: vector instructions
    for m in range(start, end):
        balance_row(z, kx, ky, m, G, carry)
        for i in range(1, nx + 1):
            residual[i] += (c[m, i] - G[i]) ** 2
        for i in range(1, nx + 1):
            diagonal = kx[m, i] + kx[m, i + 1] + ky[m, i] + ky[m + 1, i]
            terms[i] += (abs(c[m, i]) + max(diagonal * z[m, i], -z[m, i])) ** 2
    return residual.sum(), terms.sum()


@kernel
def add_balance(z: Array, kx: Array, ky: Array, c: Array, carry: Array | None, start: int, end: int) -> None:
    """c += G(z) in rows start to end - 1: then z solves the equations of which c held the residual."""
    G = np.zeros(z.shape[1])
    for m in range(start, end):
        balance_row(z, kx, ky, m, G, carry)
        for i in range(1, z.shape[1] - 1):
            c[m, i] += G[i]


@kernel
def lost_void(b_E: Array, b_W: Array, b_C: Array) -> tuple[float, float]:
    """The largest difference between the void's flow out of a cell and into the next one, and the largest b_C, per void."""
    lost, most = 0.0, 0.0
    for j in range(b_C.shape[0]):
        for i in range(1, b_C.shape[1]):
            lost = max(lost, abs(b_W[j, i] + b_E[j, i - 1]))
            most = max(most, abs(b_C[j, i]))
    return lost, most


@kernel
def pressure_and_void(z: Array, b_C: Array, p: Array, r: Array) -> None:
    """Into p and r those of z, whose frame is left out."""
    for j in range(z.shape[0]):
        for i in range(z.shape[1]):
            here = z[j, i]
            p[j, i] = here if here > 0.0 else 0.0
            r[j, i] = here / b_C[j, i] if here < 0.0 else 0.0
