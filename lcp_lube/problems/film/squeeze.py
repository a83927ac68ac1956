"""What the march of a squeeze film shows: parallel plates that oscillate, a cavity that opens and fills again.

    d/dx(h^3 dp/dx) = 2 d(h theta)/dt on (0, 1),   theta = 1 - r,   p r = 0,   p, r >= 0,   p = p_wall at both ends,

dimensionless; h(t) does not depend on x, theta = 1 at t = 0 (Optasanu and Bonneau; Ausas, Jai and Buscaglia 2009). The steps
are those of any film that moves (`drivers.time`); here their events are read off.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ...base.parallel import Array, Reduce
from ..certificate import Certificate
from ..grid import Grid
from ..solution import Fields
from .cavity import VOID


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


class Squeeze:
    """What a march shows of a squeeze film: it hears of every step, and in the end answers in the last one's place.

    Parameters
    ----------
    grid : of the march. p_wall : pressure at both ends. front_time : when `front` is told.
    """

    kind = "lubrication"  # as every step is
    units: ClassVar[dict[str, str]] = {}
    exact = None  # the events are known exactly, not the fields

    def __init__(self, p_wall: float, front_time: float):
        self.p_wall, self.front_time = p_wall, front_time
        self.history = History()
        self.step: Any = None  # the last step's problem
        self.time, self.dt = 0.0, 0.0
        self._pressures: list[Array] = []  # of the last steps in the full film
        self._fronts: list[tuple[float, float]] = []  # (time, front) since rupture
        self._void: list[float] = []

    @property
    def grid(self) -> Grid:
        return self.step.grid

    @property
    def reduce(self) -> Reduce:
        return self.step.reduce

    @property
    def unknowns(self) -> int:
        return self.step.unknowns

    def accept(self, step: Any, fields: Fields, time: float, dt: float) -> None:
        """Note what a step shows. Collective."""
        self.step, self.time, self.dt, seen = step, time, dt, self.history
        p, r = fields["p"] * step.p_unit, self._void_of(step, fields)
        p_max = self.reduce.max(p)
        if p_max > seen.p_max:
            seen.p_max, seen.p_max_time = p_max, self.time
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

    def _void_of(self, step: Any, fields: Fields) -> Array:
        """r; an interior method leaves a trace of void in the full film."""
        p, r = fields["p"] * step.p_unit, fields["r"]
        return np.where((p <= max(self.reduce.max(p), self.p_wall) * r) & (r > VOID), r, 0.0)

    def answer(self, step: Any) -> "Squeeze":
        """In the place of the last step's problem. Collective."""
        self.step = step
        self._look_back()
        return self

    def state(self) -> tuple[dict[str, Any], list[Array]]:
        """What a checkpoint holds: numbers, and arrays of the grid."""
        return {**vars(self), "history": vars(self.history), "step": None, "_pressures": None}, self._pressures

    def restore(self, numbers: dict[str, Any], arrays: list[Array]) -> None:
        """Put back what `state` gave."""
        vars(self).update({**numbers, "history": History(**numbers["history"]), "_pressures": arrays})

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
        """When: the void, falling as it was in the last three steps, by a parabola, is used up."""
        last = self._void[-3:]
        fall = np.polyfit(np.arange(1 - len(last), 1), last, len(last) - 1)
        roots = [root.real for root in np.roots(fall) if abs(root.imag) <= 1e-9 and 0 <= root.real <= 1]
        self.history.reformation_time = self.time - self.dt * (1.0 - min(roots, default=1.0))

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
            "cavitated_fraction": self.reduce.sum((self._void_of(self.step, fields) > 0).astype(float)) / self.grid.size,
            "t_end": self.time,
        }

    def physical(self, fields: Fields) -> dict[str, tuple[Array, str]]:
        """Pressure, void fraction and gap at the end, dimensionless."""
        return {"p": (fields["p"] * self.step.p_unit, ""), "r": (fields["r"], ""), "h": (self.step.scheme.h.ravel(), "")}

    def at_sides(self, name: str, x: Array, y: Array) -> Array:
        """p_wall, the gap, and no void unless p_wall = 0."""
        void = 0.0 if self.p_wall else np.nan
        if name == "h":
            return np.array(self.step.film(x, y))
        return np.full(np.broadcast(x, y).shape, {"p": self.p_wall, "r": void}[name])

    def prolong(self, coarse: Any, fields: Fields, interior: bool) -> Fields:
        """Nothing: every march begins with the full film."""
        return {}

    def destroy(self) -> None:
        self.step.destroy()
