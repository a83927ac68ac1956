"""The finest grid of the nonlinear multigrid: a problem's own, whose coefficients are not stored twice."""

from typing import Any

import numpy as np
from mpi4py import MPI

from ...base.parallel import Array
from ...problems.film.cavity import missing_flow
from ...problems.film.lubrication import LubricationProblem
from ...problems.film.strip import frames
from ...problems.film.tangent import renew
from ...problems.grid import Grid
from ...problems.solution import Fields
from . import held, kernels, loops
from .levels import FEWEST_LINES, Level, carried


def finest(problem: LubricationProblem) -> Level:
    """The problem's own grid. Collective."""
    grid, s = problem.grid, problem.scheme
    level = level_of(grid, s.k_W, s.k_E, s.k_S, s.k_N, s.c)
    if s.storage is not None:
        level.void = np.zeros((3, *level.z.shape))
        for into, values in zip(level.void, (-s.b_E, s.storage, s.gives), strict=True):
            if values is not None:
                put(level, grid, into, values)
        carried(level)
    if problem.held is not None:
        owner, pressures = np.zeros_like(level.z), np.zeros_like(level.z)
        put(level, grid, owner, problem.held.owner + 1.0)
        put(level, grid, pressures, problem.held.pressures(problem.p_unit))
        held.hold(level, pressures, owner)
    return level


def unpressed(level: Level) -> bool:
    """Put in the answer of a film that needs no pressure, if it is one (`missing_flow`); whether it is. Collective.

    Each of its cavities ends just where it is full again, at places that coarse grids have elsewhere: cycles do not settle.
    """
    plain = level.held is None and level.carry is None and not level.periodic[0]
    missing = missing_flow(level.c[1:-1, 1:-1]) if plain else None
    found = missing is not None
    if level.comm is not None:
        found = level.comm.allreduce(found, MPI.LAND)
    if found:
        level.z[1:-1, 1:-1] = missing
        level.share(level.z)
    return found


def renewed(level: Level, problem: LubricationProblem, follow: Any) -> None:
    """Go on with coefficients that follow the pressure, if any do; coarse grids, which make corrections alone, keep the old.

    follow : supplies whose pressures do likewise (`following.Following`), if any. Collective.
    """
    if problem.factors is None or problem.factors.law is None:
        return
    fields = loops.pressure_and_void(own(level, problem.grid, level.z), problem.scheme, problem.grid)
    renew(problem, fields["p"])
    new = finest(problem)
    level.kx, level.ky, level.c, level.void, level.carry, level.factors = new.kx, new.ky, new.c, new.void, new.carry, None
    put(level, problem.grid, level.z, fields["p"] + problem.scheme.b_C.ravel() * fields["r"])
    if follow is not None:
        follow.begin(fields)


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
    n = y1 - y0
    kx, ky, framed = frames(k_W, k_E, k_S, k_N, c)
    level = Level(nx, ny, y0, y1, comm, False, periodic, np.zeros((n + 2, nx + 2)), framed, kx, ky)
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


def put(level: Level, grid: Grid, into: Any, values: Any) -> None:
    """This rank's values into an array of the finest level, and its frame. Collective."""
    box = values.reshape(grid.box)
    into[1:-1, 1:-1] = whole(grid, box) if level.comm is None and grid.comm.size > 1 else box
    level.share(into)


def give_up(levels: list[Level], problem: LubricationProblem) -> Fields | None:
    """Leave memory to the certificate: of coarse grids what cycles fill, and z, in whose place p is made. p and r then.

    None where z is needed beside them, or is not of this rank's points alone.
    """
    level, grid = levels[0], problem.grid
    for coarse in levels[1:]:
        coarse.rest()
    z, room, level.room = level.z, level.room, np.zeros(0)
    if level.held is not None or level.void is not None or z.shape != (grid.box[0] + 2, grid.box[1] + 2):
        return None
    room = room if room.size >= grid.local_size else np.empty(grid.local_size)
    p, r = z.ravel()[: grid.local_size], room[: grid.local_size]
    loops.void(z[1:-1, 1:-1], problem.scheme, grid, r.reshape(grid.box))
    kernels.pressure(z[1:-1, 1:-1], p.reshape(grid.box))
    level.z = np.zeros((0, 0))
    return {"p": p, "r": r}


def take_back(level: Level, problem: LubricationProblem, fields: Fields | None) -> None:
    """z of the fields for which it was given up. Collective."""
    if not level.z.size and fields is not None:
        level.z = np.zeros_like(level.c)
        put(level, problem.grid, level.z, fields["p"] + problem.scheme.b_C.ravel() * fields["r"])
