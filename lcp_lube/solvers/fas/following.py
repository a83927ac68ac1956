"""Multigrid for supplies whose pressures follow from flows: each is one more unknown, with its own equation on every grid.

What a supply's cells give to the film is the sum of their balances, and that is what its source lets through. On the way down
a pressure is set so that this holds beside the cells as they are. What free cells leave goes to the supplies of a coarse grid
as it goes to its cells, so that no flow is lost between the grids; the coarsest one, which is solved exactly, knows how its
whole film answers to each pressure. On the way up pressures change by as much as on the coarser grid.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...base.compiled import kernel
from ...base.parallel import Array
from ...problems.film.flows import volume_unit
from ...problems.film.lubrication import LubricationProblem
from ...problems.film.sources import balanced
from ...problems.film.supplies import Held, Supply, supply_flows
from ...problems.solution import Fields
from . import coarsest
from . import levels as tools
from .kernels import balance_at

LEAST = 0.5  # of a pressure, in one step
STEP = 1e-3  # of a pressure, by which the coarsest grid's answer to it is found
EMPTY = 1e-3  # p_unit: a start for those that fields have empty, as steps are parts of a pressure
SAME = 1e-3  # relative changes of pressures that end the coarsest grid's steps
ROUNDS = 4  # of these, at most
LEAST_PART = 0.5  # of a change of pressures by the coarse grids


class Following:
    """Those of a film that is at `fields`. Collective, as its methods.

    Attributes
    ----------
    P, c, units, flows : on each level the pressures, in p_unit, what is subtracted of the sum of their cells' balances, these
        balances' unit, m3/s, and what the film has taken on the way down, m3/s.
    """

    def __init__(self, problem: LubricationProblem, levels: Sequence[tools.Level], fields: Fields):
        held, n = problem.held, len(levels)
        assert held is not None  # for the type checker: it has supplies
        self.problem, self.levels = problem, levels
        self.free = _free(held)
        self.units = [volume_unit(problem)]
        self.slopes: Array | None = None  # of the coarsest level's whole film
        self.before: dict[int, Array] = {}  # pressures with which each level was left on the way down
        # What the coarse grids of the last cycle changed the finest level's by, and which part of that is taken: films that are
        # cavitated beside a supply take the less of its pressure the coarser the grid is, and pressures would swing.
        self.last, self.part = np.zeros(len(self.free)), np.ones(len(self.free))
        for fine in levels[:-1]:
            self.units.append(self.units[-1] * (2.0 if fine.by_y else 1.0))
        self.at = [[np.flatnonzero(v.owner == k + 1) for k in self.free] for v in levels]
        self.inner = [self._sum(v, inner(v.kx, v.ky, v.owner, v.carry, len(held.supplies))) for v in levels]
        self.P, self.c, self.flows = ([np.zeros(len(self.free))] * n for _ in range(3))
        self.P[0] = np.array([held.supplies[k].p / problem.p_unit for k in self.free])
        self.begin(fields)

    def begin(self, fields: Fields) -> None:
        """With the problem's coefficients, at fields."""
        own = np.array(supply_flows(self.problem, fields["p"], fields["r"]))[self.free]
        self.c[0] = np.zeros(len(self.free))
        self.c[0] = (self.taken(0) - own) / self.units[0]

    def _sum(self, level: tools.Level, of_all: Array) -> Array:
        found: Array = of_all[self.free]
        return level.comm.allreduce(found) if level.split and level.comm is not None else found

    def taken(self, k: int) -> Array:
        """What the film takes on a level, m3/s."""
        v, n = self.levels[k], len(self.problem.held.supplies)  # type: ignore[union-attr]
        return self.units[k] * (self._sum(v, sums(v.z, v.kx, v.ky, v.owner, v.carry, n)) - self.c[k])

    def found(self, P: Array, flows: Array, slopes: Array) -> Array:
        """Pressures (p_unit) at which the sources give what a film takes that takes flows + slopes (x - P)."""
        unit = self.problem.p_unit
        some = [self.problem.held.supplies[k] for k in self.free]  # type: ignore[union-attr]
        new = balanced(some, P * unit, flows, slopes / unit, self.problem.held.law)  # type: ignore[union-attr]
        return P if new is None else np.maximum(new / unit, LEAST * P)

    def shift(self, k: int, new: Array) -> None:
        """New pressures on a level."""
        v = self.levels[k]
        flat = v.z.reshape(-1)
        for places, change in zip(self.at[k], new - self.P[k], strict=True):
            flat[places] += change
        self.P[k] = new
        if k == 0:
            v.given = v.z[v.held]

    def relax(self, k: int) -> None:
        """Pressures at which the sources give what the cells beside them take."""
        flows, slopes = self.taken(k), self.units[k] * self.inner[k]
        new = self.found(self.P[k], flows, np.diag(slopes))
        self.flows[k] = flows + slopes * (new - self.P[k])
        self.shift(k, new)

    def descend(self, k: int) -> None:
        """Level k + 1's equations, whose cells' right-hand sides are there."""
        coarse = self.levels[k + 1]
        rows = owned(coarse.c, coarse.owner, len(self.problem.held.supplies))  # type: ignore[union-attr]
        self.c[k + 1] = self._sum(coarse, rows) - self.flows[k] / self.units[k + 1]
        self.P[k + 1] = self.before[k] = self.P[k]

    def ascend(self, k: int) -> None:
        """What level k + 1's pressures have changed by, or `part` of it on the finest level."""
        step = self.P[k + 1] - self.before[k]
        if k == 0:
            with np.errstate(all="ignore"):
                part = self.part / (1.0 - step / self.last)
            self.part, self.last = np.clip(np.where(part > 0.0, part, 1.0), LEAST_PART, 1.0), step
            step = self.part * step
        self.shift(k, np.maximum(self.P[k] + step, LEAST * self.P[k]))

    def solve(self, k: int) -> None:
        """The coarsest level, whose cells alone are solved already."""
        z = self.levels[k].z
        if self.slopes is None:
            P, here, flows, columns = self.P[k], z.copy(), self.taken(k), []
            for t in range(P.size):
                more = P.copy()
                more[t] *= 1.0 + STEP
                self.shift(k, more)
                coarsest.solve(self.levels[k])
                columns.append((self.taken(k) - flows) / (more[t] - P[t]))
                z[:], self.P[k] = here, P
            self.slopes = np.stack(columns, axis=1)
        for _ in range(ROUNDS):
            new, P = self.found(self.P[k], self.taken(k), self.slopes), self.P[k]
            self.shift(k, new)
            coarsest.solve(self.levels[k])
            if np.max(np.abs(new - P)) <= SAME * np.max(P):
                break

    def beside(self, part: float, flows: Array) -> tuple[float, Array]:
        """What the film takes more, and at which pressures, where all of them have grown by this part; flows : of all then."""
        slopes, P = self.units[0] * self.inner[0], (1.0 + part) * self.P[0]
        new = self.found(P, flows[self.free], np.diag(slopes))
        return float(slopes @ (new - P)), new

    def put(self, new: Array) -> None:
        """New pressures on the finest level, and for the problem."""
        self.shift(0, new)
        self.problem.hold_at(_at(self.problem, dict(zip(self.free, new, strict=True))))


def foreseen(problem: LubricationProblem, p: Array) -> bool:
    """Hold supplies that follow at the pressures that a start has; whether there are any. Collective."""
    held = problem.held
    if held is None or not (free := _free(held)):
        return False
    own = {k: problem.reduce.max(np.where(held.owner.ravel() == k, p, 0.0)) or EMPTY for k in free}
    problem.hold_at(_at(problem, own))
    return True


def _free(held: Held) -> list[int]:
    return [k for k, one in enumerate(held.supplies) if one.open]


def _at(problem: LubricationProblem, own: dict[int, float]) -> list[Supply]:
    """The supplies, some of them at these pressures, p_unit."""
    unit, supplies = problem.p_unit, problem.held.supplies  # type: ignore[union-attr]
    return [replace(one, p=float(own[k]) * unit) if k in own else one for k, one in enumerate(supplies)]


@kernel
def sums(z: Array, kx: Array, ky: Array, owner: Array, carry: Array | None, n: int) -> Array:
    """Of G over the points of each supply."""
    out = np.zeros(n)
    for m in range(1, z.shape[0] - 1):
        for i in range(1, z.shape[1] - 1):
            if owner[m, i] > 0:
                out[int(owner[m, i]) - 1] += balance_at(z, kx, ky, m, i, carry)
    return out


@kernel
def owned(c: Array, owner: Array, n: int) -> Array:
    """Sums of values over the points of each supply."""
    out = np.zeros(n)
    for m in range(1, c.shape[0] - 1):
        for i in range(1, c.shape[1] - 1):
            if owner[m, i] > 0:
                out[int(owner[m, i]) - 1] += c[m, i]
    return out


@kernel
def inner(kx: Array, ky: Array, owner: Array, carry: Array | None, n: int) -> Array:
    """By how much each supply's sum of G grows with its own pressure, its neighbours' being held."""
    out = np.zeros(n)
    for m in range(1, owner.shape[0] - 1):
        for i in range(1, owner.shape[1] - 1):
            own = owner[m, i]
            if own > 0:
                k = (kx[m, i] if owner[m, i - 1] != own else 0.0) + (kx[m, i + 1] if owner[m, i + 1] != own else 0.0)
                k += (ky[m, i] if owner[m - 1, i] != own else 0.0) + (ky[m + 1, i] if owner[m + 1, i] != own else 0.0)
                out[int(own) - 1] += k + (0.0 if carry is None else carry[1, m, i])
    return out
