"""Derivatives of a film with effects by its scene's numbers: the whole coupled system by the implicit function.

With y = (z, x), the film's fields and those of its effects, and R(y; a) = 0 all equations (`coupled_response`),

    R_y y' = -R_a,      dQ/da = Q_y y' + Q_a:

one linear solve a number, for any number of quantities, those of the effects too. Derivatives of R and Q are differences along
y' and a, none of them of a solve.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, cast

import numpy as np

from ...base.differences import APART, CHORD, KINK, SLIGHT, WIDTHS
from ...base.parallel import Array
from ...errors import InputError, nearest
from ...problems.film.forces import PIVOT, totals
from ...problems.film.grooves import GroovedProblem
from ...problems.film.model import Model
from ...problems.film.supplies import Supply, supply_flows
from ...problems.grid import Places
from ...problems.solution import Solution
from ...scenes.scene import Derived, Scene
from ...scenes.values import values_of, with_values
from ..ask import Ask
from ..effects.frozen import Frozen
from ..effects.loop import Loop
from ..motions.coefficients import placed
from ..motions.coupled_response import CoupledResponse
from ..supplies import Fed
from ..turned import Mirrored, as_solved
from .adjoint import GUESS, conditions_of, moves_edges, size_of
from .equations import followed
from .laid import Laid

STEP = 1e-4  # of a number, relative, and of the fields
LARGER, ROUNDING = 10, 1e-14  # powers of ten by which a step from zero may grow; of a number: a smaller change of it is none
# Weights of the first derivative by steps of it, of fourth order: central, or to one side where the other has no values.
CENTRAL = {1: 2 / 3, -1: -2 / 3, 2: -1 / 12, -2: 1 / 12}
ONWARD = {0: -25 / 12, 1: 4.0, 2: -3.0, 3: 4 / 3, 4: -1 / 4}
STENCILS: tuple[dict[int, float], ...] = (CENTRAL, ONWARD, {-m: -w for m, w in ONWARD.items()})
# What the derivative to the right has more than that to the left; of what bends nothing is left.
KINKED = {0: -3.0, 1: 2.0, -1: 2.0, 2: -0.5, -2: -0.5}
MEAN = {1: 1.0, -1: -1.0, 2: -0.25, -2: 0.25}  # and the mean of both, bends that differ from side to side left out too
SEEN = 1e-5  # of the equations' derivative: a kink of them that is smaller is not looked at
FINER = 0.1  # steps so much smaller leave a kink as it is, and make what a jump makes of it larger
State = tuple[Array, Array, dict[str, float]]  # R, what sources and film disagree by, and the numbers


@dataclass(frozen=True)
class Placed(Derived):
    """A scene with lines of points where another grid has them."""

    places: Places

    @property
    def model(self) -> Model:
        return replace(self.whole.model, places=self.places)


class CoupledGradient(CoupledResponse):
    """As `adjoint.Adjoint` where it is asked by numbers of the scene. Collective, as its methods.

    Raises
    ------
    InputError : no converged solution, a quantity without a derivative.
    """

    def __init__(self, scene: Scene, solution: Solution, quantities: Sequence[str], flip: bool = False):
        if not solution.converged:
            raise InputError(f"{scene.name}: {solution.outcome.sentence}: no solution, no derivatives")
        self.scene: Any = placed(scene, solution)
        self.reported = problem = cast(Any, solution.problem)
        self.turned: bool = problem.moving is not problem  # the equations are those of the mirror image
        super().__init__(self._facing(self.scene), as_solved(solution), [], flip)
        self.found, self.conditions = conditions_of(scene, solution)
        self.report = self._numbers(self.loop, 0.0 * self.p, self.x)
        for name in (*quantities, *self.conditions):
            if name not in self.report and name not in self.found:
                known = nearest(name, self.report) or f"; of this scene they are known of {', '.join(self.report)}"
                raise InputError(f"quantity {name}: no derivative{known}")
        self.names = [name for name in dict.fromkeys([*quantities, *self.conditions]) if name not in self.found]
        self.switching = int(self.loop.base.reduce.sum(self.changing.astype(float)))
        self.ties: dict[str, int] = {}

    def _facing(self, scene: Any) -> Any:
        """The scene whose wall moves to larger x."""
        return Mirrored(scene) if self.turned else scene

    @property
    def lambdas(self) -> dict[str, None]:
        """What has derivatives: quantities and conditions."""
        return dict.fromkeys(self.names)

    def value(self, key: str) -> float:
        return values_of(self.scene)[key]

    def _numbers(self, loop: Loop, z: Array, x: Array, base: Any = None) -> dict[str, float]:
        """What is told of a state, vectors by their parts; base : a film near the loop's own."""
        at = self._answer(z, x, base or loop.base, loop)
        if self.free:
            held, highest = at.problem.held, at.problem.reduce.max
            P = [highest(np.where(self._owner == k, at.p, -np.inf)) for k in range(len(self.supplies))]
            supplies = tuple(replace(one, p=p) for one, p in zip(held.supplies, P, strict=True))  # type: ignore[union-attr]
            at.problem.held = replace(held, supplies=supplies)  # type: ignore[type-var]
        for effect in loop.effects:
            at.problem.more |= effect.report(at).numbers
        fields = {"p": at.p / at.problem.p_unit, "r": at.r}
        told = at.problem.quantities(fields)
        told = self.reported.told(told) if self.turned else told
        out = {name: value for name, value in totals(at.problem, at.p, at.r).items() if name.startswith(PIVOT)}
        for name, value in told.items():
            parts = {"": value}
            if isinstance(value, (list, tuple)) and name != "at":
                parts = dict(
                    zip(("_x", "_y") if name in ("force", "moment") else ("_1", "_2", "_3", "_4"), value, strict=False)
                )
            if isinstance(value, dict):
                parts = {f"_{part}": one for part, one in value.items()}
            out |= {name + part: one for part, one in parts.items() if isinstance(one, float)}
        return out

    def _rest(self, loop: Loop) -> tuple[Array, Array]:
        """R of another scene at the solution's state, and by how much sources and film disagree."""
        at = self._answer(np.zeros(self.n), self.x, loop.base, loop)
        film = at.problem
        H = film.balance(at.p / film.p_unit, at.r) * (film.scheme.flow_unit / self.unit)
        if isinstance(loop.base, GroovedProblem):
            for inside, groove in zip(loop.base.columns, loop.base.grooves, strict=True):
                H = np.where(inside, (at.p - groove.p) / self.loop.base.p_unit, H)
        loop.answer = at
        R = np.concatenate([H, self.x - loop.vector(loop.made()) if loop.names else self.x])
        sources = loop.scene.whole.model.supplies if self.free else ()  # type: ignore[union-attr]
        taken = supply_flows(film, at.p / film.p_unit, at.r)
        off = [sources[k].misfit(self.supplies[k].p, taken[k])[0] for k in self.free]
        return R, np.array(off)

    def slopes(self, key: str) -> tuple[dict[str, float], dict[str, float], dict[str, float]]:
        """dQ/da and the difference between both sides by quantity and condition, what was found held. Collective.

        Kinks by the number, and those that the fields come to along y', make a difference to first order: by one more solve,
        with the difference of R's derivatives. Where R or Q jumps the slope is that of a chord, and the difference inf.

        Raises
        ------
        InputError : no scene on either side.
        """
        d = self._step(key, self.value(key))
        stencil, known, anew = self._around(key, d)
        slope, kink = self._total(known, stencil, d)
        least = {name: ROUNDING * abs(value) / d for name, value in self.report.items()}
        out = {name: one if abs(one) > least[name] else 0.0 for name, one in slope.items()}
        if stencil is not CENTRAL:
            return out, dict.fromkeys(out, np.inf) if anew else {}, {}
        jumps = {name: abs(one) for name, one in kink.items() if abs(one) > KINK * abs(out[name]) + 10.0 * least[name]}
        if jumps:
            mean, closer = self._total(self._around(key, FINER * d)[1], MEAN, FINER * d)
            larger = {name: max(one, abs(closer[name])) for name, one in jumps.items()}
            steps = [name for name, one in larger.items() if abs(closer[name] - kink[name]) > APART * one]
            out |= {name: mean[name] for name in jumps}
            if steps:
                chord = self._chord(key, CHORD * d / STEP)
                out |= {name: chord[name] for name in steps}
                jumps |= dict.fromkeys(steps, np.inf)
        if moves_edges(self.scene, key, self.value(key) + d):  # many steps, though it may seem smooth next to a
            chords = [out, *(self._chord(key, width * CHORD * d / STEP) for width in WIDTHS)]
            for name in self.names:
                values = [one[name] for one in chords]
                if np.ptp(values) > max(APART * np.abs(values).max(), SLIGHT * abs(self.report[name]) * STEP / d):
                    out[name], jumps[name] = np.nan, np.inf
        return out, dict.fromkeys(out, np.inf) if anew else jumps, {}

    def _chord(self, key: str, width: float) -> dict[str, float]:
        """Mean slopes from so far below to so far above."""
        ends = {m: self._beside(key, self.value(key) + m * width) for m in (-1, 1)}
        return self._total(ends, {-1: -0.5, 1: 0.5}, width)[0]

    def _around(self, key: str, d: float) -> tuple[dict[int, float], dict[int, State], bool]:
        """A stencil of scenes that there are, and what they have at the solution's state; that of the scene itself too. And
        whether the lines of points of some are laid anew."""
        a, known = self.value(key), {0: self._here}
        laid = Laid(self.scene.model, self.loop.base.grid.shape)
        for stencil in STENCILS:
            try:
                beside: list[Any] = [with_values(self.scene, {key: a + m * d}) for m in stencil]
                anew = any(laid.anew(scene.model) for scene in beside)
                for m in stencil:
                    known[m] = known.get(m) or self._beside(key, a + m * d)
                return stencil, known, anew
            except InputError as error:
                refused = error
        raise refused

    def _total(self, known: dict[int, State], stencil: dict[int, float], d: float) -> tuple[dict[str, float], dict[str, float]]:
        """dQ/da, and by a stencil of four places around a the difference between both sides, from what scenes beside have."""
        R, off, own = self._weighed(known, stencil, d)
        y = self._settled(-R, 0.0, 0.0, off=off)
        slope, along = self._numbers_along(y)
        total = {name: own[name] + slope[name] for name in self.names}
        if len(stencil) != len(CENTRAL):
            return total, {}
        kinks, apart, own = self._weighed(known, KINKED, d)
        t = self._reach(y)
        states = {m: self._system(m * t * y[: self.n], self.x + m * t * y[self.n :], self.loop.base) for m in KINKED}
        kinks = kinks + np.sum([w * states[m][0] for m, w in KINKED.items()], axis=0) / t
        given = np.sum([w * states[m][2][0] for m, w in KINKED.items()], axis=0) / t
        largest = self.loop.base.reduce.max
        more = dict.fromkeys(self.names, 0.0)
        if largest(np.abs(kinks)) > SEEN * largest(np.abs(R)):
            more = self._numbers_along(self._settled(-kinks, given, 0.0, off=apart))[0]
        return total, {name: own[name] + along[name] + more[name] for name in self.names}

    def _weighed(self, known: dict[int, State], stencil: dict[int, float], d: float) -> State:
        """R, misfits and numbers of scenes beside this one, summed by a stencil's weights over the step."""
        R = np.sum([w * known[m][0] for m, w in stencil.items()], axis=0) / d
        off = np.sum([w * known[m][1] for m, w in stencil.items()], axis=0) / d
        return R, off, {name: sum(w * known[m][2][name] for m, w in stencil.items()) / d for name in self.names}

    def _reach(self, y: Array) -> float:
        """How far along a direction differences go."""
        by_size = np.concatenate([np.where(self.cavity, 1.0, 1.0 / self.p_max) * y[: self.n], y[self.n :]])
        return STEP / (self.loop.base.reduce.max(np.abs(by_size)) or STEP)

    def _numbers_along(self, y: Array) -> tuple[dict[str, float], dict[str, float]]:
        """The numbers' derivatives along a direction, and by how much they differ to both sides."""
        t = self._reach(y)
        at = {m: self._numbers(self.loop, m * t * y[: self.n], self.x + m * t * y[self.n :]) for m in CENTRAL} | {
            0: self.report
        }

        def of(stencil: dict[int, float]) -> dict[str, float]:
            return {name: sum(w * at[m][name] for m, w in stencil.items()) / t for name in self.names}

        return of(CENTRAL), of(KINKED)

    @cached_property
    def _here(self) -> State:
        return *self._rest(self.loop), self.report

    def _step(self, key: str, a: float) -> float:
        """A small change of a number; of one whose size is a guess one that changes the equations by more than rounding does.

        No other is made larger: where nearly all of a film is cavitated its level hardly changes the equations, and they bend.
        """
        size = size_of(self.scene, key, self.loop.base, self.p * self.loop.base.p_unit, key in self.found)
        d = STEP * (size or GUESS)
        if a or size is not None:
            return d
        with suppress(InputError):  # so large a value is not allowed
            here = self._beside(key, 0.0)[0]
            for _ in range(LARGER):
                if self.loop.base.reduce.max(np.abs(self._beside(key, 10.0 * d)[0] - here)) > STEP:
                    break
                d *= 10.0
        return d

    def _beside(self, key: str, value: float) -> State:
        """R, what sources and film disagree by, and the numbers of the scene with another value, at the solution's state."""
        scene, own = self._facing(with_values(self.scene, {key: value})), self.loop.base.grid
        places = followed(own, self.loop.frozen.constant, Frozen(scene, self.loop.law).constant)
        if places is None:
            raise InputError("the film's edges are others beside this value")
        if any(at is not None for at in places):
            scene = Placed(scene, places)
        if self.free:
            held = zip(scene.model.supplies, self.supplies, strict=True)
            scene = Fed(scene, tuple(Supply(one.region, known.p) for one, known in held))
        loop = Loop(scene, Ask(comm=self.loop.base.grid.petsc_comm), None)  # type: ignore[arg-type]
        loop.base = loop.base.revised(self.loop.base.dry)
        try:
            if loop.base.grid.shape != self.loop.base.grid.shape or loop.names != self.loop.names:
                raise InputError("the grid or the effects are others beside this value")
            return *self._rest(loop), self._numbers(loop, np.zeros(self.n), self.x)
        finally:
            loop.base.destroy()
