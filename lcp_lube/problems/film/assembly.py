"""Stencils of the box scheme as PETSc matrices, and their structure."""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from ...base.parallel import Array
from ..grid import Grid


def coo(grid: Grid, entries: Sequence[tuple[int, int, NDArray]]) -> Iterator[tuple[NDArray, NDArray, NDArray]]:
    """Global rows, columns and values of stencil entries; neighbours outside the domain are left out."""
    number = grid.neighbours()
    ny, nx = grid.box
    rows = number[1:-1, 1:-1]
    for dj, di, values in entries:
        columns = number[1 + dj : 1 + dj + ny, 1 + di : 1 + di + nx]
        inside = columns >= 0
        yield rows[inside], columns[inside], np.broadcast_to(values, grid.box)[inside]


def csr(rows: NDArray, columns: NDArray, first: int, count: int) -> tuple[NDArray, NDArray, NDArray]:
    """CSR structure of COO entries in `count` owned rows from `first` on.

    Returns row pointers, columns (sorted in each row), and the order that takes COO values to CSR values.
    """
    order = np.lexsort((columns, rows))
    pointers = np.zeros(count + 1, dtype=PETSc.IntType)
    np.cumsum(np.bincount(rows - first, minlength=count), out=pointers[1:])
    return pointers, columns[order].astype(PETSc.IntType), order


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
