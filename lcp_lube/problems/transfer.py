"""Bilinear interpolation of a field from one grid of a rectangle to another one, on any number of ranks."""

import numpy as np
from petsc4py import PETSc

from ..parallel import Array
from .grid import Grid
from .reynolds import csr


class Transfer:
    """Interpolates fields of `coarse` to the points of `fine`, two grids of the same sides.

    Points between the boundary and the first coarse point take that point's value: for a field whose sign tells full film
    from cavity, what happens at the boundary is the nearest cell's affair.

    Parameters
    ----------
    nearest : take the nearest coarse point's value instead (for fields with jumps).
    """

    def __init__(self, coarse: Grid, fine: Grid, nearest: bool = False):
        self._rows = fine.local_size
        i0, wx = _weights(np.arange(fine.x_start, fine.x_end), coarse.shape[0], fine.shape[0], nearest)
        if fine.dim == 2:
            j0, wy = _weights(np.arange(fine.y_start, fine.y_end), coarse.shape[1], fine.shape[1], nearest)
        else:
            j0, wy = np.zeros(1, dtype=np.int64), np.zeros(1)
        nx, ny = coarse.shape[0], coarse.shape[1] if coarse.dim == 2 else 1
        rows = fine.first + np.arange(fine.local_size)
        parts = []
        for dj, y_weight in ((0, 1.0 - wy), (1, wy)):
            for di, x_weight in ((0, 1.0 - wx), (1, wx)):
                weight = (y_weight[:, None] * x_weight[None, :]).ravel()
                column = (np.minimum(j0 + dj, ny - 1)[:, None] * nx + np.minimum(i0 + di, nx - 1)[None, :]).ravel()
                used = weight > 0
                parts.append((rows[used], column[used], weight[used]))
        row, column, value = (np.concatenate(part) for part in zip(*parts, strict=True))
        column = coarse.dm.getAO().app2petsc(column.astype(PETSc.IntType))
        pointers, columns, order = csr(row, column, fine.first, fine.local_size)
        sizes = ((fine.local_size, fine.size), (coarse.local_size, coarse.size))
        self._mat = PETSc.Mat().createAIJ(sizes, csr=(pointers, columns, value[order]), comm=fine.dm.comm)
        self._x, self._y = self._mat.createVecs()

    def __call__(self, field: Array) -> Array:
        """The field on the fine grid. Collective."""
        self._x.setArray(field)
        self._mat.mult(self._x, self._y)
        return self._y.array_r.copy()

    def destroy(self) -> None:
        for obj in (self._mat, self._x, self._y):
            obj.destroy()


def _weights(fine: np.ndarray, n_coarse: int, n_fine: int, nearest: bool) -> tuple[np.ndarray, Array]:
    """Index of the coarse point to the left of each fine point, and the weight of the one to its right."""
    position = (fine + 1.0) * (n_coarse + 1.0) / (n_fine + 1.0) - 1.0
    position = np.clip(position, 0.0, n_coarse - 1.0)
    if nearest:
        position = np.rint(position)
    left = np.minimum(np.floor(position).astype(np.int64), max(n_coarse - 2, 0))
    return left, position - left
