"""Rows of the full film's Schur complement, written straight into CSR arrays: one pass to count, one to fill."""

import numpy as np
from numpy.typing import NDArray

from ..base.compiled import compiled
from ..base.parallel import Array
from ..problems.film.reynolds import BoxScheme


def schur_rows(scheme: BoxScheme, numbers: NDArray[np.int64], index: type) -> tuple[NDArray, NDArray, Array]:
    """Row pointers, columns (sorted in each row) and values.

    Parameters
    ----------
    numbers : global number of every full cell, -1 for cavitated ones and outside the domain; shape of the owned cells with a
        frame of neighbours. Numbers grow along x, then y.
    index : integer type of pointers and columns.
    """
    s = scheme
    ny, nx = s.c.shape
    rows = int(np.count_nonzero(numbers[1:-1, 1:-1] >= 0))
    pointers: NDArray = np.zeros(rows + 1, dtype=index)
    compiled(_count)(numbers, ny, nx, pointers)
    np.cumsum(pointers, out=pointers)
    columns: NDArray = np.empty(pointers[-1], dtype=index)
    values = np.empty(pointers[-1])
    compiled(_fill)(numbers, ny, nx, s.k_W, s.k_E, s.k_S, s.k_N, pointers, columns, values)
    return pointers, columns, values


def _count(numbers: NDArray, ny: int, nx: int, pointers: NDArray) -> None:
    """Entries of row k into pointers[k + 1]."""
    row = 0
    for j in range(1, ny + 1):
        start = 1  # where the cavitated run upstream of the cell begins, or the cell itself
        for i in range(1, nx + 1):
            if numbers[j, i] >= 0:
                entries = 1 + (numbers[j, start - 1] >= 0) + (numbers[j, i + 1] >= 0)
                for k in range(start, i + 1):
                    entries += (numbers[j - 1, k] >= 0) + (numbers[j + 1, k] >= 0)
                row += 1
                pointers[row] = entries
                start = i + 1


def _fill(
    numbers: NDArray,
    ny: int,
    nx: int,
    k_W: Array,
    k_E: Array,
    k_S: Array,
    k_N: Array,
    pointers: NDArray,
    columns: NDArray,
    values: Array,
) -> None:
    """Row by row: south of the run and of the cell, west, the cell itself, east, north."""
    at = 0
    for j in range(1, ny + 1):
        start = 1
        for i in range(1, nx + 1):
            if numbers[j, i] >= 0:
                for k in range(start, i + 1):
                    if numbers[j - 1, k] >= 0:
                        columns[at] = numbers[j - 1, k]
                        values[at] = -k_S[j - 1, k - 1]
                        at += 1
                if numbers[j, start - 1] >= 0:
                    columns[at] = numbers[j, start - 1]
                    values[at] = -k_W[j - 1, start - 1]
                    at += 1
                columns[at] = numbers[j, i]
                values[at] = k_W[j - 1, i - 1] + k_E[j - 1, i - 1] + k_S[j - 1, i - 1] + k_N[j - 1, i - 1]
                if start < i:  # what the run's last cell gives to this one
                    values[at] -= k_E[j - 1, i - 2]
                at += 1
                if numbers[j, i + 1] >= 0:
                    columns[at] = numbers[j, i + 1]
                    values[at] = -k_E[j - 1, i - 1]
                    at += 1
                for k in range(start, i + 1):
                    if numbers[j + 1, k] >= 0:
                        columns[at] = numbers[j + 1, k]
                        values[at] = -k_N[j - 1, k - 1]
                        at += 1
                start = i + 1
