"""Faces around the corners of a held rectangle, where the film goes round by 270 degrees.

There the pressure is P + a s + ..., s = r^(2/3) sin(2 theta/3), which a scheme that takes slopes for differences follows
with order 4/3 alone. What s drives through a face is known, the difference of Re z^(2/3) between the face's ends; so is the
difference of s between its two points. Conductances times the ratio of the two have s for a solution. The ratios are
positive, and both cells of a face share them: A stays the M-matrix that it was (docs/accuracy.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from ...base.parallel import Array
from ..grid import Grid

if TYPE_CHECKING:
    from .supplies import Region

CELLS = 8  # about a corner: further away s is nearly straight between two points
BLEND = 8  # the power by which ratios become 1 towards the last of these cells, so that moved corners see no steps
SMALL, LEAST = 0.05, 0.25  # part of the gradient: a slope below it says little of its ratio; and the least ratio
ON = 1e-6  # of a spacing: so near a corner a point lies on it


def around_corners(grid: Grid, regions: Sequence[Region]) -> Array:
    """By what the owned conductances to the west, east, south and north are multiplied, shape (4, ny, nx).

    1 but around corners of rectangles that are points of the grid, inside the film: half-way to the next corner at most.
    """
    edges = [(one.edges("x"), one.edges("y")) for one in regions] if grid.dim == 2 else []
    signs = [*product((-1.0, 1.0), repeat=2)]
    corners = [found for x, y in edges if x and y for found in zip(product(x, y), signs, strict=True)]
    if not corners:
        return np.ones((4, 1, 1))
    (ny, nx), first = grid.box, (grid.x_start, grid.y_start)
    out = np.ones((ny, nx + 1)), np.ones((nx, ny + 1))  # lines across, faces along
    around = grid.periodic
    nodes = [places(grid, side) for side in (0, 1)]
    for at, outward in corners:
        away = [np.array([abs(at[side] - other[side]) for other, _ in corners]) for side in (0, 1)]
        away = [np.minimum(d, L - d) if ring else d for d, L, ring in zip(away, grid.lengths, around, strict=True)]
        room = min(0.5 * d for d in np.hypot(*away) if d > 0.0)
        for side in (0, 1):
            if not around[side]:
                room = min(room, at[side] - grid.origin[side], grid.origin[side] + grid.lengths[side] - at[side])
        off = [np.min(np.abs(a - t)) / h for a, t, h in zip(nodes, at, grid.spacing, strict=True)]
        reach = [min(room, CELLS * h) for h in grid.spacing]
        near = [np.flatnonzero(np.abs(a[1:-1] - t) < r) for a, t, r in zip(nodes, at, reach, strict=True)]
        if max(off) > ON or not all(k.size for k in near):  # none too where a corner is as near a side as rounding
            continue
        # In lengths, from the corner outwards: these points and those before and behind them, and the faces between.
        scale = outward[0] * float(grid.stretch(np.array(at[1]))), outward[1]
        points = [(a[k[0] : k[-1] + 3] - t) * m for a, k, t, m in zip(nodes, near, at, scale, strict=True)]
        faces = [0.5 * (a[1:] + a[:-1]) for a in points]
        for side, across in ((0, 1), (1, 0)):
            T, t, S, s = points[side], faces[side], points[across][1:-1, None], faces[across][:, None]
            slope = np.diff(_power(T, S).imag) / np.diff(T)
            flow = -np.diff(_power(t, s).real, axis=0) / np.diff(s, axis=0)
            least = (SMALL * 2.0 / 3.0) ** 2 * np.hypot(t, S) ** (-2.0 / 3.0)
            far = np.maximum(np.abs(t / scale[side]) / reach[side], np.abs(S / scale[across]) / reach[across])
            ratio = ratios(flow, slope, least, far)
            n, last = grid.shape[side], near[side][-1] + 1
            lines, numbers = near[across] % grid.shape[across], np.append(near[side], last)
            if around[side]:
                numbers = np.append(numbers % n, n)  # the last face is the first one
                joint = np.flatnonzero(numbers[:-1] == 0)
                ratio = np.concatenate([ratio, ratio[:, joint] if joint.size else np.ones((lines.size, 1))], axis=1)
            else:  # what a side's face lets through is in c already
                ratio[:, (numbers == 0) | (numbers == n)] = 1.0
            j, i = lines - first[across], numbers - first[side]
            rows, columns = ((k >= 0) & (k < size) for k, size in zip((j, i), out[side].shape, strict=True))
            out[side][np.ix_(j[rows], i[columns])] *= ratio[np.ix_(rows, columns)]
    x, y = out[0], out[1].T
    return np.stack([x[:, :-1], x[:, 1:], y[:-1], y[1:]])


def ratios(flow: Array, driven: Array, least: Array, far: Array) -> Array:
    """What flows through faces over what the scheme drives, which `least` keeps from vanishing; 1 from `far` = 1 on."""
    ratio = (flow * driven + least) / (driven * driven + least)
    ratio = np.where(np.real(ratio) < LEAST, LEAST, ratio)
    return 1.0 + (ratio - 1.0) * np.maximum(1.0 - far**BLEND, 0.0)


def places(grid: Grid, side: int) -> Array:
    """Coordinates of all points of a side, m, between their neighbours; round a ring of three turns."""
    places = grid.with_neighbours(side)
    if not grid.periodic[side]:
        return places
    turns = [places[1:-1] + turn * grid.lengths[side] for turn in (-1, 0, 1)]
    return np.concatenate([places[:1] - grid.lengths[side], *turns, places[-1:] + grid.lengths[side]])


def _power(T: Array, S: Array) -> Array:
    """z^(2/3), z counted round the film from one edge of the rectangle T < 0, S < 0 to the other; 0 within."""
    turned = (np.arctan2(S, T) + 0.5 * np.pi) % (2.0 * np.pi)
    return np.where(turned > 1.5 * np.pi + 1e-9, 0.0, np.hypot(T, S) ** (2.0 / 3.0) * np.exp(1j * (2.0 / 3.0) * turned))
