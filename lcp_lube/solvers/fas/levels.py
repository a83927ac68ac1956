"""Grids of the nonlinear multigrid: their points, how these are dealt to the ranks, and their coefficients."""

from dataclasses import dataclass, field

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from ...base.parallel import Array
from ...errors import InputError
from ...problems.film.lubrication import LubricationProblem
from ...problems.grid import Grid
from . import exact, held, kernels, transfer

FEWEST = 3  # points a side of the coarsest grid, at least
FEWEST_LINES = 16  # of a rank; grids with fewer are held whole by every rank. With 8 a dimpled pad stalls on three
MOST_ENTRIES = 5_000_000  # of a banded matrix that is eliminated
# Times the mean conductance of the other direction: then points are left out in the strong one alone. 8 costs 6 % less work on
# six stretched films and 6 cycles more, on a rough one above all; 64 doubles both (benchmarks/constants.py).
STRONG = 4.0
LEAST = 1e-300


@dataclass
class Level:
    """One grid: lines y0 to y1 of an nx by ny grid, in arrays with a frame of neighbours (`kernels`).

    Attributes
    ----------
    z, c : iterate and right-hand side; old : the finer level's values that z started from; f : right-hand side of the coarse
        problem proper, for full multigrid.
    kx, ky : conductances of the x and y faces.
    comm : the ranks, None where this one holds the whole grid and need not tell anyone.
    whole : every rank holds the whole grid, though comm has several.
    by_x, by_y : which points the next coarser grid leaves out.
    carry : of a time step (`kernels`); void : the part of it that b_C r is made of, what leaves and what is stored; scale : z
        of a cavitated cell over that of the finer grid's, which is smaller.
    held, given, spans, slips : of a film with supplies (`held`): which points are held, their pressures, the runs of free
        points, and the held points that the next coarser grid sees beside their place.
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
    f: Array = field(default_factory=lambda: np.zeros((0, 0)))
    old: Array = field(default_factory=lambda: np.zeros((0, 0)))
    by_x: bool = False
    by_y: bool = False
    carry: Array | None = None
    void: tuple[Array, Array] | None = None
    scale: Array | None = None
    held: NDArray[np.bool_] | None = None
    given: Array = field(default_factory=lambda: np.zeros(0))
    spans: NDArray[np.int32] = field(default_factory=lambda: np.zeros((0, 3), dtype=np.int32))
    slips: NDArray[np.bool_] | None = None
    visits: int = 0
    seconds: float = 0.0
    work: float = 0.0  # relaxed points

    @property
    def first(self) -> int:
        """Number of the line in row 1 of the arrays."""
        return 0 if self.whole or self.comm is None else self.y0

    def part(self, a: Array) -> Array:
        """The rows of this rank, with their frame; the array itself unless every rank holds the whole."""
        if not self.whole:
            return a
        return a[self.y0 : self.y1 + 2 + (a.shape[0] - self.ny - 2)]

    def share(self, a: Array) -> Array:
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

    @property
    def split(self) -> bool:
        """Whether other ranks hold other lines."""
        return self.comm is not None and not self.whole

    def _neighbours(self, comm: MPI.Comm) -> tuple[int, int]:
        """The ranks that hold the lines before and behind this one's."""
        rank, size, ring = comm.rank, comm.size, self.periodic[1]
        below = rank - 1 if rank else (size - 1 if ring else MPI.PROC_NULL)
        return below, rank + 1 if rank < size - 1 else (0 if ring else MPI.PROC_NULL)

    def collect(self, a: Array) -> Array:
        """Add up what the ranks have put into each other's rows, in `part(a)` of an array that was zero. Collective."""
        if self.comm is not None and self.whole:
            self.comm.Allreduce(MPI.IN_PLACE, a)
        if self.comm is not None and not self.whole:
            below, above = self._neighbours(self.comm)
            from_below, from_above = np.zeros_like(a[0]), np.zeros_like(a[0])
            self.comm.Sendrecv(a[-1].copy(), above, recvbuf=from_below, source=below)
            self.comm.Sendrecv(a[0].copy(), below, recvbuf=from_above, source=above)
            a[1] += from_below
            a[-2] += from_above
        elif self.periodic[1]:
            a[-2] += a[0]
            a[1] += a[-1]
        a[0], a[-1], a[:, 0], a[:, -1] = 0.0, 0.0, 0.0, 0.0
        return a


def finest(problem: LubricationProblem) -> Level:
    """The problem's own grid. Collective.

    Raises
    ------
    InputError : the void that leaves a cell is not what enters the next one, which no scheme of this package does.
    """
    grid, s = problem.grid, problem.scheme
    lost, carried = kernels.lost_void(s.b_E, s.b_W, s.b_C)
    if grid.reduce.max(np.array([lost])) > 1e-12 * grid.reduce.max(np.array([carried])):
        raise InputError("--method fas: what leaves a cell of this scheme does not enter the next one; use active-set")
    level = level_of(grid, s.k_W, s.k_E, s.k_S, s.k_N, s.c)
    if s.storage is not None:
        level.void = np.zeros_like(level.z), np.zeros_like(level.z)
        put(level, grid, level.void[0], -s.b_E)
        put(level, grid, level.void[1], s.storage)
        _carry(level)
    if problem.held is not None:
        mask, pressures = np.zeros_like(level.z), np.zeros_like(level.z)
        put(level, grid, mask, problem.held.mask.astype(float))
        put(level, grid, pressures, problem.held.pressures(problem.p_unit))
        held.hold(level, mask, pressures)
    return level


def _carry(level: Level) -> None:
    """What part of a cell's void leaves it, from `void`."""
    leaves, stored = level.void  # type: ignore[misc]
    level.carry = leaves / (leaves + stored + LEAST)


def level_of(grid: Grid, k_W: Array, k_E: Array, k_S: Array, k_N: Array, c: Array) -> Level:
    """A level from the conductances of every point's faces and a right-hand side. Collective.

    Its points are dealt to the ranks as the grid's are; where these hold parts of lines, or few lines, each holds the whole.
    """
    periodic = (grid.periodic[0], grid.dim == 2 and grid.periodic[1])
    split = grid.comm.size > 1
    nx, ny = grid.shape[0], grid.shape[1] if grid.dim == 2 else 1
    lines = grid.box[0] if grid.box[1] == nx else 0
    if split and grid.reduce.min(np.array([float(lines)])) < FEWEST_LINES:
        k_W, k_E, k_S, k_N, c = (whole(grid, a) for a in (k_W, k_E, k_S, k_N, c))
        y0, y1, comm = 0, ny, None
    else:
        y0, y1, comm = grid.y_start, grid.y_end, grid.comm if split else None
    level = _empty(nx, ny, y0, y1, comm, False, periodic)
    level.kx[1:-1, 1 : nx + 1], level.kx[1:-1, nx + 1] = k_W, k_E[:, -1]
    level.ky[1 : y1 - y0 + 1, 1:-1], level.ky[y1 - y0 + 1, 1:-1] = k_S, k_N[-1]
    level.c[1:-1, 1:-1] = c
    for a in (level.kx, level.ky):
        level.share(a)
    return level


def whole(grid: Grid, a: Array) -> Array:
    """All points of a coefficient, on every rank. Collective."""
    out = np.empty((grid.shape[1] if grid.dim == 2 else 1, grid.shape[0]))
    own = (slice(grid.y_start, grid.y_end), slice(grid.x_start, grid.x_end))
    for where, values in grid.comm.allgather((own, np.ascontiguousarray(np.broadcast_to(a, grid.box)))):
        out[where] = values
    return out


def own(level: Level, grid: Grid, a: Array) -> Array:
    """This rank's points of an array of the finest level, without a frame."""
    columns = slice(grid.x_start + 1, grid.x_end + 1)
    return a[slice(grid.y_start + 1, grid.y_end + 1) if level.comm is None else slice(1, -1), columns]


def put(level: Level, grid: Grid, into: Array, values: Array) -> None:
    """This rank's values into an array of the finest level, and its frame. Collective."""
    box = values.reshape(grid.box)
    into[1:-1, 1:-1] = whole(grid, box) if level.comm is None and grid.comm.size > 1 else box
    level.share(into)


def _empty(nx: int, ny: int, y0: int, y1: int, comm: MPI.Comm | None, whole: bool, periodic: tuple[bool, bool]) -> Level:
    n = ny if whole or comm is None else y1 - y0
    z, c, kx, ky = (np.zeros(shape) for shape in ((n + 2, nx + 2), (n + 2, nx + 2), (n + 2, nx + 3), (n + 3, nx + 2)))
    return Level(nx, ny, y0, y1, comm, whole, periodic, z, c, kx, ky)


def hierarchy(level: Level, harmonic: bool) -> list[Level]:
    """A level and all coarser ones. Collective."""
    levels = [level]
    while (coarse := _coarser(levels[-1], harmonic)) is not None:
        levels.append(coarse)
    return levels


def _coarser(fine: Level, harmonic: bool) -> Level | None:
    """The grid of every second point, in the directions whose coupling is not much the weaker one. Collective."""
    # Without a point in between, the two ends of a period would be neighbours on the coarse grid and not on the fine one.
    can_x = fine.nx // 2 >= FEWEST and not (fine.periodic[0] and fine.nx % 2)
    can_y = fine.ny // 2 >= FEWEST and not (fine.periodic[1] and fine.ny % 2)
    mean_x, mean_y = (float(fine.part(k)[1:-1, 1:-1].mean()) for k in (fine.kx, fine.ky))
    if fine.comm is not None:
        mean_x, mean_y = (fine.comm.allreduce(mean) for mean in (mean_x, mean_y))
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
    coarse = _empty(nx, ny, y0, y1, comm, whole, fine.periodic)
    last = fine.comm is None or fine.whole or fine.y1 == fine.ny
    beyond_x = by_x and fine.nx % 2 == 0 and not fine.periodic[0]
    beyond_y = by_y and fine.ny % 2 == 0 and not fine.periodic[1] and last
    flags = (fine.first, by_x, by_y, harmonic)
    kx, ky = (fine.kx, fine.ky) if fine.held is None else held.marked(fine)
    transfer.coarsen_x_faces(kx, fine.ky, coarse.part(coarse.kx), *flags, beyond_x)
    transfer.coarsen_y_faces(fine.kx, ky, coarse.part(coarse.ky), *flags, beyond_y)
    for a in (coarse.kx, coarse.ky):
        coarse.gather(a)
    restrict(fine, coarse, coarse.c, harmonic, fine.c)
    if fine.held is not None:
        held.coarser(fine, coarse)
    coarse.f, coarse.old = coarse.c.copy(), np.zeros_like(coarse.z)
    if fine.void is not None:
        leaves, stored, before = (np.zeros_like(coarse.z) for _ in range(3))
        for values, into in zip(fine.void, (leaves, before), strict=True):
            transfer.inject(values, coarse.part(into), fine.first, by_x, by_y)
            coarse.gather(into)
        restrict(fine, coarse, stored, harmonic, fine.void[1])
        coarse.void = leaves, coarse.share(stored)
        _carry(coarse)
        coarse.scale = (leaves + stored + LEAST) / (leaves + before + LEAST)
    return coarse


def solve(level: Level) -> bool:
    """Newton's method (`exact`) on a level, on every rank if it is dealt to several; whether it settled. Collective."""
    comm, n = level.comm, level.ny
    if level.nx * n * (4 * min(level.nx, n) + 1) > MOST_ENTRIES:  # odd numbers of points between periodic sides
        return False
    if comm is None or not level.split:
        return exact.solve(level.z, level.kx, level.ky, level.c, *level.periodic, level.carry, level.held)
    whole = _empty(level.nx, n, 0, n, None, False, level.periodic)
    whole.carry = None if level.carry is None else np.zeros_like(whole.z)
    whole.held = None if level.held is None else np.zeros(whole.z.shape, dtype=bool)
    for name in ("z", "c", "kx", "ky", *(name for name in ("carry", "held") if getattr(whole, name) is not None)):
        mine, out = getattr(level, name), getattr(whole, name)
        rows = mine[1 if level.y0 else 0 : level.y1 - level.y0 + 1 if level.y1 < n else None]
        np.concatenate(comm.allgather(np.ascontiguousarray(rows)), out=out)
    settled = exact.solve(whole.z, whole.kx, whole.ky, whole.c, *level.periodic, whole.carry, whole.held)
    level.z[:] = whole.z[level.y0 : level.y1 + 2]
    return settled


def restrict(fine: Level, coarse: Level, out: Array, harmonic: bool, given: Array | None = None) -> None:
    """The fine level's residual, or something else that is given there, on the coarse one. Collective."""
    out[:] = 0.0
    where = (fine.first, fine.by_x, fine.by_y, harmonic, fine.periodic[0], given is None)
    c = fine.c if given is None else given
    transfer.restrict(fine.z, fine.kx, fine.ky, c, coarse.part(out), *where, fine.carry)  # type: ignore[arg-type]
    coarse.collect(out)
