"""The memory of a march in time: contents of the film's cells, fields, and the difference formulas that are applied to them.

Implicit Euler, or BDF2 with steps of any length: with w = dt/(step before)

    d/dt u ~ [ (1 + 2 w)/(1 + w) u_new - (1 + w) u_last + w^2/(1 + w) u_before ] / dt.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...base.parallel import Array
from ...problems.film.cavity import cavity_sign
from ...problems.film.flows import point_weights
from ...problems.film.grooves import GroovedProblem
from ...problems.film.lubrication import LubricationProblem
from ...problems.film.stored import Stored
from ...problems.film.supplies import supply_flows
from ...problems.grid import Grid
from ...problems.solution import Fields

LONGEST, SHORTEST, SAFETY = 1.5, 0.2, 0.9  # a step in parts of the one before
ROUNDED = 2.0**-48  # of what the film could hold: an error of sums of contents that is rounding
SCARCE = 1e-9  # likewise: of a film with less oil only rounding is left


@dataclass(frozen=True)
class Formula:
    """d/dt u ~ weight u_new - last u_last - before u_before, 1/s."""

    weight: float
    last: float
    before: float = 0.0

    def old(self, values: list[Any]) -> Any:
        """What it has of earlier values, the newest first."""
        return self.last * values[0] + (self.before * values[1] if self.before else 0.0)


@dataclass
class March:
    """Where the film has got.

    Attributes
    ----------
    grid : of all steps. second : BDF2 in place of Euler's formula.
    t, dts : the time, and the lengths of the last steps; contents : h (1 - r) of the last times, m; fields, full : theirs, and
        which cells were full; carried : contents times temperatures, m K, if any. All of them with the newest first.
    volumes : sums of contents, 2 dx m2; flowed, stored, moved : of the whole run, in time: what came in, what was stored, and
        the larger of all that passed and all that was stored; whole : what a full film holds, 2 dx m2.
    """

    grid: Grid
    second: bool
    t: float = 0.0
    dts: list[float] = field(default_factory=list)
    contents: list[Array] = field(default_factory=list)
    carried: list[Array] = field(default_factory=list)
    fields: list[Fields] = field(default_factory=list)
    full: list[Any] = field(default_factory=list)
    volumes: list[float] = field(default_factory=list)
    flowed: float = 0.0
    stored: float = 0.0
    moved: float = 0.0
    whole: float = 0.0
    rates: float = 0.0  # largest so far: what drives the film, 2 dx sums
    warming: float = 0.0  # likewise, of what is carried
    curved: bool = False  # whether `guess` knows three steps
    ends: bool = False  # whether steps end by `lapse`: of the last step, what its formula errs by, as `Stored` has it
    lapse: float = 0.0

    def begin(self, contents: Array, fields: Fields | None, carried: Array | None = None) -> None:
        """At t = 0."""
        self.contents = [contents]
        self.carried = [] if carried is None else [carried]
        self.volumes = [self._sum(contents)]
        if fields is not None:
            self.fields = [fields]

    def formula(self, dt: float) -> Formula:
        """For a step of this length."""
        if not (self.second and self.dts):
            return Formula(1.0 / dt, 1.0 / dt)
        w = dt / self.dts[0]
        return Formula((1.0 + 2.0 * w) / ((1.0 + w) * dt), (1.0 + w) / dt, -w * w / ((1.0 + w) * dt))

    def term(self, formula: Formula) -> Stored:
        """What the step adds to the film's balance."""
        carried = formula.old(self.carried) if self.carried else None
        return Stored(formula.weight, formula.old(self.contents), self.grid, carried=carried, lapse=self.lapse)

    def guess(self, dt: float) -> Fields | None:
        """Fields at the step's end, as they went on in the last steps: z = p or -r in a line, `curved` in a parabola, but where
        a front passed."""
        if len(self.fields) < 2 or len(self.full) < 2:
            return self.fields[0] if self.fields else None
        w = np.where(self.full[0] == self.full[1], min(dt / self.dts[0], 1.0), 0.0)
        last, before = self.fields[:2]
        ahead = {name: (1.0 + w) * last[name] - w * before[name] for name in ("p", "r")}
        if len(self.fields) > 2 and len(self.full) > 2:
            (a, b), ahead_by = self.dts[:2], min(dt, self.dts[0])
            same = (self.full[0] == self.full[1]) & (self.full[1] == self.full[2])
            c = np.where(same, ahead_by * (ahead_by + a) / (a + b), 0.0)
            for name, values in ahead.items():
                values += c * ((last[name] - before[name]) / a - (before[name] - self.fields[2][name]) / b)
        P, R = (self.grid.reduce.max(last[name]) or 1.0 for name in ("p", "r"))
        z = np.where(self.full[0], ahead["p"] / P, -ahead["r"] / R)  # where p > 0 some methods leave r a rounding
        return {"p": P * np.maximum(z, 0.0), "r": R * np.maximum(-z, 0.0)}

    def accept(
        self, dt: float, problem: LubricationProblem, fields: Fields, contents: Array, carried: Array | None = None
    ) -> dict[str, float]:
        """Take a step over; returns its flows: in and out, m2/s or m3/s, as volumes. Collective."""
        formula = self.formula(dt)
        p, r = fields["p"], fields["r"]
        west, east, south, north = problem.boundary_flows(p, r)
        into = [west, -east, south, -north]
        if isinstance(problem, GroovedProblem):
            balance = problem.scheme.flow_unit * problem.flow(p, r)
            into += [problem.reduce.sum(np.where(inside, balance, 0.0)) for inside in problem.columns]
        size = 0.5 * (self.grid.spacing[1] if self.grid.dim == 2 else 1.0)
        own = problem.there(fields)
        into += [flow / size for flow in supply_flows(problem.moving, own["p"], own["r"])]
        contents, volume = self._rounded(formula, problem, contents, sum(into))
        if self.ends and (lapse := self._lapse(dt, contents, self.contents)) is not None:
            self.lapse = self.grid.reduce.norm(lapse) / (self.grid.reduce.norm(formula.old(self.contents)) or 1.0)
        rate = formula.weight * volume - formula.old(self.volumes)
        self.flowed += dt * sum(into)
        self.stored += dt * rate
        self.moved += dt * max(sum(map(abs, into)), abs(rate))
        self.t += dt
        self.volumes = [volume, *self.volumes[:1]]
        self.dts = [dt, *self.dts[:2]]
        self.contents = [contents, *self.contents[:2]]
        self.carried = [] if carried is None else [carried, *self.carried[:2]]
        self.fields = [fields, *self.fields[: 2 if self.curved else 1]]
        self.full = [cavity_sign(problem.reduce, p, r) >= 0, *self.full[:3]]
        return {
            "volume": size * volume,
            "inflow": size * sum(max(a, 0.0) for a in into),
            "outflow": -size * sum(min(a, 0.0) for a in into),
        }

    def _rounded(self, formula: Formula, problem: LubricationProblem, contents: Array, into: float) -> tuple[Array, float]:
        """Contents and their sum, without what 1 - r has lost by rounding: of an almost empty film that counts. Collective."""
        volume, scheme = self._sum(contents), problem.scheme
        due = (formula.old(self.volumes) + into) / formula.weight
        assert scheme.storage is not None  # as a time step has
        self.whole = scheme.flow_unit * self.grid.reduce.sum(np.abs(scheme.storage)) / formula.weight
        if volume > 0.0 and 0.0 < abs(due - volume) <= ROUNDED * self.whole:
            return contents * (due / volume), due
        return contents, volume

    @property
    def defect(self) -> float:
        """What was lost or made in the whole run, in parts of what passed or was stored."""
        lost = abs(self.flowed - self.stored)
        held = 1e-3 * max(map(abs, self.volumes), default=0.0)  # of a film that hardly moves
        return lost / max(self.moved, held, SCARCE * self.whole) if lost else 0.0

    def error(self, dt: float, problem: LubricationProblem, contents: Array, carried: Array | None = None) -> float | None:
        """Estimated relative error of the rates d/dt h (1 - r) of a step not yet accepted; None before there are enough.

        Of what the contents carry likewise, if that is more. Of cells that were full, or cavitated, all the while: in those
        that a front crosses no formula has an order. Collective.
        """
        s = problem.scheme
        drag = s.flow_unit * problem.reduce.sum(np.abs(s.couette_E - s.couette_W))
        self.rates = max(self.rates, drag + self._rate(dt, contents, self.contents))
        found = self._error(dt, contents, self.contents, self.rates)
        if carried is None or not self.rates:
            return found
        warmest = problem.reduce.max(np.abs(carried)) / problem.reduce.max(np.abs(contents))
        self.warming = max(self.warming, warmest * self.rates + self._rate(dt, carried, self.carried))
        other = self._error(dt, carried, self.carried, self.warming)
        return max(filter(None, (found, other)), default=found)

    def _rate(self, dt: float, new: Array, before: list[Array]) -> float:
        """Sum of the rates, in modulus, at which cells store."""
        formula = self.formula(dt)
        return self._sum(np.abs(formula.weight * new - formula.old(before)))

    def _error(self, dt: float, new: Array, before: list[Array], size: float) -> float | None:
        """Of the rates of what cells store, over their size."""
        lapse = self._lapse(dt, new, before) if size else None
        return None if lapse is None else self._sum(np.abs(lapse)) / size

    def _lapse(self, dt: float, new: Array, before: list[Array]) -> Array | None:
        """What the formula errs by in the rates of cells that were full, or cavitated, all the while; in others 0."""
        order = 2 if self.second else 1
        if len(self.dts) < order:
            return None
        steps = [dt, *self.dts][: order + 1]
        times = -np.concatenate([[0.0], np.cumsum(steps)])  # of the values known, from the new one back
        used = [new, *before][: order + 2]
        if len(used) < order + 2:
            return None
        # The divided difference of order + 1, times the derivative of the formula's error.
        weights = [1.0 / np.prod([times[k] - other for j, other in enumerate(times) if j != k]) for k in range(order + 2)]
        high = sum(weight * values for weight, values in zip(weights, used, strict=True))
        factor = dt * (dt + self.dts[0]) if order == 2 else dt
        steady = np.logical_and.reduce([full == self.full[0] for full in self.full[: order + 1]])
        found: Array = np.where(steady, factor * high, 0.0)
        return found

    def next_step(self, dt: float, error: float | None, tol: float) -> float:
        """The length of the next step, or of the same step if it is taken again."""
        if error is None:
            return dt
        power = 1.0 / (2 if self.second else 1)
        return dt * min(max(SAFETY * (tol / max(error, 1e-300)) ** power, SHORTEST), LONGEST)

    def _sum(self, values: Array) -> float:
        return 2.0 * self.grid.spacing[0] * self.grid.reduce.sum(point_weights(self.grid) * values)
