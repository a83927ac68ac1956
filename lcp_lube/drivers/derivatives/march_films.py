"""lambda' G of the steps of a line's march at films near by, without the steps' problems: all steps at once.

As in a steady film (`problems/film/by_faces`) it is linear in what the faces conduct and drag, and in what the cells store.
What it has of each is known once; another number costs the films of the steps, a viscosity or a side's pressure not even these.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ...base.parallel import Array
from ...problems.film.edges import Around, face_film, jumps_of, pairs
from ...problems.film.fluid import Law
from ...problems.film.reynolds import sides
from ...problems.film.shapes import Sum
from ...problems.film.stored import mean_film
from ...problems.film.views import MirroredFilm, Travelling
from ...problems.strips import MANY
from ..marches.march_course import Course
from .near_films import alike, same


@dataclass(frozen=True)
class StepFilms:
    """Of the steps, a row each: C (m3) and H (m) of the faces, the film at the points before them, and of the cells what a step
    comes to store; and what earlier ones have stored, from t = 0 on."""

    C: Array
    H: Array
    before: Array
    stored: Array
    kept: Array


def films_of(course: Course) -> StepFilms:
    """Those of a march."""
    grid = course.grid
    rows: list[tuple[Array, ...]] = []
    nodes, faces = grid.nodes_and_faces(0)
    period, none = grid.lengths[0] if grid.periodic[0] else 0.0, np.zeros(1)
    places = np.concatenate([faces, nodes[:-1], grid.x[0]])[None, :]
    kept = [course.fill * mean_film(grid, course.models(0.0, course.place(0)).film)[0]]
    h: Array = _at_once(course, places)
    if h.size:
        H, before, stored = np.split(h, [faces.size, 2 * faces.size], axis=1)
        return StepFilms(H**3, H, before, stored, np.concatenate([kept, stored]))
    for n, step in enumerate(course.trace.steps, start=1):
        model = course.models(step.t, course.place(n))
        film = Around(model.gap, grid)
        cut = jumps_of(film, "x")
        h = np.broadcast_to(film(places, none[:, None]), places.shape)[0].astype(float)
        H, before, stored = np.split(h, [faces.size, 2 * faces.size])
        C = H**3
        if cut:
            C, H = (a[0] for a in face_film(film, pairs(nodes), faces, none, cut, (), np.ones((2, 1)), period))
            stored = mean_film(grid, film)[0]
        kept.append(mean_film(grid, model.film)[0] if cut else stored)
        rows.append((C, H, before, stored))
    C, H, before, stored = (np.array(one) for one in zip(*rows, strict=True))
    return StepFilms(C, H, before, stored, np.array(kept))


def _at_once(course: Course, places: Array) -> Array:
    """The films of all steps at places, a row each, where the wall's way is all that time changes; else none."""
    steps, U = course.trace.steps, course.film(1).U * (-1.0 if course.turned else 1.0)
    first, last = (course.models(steps[n].t, course.place(n + 1)).gap for n in (0, -1))
    if course.place(1) is not None or jumps_of(first, "x") or not same(_carried(first, U * steps[-1].t), last):
        return np.zeros((0, 0))
    blocks = np.array_split(U * np.array([step.t for step in steps])[:, None], 1 + len(steps) * places.size // MANY)
    films = [(Around(_carried(first, way), course.grid), (way.size, places.size)) for way in blocks]
    return np.concatenate([film(np.broadcast_to(places, shape), np.zeros((1, 1))) for film, shape in films])


def _carried(film: Any, way: Any) -> Any:
    """The film with what its wall carries along so far, m; of several ways the x that it is asked for has a row each."""
    if isinstance(film, MirroredFilm):
        return replace(film, film=_carried(film.film, way))
    if isinstance(film, Sum):
        return replace(film, parts=[replace(one, travel=way) if isinstance(one, Travelling) else one for one in film.parts])
    return film


class MarchFilms:
    """lambda' G of all steps but the steady one that a march may begin with. Collective, as its method.

    Parameters
    ----------
    lambdas : by quantity, of each step, 0 the first. units : of flow, of each step.
    """

    def __init__(self, course: Course, lambdas: Mapping[str, Sequence[Array]], units: Mapping[int, float]):
        self.course, self.model = course, course.film(1)
        steps, grid = course.trace.steps, course.grid
        self.w = np.array([[one[n] / units[n] for n in range(1, len(steps) + 1)] for one in lambdas.values()])
        enters = self.model.sides[0].r if grid.ends[0][0] == "open" else 0.0
        self.p = np.array([grid.ghosted(kept.p, 0.0)[1] for kept in steps])
        r = np.array([grid.ghosted(kept.r, 0.0)[1] for kept in steps])
        if sides(grid)[0].any():
            r[:, 0] = enters
        self.wall, self.void = (_left(self.w, a) for a in (np.ones_like(r[:, :-1]), -r[:, :-1]))
        left = self.w * (1.0 - r[:, 1:-1])  # of what each step comes to store, by the film
        start = course.kept(0)
        begun = np.ones_like(left[0, :1]) if start is None else 1.0 - start.r[None, :]
        full = np.concatenate([begun, 1.0 - r[:, 1:-1]])
        formulas = [course.formula(n) for n in range(1, len(steps) + 1)]
        self.stored = np.array([one.weight for one in formulas])[:, None] * left
        self.kept = np.zeros((len(self.w), *full.shape))  # the same of what earlier ones have stored
        self.kept[:, :-1] = np.array([one.last for one in formulas])[:, None] * self.w
        self.kept[:, :-2] += np.array([one.before for one in formulas[1:]])[:, None] * self.w[:, 1:]
        self.kept *= full

    @staticmethod
    def can(course: Course) -> bool:
        """Whether a march is that of a line under a wall at one speed, its fluid's density constant, and nothing else found."""
        model, table = course.film(1), course.table
        alone = not (model.supplies or model.grooves or model.effects or model.dense or model.mean_cubes)
        steady = not (table.free or table.set) and model.U > 0.0
        return alone and steady and course.grid.dim == 1 and "closed" not in course.grid.ends[0]

    @cached_property
    def _own(self) -> StepFilms:
        return films_of(self.course)

    @cached_property
    def _pressed(self) -> Array:
        return self._by(self.model.law or Law())

    def _by(self, law: Law) -> Array:
        q = law.reduced(self.p)
        return _left(self.w, q[:, :-1] - q[:, 1:])

    def sums(self, course: Course) -> Array | None:
        """Of each quantity; None where it is not that of another film, fluid or wall on as many points."""
        if not (alike(course.film(1), self.model) and self.can(course)):
            return None
        films = self._films(course)
        if not course.grid.reduce.min(np.append(films.C, films.before)) > 0.0:
            return None
        # Term by term: sums of a march are large against what one number changes of them.
        changes = [(one - here).sum(axis=(1, 2)) for one, here in zip(self._terms(course, films), self._here, strict=True)]
        return np.asarray(course.grid.comm.allreduce(sum(changes) + sum(here.sum(axis=(1, 2)) for here in self._here)))

    @cached_property
    def _here(self) -> list[Array]:
        return self._terms(self.course, self._own)

    def _terms(self, course: Course, films: StepFilms) -> list[Array]:
        model, grid, scheme = course.film(1), course.grid, self.model.scheme
        law, k = model.law or Law(), films.C / (6.0 * model.mu * grid.steps(0))
        pressed = (self._pressed if same(model.law, self.model.law) else self._by(law)) * k
        for end, side, p_side in zip((0, -1), sides(grid), model.p_sides, strict=False):
            if side.any():
                pressed[:, :, end] -= float(law.reduced(np.array(p_side))) * self.w[:, :, end] * k[:, end]
        wall = self.wall * (films.before if scheme == "upwind" else films.H)
        void = self.void * (films.H if scheme == "face" else films.before)
        area = 2.0 * grid.spacing[0] * grid.widths(0)
        return [pressed, model.U * (wall + void), self.stored * (films.stored * area), -self.kept * (films.kept * area)]

    def _films(self, course: Course) -> StepFilms:
        """Time changes them by the wall's way and the journal's place alone: the same at three times, they are so always."""
        last, grid = len(self.course.trace.steps), self.course.grid
        still = course.table == self.course.table and course.grid.lengths == grid.lengths and course.grid.even == grid.even
        if still and grid.even and all(same(course.film(n).gap, self.course.film(n).gap) for n in (0, 1, last)):
            return self._own
        return films_of(course)


def _left(w: Array, a: Array) -> Array:
    """Of flows a through the faces, one by one, the sum of w times what leaves the cells."""
    out = np.zeros((*w.shape[:2], w.shape[2] + 1))
    out[..., 1:] += w * a[:, 1:]
    out[..., :-1] -= w * a[:, :-1]
    return out
