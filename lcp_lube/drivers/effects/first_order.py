"""What effects change of a number, to first order: one transposed solve on an answer of the film, no solve with the effects.

With J' lambda = dQ/dz at an answer (`adjoint`), coefficients that change by d on it, their fields z held, change Q by
dL(d) = dQ - lambda' dG. An effect's d is what it makes of the answer: of the logarithm of viscosity, density and film, so that
exp(dL/Q) - 1 is near the truth for large effects too (a film whose viscosity doubles everywhere carries twice the load). What
is found for the scene, where a load is carried, follows by the conditions that it meets.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from math import expm1
from typing import Any

import numpy as np

from ...base.parallel import Array
from ...errors import InputError
from ...problems.film.compressible import Compressible
from ...problems.film.effects import (
    CHANNELS,
    Answer,
    Cells,
    Effect,
    FaceFactors,
    answer,
    around,
    factors,
    framed_by,
    neutral,
)
from ...problems.film.fluid import Law
from ...problems.film.forces import weights
from ...problems.solution import Solution
from ...scenes.effects.named import FLUID, named, without
from ...scenes.values import values_of
from ..derivatives.adjoint import Adjoint, conditions_of
from ..derivatives.equations import Equations, cavity_of, fields_of, right_side, unknowns
from ..derivatives.implicit import Implicit
from ..motions.coefficients import placed
from ..motions.linearised import Linear
from ..turned import Mirrored

STEP = 1e-4  # of an effect: its derivative is a difference of two values of L
THINNEST = -0.9  # of the rigid film, of a lift
SOME = 1e-300  # Pa
FORCES = {"load", "force_x", "force_y"}  # numbers that are made of no others
MOST = 30.0  # of log(Q), up or down, by an effect: more tells nothing, and less than exp(-36) is no digit of 1 + dQ/Q


class FirstOrder:
    """A film's answer with some of its scene's effects, and what the others would change. Collective, as its methods.

    Parameters
    ----------
    scene : with all its effects. kept : those that `solution` was solved with. quantity : a key of its results, or what a
        balance has found. found : how what is found follows, of an earlier answer; by default of this one, without effects.

    Raises
    ------
    InputError : a quantity, or a film, without derivatives.
    """

    def __init__(self, scene: Any, solution: Solution, kept: Sequence[str], quantity: str, found: Implicit | None = None):
        grid = solution.problem.grid
        self.scene, self.kept = scene if scene.shape == grid.shape else scene.with_shape(grid.shape), list(kept)
        self._fields: dict[tuple[str, ...], Cells] = {}
        self.names = names = named(scene)
        if found is None:
            found = Implicit([], [], np.zeros((0, 0)), {})
            (keys, conditions), supplied = conditions_of(self.scene, solution), solution.settings.get("supply_pressures")
            if keys == [quantity] and not supplied and (slope := solution.settings.get("load_slope")):  # a search knows it
                found = Implicit(keys, list(conditions), np.array([[1.0 / slope]]), {})
            elif keys or supplied:
                law = without(self.scene, [name for name in names if name != "barus" or name not in kept])
                adjoint = Adjoint(law, solution, [quantity])
                found = Implicit.of(adjoint)
                adjoint.destroy()
        self.found, self.quantity = found, quantity
        pressures = [float(P) for P in solution.settings.get("supply_pressures", ())]
        self.scene = placed(self.scene, solution)
        bare = without(self.scene, names)
        solved = solution.problem.moving  # type: ignore[attr-defined]
        own = getattr(solution.problem, "rigid", None) or (None if self.kept else solution.problem)  # solved without effects
        self.equations = eq = Equations(bare, grid.petsc_comm, pressures, dry=solved.dry, solved=own)
        self.base, (self.p, self.r) = eq.constant, fields_of(solution)
        self.h = self.base.scheme.h.ravel()
        model = (Mirrored(self.scene) if eq.turned else self.scene).model
        self.whole, acting = model.law or Law(), [name for name in names if name not in FLUID]
        self.acts: dict[str, Effect] = dict(zip(acting, model.effects, strict=True))
        every = self._physics(names)[1]
        if any(getattr(effect, "even_lines", False) for effect in every) and not self.base.grid.even:
            raise InputError(f"scene {scene.name}: an effect of it needs even lines")
        self.cells = {**neutral(every, self.h.size), **solved.cells}
        if "barus" in names:
            self.cells.setdefault("viscosity", np.ones(self.h.size))
        self.law = self._physics(self.kept)[0]
        self.solved = {name: self.cells[name] for name in solved.cells if name in self.cells}
        if eq.lent and not CHANNELS.keys() & solved.cells.keys():
            eq.constant = film = solved.with_scheme(solved.scheme, solved.mu)
            film.oil = None  # numbers are the discrete film's
        else:
            self._film(self.solved)
        self.at = Answer(eq.constant, self.p, self.r, self.cells, self.law, self.base, rough=True)
        wanted = [name for name in dict.fromkeys([quantity, *found.conditions]) if name not in found.found]
        self.numbers = numbers = eq.numbers(self.p, self.r, FORCES if FORCES.issuperset(wanted) else None)
        self.parts = {name: eq.partials(numbers, name) for name in wanted}
        self.value = eq.report(numbers).get(quantity)
        if quantity in found.found:
            self.value = values_of(self.scene)[quantity]
        self.cavity, _ = cavity_of(eq, self.p, self.r)
        self.linear = Linear(eq.constant, self.cavity, given=eq.held)
        self.lambdas = self._adjoints()

    def change(self, name: str) -> tuple[float | None, float]:
        """dQ/Q by an effect that was not solved for, or by Barus' law, and the largest change of a coefficient. Collective."""
        d, sign = self._change(name)
        with np.errstate(all="ignore"):
            total = self.found.total(self.quantity, name, dict(zip(self.lambdas, self._slopes(d), strict=True)))
        largest = {key: self.base.reduce.max(np.abs(change)) for key, change in d.items()}
        if "contact" in largest:
            largest["contact"] /= max(self.base.reduce.max(self.p), SOME)
        size = max(largest.values(), default=0.0)
        grows = sign * total / self.value if self.value else np.nan
        return (expm1(grows) if abs(grows) <= MOST else None), size

    def second(self, name: str) -> float:
        """dQ/Q by an effect that was not solved for, to second order; NaN where there is none. Collective.

        L has no slope by the fields: at z + z', J z' = -dG, with what the effect makes of these, it has the second order too.
        What is found for the scene is held, but for its first order.
        """
        eq, (d, _) = self.equations, self._change(name)
        with np.errstate(all="ignore"):
            self._film(self.cells)
            before = self._balance(self.p, self.r)
            self._film(self._moved(d, STEP), STEP)
            (dz,) = self.linear.solve([(before - self._balance(self.p, self.r)) / STEP])
            p = np.where(self.cavity, self.p, self.p + dz * eq.constant.p_unit)
            r = np.where(self.cavity, self.r - dz, self.r)
            cells = self._moved(d, 1.0)
            self._film(cells, 1.0)
            after = self._makes([*self.kept, name], Answer(eq.constant, p, r, cells, self.law, self.base))
            d = {key: self._over(key, after[key], self.cells[key]) for key in after}
            moved = self._lagrangians(self._moved(d, 1.0), 1.0, p, r) - self._start
            return self.found.total(self.quantity, name, dict(zip(self.lambdas, moved, strict=True))) / (self.value or np.nan)

    def _change(self, name: str) -> tuple[Cells, float]:
        """What an effect changes, d, and its sign: -1 for one that was solved for, Barus' law."""
        if name in self.kept:
            return {"viscosity": -np.log(self.law.viscosity(self.p))}, -1.0
        both = [*self.kept, name]
        after, channels = self._made(both), {"viscosity", *neutral(self._physics(both)[1], 0)}
        with np.errstate(all="ignore"):
            return {key: self._over(key, after[key], self.cells[key]) for key in after if key in channels}, 1.0

    def made(self, names: Sequence[str]) -> Cells:
        """The fields that effects make of this answer: what the loop that solves for them has of its first film."""
        made = self._made(names)
        return {key: made[key] for key in neutral(self._physics(names)[1], 0)}

    def _physics(self, names: Sequence[str]) -> tuple[Law, tuple[Effect, ...]]:
        """The law of pressure and the effects, in the order in which the loop has them, of these names."""
        dense = self.whole.dowson_higginson and "density" in names
        law = replace(self.whole, barus=self.whole.barus if "barus" in names else 0.0, dowson_higginson=dense)
        return law, (*((Compressible(law),) if dense else ()), *(self.acts[name] for name in self.acts if name in names))

    def _made(self, names: Sequence[str]) -> Cells:
        key = tuple(sorted(names))
        if key not in self._fields:
            self._fields[key] = self._makes(names, self.at)
        return self._fields[key]

    def _makes(self, names: Sequence[str], at: Answer) -> Cells:
        """What these effects make of an answer."""
        out = neutral(self._physics(self.names)[1], self.h.size)
        if "barus" in self.names:
            out.setdefault("viscosity", np.ones(self.h.size))
        for effect in self._physics(names)[1]:
            effect.apply(at, out)
        if (barus := self._physics(names)[0]).barus and not self.law.barus:
            out["viscosity"] = out["viscosity"] * barus.viscosity(at.p)
        return out

    def _over(self, key: str, after: Array, before: Array) -> Array:
        """The change of a coefficient: of its logarithm, and of the film's; of asperities' pressure in Pa."""
        if key == "contact":
            return after - before
        if key == "lift":
            after, before = (1.0 + np.maximum(lift / self.h, THINNEST) for lift in (after, before))
        return np.asarray(np.log(after / before))

    def _moved(self, d: Cells, t: float) -> Cells:
        out = dict(self.cells)
        for key, change in d.items():
            if key == "contact":
                out[key] = out[key] + t * change
            elif key == "lift":
                out[key] = (self.h + out[key]) * np.exp(t * change) - self.h
            else:
                out[key] = out[key] * np.exp(t * change)
        return out

    def _slopes(self, d: Cells) -> Array:
        """dL/dt of all numbers, where coefficients change by t d. Collective."""
        cells = self._moved(d, STEP)
        if not self._only_pressures(cells):
            return (self._lagrangians(cells, STEP) - self._start) / STEP
        solved = {key: self.cells[key] for key in d if key in self.solved}
        before = self._factors(solved, 0.0).values if solved else dict.fromkeys(self._flows, 1.0)
        by, dot = self._factors({key: cells[key] for key in d}, STEP).values, self.base.reduce.dot
        G = sum(flow * ((by[name] - before[name]) / before[name]) for name, flow in self._flows.items()).ravel()  # type: ignore[union-attr]
        return np.array([-dot(one, G) / STEP for one in self.lambdas.values()])

    def _only_pressures(self, cells: Cells) -> bool:
        """Whether all numbers are integrals of the pressure, so that coefficients change G alone."""
        wanted = {part for one in self.parts.values() for part in one}
        return "contact" not in cells and wanted <= set(weights(self.base))

    @cached_property
    def _start(self) -> Array:
        return self._lagrangians(self.cells)

    @cached_property
    def _flows(self) -> dict[str, Array]:
        """What leaves each cell at the answer by the factors of its faces; nothing where the pressure is given."""
        film, grid = self.at.problem, self.base.grid
        s, p, r = film.scheme, self.p.reshape(grid.box) / film.p_unit, self.r.reshape(grid.box)
        beside = around(framed_by(grid, self.p / film.p_unit, [side / film.p_unit for side in film.p_sides]))
        names = ("k_W", "k_E", "k_S", "k_N")[: 2 * grid.dim]
        flows = {name: getattr(s, name) * (p - near) for name, near in zip(names, beside, strict=False)}
        flows["u_W"] = s.b_W * grid.ghosted(self.r, outside=0.0)[1:-1, :-2] - s.couette_W
        flows["u_E"] = s.couette_E + s.b_E * r
        given = self.equations.given
        free = 1.0 if given is None else ~given.reshape(grid.box)
        return {name: free * flow for name, flow in flows.items()}

    def _factors(self, cells: Cells, t: float) -> FaceFactors:
        dense, own = self._physics(self.names)[0], self._physics(self.kept)[0]
        power = 1.0 if own.dowson_higginson else t
        return factors(self.base, cells, [float(dense.density(np.array(p))) ** power for p in self.equations._p_sides])

    def _film(self, cells: Cells, t: float = 0.0) -> None:
        """The equations are those of the film with these coefficients; t : the part of what was not solved for in them."""
        eq, law = self.equations, self._physics(self.kept)[0]
        by = self._factors(cells, t)
        film = answer(self.base, law, cells, by, self.p, self.r, eq._p_sides).problem
        if "contact" in cells and (contact := getattr(getattr(self, "at", None), "problem", film).contact) is not None:
            film.contact = replace(contact, p_a=cells["contact"])
        eq.constant = film

    def _adjoints(self) -> dict[str, Array]:
        eq, p, r = self.equations, self.p, self.r
        rows = []
        for parts in self.parts.values():
            slopes = {part: eq.slope(p, r, part) for part in parts}
            rows.append(right_side(slopes, parts, self.cavity))
        z = unknowns(self.cavity, p, r, eq.constant.p_unit)
        return dict(zip(self.parts, self.linear.solve_transposed(rows, z), strict=True))

    def _balance(self, p: Array, r: Array) -> Array:
        eq = self.equations
        G = eq.balance(p, r) / self.base.scheme.flow_unit
        return G if eq.held is None else np.where(eq.held, 0.0, G)

    def _lagrangians(self, cells: Cells, t: float = 0.0, p: Array | None = None, r: Array | None = None) -> Array:
        """L of all numbers with these coefficients, at the answer's fields or others."""
        eq, p, r = self.equations, self.p if p is None else p, self.r if r is None else r
        self._film(cells, t)
        wanted = {part for one in self.parts.values() for part in one}
        same = p is self.p and self._only_pressures(cells)
        report = eq.report(self.numbers if same else eq.numbers(p, r, wanted, self.numbers))
        G = self._balance(p, r)
        return np.array([report[name] - eq.grid.reduce.dot(one, G) for name, one in self.lambdas.items()])

    def destroy(self) -> None:
        self.linear.destroy()
        self.equations.constant = self.base
        self.equations.destroy()
