"""Supplies inside a film: holes, grooves and recesses whose cells hold one pressure, and what leaves them.

A cell whose point lies in a supply is full, p = P and r = 0. Its row of A p + B r = c becomes d (p - P) = 0 with A's own
diagonal d, and void that reaches it is swallowed, b_W = 0. A and -B stay column diagonally dominant M-matrices: rows lose
off-diagonal entries, no column grows. What the supply gives to the film is the balance that its cells would have had. The face
between a held point and a free one resists over the length up to the supply's edge alone, wherever that lies.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from ...base.parallel import Array
from ...errors import InputError
from ..grid import Grid
from .corners import around_corners
from .flows import volume_unit
from .fluid import Law
from .reynolds import BoxScheme

if TYPE_CHECKING:
    from .lubrication import LubricationProblem

MARGIN = 1e-9  # of a shape's extent: a point so near an edge is on it, and belongs to the supply
NEAREST = 1e-4  # part of a spacing: a face to an edge that is nearer resists over this
KNOWN = 1e-8  # part of a pressure that counts as none
WAYS = ((0, -1), (0, 1), (-1, 0), (1, 0))  # dj, di to the neighbours west, east, south, north
HALVINGS = 40  # of the interval in which an edge is looked for: derivatives see no steps, both cells of a face find the same


@dataclass(frozen=True)
class Patch:
    """A rectangle or an ellipse about (x, y), of extents 2 half_x and 2 half_y, m; `period` in x, where the film closes.

    A region says whether points (m, they broadcast) are inside, its middle, the same place with x counted from `start`, its
    mirror image in a film of length L, whether it is its own in the line at y, and its straight edges along an axis.
    """

    x: float
    y: float
    half_x: float
    half_y: float
    round: bool = False
    period: float | None = None

    def inside(self, x: Array, y: Array) -> NDArray[np.bool_]:
        dx, dy = x - self.x, y - self.y
        if self.period is not None:
            dx = np.remainder(dx + 0.5 * self.period, self.period) - 0.5 * self.period
        a, b = np.abs(dx) / self.half_x, np.abs(dy) / self.half_y  # 0 for a half without bound
        return (a**2 + b**2 if self.round else np.maximum(a, b)) <= 1.0 + MARGIN

    @property
    def middle(self) -> tuple[float, float]:
        return self.x, self.y

    def mirrored(self, L: float) -> Patch:
        return replace(self, x=L - self.x)

    def symmetric(self, y: float) -> bool:
        return self.half_y == math.inf or abs(self.y - y) <= MARGIN * self.half_y

    def edges(self, axis: str) -> tuple[float, ...]:
        middle, half = (self.x, self.half_x) if axis == "x" else (self.y, self.half_y)
        if self.round or half == math.inf:
            return ()
        ends = (middle - half, middle + half)
        return tuple(t % self.period for t in ends) if axis == "x" and self.period is not None else ends


@dataclass(frozen=True)
class Where:
    """Where a function of x and y (m) is positive, x counted forwards or, from `end` back, backwards."""

    function: Callable[[Array, Array], Array]
    centre: tuple[float, float]
    end: float | None = None

    def inside(self, x: Array, y: Array) -> NDArray[np.bool_]:
        return self.function(x if self.end is None else self.end - x, y) > 0

    @property
    def middle(self) -> tuple[float, float]:
        x, y = self.centre
        return (x if self.end is None else self.end - x), y

    def mirrored(self, L: float) -> Where:
        return replace(self, end=L)

    def symmetric(self, y: float) -> bool:
        return False

    def edges(self, axis: str) -> tuple[float, ...]:
        return ()


Region = Patch | Where  # where a supply lies


@dataclass(frozen=True)
class Supply:
    """A region that one source feeds.

    p : its pressure, Pa above p_c: given, or the last one found. flow : volume flow that it gives, m3/s
    (1D: m2/s). law, K, p_s : or a restrictor before it, 'capillary', flow = K (p_s - p), or 'orifice', flow = K sqrt(p_s - p),
    back again where p > p_s; p_s in Pa above p_c. backflow : whether that may happen.
    """

    region: Region
    p: float = 0.0
    flow: float | None = None
    law: str | None = None
    K: float = 0.0
    p_s: float = 0.0
    backflow: bool = False

    @property
    def open(self) -> bool:
        """Whether its pressure has to be found."""
        return self.flow is not None or self.law is not None

    @property
    def half(self) -> Supply:
        """What half of a film that is symmetric about it gets."""
        return replace(self, K=0.5 * self.K, flow=None if self.flow is None else 0.5 * self.flow)

    def misfit(self, p: float, flow: float) -> tuple[float, float, float]:
        """What source and film disagree by where the film takes `flow` at the pressure p, and its derivatives by both.

        A flow (m3/s), or behind an orifice a pressure (Pa), p - p_s + (flow/K)^2: the root has none where nothing flows.
        """
        if not self.open:
            return 0.0, 1.0, 0.0
        if self.law != "orifice":
            return flow - self.given(p), self.K, 1.0
        return p - self.p_s + flow * abs(flow) / self.K**2, 1.0, 2.0 * abs(flow) / self.K**2

    def given(self, p: float) -> float:
        """What its source lets through at the pressure p, m3/s."""
        if self.law != "orifice":
            return self.K * (self.p_s - p) if self.flow is None else self.flow
        return math.copysign(self.K * math.sqrt(abs(self.p_s - p)), self.p_s - p)

    def sought(self, p: float, flow: float) -> tuple[float, float, float]:
        """As `misfit`, for the next p by Newton's method: in flows also behind an orifice of which the film asks too much,
        as the square grows beyond bounds there, and its steps are halves.
        """
        if self.law != "orifice" or not flow**2 > self.K**2 * abs(self.p_s - p) > 0.0:
            return self.misfit(p, flow)
        return flow - self.given(p), 0.5 * self.given(p) / (self.p_s - p), 1.0

    def defect(self, p: float, flow: float, largest: float, least: float, rounding: float) -> float:
        """The misfit beyond rounding in parts of the largest flow; behind an orifice, of its pressures or of its own flow.

        least : flow that is next to nothing. rounding : of the flow; as much as makes 1e-8 of a restrictor's pressures counts.
        """
        (off, by_p, by_flow), orifice = map(abs, self.misfit(p, flow)), self.law == "orifice"
        pressure = max(abs(p), abs(self.p_s))
        off -= min(rounding * (by_flow + rounding / self.K**2 if orifice else 1.0), by_p * KNOWN * pressure or np.inf)
        part = max(off, 0.0) / ((pressure if orifice else max(largest, least)) or 1.0)
        return min(part, max(abs(flow - self.given(p)) - rounding, 0.0) / (max(abs(flow), least) or 1.0)) if orifice else part


@dataclass(frozen=True)
class Held:
    """The supplies of a problem, and the number of the supply at each owned point, -1 outside, shape (ny, nx).

    law : whose q the supplies' p are; None: pressures.
    """

    supplies: tuple[Supply, ...]
    owner: NDArray[np.int64]
    law: Law | None = None

    @property
    def mask(self) -> NDArray[np.bool_]:
        return self.owner >= 0

    def pressures(self, p_unit: float) -> Array:
        """P at every owned point, in p_unit; 0 outside."""
        return np.append([supply.p / p_unit for supply in self.supplies], 0.0)[self.owner]


def hold(
    grid: Grid, scheme: BoxScheme, supplies: Sequence[Supply], p_unit: float, to_edges: bool = False
) -> tuple[BoxScheme, Held]:
    """The scheme with the supplies' cells held at their pressures. Collective.

    to_edges : whether its conductances are those up to the supplies' edges already (`spans`).

    Raises
    ------
    InputError : two supplies have a point in common, or hold all of a film without a way out, whose matrix has no scale.
    """
    if not grid.reduce.max(scheme.diagonal) > 0:
        raise InputError(f"grid {'x'.join(map(str, grid.shape))}: a supply holds the film's only point, between closed sides")
    held = Held(tuple(supplies), owners(grid, supplies))
    if not to_edges:
        k = zip(("k_W", "k_E", "k_S", "k_N"), shares_of(grid, held), strict=True)
        scheme = scheme.changed(**{name: getattr(scheme, name) / share for name, share in k})
    return pressed(scheme.changed(held=held.mask), held, p_unit), held


def owners(grid: Grid, supplies: Sequence[Supply]) -> NDArray[np.int64]:
    """The number of the supply at each owned point, -1 outside. Collective.

    A supply in which no point lies has the point nearest to its middle.

    Raises
    ------
    InputError : two supplies that are not held at one pressure have a point or an area in common.
    """
    owner = np.full(grid.box, -1, dtype=np.int64)
    for number, supply in enumerate(supplies):
        mine = np.broadcast_to(supply.region.inside(grid.x, grid.y), grid.box)
        if not grid.reduce.sum(mine.astype(float)):
            mine = _nearest(grid, supply.region.middle)
        meet = {k for k in range(number) if _meet(supply.region, supplies[k].region)}
        for other in (meet | {grid.comm.allreduce(int(owner[mine].max(initial=-1)), MPI.MAX)}) - {-1}:
            if supply.open or supplies[other].open or supply.p != supplies[other].p:
                raise InputError(f"supply {other + 1} and supply {number + 1} overlap: allowed where both hold the same p")
        owner = np.where(mine & (owner < 0), number, owner)
    return owner


def _meet(a: Region, b: Region) -> bool:
    """Whether two rectangles have an area in common."""
    if not (isinstance(a, Patch) and isinstance(b, Patch)) or a.round or b.round:
        return False
    dx, dy = abs(math.remainder(a.x - b.x, a.period or math.inf)), abs(a.y - b.y)
    return max(dx - (1.0 - MARGIN) * (a.half_x + b.half_x), dy - (1.0 - MARGIN) * (a.half_y + b.half_y)) < 0.0


def pressed(scheme: BoxScheme, held: Held | None, p_unit: float) -> BoxScheme:
    """The scheme with the supplies' pressures in c."""
    return scheme if held is None else scheme.changed(c=np.where(held.mask, scheme.diagonal * held.pressures(p_unit), scheme.c))


def _nearest(grid: Grid, place: tuple[float, float]) -> NDArray[np.bool_]:
    """The point nearest to a place. Collective."""
    far = np.hypot(grid.x - place[0], grid.y - place[1] if grid.dim == 2 else 0.0)
    j, i = np.unravel_index(np.argmin(far), far.shape)
    best = (round(float(far[j, i]) / (MARGIN * grid.spacing[0])), grid.comm.rank, int(j), int(i))
    _, rank, j, i = grid.comm.allreduce(best, MPI.MIN)
    mine = np.zeros(grid.box, dtype=bool)
    if rank == grid.comm.rank:  # the others' boxes may be smaller
        mine[j, i] = True
    return mine


def shares_of(grid: Grid, held: Held) -> Array:
    """Parts of the ways to the four neighbours over which faces resist: to the edge of a supply, and as at its `corners`."""
    (ny, nx), outside = grid.box, -2
    framed = grid.ghosted(held.owner.astype(float).ravel(), outside=outside).astype(np.int64)
    beside = np.stack([framed[1 + dj : 1 + dj + ny, 1 + di : 1 + di + nx] for dj, di in WAYS])
    shares = np.ones(beside.shape)
    way, j, i = np.nonzero(((held.owner < 0) != (beside < 0)) & ((beside != outside) | (held.owner >= 0)))
    dj, di = np.array(WAYS)[way].T
    owner, other = held.owner[j, i], beside[way, j, i]
    at_x, at_y = grid.with_neighbours(0), grid.with_neighbours(1) if grid.dim == 2 else np.zeros(3)
    start = np.stack([at_x[grid.x_start + i + 1], at_y[grid.y_start + j + 1]])
    end = np.stack([at_x[grid.x_start + i + 1 + di], at_y[grid.y_start + j + 1 + dj]])
    free, full = np.where(owner >= 0, end, start), np.where(owner >= 0, start, end)
    numbers, found = np.maximum(owner, other), np.ones(j.size)
    for number in np.unique(numbers):
        at = numbers == number
        region, first, last = held.supplies[number].region, free[:, at], full[:, at]
        low, high = np.zeros(first.shape[1]), np.ones(first.shape[1])
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            place = first + middle * (last - first)
            for side in np.flatnonzero(grid.periodic):  # both cells of a face there see the same edge
                place[side] = grid.origin[side] + np.remainder(place[side] - grid.origin[side], grid.lengths[side])
            there = region.inside(*place)
            low, high = np.where(there, low, middle), np.where(there, middle, high)
        found[at] = np.maximum(high, NEAREST)
    shares[way, j, i] = np.where((other == outside) & (found == NEAREST), 1.0, found)  # 1: a supply that reaches the side
    return shares / around_corners(grid, [supply.region for supply in held.supplies])


def supply_flows(problem: LubricationProblem, p: Array, r: Array) -> list[float]:
    """Volume flow that each supply gives to the film, m3/s (1D: m2/s). Collective."""
    if (held := problem.held) is None:
        return []
    given, unit = problem.face_flows(p, r).reshape(problem.grid.box), volume_unit(problem)
    return [unit * problem.reduce.sum(np.where(held.owner == k, given, 0.0)) for k in range(len(held.supplies))]
