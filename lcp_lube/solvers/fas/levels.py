"""Grids of the nonlinear multigrid: their points, how these are dealt to the ranks, and the coarse ones' coefficients."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from ...base.parallel import Array
from . import held, loops

FEWEST = 3  # points a side of the coarsest grid, at least
FEWEST_LINES = 16  # of a rank; grids with fewer are held whole by every rank. With 8 a dimpled pad stalls on three
# Times the mean conductance of the other direction: then points are left out in the strong one alone. 8 costs 6 % less work on
# six stretched films and 6 cycles more, on a rough one above all; 64 doubles both (benchmarks/constants.py).
STRONG = 4.0
LEAST = 1e-300  # beside flows of a cell that has none: 0 / 0 is 0 then


@dataclass
class Level:
    """One grid: lines y0 to y1 of an nx by ny grid, in arrays with a frame of neighbours (`kernels`).

    Attributes
    ----------
    z, c : iterate and right-hand side; old : the finer level's values that z started from. Of a coarse level they are made at
        their first use (`work_on`), and may be dropped between two cycles (`rest`).
    room : of the finest level, where those of the coarse ones lie (`lodge`), and then r.
    kx, ky : conductances of the x and y faces.
    comm : the ranks, None where this one holds the whole grid and need not tell anyone.
    whole : every rank holds the whole grid, though comm has several.
    by_x, by_y : which points the next coarser grid leaves out.
    carry : of a time step (`kernels`); void : what it is made of, what of b_C r leaves, what is stored of it, and what cells
        store more by p = 1; scale : z of a cavitated cell over that of the finer grid's, which is smaller.
    held, owner, given, spans, slips : of a film with supplies (`held`): which points are held, by which supply (from 1 on),
        their pressures, the runs of free points, and the held points that the next coarser grid sees beside their place.
    look : what has been seen of the conductances (`looked`); ways : weights of interpolation in films with steps (`steps`).
    factors : of the coarsest grid's Jacobian, and the signs of z that they are of (`coarsest`).
    near : how many points this rank relaxed in the last sweeps at fronts, over all of the grid's.
    """

    nx: int
    ny: int
    y0: int
    y1: int
    comm: MPI.Comm | None
    whole: bool
    periodic: tuple[bool, bool]
    z: Array
    c: Array
    kx: Array
    ky: Array
    old: Array = field(default_factory=lambda: np.zeros((0, 0)))
    room: Array = field(default_factory=lambda: np.zeros(0))
    by_x: bool = False
    by_y: bool = False
    carry: Array | None = None
    void: Array | None = None
    scale: Array | None = None
    held: NDArray[np.bool_] | None = None
    owner: Array = field(default_factory=lambda: np.zeros((0, 0)))
    given: Array = field(default_factory=lambda: np.zeros(0))
    spans: NDArray[np.int32] = field(default_factory=lambda: np.zeros((0, 3), dtype=np.int32))
    slips: NDArray[np.bool_] | None = None
    ways: NDArray[np.float32] | None = None
    look: tuple[float, float, float] | None = None
    factors: tuple[Array, NDArray[np.int8]] | None = None
    near: float = np.inf
    visits: int = 0
    seconds: float = 0.0
    work: float = 0.0  # relaxed points

    def work_on(self) -> None:
        """Make the arrays of a coarse level that a cycle fills, where they are not there."""
        for name in ("z", "c", "old"):
            if not getattr(self, name).size:
                setattr(self, name, np.zeros((self.kx.shape[0], self.ky.shape[1])))

    def rest(self) -> None:
        """Drop them until the next cycle; of films with supplies or in time they hold more than that."""
        self.old = np.zeros((0, 0))
        if self.held is None and self.void is None:
            self.z = self.c = self.old

    @property
    def first(self) -> int:
        """Number of the line in row 1 of the arrays."""
        return 0 if self.whole or self.comm is None else self.y0

    def part(self, a: Array) -> Array:
        """The rows of this rank, with their frame; the array itself unless every rank holds the whole."""
        if not self.whole:
            return a
        return a[self.y0 : self.y1 + 2 + (a.shape[0] - self.ny - 2)]

    def share(self, a: Any) -> Any:
        """Bring the frame up to date: rows of the neighbouring ranks, and beyond periodic sides. Collective."""
        n = self.ny if self.comm is None or self.whole else self.y1 - self.y0
        rows, columns = a.shape[0] - n - 1, a.shape[1] - self.nx - 1  # of the frame behind the last point: 1, of faces 2
        if self.comm is not None and not self.whole:
            below, above = self._neighbours(self.comm)
            behind = a[n + 1 :].copy()
            self.comm.Sendrecv(a[n].copy(), above, recvbuf=a[0], source=below)
            self.comm.Sendrecv(a[1 : 1 + rows].copy(), below, recvbuf=behind, source=above)
            a[n + 1 :] = behind
        elif self.periodic[1]:
            a[0], a[n + 1 :] = a[n], a[1 : 1 + rows]
        if self.periodic[0]:
            a[:, 0] = a[:, self.nx]
            a[:, self.nx + 1 :] = a[:, 1 : 1 + columns]
        return a

    def gather(self, a: Array) -> Array:
        """`share` after each rank has computed its own rows, `part(a)`: where all hold the whole, give them all. Collective."""
        if self.comm is not None and self.whole:
            end = self.y1 + 1 + (a.shape[0] - self.ny - 2 if self.y1 == self.ny else 0)
            np.concatenate(self.comm.allgather(np.ascontiguousarray(a[self.y0 + 1 : end])), out=a[1:-1])
        return self.share(a)

    def put_sides(self, west: float = 0.0, east: float = 0.0, south: float = 0.0, north: float = 0.0) -> None:
        """Pressures of the sides into z's frame, for interpolation; while it is swept there is 0, as c has what they push."""
        if not self.periodic[0]:
            self.z[1:-1, 0], self.z[1:-1, -1] = west, east
        if not self.periodic[1] and (not self.split or self.y0 == 0):
            self.z[0, 1:-1] = south
        if not self.periodic[1] and (not self.split or self.y1 == self.ny):
            self.z[-1, 1:-1] = north

    def seen(self, z: Array) -> Array:
        """Values as the finer level has them, whose cells store less void."""
        return z if self.scale is None else np.where(z < 0.0, z / self.scale, z)

    @property
    def sides(self) -> tuple[bool, bool, bool, bool]:
        """Whether the coarser grid's frame has a side to the west, east, south and north, a whole mesh of that grid away."""
        x, y = (not ring for ring in self.periodic)
        south, north = (not self.split or self.y0 == 0), (not self.split or self.y1 == self.ny)
        return x, x and self.nx % 2 == 1, y and south, y and north and self.ny % 2 == 1

    @property
    def split(self) -> bool:
        """Whether other ranks hold other lines."""
        return self.comm is not None and not self.whole

    def _neighbours(self, comm: MPI.Comm) -> tuple[int, int]:
        """The ranks that hold the lines before and behind this one's."""
        rank, size, ring = comm.rank, comm.size, self.periodic[1]
        below = rank - 1 if rank else (size - 1 if ring else MPI.PROC_NULL)
        return below, rank + 1 if rank < size - 1 else (0 if ring else MPI.PROC_NULL)

    def collect(self, a: Array, faces: bool = False) -> Array:
        """Add up what the ranks have put into each other's rows, in `part(a)` of an array that was zero; faces : of y faces, of
        which the last one is the first of the next rank. Collective."""
        if self.comm is not None and self.whole:
            self.comm.Allreduce(MPI.IN_PLACE, a)
        if self.comm is not None and not self.whole:
            below, above = self._neighbours(self.comm)
            from_below, from_above = np.zeros_like(a[0]), np.zeros_like(a[0])
            self.comm.Sendrecv(a[-2 if faces else -1].copy(), above, recvbuf=from_below, source=below)
            self.comm.Sendrecv(a[0].copy(), below, recvbuf=from_above, source=above)
            a[1] += from_below
            a[-2] += from_above
        elif self.periodic[1]:
            a[-2] += a[0]
            a[1] += a[-1]
        a[0], a[-1], a[:, 0], a[:, -1] = 0.0, 0.0, 0.0, 0.0
        return a


def carried(level: Level) -> None:
    """What part of a cell's void leaves it, and what it stores more by p = 1, from `void`."""
    leaves, stored, gives = level.void  # type: ignore[misc]
    level.carry = np.stack([leaves / (leaves + stored + LEAST), gives])


def empty(nx: int, ny: int, y0: int, y1: int, comm: MPI.Comm | None, whole: bool, periodic: tuple[bool, bool]) -> Level:
    n = ny if whole or comm is None else y1 - y0
    z, c, kx, ky = (np.zeros(shape) for shape in ((n + 2, nx + 2), (n + 2, nx + 2), (n + 2, nx + 3), (n + 3, nx + 2)))
    return Level(nx, ny, y0, y1, comm, whole, periodic, z, c, kx, ky)


def lodge(levels: Sequence[Level]) -> None:
    """What cycles fill on the coarse grids laid into one array of the size of the finest one, or as much of it as has room.

    Once they are dropped r is made there: memory costs most when it is touched for the first time.
    """
    finest, at = levels[0], 0
    for coarse in levels[1:]:
        coarse.rest()
    arrays = [(coarse, name, (coarse.kx.shape[0], coarse.ky.shape[1])) for coarse in levels[1:] for name in ("z", "c", "old")]
    finest.room = np.zeros(min(finest.z.size + 8 * sum(finest.z.shape), sum(rows * width for _, _, (rows, width) in arrays)))
    for coarse, name, (rows, width) in arrays:
        if at + rows * width <= finest.room.size:
            setattr(coarse, name, finest.room[at : at + rows * width].reshape(rows, width))
            at += rows * width


def hierarchy(level: Level, harmonic: bool, enough: int = 0) -> list[Level]:
    """A level and all coarser ones, down to so few points or as far as they go. Collective."""
    levels = [level]
    while levels[-1].nx * levels[-1].ny > enough and (coarse := _coarser(levels[-1], harmonic)) is not None:
        levels.append(coarse)
    return levels


def settled(levels: list[Level]) -> list[Level]:
    """The same without what `carry` was made of, once all are made; of steady films without supplies the coarse ones lodged."""
    for level in levels:
        if level.void is not None:
            level.void = np.zeros((3, 0, 0))
    if levels[0].void is None and levels[0].held is None:
        lodge(levels)
    return levels


def _coarser(fine: Level, harmonic: bool) -> Level | None:
    """The grid of every second point, in the directions whose coupling is not much the weaker one. Collective."""
    can_x = fine.nx // 2 >= FEWEST
    # Without a line in between, the two ends of a period would be neighbours on the coarse grid and not on the fine one.
    can_y = fine.ny // 2 >= FEWEST and not (fine.periodic[1] and fine.ny % 2)
    mean_x, mean_y, steps = looked(fine)
    by_x = can_x and (mean_y <= STRONG * mean_x or not can_y)
    by_y = can_y and (mean_x <= STRONG * mean_y or not can_x)
    if not (by_x or by_y):
        return None
    fine.by_x, fine.by_y = by_x, by_y
    nx, ny = fine.nx // 2 if by_x else fine.nx, fine.ny // 2 if by_y else fine.ny
    y0, y1 = (fine.y0 // 2, fine.y1 // 2) if by_y else (fine.y0, fine.y1)
    comm = None if fine.whole else fine.comm
    whole = comm is not None and comm.allreduce(y1 - y0, MPI.MIN) < FEWEST_LINES
    if comm is None:
        y0, y1 = 0, ny
    coarse = empty(nx, ny, y0, y1, comm, whole, fine.periodic)
    last = fine.comm is None or fine.whole or fine.y1 == fine.ny
    beyond_x = by_x and fine.nx % 2 == 0 and not fine.periodic[0]
    beyond_y = by_y and fine.ny % 2 == 0 and not fine.periodic[1] and last
    seam = by_x and fine.periodic[0] and fine.nx % 2 == 1
    into_x, into_y = coarse.part(coarse.kx), coarse.part(coarse.ky)
    if not seam and harmonic and fine.held is None and by_x and by_y and steps:
        fine.ways = np.full((fine.kx.shape[0], fine.ky.shape[1]), 0.5, dtype=np.float32)
        loops.make_ways(fine.kx, fine.ky, fine.ways, fine.first)
        fine.share(fine.ways)
        flags = (fine.first, beyond_x, beyond_y, fine.periodic[0])
        loops.coarsen_steps(fine.kx, fine.ky, fine.ways, into_x, into_y, *flags)
        coarse.share(coarse.collect(coarse.kx))
        coarse.share(coarse.collect(coarse.ky, faces=True))
    else:
        marked = (fine.kx, fine.ky) if fine.held is None else held.marked(fine)
        of_x, of_y = (marked[0], fine.ky, into_x, beyond_x), (fine.kx, marked[1], into_y, beyond_y)
        loops.coarsen(of_x, of_y, fine.first, by_x, by_y, harmonic, seam)
        for a in (coarse.kx, coarse.ky):
            coarse.gather(a)
    if fine.held is not None:
        held.coarser(fine, coarse)
    if fine.void is not None:
        coarse.void, before = np.zeros((3, *coarse.z.shape)), np.zeros_like(coarse.z)
        leaves, stored, gives = coarse.void
        for values, into in zip(fine.void, (leaves, before), strict=False):
            loops.inject(values, coarse.part(into), fine.first, by_x, by_y)
            coarse.gather(into)
        for values, into in zip(fine.void[1:], (stored, gives), strict=True):
            restrict(fine, coarse, into, harmonic, values)
            coarse.share(into)
        carried(coarse)
        coarse.scale = (leaves + stored + LEAST) / (leaves + before + LEAST)
    return coarse


def right_sides(levels: Sequence[Level], harmonic: bool) -> None:
    """The right-hand sides of the coarse problems proper, for full multigrid. Collective."""
    for fine, coarse in pairwise(levels):
        coarse.work_on()
        if fine.held is not None:
            fine.c[fine.held] = 0.0
        restrict(fine, coarse, coarse.c, harmonic, fine.c)
    if levels[-1].held is not None:
        levels[-1].c[levels[-1].held] = 0.0


def looked(level: Level) -> tuple[float, float, float]:
    """Mean conductances of the x and y faces, and how many steps of the film this grid sees (`starts.look`). Collective."""
    if level.look is None:
        x, y, steps = loops.look(level.kx, level.ky)
        if level.comm is not None:
            x, y, steps = (level.comm.allreduce(a) / n for a, n in ((x, level.comm.size), (y, level.comm.size), (steps, 1)))
        level.look = x, y, steps
    return level.look


def restrict(fine: Level, coarse: Level, out: Array, harmonic: bool, given: Array | None = None) -> None:
    """The fine level's residual, or something else that is given there, on the coarse one. Collective."""
    if coarse.whole:
        out[:] = 0.0
    where = (fine.first, fine.by_x, fine.by_y, harmonic, fine.periodic[0], given is None)
    c = fine.c if given is None else given
    loops.restrict(fine.z, fine.kx, fine.ky, c, coarse.part(out), *where, fine.carry, fine.ways)
    coarse.collect(out)
