"""Sweeps and balances of the film linearised at the signs of a solution, and of the transposed system (`frozen`).

Arrays have the frame of `kernels`, before it one axis of several right-hand sides, or of a real and an imaginary part. `full`
says where the film is full, `free` (None: everywhere) where it is not held at a pressure. A point's row of J is there

    sum of k (p_i - p_neighbour) - q_i + carry q_west = c_i,      p where the film is full, -q in the cavity,

and of J', its transpose, a full point's sum of k (l_i - l_neighbour) = c_i, a cavitated one's l_i - carry l_east = c_i: void
hands what is asked of it on to the east. carry + i turn is the part of a cell's void that leaves it; None, None: all of it.
"""

import numpy as np
from numpy.typing import NDArray

from ...base.compiled import kernel, piece
from ...base.parallel import Array

Mask = NDArray[np.bool_]


@kernel
def sweep(
    z: Array, full: Mask, free: Mask | None, kx: Array, ky: Array, c: Array, down: bool,
    carry: Array | None, turn: Array | None,
) -> None:  # fmt: skip
    """One Gauss-Seidel sweep of J z = c in place, every x line along the flow, lines upwards or down."""
    several, ny, nx = z.shape[0], z.shape[1] - 2, z.shape[2] - 2
    given, west, across = np.empty((2, nx + 2)), np.empty(nx + 2), np.zeros(nx + 2)
    for s in range(ny):
        m = ny - s if down else 1 + s
        for i in range(1, nx + 1):  # loops of their own: they need no neighbour's new value, and go by vectors
            over = 1.0 / ((kx[m, i] + kx[m, i + 1]) + (ky[m, i] + ky[m + 1, i])) if full[m, i] else 1.0
            if free is not None:
                over = over if free[m, i] else 0.0
            west[i] = over * (kx[m, i] if full[m, i - 1] else (1.0 if carry is None else carry[m, i - 1]))
            if turn is not None:
                across[i] = 0.0 if full[m, i - 1] else over * turn[m, i - 1]
        for n in range(several):
            for i in range(1, nx + 1):
                over = 1.0 / ((kx[m, i] + kx[m, i + 1]) + (ky[m, i] + ky[m + 1, i])) if full[m, i] else 1.0
                if free is not None:
                    over = over if free[m, i] else 0.0
                east = z[n, m, i + 1] if full[m, i + 1] else 0.0
                south = z[n, m - 1, i] if full[m - 1, i] else 0.0
                north = z[n, m + 1, i] if full[m + 1, i] else 0.0
                given[n, i] = over * (c[n, m, i] + kx[m, i + 1] * east + ky[m, i] * south + ky[m + 1, i] * north)
        if several == 1:
            a = z[0, m, 0]
            for i in range(1, nx + 1):
                a = given[0, i] + west[i] * a
                z[0, m, i] = a
        else:  # both chains at once
            a, b = z[0, m, 0], z[1, m, 0]
            for i in range(1, nx + 1):
                if turn is None:
                    a, b = given[0, i] + west[i] * a, given[1, i] + west[i] * b
                else:
                    a, b = given[0, i] + (west[i] * a - across[i] * b), given[1, i] + (west[i] * b + across[i] * a)
                z[0, m, i], z[1, m, i] = a, b


@kernel
def residual(
    z: Array, full: Mask, free: Mask | None, kx: Array, ky: Array, c: Array, carry: Array | None, turn: Array | None, out: Array
) -> None:
    """c - J z at all of the rank's points; none where a pressure is held."""
    several, ny, nx = z.shape[0], z.shape[1] - 2, z.shape[2] - 2
    for m in range(1, ny + 1):
        for n in range(several):
            for i in range(1, nx + 1):
                here = z[n, m, i] if full[m, i] else 0.0
                west, passed = (z[n, m, i - 1], 0.0) if full[m, i - 1] else (0.0, z[n, m, i - 1])
                if turn is not None and carry is not None:
                    other = 0.0 if full[m, i - 1] else z[1 - n, m, i - 1]
                    passed = passed * carry[m, i - 1] + (2.0 * n - 1.0) * turn[m, i - 1] * other
                elif carry is not None:
                    passed = passed * carry[m, i - 1]
                east = z[n, m, i + 1] if full[m, i + 1] else 0.0
                south = z[n, m - 1, i] if full[m - 1, i] else 0.0
                north = z[n, m + 1, i] if full[m + 1, i] else 0.0
                flows = (kx[m, i] * (here - west) + kx[m, i + 1] * (here - east)) + (
                    ky[m, i] * (here - south) + ky[m + 1, i] * (here - north)
                )
                rest = c[n, m, i] - flows - ((0.0 if full[m, i] else z[n, m, i]) - passed)
                if free is not None:
                    rest = rest if free[m, i] else 0.0
                out[n, m, i] = rest


@kernel
def transposed_sweep(
    l: Array, full: Mask, free: Mask | None, kx: Array, ky: Array, c: Array, down: bool,
    carry: Array | None, ring: bool,
) -> None:  # fmt: skip
    """Two Gauss-Seidel sweeps of J' l = c in place, each x line against the flow, lines upwards or down.

    The second one follows two lines behind the first (`kernels.sweep`): their chains overlap. Columns are unsigned for vector
    instructions. ring: the ends of a line are neighbours.
    """
    one, none = l.dtype.type(1), l.dtype.type(0)
    several, ny, nx = l.shape[0], l.shape[1] - 2, l.shape[2] - 2
    step, first = (-1, ny) if down else (1, 1)
    over, east, t = np.zeros((3, nx + 2), l.dtype), np.zeros((3, nx + 2), l.dtype), np.zeros((4, nx + 2), l.dtype)
    for s in range(ny + 2):
        m, slot, behind = first + step * s, s % 3, (s - 2) % 3
        if s < ny:
            for i in range(np.uint32(1), np.uint32(nx + 1)):
                part = one / ((kx[m, i] + kx[m, i + 1]) + (ky[m, i] + ky[m + 1, i])) if full[m, i] else one
                if free is not None:
                    part = part if free[m, i] else none
                over[slot, i] = part
            for i in range(np.uint32(1), np.uint32(nx + 1)):
                east[slot, i] = over[slot, i] * (kx[m, i + 1] if full[m, i] else one if carry is None else carry[m, i])
        for k in range(2):
            if 0 <= s - 2 * k < ny:
                j, q = m - 2 * k * step, behind if k else slot
                for n in range(several):
                    w = k * several + n
                    for i in range(np.uint32(1), np.uint32(nx + 1)):
                        others = kx[j, i] * l[n, j, i - 1] + (ky[j, i] * l[n, j - 1, i] + ky[j + 1, i] * l[n, j + 1, i])
                        t[w, i] = over[q, i] * (c[n, j, i] + (others if full[j, i] else none))
                    t[w, nx] += east[q, nx] * l[n, j, nx + 1]
        for k in range(several):  # two chains at once
            lead, two = 2 * k, 2 * k + 1
            by_one, by_two = (slot, behind) if several == 1 else (behind, behind) if k else (slot, slot)
            a, b = t[lead, nx], t[two, nx]
            for i in range(nx - 1, 0, -1):
                a, b = t[lead, i] + east[by_one, i] * a, t[two, i] + east[by_two, i] * b
                t[lead, i], t[two, i] = a, b
        for k in range(2):
            if 0 <= s - 2 * k < ny:
                j = m - 2 * k * step
                for n in range(several):
                    for i in range(np.uint32(1), np.uint32(nx + 1)):
                        l[n, j, i] = t[k * several + n, i]
                    if ring:
                        l[n, j, 0], l[n, j, nx + 1] = l[n, j, nx], l[n, j, 1]


@kernel
def transposed_residual(
    l: Array, full: Mask, free: Mask | None, kx: Array, ky: Array, c: Array, carry: Array | None, over: Array, out: Array
) -> None:
    """c - J' l at all of the rank's points, times `over`, a number of each; none where a pressure is held."""
    row = np.zeros(l.shape[2], l.dtype)
    for n in range(l.shape[0]):
        for m in range(1, l.shape[1] - 1):
            transposed_row(l[n], full, free, kx, ky, c[n], carry, m, row)
            for i in range(1, l.shape[2] - 1):
                out[n, m, i] = over[n] * row[i]


@kernel
def transposed_misfit(
    l: Array, full: Mask, free: Mask | None, kx: Array, ky: Array, c: Array, carry: Array | None, z: Array, out: Array
) -> None:
    """(c - J' l)' z of each l."""
    row, sums = np.zeros(l.shape[2], l.dtype), np.zeros(l.shape[2], l.dtype)
    for n in range(l.shape[0]):
        sums[:] = 0.0
        for m in range(1, l.shape[1] - 1):
            transposed_row(l[n], full, free, kx, ky, c[n], carry, m, row)
            for i in range(1, l.shape[2] - 1):
                sums[i] += row[i] * z[m, i]
        out[n] = sums.sum()


@kernel
def products(c: Array, z: Array, out: Array) -> None:
    """|c|' |z| of each c."""
    sums = np.zeros(z.shape[1])
    for n in range(c.shape[0]):
        sums[:] = 0.0
        for m in range(1, z.shape[0] - 1):
            for i in range(1, z.shape[1] - 1):
                sums[i] += abs(c[n, m, i] * z[m, i])
        out[n] = sums.sum()


@kernel
def add(x: Array, v: Array, part: Array) -> None:
    """So much of a vector, a part of each answer, to x."""
    for n in range(x.shape[0]):
        some = x.dtype.type(part[n])
        for m in range(x.shape[1]):
            for i in range(x.shape[2]):
                x[n, m, i] += some * v[n, m, i]


@kernel
def in_units(values: Array, cavity: Mask, unit: Array, into: bool, out: Array) -> None:
    """Values, in the cavity in units of their own or, of those that are so, not."""
    for m in range(values.shape[0]):
        for i in range(values.shape[1]):
            part = (1.0 / unit[m, i] if into else unit[m, i]) if cavity[m, i] else 1.0
            out[m, i] = part * values[m, i]


@kernel
def kept(a: Array, full: Mask) -> None:
    """Nothing but what is in the full film."""
    none = a.dtype.type(0)
    for m in range(a.shape[0]):
        for i in range(a.shape[1]):
            a[m, i] = a[m, i] if full[m, i] else none


@piece
def transposed_row(
    l: Array, full: Mask, free: Mask | None, kx: Array, ky: Array, c: Array, carry: Array | None, m: int, out: Array
) -> None:
    """The same of one row and right-hand side."""
    for i in range(np.uint32(1), np.uint32(l.shape[1] - 1)):
        here, east = l[m, i], l[m, i + 1]
        flows = (kx[m, i] * (here - l[m, i - 1]) + kx[m, i + 1] * (here - east)) + (
            ky[m, i] * (here - l[m - 1, i]) + ky[m + 1, i] * (here - l[m + 1, i])
        )
        passed = east if carry is None else carry[m, i] * east
        rest = c[m, i] - (flows if full[m, i] else here - passed)
        if free is not None:
            rest = rest if free[m, i] else l.dtype.type(0)
        out[i] = rest
