"""Films that jump inside a cell: the conductance and the Couette film of its faces, so that an edge may lie anywhere.

Between two neighbouring points a distance d apart a film h(t) that is full carries, by p' = 6 mu (U h - Q)/h^3 with one Q,

    Q = U H - C (p_2 - p_1)/(6 mu d),    C = d / Int h^-3 dt,    H = Int h^-2 dt / Int h^-3 dt :

resistances in series. Where h does not jump, C = h^3 and H = h in the middle, to second order, and that is what is taken.
Across the flow the pieces of a face stand side by side: their C and H are averaged by their lengths. (Where a film ruptures at
an edge inside a cell, only the part before it resists, which the coefficients cannot know: that error is of first order.)
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.parallel import Array
from ..grid import Grid

GAUSS = (0.5 - 0.5 / np.sqrt(3.0), 0.5 + 0.5 / np.sqrt(3.0))
MARGIN = 1e-9  # of a spacing: an edge so near a point, or a face's end, is on it
SEAM, SAME = 1e-12, 1e-9  # of a ring: how far before its end it is looked at; and by what its ends may differ where it closes
LOOKS = 65  # places along a seam


def marks_of(film: Any) -> tuple[float, ...]:
    """x (m) where a film, or a part of one, jumps or has a kink, as far as it tells: `marks`, `breakpoints` or `jumps`."""
    for name, axis in (("marks", ()), ("breakpoints", ()), ("jumps", ("x",))):
        tell = getattr(film, name, None)
        if tell is not None:
            return tuple(tell(*axis))
    return ()


def jumps_of(film: Any, axis: str) -> tuple[float, ...]:
    """x or y (m) of the straight lines across which a film jumps, as far as it, or its parts, tell."""
    return _told(film, "jumps", axis)


def kinks_of(film: Any, axis: str) -> tuple[float, ...]:
    """x or y (m) of the straight lines across which a film's slope jumps, as far as it, or its parts, tell."""
    return _told(film, "kinks", axis)


def corners_of(film: Any) -> Array:
    """Corners of rectangles in which a film, or a part of one, is thicker or thinner, as far as it tells, shape (n, 4): x and y
    (m), and the signs of the way out of them."""
    return np.asarray(getattr(film, "corners", ()), dtype=float).reshape(-1, 4)


def rectangles(x: Any, y: Any) -> Array:
    """`corners_of` rectangles from x[0] to x[1] and y[0] to y[1], m: pairs of numbers, or of arrays that broadcast."""
    ways = [(i, j) for i in (0, 1) for j in (0, 1)]
    found = [np.broadcast_arrays(x[i], y[j], 2.0 * i - 1.0, 2.0 * j - 1.0) for i, j in ways]
    return np.concatenate([np.stack([a.ravel() for a in one], axis=1) for one in found])


def _told(film: Any, name: str, axis: str) -> tuple[float, ...]:
    tell = getattr(film, name, None)
    return tuple(tell(axis)) if tell else tuple(t for part in getattr(film, "parts", ()) for t in _told(part, name, axis))


def oblique(film: Any) -> list[Any]:
    """Parts of a film with edges that run across the lines of points, by which coefficients change in steps; all 1 m deep."""
    inside = (*getattr(film, "parts", ()), *filter(None, [getattr(film, "film", None)]))
    own = [replace(film, depth=1.0)] if getattr(film, "oblique", False) else []
    return own + [one for part in inside for one in oblique(part)]


def level(film: Any) -> bool:
    """Whether a film is the same along y from jump to jump, as far as it tells."""
    return bool(getattr(film, "level", False))


def one_line(film: Any) -> bool:
    """Whether all its lines along x are the same, as far as it tells."""
    return level(film) and not jumps_of(film, "y")


def pairs(a: Array) -> Array:
    """Each of them but the last with its next one, shape (2, a.size - 1)."""
    return np.array([a[:-1], a[1:]])


@dataclass(frozen=True)
class Around:
    """A film on a grid, that goes on beyond periodic sides: what lies behind one is what lies within the other, edges too."""

    film: Callable[[Array, Array], Array]
    grid: Grid

    def __call__(self, x: Array, y: Array) -> Array:
        """The film at x and y, which broadcast; of a film that is the same along y the one line there is."""
        return self.film(*self._inside(x, y[:1] if self.one_line and x.shape[:-1] == (1,) else y))

    @cached_property
    def one_line(self) -> bool:
        return one_line(self.film)

    def _inside(self, *at: Array) -> list[Array]:
        out = list(at)
        for k, (length, start) in enumerate(zip(self.grid.lengths, self.grid.origin, strict=False)):
            if self.grid.periodic[k]:
                # On a side counts as inside, also by rounding.
                beyond = np.round((at[k] - start - 0.5 * length) / (length * (1.0 + MARGIN)))
                out[k] = np.where(beyond, at[k] - beyond * length, np.clip(at[k], start, start + length))
        return out

    def jumps(self, axis: str) -> Sequence[float]:
        found, k = jumps_of(self.film, axis), "xy".index(axis)
        around = k < self.grid.dim and self.grid.periodic[k]
        return [t + m * self.grid.lengths[k] for t in found for m in (-1, 0, 1)] if around else found

    def edges(self, side: int) -> Sequence[float]:
        """Its edges in x (side 0) or y, m; round a ring the seam is one too where the film's ends differ."""
        return self._edges[side]

    @cached_property
    def _edges(self) -> list[Sequence[float]]:
        return [self._edges_of(side) for side in range(2)]

    def _edges_of(self, side: int) -> Sequence[float]:
        found = self.jumps("xy"[side])
        if not (turn := self.period(side)):
            return found
        grid, start = self.grid, self.grid.origin[side]
        places = np.linspace(0.0, 1.0, LOOKS)[:, None]  # on any grid and rank the same ones
        other = grid.origin[1 - side] + grid.lengths[1 - side] * places if grid.dim == 2 else np.zeros((1, 1))
        ends = np.array([[[start]], [[start + turn * (1.0 - SEAM)]]])
        a, b = (self(at, other) if side == 0 else self(other.T, at) for at in ends)
        return [*found, start, start + turn] if np.max(np.abs(b - a)) > SAME * np.max(np.abs(a)) else found

    def period(self, side: int) -> float:
        """Length of a side that is a ring, m; 0 of another."""
        return self.grid.lengths[side] if side < self.grid.dim and self.grid.periodic[side] else 0.0

    @property
    def level(self) -> bool:
        return level(self.film)

    @property
    def corners(self) -> Array:
        return corners_of(self.film)

    @property
    def rims(self) -> Sequence[Any]:
        return [replace(self, film=rim) for rim in getattr(self.film, "rims", ())]


def face_film(
    film: Callable[[Array, Array], Array],
    nodes: Array,
    faces: Array,
    lines: Array,
    jumps: Sequence[float],
    jumps_across: Sequence[float],
    steps: Array,
    period: float = 0.0,
) -> tuple[Array, Array]:
    """C and H of all faces along t, of the lines at s; shape (lines, faces).

    Parameters
    ----------
    film : h(t, s) in m for arrays that broadcast. nodes : t of the points before and behind each face, shape (2, faces), m.
    faces : t of the faces. lines : s of the lines of points. steps : distances before and behind each of them, half-way along
        which cells end, shape (2, lines).
    jumps, jumps_across : t and s of the film's edges, m. period : round a ring, whose last point lies before the first.
    """
    columns, pieces = edges_inside(nodes[0], nodes[1], jumps, period)

    def along(s: Array) -> tuple[Array, Array]:
        h = np.broadcast_to(film(faces[None, :], s[:, None]), (s.size, faces.size))
        cubes, films = h**3, np.array(h)
        if columns.size:
            resistance = drag = 0.0
            for a, b in pairwise(pieces):
                for part in GAUSS:
                    piece = np.broadcast_to(film((a + part * (b - a))[None, :], s[:, None]), (s.size, columns.size))
                    resistance = resistance + 0.5 * (b - a) / piece**3
                    drag = drag + 0.5 * (b - a) / piece**2
            cubes[:, columns] = (pieces[-1] - pieces[0]) / resistance
            films[:, columns] = drag / resistance
        return cubes, films

    cubes, films = along(lines)
    rows, strips = edges_inside(lines - 0.5 * steps[0], lines + 0.5 * steps[1], jumps_across)
    if rows.size:
        cubes[rows] = films[rows] = 0.0
        for a, b in pairwise(strips):
            share = ((b - a) / (0.5 * (steps[0] + steps[1])[rows]))[:, None]
            part_cubes, part_films = along(0.5 * (a + b))
            cubes[rows] += share * part_cubes
            films[rows] += share * part_films
    return cubes, films


def strips(
    film: Callable[[Array, Array], Array], x: Array, lines: Array, steps: Array, jumps: Sequence[float]
) -> tuple[NDArray[np.int64], Array, Array]:
    """Lines whose cells an edge y = const divides, and the film at x, m, in their strips: shape (strips, such lines, x.size).

    steps : distances before and behind each line, shape (2, lines).
    Returns the numbers of the lines, the films, and the strips' shares of a cell's width, shape (strips, such lines, 1).
    """
    rows, ends = edges_inside(lines - 0.5 * steps[0], lines + 0.5 * steps[1], jumps)
    parts = list(pairwise(ends))
    shares = np.array([(b - a) / (0.5 * (steps[0] + steps[1])[rows]) for a, b in parts])
    films = [np.broadcast_to(film(x[None, :], 0.5 * (a + b)[:, None]), (rows.size, x.size)) for a, b in parts]
    return rows, np.array(films), shares[..., None]


def edges_inside(start: Array, end: Array, jumps: Sequence[float], period: float = 0.0) -> tuple[NDArray[np.int64], Array]:
    """Numbers of the intervals with jumps inside, and their ends with the jumps in between, one row a place.

    Shape (most jumps in an interval + 2, intervals with jumps); intervals with fewer of them have pieces of no length.
    period : round a ring, of which the last interval ends where the first one begins.
    """
    end = np.where(end < start, end + period, end)
    places = np.unique(np.asarray(jumps, dtype=float))
    margin = MARGIN * (end - start)
    first = np.searchsorted(places, start + margin)
    last = np.searchsorted(places, end - margin)
    found = np.flatnonzero((last > first) & (end > start))
    most = int(np.max(last[found] - first[found], initial=0))
    rows = [start[found]]
    for k in range(most):
        inside = first[found] + k < last[found]
        rows.append(np.where(inside, places[np.minimum(first[found] + k, places.size - 1)], end[found]))
    return found, np.array([*rows, end[found]])
