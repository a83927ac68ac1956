"""One unknown on a rectangle: what is symmetric about the middle in x, in y, or in both is solved on a half or a quarter.

Symmetric must be all that the equation is made of: source, bounds, values on the boundary, and the start, which chooses among
several solutions. Newton's steps from there are then symmetric too.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from ..base.parallel import Array
from ..problems.facts import Facts
from ..problems.film.halves import Lent
from ..problems.film.lines import some_places
from ..problems.fold import part_grid, part_shape
from ..problems.grid import OPEN, Grid
from ..problems.solution import Fields, Problem
from ..problems.transfer import numbers
from ..scenes.scene import Derived, Solvable

SAME = 1e-12  # difference that rounding leaves between two values, relative, or to 1 where v itself is of that order

SAMPLE = 33  # columns and lines that are compared first, before anything is built

UNLIKELY = "source, bounds, start and boundary do not all mirror themselves about the middle, neither in x nor in y"
NONE = UNLIKELY


Rectangular = Any  # a scene with one unknown on a rectangle (`scenes.semilinear`)


@dataclass(frozen=True)
class Quarter(Derived):
    """A quarter, or a half, of a scene; shape : that of the whole scene's grid."""

    axes: tuple[bool, bool]

    @property
    def kind(self) -> str:
        return {(True, True): "quarter", (True, False): "half in x", (False, True): "half in y"}[self.axes]

    @property
    def sentence(self) -> str:
        what, how = ("a quarter", "in x and y") if all(self.axes) else ("a half", f"in {'x' if self.axes[0] else 'y'}")
        part, whole = (int(np.prod(shape)) for shape in (part_shape(self.shape, self.axes), self.shape))
        return f"{what} is solved, {part} of {whole} points: all data are symmetric about the middle {how}"

    @property
    def lent(self) -> Lent:
        """What it has of the whole's memory: nothing."""
        return Lent()

    def facts(self, comm: PETSc.Comm | None = None) -> Facts:
        return replace(self.whole.facts(comm), shape=part_shape(self.shape, self.axes))

    def grid(self, comm: PETSc.Comm | None = None) -> Grid:
        """The part's points. Collective."""
        (x0, x1), (y0, y1) = self.whole.rectangle
        return part_grid(self.shape, (x1 - x0, y1 - y0), self.axes, comm, (x0, y0))

    def build(self, comm: PETSc.Comm | None = None) -> Problem:
        """The discrete problem of the part. Collective."""
        return self.whole.problem_on(self.grid(comm))

    def answer(self, problem: Problem) -> Fields | None:
        """None: there always is something to solve."""
        return None

    def places(self, grid: Grid) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Line and column in the part that the owned points of the whole grid are like."""
        (j, i), (nx, ny) = numbers(grid), grid.shape
        return (np.minimum(j, ny - 1 - j) if self.axes[1] else j), (np.minimum(i, nx - 1 - i) if self.axes[0] else i)


def applies(scene: Solvable) -> bool:
    """Whether it is one unknown on a rectangle."""
    return hasattr(scene, "problem_on")  # not by its class: no family is loaded that is not asked for


def promising(scene: Rectangular) -> bool:
    """Whether some columns and lines of the data mirror themselves: nothing is built for a scene where they do not."""
    sides = zip(scene.shape, scene.rectangle, strict=True)
    xs, ys = (start + some_places(n, end - start, OPEN, SAMPLE) for n, (start, end) in sides)
    return any(_mirrored(scene, xs[None, :], ys[:, None]))


def part_of(scene: Rectangular, problem: Problem) -> Quarter | None:
    """The least part of a scene that gives its whole answer; None where that is the scene itself. Collective."""
    grid: Grid = problem.grid
    differs = np.array([not same for same in _mirrored(scene, grid.x, grid.y)], dtype=float)
    x, y = (bool(grid.reduce.max(differs[k : k + 1]) == 0) for k in range(2))
    nx, ny = grid.shape
    axes = x and nx > 1 and grid.comm.size <= ny, y and ny > 1 and grid.comm.size <= ny // 2  # lines for every rank
    return Quarter(scene, axes) if any(axes) else None


def _mirrored(scene: Rectangular, x: Array, y: Array) -> tuple[bool, bool]:
    """Whether all data at these columns and lines are what they are at the mirror images in x, and in y."""
    (x0, x1), (y0, y1) = scene.rectangle
    ends_x, ends_y = np.array([[x0, x1]]), np.array([[y0], [y1]])

    def same(mirror_x: bool, mirror_y: bool) -> bool:
        def image(a: Array, b: Array) -> tuple[Array, Array]:
            return (x0 + x1 - a if mirror_x else a), (y0 + y1 - b if mirror_y else b)

        with np.errstate(all="ignore"):
            pairs = list(zip(scene.inside(x, y), scene.inside(*image(x, y)), strict=True))
        if (boundary := scene.on_boundary) is not None:
            pairs += [(boundary(*at), boundary(*image(*at))) for at in ((ends_x, y), (x, ends_y))]
        return all(map(_close, *zip(*pairs, strict=True)))

    return same(True, False), same(False, True)


def _close(a: Array, b: Array) -> bool:
    with np.errstate(invalid="ignore"):  # inf, where there is no bound, equals inf
        return bool(np.all((a == b) | (np.abs(a - b) <= SAME * np.maximum(np.maximum(np.abs(a), np.abs(b)), 1.0))))
