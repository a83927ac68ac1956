"""Films with steps: weights of interpolation that know what is tied to what round a pocket's corner, and conductances of the
next coarser grid that make corrections cost there what they cost; arrays as in `kernels`.

A point between two coarse ones of a line follows them by its own conductances and by those past the points beside that line, a
point between four its four neighbours. With this interpolation P, and its transpose for the restriction, the best coarse grid
is P' A P, of nine points. In each of its cells that is six conductances between four corners, of which the two across are put
on the four sides, half of each: what smooth corrections cost stays as it is, and none costs less than half of what it should.
So none is made more than twice too large, and two grids do not diverge in full film.
"""

import numpy as np

from ...base.compiled import kernel, piece
from ...base.parallel import Array
from .transfer import coarse_rows, drop, follow_across, follow_along, interpolate_row, moved
from .weights import Ways, centre, share, stored_shares


@piece
def past(W: float, E: float, S: float, N: float, over: float) -> tuple[float, float]:
    """What a point between four coarse ones adds to the conductances to the west and east of one that it has `over` to."""
    total = W + E + S + N
    link = over / total if total > 0.0 else 0.0
    return link * W, link * E


@kernel
def make_ways(kx: Array, ky: Array, out: Ways, y0: int, start: int, end: int) -> None:
    """Of rows start + 1 to end, which both directions coarsen: the weights of the west neighbours of points between two coarse
    ones of a line, of the south neighbours of those between two lines."""
    for m in range(start + 1, end + 1):
        along = (y0 + m - 1) % 2 == 1
        for i in range(1 if along else 2, out.shape[1] - 1, 2):
            if along:
                a, b = kx[m, i], kx[m, i + 1]
                for n, over in ((m - 1, ky[m, i]), (m + 1, ky[m + 1, i])):
                    more = past(kx[n, i], kx[n, i + 1], ky[n, i], ky[n + 1, i], over)
                    a, b = a + more[0], b + more[1]
            else:
                a, b = ky[m, i], ky[m + 1, i]
                for n, over in ((i - 1, kx[m, i]), (i + 1, kx[m, i + 1])):
                    more = past(ky[m, n], ky[m + 1, n], kx[m, n], kx[m, n + 1], over)
                    a, b = a + more[0], b + more[1]
            out[m, i] = share(a, b, True)


@kernel
def coarsen(
    kx: Array, ky: Array, ways: Ways, out_x: Array, out_y: Array,
    y0: int, beyond_x: bool, beyond_y: bool, ring: bool, start: int, end: int,
) -> None:  # fmt: skip
    """Add to conductances of the coarse grid what the fine rows give to its rows start to end - 1, halved as every row is a
    balance per unit width.

    beyond : the last coarse point is the last fine one, and only one fine face lies between it and the side.
    """
    ny, nx, n_coarse = kx.shape[0] - 2, ky.shape[1] - 2, out_y.shape[1] - 2
    first, last = 2 * (start - 1 + y0 // 2) - y0 + 1, 2 * (end - 1 + y0 // 2) - y0 + 1
    cells = n_coarse if beyond_x or ring else n_coarse + 1  # with fine points between west and east
    for m in range(max(first, 1), min(last, ny) + 1):
        row = (y0 + m) // 2 - y0 // 2  # the coarse line, or that to the south
        if (y0 + m - 1) % 2 == 1:
            if start <= row < end:
                for f in range(1, cells + 1):
                    out_x[row, f] += 0.5 * in_turn(kx[m, 2 * f - 1], kx[m, 2 * f], ways[m, 2 * f - 1])
                if beyond_x:
                    out_x[row, cells + 1] += 0.5 * kx[m, nx + 1]
                if beyond_y and m == ny:
                    for k in range(1, n_coarse + 1):
                        out_y[row + 1, k] += 0.5 * ky[m + 1, 2 * k]
                    for f in range(1, cells + 1):
                        deal(0.5 * ky[m + 1, 2 * f - 1], ways[m, 2 * f - 1], out_y, row + 1, f, ring)
            continue
        here, north = start <= row < end, start <= row + 1 < end
        if north:
            for k in range(1, n_coarse + 1):
                out_y[row + 1, k] += 0.5 * in_turn(ky[m, 2 * k], ky[m + 1, 2 * k], ways[m, 2 * k])
        for f in range(1, cells + 1):
            i = 2 * f - 1
            us, un = 1.0 - ways[m - 1, i], 1.0 - ways[m + 1, i]
            vw, ve = ways[m, i - 1], ways[m, i + 1]
            # Beyond a side corrections vanish, and any weights are right: those of the other side make least of it.
            us, un = (
                (us if kx[m - 1, i] + kx[m - 1, i + 1] > 0.0 else un),
                (un if kx[m + 1, i] + kx[m + 1, i + 1] > 0.0 else us),
            )
            vw, ve = (
                (vw if ky[m, i - 1] + ky[m + 1, i - 1] > 0.0 else ve),
                (ve if ky[m, i + 1] + ky[m + 1, i + 1] > 0.0 else vw),
            )
            south_side, north_side, west_side, east_side = cell(kx[m, i], kx[m, i + 1], ky[m, i], ky[m + 1, i], us, un, vw, ve)
            if here:
                out_x[row, f] += 0.5 * south_side
            if north:
                out_x[row + 1, f] += 0.5 * north_side
                out_y[row + 1, f - 1 if f > 1 or not ring else n_coarse] += 0.5 * west_side
                out_y[row + 1, f] += 0.5 * east_side
        if beyond_x:
            v, k = ways[m, nx], 0.5 * kx[m, nx + 1]
            if here:
                out_x[row, cells + 1] += v * k
            if north:
                out_x[row + 1, cells + 1] += (1.0 - v) * k


@piece
def in_turn(a: float, b: float, w: float) -> float:
    """What a difference of 1 costs along two faces between which it is 1 - w."""
    return a * (1.0 - w) ** 2 + b * w * w


@piece
def deal(k: float, w: float, out_y: Array, row: int, f: int, ring: bool) -> None:
    """A y face between two coarse columns, put on these by the weights of its point."""
    out_y[row, f - 1 if f > 1 or not ring else out_y.shape[1] - 2] += w * k
    out_y[row, f] += (1.0 - w) * k


@piece
def cell(
    W: float, E: float, S: float, N: float, us: float, un: float, vw: float, ve: float
) -> tuple[float, float, float, float]:
    """Conductances of the south, north, west and east side of a coarse cell, that its inner point's make.

    us, un : weights of the eastern corners at the points on the south and north side; vw, ve : of the southern ones at those on
    the west and east side. Without the inner point each two of these four points are tied.
    """
    _, e, s, n = centre(W, E, S, N)
    we, sn, ws, es, en, wn = W * e, S * n, W * s, E * s, E * n, W * n
    ls, rs, rn, ln = ws * us * (1.0 - vw), es * (1.0 - us) * (1.0 - ve), en * ve * (1.0 - un), wn * vw * un
    up = we * vw * (1.0 - ve) + sn * (1.0 - us) * un + rs + ln  # from the south west to the north east
    down = we * ve * (1.0 - vw) + sn * us * (1.0 - un) + ls + rn
    south = we * vw * ve - sn * us * (1.0 - us) + ws * us * us - ls + es * (1.0 - us) ** 2 - rs
    north = we * (1.0 - vw) * (1.0 - ve) - sn * un * (1.0 - un) + en * (1.0 - un) ** 2 - rn + wn * un * un - ln
    west = sn * (1.0 - us) * (1.0 - un) - we * vw * (1.0 - vw) + ws * (1.0 - vw) ** 2 - ls + wn * vw * vw - ln
    east = sn * us * un - we * ve * (1.0 - ve) + es * (1.0 - ve) ** 2 - rs + en * ve * ve - rn
    return side(south, up, down), side(north, up, down), side(west, up, down), side(east, up, down)


@piece
def side(k: float, up: float, down: float) -> float:
    """Half of what lies across added to a side's own, which may be negative; at least half of what no correction exceeds."""
    return max(k + 0.5 * (up + down), 0.5 * max(k + max(up, down), 0.0))


@kernel
def correct(
    z: Array, new: Array, old: Array, kx: Array, ky: Array, ways: Ways,
    y0: int, truncation: int, ring: bool, start: int, end: int,
) -> float:  # fmt: skip
    """`transfer.correct` by these weights, of pressures by pressures and of void by void: a coarse point in a deep pocket
    that fills or empties says nothing of the other.

    Where full film flows into a cavitated neighbour but a western one, whose void does not come back, p = 0 holds the point as
    much as its other neighbours move it: else pockets in which a cavity ends were filled anew by each correction.
    """
    nx, size = z.shape[1] - 2, new.shape[1]
    w, d, added = np.zeros((2, size - 1)), np.zeros(size), np.zeros(nx + 2)
    south, north, e, flows = np.zeros(nx + 2), np.zeros(nx + 2), np.zeros(nx + 2), np.zeros(nx + 2)
    for m in range(start, end):
        row, last = coarse_rows(y0 + m - 1, y0, m, True)
        between = last > row
        stored_shares(ways, m - 1 if between else m, w[0])
        stored_shares(ways, m + 1 if between else m, w[1])
        void = 0
        for i in range(1, nx + 1):
            void += z[m, i] <= 0.0
        for sign in (-1.0, 1.0):
            if sign > 0.0 or void > 0:
                for n in range(2 if between else 1):
                    for k in range(size):
                        d[k] = max(sign * new[row + n, k], 0.0) - max(sign * old[row + n, k], 0.0)
                    interpolate_row(d, w[n], True, north if n else south)
                if between:
                    mix_four(south, north, kx, ky, ways, m, e)
                else:
                    e[:] = south
            if sign < 0.0:
                flows[:] = e
        if truncation == 1:
            if between:
                follow_across(z, m, south, north, ring, e)
            follow_along(z, m, e)
            hold(z, kx, ky, m, e)
        elif truncation == 2:
            drop(z, m, new, old, row, last, True, e)
        for i in range(1, nx + 1):
            here = z[m, i]
            z[m, i] = moved(here, e[i] if here > 0.0 else -flows[i], truncation)
            added[i] += (z[m, i] - here) ** 2
    return added.sum()


@piece
def mix_four(south: Array, north: Array, kx: Array, ky: Array, ways: Ways, m: int, out: Array) -> None:
    """Row m between two coarse lines."""
    for i in range(0, out.size, 2):
        out[i] = north[i] + ways[m, i] * (south[i] - north[i])
    for i in range(1, out.size - 1, 2):
        W, E, S, N = centre(kx[m, i], kx[m, i + 1], ky[m, i], ky[m + 1, i])
        out[i] = W * out[i - 1] + E * out[i + 1] + S * south[i] + N * north[i]


@piece
def hold(z: Array, kx: Array, ky: Array, m: int, e: Array) -> None:
    """Corrections of full points of row m, as cavitated neighbours hold them; beyond sides z is 0."""
    for i in range(1, z.shape[1] - 1):
        if z[m, i] > 0.0 and min(z[m, i + 1], z[m - 1, i], z[m + 1, i]) < 0.0:
            E, S, N = kx[m, i + 1], ky[m, i], ky[m + 1, i]
            left = (E if z[m, i + 1] >= 0.0 else 0.0) + (S if z[m - 1, i] >= 0.0 else 0.0) + (N if z[m + 1, i] >= 0.0 else 0.0)
            W = kx[m, i] if z[m, i - 1] >= 0.0 else 0.0
            e[i] *= (W + left) / (W + E + S + N)
