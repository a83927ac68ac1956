"""What sums of a film's balances times weights change by with the film everywhere, strip by strip: no coefficient is kept."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ...base.compiled import has_numba
from ...base.parallel import Array
from ..strips import MANY, ghosted, in_strips, places_of
from .edges import Around, level
from .face_lines import FaceLines, Rows, line_factors, runs
from .flows import line_shares
from .lubrication import LubricationProblem
from .made_faces import MadeFaces
from .model import Model
from .reynolds import sides
from .views import Raised

STEP = 1e-30  # relative, of a complex step


def can(problem: LubricationProblem, model: Model, least: int = MANY, held: bool = False, rims: bool = False) -> bool:
    """Whether the coefficients are those of a steady film alone, under a wall that moves, and compiled loops pay.

    held : supplies may hold some cells. rims : round edges may cut faces.
    """
    grid = problem.grid
    plain = type(problem) is LubricationProblem and problem.plain and (rims or not model.cut)
    plain = plain and (held or problem.held is None)
    flow = not model.mean_cubes and model.U > 0.0 and model.stored is None and model.law is None
    return plain and flow and grid.dim == 2 and "closed" not in grid.ends[0] and grid.size >= least and has_numba()


class Weighed:
    """w' G at a problem's fields, w of the owned points. Collective, as its methods.

    Parameters
    ----------
    p : Pa above p_c, r : owned points.
    """

    def __init__(self, problem: LubricationProblem, model: Model, p: Array, r: Array):
        self.problem, self.scheme, self.grid = problem, model.scheme, problem.grid
        enters = problem.r_in if self.grid.ends[0][0] == "open" else 0.0
        self._p, self._r = ghosted(self.grid, p, 0.0), ghosted(self.grid, r, enters)
        self._film, step = Around(model.gap, self.grid), STEP * float(np.max(np.abs(model.gap(self.grid.x, self.grid.y[:1]))))
        self._raised, self._step = Around(Raised(model.gap, 1j * step), self.grid), step
        self._cut = [self._film.edges(side) for side in range(2)]
        self._made = MadeFaces.of(problem, self._raised, complex)
        self._at = FaceLines.of(self.grid, level(self._film), tuple(self._cut[1]), self._made.apart)

    def by_film(self, w: Array, unit: float, even: bool = False) -> Array:
        """What w' G changes by with the film at each owned point, that between two points being their mean, in so many m/s.

        even : all is symmetric about the middle line, film and weights too, on one rank."""
        from .cell_loops import loop_by_film

        grid, problem, at, ghosts = self.grid, self.problem, self._at, ("open", "closed", "mirror")
        weights, (pressed, ends, dragged) = ghosted(grid, w, 0.0), line_factors(grid)
        west, east, south, north = (mask.ravel() for mask in sides(grid, ghosts))
        closed = [mask.ravel() for mask in sides(grid, ghosts[1:])[2:]]
        along, before = np.where([west, east], 1.0, 0.5), np.array([1.0 * west, np.ones(grid.box[1])])
        parts = [along, before if self.scheme == "upwind" else along, along if self.scheme == "face" else before]
        of_lines = np.array([pressed / (problem.mu * unit), dragged * (problem.U / unit)])
        of_faces = ends / (problem.mu * unit) * np.ones((2, 1))
        of_faces[0, :-1] *= np.where(closed[0], 0.0, np.where(south, 1.0, 0.5))
        of_faces[1, 1:] *= np.where(closed[1], 0.0, np.where(north, 1.0, 0.5))

        def add(rows: slice, out: Array) -> None:
            lines, of_line = runs(at.lines, rows.start, rows.stop)
            faces, of_face = runs(at.faces, rows.start, rows.stop + 1)
            C, wall, void = self._along(lines)
            by_x = _dealt(parts, (C / at.steps, wall, void))
            by_y = self._over(faces) * grid.widths(0), of_face, of_faces[:, rows.start : rows.stop + 1]
            loop_by_film(weights(rows), self._framed(rows), self._r(rows), by_x, of_line, of_lines[:, rows], *by_y, out)

        return self._strip_by_strip(add, even)

    def begun_by_film(self, by_k: Array, by_b: Array, unit: float) -> Array:
        """The same of what changes by so much with k_W and b_W, in these units of flow (`borne.by_coefficients`)."""
        grid, problem, at, (pressed, _, dragged) = self.grid, self.problem, self._at, line_factors(self.grid)
        frames = ghosted(grid, by_k.ravel(), 0.0), ghosted(grid, by_b.ravel(), 0.0)
        k, b = 0.5 * problem.p_unit / (problem.mu * unit) * pressed[:, None], 0.5 * problem.U / unit * dragged[:, None]

        def add(rows: slice, out: Array) -> None:
            lines, of_line = runs(at.lines, rows.start, rows.stop)
            C, _, void = self._along(lines)
            of_k, of_b = (frame(rows)[1:-1, 1:] for frame in frames)
            halves = k[rows] * of_k * (C / at.steps)[of_line] + b[rows] * of_b * void[of_line]
            out += halves[:, :-1] + halves[:, 1:]

        return self._strip_by_strip(add, False)

    def drag_by_film(self, lever: Any, even: bool = False) -> Array:
        """The same of the drag at the wall (`flows.drag`), times the lever of each line, in N/m."""
        from .cell_loops import loop_drag_by_film

        grid, at, speed = self.grid, self._at, self.problem.mu * self.problem.U
        shears, pulls = (np.broadcast_to(share * lever, (grid.box[0], 1)).ravel() for share in line_shares(grid))
        west, east = (mask.ravel() for mask in sides(grid)[:2])
        along, of_lines = np.where([west, east], 1.0, 0.5), np.array([pulls, speed * shears])

        def add(rows: slice, out: Array) -> None:
            lines, of_line = runs(at.lines, rows.start, rows.stop)
            void: Any = np.ones(1)
            if self.scheme == "nodal":
                _, H, before = at.along(self._raised, lines, self._cut)
                void = before / H
            r = self._r(rows)[1:-1, :-1].copy()
            r[:, : int(west.any())] = 0.0
            h, resting, moving = at.sheared(self._raised, lines, 1.0 - void * r[lines - rows.start])
            films = 0.5 * h, at.steps * (resting + 1.0 / moving), at.steps * (void / moving)
            by_x = _dealt([along] * 3, [np.imag(a) / self._step for a in films])
            loop_drag_by_film(self._framed(rows), r, by_x, of_line, of_lines[:, rows], out)

        return self._strip_by_strip(add, even)

    def _strip_by_strip(self, add: Callable[[slice, Array], None], even: bool) -> Array:
        """What is added to the lines of each strip; of what is even half of it is made."""
        out, count = np.zeros(self.grid.box), self.grid.box[0]
        half = count - count // 2 if even else count
        for rows in in_strips(self.grid):
            if rows.start < half:
                some = slice(rows.start, min(rows.stop, half))
                add(some, out[some])
        out[half:] = out[: count - half][::-1]
        return out

    def _framed(self, rows: slice) -> Array:
        """p with a frame that has the sides' pressures."""
        p, part = self._p(rows), places_of(self.grid, rows)
        west, east, south, north = (np.broadcast_to(mask, part.box) for mask in sides(part))
        lines = ((p[1:-1, 0], west[:, 0]), (p[1:-1, -1], east[:, -1]), (p[0, 1:-1], south[0]), (p[-1, 1:-1], north[-1]))
        for (line, mask), p_side in zip(lines, self.problem.p_sides, strict=True):
            line[mask] = p_side
        return p

    def _along(self, lines: Rows) -> list[Array]:
        """Derivatives by a film that is everywhere thicker by as much, of x faces of some lines: of C, of the film that the
        wall drags there and of the void's."""
        film, at = self._film, self._at
        if self._cut[0] or self._cut[1] or self._made.inlet:
            C, H, before = at.along(self._raised, lines, self._cut)
            C, H = self._made.along(at, lines, C, H)
            found = C, before if self.scheme == "upwind" else H, H if self.scheme == "face" else before
            return [np.imag(a) / self._step for a in found]
        x_faces = at.x_places[1]
        h = np.broadcast_to(film(x_faces[None, :], at.y[lines][:, None]), (lines.size, x_faces.size))
        same = np.ones_like(h)
        return [3.0 * h * h, same, same]

    def _over(self, faces: Rows) -> Array:
        """The same of C of some lines of y faces."""
        film, at = self._film, self._at
        if self._cut[0] or self._cut[1]:
            return np.imag(self._made.over(faces, at.over(self._raised, faces, self._cut))) / self._step
        x, y = at.x_places[0][None, 1:-1], at.y_places[1][faces][:, None]
        h = np.broadcast_to(film(x, y), (faces.size, self.grid.box[1]))
        return 3.0 * h * h


def _dealt(parts: Sequence[Array], films: Sequence[Array]) -> Array:
    """Of x faces what belongs to the points behind and before them, shape (lines, 2 films, columns)."""
    found = [(west * a[:, :-1], east * a[:, 1:]) for (west, east), a in zip(parts, films, strict=True)]
    return np.stack([one for pair in found for one in pair], axis=1)
