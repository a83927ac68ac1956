"""solve(scene) -> Solution: choose method, system and recipe, run the outer loop, certify."""

from inspect import signature
from pathlib import Path
from time import perf_counter
from typing import Any

from petsc4py import PETSc

from .base.alarm import check_same
from .base.options import recipe, set_names
from .base.parallel import overflow_is_no_warning
from .base.stages import Stages
from .drivers.checkpoint import CHOICES, Checkpointer, load
from .drivers.fluid import solve_fluid
from .drivers.memory import check as check_memory
from .drivers.memory import look_ahead, resident
from .drivers.nested import Run
from .drivers.plan import plan
from .drivers.symmetry import part_of, solve_part
from .drivers.time import march
from .errors import InputError
from .problems.box import BoxProblem
from .problems.film.lubrication import LubricationProblem
from .problems.film.squeeze import SqueezeProblem
from .problems.solution import Fields, Outcome, Problem, Solution
from .registry import METHODS
from .scenes.scene import Scene, as_scene
from .solvers.newton import Monitor, Stopping


@overflow_is_no_warning  # but an outcome
def solve(
    scene: str | Path | dict[str, Any] | Scene,
    *,
    method: str = "auto",
    system: str = "auto",
    recipe_name: str | None = None,
    stopping: Stopping | dict[str, Any] | None = None,
    options: dict[str, Any] | None = None,
    monitor: Monitor | None = None,
    comm: PETSc.Comm | None = None,
    nested: bool | None = None,
    start: tuple[Problem, Fields] | None = None,
    certify: bool = False,
    memory_check: bool = True,
    checkpoint: str | Path | None = None,
    every: int = 1,
    resume: str | Path | None = None,
    **changes: Any,
) -> Solution:
    """Solve a scene and certify the answer. Collective.

    Parameters
    ----------
    scene : what to solve: a Scene, or a name, a file or a dictionary as `load_scene` takes them.
    changes : new values of the scene's keys, ``solve("problem4", n=200)``.
    method, system : names in the registry, or 'auto'.
    recipe_name : options/NAME.opts for the inner solver; PETSc options that are set already win over it. By default see
        `auto.plan`, unless a -ksp_type or -pc_type is set.
    stopping : tolerances and iteration limit; a dictionary gives some of them, the method's own (`MethodEntry.eps`) the rest.
    options : the method's own parameters by name (p0, r0, mu, conditions, ... of `DinOptions`).
    monitor : called after every step with its number and record.
    comm : communicator; default all ranks.
    nested : start from the answers on coarser grids; default: where it pays.
    start : a problem of the same kind on any grid, and fields near the answer, from which its own are interpolated: those of a
        neighbouring scene. They take the coarser grids' place, unless `nested` asks for these.
    checkpoint, every : write the iterate to this file after every so many steps; see `checkpoint`.
    resume : go on from such a file, as if the run had not been stopped. What is not given anew is as it was begun with.
    certify : also prove a band around the answer (`Solution.enclosure`), for the price of one linear solve at most.
    memory_check : refuse a run that needs more memory than there is, by an estimate (`memory`).

    Returns
    -------
    Solution : call its `destroy` when done with it.

    Raises
    ------
    InputError : an unknown name, a value out of range, an option that does not fit.
    """
    scene = as_scene(scene, changes, signature(solve).parameters)
    if getattr(scene, "balance", None) is not None:
        raise InputError(f"scene {scene.name}: [balance] asks for a search, as 'lcp-lube solve' and solve_or_balance make it")
    begin = perf_counter()
    stages = Stages()
    held = resident()
    with stages("setup"):
        if getattr(scene, "family", "user") != "user":  # whose data are each rank's own
            asked = (scene, method, system, recipe_name, stopping, options, nested, start is None)
            check_same((comm or PETSc.COMM_WORLD).tompi4py(), f"scene {scene.name} or how to solve it", asked)
        if memory_check:
            look_ahead(scene, comm, lambda large: plan(large, scene.name, method, system, recipe_name, nested, options or ()))
        problem = scene.build(comm)
    if start is not None and nested is None:
        nested = False
    keeper = Checkpointer(checkpoint, every, problem.grid.comm)
    saved = load(resume, scene, problem.grid.comm) if resume is not None else None
    if saved is not None:
        kept = saved.settle(method=method, system=system, recipe=recipe_name, nested=nested, options=options or {})
        method, system, recipe_name, nested, options = (kept[name] for name in CHOICES)
    chosen = plan(problem, scene.name, method, system, recipe_name, nested, options or ())
    entry = METHODS[chosen.method].of(problem.kind)
    if certify and not isinstance(problem, LubricationProblem):
        raise InputError(f"--certify: scene {scene.name} is no film with cavitation, for which alone the theorem holds")
    if not isinstance(stopping, Stopping):
        stopping = Stopping(**{**dict(zip(("eps1", "eps2"), entry.eps, strict=True)), **(stopping or {})})
    if law := getattr(getattr(scene, "model", None), "law", None):
        problem.destroy()
        if checkpoint or resume or certify:
            raise InputError(f"--checkpoint, --resume, --certify: not for {scene.name}, whose fluid depends on the pressure")
        how: dict[str, Any] = {"method": method, "system": system, "recipe_name": recipe_name, "options": options}
        how |= {"monitor": monitor, "comm": comm, "nested": nested, "start": start, "memory_check": memory_check}
        solution = solve_fluid(scene, law, solve, stopping, **how)
        solution.times["total"] = perf_counter() - begin
        return solution
    # Who names a method, a matrix or an inner solver means those of the whole scene.
    named = (method, system) != ("auto", "auto") or recipe_name or options or {"ksp_type", "pc_type"} & set_names()
    if not (named or certify or checkpoint or resume) and (part := part_of(scene, problem)):
        how = {"stopping": stopping, "monitor": monitor, "comm": comm, "nested": nested, "start": start}
        solution = solve_part(part, problem, solve, stopping.eps1, **how, memory_check=memory_check)
        if solution.outcome is not Outcome.WRONG_SOLUTION:
            solution.times["total"] = perf_counter() - begin
            return solution
        chosen.why.insert(0, f"the whole model: the reduced one's answer ({part.kind}) is not the whole scene's")
    if isinstance(problem, SqueezeProblem):
        if checkpoint or resume or certify or chosen.nested:
            raise InputError(f"--checkpoint, --resume, --certify, --nested: not for scene {scene.name}, which goes on in time")
        return march(problem, scene, chosen, stopping, options or {}, monitor, stages)
    run = Run(scene, problem, chosen, stopping, options or {}, monitor, stages, keeper, saved)
    keeper.begin(scene, (chosen.method, chosen.system, recipe_name, chosen.nested, options or {}))
    with recipe(chosen.recipe) as recipe_used:
        memory = check_memory(problem, chosen, held, memory_check)
        run.grids(start)
    run.take_over()
    outcome, message = run.outcome, run.message
    certificate = problem.certify(run.fields, stopping.eps1)
    enclosure = run.enclose(problem) if certify and isinstance(problem, LubricationProblem) else None
    if outcome is not Outcome.CONVERGED and isinstance(problem, BoxProblem):
        outcome, message = problem.explain(outcome, message)
    if outcome is Outcome.CONVERGED and not certificate.holds:
        outcome, message = Outcome.WRONG_SOLUTION, f"{message}, but the certificate fails: {certificate.failure}"
    return Solution(
        problem,
        run.fields,
        outcome,
        message,
        certificate,
        run.steps,
        settings={**run.settings(recipe_used, [memory.sentence] if memory else []), **(memory.settings if memory else {})},
        times={**stages.seconds, "total": perf_counter() - begin},
        levels=run.levels if chosen.nested else run.details.get("levels", []),
        enclosure=enclosure,
    )
