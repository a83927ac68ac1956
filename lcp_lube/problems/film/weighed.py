"""What sums of a film's balances times weights change by with the film everywhere, strip by strip: no coefficient is kept."""

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


def can(problem: LubricationProblem, model: Model, least: int = MANY, held: bool = False, rims: bool = False) -> bool:
    """Whether the coefficients are those of a steady film alone, under a wall that moves, and compiled loops pay.

    held : supplies may hold some cells. rims : round edges may cut faces.
    """
    grid = problem.grid
    plain = type(problem) is LubricationProblem and problem.plain and (rims or problem.coefficients_for is None)
    plain = plain and (held or problem.held is None)
    flow = not model.mean_cubes and model.U > 0.0 and model.stored is None and model.law is None
    return plain and flow and grid.dim == 2 and "closed" not in grid.ends[0] and grid.size >= least and has_numba()


class Weighed:
    """w' G at a problem's fields, w of the owned points. Collective, as its methods.

    Parameters
    ----------
    p : Pa above p_c, r : owned points.
    """

    def __init__(self, problem: LubricationProblem, scheme: str, p: Array, r: Array):
        self.scheme, self.grid = scheme, problem.grid
        enters = problem.r_in if self.grid.ends[0][0] == "open" else 0.0
        self._p, self._r = ghosted(self.grid, p, 0.0), ghosted(self.grid, r, enters)

    def by_film(self, gap: Any, w: Array, mu: float, U: float, p_sides: Sequence[float]) -> Array:
        """What w' G changes by with the film at each owned point, that between two points being their mean, m/s."""
        from .cell_loops import loop_by_film

        out, grid = np.zeros(self.grid.box), self.grid
        weights = ghosted(grid, w, 0.0)
        for rows, part, k_x, k_y, wall, void in self._strips(gap):
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

    def _strips(self, gap: Any) -> Iterator[Strip]:
        """Lines, their places, and derivatives by a film that is everywhere thicker by as much: of conductances of the x and y
        faces at mu = 1, and at U = 1 of what the wall drags through x faces and what if all is void."""
        grid, film = self.grid, Around(gap, self.grid)
        cut = bool(jumps_of(film, "x") or jumps_of(film, "y"))
        if cut:
            step = STEP * float(np.max(np.abs(gap(grid.x, grid.y[:1]))))
            raised = Around(Raised(gap, 1j * step), grid)
        for rows in in_strips(grid):
            part = places_of(grid, rows)
            if cut:
                k_x, k_y, _, wall, void = coefficients_of(part, raised, 1.0 / 6.0, 1.0, self.scheme, False, (), None, None)
                k_x, k_y, wall, void = (np.imag(a) / step for a in (k_x, k_y, wall, void))
            else:
                k_x, k_y, wall, void = self._smooth(part, film)
            first, last = (part.ends[1][k] in ("closed", "mirror") for k in (0, 1))
            if first and part.y_start == 0:
                k_y[0] = 0.0
            if last and part.y_end == part.shape[1]:
                k_y[-1] = 0.0
            yield rows, part, k_x, k_y, wall, void

    def _smooth(self, part: Grid, film: Around) -> tuple[Array, Array, Array, Array]:
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
            loop_cubes(np.ascontiguousarray(h), columns, lines.ravel())
            for h, columns, lines in ((h_x, 1.0 / part.steps(0), along), (h_y, part.widths(0), across))
        )
        same = np.broadcast_to(stream_weights(part), h_x.shape).copy()
        return k_x, k_y, same, same
