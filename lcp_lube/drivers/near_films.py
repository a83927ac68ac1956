"""L of a film's integrals at scenes near by, without their problems: what another film or fluid changes of lambda' G alone.

A problem's coefficients and its balance cost several times what its film at the faces does (`problems/film/weighed`), and a
viscosity, a speed or a pressure of a side costs nothing, as the balance is linear in them.
"""

from collections.abc import Collection, Mapping, Sequence
from copy import copy
from dataclasses import fields
from functools import cached_property
from typing import Any

import numpy as np

from ..base.parallel import Array
from ..problems.film import forces
from ..problems.film.model import Model
from ..problems.film.weighed import ByFaces, Weighed, can
from ..registry import SMALL
from ..scenes.scene import Scene
from .equations import Equations
from .turned import Mirrored

FREE = {"gap", "mu", "U", "p_unit", "p_c", "sides", "exact", "extras", "shaft", "levers", "places"}  # what may differ


class NearFilms:
    """lambda' G, and the numbers that are integrals of the pressure, of films on one grid. Collective, as its method.

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
        self.wanted = {part for one in parts.values() for part in one}
        alone = equations.law is None and can(equations.constant, self.model, SMALL)
        self.known = alone and self.wanted <= set(forces.weights(equations.constant))

    @cached_property
    def _weighed(self) -> Weighed:
        return Weighed(self.equations.constant, self.model.scheme, self.p, self.r, list(self.lambdas.values()))

    @cached_property
    def _own(self) -> Array | None:
        return self._weighed.sums(self.model.gap)

    @cached_property
    def _by_faces(self) -> tuple[ByFaces, Array] | None:
        """Of this film, and what they leave of its own lambda' G; None where it has edges."""
        own, p_sides = self.model, self.equations.constant.p_sides
        faces = self._weighed.by_faces(own.gap, own.mu, own.U, p_sides)
        if faces is None or (here := faces.sums(own.gap)) is None or (G := self._balances(own, p_sides)) is None:
            return None
        return faces, G - here

    def lagrangians(self, scene: Scene) -> Array | None:
        """L of every quantity; None where it is not that of another film on this grid. Of a film without edges that alone is
        changed, to first order: it is for derivatives."""
        if not self.known or not isinstance(getattr(scene, "model", None), Model):
            return None
        eq, own = self.equations, self.model
        film: Any = Mirrored(scene) if eq.turned else scene
        model: Model = film.model
        if model.U <= 0.0 or model.effects or not self._alike(model, film.shape):
            return None
        if (G := self._balances(model, p_sides := model.p_sides)) is None:
            return None
        lean, near = copy(eq), copy(eq.constant)
        near.mu, near.U, near.p_c, near.p_sides = model.mu, model.U, model.p_c, p_sides  # type: ignore[assignment]
        near.shaft, near.extras, near.film, lean.constant = model.shaft, model.extras, model.film, near
        near.levers = model.levers
        before = (eq.constant.p_sides, eq.constant.p_c, (own.shaft, own.levers))
        same = before[:2] == (near.p_sides, near.p_c) and _same(before[2], (near.shaft, near.levers))
        told = {} if same else forces.totals(near, self.p, wanted=self.wanted)
        told = {name: told.get(name, value) if name in self.wanted else value for name, value in self.numbers.items()}
        report = lean.report(told)
        return np.array([report[name] for name in self.lambdas]) - G / eq.constant.scheme.flow_unit

    def _balances(self, model: Model, p_sides: Sequence[float]) -> Array | None:
        """lambda' G, m2/s; None for a film that is not positive."""
        own, sums = self.model, self._own
        if not _same(model.gap, own.gap):
            alone = (model.mu, model.U, p_sides) == (own.mu, own.U, self.equations.constant.p_sides)
            faces = self._by_faces if alone else None
            if faces is not None and (found := faces[0].sums(model.gap)) is not None:
                return faces[1] + found
            sums = self._weighed.sums(model.gap)
        if sums is None:
            return None
        return (sums[:, 0] + sums[:, 2:] @ np.array(p_sides)) / model.mu + model.U * sums[:, 1]  # type: ignore[no-any-return]

    def _alike(self, model: Model, shape: tuple[int, ...]) -> bool:
        own = self.model
        grid = self.equations.grid
        places = model.lines(shape) if shape == grid.shape else ()
        sides = [(side.kind, side.r) for side in model.sides] == [(side.kind, side.r) for side in own.sides]
        rest = all(_same(getattr(model, one.name), getattr(own, one.name)) for one in fields(Model) if one.name not in FREE)
        lines = len(places) == 2 and all(_lines(a, b) for a, b in zip(places, grid.places, strict=True))
        return sides and rest and lines and not getattr(model.gap, "rims", ())


def _lines(a: Array | None, b: Array | None) -> bool:
    return a is b if a is None or b is None else np.array_equal(a, b)


def _same(a: Any, b: Any) -> bool:
    """Whether two things are equal as far as they can tell."""
    try:
        return bool(a is b or a == b)
    except ValueError:  # arrays in them
        return False
