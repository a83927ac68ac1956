"""Which points are cavitated: the one definition that quantities, fronts, friction and pictures share."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...base.compiled import has_numba
from ...base.crew import by_rows, crew
from ...base.parallel import Array, Reduce
from ...registry import SMALL
from ..grid import Grid

VOID = 1e-9  # void fraction up to which a film counts as full: below what any solve resolves, and nothing that one could see
EMPTY = 1e-2  # void fraction that no full film has within the loosest certificate, however small its pressures are
SHARP = 1e-12  # of the largest flow of void: less is rounding
BLOCK = 65_536  # points that are looked at together


def cavity_sign(reduce: Reduce, p: Array, r: Array) -> Array:
    """p / max|p| - r: negative in the cavity alone, positive (or 0) in the full film. Collective.

    Contact of p with its bound is what the comparison of the two says, in units in which both are at most 1; a void fraction up
    to VOID is none, also where p is zero all over, and one of EMPTY is, also where p is all that an iteration has left of zero.

    Parameters
    ----------
    p : owned points, above the cavitation pressure, in any unit. r : void fraction there.
    """
    p_max = reduce.largest(p)
    z = p / p_max if p_max > 0 else p
    return np.where(r > VOID, np.where(r > EMPTY, 0.0, z) - r, np.maximum(z, 0.0))


def cavitated(reduce: Reduce, p: Array, r: Array) -> NDArray[np.bool_]:
    """Where `cavity_sign` is negative. Collective."""
    if p.size >= SMALL and has_numba():
        return states(reduce, p, r)[0]
    p_max = reduce.largest(p)
    return _looked(lambda p, r: (r > VOID) & (((p / p_max if p_max > 0 else p) < r) | (r > EMPTY)), p, r)


def about_to_change(reduce: Reduce, p: Array, r: Array) -> NDArray[np.bool_]:
    """Where p and r both vanish: full or cavitated, as one likes. Collective."""
    small = VOID * reduce.largest(p)
    return _looked(lambda p, r: (np.abs(p) <= small) & (np.abs(r) <= VOID), p, r)


def missing_flow(c: Array) -> Array | None:
    """b_C r of a film that needs no pressure, from the right-hand sides of whole lines of points; None of any other film.

    Such a film is nowhere narrower than where its oil comes in, and no pressure is given beside it: p = 0, and its void is what
    flow is missing.
    """
    for step in (max(1, len(c) // 4), 1):  # some lines tell most other films
        missing = np.cumsum(c[::step], axis=1)
        if not missing.max(initial=0.0) <= SHARP * -missing.min(initial=0.0):
            return None
    return np.minimum(missing, 0.0)


def states(reduce: Reduce, p: Array, r: Array) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """`cavitated` and `about_to_change`, of large films in one pass. Collective."""
    if p.size < SMALL or not has_numba():
        return cavitated(reduce, p, r), about_to_change(reduce, p, r)
    from .cell_loops import loop_states

    cavity, switching = (np.empty(p.shape, dtype=bool) for _ in range(2))
    p_max = reduce.largest(p)
    look = lambda a, b: loop_states(p[a:b], r[a:b], p_max, VOID, EMPTY, cavity[a:b], switching[a:b])  # noqa: E731
    by_rows(look, p.size, p.size)
    return cavity, switching


def _looked(look: Callable[[Array, Array], NDArray[np.bool_]], p: Array, r: Array) -> NDArray[np.bool_]:
    """What is found at each point: what lies between stays in the cache, as new memory takes longer than the arithmetic."""
    out, blocks = np.empty(p.shape, dtype=bool), [slice(k, k + BLOCK) for k in range(0, len(p), BLOCK)]

    def put(k: int) -> None:
        out[blocks[k]] = look(p[blocks[k]], r[blocks[k]])

    crew().run(put, len(blocks))
    return out


class Inlet(NamedTuple):
    """rows : which owned lines have a cavity at their first point, shape (ny, 1). driven : p_west/(6 mu U), 1/m."""

    rows: NDArray[np.bool_]
    driven: float

    def of(self, lines: Any) -> Inlet:
        return Inlet(self.rows[lines], self.driven)


def ruptured(grid: Grid, state: Array | None, driven: complex = 0.0) -> Inlet | None:
    """What is known of the first faces by `rims.state_of` the points; None where no side is open there."""
    if state is None or grid.dim == 1 or grid.ends[0][0] != "open" or grid.x_start > 0:
        return None
    return Inlet(np.reshape(state, grid.box)[:, :1] > 0.0, float(np.real(driven)))


def followed(Z: Array, p_b: float) -> Array:
    """p along lines (the last axis) followed upstream from p_b and stopped at zero; Z : up to a constant p of the full film."""
    ends = -Z
    ends[..., -1] += p_b
    return Z + np.maximum.accumulate(ends[..., ::-1], axis=-1)[..., ::-1]
