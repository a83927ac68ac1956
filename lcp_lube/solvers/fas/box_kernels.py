"""Loops of the obstacle problem's multigrid over one rank's points, compiled when this module is imported.

Arrays as in `kernels`, with a frame, but for g and its slope, which have the points alone.
f(v)_i = sum of k (v_i - v_neighbour) - m g(v_i) - c_i; m is the area of the cell.
"""

import numpy as np
from numpy.typing import NDArray

from ...base.compiled import kernel, piece
from ...base.parallel import Array


@kernel
def clip(v: Array, bounds: Array, touching: Array) -> None:
    """v within the bounds; touching : -1 at points on one of them, 1 at others, as `front_points` tells full from cavitated."""
    for j in range(v.shape[0]):
        for i in range(v.shape[1]):
            here, lower, upper = v[j, i], bounds[0, j, i], bounds[1, j, i]
            here = lower if here < lower else here  # NaN stays NaN
            here = upper if here > upper else here
            v[j, i], touching[j, i] = here, -1.0 if here <= lower or here >= upper else 1.0


@kernel
def linearise(v: Array, kx: Array, ky: Array, c: Array, m: Array, g: Array, slope: Array, source: Array, over: Array) -> None:
    """Prepare sweeps: Newton's linearisation of g at v, v_i = over_i (source_i + sum of k v_neighbour).

    Where the slope of g eats up more than half of the diagonal, on coarse grids, only half of it is taken: the steps are
    shorter then, and end where they would.
    """
    for j in range(1, v.shape[0] - 1):
        for i in range(1, v.shape[1] - 1):
            total = kx[j, i] + kx[j, i + 1] + ky[j, i] + ky[j + 1, i]
            diagonal = max(total - m[j, i] * slope[j - 1, i - 1], 0.5 * total)
            over[j, i] = 1.0 / diagonal
            source[j, i] = c[j, i] + m[j, i] * g[j - 1, i - 1] + (diagonal - total) * v[j, i]


@piece
def known_of_run(v: Array, kx: Array, ky: Array, prepared: Array, j: int, start: int, end: int, known: Array) -> None:
    """Of the relaxed points start to end - 1 of row j, what no point to the west has a say in, and what each takes of its
    western neighbour: made first, by vector instructions."""
    for i in range(start, end):
        t = prepared[0, j, i] + kx[j, i + 1] * v[j, i + 1] + ky[j, i] * v[j - 1, i] + ky[j + 1, i] * v[j + 1, i]
        known[0, i] = prepared[1, j, i] * t
        known[1, i] = prepared[1, j, i] * kx[j, i]


@piece
def relaxed(known: Array, bounds: Array, j: int, i: int, west: float) -> float:
    """Point i of row j."""
    t = known[0, i] + known[1, i] * west
    t = t if t > bounds[0, j, i] else bounds[0, j, i]
    return t if t < bounds[1, j, i] else bounds[1, j, i]


@piece
def relax(v: Array, kx: Array, ky: Array, bounds: Array, prepared: Array, j: int, start: int, end: int, known: Array) -> None:
    """Projected Gauss-Seidel on points start to end - 1 of row j; bounds: lower, upper; prepared: source, over; known: room."""
    known_of_run(v, kx, ky, prepared, j, start, end, known)
    west = v[j, start - 1]
    for i in range(start, end):
        west = relaxed(known, bounds, j, i, west)
        v[j, i] = west


@kernel
def sweep(v: Array, kx: Array, ky: Array, bounds: Array, prepared: Array, count: int, down: bool) -> None:
    """`count` sweeps over all points, lines upwards or down.

    Two at a time: the second one follows two lines behind. The values are those of sweeps one after the other, but memory is
    passed over once, and two chains of dependent operations overlap.
    """
    ny, nx = v.shape[0] - 2, v.shape[1] - 2
    first, step = (ny, -1) if down else (1, 1)
    known = np.empty((2, 2, nx + 2))
    for before in range(0, count, 2):
        both = before + 1 < count
        for s in range(ny + 2 if both else ny):
            m, n = first + step * s, first + step * (s - 2)
            leads, follows = s < ny, both and s >= 2
            if leads and follows:
                known_of_run(v, kx, ky, prepared, m, 1, nx + 1, known[0])
                known_of_run(v, kx, ky, prepared, n, 1, nx + 1, known[1])
                here, behind = v[m, 0], v[n, 0]
                for i in range(1, nx + 1):
                    here, behind = relaxed(known[0], bounds, m, i, here), relaxed(known[1], bounds, n, i, behind)
                    v[m, i], v[n, i] = here, behind
            elif leads or follows:  # neither behind the end of a film of one line
                relax(v, kx, ky, bounds, prepared, m if leads else n, 1, nx + 1, known[0])


@kernel
def sweep_spans(
    v: Array, kx: Array, ky: Array, bounds: Array, prepared: Array, spans: NDArray[np.int32], found: int, count: int
) -> int:
    """`count` sweeps, to and fro, over runs of points (`fronts.front_spans`); returns how many points these are."""
    points, known = 0, np.empty((2, v.shape[1]))
    for s in range(count):
        for k in range(found):
            at = found - 1 - k if s % 2 == 1 else k
            relax(v, kx, ky, bounds, prepared, spans[at, 0], spans[at, 1], spans[at, 2], known)
    for k in range(found):
        points += spans[k, 2] - spans[k, 1]
    return points


@piece
def leaving(v: Array, kx: Array, ky: Array, j: int, i: int) -> float:
    """A v at a point."""
    here = v[j, i]
    flow = kx[j, i] * (here - v[j, i - 1]) + kx[j, i + 1] * (here - v[j, i + 1])
    return flow + (ky[j, i] * (here - v[j - 1, i]) + ky[j + 1, i] * (here - v[j + 1, i]))


@kernel
def forces(v: Array, kx: Array, ky: Array, c: Array, m: Array, g: Array, bounds: Array, free: Array, held: Array) -> None:
    """-f(v), where no bound holds v against it into `free`, where one does into `held`, 0 elsewhere."""
    for j in range(1, v.shape[0] - 1):
        for i in range(1, v.shape[1] - 1):
            f = leaving(v, kx, ky, j, i) - c[j, i] - m[j, i] * g[j - 1, i - 1]
            holds = (v[j, i] <= bounds[0, j, i] and f > 0.0) or (v[j, i] >= bounds[1, j, i] and f < 0.0)
            free[j, i], held[j, i] = (0.0, -f) if holds else (-f, 0.0)


@kernel
def norms(v: Array, kx: Array, ky: Array, c: Array, m: Array, g: Array, bounds: Array) -> tuple[float, float]:
    """The largest part of the natural residual mid(diagonal (v - u), f, diagonal (v - l)), and the sum of |A v - b| and |m g|,
    whose mean a residual is measured by."""
    largest, terms = 0.0, 0.0
    for j in range(1, v.shape[0] - 1):
        for i in range(1, v.shape[1] - 1):
            flow, supply = leaving(v, kx, ky, j, i) - c[j, i], m[j, i] * g[j - 1, i - 1]
            diagonal = kx[j, i] + kx[j, i + 1] + ky[j, i] + ky[j + 1, i]
            natural = min(flow - supply, diagonal * (v[j, i] - bounds[0, j, i]))
            largest = max(largest, abs(max(natural, diagonal * (v[j, i] - bounds[1, j, i]))))
            terms += abs(flow) + abs(supply)
    return largest, terms


@kernel
def coarse_right_side(
    v: Array, kx: Array, ky: Array, m: Array, g: Array, bounds: Array, free: Array, held: Array, c: Array
) -> None:
    """c such that v would solve the coarse problem if there were no residual; the bounds' forces reach held points alone."""
    for j in range(1, v.shape[0] - 1):
        for i in range(1, v.shape[1] - 1):
            here = v[j, i]
            c[j, i] = leaving(v, kx, ky, j, i) - m[j, i] * g[j - 1, i - 1] + free[j, i]
            if here <= bounds[0, j, i] or here >= bounds[1, j, i]:
                c[j, i] += held[j, i]
