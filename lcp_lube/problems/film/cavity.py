"""Which points are cavitated: the one definition that quantities, fronts, friction and pictures share."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ...base.crew import crew
from ...base.parallel import Array, Reduce

VOID = 1e-9  # void fraction up to which a film counts as full: below what any solve resolves, and nothing that one could see
EMPTY = 1e-2  # void fraction that no full film has within the loosest certificate, however small its pressures are
BLOCK = 16_384  # points that are looked at together


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
    p_max = reduce.largest(p)
    return _looked(p, r, lambda p, r: _dry(p, r, p_max))[0]


def about_to_change(reduce: Reduce, p: Array, r: Array) -> NDArray[np.bool_]:
    """Where p and r both vanish: full or cavitated, as one likes. Collective."""
    p_max = reduce.largest(p)
    return _looked(p, r, lambda p, r: _either(p, r, p_max))[0]


def states(reduce: Reduce, p: Array, r: Array) -> list[NDArray[np.bool_]]:
    """`cavitated` and `about_to_change`, in one pass. Collective."""
    p_max = reduce.largest(p)
    return _looked(p, r, lambda p, r: _dry(p, r, p_max), lambda p, r: _either(p, r, p_max))


def _dry(p: Array, r: Array, p_max: float) -> NDArray[np.bool_]:
    void = r > VOID
    if not void.any():
        return void
    some = r > EMPTY
    return some if np.array_equal(some, void) else void & (((p / p_max if p_max > 0 else p) < r) | some)


def _either(p: Array, r: Array, p_max: float) -> NDArray[np.bool_]:
    both = np.abs(p) <= VOID * p_max
    return both & (np.abs(r) <= VOID) if both.any() else both


def _looked(p: Array, r: Array, *looks: Callable[[Array, Array], NDArray[np.bool_]]) -> list[NDArray[np.bool_]]:
    """What is found at each point: what lies between stays in the cache, as new memory takes longer than the arithmetic."""
    blocks = [slice(k, k + BLOCK) for k in range(0, len(p), BLOCK)]
    out = [np.empty(p.shape, dtype=bool) for _ in looks]

    def put(k: int) -> None:
        for into, look in zip(out, looks, strict=True):
            into[blocks[k]] = look(p[blocks[k]], r[blocks[k]])

    crew().run(put, len(blocks))
    return out
