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


@kernel
def sweep(z: Array, kx: Array, ky: Array, c: Array, count: int, down: bool, carry: Array | None = None) -> None:
    """`count` nonlinear Gauss-Seidel sweeps in place, every x line along the flow, lines upwards or down.

    Three at a time: the second one follows the first a line and a point behind, the third one the second. The values are those
    of sweeps one after the other, but memory is passed over once, and three chains of dependent operations overlap.
    """
    ny, nx = z.shape[0] - 2, z.shape[1] - 2
    step, first = (-1, ny) if down else (1, 1)
    left = count
    if carry is None and nx > 3:
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
                        relax(z, kx, ky, c, m - lag * step, 1, nx + 1, None)
            left -= 3
    for _ in range(left):
        for s in range(ny):
            relax(z, kx, ky, c, first + step * s, 1, nx + 1, carry)


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
    relax(z, kx, ky, c, m1, 1, 3, None)
    relax(z, kx, ky, c, m2, 1, 2, None)
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
    relax(z, kx, ky, c, m2, nx, nx + 1, None)
    relax(z, kx, ky, c, m3, nx - 1, nx + 1, None)


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
def norms(z: Array, kx: Array, ky: Array, c: Array, carry: Array | None = None) -> tuple[float, float]:
    """Sums of squares over the rank's points: of the residual c - G, and of the size of its largest terms."""
    ny, nx = z.shape[0] - 2, z.shape[1] - 2
    G = np.zeros(nx + 2)
    residual, terms = 0.0, 0.0
    for m in range(1, ny + 1):
        balance_row(z, kx, ky, m, G, carry)
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
def add_balance(z: Array, kx: Array, ky: Array, c: Array, carry: Array | None = None) -> None:
    """c += G(z): the right-hand side whose solution z would be if the residual, which c holds, were zero."""
    G = np.zeros(z.shape[1])
    for m in range(1, z.shape[0] - 1):
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
def pressure_and_void(z: Array, b_C: Array) -> tuple[Array, Array]:
    """p and r of z, whose frame is left out."""
    p, r = np.empty(z.shape), np.empty(z.shape)
    for j in range(z.shape[0]):
        for i in range(z.shape[1]):
            here = z[j, i]
            p[j, i] = here if here > 0.0 else 0.0
            r[j, i] = here / b_C[j, i] if here < 0.0 else 0.0
    return p, r
