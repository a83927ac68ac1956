"""Conductances of the next coarser grid; arrays as in `kernels`."""

from ...base.compiled import kernel, piece
from ...base.parallel import Array
from .transfer import share


@piece
def series(a: float, b: float) -> float:
    """Conductance of two faces one behind the other; one that lies in a supply, -1, resists nothing (`held.marked`)."""
    if a < 0.0 or b < 0.0:
        return max(a, b, 0.0)
    return a * b / (a + b) if a + b > 0.0 else 0.0


@kernel
def coarsen_x_faces(
    kx: Array, ky: Array, out: Array, y0: int, by_x: bool, by_y: bool, harmonic: bool, beyond: bool, start: int, end: int
) -> None:
    """Of rows start + 1 to end the coarse x faces' conductances: in series along x, added up across by restriction's weights.

    beyond: the last coarse point is the last fine one, and only one fine face lies between it and the side.
    """
    n_faces = out.shape[1] - 2
    shift = (1 - y0 % 2 if by_y else 0) + 1
    for J in range(start, end):
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
def coarsen_y_faces(
    kx: Array, ky: Array, out: Array, y0: int, by_x: bool, by_y: bool, harmonic: bool, beyond: bool, start: int, end: int
) -> None:
    """The same for y faces; where lines are coarsened they are halved, as every row is a balance per unit width."""
    n_faces, n_columns = out.shape[0] - 2, out.shape[1] - 2
    # Row of the even line under the first coarse face; the face south of row m is ky[m].
    shift = (0 if y0 % 2 == 1 else 1) if by_y else 1
    for f in range(start + 1, end + 1):
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
