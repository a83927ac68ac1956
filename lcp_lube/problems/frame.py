"""A grid's points together with those of its boundary, for fields from side to side."""

import numpy as np
from petsc4py import PETSc

from ..base.parallel import Array
from .grid import Grid


class Frame:
    """The points of a grid and of its sides: nx + 2 in x, ny + 2 in y, the corners among them.

    shape, box, x_start ... y_end, dim and comm mean what they mean for a Grid: this rank's part of the whole.

    Parameters
    ----------
    grid : whose sides are open, closed or periodic.
    """

    def __init__(self, grid: Grid):
        self.grid, self.comm, self.dim = grid, grid.comm, grid.dim
        self.shape = tuple(n + 2 for n in grid.shape)
        self.x_start, self.x_end = _with_sides(grid.x_start, grid.x_end, grid.shape[0])
        self.y_start, self.y_end = _with_sides(grid.y_start, grid.y_end, grid.shape[1]) if grid.dim == 2 else (0, 1)
        self.box = (self.y_end - self.y_start, self.x_end - self.x_start)

    @property
    def lines(self) -> tuple[Array, ...]:
        """Coordinates x, and y in 2D, of all points, side to side, m."""
        ends = zip(self.grid.origin, self.grid.lengths, self.grid.lines, strict=False)
        return tuple(np.concatenate([[start], line, [start + length]]) for start, length, line in ends)

    @property
    def x(self) -> Array:
        """Owned x coordinates in metres, shape (1, nx_local)."""
        return self.lines[0][None, self.x_start : self.x_end]

    @property
    def y(self) -> Array:
        """Owned y coordinates in metres, shape (ny_local, 1); 0 in 1D."""
        return self.lines[1][self.y_start : self.y_end, None] if self.dim == 2 else np.zeros((1, 1))

    def fill(self, values: Array, known: Array) -> Array:
        """A field at the owned points and sides, shape `box`. Collective.

        Parameters
        ----------
        values : at the grid's owned points.
        known : values at the sides, shape `box`, NaN where they are not known: there the nearest point's value goes on (at a
            periodic side the mean of the two nearest).
        """
        grid, periodic = self.grid, (*self.grid.periodic, False)
        out = grid.ghosted(values)
        inner = out[1:-1, 1:-1]
        for k, (edge, near) in enumerate(((out[0], inner[0]), (out[-1], inner[-1]))):
            edge[1:-1] = 0.5 * (edge[1:-1] + near) if periodic[1] else near
            outer, last = (out[:, 0], out[:, 1]) if k == 0 else (out[:, -1], out[:, -2])
            outer[1:-1] = 0.5 * (outer[1:-1] + last[1:-1]) if periodic[0] else last[1:-1]
        out[[0, 0, -1, -1], [0, -1, 0, -1]] = out[[0, 0, -1, -1], [1, -2, 1, -2]]  # corners
        row, column = int(self.dim == 2 and self.y_start == 0), int(self.x_start == 0)  # of the first point that is no side's
        out = out[1 - row : 1 - row + self.box[0], 1 - column : 1 - column + self.box[1]]
        at_side = np.ones(self.box, dtype=bool)
        at_side[row : row + grid.box[0], column : column + grid.box[1]] = False
        return np.where(at_side & ~np.isnan(known), known, out)

    def dm(self) -> PETSc.DMDA:
        """A new DMDA of these points, each rank with its own part."""
        ranges = tuple(np.array(sizes, dtype=PETSc.IntType) for sizes in self.grid.dm.getOwnershipRanges()[: self.dim])
        for sizes in ranges:
            sizes[0] += 1
            sizes[-1] += 1
        return PETSc.DMDA().create(
            dim=self.dim,
            sizes=self.shape,
            proc_sizes=self.grid.dm.getProcSizes(),
            ownership_ranges=ranges,
            dof=1,
            stencil_width=1,
            stencil_type=PETSc.DMDA.StencilType.STAR,
            comm=self.grid.petsc_comm,
        )


def _with_sides(start: int, end: int, n: int) -> tuple[int, int]:
    """Owned numbers start to end of n points, counted with a point more at each end of the whole line."""
    return start + (start > 0), end + 1 + (end == n)
