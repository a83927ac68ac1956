"""The loops over a level by the threads of the process (`base/crew`): each part of the work is a call of a compiled loop.

Rows that do not depend on one another are dealt out. A Gauss-Seidel sweep is divided into columns: a part of a line begins
when the one to the west of it has ended, so that every point sees what it would see in a sweep by one thread, to the last bit.
"""

from typing import Any

import numpy as np

from ...base.crew import FEWEST, PARTS, by_rows, crew
from ...base.parallel import Array
from ...problems.film.reynolds import BoxScheme
from ...problems.film.strip import by_lines
from ...problems.grid import Grid
from ...problems.solution import Fields
from ...problems.strips import each_strip
from . import coarsen as coarsening
from . import fronts, kernels, starts, steps, transfer
from .waiting import LINE, SLOTS

COLUMNS = 128  # of a part of a line, at least


def sweep(z: Array, *others: Any) -> None:
    """`kernels.sweep` of a film whose lines are open, and that stores no void, by several threads."""
    *_, carry, ring = others
    few = z.size < FEWEST or carry is not None or ring
    parts = 1 if few else min(crew().threads, (z.shape[1] - 2) // COLUMNS)
    if parts < 2:
        kernels.sweep(z, *others)
        return
    done, west = np.zeros((parts, LINE), dtype=np.int64), np.zeros((parts, SLOTS, LINE))
    crew().run(lambda part: kernels.sweep(*(z, *others, part, done, west)), parts, together=True)


def relax_front(z: Array, *others: Any) -> int:
    """`fronts.relax_front`, of a large grid in blocks, whose number does not depend on the threads."""
    blocks = 1 if z.size < FEWEST else min(PARTS, z.shape[0] - 2)
    threads = 1 if blocks == 1 else min(crew().threads, (blocks + 1) // 2)
    done, near = np.zeros((blocks, LINE), dtype=np.int64), np.zeros((2, blocks), dtype=np.int64)
    sweep_blocks = lambda k: fronts.relax_front(*(z, *others, k, threads, done, near))  # noqa: E731
    return int(sweep_blocks(0) if threads == 1 else crew().run(sweep_blocks, threads, together=True)[0])


def norms(z: Array, *others: Any) -> Array:
    """`kernels.norms` of all rows."""
    return np.sum(by_inner_rows(lambda start, end: kernels.norms(*(z, *others, start, end)), z), axis=0)


def inject(z: Array, out: Array, *others: Any) -> None:
    _into(out, z, transfer.inject, z, out, *others)


def coarsen(x_faces: Any, y_faces: Any, *flags: Any) -> None:
    """`coarsen`; x_faces, y_faces : what they are made of, where they go, and whether the last one stands for one alone."""
    for loop, (kx, ky, out, beyond) in ((coarsening.coarsen_x_faces, x_faces), (coarsening.coarsen_y_faces, y_faces)):
        _into(out, kx, loop, kx, ky, out, *flags, beyond)


def make_ways(kx: Array, ky: Array, out: Any, y0: int) -> None:
    _into(out, kx, steps.make_ways, kx, ky, out, y0)


def coarsen_steps(kx: Array, ky: Array, ways: Any, out_x: Array, out_y: Array, *flags: Any) -> None:
    """`steps.coarsen`, dealt out by the rows that are written to."""
    given = (kx, ky, ways, out_x, out_y, *flags)
    by_rows(lambda start, end: steps.coarsen(*(*given, start, end)), out_x.shape[0], kx.size)


def look(kx: Array, ky: Array) -> tuple[float, float, int]:
    """`starts.look` of all rows: the means of the x and of the y faces' conductances, and the number of steps."""
    found = np.sum(by_inner_rows(lambda start, end: starts.look(*(kx, ky, start, end)), kx), axis=0)
    ny, nx = kx.shape[0] - 2, ky.shape[1] - 2
    return float(found[0] / (ny * (nx + 1))), float(found[1] / ((ny + 1) * nx)), int(found[2])


def add_balance(z: Array, *others: Any) -> None:
    by_inner_rows(lambda start, end: kernels.add_balance(*(z, *others, start, end)), z)


def correct(z: Array, *others: Any) -> float:
    return sum(by_inner_rows(lambda start, end: transfer.correct(*(z, *others, start, end)), z))


def correct_steps(z: Array, *others: Any) -> float:
    """`steps.correct` of all rows."""
    return sum(by_inner_rows(lambda start, end: steps.correct(*(z, *others, start, end)), z))


def interpolate(z: Array, *others: Any) -> None:
    by_inner_rows(lambda start, end: starts.interpolate(*(z, *others, start, end)), z)


def restrict(z: Array, kx: Array, ky: Array, c: Array, out: Array, *others: Any) -> None:
    """Dealt out by the rows that are written to."""

    def give(start: int, end: int) -> None:
        out[start:end] = 0.0
        transfer.restrict(*(z, kx, ky, c, out, *others, start, end))

    by_rows(give, out.shape[0], z.size)


def pressure_and_void(z: Array, scheme: BoxScheme, grid: Grid) -> Fields:
    """p and r of the owned points."""
    p, r = np.empty(z.shape), np.empty(z.shape)
    each_strip(grid, lambda rows: kernels.pressure(z[rows], p[rows]))
    void(z, scheme, grid, r)
    return {"p": p.ravel(), "r": r.ravel()}


def void(z: Array, scheme: BoxScheme, grid: Grid, r: Array) -> None:
    """Into r that of the owned points."""
    each_strip(grid, lambda rows: kernels.void(z[rows], by_lines(scheme.rows(rows), "b_C"), r[rows]))


def by_inner_rows(task: Any, z: Array) -> list[Any]:
    """`by_rows` of an array's rows within its frame."""
    return by_rows(lambda start, end: task(start + 1, end + 1), z.shape[0] - 2, z.size)


def _into(out: Array, z: Array, loop: Any, *given: Any) -> None:
    """Dealt out by the rows that are written to, within the frame; z : has as many points as are read."""
    by_rows(lambda start, end: loop(*given, start, end), out.shape[0] - 2, z.size)
