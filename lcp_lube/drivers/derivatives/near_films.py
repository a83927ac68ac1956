"""L of a film's integrals, drag, flows and largest pressure at scenes near by, without problems: what they change of lambda' G.

A problem's coefficients and its balance cost many times what its film at the faces does (`problems/film/by_faces`), and a
viscosity, a speed or a pressure of a side costs nothing, as the balance is linear in them.
Barus' law has another q, as p is held.
"""

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import fields, replace
from functools import cached_property
from math import factorial
from typing import Any

import numpy as np
from mpi4py import MPI

from ...base.parallel import Array
from ...problems.film import borne, forces
from ...problems.film.by_faces import ByFaces
from ...problems.film.flows import SIDES
from ...problems.film.fluid import Law
from ...problems.film.lubrication import LubricationProblem
from ...problems.film.model import Model
from ...problems.film.quantities import largest_pressure
from ...problems.film.reynolds import sides
from ...problems.film.slopes import by_points
from ...problems.film.supplies import Held, owners, shares_of
from ...problems.film.weighed import can
from ...problems.grid import Grid
from ...problems.strips import moved
from ...registry import SMALL
from ...scenes.moving import film_of
from ...scenes.scene import Scene
from ..turned import Mirrored
from .equations import DRAGS, FLIPPED, Equations, followed

OTHER = "'"  # after a quantity: with the points that are about to change, or that tie, counted to the other side
FLOWS = [f"flow_{side}" for side in SIDES]
FREE = {"gap", "mu", "U", "p_unit", "p_c", "sides", "exact", "extras", "shaft", "levers", "law"}  # what may differ
FREE |= {"lengths", "polar", "places"}  # where its lines of points lie
SLIGHT, POWERS = 1e-2, 6  # of b p; as many terms leave 1e-17 of it


class NearFilms:
    """lambda' G, and the numbers that pressure and drag make, of films on as many points. Collective, as its method.

    Parameters
    ----------
    p : Pa above p_c, r : of the solution. lambdas : by quantity. parts : what each is made of, and its derivatives by that.
    numbers : of the solution. pressures : of its supplies, if any, Pa above p_c. asked : J' lambda.
    """

    def __init__(
        self,
        equations: Equations,
        p: Array,
        r: Array,
        lambdas: Mapping[str, Array],
        parts: Mapping[str, Mapping[str, float]],
        numbers: dict[str, float],
        pressures: Sequence[float] = (),
        asked: Mapping[str, Array] | None = None,
    ):
        self.equations, self.model, self.p, self.r = equations, equations.model, p, r
        self.lambdas, self.numbers = lambdas, numbers
        self._columns: dict[bytes, Array] = {}
        self._asked = asked or {}
        self.wanted = {part for one in parts.values() for part in one}
        self.drags = tuple(name for name in DRAGS if name in self.wanted)
        self.flows = tuple(name for name in FLOWS if name in self.wanted)
        problem, self.rows = equations.constant, list(lambdas.values())
        self._weights, self._parts, held = forces.weights(problem), parts, problem.held
        by_p = {*self._weights, "p_max"}
        self.fed = [f"supply_flow_{k}" for k in range(1, len(held.supplies) + 1)] if held else []
        self.pressures = pressures or [one.p for one in (held.supplies if held else ())]
        if held is not None:  # rows of free cells, and what leaves the others
            taken = [held.owner.ravel() == k for k in range(len(held.supplies))]
            size, free = problem.scheme.diagonal.ravel() / problem.p_unit, ~held.mask.ravel()
            self._pushed = np.array([[problem.reduce.sum(np.where(mine, w * size, 0.0)) for mine in taken] for w in self.rows])
            self.rows = [*(w * free for w in self.rows), *(mine.astype(float) for mine in taken)]
        self.known = can(problem, self.model, SMALL, held=equations.law is None, rims=True) and self.wanted <= by_p.union(
            DRAGS, FLOWS, self.fed
        )
        self._shares = self._within(problem.grid, held) if held and self.known else None
        self.known = self.known and (held is None or self._shares is not None)

    @cached_property
    def _own(self) -> ByFaces:
        return self._by_faces(self._law, self.equations._p_sides)

    @property
    def _law(self) -> Law:
        return self.equations.law or Law()

    def _by_faces(self, law: Law, p_sides: Sequence[float], shares: Array | None = None) -> ByFaces:
        problem = self.equations.constant
        shares = self._shares if shares is None else shares
        names = [FLIPPED.get(name, name) if self.equations.turned else name for name in self.flows]
        flows = [name.removeprefix("flow_") for name in names]
        fields, more = (self.p, self.r, p_sides, self.rows), (shares, self.equations.layers, self._by_borne)
        return ByFaces(problem, self.model.scheme, law, *fields, self.drags, flows, *more)

    @cached_property
    def _begun(self) -> borne.Begun | None:
        return borne.begun(self.equations.constant, self.p, self.r)

    @cached_property
    def _by_borne(self) -> list[Array]:
        """By what the pressures that integrals count are counted in every L, if they know fronts."""
        problem, out = self.equations.constant, list[Array]()
        for name in self.lambdas if problem.cornered else ():
            counts = [(by, self._weights[part]) for part, by in self._parts[name].items() if part in self._weights]
            out.append(sum((by * by_points(problem, weight) for by, weight in counts), np.zeros(problem.grid.box)))
        return out

    @cached_property
    def _here(self) -> Array | None:
        return self._own.sums(self.model.gap, self.equations.grid)

    @cached_property
    def _told(self) -> dict[str, float]:
        own = copy(self.equations.constant)
        own.p_sides, own.barus = self.equations._p_sides, self._law.barus  # not as q of Barus' law
        return self._totals(own)

    def _totals(self, problem: LubricationProblem) -> dict[str, float]:
        """The numbers, with the integrals of a film's pressure, which is held, and its largest one. As it has none of its
        coefficients, fronts stay where they are between the points: L knows by its faces what moves them (`ByFaces`)."""
        (whole := copy(problem)).cornered = False
        found = forces.totals(whole, self.p, self.r, wanted=self.wanted, columns=self._columns)
        if self._begun is not None and (names := [name for name in self._weights if name in self.wanted]):
            lost = borne.less(problem.grid, self._begun, self.p, [forces.weights(problem)[name] for name in names])
            found |= {name: found[name] - by for name, by in zip(names, lost, strict=True)}
        if "p_max" in self.wanted:
            found["p_max"] = largest_pressure(problem, self.p)[0] + problem.p_c
        return self.numbers | {name: found[name] for name in self.wanted.difference(DRAGS, FLOWS, self.fed)}

    def lagrangians(self, scene: Scene, pressures: Sequence[float] = ()) -> Array | None:
        """L of every quantity; None where it is not that of another film at these points. pressures : of supplies."""
        if not self.known or film_of(scene) is None:
            return None
        eq = self.equations
        film: Any = Mirrored(scene) if eq.turned else scene
        model: Model = film.model
        known = alike(model, self.model, "supplies") and (model.cut, model.cornered) == (self.model.cut, eq.constant.cornered)
        known = known and [one.open for one in model.supplies] == [one.open for one in self.model.supplies]
        if model.U <= 0.0 or model.effects or not known or film.shape != eq.grid.shape:
            return None
        grid, law, p_sides = self._grid(model), model.law or Law(), model.p_sides
        sums = None if grid is None else self._sums(model, law, grid, p_sides)
        if grid is None or sums is None:
            return None
        first, last = len(self.rows), len(self.rows) + len(self.drags)
        q_sides = [float(law.reduced(np.array(p))) for p in p_sides]
        pressed, dragged = sums[:, 0] + sums[:, 2:] @ np.array(q_sides), model.U * sums[:, 1]
        flows = pressed / model.mu + dragged
        G, given = np.split(flows[:first], [len(self.lambdas)])
        numbers = dict(zip([*self.flows, *self.fed], 0.5 * grid.spacing[1] * np.append(flows[last:], given), strict=True))
        for name, of, shear in zip(self.drags, sums[first:last], dragged[first:last], strict=True):
            numbers[name] = (-1.0 if eq.turned else 1.0) * (of[0] + of[2:] @ np.array(p_sides) + model.mu * shear)
        lean, near = copy(eq), copy(eq.constant)
        near.grid = grid
        near.mu, near.U, near.p_c, near.p_sides, near.barus = model.mu, model.U, model.p_c, p_sides, law.barus
        near.shaft, near.extras, near.film, lean.constant = model.shaft, model.extras, model.film, near
        near.levers, own, pushed = model.levers, self.model, 0.0
        if near.held is not None:
            P = [new if one.open else one.p for one, new in zip(model.supplies, pressures or self.pressures, strict=True)]
            pushed = self._pushed @ (np.array(P) - [one.p for one in near.held.supplies])
            near.held = replace(near.held, supplies=tuple(replace(one, p=p) for one, p in zip(model.supplies, P, strict=True)))
        at_rims = "p_max" in self.wanted and own.cut  # where it hangs on film, viscosity and speed (`rim_tops`)
        held = not at_rims and (eq._p_sides, eq.constant.p_c) == (p_sides, near.p_c) and grid is eq.grid
        held = held and same((own.shaft, own.levers), (near.shaft, near.levers))
        report = lean.report((self._told if held else self._totals(near)) | {name: float(a) for name, a in numbers.items()})
        return np.array([report[name] for name in map(plain, self.lambdas)]) - G / eq.constant.scheme.flow_unit + pushed

    def _sums(self, model: Model, law: Law, grid: Grid, p_sides: tuple[float, ...]) -> Array | None:
        gap, held = model.gap, self.equations.constant.held
        if held is not None and not (grid is self.equations.grid and same(regions(model), regions(self.model))):
            owner = owners(grid, model.supplies)
            if grid.comm.allreduce(not np.array_equal(owner, held.owner), MPI.LOR):
                return None
            shares = self._within(grid, Held(model.supplies, owner))
            return None if shares is None else self._by_faces(law, p_sides, shares).sums(gap, grid)
        at_sides = law.dowson_higginson or (law.barus and self.drags)  # whether what faces there count depends on the pressure
        same_film = grid is self.equations.grid and same(gap, self.model.gap)
        if same_film and self._slight(law):
            return self._thickened(law.barus)
        if law != self._law or (at_sides and p_sides != self.equations._p_sides):
            return self._by_faces(law, p_sides).sums(gap, grid)
        return self._here if same_film else self._own.sums(gap, grid)

    def _slight(self, law: Law) -> bool:
        """Whether a law makes a fluid of constant viscosity so little thicker that the first powers of b p tell its q."""
        own, eq = self._law == Law() != law and not law.dowson_higginson, self.equations
        own = (
            own and not self.drags and not self.flows and eq.constant.held is None and self._asked.keys() == self.lambdas.keys()
        )
        return own and abs(law.barus) * eq.grid.reduce.largest(self.p) <= SLIGHT

    @cached_property
    def _powers(self) -> Array:
        """The sums of J' lambda times p^2, p^3, ... at the points, of every lambda."""
        found, power, dot = [], self.p, self.equations.grid.reduce.dot
        for _ in range(POWERS):
            power = power * self.p
            found.append([dot(row, power) for row in self._asked.values()])
        return np.array(found)

    def _thickened(self, b: float) -> Array | None:
        """`_here` with q = p - b p^2/2 + b^2 p^3/6 - ... : what lambda' G grows by with a point's q is J' lambda there."""
        problem, known = self.equations.constant, self._here
        if known is None:
            return None
        terms = [(-b) ** k / factorial(k + 1) * sums for k, sums in enumerate(self._powers, start=1)]
        out = np.array(known)
        out[: len(self.lambdas), 0] += problem.mu * problem.scheme.flow_unit / problem.p_unit * sum(terms)
        return out

    @staticmethod
    def _within(grid: Grid, held: Held) -> Array | None:
        """`shares_of`; None where a supply ends between a side and the points beside it."""
        shares = np.broadcast_to(shares_of(grid, held), (4, *grid.box))
        off = [float(np.any((way != 1.0) & at)) for way, at in zip(shares, sides(grid), strict=True)]
        return None if grid.reduce.max(np.array(off)) else shares

    def _grid(self, model: Model) -> Grid | None:
        """The points where another film has them; None where edges came or went."""
        own, grid = self.model, self.equations.grid
        if (model.lengths, model.polar, model.edges) == (own.lengths, own.polar, own.edges) and model.places is own.places:
            return grid
        places = followed(grid, own, model)
        return None if places is None else moved(grid, model.lengths, places, model.polar)


def alike(model: Model, own: Model, *more: str) -> bool:
    """Whether films differ by no more than what may, and by these."""
    sides = [(side.kind, side.r) for side in model.sides] == [(side.kind, side.r) for side in own.sides]
    names = {one.name for one in fields(Model)}.difference(FREE, more)
    return sides and all(same(getattr(model, name), getattr(own, name)) for name in names)


def regions(model: Model) -> list[Any]:
    """Where a film's supplies lie."""
    return [one.region for one in model.supplies]


def plain(name: str) -> str:
    """A quantity, whichever side its adjoint is of."""
    return name.removesuffix(OTHER)


def same(a: Any, b: Any) -> bool:
    """Whether two things are equal as far as they can tell."""
    try:
        return bool(a is b or a == b)
    except ValueError:  # arrays in them
        return False
