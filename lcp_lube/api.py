"""solve(scene) -> Solution: choose method, system and recipe, run the outer loop, certify."""

from collections.abc import Iterable
from time import perf_counter
from typing import Any

from petsc4py import PETSc

from .errors import InputError, nearest
from .linear.options import recipe, set_names
from .linear.stages import Stages
from .problems.solution import Outcome, Problem, Solution
from .registry import DEFAULT_METHOD, METHODS
from .scene import Scene
from .solvers.newton import Monitor, Stopping, iterate


def solve(
    scene: Scene,
    *,
    method: str = "auto",
    system: str = "auto",
    recipe_name: str | None = None,
    stopping: Stopping | None = None,
    options: dict[str, Any] | None = None,
    monitor: Monitor | None = None,
    comm: PETSc.Comm | None = None,
) -> Solution:
    """Solve a scene and certify the answer. Collective.

    Parameters
    ----------
    scene : what to solve; see `load_scene`.
    method, system : names in the registry, or 'auto'.
    recipe_name : options/NAME.opts for the inner solver; PETSc options that are set already win over it. By default a
        sparse direct solver, unless a -ksp_type or -pc_type is set.
    stopping : tolerances and iteration limit.
    options : the method's own parameters by name (p0, r0, mu, conditions, ... of `DinOptions`).
    monitor : called after every step with its number and record.
    comm : communicator; default all ranks.

    Returns
    -------
    Solution : call its `destroy` when done with it.

    Raises
    ------
    InputError : an unknown name, a value out of range, an option that does not fit.
    """
    stopping = stopping or Stopping()
    start = perf_counter()
    stages = Stages()
    with stages("setup"):
        problem = scene.build(comm)
    method = _choose(method, DEFAULT_METHOD[problem.kind], METHODS, "--method")
    entry = METHODS[method]
    if problem.kind not in entry.kinds:
        fitting = [name for name, other in METHODS.items() if problem.kind in other.kinds]
        raise InputError(f"--method {method}: not for scene {scene.name}; allowed are {', '.join(fitting)}")
    system = _choose(system, entry.systems[0], entry.systems, "--system")
    name = recipe_name or default_recipe(problem)
    with recipe(name):
        run = entry.load()(problem, stages, system, options or {}, stopping)
        try:
            outcome, message, steps = iterate(run, stopping, monitor)
            ksp_type, pc_type = (run.krylov.ksp_type, run.krylov.pc_type) if run.krylov else (None, None)
            fields = run.fields
        finally:
            run.destroy()
    certificate = problem.certify(fields, stopping.eps1)
    if outcome is Outcome.CONVERGED and not certificate.holds:
        outcome, message = Outcome.WRONG_SOLUTION, f"{message}, but the certificate fails: {certificate.failure}"
    return Solution(
        problem,
        fields,
        outcome,
        message,
        certificate,
        steps,
        settings={
            "scene": scene.name,
            "method": method,
            "system": system,
            "scheme": scene.scheme,
            "recipe": name,
            "ksp_type": ksp_type,
            "pc_type": pc_type,
        },
        times={**stages.seconds, "total": perf_counter() - start},
    )


def default_recipe(problem: Problem) -> str | None:
    """The direct solver that this PETSc has for this number of ranks; None if the user has chosen by PETSc's options."""
    if {"ksp_type", "pc_type"} & set_names():
        return None
    names = ("mumps", "superlu_dist") if problem.grid.comm.size > 1 else ("superlu", "umfpack", "mumps")
    return next((name for name in names if PETSc.Sys.hasExternalPackage(name)), "bjacobi")


def _choose(name: str, default: str, table: Iterable[str], option: str) -> str:
    if name == "auto":
        return default
    if name not in table:
        raise InputError(f"{option} {name}: allowed are auto, {', '.join(table)}{nearest(name, table)}")
    return name
