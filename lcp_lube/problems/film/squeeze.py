"""Squeeze film between parallel plates that oscillate: the march through time steps (`squeeze_step`), and what it shows."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ...base.parallel import Array
from ...errors import InputError
from ..certificate import Certificate
from ..grid import Grid
from ..solution import Fields
from .cavity import VOID
from .reynolds import LARGE
from .squeeze_step import SqueezeStep


@dataclass
class History:
    """What the march saw: times in units of t, places in x; None for what did not happen."""

    rupture_time: float | None = None
    rupture: float | None = None
    reformation_time: float | None = None
    sigma: float | None = None
    sigma_time: float | None = None
    front: float | None = None
    p_max: float = 0.0
    p_max_time: float = 0.0


class SqueezeProblem:
    """The whole march from t = 0 to t_end.

    Parameters
    ----------
    gap : h(t), positive.
    steps : of equal length.
    second_order : the two-step backward difference (BDF2, its first step implicit Euler), otherwise implicit Euler.
    front_time : when `front` is told.
    """

    kind = "lubrication"  # as every step is
    units: ClassVar[dict[str, str]] = {}

    def __init__(
        self,
        grid: Grid,
        gap: Callable[[float], float],
        *,
        p_wall: float,
        t_end: float,
        steps: int,
        second_order: bool,
        front_time: float,
    ):
        self.grid, self.gap, self.p_wall, self.t_end, self.steps = grid, gap, p_wall, t_end, steps
        self.second_order, self.front_time = second_order, front_time
        self.reduce = grid.reduce
        self._check(gap(0.0))
        self.exact = None  # the events are known exactly, not the fields
        self.history = History()
        self._m = 0
        self._contents = [np.full(grid.local_size, gap(0.0))] * 2  # M of the last step, and of the one before it
        self._r = np.zeros(grid.local_size)  # of the last step
        self._pressures: list[Array] = []  # of the last steps in the full film
        self._fronts: list[tuple[float, float]] = []  # (time, front) since rupture
        self._void: list[float] = []

    def _check(self, h: float) -> None:
        """Raise InputError for data whose coefficients overflow or vanish."""
        dx, smallest = self.grid.spacing[0], min(h, self.gap(0.5 * self.t_end), self.gap(self.t_end))
        with np.errstate(all="ignore"):
            sizes = np.array([(self.p_wall or 1.0) * smallest**3 / dx, self.p_wall * h**3 / dx, 2.0 * dx * h / self.dt])
        if not np.all((sizes[[0, 2]] > 1 / LARGE) & (sizes[[0, 2]] < LARGE) & (sizes[1] < LARGE)):
            raise InputError(
                f"gap {h:g} at t = 0, p_wall = {self.p_wall:g}, {self.steps} steps up to t_end = {self.t_end:g}: coefficients "
                f"{np.min(sizes[[0, 2]]):g} to {np.max(sizes):g}, allowed are {1 / LARGE:g} to {LARGE:g}"
            )

    @property
    def unknowns(self) -> int:
        return 2 * self.grid.size

    @property
    def dt(self) -> float:
        return self.t_end / self.steps

    @property
    def time(self) -> float:
        """Of the last step taken."""
        return self._m * self.dt

    def next_step(self) -> SqueezeStep:
        """The problem of the next time step."""
        last, before = self._contents
        if self.second_order and self._m:
            weight, old = 1.5 / self.dt, (2.0 * last - 0.5 * before) / self.dt
        else:
            weight, old = 1.0 / self.dt, last / self.dt
        return SqueezeStep(self.grid, self.gap((self._m + 1) * self.dt), weight, old, self.p_wall)

    def accept(self, step: SqueezeStep, fields: Fields) -> None:
        """Take a step's solution over and note what it shows. Collective."""
        p, r, seen = fields["p"] * step.p_unit, fields["r"], self.history
        self._m += 1
        self._contents = [step.h * (1.0 - r), self._contents[0]]
        p_max = self.reduce.max(p)
        # An interior method leaves a trace of void in the full film.
        r = np.where((p <= max(p_max, self.p_wall) * r) & (r > VOID), r, 0.0)
        if p_max > seen.p_max:
            seen.p_max, seen.p_max_time = p_max, self.time
        self._r = r
        void = self.reduce.sum(r) * self.grid.cell
        if seen.rupture_time is None:
            if self.reduce.max(r) > 0:
                self._rupture(r)
            self._pressures = [*self._pressures[-2:], p]
        if seen.rupture_time is not None and seen.reformation_time is None:
            if not self.reduce.max(r) > 0:
                self._reformation()
            else:
                self._fronts.append((self.time, self.front(p, r)))
                self._void.append(void)
        if self._m == self.steps or seen.reformation_time is not None:
            self._look_back()

    def _rupture(self, r: Array) -> None:
        """When: the pressure at the cavity's middle, as it was falling, reaches zero. Collective."""
        x, cavity = self.grid.x[0], (r > 0).astype(float)
        where = self.reduce.dot(x, cavity) / self.reduce.sum(cavity)
        nearest = np.abs(x - where)
        here = (nearest == self.reduce.min(nearest)).astype(float)
        falling = np.array([self.reduce.dot(p, here) for p in self._pressures]) / self.reduce.sum(here)
        times = self.time - self.dt * np.arange(len(falling), 0, -1)
        found = self.time
        if len(falling) >= 2 and np.all(np.diff(falling) < 0):
            # t as a polynomial in p through the last two or three steps, at p = 0.
            slope = np.diff(times) / np.diff(falling)
            found = times[-1] - slope[-1] * falling[-1]
            if len(falling) == 3:
                found += (slope[1] - slope[0]) / (falling[2] - falling[0]) * falling[-1] * falling[-2]
        self.history.rupture = where
        self.history.rupture_time = float(np.clip(found, self.time - self.dt, self.time))

    def _reformation(self) -> None:
        """When: the void, falling as it was in the last two steps, is used up."""
        fall = self._void[-2] - self._void[-1] if len(self._void) > 1 else 0.0
        part = self._void[-1] / fall if fall > 0 else 1.0
        self.history.reformation_time = self.time - self.dt * (1.0 - min(part, 1.0))

    def _look_back(self) -> None:
        """Sigma and the front at `front_time`, from the fronts of all steps."""
        seen = self.history
        if not self._fronts:
            return
        times, fronts = np.array(self._fronts).T
        k = int(np.argmin(fronts))
        seen.sigma, seen.sigma_time = 1.0 - fronts[k], times[k]
        if 0 < k < len(fronts) - 1:  # a parabola through the three steps about it
            rise, bend = fronts[k + 1] - fronts[k - 1], fronts[k + 1] - 2.0 * fronts[k] + fronts[k - 1]
            if bend > 0:
                seen.sigma = float(1.0 - fronts[k] + rise**2 / (8.0 * bend))
                seen.sigma_time = float(times[k] - 0.5 * rise / bend * self.dt)
        if times[0] <= self.front_time <= times[-1]:
            seen.front = float(np.interp(self.front_time, times, fronts))

    def front(self, p: Array, r: Array) -> float:
        """Place of the cavity's west front, inside its cell. Collective.

        While the cavity opens, p = p' = 0 at the front: the vertex of the parabola through the last full points and the
        cavity's first one. While it fills, the share of the first cell that is filled, next to its neighbour's void.
        """
        grid, dx = self.grid, self.grid.spacing[0]
        x = grid.x[0]
        p_line, r_line = grid.ghosted(p)[1], grid.ghosted(r)[1]
        if grid.x_start == 0:
            p_line[0], r_line[0] = self.p_wall, 0.0
        if grid.x_end == grid.shape[0]:
            r_line[-1] = 0.0
        none = np.inf
        first = (r_line[1:-1] > 0) & ~(r_line[:-2] > 0)  # cells whose western neighbour is full
        beyond = np.where(r_line[2:] > 0, r_line[2:], np.inf)
        filled = np.clip(1.0 - r_line[1:-1] / beyond, 0.0, 1.0)
        filling = self.reduce.min(np.where(first, x - 0.5 * dx + filled * dx, none))
        last = (r_line[2:] > 0) & ~(r_line[1:-1] > 0)  # full cells with a cavity to the east
        bend = (p_line[:-2] - 2.0 * p_line[1:-1]) / dx**2
        slope = -p_line[1:-1] / dx + 0.5 * bend * dx  # of the parabola, at the cavity's first point
        vertex = np.where(bend > 0, -slope / np.where(bend > 0, bend, 1.0), none)
        opening = self.reduce.min(np.where(last & (np.abs(vertex) <= dx), x + dx + vertex, none))
        # The west front: the other one, at the mirror place, has its full cell to the east.
        return opening if opening <= filling + 2.0 * dx else filling

    def certify(self, fields: Fields, eps1: float) -> Certificate:
        raise NotImplementedError("every step is certified by itself")

    def quantities(self, fields: Fields) -> dict[str, Any]:
        """What the march saw (`History`), and the cavitated share of the points at its end. Collective."""
        seen = self.history
        return {
            **vars(seen),
            "half_width": None if seen.sigma is None else seen.sigma - 0.5,
            "cavitated_fraction": self.reduce.sum((self._r > 0).astype(float)) / self.grid.size,
            "t_end": self.time,
            "steps": self._m,
        }

    def physical(self, fields: Fields) -> dict[str, tuple[Array, str]]:
        """Pressure, void fraction and gap at the end, dimensionless."""
        h = np.full(self.grid.local_size, self.gap(self.time))
        return {"p": (fields["p"] * (self.p_wall or 1.0), ""), "r": (fields["r"], ""), "h": (h, "")}

    def at_sides(self, name: str, x: Array, y: Array) -> Array:
        """p_wall, the gap, and no void unless p_wall = 0."""
        void = 0.0 if self.p_wall else np.nan
        return np.full(np.broadcast(x, y).shape, {"p": self.p_wall, "r": void, "h": self.gap(self.time)}[name])

    def prolong(self, coarse: Any, fields: Fields, interior: bool) -> Fields:
        """Nothing: every march begins with the full film."""
        return {}

    def destroy(self) -> None:
        self.grid.destroy()
