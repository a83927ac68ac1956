"""Stencils of the box scheme as PETSc matrices, and their structure."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from ...base.parallel import Array
from ..grid import Grid

Entry = tuple[int, int, Array]  # line and column from the row's point, and values for all rows


def assemble(grid: Grid, entries: Sequence[Entry]) -> PETSc.Mat:
    """A distributed n-by-n AIJ matrix from stencil entries."""
    return matrix(grid, *csr(grid, entries))


def matrix(grid: Grid, pointers: NDArray, columns: NDArray, values: NDArray) -> PETSc.Mat:
    """The same from its arrays (`csr`)."""
    size = (grid.local_size, grid.size)
    return PETSc.Mat().createAIJWithArrays((size, size), (pointers, columns, values), comm=grid.petsc_comm)


def csr(grid: Grid, entries: Sequence[Entry], *more: Sequence[NDArray]) -> tuple[NDArray, ...]:
    """Row pointers, columns and values of stencil entries in CSR order, and values of more stencils on the same places."""
    number = grid.neighbours().astype(PETSc.IntType)
    ny, nx = grid.box
    # Columns ascend with (dj, di) inside a rank; only at its edges do they have to be sorted.
    ordered = sorted(range(len(entries)), key=lambda k: entries[k][:2])
    places = [entries[k][:2] for k in ordered]
    columns = np.stack([number[1 + dj : 1 + dj + ny, 1 + di : 1 + di + nx] for dj, di in places], axis=-1)
    stencils = ([entry[2] for entry in entries], *more)
    values = [np.empty(columns.shape, dtype=np.result_type(*one)) for one in stencils]
    for one, into in zip(stencils, values, strict=True):
        for n, k in enumerate(ordered):
            into[..., n] = one[k]
    if grid.comm.size > 1 or any(grid.periodic):
        order = np.argsort(columns, axis=-1)
        columns, *values = (np.take_along_axis(a, order, axis=-1) for a in (columns, *values))
    inside = columns >= 0
    pointers = np.zeros(ny * nx + 1, dtype=PETSc.IntType)
    np.cumsum(inside.sum(axis=-1).ravel(), out=pointers[1:])
    return pointers, columns[inside], *(a[inside] for a in values)
