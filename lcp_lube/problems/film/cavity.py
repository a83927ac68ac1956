"""Which points are cavitated: the one definition that quantities, fronts, friction and pictures share."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...base.crew import crew
from ...base.parallel import Array, Reduce

VOID = 1e-9  # void fraction up to which a film counts as full: below what any solve resolves, and nothing that one could see
BLOCK = 65_536  # points that are looked at together


def cavity_sign(reduce: Reduce, p: Array, r: Array) -> Array:
    """p / max|p| - r: negative in the cavity alone, positive (or 0) in the full film. Collective.

    Contact of p with its bound is what the comparison of the two says, in units in which both are at most 1; a void fraction up
    to VOID is none, also where p is zero all over.

    Parameters
    ----------
    p : owned points, above the cavitation pressure, in any unit. r : void fraction there.
    """
    p_max = reduce.largest(p)
    z = p / p_max if p_max > 0 else p
    return np.where(r > VOID, z - r, np.maximum(z, 0.0))


def cavitated(reduce: Reduce, p: Array, r: Array) -> NDArray[np.bool_]:
    """Where `cavity_sign` is negative. Collective."""
    p_max, out = reduce.largest(p), np.empty(p.shape, dtype=bool)

    def look(k: int) -> None:
        some = slice(k * BLOCK, (k + 1) * BLOCK)
        np.greater(r[some], VOID, out=out[some])
        out[some] &= (p[some] / p_max if p_max > 0 else p[some]) < r[some]

    crew().run(look, -(-len(p) // BLOCK))  # what lies between stays in the cache: new memory takes longer than the arithmetic
    return out


def about_to_change(reduce: Reduce, p: Array, r: Array) -> NDArray[np.bool_]:
    """Where p and r both vanish: full or cavitated, as one likes. Collective."""
    small = VOID * reduce.largest(p)
    return (p <= small) & (p >= -small) & (r <= VOID) & (r >= -VOID)
