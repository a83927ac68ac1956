"""Grids of interior points on straight lines, distributed by a PETSc DMDA. The only file that knows ghost points."""

import math
import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from ..base.owned import Owned, collect, made
from ..base.parallel import Array, Reduce
from ..errors import InputError

BYTES_PER_POINT = 60  # of the coefficients and the fields alone: no run needs less
LITTLE = 2**25  # bytes that any machine has
LARGEST = np.iinfo(PETSc.IntType).max // 2  # points: half of the unknowns

# Where the first point lies, in spacings from its side. open: the side is a neighbour with a given value; closed: it is the
# outer face of the first cell, through which nothing flows; mirror: the first point lies on it, in half a cell; periodic: the
# cell at the other end follows.
OFFSET = {"open": 1.0, "closed": 0.5, "mirror": 0.0, "periodic": 0.5}
OPEN = ("open", "open")
Places = tuple[Array | None, Array | None]  # of the lines of points in x and y, m from the corner; None: evenly spaced
EVEN: Places = (None, None)
Polar = tuple[float, float]  # radius at y = 0, and the radius on which x is measured, m


def meshes_of(n: int, ends: Sequence[str]) -> float:
    """Spacings from side to side of n points between two ends."""
    return n + OFFSET[ends[0]] + OFFSET[ends[1]] - 1.0


class Grid:
    """Interior points x_i = i dx, dx = L/(nx+1) (and y_j = j dy, dy = Ly/(ny+1)) of a line or a rectangle.

    Arrays of owned points are flat, in PETSc's order on this rank: y outer, x inner. `box` gives their
    two-dimensional shape (1 line in 1D).

    Lines may lie unevenly (`places`). `spacing` and `cell` are then means, in whose parts `widths` and `steps` tell the cells
    and the distances between points: a cell ends half-way between two points.

    Parameters
    ----------
    shape : numbers of interior points, (nx,) or (nx, ny).
    lengths : side lengths in metres, (L,) or (L, Ly).
    comm : PETSc communicator; default all ranks.
    origin : coordinates of the corner x = y = 0 of the description above, in metres.
    ends : kinds (`OFFSET`) of the two ends in x and in y; spacings and first points as above are those of open ends.
    places : coordinates of the lines of points in x and in y from that corner, ascending, m; None: evenly spaced.
    polar : of a sector: the lines of points are arcs, y is a radius beyond the first of these, x the arc on the second.

    Raises
    ------
    InputError : fewer than one point a side (periodic: 3), more points than fit, or more ranks than the points can be dealt to.
    """

    def __init__(
        self,
        shape: Sequence[int],
        lengths: Sequence[float],
        comm: PETSc.Comm | None = None,
        origin: tuple[float, float] = (0.0, 0.0),
        ends: tuple[tuple[str, str], tuple[str, str]] = (OPEN, OPEN),
        places: Places = EVEN,
        polar: Polar | None = None,
    ):
        if any(n < 1 for n in shape):
            raise InputError(f"grid {'x'.join(map(str, shape))}: at least 1 interior point a side is needed")
        self.shape = tuple(int(n) for n in shape)
        self.lengths = tuple(float(length) for length in lengths)
        self.dim = len(self.shape)
        self._ends, self.ends = ends, ends[: self.dim]
        self.periodic = tuple("periodic" in pair for pair in self.ends)
        if any(periodic and n < 3 for periodic, n in zip(self.periodic, self.shape, strict=True)):
            raise InputError(f"grid {'x'.join(map(str, shape))}: at least 3 points between periodic sides are needed")
        self.offset = tuple(OFFSET[first] for first, _ in self.ends)
        self.meshes = tuple(meshes_of(n, pair) for n, pair in zip(self.shape, self.ends, strict=True))
        self.spacing = tuple(length / meshes for length, meshes in zip(self.lengths, self.meshes, strict=True))
        self.origin, self.places, self.polar = origin, places, polar
        self._around = tuple(self._with_neighbours(side) for side in range(self.dim))
        self.size = math.prod(self.shape)
        comm = PETSc.Comm(comm or PETSc.COMM_WORLD)  # mpi4py's will do too
        self._check_size(comm)
        collect(comm)  # what earlier solves have left behind
        self._own, self.petsc_comm = Owned(self, comm), comm
        self.comm = comm.tompi4py()  # not the DM's own: that ends with it, and a solution is asked for more when it is freed
        self.reduce = Reduce(self.comm)
        # One rank has them all: its DMDA, some 30 bytes a point, waits for what asks for it (files, frames).
        ranges = self.dm.getRanges() if comm.size > 1 else [(0, n) for n in self.shape]
        self._owned = [(int(start), int(end)) for start, end in (*ranges, (0, 1))][:2]
        (self.x_start, self.x_end), (self.y_start, self.y_end) = self._owned
        self.box = (self.y_end - self.y_start, self.x_end - self.x_start)
        # Rank k owns the global (PETSc) numbers starts[k] to starts[k + 1].
        self.starts = np.cumsum([0, *(self.comm.allgather(self.local_size) if comm.size > 1 else [self.local_size])])

    @made
    def dm(self) -> PETSc.DMDA:
        """Deals the points to the ranks."""
        # Lines of the flow direction stay whole where there are enough of them: fronts are found along them.
        ranks = self.petsc_comm.size
        try:
            return PETSc.DMDA().create(
                dim=self.dim,
                sizes=self.shape,
                proc_sizes=(1, ranks) if self.dim == 2 and self.shape[1] >= ranks else None,
                dof=1,
                stencil_width=1,
                stencil_type=PETSc.DMDA.StencilType.STAR,
                boundary_type=tuple("periodic" if periodic else "none" for periodic in self.periodic),
                comm=self.petsc_comm,
            )
        except PETSc.Error:
            raise InputError(
                f"grid {'x'.join(map(str, self.shape))}: too few points for {ranks} ranks; use fewer ranks or a finer grid"
            ) from None

    def _check_size(self, comm: PETSc.Comm) -> None:
        """Refuse before anything is allocated what PETSc's integers or this machine's memory cannot hold."""
        what = f"grid {'x'.join(map(str, self.shape))}: {self.size} points"
        if self.size > LARGEST:
            raise InputError(f"{what}; this PETSc numbers at most {LARGEST}")
        needed = BYTES_PER_POINT * self.size // comm.size
        if needed > LITTLE and needed > (memory := os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")):
            raise InputError(f"{what} need {needed / 1e9:.0f} GB a rank, this machine has {memory / 1e9:.0f}; use fewer points")

    @property
    def local_size(self) -> int:
        return self.box[0] * self.box[1]

    @property
    def first(self) -> int:
        """Global number of this rank's first point."""
        return int(self.starts[self.comm.rank])

    @property
    def even(self) -> bool:
        """Whether all lines are evenly spaced."""
        return all(places is None for places in self.places[: self.dim])

    @property
    def cell(self) -> float:
        """Length (1D, m) or area (2D, m2) of a grid cell; of uneven lines their mean."""
        return float(np.prod(self.spacing))

    @property
    def x(self) -> Array:
        """Owned x coordinates in metres, shape (1, nx_local)."""
        return self._line(0, self.x_start, self.x_end)[None, :]

    @property
    def y(self) -> Array:
        """Owned y coordinates in metres, shape (ny_local, 1); 0 in 1D."""
        if self.dim == 1:
            return np.zeros((1, 1))
        return self._line(1, self.y_start, self.y_end)[:, None]

    @property
    def lines(self) -> tuple[Array, ...]:
        """Coordinates x, and y in 2D, of all points of the grid, m; on every rank."""
        return tuple(self._line(side, 0, n) for side, n in enumerate(self.shape))

    def _line(self, side: int, start: int, end: int) -> Array:
        places = self.places[side]
        if places is not None:
            return self.origin[side] + places[start:end]
        return self.origin[side] + (np.arange(start, end) + self.offset[side]) * self.spacing[side]

    def with_neighbours(self, side: int) -> Array:
        """Coordinates of all points of a side, what lies before the first and behind the last one among them, m."""
        around = self._around[side]
        if around is None:
            around = (np.arange(-1, self.shape[side] + 1) + self.offset[side]) * self.spacing[side]
        return self.origin[side] + around

    def _with_neighbours(self, side: int) -> Array | None:
        """Uneven lines with what lies before the first and behind the last one: a side, a mirror image or the other end."""
        places, (first, last), L = self.places[side], self.ends[side], self.lengths[side]
        if places is None:
            return None
        second = places[1] if places.size > 1 else L
        before = {"open": 0.0, "closed": -places[0], "mirror": -second, "periodic": places[-1] - L}[first]
        last_but_one = places[-2] if places.size > 1 else before
        behind = {"open": L, "closed": 2.0 * L - places[-1], "mirror": 2.0 * L - last_but_one, "periodic": places[0] + L}[last]
        return np.concatenate([[before], places, [behind]])

    def stretch(self, y: Array) -> Array:
        """Length of an arc at y over its x: 1 in the plane, in a sector the radius over the one on which x is measured."""
        return np.ones_like(y) if self.polar is None else (self.polar[0] + y) / self.polar[1]

    def steps(self, side: int) -> Array:
        """Distances in m, in x (side 0) or y (1), across the faces before, between and behind the owned points.

        Across a closed or mirror end to the mirror image: nothing flows there.
        """
        start, end = self._owned[side]
        around = self._around[side]
        steps = np.full(self.shape[side] + 1, self.spacing[side]) if around is None else np.diff(around)
        return (np.append(steps[:-1], steps[0]) if self.periodic[side] else steps)[start : end + 1]

    def widths(self, side: int, everywhere: bool = False) -> Array:
        """Widths of the owned columns (side 0) or lines (1) of cells, or of all, in spacings: 1, and 1/2 on a mirror."""
        start, end = (0, self.shape[side]) if everywhere else self._owned[side]
        around, n = self._around[side], self.shape[side]
        out = np.ones(end - start) if around is None else (0.5 * (around[2:] - around[:-2]) / self.spacing[side])[start:end]
        for number in {k for k, kind in zip((0, n - 1), self.ends[side], strict=True) if kind == "mirror" and start <= k < end}:
            out[number - start] *= 0.5
        return out

    def rims(self, side: int) -> tuple[float, float]:
        """Distances from the outermost lines of points to the two sides, in spacings."""
        around = self._around[side]
        if around is None:
            first, last = (OFFSET[end] for end in self.ends[side])
            return first, last
        return float(around[1]) / self.spacing[side], float(self.lengths[side] - around[-2]) / self.spacing[side]

    def nodes_and_faces(self, side: int) -> tuple[Array, Array]:
        """Coordinates in x (side 0) or y (1) of the owned points with a neighbour before and behind, and of the faces between.

        Each comes from its number alone, so that the two cells of a face see the same film even where it jumps there, and what
        leaves one cell enters the next. Nothing lies beyond a closed or mirror end: its own coordinate stands there.
        """
        start, end = self._owned[side]
        around, n, offset, L = self._around[side], self.shape[side], self.offset[side], self.lengths[side]
        if around is not None:
            at_points, at_faces = np.clip(around, 0.0, L), np.clip(0.5 * (around[1:] + around[:-1]), 0.0, L)
            if self.periodic[side]:  # one face, seen from both ends, to the last bit
                at_points, at_faces[0] = around[[n, *range(1, n + 1), 1]], np.mod(0.5 * (around[0] + around[1]), L)
                at_faces[-1] = at_faces[0]
            return self.origin[side] + at_points[start : end + 2], self.origin[side] + at_faces[start : end + 1]
        points, faces = np.arange(start - 1, end + 1), np.arange(start, end + 1)
        if self.periodic[side]:
            points, faces = points % n, faces % n
        lines = (np.clip(k + shift, 0.0, self.meshes[side]) for k, shift in ((points, offset), (faces, offset - 0.5)))
        at_points, at_faces = (self.origin[side] + line * self.spacing[side] for line in lines)
        return at_points, at_faces

    def ghosted(self, owned: NDArray, outside: float = np.nan) -> Array:
        """Owned values with one layer of the neighbours' around them, `outside` beyond the domain.

        Returns an array of shape (ny_local + 2, nx_local + 2); its corners are not to be used. Collective.
        """
        if owned.dtype.itemsize > 8:  # PETSc's vectors hold doubles
            high = owned.astype(float)
            return np.add(self.ghosted(high, outside), self.ghosted((owned - high).astype(float), 0.0), dtype=np.longdouble)
        if self.comm.size == 1:
            out = np.empty((self.box[0] + 2, self.box[1] + 2), dtype=bool if owned.dtype == bool and not outside else float)
            out[1:-1, 1:-1] = owned.reshape(self.box)
            out[:, 0], out[:, -1] = (out[:, -2], out[:, 1]) if self.periodic[0] else (outside, outside)
            out[0], out[-1] = (out[-2], out[1]) if self.periodic[-1] and self.dim == 2 else (outside, outside)
            return out
        source, target = self.dm.getGlobalVec(), self.dm.getLocalVec()
        source.setArray(owned)
        self.dm.globalToLocal(source, target)
        out = self._frame(target.array_r, outside)
        self.dm.restoreGlobalVec(source)
        self.dm.restoreLocalVec(target)
        return out

    def neighbours(self) -> NDArray[np.int64]:
        """Global (PETSc) numbers of the owned points and their neighbours, -1 outside the domain.

        Shape (ny_local + 2, nx_local + 2); its corners are not to be used.
        """
        if self.comm.size == 1:
            return self.ghosted(np.arange(self.size), -1).astype(np.int64)
        return self._frame(self.dm.getLGMap().indices, -1)

    def _frame(self, values: NDArray, outside: float) -> NDArray:
        ghost = self.dm.getGhostRanges()
        (gx0, gx1) = ghost[0]
        (gy0, gy1) = ghost[1] if self.dim == 2 else (0, 1)
        out = np.full((self.box[0] + 2, self.box[1] + 2), outside, dtype=np.asarray(values).dtype)
        row, col = gy0 - self.y_start + 1, gx0 - self.x_start + 1
        out[row : row + gy1 - gy0, col : col + gx1 - gx0] = np.reshape(values, (gy1 - gy0, gx1 - gx0))
        return out

    def __deepcopy__(self, memo: dict[int, Any]) -> "Grid":
        """A grid of its own DMDA. Collective."""
        return Grid(self.shape, self.lengths, self.petsc_comm, self.origin, self._ends, self.places, self.polar)

    def __reduce__(self) -> tuple[Any, ...]:
        """What is pickled: the numbers, from which as many ranks make the grid again, together."""
        return _on_ranks, (self.comm.size, self.shape, self.lengths, self.origin, self._ends, self.places, self.polar)

    def destroy(self) -> None:
        """Free the DMDA. Collective."""
        self._own.free()


def _on_ranks(ranks: int, shape: tuple[int, ...], lengths: tuple[float, ...], *how: Any) -> Grid:
    """A pickled grid, on one rank or all of them. Collective."""
    comm = PETSc.COMM_SELF if ranks == 1 else PETSc.COMM_WORLD
    if comm.getSize() != ranks:
        raise InputError(f"pickled on {ranks} ranks, each with its part: {comm.getSize()} ranks cannot take it up")
    return Grid(shape, lengths, comm, *how)
