"""The largest pressure at a round edge, where it has a kink that lies on no point.

Where a rim parts two points of a full film their face is made of resistances in series (`rims`), so that the pressure is known
all along it: with g_n(t) = Int_0^t h^-n / Int h^-n

    p(t) = p_1 + (p_2 - p_1) g_3(t) + D (g_2(t) - g_3(t)),    D = 6 mu U Int h^-2.

Where the viscosity follows Barus' law that is q's (`fluid`). A film that becomes thin there has its top at the rim. The largest
pressure of all points errs by first order, by up to half of what the pressure rises over a cell.
"""

from dataclasses import dataclass
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np
from mpi4py import MPI

from ...base.parallel import Array
from ..strips import each_strip, ghosted
from .edges import Around
from .fluid import Law
from .rims import LOOKS, depth_of

if TYPE_CHECKING:
    from .lubrication import LubricationProblem

TIE = 1e-9  # relative: tops so near the largest one are as large, and the first of them has it


@dataclass(frozen=True)
class RimTop:
    """A top between two points of a line.

    value : in the unit of p. place : x and y, m. points : global numbers of the points to the west and east of it.
    shares : what it changes by with their pressures. by_film : if the film between them grows by 1 m, pressures held.
    """

    value: float
    place: list[float]
    points: tuple[int, int]
    shares: tuple[float, float]
    by_film: float


def rim_top(problem: "LubricationProblem", p: Array, unit: float, largest: float) -> RimTop | None:
    """The highest pressure at a rim, where that is above the largest known so far; else None. Collective.

    Parameters
    ----------
    p : owned points, and largest : in parts of `unit`, Pa.
    """
    grid, film = problem.grid, Around(problem.film, problem.grid)
    rims = [rim for rim in film.rims if not depth_of(rim)]  # about slanted edges faces are more than what lies in series
    if grid.dim == 1 or not rims:
        return None
    frame = ghosted(grid, p, 0.0)

    def candidates(rows: slice) -> tuple[Any, ...]:
        """Faces to the east of full points between which the wall could raise the pressure above the largest."""
        around, scheme = frame(rows)[1:-1, 1:], problem.scheme.rows(rows)
        here, east = around[:, :-1], around[:, 1:]
        with np.errstate(divide="ignore", invalid="ignore"):
            rise = np.abs(scheme.couette_E / scheme.k_E) * (problem.p_unit / unit)
            j, i = np.nonzero((here > 0.0) & (east > 0.0) & (np.maximum(here, east) + rise > largest))
        return j + rows.start, i, here[j, i], east[j, i]

    j, i, first, last = map(np.concatenate, zip(*each_strip(grid, candidates), strict=True))
    x, d, y = grid.nodes_and_faces(0)[0][i + 1], grid.steps(0)[1:][i], grid.y[j, 0]
    crossed = np.any([rim(x, y) * rim(x + d, y) <= 0.0 for rim in rims], axis=0) if j.size else np.zeros(0, dtype=bool)
    j, i, first, last, x, d, y = (a[crossed] for a in (j, i, first, last, x, d, y))
    places = (np.arange(LOOKS) + 0.5)[:, None] / LOOKS
    h = np.broadcast_to(film(x + d * places, y), (LOOKS, x.size))
    law, ends = Law(problem.barus), (first * unit, last * unit)
    q_ends, pull = [law.reduced(p) for p in ends], _pull(problem, h, d, y, j, i) * law.mobility(*ends)
    q, share = _between(q_ends[0], q_ends[1], h, pull)
    k, n = np.argmax(q, axis=0), np.arange(x.size)
    highest = np.nan_to_num(law.pressure(q[k, n]), posinf=0.0) / unit
    tops = np.zeros(grid.box)
    tops[j, i] = highest
    # The same number, the first one as `drivers.derivatives.tape` follows it.
    value, most = problem.reduce.max(tops), grid.comm.allreduce(float(highest.max(initial=0.0)), MPI.MAX)
    if not most > largest:
        return None
    found: tuple[Any, ...] = ((inf,),)
    if (near := np.flatnonzero(highest >= most - TIE * most)).size:
        n, at, number = near[0], near[:1], grid.neighbours()[1:-1]
        look, row, column, step = k[n], j[n], i[n], 1e-30 * h[0, n]
        moved = _between(q_ends[0][at], q_ends[1][at], h[:, at] + 1j * step, pull[at])[0][look, 0]
        by_q = law.viscosity(highest[n] * unit)  # dp/dq
        shares = [
            by_q / law.viscosity(p[n]) * part for p, part in zip(ends, (1.0 - share[look, n], share[look, n]), strict=True)
        ]
        points = int(number[row, column + 1]), int(number[row, column + 2])
        place = [float(x[n] + d[n] * (look + 1) / LOOKS), float(y[n])]
        found = points, place, shares, float(by_q * moved.imag / (step * unit))
    points, place, shares, by_film = grid.comm.allreduce(found, MPI.MIN)
    return RimTop(value, place, points, shares, by_film)


def _pull(problem: "LubricationProblem", h: Array, d: Array, y: Array, j: Array, i: Array) -> Array:
    """D over the mean of h^-2, Pa m2, of the faces to the east of some points; with effects as the coefficients have it."""
    if not problem.plain:
        s = problem.scheme
        return s.couette_E[j, i] / s.k_E[j, i] * problem.p_unit / np.mean(h**-2.0, axis=0)
    return 6.0 * problem.mu * problem.U * d * problem.grid.stretch(y) ** 2


def _between(first: Array, last: Array, h: Any, pull: Array) -> tuple[Any, Any]:
    """p and g_3 behind each look of faces, shape (looks, faces), from the film at the looks. pull : `_pull`."""
    squares, cubes = np.cumsum(h**-2.0, axis=0), np.cumsum(h**-3.0, axis=0)
    share, dragged = cubes / cubes[-1], pull * squares[-1] / len(h)
    return first + (last - first) * share + dragged * (squares / squares[-1] - share), share
