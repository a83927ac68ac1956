"""Grids: coordinates, ghost values and the numbers of neighbours, on one rank and on several."""

import numpy as np
import pytest

from lcp_lube.errors import InputError
from lcp_lube.problems.grid import Grid


def test_points_of_a_line():
    grid = Grid((4,), (0.5,))
    np.testing.assert_allclose(grid.x, [[0.1, 0.2, 0.3, 0.4]], rtol=1e-15)
    assert grid.y.shape == (1, 1) and grid.box == (1, 4)
    assert (grid.size, grid.local_size, grid.first, grid.cell) == (4, 4, 0, pytest.approx(0.1))
    grid.destroy()


def test_points_of_a_rectangle():
    grid = Grid((3, 4), (1.0, 2.0), origin=(10.0, -1.0))
    np.testing.assert_allclose(grid.x, [[10.25, 10.5, 10.75]], rtol=1e-15)
    np.testing.assert_allclose(grid.y, [[-0.6], [-0.2], [0.2], [0.6]], rtol=1e-14)
    assert grid.box == (4, 3) and grid.size == 12 and grid.cell == pytest.approx(0.25 * 0.4)
    grid.destroy()


@pytest.mark.parametrize("shape", [(1,), (5,), (1, 1), (3, 2), (2, 5)])
def test_ghosts_outside_the_domain(shape):
    grid = Grid(shape, (1.0,) * len(shape))
    values = np.arange(grid.size, dtype=float)
    frame, number = grid.ghosted(values), grid.neighbours()
    inside = np.zeros(frame.shape, dtype=bool)
    inside[1:-1, 1:-1] = True
    np.testing.assert_array_equal(frame[inside], values)
    np.testing.assert_array_equal(number[inside], values)
    assert np.isnan(frame[~inside]).all() and (number[~inside] == -1).all()
    grid.destroy()


@pytest.mark.parametrize(
    "shape, message",
    [
        ((0,), "grid 0: at least 1 interior point a side is needed"),
        ((3, -1), "grid 3x-1: at least 1 interior point a side is needed"),
        ((2_000_000_000, 2_000_000_000), "numbers at most"),
        ((1_000_000_000,), "GB a rank, this machine has"),
    ],
)
def test_refused(shape, message):
    with pytest.raises(InputError, match=message):
        Grid(shape, (1.0,) * len(shape))


@pytest.mark.parametrize("ranks", [2, 3])
def test_on_several_ranks(mpi_job, ranks):
    """Every rank checks its coordinates, ghosts and neighbours against the natural numbering (tests/mpi_job.py)."""
    assert mpi_job(ranks)["grid_faults"] == []
