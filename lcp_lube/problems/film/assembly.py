"""Stencils of the box scheme as PETSc matrices, and their structure."""

import numpy as np
from petsc4py import PETSc

from ...base.parallel import Array
from ..grid import Grid


def assemble(grid: Grid, entries: list[tuple[int, int, Array]]) -> PETSc.Mat:
    """A distributed n-by-n AIJ matrix from stencil entries."""
    number = grid.neighbours().astype(PETSc.IntType)
    ny, nx = grid.box
    # Columns ascend with (dj, di) inside a rank; only at its edges do they have to be sorted.
    ordered = sorted(entries, key=lambda entry: entry[:2])
    columns = np.stack([number[1 + dj : 1 + dj + ny, 1 + di : 1 + di + nx] for dj, di, _ in ordered], axis=-1)
    values = np.stack([np.broadcast_to(values, grid.box) for *_, values in ordered], axis=-1)
    if grid.comm.size > 1 or any(grid.periodic):
        order = np.argsort(columns, axis=-1)
        columns, values = np.take_along_axis(columns, order, axis=-1), np.take_along_axis(values, order, axis=-1)
    inside = columns >= 0
    pointers = np.zeros(ny * nx + 1, dtype=PETSc.IntType)
    np.cumsum(inside.sum(axis=-1).ravel(), out=pointers[1:])
    size = (grid.local_size, grid.size)
    return PETSc.Mat().createAIJWithArrays((size, size), (pointers, columns[inside], values[inside]), comm=grid.petsc_comm)
