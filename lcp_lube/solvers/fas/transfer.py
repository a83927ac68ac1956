"""Between a grid and the next coarser one: residuals, corrections, starts and conductances; arrays as in `kernels`."""

import numpy as np

from ...base.compiled import kernel
from ...base.parallel import Array
from .fronts import reforms
from .kernels import balance_row


@kernel
def share(a: float, b: float, harmonic: bool) -> float:
    """Weight of the neighbour behind conductance a, 1 minus that of the one behind b, in the interpolation between them."""
    if a + b > 0.0 and (harmonic or a == 0.0 or b == 0.0):
        return a / (a + b)
    return 0.5


@kernel
def restrict(
    z: Array,
    kx: Array,
    ky: Array,
    c: Array,
    out: Array,
    y0: int,
    by_x: bool,
    by_y: bool,
    harmonic: bool,
    wrap: bool,
    residual: bool,
    carry: Array | None = None,
) -> None:
    """Add to `out` what the rank's rows of the residual c - G(z), or of c, give to the coarse points.

    That is the transposed interpolation, halved where lines are coarsened: a row is a balance per unit width. Coarse points
    stand at the odd rows and columns, counted from 0 over the whole grid; the rank's first row is y0, and row 0 of `out` is
    the coarse line y0 // 2 - 1.
    """
    ny, nx = z.shape[0] - 2, z.shape[1] - 2
    r, coarse = np.zeros(nx + 2), np.zeros(out.shape[1])
    n_coarse = out.shape[1] - 2
    for m in range(1, ny + 1):
        if residual:
            balance_row(z, kx, ky, m, r, carry)
            for i in range(1, nx + 1):
                r[i] = c[m, i] - r[i]
        else:
            r[1:-1] = c[m, 1:-1]
        j = y0 + m - 1
        odd = j % 2 == 1
        row = (j - 1) // 2 - y0 // 2 + 1 if odd else j // 2 - y0 // 2
        if not by_y:
            row = m
        if not by_x:
            coarse[:] = r
        else:
            coarse[:] = 0.0
            for k in range(n_coarse):
                coarse[k + 1] = r[2 * k + 2]
            for i in range(0, nx, 2):
                w = share(kx[m, i + 1], kx[m, i + 2], harmonic)
                coarse[i // 2] += w * r[i + 1]
                coarse[i // 2 + 1] += (1.0 - w) * r[i + 1]
            if wrap:  # periodic in x: what goes to the frame belongs to the last point
                coarse[n_coarse] += coarse[0]
        if not by_y:
            for k in range(out.shape[1]):
                out[row, k] += coarse[k]
        elif odd:
            for k in range(out.shape[1]):
                out[row, k] += 0.5 * coarse[k]
        else:
            for k in range(1, n_coarse + 1):
                i = 2 * k if by_x else k
                w = 0.5 * share(ky[m, i], ky[m + 1, i], harmonic)
                out[row, k] += w * coarse[k]
                out[row + 1, k] += (0.5 - w) * coarse[k]


@kernel
def inject(z: Array, out: Array, y0: int, by_x: bool, by_y: bool) -> None:
    """The values at the coarse points that are among the rank's."""
    sx, sy = 2 if by_x else 1, 2 if by_y else 1
    shift = (1 - y0 % 2 if by_y else 0) + 1  # row of the first coarse line among the rank's
    for J in range(out.shape[0] - 2):
        for k in range(1, out.shape[1] - 1):
            out[J + 1, k] = z[shift + sy * J, sx * k]


@kernel
def correct(
    z: Array, new: Array, old: Array, kx: Array, ky: Array, y0: int, by_x: bool, by_y: bool, harmonic: bool, truncation: int
) -> float:
    """Add the interpolated new - old of the coarse grid; returns the sum of squares of what was added.

    Where the film reforms, what flows back into the cavity returns: a point between that and a coarse point in the full film is
    corrected as the latter, not by a part of it.
    truncation: 0 none; 1 that, and a point that would cross its front stops there; 2 no correction at all at points that
    would, or that have a coarse neighbour that lies, or lay, on the other side.
    """
    ny, nx = z.shape[0] - 2, z.shape[1] - 2
    south, north, e = np.zeros(nx + 2), np.zeros(nx + 2), np.zeros(nx + 2)
    before = -2  # the coarse row whose correction stands in south
    added = 0.0
    for m in range(1, ny + 1):
        j = y0 + m - 1
        row = m if not by_y else ((j + 1) // 2 - y0 // 2 if j % 2 == 1 else j // 2 - y0 // 2)
        if row != before:
            interpolate_row(new[row] - old[row], kx, m, by_x, harmonic, south)
            before = row
        if not by_y or j % 2 == 1:
            e[:] = south
        else:
            interpolate_row(new[row] - old[row], kx, m, by_x, harmonic, south)
            interpolate_row(new[row + 1] - old[row + 1], kx, m, by_x, harmonic, north)
            for i in range(1, nx + 1):
                v = share(ky[m, i], ky[m + 1, i], harmonic)
                e[i] = v * south[i] + (1.0 - v) * north[i]
            if truncation == 1:
                for i in range(1, nx + 1):
                    if z[m, i] > 0.0:
                        if z[m - 1, i] <= 0.0 and z[m + 1, i] > 0.0 and reforms(z, m - 1, i):
                            e[i] = north[i]
                        elif z[m + 1, i] <= 0.0 and z[m - 1, i] > 0.0 and reforms(z, m + 1, i):
                            e[i] = south[i]
            before = -2
        if truncation == 1 and by_x:
            for i in range(1, nx, 2):
                if z[m, i] > 0.0 and z[m, i - 1] <= 0.0 and z[m, i + 1] > 0.0:
                    e[i] = e[i + 1]
        if truncation == 2:
            last = row + (by_y and j % 2 == 0)
            for i in range(1, nx + 1):
                left, right = (i // 2, (i + 1) // 2) if by_x else (i, i)
                full = z[m, i] > 0.0
                for J in (row, last):
                    for k in (left, right):
                        if ((new[J, k] > 0.0) != full or (old[J, k] > 0.0) != full) and new[J, k] != old[J, k]:
                            e[i] = 0.0
        stop = 0.0 if truncation == 2 else 1.0
        for i in range(1, nx + 1):
            here = z[m, i]
            moved = here + e[i]
            if truncation > 0 and (moved > 0.0) != (here > 0.0):
                moved = (1e-300 if here > 0.0 else 0.0) if stop > 0.0 else here
            z[m, i] = moved
            added += (moved - here) ** 2
    return added


@kernel
def interpolate_row(coarse: Array, kx: Array, m: int, by_x: bool, harmonic: bool, out: Array) -> None:
    """A coarse line's values at the points of row m, whose x faces give the weights."""
    if not by_x:
        out[:] = coarse
        return
    for k in range(1, coarse.size - 1):
        out[2 * k] = coarse[k]
    for k in range((out.size - 1) // 2):
        u = share(kx[m, 2 * k + 1], kx[m, 2 * k + 2], harmonic)
        out[2 * k + 1] = u * coarse[k] + (1.0 - u) * coarse[k + 1]


@kernel
def interpolate(z: Array, coarse: Array, kx: Array, ky: Array, y0: int, by_x: bool, by_y: bool, harmonic: bool) -> None:
    """A start from the coarse grid's answer: p and q interpolated one by one, the larger flow decides which one a point has."""
    ny, nx = z.shape[0] - 2, z.shape[1] - 2
    for m in range(1, ny + 1):
        j = y0 + m - 1
        if not by_y:
            a = b = m
        elif j % 2 == 1:
            a = b = (j - 1) // 2 - y0 // 2 + 1
        else:
            a = j // 2 - y0 // 2
            b = a + 1
        for i in range(1, nx + 1):
            if not by_x:
                left = right = i
            elif i % 2 == 0:
                left = right = i // 2
            else:
                left = (i - 1) // 2
                right = left + 1
            u = 0.5 if left == right else share(kx[m, i], kx[m, i + 1], harmonic)
            v = 0.5 if a == b else share(ky[m, i], ky[m + 1, i], harmonic)
            p, q = 0.0, 0.0
            for J, weight_y in ((a, v), (b, 1.0 - v)):
                for k, weight_x in ((left, u), (right, 1.0 - u)):
                    if coarse[J, k] > 0.0:
                        p += weight_x * weight_y * coarse[J, k]
                    else:
                        q -= weight_x * weight_y * coarse[J, k]
            z[m, i] = p if p * (kx[m, i] + kx[m, i + 1] + ky[m, i] + ky[m + 1, i]) > q else -q


@kernel
def series(a: float, b: float) -> float:
    """Conductance of two faces one behind the other; one that lies in a supply, -1, resists nothing (`held.marked`)."""
    if a < 0.0 or b < 0.0:
        return max(a, b, 0.0)
    return a * b / (a + b) if a + b > 0.0 else 0.0


@kernel
def coarsen_x_faces(kx: Array, ky: Array, out: Array, y0: int, by_x: bool, by_y: bool, harmonic: bool, beyond: bool) -> None:
    """Conductances of the coarse x faces: in series along x, added up across with the restriction's weights.

    beyond: the last coarse point is the last fine one, and only one fine face lies between it and the side.
    """
    n_rows, n_faces = out.shape[0] - 2, out.shape[1] - 2
    shift = (1 - y0 % 2 if by_y else 0) + 1
    for J in range(n_rows):
        m = shift + (2 * J if by_y else J)
        for f in range(1, n_faces + 1):
            i = 2 * f - 1 if by_x else f  # the face's column, or that of the first of two, between which point i lies
            total = 0.0
            for d in range(-1 if by_y else 0, 2 if by_y else 1):
                k = kx[m + d, i]
                if by_x and not (beyond and f == n_faces):
                    k = series(k, kx[m + d, i + 1])
                at = min(i, ky.shape[1] - 2)
                if d == -1:
                    k *= 1.0 - share(ky[m - 1, at], ky[m, at], harmonic)
                elif d == 1:
                    k *= share(ky[m + 1, at], ky[m + 2, at], harmonic)
                total += max(k, 0.0)
            out[J + 1, f] = 0.5 * total if by_y else total


@kernel
def coarsen_y_faces(kx: Array, ky: Array, out: Array, y0: int, by_x: bool, by_y: bool, harmonic: bool, beyond: bool) -> None:
    """The same for y faces; where lines are coarsened they are halved, as every row is a balance per unit width."""
    n_faces, n_columns = out.shape[0] - 2, out.shape[1] - 2
    # Row of the even line under the first coarse face; the face south of row m is ky[m].
    shift = (0 if y0 % 2 == 1 else 1) if by_y else 1
    for f in range(1, n_faces + 1):
        m = shift + (2 * f - 2 if by_y else f - 1)
        for k in range(1, n_columns + 1):
            i = 2 * k if by_x else k
            total = 0.0
            for d in range(-1 if by_x else 0, 2 if by_x else 1):
                value = ky[m, i + d]
                if by_y and not (beyond and f == n_faces):
                    value = series(value, ky[m + 1, i + d])
                at = min(m, kx.shape[0] - 2)
                if d == -1:
                    value *= 1.0 - share(kx[at, i - 1], kx[at, i], harmonic)
                elif d == 1:
                    value *= share(kx[at, i + 1], kx[at, i + 2], harmonic)
                total += max(value, 0.0)
            out[f, k] = 0.5 * total if by_y else total
