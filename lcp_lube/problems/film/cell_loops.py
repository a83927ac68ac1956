"""Cells and faces of large films one by one, where arrays take several times as long; compiled when this is imported."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.compiled import kernel, piece
from ...base.parallel import Array
from .certify import cell_misfit
from .face_lines import Rows
from .flows import face_drag, linear

Mask = NDArray[np.bool_]


@piece
def choose(condition: Any, a: Any, b: Any) -> Any:
    """`numpy.where` of numbers."""
    return a if condition else b


misfit, face, lengths = piece(cell_misfit), piece(face_drag), piece(linear)


@piece
def carried(voids: tuple[Array, int, Array, Array], j: int, out: Array) -> None:
    """b_C or b_W of a line, `strip.by_lines`, but for the column that is its own."""
    array, shift, lines, _ = voids
    m = min(j, len(array) - 1)
    for i in range(np.uint32(out.size)):
        out[i] = lines[j] * array[m, i + np.uint32(shift)]


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
    moving, first, couette : of each line, or one that is all lines'. leaving : b_E, as `strip.by_lines` has b_C. beyond :
    pressures east of the last points. turn : 1 where that is the first point, else 0."""
    ny, nx = p.shape
    total, b = np.zeros(nx), np.zeros(nx)
    for j in range(ny):
        m, n, k = min(j, len(h) - 1), min(j, len(resting) - 1), min(j, len(couette) - 1)
        carried(leaving, j, b)
        b[-1] = leaving[3][j]
        for i in range(nx - 1):
            east, push, thick = face(
                choose, lengths, h[m, i], resting[n, i], moving[m, i], first[m, i],
                couette[k, i], b[i], r[j, i], p[j, i], p[j, i + 1],
            )  # fmt: skip
            total[i] += lines[j] * columns[i] * east + scale[j] * push
            if by_r is not None:
                by_r[j, i] = lines[j] * columns[i] * b[i] / (choose(couette[k, i] == 0.0, np.inf, couette[k, i]) * thick)
        i = nx - 1
        east, push, thick = face(
            choose, lengths, h[m, i], resting[n, i], moving[m, i], first[m, i],
            couette[k, i], b[i], r[j, i], p[j, i], beyond[j],
        )  # fmt: skip
        total[i] += lines[j] * columns[i] * east + scale[j] * push
        if by_p is not None and by_r is not None:
            by_r[j, i] = lines[j] * columns[i] * b[i] / (choose(couette[k, i] == 0.0, np.inf, couette[k, i]) * thick)
            by_p[j, 0] = 0.5 * scale[j] * (turn * h[m, i] - h[m, 0])
            for i in range(1, nx):
                by_p[j, i] = 0.5 * scale[j] * (h[m, i - 1] - h[m, i])
    return total.sum()


@kernel
def loop_by_film(
    w: Array, p: Array, r: Array, along: Array, of: Rows, lines: Array, across: Array, over: Rows, faces: Array, out: Array
) -> None:
    """Add to `out` what the sum of w times the cells' balances changes by with the film at each point.

    w, p, r : with a frame of neighbours. along : of lines that differ by what their points' films change what the west and the
    east face conduct, what they drag and what of it the void lacks, shape (lines, 6, columns); of, lines : which of them each
    line is like, and by what it multiplies the first two and the others. across, over, faces : the same of y faces; faces : by
    what they multiply it for the line to the north, and for the one to the south.
    """
    one, two = np.uint32(1), np.uint32(2)
    ny, nx = out.shape
    for j in range(ny):
        a, k, by_x, by_wall, by_south, by_north = j + 1, of[j], lines[0, j], lines[1, j], faces[0, j], faces[1, j + 1]
        south, north = over[j], over[j + 1]
        for i in range(np.uint32(nx)):
            west, east = w[a, i] - w[a, i + one], w[a, i + one] - w[a, i + two]
            pressed = west * along[k, 0, i] * (p[a, i] - p[a, i + one]) + east * along[k, 1, i] * (
                p[a, i + one] - p[a, i + two]
            )
            dragged = west * (along[k, 2, i] - along[k, 4, i] * r[a, i]) + east * (
                along[k, 3, i] - along[k, 5, i] * r[a, i + one]
            )
            beside = by_south * (w[j, i + one] - w[a, i + one]) * across[south, i] * (p[j, i + one] - p[a, i + one])
            beside += by_north * (w[a, i + one] - w[j + 2, i + one]) * across[north, i] * (p[a, i + one] - p[j + 2, i + one])
            out[j, i] += by_x * pressed + by_wall * dragged + beside


@kernel
def loop_drag_by_film(p: Array, r: Array, along: Array, of: Rows, lines: Array, out: Array) -> None:
    """The same of the drag. along : by what its points' films change what pulls at the west and the east face, what shears
    them, and how much less goes with the void before them, r; lines : by what pulls and shears count."""
    one, two = np.uint32(1), np.uint32(2)
    ny, nx = out.shape
    for j in range(ny):
        a, k, pulls, shears = j + 1, of[j], lines[0, j], lines[1, j]
        for i in range(np.uint32(nx)):
            pull = along[k, 0, i] * (p[a, i + one] - p[a, i]) + along[k, 1, i] * (p[a, i + two] - p[a, i + one])
            sheared = along[k, 2, i] + along[k, 3, i] - along[k, 4, i] * r[j, i] - along[k, 5, i] * r[j, i + one]
            out[j, i] += pulls * pull + shears * sheared


@kernel
def loop_by_faces(
    w: Array, first: int, p: Array, r: Array, along: Array, across: Array, wall: Array, void: Array | None
) -> None:
    """Into the arrays of x faces, of y faces and again of x faces what w' G grows by with what each face conducts and drags.

    w : of all lines, those beside the owned points 0. p, r : of lines from `first` on, with a frame of neighbours. wall, void :
    of what drags oil, and less of the void with it; None: of both together.
    """
    one, ny, (lines, nx) = np.uint32(1), p.shape[0] - 2, w.shape
    dw = np.zeros(nx + 1)
    for j in range(ny):
        a, m = j + 1, first + j
        dw[0], dw[nx] = -w[m, 0], w[m, nx - 1]
        for i in range(np.uint32(nx - 1)):
            dw[i + one] = w[m, i] - w[m, i + one]
        for i in range(np.uint32(nx + 1)):
            along[j, i] = dw[i] * (p[a, i] - p[a, i + one])
            if void is None:
                wall[j, i] = dw[i] * (1.0 - r[a, i])
            else:
                wall[j, i] = dw[i]
                void[j, i] = -dw[i] * r[a, i]
        for i in range(np.uint32(nx)):
            across[j, i] = ((w[m - 1, i] if m > 0 else 0.0) - w[m, i]) * (p[j, i + one] - p[a, i + one])
        for i in range(np.uint32(nx if m == lines - 1 else 0)):
            across[a, i] = w[m, i] * (p[a, i + one] - p[a + 1, i + one])


@kernel
def loop_states(p: Array, r: Array, p_max: float, void: float, empty: float, cavity: Mask, switching: Mask) -> None:
    """`cavity.states` of points, with its bounds."""
    unit = p_max if p_max > 0.0 else 1.0
    for i in range(np.uint64(p.size)):
        cavity[i] = (r[i] > void) & ((p[i] / unit < r[i]) | (r[i] > empty))
        switching[i] = (abs(p[i]) <= void * p_max) & (abs(r[i]) <= void)
