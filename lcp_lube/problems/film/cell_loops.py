"""Cells and faces of large films one by one, where arrays take several times as long; compiled when this is imported."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

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
def misfit_at(
    p: Array, r: Array, k_W: Array, k_E: Array, k_S: Array, k_N: Array, b_C: Array, b_W: Array, c: Array,
    p_max: float, above: float, j: int, i: int,
) -> Any:  # fmt: skip
    """`certify.cell_misfit` of a cell; p and r have a frame of neighbours."""
    return misfit(
        choose, p[j + 1, i + 1], p[j + 1, i], p[j + 1, i + 2], p[j, i + 1], p[j + 2, i + 1], r[j + 1, i + 1],
        r[j + 1, i], k_W[j, i], k_E[j, i], k_S[j, i], k_N[j, i], b_C[j, i], b_W[j, i], c[j, i], p_max, above,
    )  # fmt: skip


@kernel
def loop_misfits(
    p: Array,
    r: Array,
    k_W: Array,
    k_E: Array,
    k_S: Array,
    k_N: Array,
    b_C: Array,
    b_W: Array,
    c: Array,
    held: NDArray[np.bool_],
    p_max: float,
    above: float,
) -> tuple[Array, Array]:
    """`certify.cell_misfits` of cells that are not held."""
    ny, nx = c.shape
    sums, most, here = np.zeros((6, nx)), np.zeros((2, nx)), np.zeros((2, nx))  # column by column: vector instructions
    for j in range(ny):  # a loop over sums and one over extremes: of both at once the compiler makes no vector instructions
        for i in range(nx):
            found = misfit_at(p, r, k_W, k_E, k_S, k_N, b_C, b_W, c, p_max, above, j, i)
            for n in range(5):
                sums[n, i] += found[n] * found[n]
            sums[5, i] += found[5]
        for i in range(nx):
            found = misfit_at(p, r, k_W, k_E, k_S, k_N, b_C, b_W, c, p_max, above, j, i)
            here[0, i], here[1, i] = found[6], found[7]
        for n in range(2):
            for i in range(nx):
                most[n, i] = here[n, i] if here[n, i] > most[n, i] or here[n, i] != here[n, i] else most[n, i]
    return sums.sum(axis=1), np.array([most[0].max(), most[1].max()])


@kernel
def loop_drag(
    h: Array,
    resting: Array,
    moving: Array,
    first: Array,
    couette: Array,
    b: Array,
    r: Array,
    p: Array,
    beyond: Array,
    columns: Array,
    lines: Array,
    scale: Array,
) -> float:
    """Sum of `flows.face_drag` by its shares (`flows._shares`); beyond : pressures east of the last points."""
    ny, nx = p.shape
    total = np.zeros(nx)
    for j in range(ny):
        for i in range(nx - 1):
            east, push = face(
                choose, lengths, h[j, i], resting[j, i], moving[j, i], first[j, i],
                couette[j, i], b[j, i], r[j, i], p[j, i], p[j, i + 1],
            )  # fmt: skip
            total[i] += lines[j] * columns[i] * east + scale[j] * push
        i = nx - 1
        east, push = face(
            choose, lengths, h[j, i], resting[j, i], moving[j, i], first[j, i],
            couette[j, i], b[j, i], r[j, i], p[j, i], beyond[j],
        )  # fmt: skip
        total[i] += lines[j] * columns[i] * east + scale[j] * push
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
