"""Cells and faces of large films one by one, where arrays take several times as long; compiled when this is imported."""

from typing import Any

import numpy as np

from ...base.compiled import kernel, piece
from ...base.parallel import Array
from .certify import cell_misfit
from .flows import face_drag, linear


@piece
def choose(condition: Any, a: Any, b: Any) -> Any:
    """`numpy.where` of numbers."""
    return a if condition else b


misfit, face, lengths = piece(cell_misfit), piece(face_drag), piece(linear)


@piece
def carried(voids: tuple[Array, int, Array, Array], j: int, out: Array) -> None:
    """b_C or b_W of a line, `strip.by_lines`, but for the column that is its own."""
    array, shift, lines, _ = voids
    for i in range(np.uint32(out.size)):
        out[i] = lines[j] * array[j, i + np.uint32(shift)]


@piece
def misfit_at(
    p: Array, r: Array, kx: Array, ky: Array, b_C: Array, b_W: Array, c: Array,
    p_max: float, above: float, j: int, m: int, i: int,
) -> Any:  # fmt: skip
    """`certify.cell_misfit` of a cell; p, r, kx, ky and c have frames, b_C and b_W are the line's."""
    return misfit(
        choose, p[j + 1, i + 1], p[j + 1, i], p[j + 1, i + 2], p[j, i + 1], p[j + 2, i + 1], r[j + 1, i + 1], r[j + 1, i],
        kx[m, i + 1], kx[m, i + 2], ky[m, i + 1], ky[m + 1, i + 1], b_C[i], b_W[i], c[m, i + 1], p_max, above,
    )  # fmt: skip


@kernel
def loop_misfits(
    p: Array,
    r: Array,
    kx: Array,
    ky: Array,
    leaving: tuple[Array, int, Array, Array],
    entering: tuple[Array, int, Array, Array],
    c: Array,
    p_max: float,
    above: float,
    row: int,
    first: int,
    last: int,
) -> tuple[Array, Array, float]:
    """`certify.cell_misfits` of cells that are not held, in columns first to last - 1. kx, ky, c : of all lines, in their
    frames, p, r, b_C and b_W (`strip.by_lines`) of some; row : the first one's."""
    ny, nx, width = p.shape[0] - 2, last - first, p.shape[1] - 2
    sums, most, worst = np.zeros((6, nx)), np.zeros((2, nx)), np.zeros(nx)  # column by column: vector instructions
    b_C, b_W, least = np.zeros(width), np.zeros(width), np.full(width, np.inf)
    for j in range(ny):
        m, apart = row + j + 1, 0
        carried(leaving, j, b_C)
        carried(entering, j, b_W)
        b_C[-1], b_W[0] = leaving[3][j], entering[3][j]
        for i in range(np.uint32(width)):
            least[i] = min(least[i], -b_C[i])
        for i in range(np.uint32(nx)):
            found = misfit_at(p, r, kx, ky, b_C, b_W, c, p_max, above, j, m, i + np.uint32(first))
            for n in range(5):
                sums[n, i] += found[n] * found[n]
            sums[5, i] += found[5]
            worst[i] = found[6]
        for i in range(np.uint32(nx)):
            most[0, i] = worst[i] if worst[i] > most[0, i] or worst[i] != worst[i] else most[0, i]
            apart += min(p[j + 1, i + np.uint32(first + 1)], r[j + 1, i + np.uint32(first + 1)]) != 0.0
        for i in range(np.uint32(nx if apart else 0)):
            gap = misfit_at(p, r, kx, ky, b_C, b_W, c, p_max, above, j, m, i + np.uint32(first))[7]
            most[1, i] = gap if gap > most[1, i] or gap != gap else most[1, i]
    return sums.sum(axis=1), np.array([most[0].max(), most[1].max()]), least.min()


@kernel
def loop_drag(
    h: Array,
    resting: Array,
    moving: Array,
    first: Array,
    couette: Array,
    leaving: tuple[Array, int, Array, Array],
    r: Array,
    p: Array,
    beyond: Array,
    columns: Array,
    lines: Array,
    scale: Array,
    by_p: Array | None,
    by_r: Array | None,
    turn: float,
) -> float:
    """Sum of `flows.face_drag` by its shares (`flows._shares`), and into by_p and by_r its derivatives. h, resting,
    moving, first : of each line, or one that is all lines'. leaving : b_E, as `strip.by_lines` has b_C. beyond : pressures east
    of the last points. turn : 1 where that is the first point, else 0."""
    ny, nx = p.shape
    total, b = np.zeros(nx), np.zeros(nx)
    for j in range(ny):
        m, n = min(j, len(h) - 1), min(j, len(resting) - 1)
        carried(leaving, j, b)
        b[-1] = leaving[3][j]
        for i in range(nx - 1):
            east, push, thick = face(
                choose, lengths, h[m, i], resting[n, i], moving[m, i], first[m, i],
                couette[j, i], b[i], r[j, i], p[j, i], p[j, i + 1],
            )  # fmt: skip
            total[i] += lines[j] * columns[i] * east + scale[j] * push
            if by_r is not None:
                by_r[j, i] = lines[j] * columns[i] * b[i] / (choose(couette[j, i] == 0.0, np.inf, couette[j, i]) * thick)
        i = nx - 1
        east, push, thick = face(
            choose, lengths, h[m, i], resting[n, i], moving[m, i], first[m, i],
            couette[j, i], b[i], r[j, i], p[j, i], beyond[j],
        )  # fmt: skip
        total[i] += lines[j] * columns[i] * east + scale[j] * push
        if by_p is not None and by_r is not None:
            by_r[j, i] = lines[j] * columns[i] * b[i] / (choose(couette[j, i] == 0.0, np.inf, couette[j, i]) * thick)
            by_p[j, 0] = 0.5 * scale[j] * (turn * h[m, i] - h[m, 0])
            for i in range(1, nx):
                by_p[j, i] = 0.5 * scale[j] * (h[m, i - 1] - h[m, i])
    return total.sum()


@kernel
def loop_by_film(
    w: Array, p: Array, r: Array, k_x: Array, k_y: Array, wall: Array, void: Array,
    along: Array, across: Array, of_wall: Array, of_void: Array, out: Array,
) -> None:  # fmt: skip
    """Into `out` what the sum of w times the cells' balances changes by with the film at each point, by its parts of the faces.

    w, p, r : with a frame of neighbours. k_x, k_y, wall, void : derivatives by the film at the faces. along, of_wall, of_void :
    parts of a column's west and east face that are the point's, shape (2, columns); across : of a line's south and north face.
    """
    ny, nx = out.shape
    for j in range(ny):
        for i in range(nx):
            a, b = w[j + 1, i + 1], p[j + 1, i + 1]
            west, east = w[j + 1, i] - a, a - w[j + 1, i + 2]
            pressed = along[0, i] * west * k_x[j, i] * (p[j + 1, i] - b)
            pressed += along[1, i] * east * k_x[j, i + 1] * (b - p[j + 1, i + 2])
            pressed += across[0, j] * (w[j, i + 1] - a) * k_y[j, i] * (p[j, i + 1] - b)
            pressed += across[1, j] * (a - w[j + 2, i + 1]) * k_y[j + 1, i] * (b - p[j + 2, i + 1])
            dragged = of_wall[0, i] * west * wall[j, i] + of_wall[1, i] * east * wall[j, i + 1]
            carried = of_void[0, i] * west * void[j, i] * r[j + 1, i] + of_void[1, i] * east * void[j, i + 1] * r[j + 1, i + 1]
            out[j, i] = pressed + (dragged - carried)


@kernel
def loop_cubes(h: Array, columns: Array, lines: Array) -> Array:
    """3 h^2 times what belongs to each column and line."""
    out = np.empty_like(h)
    for j in range(h.shape[0]):
        for i in range(h.shape[1]):
            out[j, i] = (columns[i] * lines[j]) * (3.0 * h[j, i] ** 2)
    return out


@kernel
def loop_by_faces(
    w: Array, p: Array, r: Array, along: Array, across: Array, wall: Array, void: Array,
) -> None:  # fmt: skip
    """Add to the arrays of x faces, of y faces and again of x faces what w' G grows by with what each face conducts and drags.

    w : of some lines of cells. p, r : with a frame of neighbours. wall, void : of what drags oil, and less of the void with it.
    """
    ny, nx = w.shape
    for j in range(ny):
        for i in range(nx):
            a, here = w[j, i], p[j + 1, i + 1]
            along[j, i + 1] += a * (here - p[j + 1, i + 2])
            across[j, i] -= a * (p[j, i + 1] - here)
            across[j + 1, i] += a * (here - p[j + 2, i + 1])
            wall[j, i + 1] += a
            void[j, i + 1] -= a * r[j + 1, i + 1]
        for i in range(nx):
            a = w[j, i]
            along[j, i] -= a * (p[j + 1, i] - p[j + 1, i + 1])
            wall[j, i] -= a
            void[j, i] += a * r[j + 1, i]
