"""The films of a line between what holds a pressure: its sides and supplies (`supplies`), each solved by itself (`line`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ...base.parallel import Array
from ..grid import Grid
from .integrals import SAME, LineIntegrals
from .supplies import NEAREST, Patch, Supply

SIDE = -1  # in the place of a supply's number


@dataclass(frozen=True)
class Span:
    """A film between two ends: from a side, or the edge of a supply, to the next.

    Attributes
    ----------
    line : with the two ends and the points between them. west, east : numbers of the supplies there, or SIDE. faces : of the
        line of all points, those between these. parts : what `line.parts` is to the scheme: an end next to a point is at least
        a part NEAREST of a spacing from it.
    """

    line: LineIntegrals
    west: int
    east: int
    faces: NDArray[np.int64]
    parts: Array

    @property
    def owned(self) -> NDArray[np.int64]:
        """Numbers of its points, behind all of its faces but the last."""
        return self.faces[:-1]

    def lifted(self, by: complex) -> Span:
        line = self.line.lifted(by)
        return replace(self, line=line, parts=line.parts * (self.parts / self.line.parts))


def whole(line: LineIntegrals) -> tuple[Span, ...]:
    """The only one of a line without supplies."""
    return (Span(line, SIDE, SIDE, np.arange(line.points.size - 1), line.parts),)


def supplied(line: LineIntegrals, grid: Grid, supplies: Sequence[Supply], owner: NDArray[np.int64]) -> tuple[Span, ...] | None:
    """Those of a line with supplies, on every rank; owner : the number of the supply at each of all points, or -1.

    None where a supply is no `Patch`, or reaches right round or as far as another one, whose all its points may be then.
    """
    start, L, ring = grid.origin[0], grid.lengths[0], bool(grid.periodic[0])
    regions = [one.region for one in supplies if isinstance(one.region, Patch)]
    if len(regions) < len(supplies) or not all(one.half_x < 0.5 * L and (owner == k).any() for k, one in enumerate(regions)):
        return None
    ends = sorted((x - one.half_x, x + one.half_x, k) for k, one in enumerate(regions) for x in [one.x % L if ring else one.x])
    around = (ends[0][0] + L, ends[0][1] + L, ends[0][2])
    ends = [*ends, around] if ring else [(start, start, SIDE), *ends, (start + L, start + L, SIDE)]
    (points,), n, found = grid.lines, grid.shape[0], []

    def held(number: int) -> NDArray[np.int64]:
        """A supply's points, in the order in which one meets them."""
        mine = np.flatnonzero(owner == number)
        return mine[np.argsort((points[mine] - regions[number].x - 0.5 * L) % L)] if ring else mine

    for (_, a, west), (b, _, east) in pairwise(ends):
        if SIDE in (west, east) and b - a <= SAME * L:  # a supply that reaches the side
            continue
        if not b - a > SAME * L:
            return None
        first = held(west)[-1] + 1 if west != SIDE else 0
        last = held(east)[0] if east != SIDE else n
        count = (last - first) % n if ring else last - first
        faces = first + np.arange(count + 1)
        inside = points[faces[:-1] % n]
        inside = inside + L * np.ceil((a - inside) / L) if ring else inside
        if not (np.diff([a, *inside, b]) > 0.0).all():
            return None
        own = LineIntegrals(line.film, np.array([a, *inside, b]), [*line.edges, start + L])
        own.ring = line.ring
        parts, least = own.parts.copy(), NEAREST * grid.spacing[0]
        parts[:, [0, -1]] *= np.maximum(least / np.diff(own.points)[[0, -1]], 1.0)
        found.append(Span(own, west, east, faces % n if ring else faces, parts))
    return tuple(found)
