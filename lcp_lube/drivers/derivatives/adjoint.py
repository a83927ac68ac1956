"""The adjoints of a solution's numbers, and of the conditions that what was found for it meets.

With J' lambda = dQ/dz the number L(a) = Q(z, a) - lambda' G(z, a), its fields z held, has the derivative that Q has at the
solution (where something was found: `implicit`).
"""

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any, cast

import numpy as np

from ...base.differences import QUICK, differences
from ...base.parallel import Array
from ...errors import InputError
from ...problems.film.edges import jumps_of, oblique
from ...problems.film.flows import layers
from ...problems.film.lubrication import LubricationProblem
from ...problems.grid import Grid
from ...problems.solution import Solution
from ...registry import SMALL
from ...scenes.effects.named import without
from ...scenes.grooved import GroovedJournalScene
from ...scenes.scene import Scene
from ...scenes.values import values_of, with_values
from ..loads.pad_coordinates import bearing_of
from ..motions.coefficients import placed
from ..motions.halved import Halved
from ..motions.linearised import Linear
from .equations import DRAGS, MISFIT, Equations, cavity_of, check_film, fields_of, right_side, unknowns
from .laid import Laid
from .near_films import OTHER, NearFilms, plain, same

ROUNDED = 1e-8  # of what is small of what was found: a 0 that rounding has moved, the attitude of pads about the load
FEWER = 2_000  # points from which multigrid solves for an answer that multigrid gave: its loops are loaded
DIRECT = {"load", "friction", "p_max", "force_x", "force_y"}  # numbers that are mostly made of no others but these
GUESS = 1e-2  # what a number that is zero, of a unit that the film has no measure of, is changed by parts of
CYCLED, FINEST = 5e-8, 1e-4  # of a quantity, or that part of what it is made of: what lambda's errors by multigrid make at most
SUPPLY = "supply.{}.p"  # the key of a supply's pressure, Pa above p_c


class Adjoint:
    """A solution with what its derivatives need: equations, adjoints of quantities and of the conditions that were met.

    Collective, as all of its methods. both : adjoints of either side (`other_side`), where points are about to change, or tie.

    Raises
    ------
    InputError : no film, no converged solution, a quantity without a derivative.
    """

    def __init__(self, scene: Scene, solution: Solution, quantities: Sequence[str], both: bool = False):
        if not solution.converged:
            raise InputError(f"{scene.name}: {solution.outcome.sentence}: no solution, no derivatives")
        left_out = solution.settings.get("model", {}).get("left_out", {})
        scene = without(scene, left_out) if left_out else scene
        check_film(scene)
        self.scene, self.reported = placed(scene, solution), cast(LubricationProblem, solution.problem)
        if getattr(scene, "p_unit", 0.0) is None:  # which follows from looks at the film, in every scene near by
            self.scene = self.scene.model_copy(update={"p_unit": self.scene.model.p_unit})  # type: ignore[attr-defined]
        self.p, self.r = fields_of(solution)
        self.pressures = [float(P) for P in solution.settings.get("supply_pressures", ())]
        self.dry = self.reported.moving.dry
        comm = solution.problem.grid.petsc_comm
        self.equations = Equations(self.scene, comm, self.pressures, dry=self.dry, solved=solution.problem)
        if self.equations.grid.shape != solution.problem.grid.shape:
            raise InputError(f"{scene.name}: the solution is on another grid than the scene")
        self._least = FEWER if solution.settings.get("method") == "fas" else SMALL
        self.reduction = solution.settings.get("details", {}).get("reduction")
        self.found, self.conditions = conditions_of(scene, solution)
        supplies = self.equations.constant.held.supplies if self.equations.constant.held else ()
        free = [k for k, one in enumerate(supplies, start=1) if one.open]
        self.found = [*self.found, *(SUPPLY.format(k) for k in free)]
        self.conditions = {**self.conditions, **{f"{MISFIT}{k}": 0.0 for k in free}}
        self.asked = list(quantities)
        names = [name for name in [*quantities, *self.conditions] if name not in self.found]
        eq, p, r = self.equations, self.p, self.r
        lean = {*names, "force_x", "force_y"} if quantities and DIRECT.issuperset(names) else None
        drags = {name: eq.slope(p, r, name) for name in DRAGS if name in (lean or ()) and eq.grid.dim == 2}
        known = {name: one.value for name, one in drags.items() if one.value == one.value}
        self.numbers = eq.numbers(p, r, lean and lean.difference(known)) | known
        if lean and any(math.isnan(eq.report(self.numbers)[name]) for name in names):  # made of others too
            self.numbers = eq.numbers(p, r)
        parts = {name: eq.partials(self.numbers, name) for name in names}
        self.cavity, switching = cavity_of(eq, p, r)
        self.switching = int(eq.grid.reduce.sum(np.array([np.count_nonzero(switching)])))
        made_of = dict.fromkeys(part for weights in parts.values() for part in weights)
        if not made_of.keys().isdisjoint(DRAGS):
            eq.layers = layers(eq.problem(p), r)
        slopes = {part: drags.get(part) or eq.slope(p, r, part) for part in made_of}
        self.ties = {name: sum(slopes[part].ties for part in weights) for name, weights in parts.items()}
        rows = {name: right_side(slopes, weights, self.cavity) for name, weights in parts.items()}
        some = [name for name in parts if both and (self.switching or self.ties[name])]
        last = slopes | {part: eq.slope(p, r, part, last=True) for part in slopes if part == "p_max" and some}
        changed, report = self.cavity ^ switching, eq.report(self.numbers)
        more = {name + OTHER: right_side(last, parts[name], changed) for name in some}
        self.parts, self.lambdas = parts | {name + OTHER: parts[name] for name in some}, dict[str, Array]()
        sets = [(rows, self.cavity), (more, changed)] if self.switching and some else [(rows | more, self.cavity)]
        made = dict[str, float]()  # what the rows make of z, in size, where lambda is of cycles
        for of, cavity in sets:  # those with one J together
            sizes = [abs(report[plain(name)]) if plain(name) in quantities else math.inf for name in of]
            found, terms = self._solve(list(of.values()), cavity, sizes)
            self.lambdas |= zip(of, found, strict=True)
            made |= {name: size for name, size in zip(of, terms, strict=False) if name in rows}
        self._off = {name: CYCLED * min(size, max(abs(report[name]), FINEST * size)) for name, size in made.items()}
        if (met := {*self.conditions} - {*quantities}) - {*made}:
            z = np.abs(unknowns(self.cavity, p, r, eq.constant.p_unit))
            made |= {name: eq.grid.reduce.dot(np.abs(rows[name]), z) for name in met}
        self._rows, self._least_of = rows | more, {name: made[name] for name in met}
        self.flow_unit = eq.problem(p).scheme.flow_unit

    @cached_property
    def sizes(self) -> dict[str, float]:
        """Of the terms that every L is the sum of. Collective."""
        terms = dict(zip(self.lambdas, self.equations.terms(self.p, list(self.lambdas.values())), strict=True))
        own = {name: sum(abs(w * self.numbers[part]) for part, w in weights.items()) for name, weights in self.parts.items()}
        return {name: own[name] + float(terms[name]) for name in self.lambdas}

    @cached_property
    def near(self) -> NearFilms:
        return NearFilms(self.equations, self.p, self.r, self.lambdas, self.parts, self.numbers, self.pressures, self._rows)

    @cached_property
    def _here(self) -> Array:
        return self.lagrangians(self.scene)

    @cached_property
    def _near_here(self) -> Array:
        """As `near` has it: it differs from the other by rounding, which differences would see."""
        found = self.near.lagrangians(self.scene)
        return self._here if found is None else found

    def _solve(self, rows: list[Array], cavity: Any, sizes: list[float]) -> tuple[list[Array], list[float]]:
        """lambda of each row, and where cycles found it the size of what the row makes of z, term by term."""
        eq, law, p = self.equations, self.equations.law, self.p
        free = eq.constant.held is None and eq.held is None
        if law and free and not law.dowson_higginson:  # J's rows by q are those of a constant fluid
            rows, p, law = [np.where(cavity, 1.0, law.viscosity(p)) * row for row in rows], law.reduced(p), None
        problem = eq.constant if law is None else eq.problem(p)
        if law is None and free and not eq.turned and self.reported.grid.size > self._least and self.reduction == "mirror":
            linear: Linear | Halved = Halved(problem, cavity, eq.film, least=self._least)
        else:
            entries = None if law is None else eq.tangent(p, self.r).entries(problem.scheme)
            linear = Linear(problem, cavity, entries, eq.held, least=self._least)
        try:
            return linear.solve_transposed(rows, unknowns(cavity, p, self.r, eq.constant.p_unit), sizes), linear.terms
        finally:
            linear.destroy()

    def lagrangians(self, scene: Scene, pressures: Sequence[float] | None = None) -> Array:
        """L of every quantity and condition at a scene near by, the fields held. Collective.

        Raises
        ------
        InputError : no such scene.
        """
        same = scene is self.scene and pressures is None
        eq = self.equations
        if not same:
            eq = Equations(scene, eq.grid.petsc_comm, pressures or self.pressures, eq, self.dry)
        try:
            if eq.grid.shape != self.equations.grid.shape:
                raise InputError("the grid has another number of points")
            wanted = {part for weights in self.parts.values() for part in weights}
            numbers = self.numbers if same else eq.numbers(self.p, self.r, wanted, self.numbers)
            report = eq.report(numbers)
            G = eq.scaled(self.p, self.r, self.flow_unit)
            return np.array([report[plain(name)] - eq.grid.reduce.dot(one, G) for name, one in self.lambdas.items()])
        finally:
            if eq is not self.equations:
                eq.destroy()

    def slopes(self, key: str) -> tuple[dict[str, float], dict[str, float], dict[str, float]]:
        """dL/da, the difference between both sides, and an estimate of the error, by quantity and condition. Collective.

        Raises
        ------
        InputError : no scene on either side.
        """
        names = list(self.lambdas)
        value = self.value(key)
        sizes, points = np.array([self.sizes[name] for name in names]), points_of(self.equations.grid)
        least = np.array([self._least_of.get(name, 0.0) for name in names])
        fed = key in self._supplies and key in self.found
        scale = max(abs(value), 1e-3 * self.equations.constant.p_unit) if fed else self.scale(key)
        if fed:
            which = self._supplies.index(key)

            def at(P: float) -> Array:
                pressures = [P if k == which else other for k, other in enumerate(self.pressures)]
                found = self.near.lagrangians(self.scene, pressures)
                return self.lagrangians(self.scene, pressures) if found is None else found

            slope, jump, error = differences(at, value, scale, sizes, False, points, least)
        else:
            quick, steps = [False], list[float]()

            def near(a: float) -> Array:
                if a == value:
                    return self._near_here if quick[0] else self._here
                scene = with_values(self.scene, {key: a})
                if self._laid.anew(scene.model):  # type: ignore[attr-defined]
                    steps.append(a)
                found = self.near.lagrangians(scene)
                quick[0] = found is not None
                return self.lagrangians(scene) if found is None else found

            wary = moves_edges(self.scene, key, value + QUICK * scale)
            slope, jump, error = differences(near, value, scale, sizes, wary, points, least)
            jump = np.full_like(jump, np.inf) if any(abs(a - value) <= 2.0 * QUICK * scale for a in steps) else jump
        off = np.array([self._off.get(plain(name), 0.0) for name in names])  # a number that changes all by its part
        error = error + off / scale
        by_name = (dict(zip(names, map(float, one), strict=True)) for one in (slope, jump, error))
        return next(by_name), next(by_name), next(by_name)

    @cached_property
    def _laid(self) -> Laid:
        return Laid(self.scene.model, self.equations.grid.shape)  # type: ignore[attr-defined]

    @property
    def _supplies(self) -> list[str]:
        return [SUPPLY.format(k) for k in range(1, len(self.pressures) + 1)]

    def value(self, key: str) -> float:
        """Of a number of the scene, or of a supply's pressure that was found."""
        known = values_of(self.scene)
        return known[key] if key in known else self.pressures[self._supplies.index(key)]

    def scale(self, key: str) -> float:
        """A change of a number that is not small."""
        problem = self.equations.constant
        return scale_of(self.scene, key, problem, self.p, key in self.found)

    @property
    def report(self) -> dict[str, float]:
        """All that is told of the film."""
        return self.equations.report(self.numbers)

    def destroy(self) -> None:
        self.equations.destroy()


def points_of(grid: Grid) -> int:
    """By whose terms' chance rounding is less; of a line, whose points' places are differences, by no more than one's."""
    return grid.size if grid.dim == 2 else 1


def scale_of(scene: Scene, key: str, problem: LubricationProblem, p: Array, found: bool = False) -> float:
    """As `size_of`, and a guess where that knows nothing. Collective."""
    return size_of(scene, key, problem, p, found) or GUESS


def size_of(scene: Scene, key: str, problem: LubricationProblem, p: Array, found: bool = False) -> float | None:
    """The size of a number, of one that is zero what its change is small against; None where the film has nothing like it.

    p : the film's, Pa above p_c. found : it was found, and may be zero but for rounding. Collective.
    """
    value = abs(values_of(scene)[key])
    if value and not found:
        return value
    units = scene.data_units()
    unit = units.get(key, units.get(key.rpartition(".")[0], ""))
    p_max = max(problem.reduce.max(p), *map(abs, problem.p_sides)) or problem.p_unit
    thinnest = problem.reduce.min(problem.scheme.h)
    small = {"Pa": p_max, "1/Pa": 1.0 / p_max, "m": thinnest, "rad": thinnest / max(problem.grid.lengths)}.get(unit)
    return value if value > ROUNDED * (small or GUESS) else small


def moves_edges(scene: Any, key: str, near: float) -> bool:
    """Whether a number, changed to one near by, moves edges across the lines of points, or what they lie among: by steps."""

    def of(model: Any) -> Any:
        return oblique(model.gap), *(jumps_of(model.gap, axis) for axis in "xy"), model.lengths, model.polar, model.edges

    own = of(scene.model)
    try:
        return bool(own[0]) and not same(own, of(with_values(scene, {key: near}).model))  # type: ignore[attr-defined]
    except InputError:
        return True


def conditions_of(scene: Scene, solution: Solution) -> tuple[list[str], dict[str, float]]:
    """The keys whose values were found, and the conditions that they meet: a number and the value that it has."""
    if (pads := bearing_of(scene)) is not None:
        met = zip(pads.keys, pads.conditions.items(), pads.free, strict=True)
        found = [(key, condition) for key, condition, free in met if free]
        return [key for key, _ in found], dict(condition for _, condition in found)
    if isinstance(scene, GroovedJournalScene):
        if scene.balance is not None:
            return ["eccentricity", "attitude_deg"], {"load": scene.balance.load, "force_y": 0.0}
        return (["attitude_deg"], {"force_y": 0.0}) if scene.attitude_deg is None else ([], {})
    if balance := solution.settings.get("balance"):
        return [balance["vary"]], {"load": balance["load"]}
    return [], {}
