"""The coarsest grid's problem to rounding: Newton's method on the active set, each step by banded elimination.

Sweeps alone would need as many as the conductances differ by where two points of the grid lie in one deep pocket: it is a
region of one pressure, which they hardly move.
"""

import numpy as np
from numpy.typing import NDArray

from ...base.compiled import kernel, piece
from ...base.parallel import Array
from .fronts import relax_pairs
from .held import free_spans
from .kernels import balance_at

MOST_STEPS = 60  # sets of full cells; what has not settled is left to the cycles at the best of them
MOST_SINGULAR = 8  # steps without a solution, for signs may pass through a closed line of void
PATIENCE = 4  # steps without a fall of the residual by 10 %, after which sweeps take over for a while
SWEEPS, RESCUE_SWEEPS, MOST_SWEEPS = 8, 32, 4096  # between two steps; where they have stalled, at first and at most


@kernel
def solve(
    z: Array,
    kx: Array,
    ky: Array,
    c: Array,
    ring_x: bool,
    ring_y: bool,
    carry: Array | None = None,
    held: NDArray[np.bool_] | None = None,
    factors: Array | None = None,
    signs: NDArray[np.int8] | None = None,
) -> bool:
    """Solve G(z) = c in place, arrays as in `kernels`; returns whether the signs of z settled.

    Each step is followed by sweeps, which bring order into the signs where steps alone cycle. Where the signs do not settle,
    z is the best that was met. factors, signs : J's factors, where they are kept from one call to the next, of `entries`
    numbers, and the signs of z they are of; 0 where they are of none.
    """
    b = entries(z.shape[1] - 2, z.shape[0] - 2, ring_x, ring_y)
    J = np.zeros(((z.shape[0] - 2) * (z.shape[1] - 2), b)) if factors is None else factors
    known = np.zeros(z.shape, dtype=np.int8) if signs is None else signs
    spans = free_spans(np.zeros(z.shape, dtype=np.bool_) if held is None else held)
    best, least, stalled, rescue, singular = z.copy(), np.inf, 0, RESCUE_SWEEPS, 0
    for _ in range(MOST_STEPS):
        full = z > 0.0
        stepped = newton_step(z, kx, ky, c, ring_x, ring_y, carry, held, J, known)
        wrap(z, ring_x, ring_y)
        if stepped and (full == (z > 0.0)).all():
            return True
        singular += not stepped
        if singular > MOST_SINGULAR:  # void gathers in a line that is closed: there may be no solution
            break
        sweeps = SWEEPS
        if stalled == PATIENCE or not stepped:
            sweeps, rescue, stalled = rescue, min(2 * rescue, MOST_SWEEPS), 0
        for s in range(sweeps):
            for k in range(len(spans)):
                at = len(spans) - 1 - k if s % 2 else k
                relax_pairs(z, kx, ky, c, spans[at, 0], spans[at, 1], spans[at, 2], carry)
            wrap(z, ring_x, ring_y)
        size = residual_square(z, kx, ky, c, carry, held)
        stalled = 0 if size < 0.8 * least else stalled + 1
        if size < least:
            best[:], least = z, size
    z[:] = best
    return False


@piece
def wrap(z: Array, ring_x: bool, ring_y: bool) -> None:
    """The frame beyond periodic sides."""
    if ring_x:
        z[:, 0], z[:, -1] = z[:, -2], z[:, 1]
    if ring_y:
        z[0], z[-1] = z[-2], z[1]


@piece
def residual_square(
    z: Array, kx: Array, ky: Array, c: Array, carry: Array | None = None, held: NDArray[np.bool_] | None = None
) -> float:
    """||c - G(z)||^2 of the points that are free."""
    total = 0.0
    for m in range(1, z.shape[0] - 1):
        for i in range(1, z.shape[1] - 1):
            if held is None or not held[m, i]:
                total += (c[m, i] - balance_at(z, kx, ky, m, i, carry)) ** 2
    return total


@piece
def place(a: int, n: int, ring: bool) -> int:
    """Position of line a of n in the order of elimination: round a ring from both ends, so that neighbours stay near."""
    if not ring:
        return a
    return 2 * a if 2 * a < n else 2 * (n - 1 - a) + 1


@piece
def entries(nx: int, ny: int, ring_x: bool, ring_y: bool) -> int:
    """Of a row of J within its band. The shorter direction runs fastest, so that the band is narrow."""
    by_columns = ny * (2 if ring_x else 1) <= nx * (2 if ring_y else 1)
    fast, ring = (ny, ring_x) if by_columns else (nx, ring_y)
    return 2 * min(2 * fast if ring else fast, nx * ny - 1) + 1


@piece
def newton_step(
    z: Array,
    kx: Array,
    ky: Array,
    c: Array,
    ring_x: bool,
    ring_y: bool,
    carry: Array | None,
    held: NDArray[np.bool_] | None,
    J: Array,
    known: NDArray[np.int8],
) -> bool:
    """z += J^-1 (c - G(z)) for the signs of z; False where J is singular: a line is cavitated all the way round.

    J is column diagonally dominant: no pivoting is needed. J, known : its factors and the signs of z they are of, made anew
    where these are others.
    """
    ny, nx = z.shape[0] - 2, z.shape[1] - 2
    by_columns = ny * (2 if ring_x else 1) <= nx * (2 if ring_y else 1)
    fast, slow, ring = (ny, nx, ring_x) if by_columns else (nx, ny, ring_y)
    b, d = J.shape[1] // 2, np.zeros(nx * ny)
    at = np.empty((ny + 2, nx + 2), dtype=np.int64)
    anew = False
    for m in range(1, ny + 1):
        for i in range(1, nx + 1):
            s, f = (i - 1, m - 1) if by_columns else (m - 1, i - 1)
            at[m, i] = place(s, slow, ring) * fast + f
            if held is None or not held[m, i]:
                d[at[m, i]] = c[m, i] - balance_at(z, kx, ky, m, i, carry)
            anew = anew or known[m, i] != (1 if z[m, i] > 0.0 else -1)
    if anew:
        assemble(z, kx, ky, at, ring_x, ring_y, carry, held, J)
        done = factor(J, b)
        for m in range(1, ny + 1):
            for i in range(1, nx + 1):
                known[m, i] = 0 if not done else 1 if z[m, i] > 0.0 else -1
        if not done:
            return False
    substitute(J, d, b)
    for m in range(1, ny + 1):
        for i in range(1, nx + 1):
            if held is not None and held[m, i]:
                continue
            full = z[m, i] > 0.0
            new = z[m, i] + d[at[m, i]]
            if (new > 0.0) != full:  # a pressure has become a flow of void, or the other way round
                diagonal = kx[m, i] + kx[m, i + 1] + ky[m, i] + ky[m + 1, i]
                new = new * diagonal if full else new / diagonal
            z[m, i] = new
    return True


@piece
def assemble(
    z: Array,
    kx: Array,
    ky: Array,
    at: NDArray[np.int64],
    ring_x: bool,
    ring_y: bool,
    carry: Array | None,
    held: NDArray[np.bool_] | None,
    J: Array,
) -> None:
    """J[row, column - row + b] for the signs of z; at : rows by place."""
    ny, nx, b = z.shape[0] - 2, z.shape[1] - 2, J.shape[1] // 2
    J[:] = 0.0
    for m in range(1, ny + 1):
        for i in range(1, nx + 1):
            here, full = at[m, i], z[m, i] > 0.0
            if held is not None and held[m, i]:
                J[here, b] = 1.0
                continue
            k_W, k_E, k_S, k_N = kx[m, i], kx[m, i + 1], ky[m, i], ky[m + 1, i]
            J[here, b] += k_W + k_E + k_S + k_N + (0.0 if carry is None else carry[1, m, i]) if full else 1.0
            if i < nx or ring_x:
                to = at[m, i + 1 if i < nx else 1]
                J[to, here - to + b] -= k_E if full else 1.0 if carry is None else carry[0, m, i]
            if full and (i > 1 or ring_x):
                to = at[m, i - 1 if i > 1 else nx]
                J[to, here - to + b] -= k_W
            if full and (m < ny or ring_y):
                to = at[m + 1 if m < ny else 1, i]
                J[to, here - to + b] -= k_N
            if full and (m > 1 or ring_y):
                to = at[m - 1 if m > 1 else ny, i]
                J[to, here - to + b] -= k_S


@piece
def factor(J: Array, b: int) -> bool:
    """J = L U in place for a matrix of half bandwidth b, without pivoting. False at a pivot that is rounding."""
    n = J.shape[0]
    least = 1e-14 * J[:, b]
    for k in range(n):
        pivot = J[k, b]
        if not pivot > least[k]:
            return False
        end = min(b, n - 1 - k)
        for r in range(1, end + 1):
            part = J[k + r, b - r]
            if part != 0.0:
                part /= pivot
                J[k + r, b - r] = part
                # Rows by their numbers, columns unsigned: no views, and vector instructions (`kernels.diagonals`).
                above, below, to, at = np.uint32(k), np.uint32(k + r), np.uint32(b - r), np.uint32(b)
                for q in range(np.uint32(1), np.uint32(end + 1)):
                    J[below, to + q] -= part * J[above, at + q]
    return True


@piece
def substitute(J: Array, d: Array, b: int) -> None:
    """d = (L U)^-1 d."""
    n = d.size
    for k in range(n):
        total = d[k]
        for r in range(1, min(b, k) + 1):
            total -= J[k, b - r] * d[k - r]
        d[k] = total
    for k in range(n - 1, -1, -1):
        total = d[k]
        for r in range(1, min(b, n - 1 - k) + 1):
            total -= J[k, b + r] * d[k + r]
        d[k] = total / J[k, b]
