"""The loop of `coupling`: films with their coefficients held, and what effects make of their answers."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from ...base.parallel import Array
from ...errors import InputError
from ...problems.certificate import glance
from ...problems.film.effects import Answer, Cells, Effect, FaceFactors, answer, factors, neutral
from ...problems.film.fluid import Law
from ...problems.film.model import Model
from ...problems.film.tangent import WIDEST, Giving, closed, filled, lift_of, logarithm, renewed
from ...problems.solution import Solution
from ...scenes.scene import Solvable
from ..ask import Ask, Start
from ..chain import added
from ..compose import Inner
from .frozen import Frozen, lent, settled

NEAR = 0.3  # change of a coefficient, relative, from which on fields are near the answer
FIRST = 8  # films after which those that are not NEAR yet are looked at otherwise
LEAST_LIFT = -0.9  # of the rigid film, of an iterate
STEEPEST = 0.9  # of q, over 1/b, where the pressure is without bound: of an iterate, whose viscosity is then 10 times mu


class Loop:
    """G, and what its evaluations leave behind. Every method is collective."""

    def __init__(self, scene: Solvable, ask: Ask, inner: Inner):
        self.scene, self.ask, self.inner = scene, ask, inner
        self.model: Model = scene.model  # type: ignore[union-attr]
        self.law = self.model.law or Law()
        self.effects: tuple[Effect, ...] = self.model.effects
        if self.law.dowson_higginson:
            from ...problems.film.compressible import Compressible  # here: of few films

            self.effects = (Compressible(self.law), *self.effects)
        moving = {"density", "lift", "drag_flow"} & {name for effect in self.effects for name in effect.channels}
        if moving and self.model.scheme != "face":
            what = "fluid.density = dowson-higginson" if moving == {"density"} else f"an effect on {', '.join(sorted(moving))}"
            raise InputError(f"{scene.name}: scheme = {self.model.scheme}: {what} needs scheme = face")
        self.frozen = Frozen(scene, self.law, None, all(effect.even for effect in self.effects))
        try:
            self.base = lent(ask.start, scene.shape) or self.frozen.build(ask.comm)
        except InputError as error:
            raise InputError(f"{scene.name}: {error}") from None
        self.frozen = replace(self.frozen, base=self.base)
        self.p_sides = self.model.p_sides
        self.h = self.base.scheme.h.ravel()
        self.giving = Giving.of(self.law, self.model.effects, self.base, not (self.model.effects or self.model.grooves))
        if self.giving is not None:
            self.effects += (self.giving,)
        self.names = list(neutral(self.effects, 0))
        self.solution: Solution | None = None  # the last one
        self.first: Solution | None = None
        self.steps: list = []
        self.times: dict[str, float] = {}
        self.rescued: Solution | None = None
        self.solves, self.work, self.change = 0, 0, np.inf
        # How far a time step is expected to change the fields, as a vector; and how far they are then from having no effect.
        self.moved, self.reach = 0.0, np.inf
        self.still = False  # whether it falls no further
        self.answer: Answer | None = None
        self.lasting: dict[Any, Any] = {}  # of answers, for those that follow
        self.own: Array | None = None  # the vector that the last film has taken in place of that it was given
        self.left: dict[str, float] = {}  # of a film's balances, where that went into what its cells store
        self.beyond = False  # whether no pressure carries the last film's flow
        self.endless = ""  # why no pressure carries it, by an effect that makes viscosity grow without bound
        self.alone = all(getattr(effect, "fixed", False) or hasattr(effect, "beyond") for effect in self.effects)
        self.start: Solution | Start | None = ask.start
        self.begun = self.last = np.zeros(0)  # the vectors of fields that the loop began with, and of the last film's
        self.told: list[str] = []  # how it went on where Anderson's method did not settle
        # What the effects have made of each film's answer; what is taken instead of films; where Newton's method has begun.
        self.log, self.given, self.tried = list[Array](), list[Array](), list[Array]()

    def vector(self, cells: Cells) -> Array:
        """Fields as one vector, in which equal steps are equal relative changes of coefficients."""
        parts = {"viscosity": np.log, "warmth": np.log, "lift": lambda a: logarithm(a / self.h)}
        parts["contact"] = lambda a: logarithm(a / self.base.p_unit)
        parts["pressure"] = lambda a: logarithm(a * self.giving.slopes)  # type: ignore[union-attr]
        return np.concatenate([parts.get(name, lambda a: a)(cells[name]) for name in self.names])  # type: ignore[operator]

    def split(self, x: Array) -> list[Array]:
        """The parts of a vector, in the order of `names`."""
        return np.split(x, len(self.names))

    def cells(self, x: Array) -> Cells:
        """The other way round; what no film can have is cut."""
        found = dict(zip(self.names, self.split(x), strict=True))
        for name in {"viscosity", "warmth"} & set(found):
            found[name] = np.exp(np.clip(found[name], -WIDEST, WIDEST))
        if "lift" in found:
            found["lift"] = self.h * np.maximum(lift_of(found["lift"]), LEAST_LIFT)
        if self.giving is not None:
            found["pressure"] = np.maximum(lift_of(found["pressure"]), 0.0) / self.giving.slopes
        if "contact" in found:
            found["contact"] = self.base.p_unit * np.maximum(lift_of(found["contact"]), 0.0)
        return found

    def by(self, cells: Cells) -> FaceFactors:
        """What these fields make of the film's scheme."""
        dense = self.law.dowson_higginson
        return factors(self.base, cells, [float(self.law.density(np.array(p))) for p in self.p_sides] if dense else None)

    def again(self, certify: bool) -> None:
        """Solve the last film once more, from its own answer, and count it not; with a band around it, if that is asked for."""
        solves, work = self.solves, self.work
        self.ask = replace(self.ask, certify=certify)
        self.film(self.cells(self.last))
        self.solves, self.work = solves, work or self.work  # 0: all of its answers were given

    def film(self, cells: Cells) -> bool:
        """Solve the film with these coefficients; whether it has an answer, which is then `answer`."""
        plain = self.by(cells)
        by = plain if self.giving is None else self.giving.linearised(plain, cells, self.h)
        ask = replace(self.ask, start=self.start, nested=None if self.solves else self.ask.nested)
        if self.solves and self.rescued is None:  # the film that this begins with tells whether others have to take over
            ask = replace(ask, judge=glance)
        new = self.inner(replace(self.frozen, by=by if cells else None), ask)
        if self.solution is not None:
            self.solution.destroy()
        self.solution, self.start, self.first = new, new, self.first or new
        self.steps += new.steps
        self.rescued = new if new.took_over else self.rescued
        self.times = added(self.times, new.times)
        self.solves, self.work = self.solves + 1, self.work + new.problem.unknowns
        if not new.converged:
            return False
        if any(one.open for one in self.model.supplies):
            self.base.hold_at(new.problem.held.supplies)  # type: ignore[attr-defined]
        unit = new.problem.p_unit  # type: ignore[attr-defined]
        q, b = new.fields["p"] * unit, self.law.barus
        self.beyond = bool(b) and not self.base.reduce.max(b * q) < 1.0
        if self.beyond and {"viscosity", "lift"} & set(self.names):  # of an iterate: hotter oil, softer walls may carry it
            q = np.minimum(q, STEEPEST / b)
        p, problem, fields = self.law.pressure(q), new.problem, new.fields
        by, own = filled(plain, by, q), renewed(problem, self.law, None if new.took_over else p)
        self.own = None if own is None else self.vector(own)
        if own is not None:
            cells, by, fields = own, self.by(own), {"p": p / unit, "r": fields["r"]}
            problem = answer(self.base, self.law, cells, by, p, fields["r"], self.p_sides).problem
        if self.model.stored is not None and (own or self.ask.options.get("rest")):
            by = closed(by, problem, fields, self.base)
            self.left = {"residual": new.certificate.measures["residual"]}
        with np.errstate(all="ignore"):
            self.answer = answer(self.base, self.law, cells, by, p, new.fields["r"], self.p_sides, self.effects)
        self.answer.lasting = self.lasting
        return bool(np.isfinite(self.base.reduce.max(p)))

    def foreseen(self, known: Cells | None, near: Any) -> Cells:
        """What the effects make of the fields that a time step is expected to end with; known: of the step before, if any."""
        cells = known or neutral(self.effects, self.h.size)
        p = self.law.pressure(near.fields["p"] * near.problem.p_unit)
        with np.errstate(all="ignore"):
            self.answer = answer(self.base, self.law, cells, self.by(cells), p, near.fields["r"], self.p_sides)
            new, self.answer = self.vector(found := self.made()), None
        if not np.isfinite(self.base.reduce.sum(new)):  # a step may point beyond a law's largest pressure
            return cells
        if known is not None:
            self.moved = self.base.reduce.max(np.abs(new - self.vector(cells)))
            self.reach = self.base.reduce.max(np.abs(new - self.vector(neutral(self.effects, self.h.size))))
        return found

    @property
    def found(self) -> bool:
        """Whether the coefficients count as found."""
        return self.change <= settled(self.ask, self.model.stored, self.moved, self.reach, self.still)

    def made(self) -> Cells:
        """The fields that the effects make of the last answer."""
        assert self.answer is not None
        out = neutral(self.effects, self.h.size)
        for effect in self.effects:
            effect.apply(self.answer, out)
        return out

    def off(self, x: Array, watch: Callable[[], None]) -> tuple[float, Array]:
        """By how much the effects change these fields at most, or those taken in their place, and the change; NaN: no film."""
        self.last = x  # before `watch` may keep it
        found = self._found(x, watch)
        with np.errstate(all="ignore"):
            off = (x if self.own is None else self.own) - found
        return self.base.reduce.max(np.abs(off)), off

    def _found(self, x: Array, watch: Callable[[], None]) -> Array:
        """The vector of what the effects make of the film with these fields; NaN, which ends the loop, if it has no answer."""
        if len(self.log) < len(self.given):
            self.log.append(self.given[len(self.log)])
            self.solves += 1
            return self.log[-1]
        with np.errstate(all="ignore"):
            has = self.film(self.cells(x))
            self.log.append(self.vector(self.made()) if has else np.full_like(x, np.nan))
        plain = not self.base.reduce.max(np.abs(x - self.vector(neutral(self.effects, self.h.size))))
        # Others may change it yet, soft walls longest; alone, it is sure after a film with all else as it is without effects.
        after = 1 if self.alone else 3 * FIRST if "lift" in self.names else FIRST
        far = self.base.reduce.max(np.abs(x - self.log[-1])) > NEAR and (plain or not self.alone)
        due = any(abs(self.solves - after * 2 ** (k / 2)) < 0.5 for k in range(11))  # again and again: an iterate may hide it
        if has and far and due:
            from .nonlinear import beyond  # here: films without effects have no loop

            solves, own = self.solves, self.own
            self.endless = beyond(self)
            self.own, self.solves = own, self.solves if self.endless else solves
        watch()
        return self.log[-1]
