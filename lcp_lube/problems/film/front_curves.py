"""The fronts of a plane film's cavities as curves, through the places where they cross the lines of points (`fronts`).

Each crossing lies on an edge between two neighbouring points, and belongs to the two cells of four points beside it. The two
crossings of a cell are joined; of four those round two opposite corners. Curves that come to a side end on it. Of a rupture
the lines along the flow know the place (U h = Q there), those across it only that p grows slowly: between two ruptures their
crossing is left out.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...base.parallel import Array
from ...errors import InputError
from .cavity import cavitated
from .fronts import across, before_side, line_fronts

if TYPE_CHECKING:
    from .lubrication import LubricationProblem


def front_curves(problem: LubricationProblem, p: Array, r: Array) -> list[Array]:
    """x and y (m) along every front, shape (points, 2), on rank 0, none on the others; closed curves end where they begin.
    Collective.

    Raises
    ------
    InputError : no film in the plane.
    """
    if problem.moving is not problem:
        L = problem.grid.lengths[0]
        curves = front_curves(problem.moving, *problem.there({"p": p, "r": r}).values())
        return [curve * [-1.0, 1.0] + [L, 0.0] for curve in curves]
    grid = problem.grid
    if grid.dim == 1 or problem.kind != "lubrication":
        raise InputError("fronts are curves of films in the plane; those of a line are its numbers ruptures and reformations")
    parts = grid.comm.gather(_crossings(problem, p, r)) if problem.U else None
    if parts is None or not sum(map(len, parts)):
        return []
    crossings = np.concatenate(parts)
    return _joined(crossings[np.lexsort(crossings.T[::-1])], grid.shape, grid.origin, grid.lengths)


def _crossings(problem: LubricationProblem, p: Array, r: Array) -> Array:
    """Of this rank: j and i of the lower or left point of an edge, whether it lies along y (1) or has a rupture (-1), else 0,
    x and y, m; shape (crossings, 5)."""
    grid, cavity = problem.grid, cavitated(problem.reduce, p, r)
    found = line_fronts(problem, p, r, cavity)
    x, y = grid.x[0], grid.y[:, 0]
    rows = []
    for (j, i, places), kind in ((found.ruptures, -1.0), (found.reformations, 0.0)):
        rows.append(np.stack([j + grid.y_start, i + grid.x_start - 1, np.full(j.size, kind), places, y[j]], axis=1))
    for (j, i, back), lower in zip(across(grid, p, cavity), (1, 0), strict=True):
        at = y[j] + (1 - 2 * lower) * back
        rows.append(np.stack([j + grid.y_start - lower, i + grid.x_start, np.ones(j.size), x[i], at], axis=1))
    steps = grid.steps(1)
    for k, (own, step, p_side) in enumerate(((0, steps[0], problem.p_sides[2]), (-1, -steps[-1], problem.p_sides[3]))):
        at_side = (grid.y_start, grid.y_end)[k] == (0, grid.shape[1])[k] and grid.ends[1][k] == "open"
        if at_side and p_side > 0.0:  # the film is full there
            i = np.flatnonzero(cavity.reshape(grid.box)[own])
            edge = np.full(i.size, -1 if k == 0 else grid.shape[1] - 1)
            at = y[own] - step + before_side(problem, k)[i] * step
            rows.append(np.stack([edge, i + grid.x_start, np.ones(i.size), x[i], at], axis=1))
    return np.concatenate(rows)


def _joined(at: Array, shape: tuple[int, ...], origin: tuple[float, float], lengths: tuple[float, ...]) -> list[Array]:
    """Curves through crossings, from those in the order of their edges."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components, depth_first_order

    j, i, kind = at[:, :3].astype(int).T
    upright, places = np.maximum(kind, 0), at[:, 3:]
    # The cells on both sides of each edge, by the numbers of their lower left points.
    cells = np.concatenate([np.stack([j, i]), np.stack([j - (1 - upright), i - upright])], axis=1)
    number, owner = (cells[0] + 1) * (shape[0] + 1) + cells[1] + 1, np.tile(np.arange(len(at)), 2)
    order = np.argsort(number, kind="stable")
    number, owner, cells = number[order], owner[order], cells[:, order]
    first = np.flatnonzero(np.diff(number, prepend=-1))
    count = np.diff(first, append=number.size)
    pairs = [np.stack([owner[first[count >= k + 2] + k], owner[first[count >= k + 2] + k + 1]]) for k in (0, 2)]
    lone = first[count % 2 == 1] + count[count % 2 == 1] - 1
    ends = np.array(places[owner[lone]])
    for axis, side in ((1, cells[0, lone]), (0, cells[1, lone])):
        across_it = upright[owner[lone]] != axis  # the curve goes on to the side
        ends[:, axis] = np.where(across_it & (side == -1), origin[axis], ends[:, axis])
        ends[:, axis] = np.where(across_it & (side == shape[axis] - 1), origin[axis] + lengths[axis], ends[:, axis])
    pairs.append(np.stack([owner[lone], len(at) + np.arange(lone.size)]))
    a, b = np.concatenate(pairs, axis=1)
    places, kind = np.concatenate([places, ends]), np.append(kind, np.zeros(lone.size, dtype=int))
    n = len(places)
    graph = coo_array((np.ones(2 * a.size), (np.concatenate([a, b]), np.concatenate([b, a]))), shape=(n, n)).tocsr()
    _, component = connected_components(graph, directed=False)
    single = np.diff(graph.indptr) == 1
    begin = np.lexsort((np.arange(n), ~single, component))  # an end of each curve first, if it has one
    starts = begin[np.flatnonzero(np.diff(component[begin], prepend=-1))]
    curves = []
    for start in starts:
        path: NDArray[np.int64] = depth_first_order(graph, start, directed=False, return_predecessors=False)
        closed = not single[start] and path.size > 2
        of = kind[path]
        told = (of < 1) | (np.roll(of, 1) >= 0) | (np.roll(of, -1) >= 0)
        path = path[told]
        curves.append(places[np.append(path, path[0]) if closed else path])
    return curves
