"""Nested iteration: the same scene on a sequence of grids, each started from the answer on the one before."""

from math import prod

from ..problems.solution import Fields, Problem

MIN_POINTS = {1: 50, 2: 24}  # coarsest grid, points a side: small enough to cost nothing, with a front to be found
COARSER = 0.7  # points of a grid `halved` over those of the finer one, at most


def level_shapes(shape: tuple[int, ...], ranks: int = 1) -> list[tuple[int, ...]]:
    """Grids from coarse to fine: (n - 1) // 2 points a side on every coarser one, so that 2^k - 1 points nest.

    In 2D each of the ranks keeps two whole x lines, which the cavity system and the dealing out of the points need.
    """
    shapes = [shape]
    while min(shapes[0]) // 2 >= MIN_POINTS[len(shape)] and (len(shape) == 1 or (shapes[0][1] - 1) // 2 >= 2 * ranks):
        shapes.insert(0, tuple((n - 1) // 2 for n in shapes[0]))
    return shapes


def halved(shape: tuple[int, ...], fewest: int, across: int) -> tuple[int, int] | None:
    """Half of the points along, but at least `fewest`, and across where there are `across`; None if that saves too little."""
    nx, ny = shape
    coarse = max(nx // 2, fewest), ny // 2 | 1 if ny >= across else ny
    return coarse if prod(coarse) <= COARSER * nx * ny else None


def guess(level: Problem, near: tuple[Problem, Fields] | None, interior: bool) -> Fields | None:
    """Fields to start from on this grid. Those of the very same grid are taken as they are, by a method that can."""
    if near is None or (near[0].grid is level.grid and interior):
        return None
    return near[1] if near[0].grid is level.grid else level.prolong(*near, interior) or None
