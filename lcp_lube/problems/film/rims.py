"""Faces that a curved edge of the film cuts: round dimples, whose rims no straight grid line can follow.

Between two points the film is told by the line between them, on which it resists in series (`edges`): a rim is where that
line crosses it. That is right where the film is full. Where a dimple is cavitated its rim is where the pressure ends: only
the film before it resists, and carries, and what lies behind would be a length that varies with the rim's place in the
cell, an error of first order. A fixed coefficient cannot know; the answer does. So a problem with such faces is solved, its
cavities are looked at, and it is solved once more, from the answer on, with the cut faces made for them (`drivers.rims`).
Where a film reforms before a rim it is full for but a cell or so, and the pressure in it runs along the rim: faces across
the flow lead there as layers do that lie so. Those beside a cavity are looked at across their whole width. In a dome, with
a kink at the rim and no jump, films rupture and reform inside: of a face into a cavity what lies before the front resists,
of others the whole. Either problem is of the one form, with positive conductances that both cells share and Couette flows
that leave one cell and enter the next: its solution is unique, certificate and bands hold as ever (docs/accuracy.md).
"""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.parallel import Array
from ..grid import Grid
from .cavity import cavitated
from .edge_layers import REACH, Shape, beside_edge, layer, normal_of
from .edges import pairs

Flags = NDArray[np.bool_]
LOOKS, FEW = 32, 8  # between the two points of a face, and where the film is smooth
WIDE = 8, 16  # lines side by side across the width of a face across the flow beside a cavity, and looks along each
TOGETHER = 2000  # faces that are looked at together, in cache
CROSSED = 0.6  # that far an edge may lie where it crosses a face; beyond there is one film
TOUCH = 1e-9  # of a face: rims that are that near to its ends touch them, in a mirror image too
SAME = 1e-9  # of a flow: least flows that differ by less are one
THIN = 1 / 3  # of the way from the thinnest to the thickest film of a face: what is below is the film outside a recess


def cut_faces(
    film: Shape,
    rims: Sequence[Shape],
    nodes: Array,
    lines: Array,
    widths: Array,
    state: Array,
    along_flow: bool,
    period: float = 0.0,
) -> tuple[Flags, Array, Array]:
    """Which faces along t a rim cuts, or a slanted edge changes, shape (lines, faces); C and H of those (`edges.face_film`).

    Parameters
    ----------
    film : h(t, s) in m. rims : distances to edges at (t, s), m, negative inside. nodes : t of the points, one more than faces.
    lines : s of the lines of points. widths : of their cells, m.
    state : of the points, as `state_of` has it, shape (lines, nodes); of faces across the flow with the line before the first.
    along_flow : whether the flow goes to larger t. period : round a ring, whose last point lies before the first.
    """
    a, d = nodes[:-1], np.diff(nodes)
    d = np.where(d < 0.0, d + period, d)
    middle = a + 0.5 * d
    cut, crossed, wide, domed = np.zeros((4, lines.size, d.size), dtype=bool)
    oblique, jump = np.zeros((2, *cut.shape))
    if not along_flow:
        (reforms, near), state = _beside_cavities(state > 0.0), state[1:]
    beside = []
    for rim in rims:
        if depth := depth_of(rim):
            beside.append((depth, *beside_edge(rim, middle, d, lines, widths, along_flow)))
            away = np.abs(beside[-1][1])
            by_rim, across = away < REACH, away < CROSSED
        else:
            away = rim(middle[None, :], lines[:, None])
            across = by_rim = np.abs(away) <= (0.5 + TOUCH) * d
            if not _jumps(rim):
                if along_flow:
                    by_rim = across | ((away < 0.0) & (state[:, :-1] <= 0.0) & (state[:, 1:] <= 0.0))
                domed |= by_rim
            elif not along_flow:
                by_rim |= (side := near & (np.abs(away) <= 0.5 * np.hypot(d, widths[:, None])))
                wide |= side
        cut, crossed = cut | by_rim, crossed | across
        jump[across] = np.maximum(jump[across], jump_of(rim))
        if not along_flow:
            j, i = np.nonzero(by_rim & reforms & (d > 0.0))
            oblique[j, i] = normal_of(rim, middle[i], d[i], lines[j], widths[j], False)[1]
    cut, domed = cut & (d > 0.0), domed & (jump == 0.0)
    kind = np.asarray(film(nodes[:1], lines[:1])).dtype  # complex, where a derivative is asked for
    cubes, films = np.zeros((2, np.count_nonzero(cut)), dtype=kind)
    j, i = np.nonzero(cut)
    kinds = (~crossed & ~domed, (1, 1)), (~crossed & domed, (1, FEW)), (crossed & ~wide, (1, LOOKS)), (wide, WIDE)
    for which, (sides, looks) in kinds:
        of = np.flatnonzero(which[j, i])
        for k in (of[first : first + TOGETHER] for first in range(0, of.size, TOGETHER)):
            at, row = i[k], j[k]
            ends = state[row, at], state[row, at + 1]
            places = (lines[row] + share * widths[row] for share in (np.arange(sides) + 0.5) / sides - 0.5)
            edges = jump[row, at], oblique[row, at], domed[row, at]
            parts = [_looked(film, a[at], d[at], line, looks, *edges, *ends, along_flow) for line in places]
            cubes[k], films[k] = np.mean(parts, axis=0)
    for depth, away, length in beside:
        more, slope = layer(depth, away[j, i], length[j, i], film(middle[i], lines[j]))
        cubes, films = cubes + more, films + slope * more
    return cut, cubes, films


def _looked(
    film: Shape, a: Array, d: Array, lines: Array, looks: int,
    jump: Array, oblique: Array, domed: Flags, first: Array, last: Array, along_flow: bool,
) -> tuple[Array, Array]:  # fmt: skip
    """C and H of faces of lengths d from a on, of what resists there; oblique : the part that leads side by side.

    domed : whether the film has a kink there and no jump. first, last : states of the points at the ends.
    """
    places = np.array([0.0, *(np.arange(looks) + 0.5) / looks, 1.0])[:, None]  # the points too
    h = np.broadcast_to(film(a + d * places, lines), (places.size, a.size))
    resists = domed | _resists(np.real(h), jump, first > 0.0, last > 0.0, along_flow)
    if along_flow and (k := np.flatnonzero(domed & (last > 0.0))).size:
        resists[1:-1, k] = before_front(np.real(h[1:-1, k]), np.maximum(-first[k], 0.0) * looks / d[k])
    inverse = 1.0 / h[1:-1]
    drag = np.where(resists[1:-1], inverse * inverse, 0.0)
    resistance = np.mean(drag * inverse, axis=0)
    cubes, films = 1.0 / resistance, np.mean(drag, axis=0) / resistance
    if (k := np.flatnonzero(oblique)).size:
        cubes[k] += oblique[k] * (np.mean(h[1:-1, k] ** 3, axis=0) - cubes[k])
    return cubes, films


def before_front(h: Array, driven: Array | float) -> Flags:
    """Which looks, shape (looks, faces), a film that ruptures has before its front: as many as let the least flow through.

    driven : by the pressure at the first point, in looks' parts of what the wall drags, 1/m2. A full film up to a place where
    p = 0 has one flow, and of all such places the front has the least. So C and H change by second order with the front.
    """
    flow = (driven + np.cumsum(h**-2.0, axis=0)) / np.cumsum(h**-3.0, axis=0)
    least = flow <= (1.0 + SAME) * flow.min(axis=0)
    return np.logical_or.accumulate(least[::-1], axis=0)[::-1]  # up to the last one of equals


def _beside_cavities(cavity: Flags) -> tuple[Flags, Flags]:
    """Which faces across the flow lie where a film has just reformed: both points full, one a cell before them cavitated;
    and which lie there or have a cavitated point."""
    dry = cavity[:, :-1] | cavity[:, 1:]
    return dry[:-1] & ~dry[1:], dry[:-1] | dry[1:]


def depth_of(rim: Any) -> float:
    """By how much the film jumps at a slanted edge, m; 0 at other rims, and where a film has any depth there."""
    return float(getattr(_own(rim), "depth", 0.0))


def jump_of(rim: Any) -> float:
    """By how much the film jumps at a slanted edge or a round rim, m, without sign; 0 at a dome's and where it is not known."""
    dimples = _dimples_of(rim)
    return abs(depth_of(rim)) if dimples is None else abs(float(np.real(dimples.depth))) * dimples.oblique


def _jumps(rim: Any) -> bool:
    """Whether the film jumps at a rim: at a dome's it does not."""
    return bool(getattr(_dimples_of(rim), "oblique", True))


def _dimples_of(rim: Any) -> Any:
    """Whose rim it is, if it is that of round recesses."""
    return getattr(_own(rim), "__self__", None)


def _own(rim: Any) -> Any:
    rim = rim.args[0] if isinstance(rim, partial) else rim
    return _own(rim.film) if hasattr(rim, "film") else rim


def _resists(h: Array, jump: Array, dry_first: Flags, dry_last: Flags, along_flow: bool) -> Flags:
    """Which part of faces resists, from the film at their looks, shape (looks, faces): before a cavity the thin film alone.

    jump : by how much the film does where their rim is. Looks that differ by less than half of it all lie on one side.
    dry_first, dry_last : whether the points at their ends, the first and last looks, are cavitated.
    """
    thinnest, thickest = h.min(axis=0), h.max(axis=0)
    thin = (h <= thinnest + THIN * (thickest - thinnest)) | (thickest - thinnest < 0.5 * jump)
    first, last = ~thin[0], ~thin[-1]  # whether the points lie in the recess
    void = np.where(first == last, dry_first & dry_last, np.where(last, dry_last, dry_first & np.bool_(not along_flow)))
    if along_flow:  # the film before the first place where it becomes thick
        thin = np.logical_and.accumulate(thin, axis=0)
        void &= last
    return thin | ~(void & thin[1:-1].any(axis=0))  # a rim on a point leaves no look before it


def rims_across_x(
    grid: Grid, film: Shape, rims: Sequence[Shape], cavity: Array | None, cubes: Array, films: Array, period: float
) -> tuple[Array, Array]:
    """C and H of the x faces, those that rims cut made anew; cavity: `state_of` the owned points. Collective."""
    nodes, _ = grid.nodes_and_faces(0)
    cut, cut_cubes, cut_films = cut_faces(
        film, rims, nodes, grid.y[:, 0], _widths(grid, 1), frame_of(grid, cavity)[1:-1], True, period
    )
    cubes, films = np.array(cubes), np.array(films)
    cubes[cut], films[cut] = cut_cubes, cut_films
    return cubes, films


def rims_across_y(grid: Grid, film: Shape, rims: Sequence[Shape], cavity: Array | None, cubes: Array, period: float) -> Array:
    """The same for C of the y faces. Collective."""
    nodes, _ = grid.nodes_and_faces(1)
    turned = [partial(_swapped, rim) for rim in (film, *rims)]
    cut, cut_cubes, _ = cut_faces(
        turned[0], turned[1:], nodes, grid.x[0], _widths(grid, 0), across_flow(grid, frame_of(grid, cavity)), False, period
    )
    cubes = np.array(cubes)
    cubes.T[cut] = cut_cubes
    return cubes


def made_along(
    film: Any, nodes: Array, lines: Array, widths: Array, state: Array, of: Sequence[Array], period: float, across: bool = False
) -> None:
    """Put C, or C and H, of the cut faces of some lines, shape (lines, faces), in the places of those of whole films.

    film : with its `rims` (`edges.Around`). state : of the lines' nodes, as `cut_faces` has it.
    across : faces along y, lines of x.
    """
    shapes = [partial(_swapped, one) if across else one for one in (film, *film.rims)]
    cut, *found = cut_faces(shapes[0], shapes[1:], nodes, lines, widths, state, not across, period)
    for a, values in zip(of, found, strict=False):
        a[cut] = values


def _swapped(shape: Shape, t: Array, s: Array) -> Array:
    return shape(s, t)


def _widths(grid: Grid, side: int) -> Array:
    return 0.5 * pairs(grid.steps(side)).sum(axis=0)


def state_of(problem: Any, p: Array, r: Array) -> Array:
    """What faces are made for: 1 at cavitated points, at others -p/(6 mu U), 1/m, or -p/(6 mu) of a wall that stands: less what
    the pressure drives. Collective."""
    driven = np.maximum(p, 0.0) * problem.p_unit / np.ravel(6.0 * problem.mu * (abs(problem.U) or 1.0))
    return np.where(cavitated(problem.reduce, p, r), 1.0, -driven)


def frame_of(grid: Grid, state: Array | None) -> Array:
    return grid.ghosted(np.zeros(grid.local_size) if state is None else state, outside=0.0)


def across_flow(grid: Grid, state: Array) -> Array:
    """Of the points of a frame those that `cut_faces` asks for across the flow: line by line, the one before the first too."""
    before = state[:, -2:-1] * grid.periodic[0]
    return np.concatenate([before, state[:, 1:-1]], axis=1).T
