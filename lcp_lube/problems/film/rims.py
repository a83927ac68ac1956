"""Faces that a curved edge of the film cuts: round dimples, whose rims no straight grid line can follow.

Between two points the film is told by lines side by side, SIDE_BY_SIDE of them across the width of a face, each with
resistances in series (`edges`). That is right where the film is full. Where a dimple is cavitated its rim is where the pressure
ends: only the film before it resists, and carries, and what lies behind would be a length that varies with the rim's place in
the cell, an error of first order. A fixed coefficient cannot know; the answer does. So a problem with such faces is solved, its
cavities are looked at, and it is solved once more, from the answer on, with the cut faces made for them
(`LubricationProblem.revised`). Either problem is of the one form, with positive conductances that both cells share and Couette
flows that leave one cell and enter the next: its solution is unique, and certificate and bands hold as ever (docs/accuracy.md).
"""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ...base.parallel import Array
from ..grid import Grid

Flags = NDArray[np.bool_]
Shape = Callable[[Array, Array], Array]
Faces = tuple[Flags, Array, Array]
SIDE_BY_SIDE, IN_SERIES = 16, 32  # looks across a face and between its two points
TOGETHER = 200  # faces that are looked at together, in cache
THIN = 1 / 3  # of the way from the thinnest to the thickest film of a face: what is below is the film outside a recess


def cut_faces(
    film: Shape,
    rims: Sequence[Shape],
    nodes: Array,
    lines: Array,
    steps: Array,
    cavity: Flags,
    along_flow: bool,
    period: float = 0.0,
    full: Faces | None = None,
) -> Faces:
    """Which faces along t a rim cuts, shape (lines, faces), and C and H of those (`edges.face_film`).

    Parameters
    ----------
    film : h(t, s) in m. rims : distances to edges at (t, s), m, negative inside. nodes : t of the points, one more than faces.
    lines, steps : s of the lines of points, and the distances before, between and behind them.
    cavity : whether the points are cavitated, shape (lines, nodes). along_flow : whether the flow goes to larger t.
    period : round a ring, whose last point lies before the first.
    full : what this returned for them without cavities, if that is known: only those beside a cavity are looked at then.
    """
    a, d = nodes[:-1], np.diff(nodes)
    d = np.where(d < 0.0, d + period, d)
    low, width = lines - 0.5 * steps[:-1], 0.5 * (steps[:-1] + steps[1:])
    if full is None:
        middle, across = (a + 0.5 * d)[None, :], (low + 0.5 * width)[:, None]
        reach = 0.5 * np.hypot(d[None, :], width[:, None])
        cut = np.zeros(reach.shape, dtype=bool)
        for rim in rims:
            cut |= np.abs(rim(middle, across)) <= reach
        cut &= d[None, :] > 0.0
        kind = np.asarray(film(nodes[:1], lines[:1])).dtype  # complex, where a derivative is asked for
        cubes, films = np.zeros((2, np.count_nonzero(cut)), dtype=kind)
    else:
        cut, cubes, films = full[0], full[1].copy(), full[2].copy()
    j, i = np.nonzero(cut)
    anew = np.arange(j.size) if full is None else np.flatnonzero(cavity[j, i] | cavity[j, i + 1])
    for some in (anew[k : k + TOGETHER] for k in range(0, anew.size, TOGETHER)):
        at = j[some], i[some]
        dry = cavity[at], cavity[at[0], at[1] + 1]
        t = a[at[1]] + d[at[1]] * ((np.arange(IN_SERIES) + 0.5) / IN_SERIES)[:, None, None]
        looks = ((np.arange(SIDE_BY_SIDE) + 0.5) / SIDE_BY_SIDE)[:, None] * width[at[0]] + low[at[0]]
        ends = [partial(film, nodes[at[1] + k], lines[at[0]]) for k in (0, 1)]
        h = film(t, looks)
        known = _in_series(h) if full is None else (cubes[some], films[some])
        cubes[some], films[some] = _of_faces(h, ends, dry, along_flow, known)
    return cut, cubes, films


def _of_faces(
    h: Array, ends: Sequence[Callable[[], Array]], dry: Sequence[Flags], along_flow: bool, known: tuple[Array, Array]
) -> tuple[Array, Array]:
    """C and H of faces from the film at all looks, shape (in series, side by side, faces): sums run fastest along the first.

    ends : the film at their first and last points. dry : whether these are cavitated. known : C and H of full faces.
    """
    cubes, films = known
    some = np.flatnonzero(dry[0] | dry[1])  # a full face resists all along: only beside a cavity a part may do it alone
    if not some.size:
        return cubes, films
    seen = np.real(h[..., some])
    thinnest, thickest = seen.min(axis=(0, 1)), seen.max(axis=(0, 1))
    between = thinnest + THIN * (thickest - thinnest)
    first, last = (np.real(end()[some]) > between for end in ends)  # whether the points lie in the recess
    dry_first, dry_last = (flags[some] for flags in dry)
    void = np.where(first == last, dry_first & dry_last, np.where(last, dry_last, dry_first & np.bool_(not along_flow)))
    seen = seen[..., void]
    thin = seen <= between[void]
    if along_flow:  # the film before the first place where it becomes thick
        thin = np.logical_and.accumulate(thin, axis=0)
        alone = thin[0] & (seen[-1] > between[void])
    else:
        alone = thin.any(axis=0)
    cubes[some[void]], films[some[void]] = _in_series(h[..., some[void]], thin | ~alone)
    return cubes, films


def _in_series(h: Array, resists: Flags | None = None) -> tuple[Array, Array]:
    """C and H of faces: means over lines of looks, on each of which what `resists` (None: all of it) does so in series."""
    inverse = 1.0 / h
    drag = inverse * inverse if resists is None else np.where(resists, inverse * inverse, 0.0)
    resistance = np.mean(drag * inverse, axis=0)
    return np.mean(1.0 / resistance, axis=0), np.mean(np.mean(drag, axis=0) / resistance, axis=0)


def rims_across_x(
    grid: Grid,
    film: Shape,
    rims: Sequence[Shape],
    cavity: Array | None,
    cubes: Array,
    films: Array,
    period: float,
    seen: dict[int, Faces] | None,
) -> tuple[Array, Array]:
    """C and H of the x faces, those that rims cut made anew; cavity: 1 at the owned points that are cavitated. Collective.

    seen : keeps what `cut_faces` says of the grid's faces without cavities.
    """
    nodes, _ = grid.nodes_and_faces(0)
    cut, cut_cubes, cut_films = found = cut_faces(
        film, rims, nodes, grid.y[:, 0], grid.steps(1), _dry(grid, cavity)[1:-1], True, period, (seen or {}).get(0)
    )
    if cavity is None and seen is not None:
        seen[0] = found
    cubes, films = np.array(cubes), np.array(films)
    cubes[cut], films[cut] = cut_cubes, cut_films
    return cubes, films


def rims_across_y(
    grid: Grid,
    film: Shape,
    rims: Sequence[Shape],
    cavity: Array | None,
    cubes: Array,
    period: float,
    seen: dict[int, Faces] | None,
) -> Array:
    """The same for C of the y faces. Collective."""
    nodes, _ = grid.nodes_and_faces(1)
    turned = [partial(_swapped, rim) for rim in (film, *rims)]
    cut, cut_cubes, _ = found = cut_faces(
        turned[0],
        turned[1:],
        nodes,
        grid.x[0],
        grid.steps(0),
        _dry(grid, cavity)[:, 1:-1].T,
        False,
        period,
        (seen or {}).get(1),
    )
    if cavity is None and seen is not None:
        seen[1] = found
    cubes = np.array(cubes)
    cubes.T[cut] = cut_cubes
    return cubes


def _swapped(shape: Shape, t: Array, s: Array) -> Array:
    return shape(s, t)


def _dry(grid: Grid, cavity: Array | None) -> Flags:
    return grid.ghosted(np.zeros(grid.local_size) if cavity is None else cavity, outside=0.0) > 0.0
