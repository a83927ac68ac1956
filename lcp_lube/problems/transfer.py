"""Bilinear interpolation of a field from one grid of a rectangle to another one, on any number of ranks."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from ..base.owned import Owned
from ..base.parallel import Array
from .grid import Grid

NESTED = 1e-9  # of a coarse spacing: a point so near a coarse one is that one

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix


class Transfer:
    """Interpolates fields of `coarse` to the points of `fine`, two grids of the same sides.

    Points between the boundary and the first coarse point take that point's value: for a field whose sign tells full film
    from cavity, the state at the boundary is that of the nearest cell.

    Parameters
    ----------
    zero_boundary : the field is zero on the boundary: interpolate to that, but at ends through which nothing flows.
    ahead : of rings along x, how far the fine one's x = 0 lies beyond the coarse one's (`film.turning.ahead`), m.

    Attributes
    ----------
    mat : the interpolation as a matrix, for PCMG.
    coarse_meshes : spacings of the coarse grid from side to side.
    """

    def __init__(self, coarse: Grid, fine: Grid, zero_boundary: bool = False, ahead: float = 0.0):
        from scipy.sparse import csr_matrix, kron  # here: a solve on one grid does without its import

        self.coarse_meshes = coarse.meshes
        ranges = ((fine.x_start, fine.x_end), (fine.y_start, fine.y_end))
        weights = csr_matrix([[1.0]])
        for side in range(fine.dim):
            points = np.arange(*ranges[side])
            along = _weights(points, coarse, fine, side, zero_boundary, ahead)
            weights = kron(along, weights, format="csr")
        weights.indices = weights.indices.astype(PETSc.IntType)
        if coarse.comm.size > 1:
            weights.indices = coarse.dm.getAO().app2petsc(weights.indices)
        weights.has_sorted_indices = False
        weights.sort_indices()
        csr = (weights.indptr.astype(PETSc.IntType), weights.indices, weights.data)
        sizes = ((fine.local_size, fine.size), (coarse.local_size, coarse.size))
        self._own = Owned(self, fine.petsc_comm)
        self.mat = self._own(PETSc.Mat().createAIJ(sizes, csr=csr, comm=fine.petsc_comm))
        self._x, self._y = map(self._own, self.mat.createVecs())

    def __call__(self, field: Array) -> Array:
        """The field on the fine grid. Collective."""
        self._x.setArray(field)
        self.mat.mult(self._x, self._y)
        return self._y.array_r.copy()

    def restrict(self, field: Array) -> Array:
        """The transposed map: sums of a fine field with the weights that its points have from each coarse one. Collective."""
        self._y.setArray(field)
        self.mat.multTranspose(self._y, self._x)
        return self._x.array_r.copy()

    def destroy(self) -> None:
        self._own.free()


def interpolated(coarse: Grid, fine: Grid, field: Array, ahead: float = 0.0) -> Array:
    """A field of `coarse` on `fine`; ahead : as in `Transfer`. Collective."""
    if alike(coarse, fine) and not ahead:
        return field.copy()
    if coarse.comm.size == 1:  # no matrix is needed for one field
        values = field.reshape(coarse.box)
        for side, n in enumerate(fine.shape):
            left, right = _between(np.arange(n), coarse, fine, side, ahead)
            before, behind = (np.take(values, _inside(k, coarse, fine, side), axis=1 - side) for k in (left, left + 1))
            part = right if side == 0 else right[:, None]
            values = before + part * (behind - before)
        return values.ravel()
    transfer = Transfer(coarse, fine, ahead=ahead)
    values = transfer(field)
    transfer.destroy()
    return values


def alike(one: Grid, other: Grid) -> bool:
    """Whether two grids have the same points in units of their sides, dealt out alike."""
    return (
        (one.shape, one.ends, one.comm.size) == (other.shape, other.ends, other.comm.size)
        and all(_same_places(*both) for both in zip(one.places, other.places, one.lengths, other.lengths, strict=False))
        and one.starts.tolist() == other.starts.tolist()
    )


def _same_places(a: Array | None, b: Array | None, of: float, other: float) -> bool:
    return a is b if a is None or b is None else of == other and np.array_equal(a, b)


def _weights(points: np.ndarray, coarse: Grid, fine: Grid, side: int, zero_boundary: bool, ahead: float) -> "csr_matrix":
    """Linear interpolation along one side as a matrix, a row for each of the fine points, a column for each coarse one."""
    from scipy.sparse import csr_matrix

    n_coarse = coarse.shape[side]
    left, right = _between(points, coarse, fine, side, ahead)
    rows = np.concatenate([np.arange(points.size)] * 2)
    columns = np.concatenate([left, left + 1])
    values = np.concatenate([1.0 - right, right])
    if zero_boundary:
        last = n_coarse - 1 if fine.ends[side][1] in ("closed", "mirror") else n_coarse
        columns = np.minimum(columns, last)  # beyond a closed end lies the mirror image
        used = (columns >= 0) & (columns < n_coarse) & (values > 0)
    else:
        columns, used = _inside(columns, coarse, fine, side), values > 0
    return csr_matrix((values[used], (rows[used], columns[used])), shape=(points.size, n_coarse))


def _inside(columns: np.ndarray, coarse: Grid, fine: Grid, side: int) -> np.ndarray:
    """Numbers of coarse points beyond the sides as those that are taken in their place."""
    n = coarse.shape[side]
    return columns % n if fine.periodic[side] else np.clip(columns, 0, n - 1)


def _between(points: np.ndarray, coarse: Grid, fine: Grid, side: int, ahead: float) -> tuple[np.ndarray, np.ndarray]:
    """Number of the coarse point before each fine one, and the weight of the one behind."""
    turned = bool(ahead) and side == 0
    if coarse.places[side] is None and fine.places[side] is None and not turned:
        return _even_weights(points, coarse, fine, side)
    around, at = coarse.with_neighbours(side), fine.lines[side][points]
    if turned:
        at = around[0] + (at + ahead - around[0]) % coarse.lengths[0]
    left = np.clip(np.searchsorted(around, at, side="right") - 1, 0, coarse.shape[side])
    right = (at - around[left]) / (around[left + 1] - around[left])
    # `around` begins with what lies before the first point.
    return left - 1, np.where(np.abs(right - np.rint(right)) < NESTED, np.rint(right), right)


def _even_weights(points: np.ndarray, coarse: Grid, fine: Grid, side: int) -> tuple[np.ndarray, np.ndarray]:
    """Number of the coarse point before each fine one, and the weight of the one behind, of evenly spaced lines.

    Fine point i lies left + part / meshes coarse spacings behind the first coarse point: integers (offsets are multiples of
    1/2), so that nested points get one weight, 1.
    """
    offset, offset_coarse, meshes, meshes_coarse = (
        round(2 * a) for a in (fine.offset[side], coarse.offset[side], fine.meshes[side], coarse.meshes[side])
    )
    left, part = np.divmod((2 * points + offset) * meshes_coarse - offset_coarse * meshes, 2 * meshes)
    return left, part / (2 * meshes)


def numbers(grid: Grid) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Line and column numbers of the owned points; they broadcast to `grid.box`."""
    return np.arange(grid.y_start, grid.y_end)[:, None], np.arange(grid.x_start, grid.x_end)[None, :]


class Pick:
    """Values at the points of one grid taken from numbered points of another: line j, column i. Collective."""

    def __init__(self, source: Grid, target: Grid, j: NDArray[np.int64], i: NDArray[np.int64]):
        self.source, self.target = source, target
        self._at: tuple[NDArray[np.int64], ...] = (j, i)
        if target.comm.size == 1:
            if np.array_equal(i, np.arange(source.shape[0])[None, :]) and j.shape[1] == 1:
                self._at = (j[:, 0],)  # whole lines
            return
        natural = np.broadcast_to(j * source.shape[0] + i, target.box).ravel().astype(PETSc.IntType)
        self._from = PETSc.IS().createGeneral(source.dm.getAO().app2petsc(natural), comm=target.petsc_comm)
        self._to = PETSc.IS().createStride(target.local_size, target.first, 1, comm=target.petsc_comm)

    def __call__(self, field: Array) -> Array:
        if self.target.comm.size == 1:
            values = field.reshape(self.source.box)[self._at]
            return values.ravel() if values.shape == self.target.box else np.broadcast_to(values, self.target.box).flatten()
        source, target = self.source.dm.createGlobalVec(), self.target.dm.createGlobalVec()
        source.setArray(field)
        scatter = PETSc.Scatter().create(source, self._from, target, self._to)
        scatter.scatter(source, target)
        values = target.array_r.copy()
        for obj in (scatter, source, target):
            obj.destroy()
        return values

    def destroy(self) -> None:
        for obj in (self._from, self._to) if self.target.comm.size > 1 else ():
            obj.destroy()


def fetch(
    comm: MPI.Comm,
    have: Sequence[tuple[int, Grid, Array]],
    which: NDArray[np.int64],
    j: NDArray[np.int64],
    i: NDArray[np.int64],
) -> Array:
    """Values at numbered points of several grids, each of which some of the ranks share. Collective.

    Parameters
    ----------
    have : of each grid that this rank has a part of: its number, itself, and the values there, shape (fields, local_size).
    which, j, i : number of the grid, line and column of each point that this rank asks for, shape (m,).

    Returns
    -------
    Shape (fields, m); 0 where no grid has the point.
    """
    boxes = [(k, grid.y_start, grid.y_end, grid.x_start, grid.x_end) for k, grid, _ in have]
    places: list[list[NDArray[np.int64]]] = []
    asked: list[list[tuple[int, NDArray[np.int64]]]] = []
    for there in comm.allgather(boxes):
        inside = [np.flatnonzero((which == k) & (y0 <= j) & (j < y1) & (x0 <= i) & (i < x1)) for k, y0, y1, x0, x1 in there]
        at = [(j[m] - y0) * (x1 - x0) + i[m] - x0 for m, (_, y0, _, x0, x1) in zip(inside, there, strict=True)]
        places.append([m for m in inside if m.size])
        asked.append([(n, one) for n, one in enumerate(at) if one.size])
    answers = comm.alltoall([[have[n][2][:, at] for n, at in one] for one in comm.alltoall(asked)])
    fields = comm.allreduce(max((values.shape[0] for _, _, values in have), default=0), MPI.MAX)
    out = np.zeros((fields, which.size))
    for mine, values in zip(places, answers, strict=True):
        for points, found in zip(mine, values, strict=True):
            out[:, points] = found
    return out
