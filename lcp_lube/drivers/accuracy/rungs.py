"""The grids of a run to an accuracy: the first one, those above it, and which of them is next."""

from collections.abc import Sequence
from fractions import Fraction
from math import ceil, lcm, log2, log10, prod

from ...scenes.scene import Solvable

COARSEST = {1: 12, 2: 4}  # points a side at least on the first grid
FEW = {1: 12, 2: 100}  # points of the first grid at least: coarser ones cost as much, and tell less
JUMP, NEARLY = 1, 0.5  # doublings of the points a side at once, and part of a rung that is not worth one more (of three grids)
FAR = 5  # rungs at once where two grids give an estimate
LOOSE, MOST_FIRST = 1e-2, 2  # a tolerance for which two grids tell most from the first one on; rungs above it at most
ASYMPTOTIC = 0.1  # an estimate below it falls by second order at best
MOST_ROUND, SAME = 720, 1e-9  # meshes that a turn is thought in to find edges, and by how much of a turn they may be off


def first_shape(
    shape: tuple[int, ...], fewest: Sequence[int] = (), finest: tuple[int, ...] | None = None, few: int | None = None
) -> tuple[int, ...]:
    """The first grid, of the scene's own proportions: FEW points, or fewer, so that `finest` leaves room for three grids.

    fewest : meshes a side, without which a film's straight edges find no lines: coarser grids would tell nothing of it. Heeded
        where that is no finer than the scene's own grid, or `finest`.
    few : points, in the place of FEW.
    """
    most, few = finest or shape, few or FEW[len(shape)]

    def enough(n: tuple[int, ...], now: tuple[int, ...]) -> bool:
        cramped = any(2 * points >= end for points, end in zip(now, most, strict=True)) if finest else False
        return min(n) >= COARSEST[len(n)] and (prod(n) >= few or cramped)

    while enough(half := tuple((n - 1) // 2 for n in shape), shape):
        shape = half
    short = max((meshes / (n + 1) for n, meshes in zip(shape, fewest, strict=False)), default=0.0)
    first = tuple(ceil(short * (n + 1)) - 1 for n in shape)
    return first if short > 1.0 and all(n <= m for n, m in zip(first, most, strict=True)) else shape


def finer(shape: tuple[int, ...], meshes: Sequence[float], rung: int, unit: int = 1) -> tuple[int, ...]:
    """The grid so many rungs above one of this shape and these meshes a side: each has twice the points of the one before, in
    the plane every other one half the spacing. The same on any number of ranks.

    unit : of which the meshes along x are a multiple.
    """
    doublings, odd = divmod(rung, 2) if len(shape) == 2 else (rung, 0)
    more = [max(1, round((2.0**0.5 - 1.0) * m / one)) * one * odd for m, one in zip(meshes, (unit, 1), strict=False)]
    return tuple(n + k + round((2**doublings - 1) * (m + k)) for n, m, k in zip(shape, meshes, more, strict=True))


def rungs_up(estimates: Sequence[float], tol: float, known: bool, dim: int, pairs: bool = False) -> int:
    """How many rungs the next grid lies above this one: the first that reaches the tolerance, if an estimate below ASYMPTOTIC
    (of three grids, or of one whose error is known) falls by second order; of several at most JUMP doublings of the points a
    side.

    pairs : two grids give an estimate, for the first one best with half the spacing on the second; at most FAR rungs. There
        another grid after a near miss costs more than a rung too many.
    """
    if pairs and not (len(estimates) >= 2 and estimates[-1] < ASYMPTOTIC):
        return dim
    if not (known or pairs or len(estimates) >= 3) or not estimates[-1] < ASYMPTOTIC:
        return 1
    up = max(1, ceil(dim * log2(estimates[-1] / tol) / 2.0 - (0.0 if pairs else NEARLY)))
    return up if known else min(up, FAR if pairs else dim * JUMP)


def first_rung(tol: float, narrow: bool) -> int:
    """The rung that a run by pairs of grids begins with: one for each tenth of LOOSE, as a solve costs most of what a small
    grid does, and the less there are to the last grid the better.

    narrow : whether a stretch between two edges may be one cell wide, so that a grid tells little of the next one.
    """
    return min(MOST_FIRST, max(MOST_FIRST if narrow else 0, round(log10(LOOSE / tol))))


def round_ring(scene: Solvable, first: tuple[int, ...], finest: tuple[int, ...] | None = None) -> tuple[tuple[int, ...], int]:
    """The first grid, and the meshes along x of whose multiples its own are: on a ring with grooves or pads as many as put
    all their edges on points, where so few will do; else the grid as it is, and 1."""
    edges = getattr(scene, "edges_deg", [])
    parts = [Fraction(edge / 360.0).limit_denominator(MOST_ROUND) for edge in edges]
    unit = lcm(*(part.denominator for part in parts))
    exact = all(abs(part - edge / 360.0) < SAME for part, edge in zip(parts, edges, strict=True))
    n = ceil(first[0] / unit) * unit
    fits = exact and unit <= scene.shape[0] and n <= (finest or (2 * first[0],))[0]
    return ((n, *first[1:]), unit) if fits else (first, 1)
