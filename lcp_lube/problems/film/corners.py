"""Faces around corners, where the film goes round by 270 degrees: of held rectangles, and of recesses and lands (`recesses`).

At the corner of a held rectangle the pressure is P + a s + ..., s = r^(2/3) sin(2 theta/3), which a scheme that takes slopes
for differences follows with order 4/3 alone. What s drives through a face is known, the difference of its conjugate between
the face's ends; so is the difference of s between its two points. Conductances times the ratio of the two have s for a
solution. The ratios are positive, and both cells of a face share them: A stays the M-matrix that it was (docs/accuracy.md).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...base.parallel import Array
from ..grid import Grid

if TYPE_CHECKING:
    from .supplies import Region

CELLS = 8  # about a corner of a supply: further away s is nearly straight between two points
BLEND = 8  # the power by which ratios become 1 towards the last of these cells, so that moved corners see no steps
SMALL, LEAST = 0.05, 0.25  # part of the gradient: a slope below it says little of its ratio; and the least ratio
ON = 1e-6  # of a spacing: so near a corner a point lies on it


class Corners(NamedTuple):
    """Corners on points of a grid, n of them, on every rank the same.

    at : numbers of the point in x and y, shape (2, n). outward : signs of the way out of the rectangle. places : m.
    reach : how far faces along x and y know of it, m. inside, outside : the film there, m. dry : whether a cavity comes up to
        it from inside, or a pressure that is held.
    """

    at: NDArray[np.int64]
    outward: NDArray[np.int64]
    places: Array
    reach: Array
    inside: Array
    outside: Array
    dry: NDArray[np.bool_]


def around_corners(grid: Grid, regions: Sequence[Region]) -> Array:
    """By what the owned conductances to the west, east, south and north are multiplied, shape (4, ny, nx).

    1 but around corners of rectangles that are points of the grid, inside the film: half-way to the next corner at most.
    """
    edges = [(one.edges("x"), one.edges("y")) for one in regions] if grid.dim == 2 else []
    signs = [*product((-1, 1), repeat=2)]
    found = [(*at, *way) for x, y in edges if x and y for at, way in zip(product(x, y), signs, strict=True)]
    if not found:
        return np.ones((4, 1, 1))
    known = np.array(found).T
    away = [np.abs(np.subtract.outer(a, a)) for a in known[:2]]
    around = zip(away, grid.lengths, grid.periodic, strict=True)
    apart = np.hypot(*(np.minimum(d, L - d) if ring else d for d, L, ring in around))
    room = 0.5 * np.min(np.where(apart > 0.0, apart, np.inf), axis=1)
    at, on = np.zeros((2, room.size), dtype=np.int64), np.ones(room.size, dtype=bool)
    for side, a in enumerate(known[:2]):
        at[side], exact = numbers_of(grid, side, a)
        on &= exact
        if not grid.periodic[side]:
            room = np.minimum(room, np.minimum(a - grid.origin[side], grid.origin[side] + grid.lengths[side] - a))
    on &= room > 0.0
    at, outward, places_, stretch = at[:, on], known[2:, on].astype(np.int64), known[:2, on], grid.stretch(known[1, on])
    reach = np.minimum(room[on], CELLS * np.array(grid.spacing)[:, None]) * [stretch, np.ones_like(stretch)]
    alike = np.ones(reach.shape[1])
    corners = Corners(at, outward, places_, reach, alike, alike, alike > 0.0)
    (ny, nx), cells = grid.box, _cells(grid, corners)
    out = np.ones((ny, nx + 1)), np.ones((nx, ny + 1))  # lines across, faces along
    nodes = [window(grid, side, at, outward, places_, cells) for side in (0, 1)]
    for side, k in enumerate(out):
        for face, more, _ in batches_about(grid, side, corners, ratios(corners, side, nodes), k.shape):
            k[face] *= more
        if not grid.periodic[side]:  # what a side's face lets through is in c already
            first, last = ((grid.x_start, grid.x_end), (grid.y_start, grid.y_end))[side]
            k[:, : int(first == 0)] = k[:, k.shape[1] - int(last == grid.shape[side]) :] = 1.0
    x, y = out[0], out[1].T
    return np.stack([x[:, :-1], x[:, 1:], y[:-1], y[1:]])


def _cells(grid: Grid, found: Corners) -> int:
    """How many points before or behind corners lie within their reach, and one more."""
    most = 0
    for side in (0, 1):
        lines, k = places(grid, side), found.at[side] + 1 + grid.shape[side] * grid.periodic[side]
        reach = found.reach[side] / (grid.stretch(found.places[1]) if side == 0 else 1.0)
        ends = np.searchsorted(lines, [lines[k] - reach, lines[k] + reach])
        most = max(most, int(np.max(np.abs(ends - k), initial=0)))
    return most + 1


def numbers_of(grid: Grid, side: int, a: Array) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Numbers of the points nearest behind places in x (side 0) or y, m, and whether they lie there."""
    lines = grid.with_neighbours(side)[1:-1]
    k = np.clip(np.searchsorted(lines, a - ON * grid.spacing[side]), 0, lines.size - 1)
    return k, np.abs(lines[k] - a) <= ON * grid.spacing[side]


def batches_about(
    grid: Grid, side: int, found: Corners, ratio: Array, shape: tuple[int, ...]
) -> Iterator[tuple[tuple[NDArray[np.int64], NDArray[np.int64]], Array, NDArray[np.int64]]]:
    """Lines and faces, the ratios there and the numbers of the corners, in batches that have no face twice.

    ratio : as `ratios` has it. shape : of the owned lines across, and faces along x (side 0) or y.
    """
    cells, n = ratio.shape[2] // 2, grid.shape[side]
    starts = (grid.x_start, grid.y_start)
    corner, j, i = np.nonzero(ratio != 1.0)
    more = ratio[corner, j, i]
    line, face = found.at[1 - side][corner] + j - cells + 1, found.at[side][corner] + i - cells + 1
    line = (line % grid.shape[1 - side] if grid.periodic[1 - side] else line) - starts[1 - side]
    for turn in (-n, 0, n) if grid.periodic[side] else (0,):  # the last face of a ring is the first one
        turned = face + turn - starts[side]
        left = np.flatnonzero((line >= 0) & (line < shape[0]) & (turned >= 0) & (turned < shape[1]))
        while left.size:  # once, but for faces that several corners are near
            once = left[np.unique(line[left] * shape[1] + turned[left], return_index=True)[1]]
            yield (line[once], turned[once]), more[once], corner[once]
            left = np.setdiff1d(left, once, assume_unique=True)


def window(grid: Grid, side: int, at: NDArray[np.int64], outward: NDArray[np.int64], places_: Array, cells: int) -> Array:
    """Coordinates of the points about corners, from them and outwards, m, shape (n, 2 cells + 1)."""
    lines, ring = places(grid, side), grid.periodic[side]
    k = at[side] + 1 + grid.shape[side] * ring
    around = lines[np.clip(k[:, None] + np.arange(-cells, cells + 1), 0, lines.size - 1)] - places_[side][:, None]
    scale = grid.stretch(places_[1]) if side == 0 else 1.0
    return around * np.broadcast_to(outward[side] * scale, k.shape)[:, None]


def ratios(found: Corners, side: int, nodes: list[Array]) -> Array:
    """By what the faces along x (side 0) or y about corners are multiplied, shape (n, lines across, faces)."""
    field = Field(found)
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
        driven, least = slope * K, (SMALL * field.steep(*turn(t, points[1])) * K) ** 2  # which keeps that from vanishing
        ratio = (flow * driven + least) / (driven * driven + least)
        ratio = 1.0 + (np.where(np.real(ratio) < LEAST, LEAST, ratio) - 1.0) * np.maximum(1.0 - far**BLEND, 0.0)
    return np.where(np.isfinite(np.real(ratio)), ratio, 1.0)


def places(grid: Grid, side: int) -> Array:
    """Coordinates of all points of a side, m, between their neighbours; round a ring of three turns."""
    places = grid.with_neighbours(side)
    if not grid.periodic[side]:
        return places
    turns = [places[1:-1] + turn * grid.lengths[side] for turn in (-1, 0, 1)]
    return np.concatenate([places[:1] - grid.lengths[side], *turns, places[-1:] + grid.lengths[side]])


class Field:
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
