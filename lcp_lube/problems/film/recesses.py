"""Faces around the corners of rectangular recesses and lands, where the film jumps about a quarter of the plane.

With K = h^3, K_1 = kappa K_2 inside and K_2 outside, a full film has there, beside a plane p whose flow U h - K p_x/(6 mu) is
one inside and outside, s = r^lambda f, which a scheme that takes slopes for differences follows with order 2 lambda < 2:

    f = cos(lambda phi - delta) inside, A cos(lambda omega + delta) outside, phi and omega from the middle of either;
    tan^2(lambda pi/4) = (kappa + 3)/(3 kappa + 1), delta = 0, or, of lands, its inverse, delta = pi/2;
    beside a cavity s = 0 inside, lambda = 2/3, delta = 0.

What s drives through a face is known, the difference of its conjugate between the face's ends; so is the difference of s
between its two points. Conductances times the ratio of the two have s for a solution, and H goes along by
dH = (h_2 - h_1)/(K_2 - K_1) dC, which keeps the plane. The ratios are positive, and both cells of a face share them: A stays
the M-matrix that it was (docs/accuracy.md). What is full and what cavitated the answer tells: a film is solved as if it had no
corners, and once more with the faces about them made for what was found (`drivers.rims`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...base.parallel import Array
from ..grid import Grid
from .corners import BLEND, Corners, batches_about, numbers_of, ratios, window
from .edges import corners_of

CELLS = 2  # about a corner
NEAR = 1e-3  # of a spacing: that far from a corner the film of its quarters is looked at
SAME = 0.05  # of the jump: by no more do the three quarters outside differ
SLIGHT = 1e-9  # relative: lesser jumps are none
FAINT = 1e-9  # of what the wall makes over a cell: a lesser pressure may be what rounding leaves of none


def corners_on(grid: Grid, film: Callable[[Array, Array], Array], state: Array, kind: Any = float) -> Corners | None:
    """Those of a film, `edges.corners_of` it, that are points of the grid, inside it, and beside which there is a pressure or a
    cavity; None: it has none. Collective.

    state : `rims.state_of` the owned points. kind : dtype of the film, complex where it is differentiated.
    """
    known = corners_of(film)
    if not known.size or grid.dim == 1:
        return None
    places_, at, on = np.array(known[:, :2].T), np.zeros((2, len(known)), dtype=np.int64), np.ones(len(known), dtype=bool)
    for side in (0, 1):
        if grid.periodic[side]:
            places_[side] %= grid.lengths[side]
        at[side], exact = numbers_of(grid, side, places_[side])
        on &= exact
    outward = known[:, 2:].T.astype(np.int64)
    rows = np.unique(np.concatenate([at, outward])[:, on], axis=1)
    if not rows.size:
        return None
    at, outward = rows[:2], rows[2:]
    places_ = np.array([grid.with_neighbours(side)[1:-1][at[side]] for side in (0, 1)])
    stretch = grid.stretch(places_[1])
    # To all that is near: half-way to other corners, and up to sides, as walls and mirrors show as much again.
    room: list[Array] = []
    for side, scale in ((0, stretch), (1, 1.0)):
        room += [0.5 * scale * a for a in _apart(places_[side], at[1 - side], grid.lengths[side] * grid.periodic[side])]
        if not grid.periodic[side]:
            start, end = grid.origin[side], grid.origin[side] + grid.lengths[side]
            room += [scale * (places_[side] - start), scale * (end - places_[side])]
    inside, outside, found = _quarters(grid, film, state, at, outward, places_, kind)
    jumps = (np.min(room, axis=0) > 0.0) & (found != 0.0) & (np.abs(inside - outside) > SLIGHT * np.abs(outside))
    if not jumps.any():
        return None
    near = np.sum(np.array(room)[:, jumps] ** -BLEND, axis=0)  # no step where another one becomes the nearest
    some = at[:, jumps], outward[:, jumps], places_[:, jumps]
    spans = np.array([np.ptp(window(grid, side, *some, CELLS), axis=1) / 2.0 for side in (0, 1)])
    reach = (spans**-BLEND + near) ** (-1.0 / BLEND)
    return Corners(*some, reach, inside[jumps], outside[jumps], found[jumps] > 0.0)


class Faces(NamedTuple):
    """Owned faces along x or y about corners, each of them once: rows and columns of an array of them all.

    more : by what they conduct more. drags : by what H grows, in parts of the C that they would have; 0 of y faces. Both
    complex where the film is.
    """

    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    more: Array
    drags: Array

    def among(self, rows: NDArray[np.int64]) -> tuple[NDArray[np.bool_], NDArray[np.int64], NDArray[np.int64]]:
        """Which of them are in some rows, which are told in order; and of these the number of the row, and the column."""
        at = np.minimum(np.searchsorted(rows, self.rows), rows.size - 1)
        own = rows[at] == self.rows
        return own, at[own], self.columns[own]


def faces_about(
    grid: Grid, film: Callable[[Array, Array], Array], state: Array, kind: Any = float
) -> tuple[Faces, Faces] | None:
    """The x and y faces about corners, and what these ask for; None without corners. Collective.

    As in `corners_on`."""
    if (found := corners_on(grid, film, state, kind)) is None:
        return None
    nodes = [window(grid, side, *found[:3], CELLS) for side in (0, 1)]
    h, H = found.inside, found.outside
    slope, out = np.where(found.dry, 0.0, 1.0 / (h * h + h * H + H * H)), []
    for side in (0, 1):
        lines, columns = grid.box[side], grid.box[1 - side] + 1
        batches = [*batches_about(grid, side, found, ratios(found, side, nodes), (lines, columns))]
        numbers = [line * columns + face for (line, face), *_ in batches]
        faces = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *numbers]))
        more, drags = np.ones(faces.size, dtype=kind), np.zeros(faces.size, dtype=kind)
        for number, (_, ratio, of) in zip(numbers, batches, strict=True):  # corner after corner, where they share a face
            k = np.searchsorted(faces, number)
            drags[k] += (ratio - 1.0) * more[k] * slope[of]
            more[k] *= ratio
        line, face = np.divmod(faces, columns)
        out.append(Faces(line, face, more, drags) if side == 0 else Faces(face, line, more, 0.0 * drags))
    return out[0], out[1]


def around_recesses(
    grid: Grid, film: Callable[[Array, Array], Array], state: Array, kx: Array, ky: Array, wall: Array, drag: Any
) -> None:
    """Make the faces about corners what these ask for. Collective.

    Parameters
    ----------
    state : as in `corners_on`. kx, ky : conductances of the x and y faces, shapes (ny, nx + 1) and (ny + 1, nx).
    wall : what it drags through the x faces. drag : 6 mu U/p_unit.
    """
    if (found := faces_about(grid, film, state, kx.dtype)) is None:
        return
    x, y = found
    at = x.rows, x.columns
    wall[at] += x.drags * kx[at] * grid.steps(0)[x.columns] * grid.stretch(grid.y)[x.rows, 0] ** 2 * drag
    kx[at] *= x.more
    ky[y.rows, y.columns] *= y.more


def _apart(places_: Array, line: Array, period: float) -> Array:
    """How far it is to the corners before and behind on the same line, m, shape (2, n); inf where there is none.

    period : round a ring, else 0."""
    order = np.lexsort((places_, line))
    a, of = places_[order], line[order]
    ends = np.flatnonzero(np.diff(of, prepend=of[:1] - 1, append=of[-1:] + 1))  # where lines begin, and the end
    gaps = np.diff(a, prepend=0.0, append=0.0)
    around = a[ends[:-1]] + period - a[ends[1:] - 1] if period else np.full(ends.size - 1, np.inf)
    before, behind = gaps[:-1].copy(), gaps[1:].copy()
    before[ends[:-1]] = behind[ends[1:] - 1] = around
    out = np.empty((2, a.size))
    out[:, order] = [np.where(gap > 0.0, gap, np.inf) for gap in (before, behind)]
    return out


def _quarters(
    grid: Grid, film: Callable[[Array, Array], Array], state: Array, at: Array, outward: Array, places_: Array, kind: Any
) -> tuple[Array, Array, Array]:
    """The film inside and outside of corners, both 0 where it is no corner of one jump, and the state of the inside.

    Told by the rank that owns the next point inside, as films may be known there alone. Collective.
    """
    x, y = (numbers - way for numbers, way in zip(at, outward, strict=True))
    i, j = (k % n if ring else k for k, n, ring in zip((x, y), grid.shape, grid.periodic, strict=True))
    own = (i >= grid.x_start) & (i < grid.x_end) & (j >= grid.y_start) & (j < grid.y_end)
    h = np.zeros((3, own.size), dtype=kind)
    if own.any():
        ways = outward[:, own, None] * np.array([[1, 1, -1, -1], [1, -1, 1, -1]])[:, None, :]
        off = np.array(grid.spacing)[:, None, None] * NEAR * ways
        quarters = film(*(places_[:, own, None] + off))
        jump = np.abs(np.real(quarters[:, 3] - quarters[:, 0]))
        one = np.ptp(np.real(quarters[:, :3]), axis=1) <= SAME * jump
        h[0, own], h[1, own] = one * quarters[:, 3], one * 0.5 * (quarters[:, 1] + quarters[:, 2])
        inside = np.reshape(state, grid.box)[j[own] - grid.y_start, i[own] - grid.x_start]
        faint = FAINT * grid.spacing[0] / np.real(quarters[:, 0]) ** 2
        h[2, own] = np.where(inside > 0.0, 1.0, np.where(inside < -faint, -1.0, 0.0))
    h = h if grid.comm.size == 1 else grid.comm.allreduce(h)
    return h[0], h[1], np.real(h[2])
