"""Multigrid for films with supplies: cells that are held at a pressure on every grid, and sweeps that leave them out.

A held cell has z = P > 0 and no equation; its neighbours see it as they see any other. Corrections leave it as it is. A coarse
point that lies in a supply is held, and the coarse face to it resists as the fine faces up to the supply do. Where a supply
slips between the coarse points, those about it are held in its place: the functions that a grid corrects by then vanish there,
as they should. So a hole of one point is one or four points on every grid.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...base.compiled import kernel, piece
from ...base.parallel import Array
from . import transfer
from .front_points import without
from .kernels import balance_at, relax

if TYPE_CHECKING:
    from .levels import Level


def hold(level: Level, pressures: Array, owner: Array) -> None:
    """Hold a level's cells; pressures and owner (which supply's, from 1 on) have frames that are up to date."""
    level.held, level.owner = owner > 0.0, np.rint(owner)
    level.spans = free_spans(level.held)
    level.given = pressures[level.held]
    level.z[level.held] = level.given
    level.c = np.where(level.held, 0.0, level.c)  # what is restricted; of the finest level a copy of the problem's


def settle(level: Level) -> None:
    """Give held cells the right-hand side that leaves them no residual."""
    if level.held is not None:
        settle_rows(level.z, level.kx, level.ky, level.c, level.held, level.carry)


def coarser(fine: Level, coarse: Level) -> None:
    """Hold a coarse level's cells as the finer one's are. Collective."""
    assert fine.held is not None
    where = (fine.first, fine.by_x, fine.by_y)
    mask, pressures = fine.held.astype(float), np.where(fine.held, fine.z, 0.0)
    pressures[fine.held] = fine.given
    of_fine = (mask, pressures, fine.owner)
    of_coarse = [np.zeros_like(coarse.z) for _ in of_fine]
    for values, out in zip(of_fine, of_coarse, strict=True):
        transfer.inject(values, coarse.part(out), *where)
        coarse.gather(out)
    seen = np.zeros_like(fine.z)
    ones = (np.ones_like(fine.kx), np.ones_like(fine.ky))
    held = coarse.part(of_coarse[0])
    transfer.correct(seen, held, np.zeros_like(held), *ones, *where, False, 0)  # type: ignore[arg-type]
    lonely = fine.held & (seen == 0.0)
    lonely[0], lonely[-1], lonely[:, 0], lonely[:, -1] = False, False, False, False
    fine.slips = lonely if lonely.any() else None  # what is swept as fronts are
    parts = [np.zeros_like(coarse.z) for _ in of_fine]
    for values, out in zip(of_fine, parts, strict=True):
        given = np.where(lonely, values, 0.0)
        into = (fine.z, *ones, given, coarse.part(out))
        transfer.restrict(*into, *where, False, fine.periodic[0], False, None)
        coarse.collect(out)
        coarse.share(out)
    added = (parts[0] > 0.0) & (of_coarse[0] == 0.0)
    for out, part in zip(of_coarse[1:], parts[1:], strict=True):
        out[added] = part[added] / parts[0][added]
    hold(coarse, *of_coarse[1:])


def marked(level: Level) -> tuple[Array, Array]:
    """kx and ky with -1 at the faces between two held cells, which resist nothing to what lies beside a supply."""
    kx, ky, held = level.kx.copy(), level.ky.copy(), level.held
    assert held is not None
    kx[:, 1:-1][held[:, :-1] & held[:, 1:]] = -1.0
    ky[1:-1][held[:-1] & held[1:]] = -1.0
    return kx, ky


@piece
def free_spans(held: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Row, first column and last column + 1 of the runs of points that are not held, upwards."""
    ny, nx = held.shape[0] - 2, held.shape[1] - 2
    rows = np.empty((ny, 3), dtype=np.int32)
    for k in range(ny):
        rows[k, 0], rows[k, 1], rows[k, 2] = k + 1, 1, nx + 1
    spans, at = without(rows, np.array([0, ny]), held)
    return spans[: at[1]]


@kernel
def sweep(
    z: Array,
    kx: Array,
    ky: Array,
    c: Array,
    spans: NDArray[np.int32],
    first: int,
    last: int,
    down: bool,
    carry: Array | None,
    ring: bool,
) -> None:
    """A sweep over the free points of rows first to last, as `kernels.sweep`."""
    n, nx = spans.shape[0], z.shape[1] - 2
    for s in range(n):
        k = n - 1 - s if down else s
        if first <= spans[k, 0] <= last:
            m = spans[k, 0]
            relax(z, kx, ky, c, m, spans[k, 1], spans[k, 2], carry)
            if ring:
                z[m, 0], z[m, nx + 1] = z[m, nx], z[m, 1]


@kernel
def settle_rows(z: Array, kx: Array, ky: Array, c: Array, held: NDArray[np.bool_], carry: Array | None) -> None:
    """c = G(z) at the held points."""
    for m in range(1, z.shape[0] - 1):
        for i in range(1, z.shape[1] - 1):
            if held[m, i]:
                c[m, i] = balance_at(z, kx, ky, m, i, carry)
