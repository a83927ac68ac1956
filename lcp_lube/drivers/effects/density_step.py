"""A time step of a fluid whose density follows the pressure, by Newton's method on the step as a whole.

`coupling` holds the densities while a film is solved, which takes several films a step, and dozens where a cell gains more by
compression than flows through it. Here the law and what cells store by it are linearised exactly (`film.tangent`):

    J = dG/dp where the film is full, -B where it is not,       z -> z - J^-1 G(z),    p = max(z, 0), r = max(-z, 0)

What the last step leaves of G goes into the densities that are stored, so that mass is conserved to rounding. They are then off
the law by `coupling`: a small part of what those foreseen were off by. Pressures of supplies that follow are found beside z
(`sources.Sources`); what their cells store takes what is left of their balances likewise.
"""

from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

import numpy as np

from ...base.parallel import Array
from ...problems.film.effects import Answer, FaceFactors, answer, factors
from ...problems.film.fluid import Law
from ...problems.film.model import Model
from ...problems.film.tangent import Tangent, tangent
from ...problems.solution import Fields, Outcome, Solution, Step
from ...scenes.scene import Solvable
from ...solvers.relaxation import relaxation
from ..ask import Ask
from ..motions.linearised import Linear
from ..sources import SWEEPS, Sources, z_of
from .frozen import Frozen, settled

WHY = "density: Newton's method on each step as a whole, the law linearised exactly"
IN_VAIN = 8  # steps that do not halve what is left, after which `coupling` takes over


def applies(scene: Solvable, ask: Ask) -> bool:
    """Whether it is such a step, from the one before, by Newton's method."""
    model: Model = scene.model  # type: ignore[union-attr]
    alone = model.dense and not model.effects and not model.grooves
    plain = ask.method == "active-set" and not ask.certify and model.scheme == "face"
    return alone and plain and model.stored is not None and ask.start is not None and "method" in ask.start.settings


def solve(scene: Any, ask: Ask) -> Solution | None:
    """The film at the step's end, with the settings of its start; None where Newton's method does not find it. Collective."""
    begun, near = perf_counter(), ask.start
    film = _Film(scene, ask)
    assert near is not None  # as `applies` found
    reduce, at = film.base.reduce, film.begin(near)
    sweeps = ask.options.get("sweeps", 0)
    steps: list[Step] = []
    allowed = settled(ask, scene.model.stored, at.size)  # the first densities are those foreseen
    least, vain = np.inf, 0
    while not (steps and at.size <= allowed):
        vain = 0 if at.size < 0.5 * least else vain + 1
        least = min(least, at.size)
        if vain == IN_VAIN or not np.isfinite(at.size):
            film.base.destroy()
            return None
        at = film.swept(at, sweeps or SWEEPS * (vain > 1))
        found = film.step(at)
        if found is None:
            film.base.destroy()
            return None
        at = film.at(at.z + found[0], at.P + found[1])
        steps.append(Step(at.size, reduce.max(np.abs(found[0])), 1.0, 1))
    fields, problem = at.fields, film.closed(at)
    problem.more_measures["coupling"] = at.size
    certificate = ask.certify_by(problem, fields, near.settings["eps1"])
    times = {"setup": 0.0, "assembly": 0.0, "linear": 0.0, "total": perf_counter() - begun}
    why = [WHY, *(one for one in near.settings["why"] if not one.startswith(("coupling", WHY)))]
    details = {key: value for key, value in near.settings["details"].items() if key not in ("fluid_solves", "coupling_work")}
    settings = {**near.settings, "why": why, "details": details}
    message = f"densities off by {at.size:.1e} after {len(steps)} steps"
    return Solution(problem, fields, Outcome.CONVERGED, message, certificate, steps, settings, times).judged()


@dataclass(frozen=True)
class _At:
    """z, and the supplies' pressures, Pa; the film with the densities at z, and their factors; what is left of its balances,
    and which density that is, at most `size`."""

    z: Array
    P: Array
    answer: Answer
    by: FaceFactors
    G: Array
    off: Array
    size: float

    @property
    def fields(self) -> Fields:
        return {"p": np.maximum(self.z, 0.0), "r": np.maximum(-self.z, 0.0)}


class _Film:
    """The film at any z. Collective, as its methods."""

    def __init__(self, scene: Any, ask: Ask):
        model = scene.model
        self.law: Law = model.law
        self.base: Any = Frozen(scene, self.law).build(ask.comm)
        self.p_sides = model.p_sides
        self._densities = [float(self.law.density(np.array(p))) for p in self.p_sides]
        held = self.base.held
        self._free = True if held is None else ~held.mask.ravel()
        self._sources = Sources(model.supplies)

    def begin(self, near: Any) -> _At:
        """At the fields of a start."""
        z = z_of(near, self.base.p_unit)
        return self.at(z, self._sources.foreseen(self.base, z) if self._sources.any else np.zeros(0))

    def at(self, z: Array, P: Array) -> _At:
        if self._sources.any:
            self.base.hold_at(self._sources.held(self.law.reduced(P)))
            z = self._sources.put(self.base, z, P)
        p, r = np.maximum(z, 0.0), np.maximum(-z, 0.0)
        pressure = p * self.base.p_unit
        cells = {"density": self.law.density(pressure)}
        with np.errstate(all="ignore"):
            by = factors(self.base, cells, self._densities)
            found = answer(self.base, self.law, cells, by, pressure, r, self.p_sides)
            G = found.problem.balance(p, r)
            storage = self.base.scheme.storage.ravel()
            off = np.where(self._free, G / (storage * (1.0 - r)), 0.0)
            if self._sources.any:
                off += self._sources.off(found.problem, p, r, P, storage)
        return _At(z, P, found, by, G, off, self.base.reduce.max(np.abs(off)))

    def swept(self, at: _At, sweeps: int) -> _At:
        """With fronts put right by sweeps, if that brings anything: where they run by several cells a step."""
        sweep = relaxation(at.answer.problem) if sweeps else None
        if sweep is None:
            return at
        new = sweep(at.fields, sweeps)
        other = self.at(new["p"] - new["r"], at.P)
        return other if other.size < at.size else at

    def step(self, at: _At) -> tuple[Array, Any] | None:
        """Changes of z and of the supplies' pressures; None where no pressures are found."""
        film, cavity = at.answer.problem, (at.z < 0.0) & self._free
        film.tangent = self.tangent(at)
        if self._sources.any:
            found = self._sources.step(film, cavity, at.z, at.G, at.P)
        else:
            linear = Linear(film, cavity)
            found = -linear.solve([at.G])[0], np.zeros(0)
            linear.destroy()
        film.free_matrices()
        return found

    def closed(self, at: _At) -> Any:
        """The film with densities stored that leave nothing of G."""
        stored = at.by.values["stored"] - at.off.reshape(at.answer.grid.box)
        by = replace(at.by, values={**at.by.values, "stored": stored})
        found = answer(self.base, self.law, at.answer.cells, by, at.answer.p, at.answer.r, self.p_sides)
        problem = found.problem
        problem.cells, problem.tangent = {**at.answer.cells, "stored": found.stored}, self.tangent(at)
        return problem

    def tangent(self, at: _At) -> Tangent:
        """dG/dp."""
        return tangent(at.answer.problem, self.law, self.base, at.fields["p"], at.fields["r"])
