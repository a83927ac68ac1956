"""Faces that a curved edge of the film cuts: round dimples, whose rims no straight grid line can follow.

Between two points the film is told by the line between them, on which it resists in series (`edges`): a rim is where that line
crosses it. That is right where the film is full. Where a dimple is cavitated its rim is where the pressure
ends: only the film before it resists, and carries, and what lies behind would be a length that varies with the rim's place in
the cell, an error of first order. A fixed coefficient cannot know; the answer does. So a problem with such faces is solved, its
cavities are looked at, and it is solved once more, from the answer on, with the cut faces made for them
(`drivers.rims`). Either problem is of the one form, with positive conductances that both cells share and Couette
flows that leave one cell and enter the next: its solution is unique, and certificate and bands hold as ever (docs/accuracy.md).
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.parallel import Array
from ..grid import Grid

Flags = NDArray[np.bool_]
Shape = Callable[[Array, Array], Array]
LOOKS = 32  # between the two points of a face
TOGETHER = 2000  # faces that are looked at together, in cache
THIN = 1 / 3  # of the way from the thinnest to the thickest film of a face: what is below is the film outside a recess


def cut_faces(
    film: Shape, rims: Sequence[Shape], nodes: Array, lines: Array, cavity: Flags, along_flow: bool, period: float = 0.0
) -> tuple[Flags, Array, Array]:
    """Which faces along t a rim cuts, shape (lines, faces), and C and H of those (`edges.face_film`).

    Parameters
    ----------
    film : h(t, s) in m. rims : distances to edges at (t, s), m, negative inside. nodes : t of the points, one more than faces.
    lines : s of the lines of points. cavity : whether the points are cavitated, shape (lines, nodes).
    along_flow : whether the flow goes to larger t. period : round a ring, whose last point lies before the first.
    """
    a, d = nodes[:-1], np.diff(nodes)
    d = np.where(d < 0.0, d + period, d)
    cut = np.zeros((lines.size, d.size), dtype=bool)
    for rim in rims:
        cut |= np.abs(rim((a + 0.5 * d)[None, :], lines[:, None])) <= 0.5 * d
    cut &= d > 0.0
    kind = np.asarray(film(nodes[:1], lines[:1])).dtype  # complex, where a derivative is asked for
    cubes, films = np.zeros((2, np.count_nonzero(cut)), dtype=kind)
    j, i = np.nonzero(cut)
    places = np.array([0.0, *(np.arange(LOOKS) + 0.5) / LOOKS, 1.0])[:, None]  # the points too
    for some in (slice(k, k + TOGETHER) for k in range(0, j.size, TOGETHER)):
        at, line = i[some], lines[j[some]]
        h = np.broadcast_to(film(a[at] + d[at] * places, line), (places.size, at.size))
        resists = _resists(np.real(h), cavity[j[some], at], cavity[j[some], at + 1], along_flow)
        inverse = 1.0 / h[1:-1]
        drag = np.where(resists[1:-1], inverse * inverse, 0.0)
        resistance = np.mean(drag * inverse, axis=0)
        cubes[some], films[some] = 1.0 / resistance, np.mean(drag, axis=0) / resistance
    return cut, cubes, films


def _resists(h: Array, dry_first: Flags, dry_last: Flags, along_flow: bool) -> Flags:
    """Which part of faces resists, from the film at their looks, shape (looks, faces): before a cavity the thin film alone.

    dry_first, dry_last : whether the points at their ends, the first and last looks, are cavitated.
    """
    thinnest, thickest = h.min(axis=0), h.max(axis=0)
    thin = h <= thinnest + THIN * (thickest - thinnest)
    first, last = ~thin[0], ~thin[-1]  # whether the points lie in the recess
    void = np.where(first == last, dry_first & dry_last, np.where(last, dry_last, dry_first & np.bool_(not along_flow)))
    if along_flow:  # the film before the first place where it becomes thick
        thin = np.logical_and.accumulate(thin, axis=0)
        void &= last
    return thin | ~(void & thin[1:-1].any(axis=0))  # a rim on a point leaves no look before it


def rims_across_x(
    grid: Grid,
    film: Shape,
    rims: Sequence[Shape],
    cavity: Array | None,
    cubes: Array,
    films: Array,
    period: float,
) -> tuple[Array, Array]:
    """C and H of the x faces, those that rims cut made anew; cavity: 1 at the owned points that are cavitated. Collective."""
    nodes, _ = grid.nodes_and_faces(0)
    cut, cut_cubes, cut_films = cut_faces(film, rims, nodes, grid.y[:, 0], dry_of(grid, cavity)[1:-1], True, period)
    cubes, films = np.array(cubes), np.array(films)
    cubes[cut], films[cut] = cut_cubes, cut_films
    return cubes, films


def rims_across_y(grid: Grid, film: Shape, rims: Sequence[Shape], cavity: Array | None, cubes: Array, period: float) -> Array:
    """The same for C of the y faces. Collective."""
    nodes, _ = grid.nodes_and_faces(1)
    turned = [partial(_swapped, rim) for rim in (film, *rims)]
    cut, cut_cubes, _ = cut_faces(turned[0], turned[1:], nodes, grid.x[0], dry_of(grid, cavity)[:, 1:-1].T, False, period)
    cubes = np.array(cubes)
    cubes.T[cut] = cut_cubes
    return cubes


def made_along(
    film: Any, nodes: Array, lines: Array, dry: Flags, of: Sequence[Array], period: float, across: bool = False
) -> None:
    """Put C, or C and H, of the cut faces of some lines, shape (lines, faces), in the places of those of whole films.

    film : with its `rims` (`edges.Around`). dry : whether the lines' nodes are cavitated. across : faces along y, lines of x.
    """
    shapes = [partial(_swapped, one) if across else one for one in (film, *film.rims)]
    cut, *found = cut_faces(shapes[0], shapes[1:], nodes, lines, dry, not across, period)
    for a, values in zip(of, found, strict=False):
        a[cut] = values


def _swapped(shape: Shape, t: Array, s: Array) -> Array:
    return shape(s, t)


def dry_of(grid: Grid, cavity: Array | None) -> Flags:
    return grid.ghosted(np.zeros(grid.local_size) if cavity is None else cavity, outside=0.0) > 0.0
