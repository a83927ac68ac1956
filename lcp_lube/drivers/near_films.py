"""L of a film's integrals, drag and largest pressure at scenes near by, without problems: what they change of lambda' G.

A problem's coefficients and its balance cost many times what its film at the faces does (`problems/film/by_faces`), and a
viscosity, a speed or a pressure of a side costs nothing, as the balance is linear in them.
Barus' law has another q, as p is held.
"""

from collections.abc import Collection, Mapping
from copy import copy
from dataclasses import fields
from functools import cached_property
from typing import Any

import numpy as np

from ..base.parallel import Array
from ..problems.film import forces
from ..problems.film.by_faces import ByFaces
from ..problems.film.fluid import Law
from ..problems.film.lubrication import LubricationProblem
from ..problems.film.model import Model
from ..problems.film.quantities import largest_pressure
from ..problems.film.weighed import can
from ..problems.grid import Grid
from ..problems.strips import moved
from ..registry import SMALL
from ..scenes.scene import Scene
from .equations import DRAGS, Equations, followed
from .turned import Mirrored

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
        constant = not (equations.law and equations.law.dowson_higginson)
        alone = constant and can(equations.constant, self.model, SMALL)
        self.drags = tuple(name for name in DRAGS if name in self.wanted)
        by_p = {*forces.weights(equations.constant), "p_max"}
        self.known = alone and self.wanted <= by_p | (set() if equations.law else {*DRAGS})

    @cached_property
    def _own(self) -> ByFaces:
        return self._by_faces(self.equations.law or Law())

    def _by_faces(self, law: Law) -> ByFaces:
        problem, rows = self.equations.constant, list(self.lambdas.values())
        return ByFaces(problem, self.model.scheme, law.reduced(self.p), self.r, rows, self.drags)

    @cached_property
    def _here(self) -> Array | None:
        return self._own.sums(self.model.gap, self.equations.grid)

    @cached_property
    def _told(self) -> dict[str, float]:
        return self._totals(self.equations.constant)

    def _totals(self, problem: LubricationProblem) -> dict[str, float]:
        """The numbers, with the integrals of a film's pressure, which is held, and its largest one."""
        found = forces.totals(problem, self.p, wanted=self.wanted, columns=self._columns)
        if "p_max" in self.wanted:
            found["p_max"] = largest_pressure(problem, self.p)[0] + problem.p_c
        return self.numbers | {name: found[name] for name in self.wanted.difference(DRAGS)}

    def lagrangians(self, scene: Scene) -> Array | None:
        """L of every quantity; None where it is not that of another film at these points."""
        if not self.known or not isinstance(getattr(scene, "model", None), Model):
            return None
        eq = self.equations
        film: Any = Mirrored(scene) if eq.turned else scene
        model: Model = film.model
        if model.U <= 0.0 or model.effects or model.dense or not self._alike(model) or film.shape != eq.grid.shape:
            return None
        grid, law, p_sides = self._grid(model), model.law or Law(), model.p_sides
        if self.drags and model.law:  # which drags by the viscosity at every point
            return None
        sums = None if grid is None else self._sums(model.gap, law, grid)
        if grid is None or sums is None:
            return None
        q_sides = [float(law.reduced(np.array(p))) for p in p_sides]
        pressed, dragged = sums[:, 0] + sums[:, 2:] @ np.array(q_sides), model.U * sums[:, 1]
        G = (pressed / model.mu + dragged)[: len(self.lambdas)]
        drags = (-1.0 if eq.turned else 1.0) * (pressed + model.mu * dragged)[len(self.lambdas) :]
        lean, near = copy(eq), copy(eq.constant)
        near.grid = grid
        near.mu, near.U, near.p_c, near.p_sides = model.mu, model.U, model.p_c, p_sides  # type: ignore[assignment]
        near.shaft, near.extras, near.film, lean.constant = model.shaft, model.extras, model.film, near
        near.levers, own = model.levers, self.model
        same = (eq._p_sides, eq.constant.p_c) == (p_sides, near.p_c) and grid is eq.grid
        same = same and _same((own.shaft, own.levers), (near.shaft, near.levers))
        numbers = self._told if same else self._totals(near)
        report = lean.report(numbers | dict(zip(self.drags, map(float, drags), strict=True)))
        return np.array([report[name] for name in self.lambdas]) - G / eq.constant.scheme.flow_unit

    def _sums(self, gap: Any, law: Law, grid: Grid) -> Array | None:
        if (law.barus or None) != ((self.equations.law and self.equations.law.barus) or None):
            return self._by_faces(law).sums(gap, grid)
        if grid is self.equations.grid and _same(gap, self.model.gap):
            return self._here
        return self._own.sums(gap, grid)

    def _grid(self, model: Model) -> Grid | None:
        """The points where another film has them; None where edges came or went."""
        own, grid = self.model, self.equations.grid
        if (model.lengths, model.polar, model.edges) == (own.lengths, own.polar, own.edges) and model.places is own.places:
            return grid
        places = model.lines(grid.shape) if grid.even else followed(grid, own, model)
        return None if places is None else moved(grid, model.lengths, places, model.polar)

    def _alike(self, model: Model) -> bool:
        own = self.model
        sides = [(side.kind, side.r) for side in model.sides] == [(side.kind, side.r) for side in own.sides]
        rest = all(_same(getattr(model, one.name), getattr(own, one.name)) for one in fields(Model) if one.name not in FREE)
        return sides and rest and not getattr(model.gap, "rims", ())


def _same(a: Any, b: Any) -> bool:
    """Whether two things are equal as far as they can tell."""
    try:
        return bool(a is b or a == b)
    except ValueError:  # arrays in them
        return False
