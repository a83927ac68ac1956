"""Grid lines on the straight edges of a film: even between two edges, as many cells there as its length asks for.

A point on an edge sees the film of either side in its two halves: no cell face, and no strip of one, has an edge inside, so
that the box scheme keeps its second order (docs/accuracy.md). Lines are moved, none is added. Where the number of meshes is a
multiple of 2^k and the spacings hardly suffer (UNEVEN), every stretch has a multiple of 2^k cells: coarser grids of a
multigrid method, and the grids of a refinement by halves, then have lines on the edges too.
"""

import heapq
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ...base.parallel import Array
from ..grid import OFFSET, meshes_of

SAME = 1e-9  # of the length: edges so near each other, or a side, are one
REMEMBERED = 16  # lines
UNEVEN = 1.1  # largest spacing over the mean, up to which a grid is made from a coarser one by halves


def some_places(n: int, length: float, ends: Sequence[str], most: int) -> Array:
    """Coordinates of at most so many of the n points of a line between two ends, its first and last among them, m."""
    return (np.linspace(0, n - 1, min(n, most)).round() + OFFSET[ends[0]]) * (length / meshes_of(n, ends))


def on_edges(n: int, length: float, ends: Sequence[str], edges: Sequence[float]) -> Array | None:
    """Coordinates of n points of a line with one on each edge, m; None where evenly spaced ones will do or are all there is.

    Parameters
    ----------
    ends : kinds of the two ends (`grid.OFFSET`). edges : coordinates from the line's start, m; those off the line count for
        nothing.
    """
    line = _on_edges(n, length, (*ends,), (*edges,))
    return None if line is None else line.copy()


@lru_cache(REMEMBERED)
def _on_edges(n: int, length: float, ends: tuple[str, ...], edges: tuple[float, ...]) -> Array | None:
    """`on_edges`, of searches for places and attitudes, whose films all have the same edges, once."""
    periodic = "periodic" in ends
    knots, lengths = stretches(length, ends, edges)
    if not lengths.size:
        return None
    # Half a mesh of a closed end lies before its first point.
    cut = np.zeros(lengths.size)
    if not periodic:
        cut[0] += 0.5 * (ends[0] == "closed")
        cut[-1] += 0.5 * (ends[1] == "closed")
    meshes = meshes_of(n, ends)
    counts = _counts(lengths, cut, round(meshes + cut.sum()))
    if counts is None:
        return None
    at = np.concatenate([[0.0], np.cumsum(counts - cut)])  # of the knots, in meshes
    if periodic:
        first = int(np.floor(knots[0] * counts[-1] / lengths[-1] + SAME))  # points between 0 and the first edge
        steps = np.arange(n) - first
        line = np.interp(steps % n, at, knots) + length * (steps // n)
    else:
        line = np.interp(np.arange(n) + OFFSET[ends[0]], at, knots)
    even = (np.arange(n) + OFFSET[ends[0]]) * (length / meshes)
    return None if np.allclose(line, even, rtol=0.0, atol=SAME * length) else line


def stretches(length: float, ends: Sequence[str], edges: Sequence[float]) -> tuple[Array, Array]:
    """The ends of the stretches between edges (round a ring the first one again at the end), and their lengths, m; none
    where there are no edges."""
    periodic = "periodic" in ends
    places, slack = np.asarray(edges, dtype=float), SAME * length
    inside = places[(places > slack) & (places < length - slack)]
    at_ends = (np.abs(places) <= slack) | (np.abs(places - length) <= slack)
    places = np.unique(np.concatenate([[0.0] if periodic and at_ends.any() else [], inside]))
    if not places.size:
        return places, places
    places = places[np.concatenate([[True], np.diff(places) > slack])]
    knots = np.concatenate([places, [places[0] + length]]) if periodic else np.concatenate([[0.0], places, [length]])
    return knots, np.diff(knots)


def _counts(stretches: Array, cut: Array, total: int) -> NDArray[np.int64] | None:
    """Cells of each stretch, `total` in all; None where they are too few."""
    alike = bool(np.allclose(stretches, stretches[::-1], rtol=0.0, atol=SAME * stretches.sum()) and cut[0] == cut[-1])
    halvings = 0 if cut.any() else (total & -total).bit_length() - 1
    found = []  # (largest spacing over the mean, counts), of the grid itself first
    for coarse in (total >> k for k in range(halvings + 1) if total >> k >= stretches.size):
        counts = _shared_out(stretches, cut, coarse, alike and (stretches.size % 2 == 1 or coarse % 2 == 0))
        largest = float(np.max(stretches / (counts - cut)) * (coarse - cut.sum()) / stretches.sum())
        found.append((largest, counts * (total // coarse)))
    if not found:
        return None
    allowed = 1.0 if found[0][0] <= 1.0 + SAME else max(found[0][0], UNEVEN)
    return next(counts for largest, counts in reversed(found) if largest <= allowed + SAME)


def _shared_out(stretches: Array, cut: Array, total: int, mirrored: bool) -> NDArray[np.int64]:
    """Cells for each stretch so that sum l d^2, l their lengths and d their spacings, is least; alike about the middle.

    One cell after the other goes where that falls most for its price: the least of a sum of convex terms.
    """
    size = stretches.size
    stretches = np.round(stretches / stretches.sum(), 9)  # of like ones the first gets more, not the longer one by rounding
    half = (size + 1) // 2 if mirrored else size  # those behind the middle follow
    lone = np.arange(half) == half - 1 if mirrored and size % 2 else np.full(half, not mirrored)
    price = np.where(lone, 1, 2)
    step = 2 // price if mirrored else price  # the number of cells in the middle keeps its parity
    counts = np.maximum(1, (stretches[:half] * total).astype(int) - 3)
    if mirrored and size % 2:
        counts[-1] += (total - int(price @ counts)) % 2

    def gain(k: int, more: int) -> float:
        """By how much the sum falls when a stretch has so many cells more."""
        meshes = counts[k] - cut[k]
        return float(stretches[k] ** 3 * (1.0 / meshes**2 - 1.0 / (meshes + more) ** 2)) * price[k]

    while int(price @ counts) > total:  # least ones of many small stretches
        k = min((k for k in range(half) if counts[k] > step[k]), key=lambda k: -gain(k, -int(step[k])))
        counts[k] -= step[k]
    heap = [(-gain(k, int(step[k])), k) for k in range(half)]
    heapq.heapify(heap)
    for _ in range((total - int(price @ counts)) // int(price[0] * step[0])):
        _, k = heapq.heappop(heap)
        counts[k] += step[k]
        heapq.heappush(heap, (-gain(k, int(step[k])), k))
    return np.concatenate([counts, counts[: size - half][::-1]]) if mirrored else counts


def graded_round(n: int, eccentricity: float, L: float) -> Array:
    """n lines round a journal from the groove at its widest gap to the same again, graded towards the thinnest film, m.

    Half of them lie as Sommerfeld's angle psi has it, 1 + e cos(phi) = (1 - e^2)/(1 - e cos(psi)), in which the film's course
    is spread out: their spacings go with the film. The other half lies evenly.
    """
    psi = np.linspace(0.0, 2.0 * np.pi, 200 * (n + 1) + 1)
    wide = np.sqrt((1.0 + eccentricity) / (1.0 - eccentricity))
    phi = 2.0 * np.arctan2(wide * np.sin(0.5 * psi), np.cos(0.5 * psi))
    return np.interp(np.arange(1, n + 1) / (n + 1), (psi + phi) / (4.0 * np.pi), phi) * (L / (2.0 * np.pi))


def graded_across(n: int, reach: float, width: float) -> Array:
    """n lines across a film, graded towards both ends, where the pressure falls within `reach`; m."""
    half = 0.5 * width
    d = np.linspace(0.0, half, 200 * (n + 1) + 1)
    share = 0.5 * (d / half + np.arctan(d / reach) / np.arctan(half / reach))
    t = np.arange(1, n + 1) / (n + 1)
    return np.where(t <= 0.5, np.interp(2.0 * t, share, d), width - np.interp(2.0 - 2.0 * t, share, d))
