"""Faces that a curved edge of the film cuts: round dimples, whose rims no straight grid line can follow.

Between two points the film is told by the line between them, on which it resists in series (`edges`): a rim is where that line
crosses it. That is right where the film is full. Where a dimple is cavitated its rim is where the pressure
ends: only the film before it resists, and carries, and what lies behind would be a length that varies with the rim's place in
the cell, an error of first order. A fixed coefficient cannot know; the answer does. So a problem with such faces is solved, its
cavities are looked at, and it is solved once more, from the answer on, with the cut faces made for them
(`drivers.rims`). Where a film reforms before a rim it is full for but a cell or so, and the pressure in it runs along the rim:
faces across the flow lead there as layers do that lie so. Either problem is of the one form, with positive conductances that
both cells share and Couette flows that leave one cell and enter the next: its solution is unique, and certificate and bands
hold as ever (docs/accuracy.md).
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.parallel import Array
from ..grid import Grid
from .edges import pairs

Flags = NDArray[np.bool_]
Shape = Callable[[Array, Array], Array]
LOOKS = 32  # between the two points of a face
TOGETHER = 2000  # faces that are looked at together, in cache
REACH, FAR = 1.5, 4.0  # cells from a slanted edge to where it changes faces; that far, by both widths, it is looked for
STEP, STEEP = 1e-3, 0.1  # of a cell, for the distance's slopes; the least 2 a b of the edge's normal (a, b) in cells
THIN = 1 / 3  # of the way from the thinnest to the thickest film of a face: what is below is the film outside a recess


def cut_faces(
    film: Shape,
    rims: Sequence[Shape],
    nodes: Array,
    lines: Array,
    widths: Array,
    cavity: Flags,
    along_flow: bool,
    period: float = 0.0,
) -> tuple[Flags, Array, Array]:
    """Which faces along t a rim cuts, or a slanted edge changes, shape (lines, faces); C and H of those (`edges.face_film`).

    Parameters
    ----------
    film : h(t, s) in m. rims : distances to edges at (t, s), m, negative inside. nodes : t of the points, one more than faces.
    lines : s of the lines of points. widths : of their cells, m.
    cavity : whether the points are cavitated, shape (lines, nodes); of faces across the flow with the line before the first.
    along_flow : whether the flow goes to larger t. period : round a ring, whose last point lies before the first.
    """
    a, d = nodes[:-1], np.diff(nodes)
    d = np.where(d < 0.0, d + period, d)
    cut = np.zeros((lines.size, d.size), dtype=bool)
    oblique = np.zeros(cut.shape)
    if not along_flow:
        reforms, cavity = _reforms(cavity), cavity[1:]
    beside = []
    for rim in rims:
        if depth := depth_of(rim):
            beside.append((depth, *_beside(rim, a + 0.5 * d, d, lines, widths, along_flow)))
            by_rim = np.abs(beside[-1][1]) < REACH
        else:
            by_rim = np.abs(rim((a + 0.5 * d)[None, :], lines[:, None])) <= 0.5 * d
        cut |= by_rim
        if not along_flow:
            j, i = np.nonzero(by_rim & reforms & (d > 0.0))
            oblique[j, i] = 1.0 - _slope(rim, a[i] + 0.5 * d[i], d[i], lines[j]) ** 2
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
        part = oblique[j[some], at]
        if (k := np.flatnonzero(part)).size:
            cubes[some.start + k] += part[k] * (np.mean(h[1:-1, k] ** 3, axis=0) - cubes[some.start + k])
    for depth, away, length in beside:
        more, slope = _layer(depth, away[j, i], length[j, i], film(a[i] + 0.5 * d[i], lines[j]))
        cubes, films = cubes + more, films + slope * more
    return cut, cubes, films


def _reforms(cavity: Flags) -> Flags:
    """Which faces across the flow lie where a film has just reformed: both points full, one a cell before them cavitated."""
    dry = cavity[:, :-1] | cavity[:, 1:]
    return dry[:-1] & ~dry[1:]


def _slope(rim: Shape, t: Array, d: Array, s: Array) -> Array:
    """By how much the distance grows with a length t: the normal's part along it, at most 1 in size."""
    return np.clip(np.real(rim(t + STEP * d, s) - rim(t - STEP * d, s)) / (2.0 * STEP * d), -1.0, 1.0)


def depth_of(rim: Any) -> float:
    """By how much the film jumps at a slanted edge, m; 0 at other rims, and where a film has any depth there."""
    rim = rim.args[0] if isinstance(rim, partial) else rim
    return depth_of(rim.film) if hasattr(rim, "film") else float(getattr(rim, "depth", 0.0))


def _beside(rim: Shape, t: Array, d: Array, lines: Array, widths: Array, along_flow: bool) -> tuple[Array, Array]:
    """How far faces lie from a slanted edge, in cells, negative inside; and the length by which `_layer` conducts, in cells."""
    t, s = np.broadcast_arrays(t[None, :], lines[:, None])
    away, length = np.full(t.shape, np.inf), np.zeros(t.shape)
    found = rim(t, s)
    j, i = np.nonzero(np.abs(found) < FAR * (d[None, :] + widths[:, None]))
    t, s, d, w = t[j, i], s[j, i], d[i], widths[j]
    by_t, by_s = rim(t + STEP * d, s) - rim(t - STEP * d, s), rim(t, s + STEP * w) - rim(t, s - STEP * w)
    with np.errstate(invalid="ignore"):
        by_t, by_s = (np.abs(np.nan_to_num(a, nan=0.0, posinf=0.0, neginf=0.0)) / (2.0 * STEP) for a in (by_t, by_s))
    # y is a length, x in a sector is not: the normal's parts by the former.
    n_y = np.minimum((by_s / w if along_flow else by_t / d) ** 2, 1.0)
    of_t, of_s = (n_y, 1.0 - n_y) if along_flow else (1.0 - n_y, n_y)
    cell = np.hypot(by_t, by_s)
    cell = np.where(cell > 0.0, cell, np.inf)
    steep = np.maximum(2.0 * by_t * by_s / cell**2, STEEP)
    away[j, i], length[j, i] = found[j, i] / cell, (of_t * by_t + of_s * by_s) / cell * steep**-0.6
    return away, length


def _layer(depth: float, away: Array, length: Array, h: Array) -> tuple[Array, Array]:
    """What a slanted edge adds to C of the faces about a cell away from it, and dH/dC.

    Resistances in series on the lines of points are exact for what flows across an edge, and lead too little along it: by
    as much, to 3 % of a cell of the thick side on square cells, as networks of such faces were found to (docs/accuracy.md).
    The thick side gains it, and the thin one loses what leaves the flow across as it was. H is linear in C.
    """
    other = np.where(away < 0.0, h - depth, h + depth)
    K, K_other = h**3, other**3
    jump = (K - K_other) / (K + K_other)
    part = 0.715 * length * jump * (0.46 + 0.22 * np.where(away < 0.0, jump, -jump) ** 3)
    hat = np.maximum(0.0, 2.0 - 4.0 * np.abs(np.abs(away) - 1.0))
    return part * hat * K * K / (K + K_other), 1.0 / (h * h + h * other + other * other)


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
    cut, cut_cubes, cut_films = cut_faces(
        film, rims, nodes, grid.y[:, 0], _widths(grid, 1), dry_of(grid, cavity)[1:-1], True, period
    )
    cubes, films = np.array(cubes), np.array(films)
    cubes[cut], films[cut] = cut_cubes, cut_films
    return cubes, films


def rims_across_y(grid: Grid, film: Shape, rims: Sequence[Shape], cavity: Array | None, cubes: Array, period: float) -> Array:
    """The same for C of the y faces. Collective."""
    nodes, _ = grid.nodes_and_faces(1)
    turned = [partial(_swapped, rim) for rim in (film, *rims)]
    cut, cut_cubes, _ = cut_faces(
        turned[0], turned[1:], nodes, grid.x[0], _widths(grid, 0), across_flow(grid, dry_of(grid, cavity)), False, period
    )
    cubes = np.array(cubes)
    cubes.T[cut] = cut_cubes
    return cubes


def made_along(
    film: Any, nodes: Array, lines: Array, widths: Array, dry: Flags, of: Sequence[Array], period: float, across: bool = False
) -> None:
    """Put C, or C and H, of the cut faces of some lines, shape (lines, faces), in the places of those of whole films.

    film : with its `rims` (`edges.Around`). dry : whether the lines' nodes are cavitated, as `cut_faces` has it.
    across : faces along y, lines of x.
    """
    shapes = [partial(_swapped, one) if across else one for one in (film, *film.rims)]
    cut, *found = cut_faces(shapes[0], shapes[1:], nodes, lines, widths, dry, not across, period)
    for a, values in zip(of, found, strict=False):
        a[cut] = values


def _swapped(shape: Shape, t: Array, s: Array) -> Array:
    return shape(s, t)


def _widths(grid: Grid, side: int) -> Array:
    return 0.5 * pairs(grid.steps(side)).sum(axis=0)


def dry_of(grid: Grid, cavity: Array | None) -> Flags:
    return grid.ghosted(np.zeros(grid.local_size) if cavity is None else cavity, outside=0.0) > 0.0


def across_flow(grid: Grid, dry: Flags) -> Flags:
    """Of the points of a frame those that `cut_faces` asks for across the flow: line by line, the one before the first too."""
    before = dry[:, -2:-1] & grid.periodic[0]
    return np.concatenate([before, dry[:, 1:-1]], axis=1).T
