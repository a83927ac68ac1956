"""Derivatives of a film with effects by its scene's numbers: the whole coupled system by the implicit function.

With y = (z, x), the film's fields and those of its effects, and R(y; a) = 0 all equations (`coupled_response`),

    R_y y' = -R_a,      dQ/da = Q_y y' + Q_a:

one linear solve a number, for any number of quantities, those of the effects too. Derivatives of R and Q are differences along
y' and a, none of them of a solve.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from ..base.parallel import Array
from ..errors import InputError, nearest
from ..problems.film.cavity import VOID
from ..problems.film.forces import PIVOT, totals
from ..problems.film.grooves import GroovedProblem
from ..problems.film.supplies import Supply, supply_flows
from ..problems.solution import Solution
from ..scenes.scene import Scene
from ..scenes.values import values_of, with_values
from .adjoint import conditions_of, scale_of
from .ask import Ask
from .coefficients import placed
from .coupled_response import CoupledResponse
from .loop import Loop
from .supplies import Fed

STEP = 1e-4  # of a number, relative, and of the fields
LARGER, ROUNDING = 10, 1e-14  # powers of ten by which a step from zero may grow; of a number: a smaller change of it is none
# Weights of the first derivative by steps of it, of fourth order: central, or to one side where the other has no values.
CENTRAL = {1: 2 / 3, -1: -2 / 3, 2: -1 / 12, -2: 1 / 12}
ONWARD = {0: -25 / 12, 1: 4.0, 2: -3.0, 3: 4 / 3, 4: -1 / 4}
STENCILS: tuple[dict[int, float], ...] = (CENTRAL, ONWARD, {-m: -w for m, w in ONWARD.items()})


class CoupledGradient(CoupledResponse):
    """As `adjoint.Adjoint` where it is asked by numbers of the scene. Collective, as its methods.

    Raises
    ------
    InputError : no converged solution, a quantity without a derivative.
    """

    def __init__(self, scene: Scene, solution: Solution, quantities: Sequence[str]):
        if not solution.converged:
            raise InputError(f"{scene.name}: {solution.outcome.sentence}: no solution, no derivatives")
        self.scene: Any = placed(scene, solution)
        super().__init__(self.scene, solution, [])
        self.found, self.conditions = conditions_of(scene, solution)
        self.report = self._numbers(self.loop, 0.0 * self.p, self.x)
        for name in (*quantities, *self.conditions):
            if name not in self.report and name not in self.found:
                known = nearest(name, self.report) or f"; of this scene they are known of {', '.join(self.report)}"
                raise InputError(f"quantity {name}: no derivative{known}")
        self.names = [name for name in dict.fromkeys([*quantities, *self.conditions]) if name not in self.found]
        switching = (np.abs(self.p) <= VOID * self.p_max) & (np.abs(self.r) <= VOID) & ~self.given
        self.switching = int(self.loop.base.reduce.sum(switching.astype(float)))
        self.ties: dict[str, int] = {}

    @property
    def lambdas(self) -> dict[str, None]:
        """What has derivatives: quantities and conditions."""
        return dict.fromkeys(self.names)

    def value(self, key: str) -> float:
        return values_of(self.scene)[key]

    def _numbers(self, loop: Loop, z: Array, x: Array) -> dict[str, float]:
        """What is told of a state, vectors by their parts."""
        at = self._answer(z, x, loop.base, loop)
        if self.free:
            held, highest = at.problem.held, loop.base.reduce.max
            P = [highest(np.where(self._owner == k, at.p, -np.inf)) for k in range(len(self.supplies))]
            supplies = tuple(replace(one, p=p) for one, p in zip(held.supplies, P, strict=True))  # type: ignore[union-attr]
            at.problem.held = replace(held, supplies=supplies)  # type: ignore[type-var]
        for effect in loop.effects:
            at.problem.more |= effect.report(at).numbers
        fields = {"p": at.p / at.problem.p_unit, "r": at.r}
        told = at.problem.quantities(fields)
        out = {name: value for name, value in totals(at.problem, at.p).items() if name.startswith(PIVOT)}
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
        sources = loop.scene.whole.model.supplies if self.free else ()  # type: ignore[attr-defined]
        taken = supply_flows(film, at.p / film.p_unit, at.r)
        off = [sources[k].misfit(self.supplies[k].p, taken[k])[0] for k in self.free]
        return R, np.array(off)

    def slopes(self, key: str) -> tuple[dict[str, float], dict[str, float]]:
        """dQ/da by quantity and condition, what was found held; kinks are not told. Collective.

        Raises
        ------
        InputError : no scene on either side.
        """
        a, base = self.value(key), self.loop.base
        d = self._step(key, a)
        known: dict[int, tuple[Array, Array, dict[str, float]]] = {}
        for stencil in STENCILS:
            try:
                for m in stencil:
                    known[m] = known.get(m) or self._beside(key, a + m * d)
                break
            except InputError as error:
                refused = error
        else:
            raise refused
        R_a = np.sum([w * known[m][0] for m, w in stencil.items()], axis=0) / d
        off = np.sum([w * known[m][1] for m, w in stencil.items()], axis=0) / d
        y = self._settled(-R_a, 0.0, 0.0, off=off)
        z, x = y[: self.n], y[self.n :]
        size = base.reduce.max(np.abs(np.concatenate([np.where(self.cavity, 1.0, 1.0 / self.p_max) * z, x])))
        t = STEP / size if size > 0.0 else 1.0
        moved = {m: self._numbers(self.loop, m * t * z, self.x + m * t * x) for m in CENTRAL}
        out = {}
        for name in self.names:
            own = sum(w * known[m][2][name] for m, w in stencil.items()) / d
            total = own + sum(w * moved[m][name] for m, w in CENTRAL.items()) / t
            out[name] = total if abs(total) * d > ROUNDING * abs(self.report[name]) else 0.0
        return out, {}

    def _step(self, key: str, a: float) -> float:
        """A small change of a number; of one that is zero one that changes the equations by more than rounding does."""
        d = STEP * scale_of(self.scene, key, self.loop.base, self.p, key in self.found)
        if a:
            return d
        with suppress(InputError):  # so large a value is not allowed
            here = self._beside(key, 0.0)[0]
            for _ in range(LARGER):
                if self.loop.base.reduce.max(np.abs(self._beside(key, 10.0 * d)[0] - here)) > STEP:
                    break
                d *= 10.0
        return d

    def _beside(self, key: str, value: float) -> tuple[Array, Array, dict[str, float]]:
        """R, what sources and film disagree by, and the numbers of the scene with another value, at the solution's state."""
        scene: Any = with_values(self.scene, {key: value})
        if self.free:
            held = zip(scene.model.supplies, self.supplies, strict=True)
            scene = Fed(scene, tuple(Supply(one.region, known.p) for one, known in held))
        loop = Loop(scene, Ask(comm=self.loop.base.grid.petsc_comm), None)  # type: ignore[arg-type]
        try:
            if loop.base.grid.shape != self.loop.base.grid.shape or loop.names != self.loop.names:
                raise InputError("the grid or the effects are others beside this value")
            return *self._rest(loop), self._numbers(loop, np.zeros(self.n), self.x)
        finally:
            loop.base.destroy()
