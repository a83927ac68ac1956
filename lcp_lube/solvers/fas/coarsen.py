"""Conductances of the next coarser grid; arrays as in `kernels`.

Each fine row's are put in series, and its weights made, once, in loops of which vector instructions are made.
"""

import numpy as np

from ...base.compiled import kernel, piece
from ...base.parallel import Array
from .transfer import restrict_row
from .weights import series, share, west_shares


@kernel
def coarsen_x_faces(
    kx: Array, ky: Array, out: Array, y0: int, by_x: bool, by_y: bool, harmonic: bool, seam: bool, beyond: bool,
    start: int, end: int,
) -> None:  # fmt: skip
    """Of rows start + 1 to end the coarse x faces' conductances: in series along x, added up across by restriction's weights.

    beyond: the last coarse point is the last fine one, and only one fine face lies between it and the side. seam: round a ring
    of an odd number of points three fine faces lie between the last coarse point and the first.
    """
    n = out.shape[1] - 2
    shift = (1 - y0 % 2 if by_y else 0) + 1
    here, south, north = np.zeros(n + 2), np.zeros((2, n + 2)), np.zeros((2, n + 2))  # the lines beside: with their weights
    for J in range(start, end):
        m = shift + (2 * J if by_y else J)
        in_line(kx, m, by_x, seam, beyond, here)
        if not by_y:
            out[J + 1, 1:-1] = here[1:-1]
            continue
        if start == J:
            between(kx, ky, m - 1, by_x, harmonic, seam, beyond, south)
        between(kx, ky, m + 1, by_x, harmonic, seam, beyond, north)
        for f in range(np.uint32(1), np.uint32(n + 1)):
            out[J + 1, f] = 0.5 * (((1.0 - south[1, f]) * south[0, f] + here[f]) + north[1, f] * north[0, f])
        south, north = north, south


@piece
def in_line(kx: Array, m: int, by_x: bool, seam: bool, beyond: bool, out: Array) -> None:
    """The x faces of row m, each two of them in series where points are left out, at a seam three."""
    n = out.size - 2
    if not by_x:
        for f in range(np.uint32(1), np.uint32(n + 1)):
            out[f] = max(kx[m, f], 0.0)
        return
    for f in range(np.uint32(1), np.uint32(n + 1 - beyond)):
        out[f] = series(kx[m, 2 * f - 1], kx[m, 2 * f])
    if beyond:
        out[n] = max(kx[m, 2 * n - 1], 0.0)
    if seam:
        out[1] = series(kx[m, 2 * n - 1], out[1])
        out[n] = out[1]


@piece
def between(kx: Array, ky: Array, m: int, by_x: bool, harmonic: bool, seam: bool, beyond: bool, out: Array) -> None:
    """The same of a row between two coarse lines, and at each face the weight of the southern one."""
    in_line(kx, m, by_x, seam, beyond, out[0])
    n, step = out.shape[1] - 2, 2 if by_x else 1
    for f in range(np.uint32(1), np.uint32(n)):
        i = step * f - (step - 1)
        out[1, f] = share(ky[m, i], ky[m + 1, i], harmonic)
    i = min(step * n - (step - 1), ky.shape[1] - 2)
    out[1, n] = share(ky[m, i], ky[m + 1, i], harmonic)


@kernel
def coarsen_y_faces(
    kx: Array, ky: Array, out: Array, y0: int, by_x: bool, by_y: bool, harmonic: bool, seam: bool, beyond: bool,
    start: int, end: int,
) -> None:  # fmt: skip
    """The same for y faces; where lines are coarsened they are halved, as every row is a balance per unit width."""
    n_faces, n_columns = out.shape[0] - 2, out.shape[1] - 2
    # Row of the even line under the first coarse face; the face south of row m is ky[m].
    shift = (0 if y0 % 2 == 1 else 1) if by_y else 1
    fine, w, coarse = np.zeros(ky.shape[1]), np.zeros(n_columns + 1), np.zeros(n_columns + 2)
    for f in range(start + 1, end + 1):
        m = shift + (2 * f - 2 if by_y else f - 1)
        if by_y and not (beyond and f == n_faces):
            for i in range(np.uint32(fine.size)):
                fine[i] = series(ky[m, i], ky[m + 1, i])
        else:
            for i in range(np.uint32(fine.size)):
                fine[i] = max(ky[m, i], 0.0)
        if by_x:
            west_shares(kx, min(m, kx.shape[0] - 2), harmonic, seam, w)
        restrict_row(fine, w, by_x, seam, coarse)  # else the frame has what is beyond
        for k in range(np.uint32(1), np.uint32(n_columns + 1)):
            out[f, k] = 0.5 * coarse[k] if by_y else coarse[k]
