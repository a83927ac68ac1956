"""Cells and faces of large films one by one, where arrays take several times as long; compiled when this is imported."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.compiled import kernel
from ...base.parallel import Array
from .certify import cell_misfit
from .flows import face_drag


@kernel
def choose(condition: Any, a: Any, b: Any) -> Any:
    """`numpy.where` of numbers."""
    return a if condition else b


misfit, face = kernel(cell_misfit), kernel(face_drag)


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
    sums, most = np.zeros((6, nx)), np.zeros((2, nx))  # column by column: vector instructions
    for j in range(ny):
        for i in range(nx):
            a, b, left, own, carried, inside, worst, gap = misfit(
                choose, p[j + 1, i + 1], p[j + 1, i], p[j + 1, i + 2], p[j, i + 1], p[j + 2, i + 1], r[j + 1, i + 1],
                r[j + 1, i], k_W[j, i], k_E[j, i], k_S[j, i], k_N[j, i], b_C[j, i], b_W[j, i], c[j, i], p_max, above,
            )  # fmt: skip
            sums[0, i] += a * a
            sums[1, i] += b * b
            sums[2, i] += left * left
            sums[3, i] += own * own
            sums[4, i] += carried * carried
            sums[5, i] += inside
            most[0, i] = worst if worst > most[0, i] or worst != worst else most[0, i]
            most[1, i] = gap if gap > most[1, i] or gap != gap else most[1, i]
    return sums.sum(axis=1), np.array([most[0].max(), most[1].max()])


@kernel
def loop_drag(
    h: Array,
    resting: Array,
    moving: Array,
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
                choose, h[j, i], resting[j, i], moving[j, i], couette[j, i], b[j, i], r[j, i], p[j, i], p[j, i + 1]
            )
            total[i] += lines[j] * columns[i] * east + scale[j] * push
        i = nx - 1
        east, push = face(choose, h[j, i], resting[j, i], moving[j, i], couette[j, i], b[j, i], r[j, i], p[j, i], beyond[j])
        total[i] += lines[j] * columns[i] * east + scale[j] * push
    return total.sum()
