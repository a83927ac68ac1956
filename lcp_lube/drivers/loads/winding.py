"""Where in a bore a journal may be in balance: cells between places all round, about which the load left over turns."""

import math
from collections.abc import Callable

import numpy as np

from ...base.parallel import Array

AROUND = np.linspace(-math.pi, math.pi, 12, endpoint=False)
WITHIN, OUTER, BEYOND, OUTMOST = -1.0, 2.5, 2.5, 6.5  # rings in t: from; to at least, beyond where closed forms see it, at most
BEST = 6  # places that are tried without a turn about them


def places(left_at: Callable[[float, float], complex], t: float, attitude: float | None) -> tuple[list[Array], int]:
    """Places from which the one of balance may be found, the likeliest first, and the number of solves.

    (F + W)/W is looked at in the middle and on rings. Where it turns once round as a place goes round a cell of four, it is nil
    inside the cell; so it is in one cell at least if the outermost ring presses the journal back. Those where it turns in the
    sense of the place, as a film with stiffness has it, come first, and behind all such cells the places with the least of it.
    Where the attitude is given a cell is a stretch between rings, at whose ends what is left has different signs.

    Parameters
    ----------
    left_at : (F + W)/W at t = log(s/(1 - s)) and an attitude (rad), s as in `position`; NaN without a film.
    t : where closed forms see the journal.
    attitude : where it is given; `left_at` is then what the force's size is short of the load's, over W.
    """
    rings = np.arange(WITHIN, min(max(t + BEYOND, OUTER), OUTMOST))
    q = np.stack(np.meshgrid(rings, AROUND if attitude is None else [attitude], indexing="ij"), axis=-1)
    left = np.full(q.shape[:2], np.nan + 0j)
    for k, ring in enumerate(q):
        left[k] = [left_at(*one) for one in ring]
        if not np.isfinite(left).any():  # nor will there be a film nearer the bore
            return [], (k + 1) * len(ring)
    # Four corners of each cell, the innermost between the middle and the first ring, in the sense of the attitude.
    at = _cells(1.0 / (1.0 + np.exp(-q[..., 0])) * np.exp(1j * q[..., 1]), 0j)
    about = _cells(left, left_at(-math.inf, 0.0))
    if attitude is None:
        turns = np.round(np.angle(np.roll(about, -1, axis=0) / about).sum(axis=0) / (2.0 * math.pi))
    else:
        turns = 0.5 * (np.sign(about[0].real) - np.sign(about[1].real))
    near = np.abs(about) ** -2.0
    inside = (at * near).sum(axis=0) / near.sum(axis=0)
    likely = [inside[turns == sign] for sign in (1.0, -1.0)]
    found = [np.array([math.log(s / (1.0 - s)), np.angle(z)]) for z in np.concatenate(likely) if (s := max(abs(z), 1e-6))]
    with np.errstate(divide="ignore"):  # of a film without force
        miss = np.abs(np.log(np.abs(left - 1.0))) + np.abs(np.angle(1.0 - left))
    order = np.argsort(miss, axis=None)[: min(BEST, int(np.isfinite(miss).sum()))]
    return [*found, *q.reshape(-1, 2)[order]], left.size + 1


def _cells(rings: Array, middle: complex) -> Array:
    """Corners by cell, of values on rings and in the middle."""
    all_ = np.concatenate([np.full((1, rings.shape[1]), middle), rings])
    return np.stack([all_[:-1], all_[1:], np.roll(all_[1:], -1, axis=1), np.roll(all_[:-1], -1, axis=1)])
