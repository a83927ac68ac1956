"""Films of a fluid whose viscosity and density depend on the pressure: solves of the constant fluid's kind, and few of them.

Barus' viscosity is a change of the unknown (problems/fluid.py). Density is taken from the last answer until it changes no more:
rho(p) moves by 3e-10 of itself a pascal, so each solve, started from the last, gains two digits and more.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from petsc4py import PETSc

from ..base.parallel import Array
from ..errors import InputError
from ..problems.film.fluid import Law, effective, with_density
from ..problems.film.lubrication import LubricationProblem
from ..problems.film.model import Model
from ..problems.solution import Fields, Outcome, Solution
from ..scenes.scene import Scene
from ..solvers.newton import Stopping

MOST_SOLVES = 30
DENSITY = 0.1  # of eps1: relative change of the density at which it counts as settled


@dataclass(frozen=True)
class Frozen:
    """A scene in q with the density held; to `solve` it is a scene like any other.

    p : pressures (Pa, owned points) that the density is taken from; None: it is constant.
    """

    whole: Scene
    law: Law
    p: Array | None = None
    family: ClassVar[str] = "user"  # no file's: what is asked of those has been asked of the whole scene

    @property
    def name(self) -> str:
        return self.whole.name

    @property
    def scheme(self) -> str | None:
        return self.whole.scheme

    @property
    def shape(self) -> tuple[int, ...]:
        return self.whole.shape

    @property
    def constant(self) -> Model:
        """The film of the constant fluid, in q."""
        model: Model = self.whole.model  # type: ignore[attr-defined]
        sides = (replace(side, p=float(self.law.reduced(np.array(side.p)))) for side in model.sides)
        return replace(model, sides=tuple(sides), law=None, exact=None)  # type: ignore[arg-type]

    @property
    def model(self) -> Model | None:
        """What `reduction` may look at: with a density that varies, nothing."""
        return self.constant if self.p is None else None

    def with_shape(self, shape: tuple[int, ...]) -> "Frozen":
        return Frozen(self.whole.with_shape(shape), self.law)

    def build(self, comm: PETSc.Comm | None = None) -> LubricationProblem:
        problem = self.constant.build(self.shape, comm)
        return problem if self.p is None else with_density(problem, self.law, self.p)


def solve_fluid(scene: Scene, law: Law, solve: Callable[..., Solution], stopping: Stopping, **how: Any) -> Solution:
    """Solution of a scene whose fluid has a law. Collective.

    Parameters
    ----------
    solve : api.solve; how : its arguments. `start` is a neighbour's problem and fields, p in its p_unit.

    Raises
    ------
    InputError : a scheme without densities at faces.
    """
    model: Model = scene.model  # type: ignore[attr-defined]
    if law.dowson_higginson and model.scheme != "face":
        raise InputError(f"{scene.name}: scheme = {model.scheme}: fluid.density = dowson-higginson needs scheme = face")
    if how.get("start") is not None:
        near, found = how["start"]
        how["start"] = (near, {**found, "p": law.reduced(found["p"] * near.p_unit) / near.p_unit})
    solution = solve(Frozen(scene, law), stopping=stopping, **how)
    first, steps, p, solves = solution, list(solution.steps), _pressure(solution, law), 1
    density, change = np.ones_like(p), 0.0
    while law.dowson_higginson and solution.converged:
        new = law.density(p)
        change, density = solution.problem.reduce.max(np.abs(new - density)), new
        if not change > DENSITY * stopping.eps1 or solves == MOST_SOLVES:  # NaN: no pressure, which is told below
            break
        last = solution
        how |= {"start": (last.problem, last.fields), "nested": None}
        solution = solve(Frozen(scene, law, p), stopping=stopping, **how)
        last.destroy()
        p, solves = _pressure(solution, law), solves + 1
        steps += solution.steps
    outcome, message = solution.outcome, solution.message
    reduce = solution.problem.reduce
    if solution.converged and not np.isfinite(reduce.max(p)):
        outcome, message = (
            Outcome.NO_SOLUTION,
            f"no pressure carries the flow: viscosity grows without bound (barus = {law.barus:g} 1/Pa)",
        )
    elif solution.converged and change > 0.1 * stopping.eps1:
        outcome, message = Outcome.MAX_ITERATIONS, f"the density still changes by {change:.1e} after {solves} solves"
    p_sides = tuple(side.p if side.kind == "open" else 0.0 for side in model.sides)
    constant = Frozen(scene, law).build(how.get("comm"))
    with np.errstate(all="ignore"):
        problem = effective(constant, law, p, p_sides)  # type: ignore[arg-type]
        fields: Fields = {"p": p / problem.p_unit, "r": solution.fields["r"]}
        certificate = problem.certify(fields, stopping.eps1)
    if outcome is Outcome.CONVERGED and not certificate.holds:
        outcome, message = Outcome.WRONG_SOLUTION, f"{message}, but the certificate fails: {certificate.failure}"
    solution.destroy()
    why = f"fluid: {solves} solve{'s' * (solves > 1)} of a constant fluid's kind, viscosity by a change of unknown"
    settings = {**first.settings, "why": [why, *first.settings["why"]]}
    settings["details"] = {**first.settings["details"], "fluid_solves": solves}
    done = {"problem": problem, "fields": fields, "outcome": outcome, "message": message, "certificate": certificate}
    return replace(first, **done, steps=steps, settings=settings)  # type: ignore[arg-type]


def _pressure(solution: Solution, law: Law) -> Array:
    """p in Pa of a solution in q."""
    return law.pressure(solution.fields["p"] * solution.problem.p_unit)  # type: ignore[attr-defined]
