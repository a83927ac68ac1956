"""The transpose of a coupled film's equations and numbers, and with it dQ/dh(x, y) through all effects.

With R(y; h) = 0 all equations (`coupled_gradient`), one transposed solve a quantity gives

    R_y' lambda = Q_y,      dQ/dh = Q_h - R_h' lambda.

What is not local in them stands on a `tape`, as inputs g and what these are made of. All else is of a point and its neighbours
around it: points of one colour, no two of which have a neighbour in common, are changed together, for central differences. The
film's change is bilinear between points, their mean at faces as in `film_gradient`.
"""

from collections.abc import Callable, Iterator
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ...base.parallel import Array
from ...errors import NotFound
from ...problems.film.slopes import slope
from ...problems.film.views import LiftedFilm
from ...problems.grid import Grid
from ..motions.coupled_response import krylov
from .coupled_gradient import CoupledGradient
from .film_gradient import per_area
from .implicit import Implicit
from .tape import Tape

STEP = 1e-6  # of a field: neighbours' differences see it some hundred times as large
RTOL = 1e-10  # far below 1e-6, to which derivatives agree with differences
Place = Any  # of an input or an output: a number of the equations' fields, "h", ("tape", number)
Weights = dict[Place, Any]
Outputs = tuple[list[Any], dict[str, float]]


def colours(grid: Grid) -> list[Array]:
    """The owned points of each colour, no two of which have a neighbour in common, also across corners; shape grid.box."""
    found = []
    for side, own in zip(range(grid.dim), (slice(grid.x_start, grid.x_end), slice(grid.y_start, grid.y_end)), strict=False):
        n, rest = np.arange(grid.shape[side]), grid.shape[side] % 3 if grid.periodic[side] else 0
        of = np.where(n < n.size - rest, n % 3, 3 + n - (n.size - rest))
        found.append([of[own] == k for k in np.unique(of)])
    across = found[1] if grid.dim == 2 else [np.ones(1, dtype=bool)]
    return [one[None, :] & two[:, None] for one in found[0] for two in across]


@dataclass(frozen=True)
class Local:
    """A field's derivatives by one of its neighbours: those by the points of each colour."""

    grid: Grid
    size: Array
    by: list[tuple[Array, Array]]

    def transposed(self, w: Any) -> Array:
        """The product of the transpose with a field. Collective."""
        out = np.zeros(self.grid.box)
        for mask, change in self.by:
            a = (change * w).reshape(self.grid.box)
            for axis in range(self.grid.dim):
                framed = self.grid.ghosted(a.ravel(), outside=0.0)
                a = a + (framed[1:-1, :-2] + framed[1:-1, 2:] if axis == 0 else framed[:-2, 1:-1] + framed[2:, 1:-1])
            out += np.where(mask, a, 0.0)
        return out.ravel() / self.size


class CoupledFilm:
    """dQ/dh of a coupled film's quantities, as `film_gradient.FilmGradient`. Collective, as its methods."""

    def __init__(self, gradient: CoupledGradient):
        self.gradient, loop = gradient, gradient.loop
        self.grid, self.n, self.count = loop.base.grid, gradient.n, 1 + len(loop.names)
        self.reduce = loop.base.reduce
        self.tape = Tape(self.reduce, self.n)
        self.film = self._taped(loop.base)
        self.implicit = Implicit.of(gradient)
        self.names = gradient.names
        self.first = 0  # of the tape, what numbers ask for
        self.begun = self._evaluated()
        self.blocks: dict[Place, dict[Place, Any]] = {}  # of each output by the inputs
        self.numbers: dict[str, Weights] = {name: {} for name in [*self.names, *self._taken]}
        self._colours = colours(self.grid)
        for place in [*range(self.count), "h"]:
            self._by_field(place)
        for k, value in enumerate(self.tape.known):
            (self._by_field if np.ndim(value) else self._by_sum)(("tape", k))
        if "p_max" in self.names:
            top = slope(loop.base, None, gradient.p * loop.base.p_unit, gradient.r, "p_max")
            # That of a parabola through five points is not of the tape; one at a rim is.
            if not self.reduce.comm.allreduce(bool(np.any(top.film))):
                self.numbers["p_max"] = {0: np.where(gradient.cavity, 0.0, top.p)}

    @property
    def _taken(self) -> list[str]:
        """Names for what supplies that follow give, m3/s."""
        return [f"taken {k}" for k in self.gradient.free]

    def _taped(self, film: Any) -> Any:
        film = copy(film)
        film.reduce = self.tape
        return film

    def _evaluated(self, z: Any = 0.0, x: Any = 0.0, film: Any = None, told: bool = False) -> Outputs:
        """All outputs at a state near the solution: of the equations and of the tape, and the numbers.

        told : what is changed is asked for by the numbers alone.
        """
        gradient, film, tape = self.gradient, film or self.film, self.tape
        state = np.zeros(self.n) + z, gradient.x + x, film
        tape.made = [*self.begun[0][self.count : self.count + self.first]] if told else []
        if told:
            equations, taken = self.begun[0][: self.count], [self.begun[1][name] for name in self._taken]
        else:
            R, _, (taken, _) = gradient._system(*state)
            equations = np.split(R, self.count)
        asked = len(tape.made)
        numbers = gradient._numbers(gradient.loop, *state)
        if tape.first:
            tape.first, self.first = False, asked
        found = {name: numbers[name] for name in self.names} | dict(zip(self._taken, taken, strict=True))
        return [*equations, *tape.made], found

    def _steps(self, place: Place) -> tuple[Any, Callable[[Any], Any]]:
        """The size of a change of an input, and an evaluation with a change of it."""
        gradient, loop, tape = self.gradient, self.gradient.loop, self.tape
        if place == 0:
            return STEP * np.where(gradient.cavity, 1.0, gradient.p_max), lambda d: self._evaluated(z=d)
        if place == "h":
            return STEP * self.reduce.min(loop.base.scheme.h), self._thicker
        if isinstance(place, int):
            part = slice((place - 1) * self.n, place * self.n)

            def moved(d: Array) -> Any:
                x = np.zeros_like(gradient.x)
                x[part] = d
                return self._evaluated(x=x)

            return STEP, moved
        k = place[1]

        def other(d: Any) -> Any:
            before = tape.known[k]
            tape.known[k] = before + d
            try:
                return self._evaluated(told=k >= self.first)
            finally:
                tape.known[k] = before

        made = self.begun[0][self.count + k]
        if np.ndim(tape.known[k]):
            return STEP * (self.reduce.max(np.abs(tape.known[k])) or 1.0), other
        return 0.0 if made is None else STEP * self.reduce.sum(np.abs(made)), other

    def _thicker(self, d: Array) -> Any:
        """With a film that is thicker by d at the points, and between them by what lies between."""
        loop = self.gradient.loop
        model, s = loop.frozen.constant, loop.base.scheme
        gap = LiftedFilm.of(model.gap, self.grid, d)
        if loop.base.remade:  # what part of a cut face resists does not hang on the change
            film, slopes = self._taped(loop.base.with_lift(d)), model.film_slopes(loop.base, gap)
            film.scheme = s.changed(**{name: getattr(s, name) + getattr(slopes, name) for name in s.arrays})
            return self._evaluated(film=film)
        film = replace(model, gap=gap).build(self.grid.shape, self.grid.petsc_comm, self.grid)
        try:
            return self._evaluated(film=self._taped(film))
        finally:
            film.shares_grid = True
            film.destroy()

    def _pair(self, place: Place, d: Any) -> Outputs:
        """Halves of what the outputs and numbers differ by to both sides."""
        _, at = self._steps(place)
        (above, more), (below, less) = at(d), at(-d)
        fields = [None if a is None else 0.5 * (a - b) for a, b in zip(above, below, strict=True)]
        return fields, {name: 0.5 * (more[name] - less[name]) for name in more}

    def _outputs(self) -> Iterator[tuple[int, Place, bool]]:
        """The outputs' numbers and places, and whether they are fields; else sums of what they are made of."""
        for k in range(self.count):
            yield k, k, True
        for k, back in enumerate(self.tape.back):
            if self.begun[0][self.count + k] is not None:
                yield self.count + k, ("tape", k), back is not None

    def _by_field(self, place: Place) -> None:
        """The outputs' derivatives by a field."""
        size = np.broadcast_to(self._steps(place)[0], (self.n,))
        slopes: dict[int, list[tuple[Array, Array]]] = {}
        for mask in self._colours:
            fields, _ = self._pair(place, np.where(mask.ravel(), size, 0.0))
            seen = self._seen(fields)
            for number, *_ in self._outputs():
                if seen[number]:
                    slopes.setdefault(number, []).append((mask, fields[number]))
        for number, out, is_field in self._outputs():
            if number in slopes:
                local = Local(self.grid, size, slopes[number])
                self.blocks.setdefault(out, {})[place] = local if is_field else local.transposed(1.0)

    def _seen(self, fields: list[Any]) -> Array:
        """How many ranks have more than zeros in each of these; one message for all."""
        return np.asarray(self.reduce.comm.allreduce(np.array([0.0 if a is None else float(np.any(a)) for a in fields])))

    def _by_sum(self, place: Place) -> None:
        """The outputs' and numbers' derivatives by what is one number."""
        d, at = self._steps(place)
        if not d > 0.0 or self._same(at(d), self.begun):
            return
        fields, numbers = self._pair(place, d)
        seen = self._seen(fields)
        for number, out, is_field in self._outputs():
            if seen[number]:
                self.blocks.setdefault(out, {})[place] = fields[number] / d if is_field else self.reduce.sum(fields[number]) / d
        for name, change in numbers.items():
            if change:
                self.numbers[name][place] = change / d

    def _same(self, one: Outputs, other: Outputs) -> bool:
        """Whether outputs and numbers are the same to the last bit: most sums are of numbers that were not asked for."""
        pairs = zip(one[0], other[0], strict=True)
        differ = one[1] != other[1] or any(a is not None and not np.array_equal(a, b) for a, b in pairs)
        return not self.reduce.sum(np.array([float(differ)]))

    def _pulled(self, rows: Array | None, seeds: Weights) -> Weights:
        """What the equations by these rows, and inputs by their seeds, change by: by fields and film. Collective."""
        total = dict(seeds)

        def pull(out: Place, w: Any) -> None:
            for place, block in self.blocks.get(out, {}).items():
                if isinstance(block, Local):
                    part: Any = block.transposed(w)
                else:
                    part = self.reduce.dot(w, block) if np.ndim(w) else w * block
                total[place] = total.get(place, 0.0) + part

        for k, row in enumerate(() if rows is None else np.split(rows, self.count)):
            pull(k, row)
        for k in range(len(self.tape.known) - 1, -1, -1):
            place, back = ("tape", k), self.tape.back[k]
            if place in total:
                pull(place, total[place] if back is None else back(total[place]))
        return total

    def _by_y(self, pulled: Weights) -> Array:
        return np.concatenate([np.zeros(self.n) + pulled.get(k, 0.0) for k in range(self.count)])

    @cached_property
    def lambdas(self) -> dict[str, Array]:
        """By number; those of what supplies that follow give among them."""
        return {name: self._solved(self._by_y(self._pulled(None, seeds))) for name, seeds in self.numbers.items()}

    def _solved(self, b: Array) -> Array:
        """R_y'^-1 b, with the film's own transpose beside the effects' answers to it. Collective."""
        gradient, n = self.gradient, self.n
        z = np.where(gradient.cavity, -gradient.r, gradient.p)
        linear = gradient._linear

        def film(v: Array) -> Array:
            by_film = v[:n] - self._by_y(self._pulled(np.concatenate([np.zeros(n), v[n:]]), {}))[:n]
            v[:n] = linear.solve_transposed([by_film], z)[0]
            return v

        found, reason = krylov(self.grid.petsc_comm, b, lambda v: self._by_y(self._pulled(v, {})), film, RTOL)
        if reason < 0:
            raise NotFound(f"dQ/dh: the transposed effects were not solved (GMRES ended with {reason})")
        return found

    def field(self, quantity: str) -> Array:
        """dQ/dh at the owned points of the solution's grid, as `film_gradient.FilmGradient.field` tells."""
        total = sum(w * self._lagrangian(name) for name, w in self.implicit.weights(quantity).items())
        return per_area(np.asarray(total), self.grid, self.gradient.reported)

    def _lagrangian(self, name: str) -> Array:
        """Of a number by the film at each point, what was found held; pressures of supplies follow."""
        gradient, dot = self.gradient, self.reduce.dot

        def of(name: str) -> Array:
            return np.zeros(self.n) + self._pulled(-self.lambdas[name], self.numbers[name]).get("h", 0.0)

        out = of(name)
        if gradient.free:
            by_P = lambda name: np.array([dot(self.lambdas[name], push) for push in gradient._pushes])  # noqa: E731
            a, b = gradient._sources[gradient.free].T
            M = np.diag(a) + b[:, None] * np.array([by_P(one) for one in self._taken])
            change = np.linalg.solve(M.T, by_P(name))
            out = out - sum(w * f * of(one) for w, f, one in zip(change, b, self._taken, strict=True))
        return out

    def destroy(self) -> None:
        self.tape.destroy()
