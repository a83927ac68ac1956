"""L of a film's integrals, drag, flows and largest pressure at scenes near by, without problems: what they change of lambda' G.

A problem's coefficients and its balance cost many times what its film at the faces does (`problems/film/by_faces`), and a
viscosity, a speed or a pressure of a side costs nothing, as the balance is linear in them.
Barus' law has another q, as p is held.
"""

from collections.abc import Collection, Mapping, Sequence
from copy import copy
from dataclasses import fields
from functools import cached_property
from typing import Any

import numpy as np

from ...base.parallel import Array
from ...problems.film import forces
from ...problems.film.by_faces import ByFaces
from ...problems.film.flows import SIDES
from ...problems.film.fluid import Law
from ...problems.film.lubrication import LubricationProblem
from ...problems.film.model import Model
from ...problems.film.quantities import largest_pressure
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


class NearFilms:
    """lambda' G, and the numbers that pressure and drag make, of films on as many points. Collective, as its method.

    Parameters
    ----------
    p : Pa above p_c, r : of the solution. lambdas : by quantity. parts : what each is made of. numbers : of the solution.
    """

    def __init__(
        self,
        equations: Equations,
        p: Array,
        r: Array,
        lambdas: Mapping[str, Array],
        parts: Mapping[str, Collection[str]],
        numbers: dict[str, float],
    ):
        self.equations, self.model, self.p, self.r = equations, equations.model, p, r
        self.lambdas, self.numbers = lambdas, numbers
        self._columns: dict[bytes, Array] = {}
        self.wanted = {part for one in parts.values() for part in one}
        self.drags = tuple(name for name in DRAGS if name in self.wanted)
        self.flows = tuple(name for name in FLOWS if name in self.wanted)
        by_p = {*forces.weights(equations.constant), "p_max"}
        self.known = can(equations.constant, self.model, SMALL) and self.wanted <= by_p.union(DRAGS, FLOWS)

    @cached_property
    def _own(self) -> ByFaces:
        return self._by_faces(self._law, self.equations._p_sides)

    @property
    def _law(self) -> Law:
        return self.equations.law or Law()

    def _by_faces(self, law: Law, p_sides: Sequence[float]) -> ByFaces:
        problem, rows = self.equations.constant, list(self.lambdas.values())
        names = [FLIPPED.get(name, name) if self.equations.turned else name for name in self.flows]
        flows = [name.removeprefix("flow_") for name in names]
        return ByFaces(problem, self.model.scheme, law, self.p, self.r, p_sides, rows, self.drags, flows)

    @cached_property
    def _here(self) -> Array | None:
        return self._own.sums(self.model.gap, self.equations.grid)

    @cached_property
    def _told(self) -> dict[str, float]:
        own = copy(self.equations.constant)
        own.p_sides = self.equations._p_sides  # not as q of Barus' law
        return self._totals(own)

    def _totals(self, problem: LubricationProblem) -> dict[str, float]:
        """The numbers, with the integrals of a film's pressure, which is held, and its largest one."""
        found = forces.totals(problem, self.p, wanted=self.wanted, columns=self._columns)
        if "p_max" in self.wanted:
            found["p_max"] = largest_pressure(problem, self.p)[0] + problem.p_c
        return self.numbers | {name: found[name] for name in self.wanted.difference(DRAGS, FLOWS)}

    def lagrangians(self, scene: Scene) -> Array | None:
        """L of every quantity; None where it is not that of another film at these points."""
        if not self.known or film_of(scene) is None:
            return None
        eq = self.equations
        film: Any = Mirrored(scene) if eq.turned else scene
        model: Model = film.model
        known = alike(model, self.model) and not getattr(model.gap, "rims", ())
        if model.U <= 0.0 or model.effects or not known or film.shape != eq.grid.shape:
            return None
        grid, law, p_sides = self._grid(model), model.law or Law(), model.p_sides
        sums = None if grid is None else self._sums(model.gap, law, grid, p_sides)
        if grid is None or sums is None:
            return None
        last, q_sides = len(self.lambdas) + len(self.drags), [float(law.reduced(np.array(p))) for p in p_sides]
        pressed, dragged = sums[:, 0] + sums[:, 2:] @ np.array(q_sides), model.U * sums[:, 1]
        flows = pressed / model.mu + dragged
        G, numbers = flows[: len(self.lambdas)], dict(zip(self.flows, 0.5 * grid.spacing[1] * flows[last:], strict=True))
        for name, of, shear in zip(self.drags, sums[len(self.lambdas) : last], dragged[len(self.lambdas) : last], strict=True):
            numbers[name] = (-1.0 if eq.turned else 1.0) * (of[0] + of[2:] @ np.array(p_sides) + model.mu * shear)
        lean, near = copy(eq), copy(eq.constant)
        near.grid = grid
        near.mu, near.U, near.p_c, near.p_sides = model.mu, model.U, model.p_c, p_sides
        near.shaft, near.extras, near.film, lean.constant = model.shaft, model.extras, model.film, near
        near.levers, own = model.levers, self.model
        held = (eq._p_sides, eq.constant.p_c) == (p_sides, near.p_c) and grid is eq.grid
        held = held and same((own.shaft, own.levers), (near.shaft, near.levers))
        report = lean.report((self._told if held else self._totals(near)) | {name: float(a) for name, a in numbers.items()})
        return np.array([report[name] for name in map(plain, self.lambdas)]) - G / eq.constant.scheme.flow_unit

    def _sums(self, gap: Any, law: Law, grid: Grid, p_sides: tuple[float, ...]) -> Array | None:
        at_sides = law.dowson_higginson or (law.barus and self.drags)  # whether what faces there count depends on the pressure
        if law != self._law or (at_sides and p_sides != self.equations._p_sides):
            return self._by_faces(law, p_sides).sums(gap, grid)
        if grid is self.equations.grid and same(gap, self.model.gap):
            return self._here
        return self._own.sums(gap, grid)

    def _grid(self, model: Model) -> Grid | None:
        """The points where another film has them; None where edges came or went."""
        own, grid = self.model, self.equations.grid
        if (model.lengths, model.polar, model.edges) == (own.lengths, own.polar, own.edges) and model.places is own.places:
            return grid
        places = model.lines(grid.shape) if grid.even else followed(grid, own, model)
        return None if places is None else moved(grid, model.lengths, places, model.polar)


def alike(model: Model, own: Model) -> bool:
    """Whether films differ by no more than what may."""
    sides = [(side.kind, side.r) for side in model.sides] == [(side.kind, side.r) for side in own.sides]
    return sides and all(
        same(getattr(model, one.name), getattr(own, one.name)) for one in fields(Model) if one.name not in FREE
    )


def plain(name: str) -> str:
    """A quantity, whichever side its adjoint is of."""
    return name.removesuffix(OTHER)


def same(a: Any, b: Any) -> bool:
    """Whether two things are equal as far as they can tell."""
    try:
        return bool(a is b or a == b)
    except ValueError:  # arrays in them
        return False
