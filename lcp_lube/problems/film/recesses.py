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
from .corners import BLEND, ON, SMALL, places, ratios
from .edges import corners_of

CELLS = 2  # about a corner
NEAR = 1e-3  # of a spacing: that far from a corner the film of its quarters is looked at
SAME = 0.05  # of the jump: by no more do the three quarters outside differ
SLIGHT = 1e-9  # relative: lesser jumps are none
FAINT = 1e-9  # of what the wall makes over a cell: a lesser pressure may be what rounding leaves of none


class Corners(NamedTuple):
    """Corners on points of a grid, n of them, on every rank the same.

    at : numbers of the point in x and y, shape (2, n). outward : signs of the way out of the recess. places : m.
    reach : how far faces know of it, m. inside, outside : the film there, m. dry : whether a cavity comes up to it.
    """

    at: NDArray[np.int64]
    outward: NDArray[np.int64]
    places: Array
    reach: Array
    inside: Array
    outside: Array
    dry: NDArray[np.bool_]


def corners_on(grid: Grid, film: Callable[[Array, Array], Array], state: Array, kind: Any = float) -> Corners | None:
    """Those of a film, `edges.corners_of` it, that are points of the grid, inside it, and beside which there is a pressure or a
    cavity; None: it has none. Collective.

    state : `rims.state_of` the owned points. kind : dtype of the film, complex where it is differentiated.
    """
    known = corners_of(film)
    if not known.size or grid.dim == 1:
        return None
    places_, at, on = np.array(known[:, :2].T), np.zeros((2, len(known)), dtype=np.int64), np.ones(len(known), dtype=bool)
    for side, n in enumerate(grid.shape):
        if grid.periodic[side]:
            places_[side] %= grid.lengths[side]
        lines = grid.with_neighbours(side)[1:-1]
        k = np.clip(np.searchsorted(lines, places_[side] - ON * grid.spacing[side]), 0, n - 1)
        at[side], on = k, on & (np.abs(lines[k] - places_[side]) <= ON * grid.spacing[side])
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
    spans = np.array([np.ptp(_window(grid, side, *some), axis=1) / 2.0 for side in (0, 1)])
    reach = (spans**-BLEND + near) ** (-1.0 / BLEND)
    return Corners(*some, reach, inside[jumps], outside[jumps], found[jumps] > 0.0)


def around_recesses(
    grid: Grid, film: Callable[[Array, Array], Array], state: Array, kx: Array, ky: Array, wall: Array, drag: Any
) -> None:
    """Make the faces about corners what these ask for. Collective.

    Parameters
    ----------
    state : as in `corners_on`. kx, ky : conductances of the x and y faces, shapes (ny, nx + 1) and (ny + 1, nx).
    wall : what it drags through the x faces. drag : 6 mu U/p_unit.
    """
    if (found := corners_on(grid, film, state, kx.dtype)) is None:
        return
    nodes = [_window(grid, side, *found[:3]) for side in (0, 1)]
    h, H = found.inside, found.outside
    slope = np.where(found.dry, 0.0, 1.0 / (h * h + h * H + H * H))
    steps, stretch = grid.steps(0), grid.stretch(grid.y)[:, 0]
    for side, k in ((0, kx), (1, ky.T)):
        ratio, n = _ratios(found, side, nodes), grid.shape[side]
        corner, j, i = np.nonzero(ratio != 1.0)
        more, by = ratio[corner, j, i], slope[corner]
        line, face = found.at[1 - side][corner] + j - CELLS + 1, found.at[side][corner] + i - CELLS + 1
        line = (line % grid.shape[1 - side] if grid.periodic[1 - side] else line) - (grid.x_start if side else grid.y_start)
        for turn in (-n, 0, n) if grid.periodic[side] else (0,):  # the last face of a ring is the first one
            turned = face + turn - (grid.y_start if side else grid.x_start)
            left = np.flatnonzero((line >= 0) & (line < k.shape[0]) & (turned >= 0) & (turned < k.shape[1]))
            while left.size:  # once, but for faces that several corners are near
                once = left[np.unique(line[left] * k.shape[1] + turned[left], return_index=True)[1]]
                at = line[once], turned[once]
                if side == 0:
                    wall[at] += (more[once] - 1.0) * k[at] * steps[at[1]] * stretch[at[0]] ** 2 * drag * by[once]
                k[at] *= more[once]
                left = np.setdiff1d(left, once, assume_unique=True)


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


def _window(grid: Grid, side: int, at: NDArray[np.int64], outward: NDArray[np.int64], places_: Array) -> Array:
    """Coordinates of the points about corners, from them and outwards, m, shape (n, 2 CELLS + 1)."""
    lines, ring = places(grid, side), grid.periodic[side]
    k = at[side] + 1 + grid.shape[side] * ring
    around = lines[np.clip(k[:, None] + np.arange(-CELLS, CELLS + 1), 0, lines.size - 1)] - lines[k][:, None]
    scale = grid.stretch(places_[1]) if side == 0 else 1.0
    return around * np.broadcast_to(outward[side] * scale, k.shape)[:, None]


def _ratios(found: Corners, side: int, nodes: list[Array]) -> Array:
    """By what the faces along x (side 0) or y about corners are multiplied, shape (n, lines across, faces)."""
    field = _Field(found)
    points = [nodes[side][:, None, :], nodes[1 - side][:, 1:-1, None]]
    faces = [0.5 * (a[:, 1:] + a[:, :-1]) for a in (nodes[side], nodes[1 - side])]
    t, ends = faces[0][:, None, :], faces[1][:, :, None]
    turn = (lambda along, across: (along, across)) if side == 0 else (lambda along, across: (across, along))
    with np.errstate(divide="ignore", invalid="ignore"):  # of points that no grid has
        slope = np.diff(field.s(*turn(*points)), axis=2) / np.diff(points[0], axis=2)
        flow = (1 - 2 * side) * np.diff(field.conjugate(*turn(t, ends)), axis=1) / np.diff(ends, axis=1)
    low, high = np.minimum(ends[:, :-1], ends[:, 1:]), np.maximum(ends[:, :-1], ends[:, 1:])
    share = np.where(t < 0.0, np.clip(-low, 0.0, None) - np.clip(-high, 0.0, None), 0.0) / np.where(high > low, high - low, 1.0)
    K = 1.0 + (field.kappa - 1.0) * share
    far = np.maximum(*(np.abs(a) / found.reach[k][:, None, None] for a, k in ((t, side), (points[1], 1 - side))))
    with np.errstate(invalid="ignore"):
        ratio = ratios(flow, slope * K, (SMALL * field.steep(*turn(t, points[1])) * K) ** 2, far)
    return np.where(np.isfinite(np.real(ratio)), ratio, 1.0)


class _Field:
    """s about corners, at places T, S in x and y from them and outwards, m, shape (n, ...)."""

    def __init__(self, found: Corners):
        self.dry = found.dry[:, None, None]
        self.kappa = kappa = np.where(found.dry, 1.0, (found.inside / found.outside) ** 3)[:, None, None]
        deep = np.real(kappa) >= 1.0
        tangent = np.where(deep, (kappa + 3.0) / (3.0 * kappa + 1.0), (3.0 * kappa + 1.0) / (kappa + 3.0)) ** 0.5
        self.power = power = np.where(self.dry, 2.0 / 3.0, 4.0 / np.pi * np.arctan(tangent))
        self.turned = np.where(deep, 0.0, 0.5 * np.pi)
        A = np.sin(0.25 * np.pi * power) / np.sin(0.75 * np.pi * power) * np.where(deep, -kappa, 1.0)
        self.A = np.where(self.dry, 1.0, A)

    def s(self, T: Array, S: Array) -> Array:
        size, angle, _ = self._polar(T, S)
        return size * np.cos(angle)

    def conjugate(self, T: Array, S: Array) -> Array:
        """What flows between two places is its difference."""
        size, angle, inside = self._polar(T, S)
        return np.where(inside, self.kappa, 1.0) * size * np.sin(angle)

    def steep(self, T: Array, S: Array) -> Array:
        """The size of the slope of s; as if the film were full inside too, for faces there are not changed."""
        return self.power * np.hypot(T, S) ** (self.power - 1.0) * np.where((T < 0.0) & (S < 0.0), 1.0, self.A)

    def _polar(self, T: Array, S: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Radius^lambda times the amplitude, the angle, and what lies inside."""
        phi = (np.arctan2(S, T) + 1.75 * np.pi) % (2.0 * np.pi) - np.pi
        inside = np.abs(phi) < 0.25 * np.pi - 1e-9
        omega = phi - np.copysign(np.pi, phi)
        angle = self.power * np.where(inside, phi, omega) + np.where(inside, -self.turned, self.turned)
        radius = np.maximum(np.hypot(T, S), 1e-300)  # 0 to a complex power is none
        return radius**self.power * np.where(inside, np.where(self.dry, 0.0, 1.0), self.A), angle, inside
