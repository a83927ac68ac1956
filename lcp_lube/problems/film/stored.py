"""What the cells of a moving film store: the term that a time step adds to the balance of the steady film.

    A p + B r - c + 2 dx d/dt[h (1 - r)] = 0,     d/dt u ~ weight u - old     (implicit Euler, BDF2)

puts -2 dx weight h on r's diagonal and 2 dx (old - weight h) to c. -B gains a positive diagonal: a step is of the same M-matrix
family as the steady problem, and what holds for that one holds for it.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.parallel import Array
from ..grid import Grid
from ..transfer import Pick, numbers
from .edges import GAUSS, Around, edges_inside

if TYPE_CHECKING:
    from .lubrication import LubricationProblem


@dataclass(frozen=True)
class Stored:
    """A difference formula, and what it has of the contents h (1 - r) of earlier times.

    Parameters
    ----------
    weight : of the contents sought, 1/s.
    old : m/s, at this rank's points of `grid`, that of the whole march.
    first, step : the film that is solved is a part of that one: its column i is column first + step i there, counted round.
    exact : what hangs on the step's answer needs its last digit.
    carried : as `old`, of what the oil carries along, contents times temperature; None: nothing.
    lapse : norm of what the formula errs by, as far as the last steps tell, in parts of that of `old`.
    """

    weight: float
    old: Array
    grid: Grid
    first: int = 0
    step: int = 1
    exact: bool = False
    carried: Array | None = None
    lapse: float = 0.0

    def on(self, grid: Grid, values: Array | None = None) -> Array:
        """`old`, or other values there, at the owned points of the film's own grid, shape `grid.box`. Collective."""
        values = self.old if values is None else values
        return (values if grid is self.grid else _of_part(self.grid, values, grid, self.first, self.step)).reshape(grid.box)

    def terms(self, grid: Grid, film: Any, share: Array, b_C: Array, c: Array) -> dict[str, Array]:
        """What it makes of a scheme; share : twice the area that a row of the balance has for each m of film."""
        storage, kept = share * self.weight * mean_film(grid, film), share * self.on(grid)
        return {"b_C": b_C - storage, "c": c + kept - storage, "storage": storage, "kept": kept}

    @property
    def mirrored(self) -> "Stored":
        """Of the mirror image in x of the whole film."""
        return replace(self, first=-1 - self.first, step=-self.step)

    def starting(self, first: int) -> "Stored":
        """Of the part that begins at this column."""
        return replace(self, first=self.first + self.step * first)


@dataclass(frozen=True)
class Dry:
    """Which points of a film are cavitated, as `rims.state_of` tells, on this rank; a part begins at its column `first`."""

    values: Array
    grid: Grid
    first: int = 0

    def on(self, grid: Grid) -> Array:
        """At the owned points of a part's own grid. Collective."""
        return _of_part(self.grid, self.values, grid, self.first)

    def starting(self, first: int) -> "Dry":
        """Of the part that begins at this column."""
        return replace(self, first=self.first + first)


def _of_part(whole: Grid, values: Array, grid: Grid, first: int, step: int = 1) -> Array:
    """Values at the points of a film's part, whose lines are the film's first ones. Collective."""
    j, i = numbers(grid)
    take = Pick(whole, grid, j, (first + step * i) % whole.shape[0])
    found = take(values)
    take.destroy()
    return found


def storing(problem: "LubricationProblem", p: Array, r: Array) -> float:
    """What all cells come to store, as `boundary_flows` has flows; 0 in a steady film. Collective."""
    s = problem.scheme
    if s.storage is None or s.kept is None:
        return 0.0
    more = 0.0 if s.gives is None else s.gives * p.reshape(problem.grid.box)
    return s.flow_unit * problem.reduce.sum(s.storage * (1.0 - r.reshape(problem.grid.box)) + more - s.kept)


def mean_film(grid: Grid, film: Any) -> Array:
    """The film of each owned cell, m, shape `grid.box`: its value at the point, or where edges lie inside, its mean.

    Else a pocket that travels would fill a whole cell at the moment when its edge passes the point.
    """
    film = film if isinstance(film, Around) else Around(film, grid)
    h = np.array(np.broadcast_to(film(grid.x, grid.y), grid.box), dtype=float)
    jumps = [film.edges(side) for side in range(grid.dim)]
    if not any(jumps):
        return h
    faces = [grid.nodes_and_faces(side)[1] for side in range(grid.dim)]
    columns, pieces = edges_inside(faces[0][:-1], faces[0][1:], jumps[0], film.period(0))

    def along(y: Array) -> Array:
        values = np.array(np.broadcast_to(film(grid.x, y[:, None]), (y.size, grid.box[1])))
        if columns.size:
            mean = 0.0
            for a, b in pairwise(pieces):
                for part in GAUSS:
                    piece = np.broadcast_to(film((a + part * (b - a))[None, :], y[:, None]), (y.size, columns.size))
                    mean = mean + 0.5 * (b - a) / (pieces[-1] - pieces[0]) * piece
            values[:, columns] = mean
        return values

    h = along(grid.y[:, 0])
    if grid.dim == 2:
        rows, strips = edges_inside(faces[1][:-1], faces[1][1:], jumps[1], film.period(1))
        if rows.size:
            h[rows] = sum(((b - a) / (strips[-1] - strips[0]))[:, None] * along(0.5 * (a + b)) for a, b in pairwise(strips))
    return h
