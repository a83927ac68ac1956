"""Films of a fluid whose viscosity and density depend on the pressure: solves of the constant fluid's kind, and few of them.

Barus' viscosity is a change of the unknown (problems/fluid.py). Density is taken from the last answer until it changes no more:
rho(p) moves by 3e-10 of itself a pascal, so each solve, started from the last, gains two digits and more.
"""

from dataclasses import dataclass, replace

import numpy as np
from petsc4py import PETSc

from ..base.parallel import Array
from ..errors import InputError
from ..problems.facts import Facts
from ..problems.film.fluid import Law, effective, with_density
from ..problems.film.lubrication import LubricationProblem
from ..problems.film.model import Model
from ..problems.solution import Fields, Outcome, Solution
from ..scenes.scene import Derived, Solvable
from .ask import Ask, Start
from .compose import Inner

MOST_SOLVES = 30
DENSITY = 0.1  # of eps1: relative change of the density at which it counts as settled


@dataclass(frozen=True)
class Frozen(Derived):
    """A scene in q with the density held.

    p : pressures (Pa, owned points) that the density is taken from; None: it is constant.
    """

    law: Law
    p: Array | None = None

    @property
    def constant(self) -> Model:
        """The film of the constant fluid, in q."""
        model: Model = self.whole.model  # type: ignore[attr-defined]
        sides = (replace(side, p=float(self.law.reduced(np.array(side.p)))) for side in model.sides)
        supplies = tuple(replace(one, p=float(self.law.reduced(np.array(one.p)))) for one in model.supplies)
        return replace(model, sides=tuple(sides), supplies=supplies, law=None, exact=None)  # type: ignore[arg-type]

    @property
    def model(self) -> Model | None:
        """What `symmetry` may look at: with a density that varies, nothing."""
        return self.constant if self.p is None else None

    def with_shape(self, shape: tuple[int, ...]) -> "Frozen":
        return Frozen(self.whole.with_shape(shape), self.law)

    def facts(self, comm: PETSc.Comm | None = None) -> Facts:
        return self.constant.facts(self.shape, comm)

    def build(self, comm: PETSc.Comm | None = None) -> LubricationProblem:
        problem = self.constant.build(self.shape, comm)
        problem.coefficients_for = None  # what is certified is another problem, made from this one
        return problem if self.p is None else with_density(problem, self.law, self.p)


def applies(scene: Solvable, ask: Ask) -> bool:
    """Whether the fluid depends on the pressure."""
    return getattr(getattr(scene, "model", None), "law", None) is not None


def solve(scene: Solvable, ask: Ask, inner: Inner) -> Solution:
    """Solution of a scene whose fluid has a law. Collective.

    Raises
    ------
    InputError : a scheme without densities at faces.
    """
    model: Model = scene.model  # type: ignore[attr-defined]
    law = model.law
    assert law is not None  # as `applies` found
    if law.dowson_higginson and model.scheme != "face":
        raise InputError(f"{scene.name}: scheme = {model.scheme}: fluid.density = dowson-higginson needs scheme = face")
    if ask.start is not None:
        near, found = ask.start.problem, ask.start.fields
        p_unit = near.p_unit  # type: ignore[attr-defined]
        ask = replace(ask, start=Start(near, {**found, "p": law.reduced(found["p"] * p_unit) / p_unit}, ask.start.settings))
    solution = inner(Frozen(scene, law), ask)
    eps1 = solution.settings["eps1"]
    first, steps, p, solves = solution, list(solution.steps), _pressure(solution, law), 1
    times, rescued = dict(solution.times), solution if solution.took_over else None
    density, change = np.ones_like(p), 0.0
    while law.dowson_higginson and solution.converged:
        new = law.density(p)
        change, density = solution.problem.reduce.max(np.abs(new - density)), new
        if not change > DENSITY * eps1 or solves == MOST_SOLVES:  # NaN: no pressure, which is told below
            break
        last = solution
        solution = inner(Frozen(scene, law, p), replace(ask, start=last, nested=None))
        last.destroy()
        p, solves = _pressure(solution, law), solves + 1
        steps += solution.steps
        rescued = solution if solution.took_over else rescued
        times = {name: times.get(name, 0.0) + seconds for name, seconds in solution.times.items()}
    outcome, message = solution.outcome, solution.message
    reduce = solution.problem.reduce
    if solution.converged and not np.isfinite(reduce.max(p)):
        outcome, message = (
            Outcome.NO_SOLUTION,
            f"no pressure carries the flow: viscosity grows without bound (barus = {law.barus:g} 1/Pa)",
        )
    elif solution.converged and change > DENSITY * eps1:
        outcome, message = Outcome.MAX_ITERATIONS, f"the density still changes by {change:.1e} after {solves} solves"
    p_sides = tuple(side.p if side.kind == "open" else 0.0 for side in model.sides)
    constant = Frozen(scene, law).build(ask.comm)
    with np.errstate(all="ignore"):
        problem = effective(constant, law, p, p_sides)  # type: ignore[arg-type]
        fields: Fields = {"p": p / problem.p_unit, "r": solution.fields["r"]}
        certificate = problem.certify(fields, eps1)
    solution.destroy()
    why = f"fluid: {solves} solve{'s' * (solves > 1)} of a constant fluid's kind, viscosity by a change of unknown"
    settings = {**first.settings, "why": [why, *first.settings["why"]]}
    if rescued is not None:
        settings |= {"method": rescued.method, "took_over": rescued.asked}
    settings["details"] = {**first.settings["details"], "fluid_solves": solves}
    done = {"problem": problem, "fields": fields, "outcome": outcome, "message": message, "certificate": certificate}
    return replace(first, **done, steps=steps, settings=settings, times=times).judged()  # type: ignore[arg-type]


def _pressure(solution: Solution, law: Law) -> Array:
    """p in Pa of a solution in q."""
    return law.pressure(solution.fields["p"] * solution.problem.p_unit)  # type: ignore[attr-defined]
