"""Sums of a film's balances times weights, strip by strip: its coefficients are made of the film and not kept.

With G_i the balance of a point (`reynolds`), w' G is P(h)/mu + U D(h): what the pressures and what the wall makes leave the
cells. Another film at the same fields costs its values at the faces. So does what w' G changes by with the film everywhere.
"""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from ...base.compiled import has_numba
from ...base.parallel import Array
from ..grid import Grid
from ..strips import MANY, ghosted, in_strips, places_of
from .edges import Around, jumps_of
from .lubrication import LubricationProblem
from .model import Model
from .reynolds import sides
from .strip import coefficients_of, line_weights, stream_weights
from .views import Raised

STEP = 1e-30  # relative, of a complex step
Strip = tuple[slice, Grid, Array, Array, Array, Array]


def can(problem: LubricationProblem, model: Model, least: int = MANY) -> bool:
    """Whether the coefficients are those of a steady film alone, under a wall that moves, and compiled loops pay."""
    grid = problem.grid
    plain = type(problem) is LubricationProblem and problem.plain and problem.held is None and problem.coefficients_for is None
    flow = not model.mean_cubes and model.U > 0.0 and model.stored is None and model.law is None
    return plain and flow and grid.dim == 2 and "closed" not in grid.ends[0] and grid.size >= least and has_numba()


class Weighed:
    """w' G of the films that a problem could have, at its fields. Collective, as its methods.

    Parameters
    ----------
    p : Pa above p_c, r : owned points. rows : the weights w, each of the owned points.
    """

    def __init__(self, problem: LubricationProblem, scheme: str, p: Array, r: Array, rows: Sequence[Array]):
        self.scheme = scheme
        self.grid, self.rows = problem.grid, [row.reshape(problem.grid.box) for row in rows]
        enters = problem.r_in if self.grid.ends[0][0] == "open" else 0.0
        self._p, self._r = ghosted(self.grid, p, 0.0), ghosted(self.grid, r, enters)

    def sums(self, gap: Any) -> Array | None:
        """P in m2/s Pa s, D in m, and by what P grows with the pressure of each side: shape (weights, 6); None for a film that
        is not positive."""
        from .cell_loops import loop_weighed

        out, by_side = np.zeros((len(self.rows), 2, self.grid.box[1])), np.zeros((len(self.rows), 4))
        positive = True
        for rows, part, k_x, k_y, wall, void in self._strips(gap):
            positive = positive and bool((wall > 0.0).all() and (void > 0.0).all())
            w = np.array([row[rows] for row in self.rows])
            loop_weighed(w, self._p(rows), self._r(rows), k_x, k_y, wall, void, out)
            at_west, at_east, at_south, at_north = (mask.any() for mask in sides(part))
            for k, at, edge, k_edge in (
                (0, at_west, w[:, :, 0], k_x[:, 0]),
                (1, at_east, w[:, :, -1], k_x[:, -1]),
                (2, at_south, w[:, 0], k_y[0]),
                (3, at_north, w[:, -1], k_y[-1]),
            ):
                if at:
                    by_side[:, k] -= edge @ k_edge
        total = self.grid.comm.allreduce(np.append(np.concatenate([out.sum(axis=2), by_side], axis=1), float(not positive)))
        return None if total[-1] else total[:-1].reshape(len(self.rows), 6)

    def by_film(self, gap: Any, w: Array, mu: float, U: float, p_sides: Sequence[float]) -> Array:
        """What w' G changes by with the film at each owned point, that between two points being their mean, m/s."""
        from .cell_loops import loop_by_film

        out, grid = np.zeros(self.grid.box), self.grid
        weights = ghosted(grid, w, 0.0)
        for rows, part, k_x, k_y, wall, void in self._strips(gap, slopes=True):
            west, east, south, north = (np.broadcast_to(mask, part.box) for mask in sides(part, ("open", "closed", "mirror")))
            along = np.array([np.where(west[0], 1.0, 0.5), np.where(east[0], 1.0, 0.5)])
            across = np.array([np.where(south[:, 0], 1.0, 0.5), np.where(north[:, 0], 1.0, 0.5)])
            before = np.array([np.where(west[0], 1.0, 0.0), np.ones(part.box[1])])  # of what the film at the point before is
            of_wall, of_void = before if self.scheme == "upwind" else along, along if self.scheme == "face" else before
            shares = (along, across, of_wall, of_void)
            p = self._framed(rows, part, p_sides)
            loop_by_film(weights(rows), p, self._r(rows), k_x / mu, k_y / mu, U * wall, U * void, *shares, out[rows])
        return out

    def _framed(self, rows: slice, part: Grid, p_sides: Sequence[float]) -> Array:
        """p with a frame that has the sides' pressures."""
        west, east, south, north = (np.broadcast_to(mask, part.box) for mask in sides(part, ("open", "closed", "mirror")))
        p = np.array(self._p(rows))
        lines = ((p[1:-1, 0], west[:, 0]), (p[1:-1, -1], east[:, -1]), (p[0, 1:-1], south[0]), (p[-1, 1:-1], north[-1]))
        for (line, mask), p_side in zip(lines, p_sides, strict=True):
            line[mask] = p_side
        return p

    def by_faces(self, gap: Any, mu: float, U: float, p_sides: Sequence[float]) -> "ByFaces | None":
        """What w' G changes by with the film where the coefficients take it; None for one with edges."""
        from .cell_loops import loop_by_faces

        if _cut(Around(gap, self.grid)):
            return None
        (ny, nx), count = self.grid.box, len(self.rows)
        along, across, before = (np.zeros((count, *shape)) for shape in ((ny, nx + 1), (ny + 1, nx), (ny, nx + 1)))
        at_faces = self.scheme != "upwind", self.scheme == "face"
        for rows, part, k_x, k_y, wall, void in self._strips(gap, slopes=True):
            w, p = np.array([row[rows] for row in self.rows]), self._framed(rows, part, p_sides)
            out = along[:, rows], across[:, rows.start : rows.stop + 1], before[:, rows]
            loop_by_faces(w, p, self._r(rows), k_x / mu, k_y / mu, U * wall, U * void, *out, *at_faces)
        return ByFaces(self.grid, (along, across) if all(at_faces) else (along, across, before))

    def _strips(self, gap: Any, slopes: bool = False) -> Iterator[Strip]:
        """Lines, their places, conductances at mu = 1 of the x and y faces, and at U = 1 what the wall drags through x faces
        and what if all is void; slopes : their derivatives by a film that is everywhere thicker by as much."""
        grid, film = self.grid, Around(gap, self.grid)
        cut = _cut(film)
        raised = film
        if cut and slopes:
            step = STEP * float(np.max(np.abs(gap(grid.x, grid.y[:1]))))
            raised = Around(Raised(gap, 1j * step), grid)
        for rows in in_strips(grid):
            part = places_of(grid, rows)
            if cut:
                k_x, k_y, _, wall, void = coefficients_of(part, raised, 1.0 / 6.0, 1.0, self.scheme, False, (), None, None)
                if slopes:
                    k_x, k_y, wall, void = (np.imag(a) / step for a in (k_x, k_y, wall, void))
            else:
                k_x, k_y, wall, void = self._smooth(part, film, slopes)
            first, last = (part.ends[1][k] in ("closed", "mirror") for k in (0, 1))
            if first and part.y_start == 0:
                k_y[0] = 0.0
            if last and part.y_end == part.shape[1]:
                k_y[-1] = 0.0
            yield rows, part, k_x, k_y, wall, void

    def _smooth(self, part: Grid, film: Around, slopes: bool) -> tuple[Array, Array, Array, Array]:
        """As `strip.coefficients_of`, of a film without edges."""
        from .cell_loops import loop_cubes

        x_nodes, x_faces = part.nodes_and_faces(0)
        _, y_faces = part.nodes_and_faces(1)
        (ny, nx), y = part.box, part.y
        h_x = np.broadcast_to(film(x_faces[None, :], y), (ny, nx + 1))
        h_y = np.broadcast_to(film(x_nodes[None, 1:-1], y_faces[:, None]), (ny + 1, nx))
        along = line_weights(part) / part.stretch(y) / 6.0
        across = part.spacing[0] * part.stretch(y_faces)[:, None] / (6.0 * (part.steps(1) * part.spacing[1])[:, None])
        k_x, k_y = (
            loop_cubes(np.ascontiguousarray(h), columns, lines.ravel(), slopes)
            for h, columns, lines in ((h_x, 1.0 / part.steps(0), along), (h_y, part.widths(0), across))
        )
        weight = stream_weights(part)
        if slopes:
            same = np.broadcast_to(weight, h_x.shape).copy()
            return k_x, k_y, same, same
        at_face = weight * h_x
        if self.scheme == "face":
            return k_x, k_y, at_face, at_face
        before = weight * np.broadcast_to(film(x_nodes[None, :-1], y), h_x.shape)
        return k_x, k_y, at_face if self.scheme == "nodal" else before, before


def _cut(film: Any) -> bool:
    return bool(jumps_of(film, "x") or jumps_of(film, "y"))


class ByFaces:
    """Sums of films without edges times what w' G changes by with them: to first order w' G itself. Collective."""

    def __init__(self, grid: Grid, slopes: Sequence[Array]):
        self.grid = grid
        x_nodes, x_faces = grid.nodes_and_faces(0)
        y_faces = grid.nodes_and_faces(1)[1]
        places = ((x_faces, grid.y), (x_nodes[1:-1], y_faces[:, None]), (x_nodes[:-1], grid.y))
        self._parts = [(slope, slope.sum(axis=1), *place) for slope, place in zip(slopes, places, strict=False)]

    def sums(self, gap: Any) -> Array | None:
        """Of each w; None for a film that has edges, or is not positive."""
        film = Around(gap, self.grid)
        total, bad = np.zeros(self._parts[0][0].shape[0] + 1), _cut(film)
        for slope, by_column, x, y in () if bad else self._parts:
            if film(x[None, :], y[:2]).shape[0] == 1:  # of x alone
                h = film(x[None, :], y[:1])
                total[:-1] += (by_column * h).sum(axis=1)
            else:
                h = np.broadcast_to(film(x[None, :], y), slope.shape[1:])
                flat = h.ravel()  # with it einsum is several times as fast
                total[:-1] += [np.einsum("i,i->", one.ravel(), flat) for one in slope]
            bad = bad or not (h > 0.0).all()
        total[-1] = float(bad)
        total = self.grid.comm.allreduce(total)
        return None if total[-1] else total[:-1]
