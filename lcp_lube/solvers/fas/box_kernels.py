"""Loops of the obstacle problem's multigrid over one rank's points, compiled when this module is imported.

Arrays as in `kernels`, all with a frame. f(v)_i = sum of k (v_i - v_neighbour) - m g(v_i) - c_i; m is the area of the cell.
"""

import numpy as np
from numpy.typing import NDArray

from ...base.compiled import kernel, piece
from ...base.parallel import Array


@kernel
def linearise(v: Array, kx: Array, ky: Array, c: Array, m: Array, g: Array, slope: Array, source: Array, over: Array) -> None:
    """Prepare sweeps: Newton's linearisation of g at v, v_i = over_i (source_i + sum of k v_neighbour).

    Where the slope of g eats up more than half of the diagonal, on coarse grids, only half of it is taken: the steps are
    shorter then, and end where they would.
    """
    for j in range(1, v.shape[0] - 1):
        for i in range(1, v.shape[1] - 1):
            total = kx[j, i] + kx[j, i + 1] + ky[j, i] + ky[j + 1, i]
            diagonal = max(total - m[j, i] * slope[j, i], 0.5 * total)
            over[j, i] = 1.0 / diagonal
            source[j, i] = c[j, i] + m[j, i] * g[j, i] + (diagonal - total) * v[j, i]


@piece
def relax(v: Array, kx: Array, ky: Array, bounds: Array, prepared: Array, j: int, start: int, end: int) -> None:
    """Projected Gauss-Seidel on points start to end - 1 of row j; bounds: lower, upper; prepared: source, over."""
    west = v[j, start - 1]
    for i in range(start, end):
        t = prepared[0, j, i] + kx[j, i + 1] * v[j, i + 1] + ky[j, i] * v[j - 1, i] + ky[j + 1, i] * v[j + 1, i]
        t = (t + kx[j, i] * west) * prepared[1, j, i]
        t = t if t > bounds[0, j, i] else bounds[0, j, i]
        west = t if t < bounds[1, j, i] else bounds[1, j, i]
        v[j, i] = west


@kernel
def sweep(v: Array, kx: Array, ky: Array, bounds: Array, prepared: Array, count: int, down: bool) -> None:
    """`count` sweeps over all points, lines upwards or down."""
    ny, nx = v.shape[0] - 2, v.shape[1] - 2
    for _ in range(count):
        for line in range(ny):
            relax(v, kx, ky, bounds, prepared, ny - line if down else line + 1, 1, nx + 1)


@kernel
def sweep_spans(
    v: Array, kx: Array, ky: Array, bounds: Array, prepared: Array, spans: NDArray[np.int32], found: int, count: int
) -> int:
    """`count` sweeps, to and fro, over runs of points (`fronts.front_spans`); returns how many points these are."""
    points = 0
    for s in range(count):
        for k in range(found):
            at = found - 1 - k if s % 2 == 1 else k
            relax(v, kx, ky, bounds, prepared, spans[at, 0], spans[at, 1], spans[at, 2])
    for k in range(found):
        points += spans[k, 2] - spans[k, 1]
    return points


@kernel
def residual(
    v: Array, kx: Array, ky: Array, c: Array, m: Array, g: Array, bounds: Array, free: Array, held: Array
) -> tuple[float, float]:
    """-f(v), where no bound holds v against it into `free`, where one does into `held`, 0 elsewhere.

    Returns the largest part of the natural residual mid(diagonal (v - u), f, diagonal (v - l)), and the sum of |A v - b| and
    |m g|, whose mean a residual is measured by.
    """
    largest, terms = 0.0, 0.0
    for j in range(1, v.shape[0] - 1):
        for i in range(1, v.shape[1] - 1):
            here = v[j, i]
            k_W, k_E, k_S, k_N = kx[j, i], kx[j, i + 1], ky[j, i], ky[j + 1, i]
            flow = k_W * (here - v[j, i - 1]) + k_E * (here - v[j, i + 1])
            flow += k_S * (here - v[j - 1, i]) + k_N * (here - v[j + 1, i]) - c[j, i]
            supply = m[j, i] * g[j, i]
            f = flow - supply
            holds = (here <= bounds[0, j, i] and f > 0.0) or (here >= bounds[1, j, i] and f < 0.0)
            free[j, i], held[j, i] = (0.0, -f) if holds else (-f, 0.0)
            diagonal = k_W + k_E + k_S + k_N
            natural = max(min(f, diagonal * (here - bounds[0, j, i])), diagonal * (here - bounds[1, j, i]))
            largest = max(largest, abs(natural))
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
            flow = kx[j, i] * (here - v[j, i - 1]) + kx[j, i + 1] * (here - v[j, i + 1])
            flow += ky[j, i] * (here - v[j - 1, i]) + ky[j + 1, i] * (here - v[j + 1, i])
            c[j, i] = flow - m[j, i] * g[j, i] + free[j, i]
            if here <= bounds[0, j, i] or here >= bounds[1, j, i]:
                c[j, i] += held[j, i]
