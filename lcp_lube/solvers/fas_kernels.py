"""Loops of the nonlinear multigrid over one rank's points, compiled when this module is imported.

Arrays have a frame of neighbours (`fas_levels.Level`): point (j, i) of the rank stands at z[j + 1, i + 1], its west and east
face at kx[j + 1, i + 1] and kx[j + 1, i + 2], its south and north face at ky[j + 1, i + 1] and ky[j + 2, i + 1]. z > 0 is a
pressure, z < 0 minus the flow of void -b_C r that leaves the cell. With it the balance of a point is

    G_i = sum of k (p_i - p_neighbour) - q_i + q_west,    p = max(z, 0), q = max(-z, 0):

B has the entries -1 and 1, on every level.
"""

import numpy as np

from ..compiled import kernel
from ..parallel import Array


@kernel
def sweep(z: Array, kx: Array, ky: Array, c: Array, count: int, down: bool) -> None:
    """`count` nonlinear Gauss-Seidel sweeps in place, every x line along the flow, lines upwards or down."""
    ny, nx = z.shape[0] - 2, z.shape[1] - 2
    for _ in range(count):
        for line in range(ny):
            m = ny - line if down else line + 1
            relax(z, kx, ky, c, m, 1, nx + 1)


@kernel
def relax(z: Array, kx: Array, ky: Array, c: Array, m: int, start: int, end: int) -> None:
    """The points of row m in columns start to end - 1, one after the other: each balance has one solution."""
    west = z[m, start - 1]
    for i in range(start, end):
        k_W, k_E, k_S, k_N = kx[m, i], kx[m, i + 1], ky[m, i], ky[m + 1, i]
        t = c[m, i] + k_E * max(z[m, i + 1], 0.0) + k_S * max(z[m - 1, i], 0.0) + k_N * max(z[m + 1, i], 0.0)
        t += k_W * west if west > 0.0 else west
        west = t / (k_W + k_E + k_S + k_N) if t > 0.0 else t
        z[m, i] = west


@kernel
def relax_front(z: Array, kx: Array, ky: Array, c: Array, count: int, width: int) -> int:
    """`count` sweeps, to and fro, over the points within `width` cells of a front; returns how many points these are."""
    ny, nx = z.shape[0] - 2, z.shape[1] - 2
    # Columns of the fronts, row by row: the sign changes to the east or to the north.
    first = np.zeros(ny + 3, dtype=np.int64)
    columns = np.empty(nx * ny // 4 + nx + 1, dtype=np.int32)
    found = 0
    for m in range(1, ny + 1):
        first[m] = found
        if found + nx > columns.size:
            columns = np.concatenate((columns, np.empty(columns.size + nx, dtype=np.int32)))
        for i in range(1, nx + 1):
            full = z[m, i] > 0.0
            if (i < nx and (z[m, i + 1] > 0.0) != full) or (m < ny and (z[m + 1, i] > 0.0) != full):
                columns[found] = i
                found += 1
    first[ny + 1] = first[ny + 2] = found
    if found == 0:
        return 0
    # Spans of points to be swept: row, first column, last column + 1.
    spans = np.empty((found + ny + 1, 3), dtype=np.int64)
    near = np.zeros(nx + 2, dtype=np.uint8)
    count_spans, points = 0, 0
    for m in range(1, ny + 1):
        low, high = first[max(m - 1 - width, 1)], first[min(m + width + 1, ny + 1)]
        if low == high:
            continue
        near[:] = 0
        for k in range(low, high):
            for i in range(max(columns[k] - width, 1), min(columns[k] + width + 1, nx) + 1):
                near[i] = 1
        i = 1
        while i <= nx:
            if near[i] == 0:
                i += 1
                continue
            start = i
            while i <= nx and near[i] == 1:
                i += 1
            if count_spans == spans.shape[0]:
                spans = np.concatenate((spans, np.empty((spans.shape[0], 3), dtype=np.int64)))
            spans[count_spans, 0], spans[count_spans, 1], spans[count_spans, 2] = m, start, i
            count_spans += 1
            points += i - start
    for s in range(count):
        for k in range(count_spans):
            at = count_spans - 1 - k if s % 2 == 1 else k
            relax(z, kx, ky, c, spans[at, 0], spans[at, 1], spans[at, 2])
    return points


@kernel
def balance_row(z: Array, kx: Array, ky: Array, m: int, out: Array) -> None:
    """G of the points of row m into out[1:-1]."""
    for i in range(1, z.shape[1] - 1):
        k_W, k_E, k_S, k_N = kx[m, i], kx[m, i + 1], ky[m, i], ky[m + 1, i]
        west, here = z[m, i - 1], z[m, i]
        out[i] = (
            ((k_W + k_E + k_S + k_N) * here if here > 0.0 else here)
            - (k_W * west if west > 0.0 else west)
            - (k_E * max(z[m, i + 1], 0.0) + k_S * max(z[m - 1, i], 0.0) + k_N * max(z[m + 1, i], 0.0))
        )


@kernel
def norms(z: Array, kx: Array, ky: Array, c: Array) -> tuple[float, float]:
    """Sums of squares over the rank's points: of the residual c - G, and of the size of its largest terms."""
    ny, nx = z.shape[0] - 2, z.shape[1] - 2
    G = np.zeros(nx + 2)
    residual, terms = 0.0, 0.0
    for m in range(1, ny + 1):
        balance_row(z, kx, ky, m, G)
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
def add_balance(z: Array, kx: Array, ky: Array, c: Array) -> None:
    """c += G(z): the right-hand side whose solution z would be if the residual, which c holds, were zero."""
    G = np.zeros(z.shape[1])
    for m in range(1, z.shape[0] - 1):
        balance_row(z, kx, ky, m, G)
        for i in range(1, z.shape[1] - 1):
            c[m, i] += G[i]


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
) -> None:
    """Add to `out` what the rank's rows of the residual c - G(z), or of c, give to the coarse points: the transposed interpolation.

    Where lines are coarsened it is halved: a row is a balance per unit width. Coarse points stand at the odd rows and columns,
    counted from 0 over the whole grid; the rank's first row is y0, and row 0 of `out` is the coarse line y0 // 2 - 1.
    """
    ny, nx = z.shape[0] - 2, z.shape[1] - 2
    r, coarse = np.zeros(nx + 2), np.zeros(out.shape[1])
    n_coarse = out.shape[1] - 2
    for m in range(1, ny + 1):
        if residual:
            balance_row(z, kx, ky, m, r)
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

    truncation: 0 none; 1 a point that would cross its front stops there; 2 nothing also from coarse points that lie, or lay,
    on the other side of it; 3 no correction at all at points with such a neighbour or that would cross.
    """
    ny, nx = z.shape[0] - 2, z.shape[1] - 2
    added = 0.0
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
            here = z[m, i]
            full = here > 0.0
            e, mixed = 0.0, False
            for J, weight_y in ((a, v), (b, 1.0 - v)):
                for k, weight_x in ((left, u), (right, 1.0 - u)):
                    after, before = new[J, k], old[J, k]
                    if truncation >= 2 and ((after > 0.0) != full or (before > 0.0) != full) and after != before:
                        mixed = True
                        continue
                    e += weight_x * weight_y * (after - before)
            if truncation == 3 and (mixed or (here + e > 0.0) != full):
                continue
            if truncation >= 1 and (here + e > 0.0) != full:
                e = (1e-300 if full else 0.0) - here
            z[m, i] = here + e
            added += e * e
    return added


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
    """Conductance of two faces one behind the other."""
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
                if not by_x:
                    k = kx[m + d, i]
                elif beyond and f == n_faces:
                    k = kx[m + d, i]
                else:
                    k = series(kx[m + d, i], kx[m + d, i + 1])
                at = min(i, ky.shape[1] - 2)
                if d == -1:
                    k *= 1.0 - share(ky[m - 1, at], ky[m, at], harmonic)
                elif d == 1:
                    k *= share(ky[m + 1, at], ky[m + 2, at], harmonic)
                total += k
            out[J + 1, f] = 0.5 * total if by_y else total


@kernel
def coarsen_y_faces(kx: Array, ky: Array, out: Array, y0: int, by_x: bool, by_y: bool, harmonic: bool, beyond: bool) -> None:
    """The same for y faces; where lines are coarsened they are halved, as every row is a balance per unit width."""
    n_faces, n_columns = out.shape[0] - 2, out.shape[1] - 2
    # Row of the even line under the first coarse face; the face south of row m is ky[m].
    shift = (0 if y0 % 2 == 1 else 1) if by_y else 1
    for F in range(n_faces):
        m = shift + (2 * F if by_y else F)
        for k in range(1, n_columns + 1):
            i = 2 * k if by_x else k
            total = 0.0
            for d in range(-1 if by_x else 0, 2 if by_x else 1):
                if not by_y:
                    value = ky[m, i + d]
                elif beyond and F == n_faces - 1:
                    value = ky[m, i + d]
                else:
                    value = series(ky[m, i + d], ky[m + 1, i + d])
                at = min(m, kx.shape[0] - 2)
                if d == -1:
                    value *= 1.0 - share(kx[at, i - 1], kx[at, i], harmonic)
                elif d == 1:
                    value *= share(kx[at, i + 1], kx[at, i + 2], harmonic)
                total += value
            out[F + 1, k] = 0.5 * total if by_y else total
