"""solve(scene) -> Solution: choose method, system and recipe, run the outer loop, certify."""

from dataclasses import astuple
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from petsc4py import PETSc

from .alarm import check_same
from .auto import default_recipe, plan
from .checkpoint import CHOICES, Checkpointer, load
from .errors import InputError
from .linear.options import recipe, set_names
from .linear.stages import Stages
from .march import march
from .memory import check as check_memory
from .memory import look_ahead, resident
from .piezo import solve_fluid
from .problems.box import BoxProblem
from .problems.problem import LubricationProblem
from .problems.solution import Fields, Outcome, Problem, Solution
from .problems.squeeze import SqueezeProblem
from .reduction import part_of, solve_part
from .registry import METHODS
from .scene import Scene
from .solvers.enclosure import Enclosure, enclose
from .solvers.nested import level_shapes
from .solvers.newton import Monitor, Stopping

# A coarse answer is a start: its front matters, not its last digits. An interior method's layer there must be thin, though.
COARSE_EPS = {False: 1e-4, True: 1e-8}  # by MethodEntry.interior


@np.errstate(over="ignore", invalid="ignore")  # iterates that overflow are an outcome, not a warning
def solve(
    scene: Scene,
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
) -> Solution:
    """Solve a scene and certify the answer. Collective.

    Parameters
    ----------
    scene : what to solve; see `load_scene`.
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
    shapes = level_shapes(scene.shape, problem.grid.comm.size) if chosen.nested else [scene.shape]
    near, previous = start, None  # what the next grid starts from, and the problem on the grid before
    levels: list[dict[str, Any]] = []
    if saved is not None:
        shapes, levels, near = saved.shapes, saved.record["levels"], None
    keeper.begin(scene, (chosen.method, chosen.system, recipe_name, chosen.nested, options or {}))
    with recipe(chosen.recipe) as recipe_used:
        memory = check_memory(problem, chosen, held, memory_check)
        for shape in shapes:
            finest = shape == shapes[-1]
            level_begin = perf_counter()
            with stages("setup"):
                level = problem if finest else scene.with_shape(shape).build(comm)
            with stages("prolongation"):
                guess = level.prolong(*near, entry.interior) if near is not None else None
            if previous is not None:
                previous.destroy()
            coarse_eps = max(COARSE_EPS[entry.interior], stopping.eps1)
            level_stopping = stopping if finest else Stopping(coarse_eps, np.inf, stopping.max_it)
            run = entry.load()(level, stages, chosen.system, options or {}, level_stopping, guess)
            try:
                if saved is not None and saved.failures:  # another method had taken over
                    outcome, message, steps = saved.failures[0]
                else:
                    before = saved.restore(run, level.grid) if saved is not None else []
                    saved = None
                    where: dict[str, Any] = {"shapes": shapes[shapes.index(shape) :], "levels": levels}
                    outcome, message, steps = keeper.iterate(run, level.grid, level_stopping, monitor, before, **where)
                krylov = run.krylov
                ksp_type, pc_type = (krylov.ksp_type, krylov.pc_type) if krylov else (None, None)
                near = (level, run.fields)
            finally:
                run.destroy()
            if not finest and outcome in (Outcome.NOT_FINITE, Outcome.LINEAR_SOLVER):
                near = None  # nothing to start from: the next grid begins by itself
            previous = level
            levels.append(
                {
                    **dict(zip(("nx", "ny"), shape, strict=False)),
                    "iterations": len(steps),
                    "linear_iterations": sum(step.linear_iterations for step in steps),
                    "time_s": perf_counter() - level_begin,
                }
            )
    fields, took_over = run.fields, None
    details: dict[str, Any] = getattr(run, "details", {})  # what a method tells of itself beyond its steps
    reached, failures, more, failed = fields, "", steps, []
    for tried, name in enumerate(entry.fallback if set(options or {}) <= {"p0"} else (), start=1):
        if outcome is Outcome.CONVERGED:
            break
        failed.append((outcome, message, [astuple(step) for step in more]))
        failures += f"{took_over or chosen.method} failed ({message}); "
        rescue = METHODS[name].of(problem.kind)
        # Interior methods converge from anywhere, and only direct inner solves keep up with them on films like this one.
        system, inner = rescue.systems[0], default_recipe(problem, rescue.systems[0], large=False)[0]
        if not chosen.system and not rescue.interior:  # a method without linear systems hands over what it has reached
            next_one = plan(problem, scene.name, name)
            system, inner = next_one.system, next_one.recipe or inner
        with recipe(inner):
            # An interior method begins anew; another may take up what was reached.
            run = rescue.load()(problem, stages, system, {}, stopping, None if rescue.interior else reached)
            try:
                if saved is not None and len(saved.failures) > tried:
                    outcome, message, more = saved.failures[tried]
                else:
                    before = saved.restore(run, problem.grid, reached) if saved is not None else []
                    saved = None
                    outcome, message, more = keeper.iterate(
                        run, problem.grid, stopping, monitor, before, reached, failed=failed
                    )
            finally:
                run.destroy()
        fields, steps, took_over = run.fields, steps + more, name
    if took_over:
        message = f"{failures}{took_over} took over: {message}"
    certificate = problem.certify(fields, stopping.eps1)
    enclosure: Enclosure | None = None
    if certify and isinstance(problem, LubricationProblem):
        # By the inner solver that has just solved this problem, or would have.
        solver = chosen if chosen.system else plan(problem, scene.name, "active-set", nested=False)
        system = METHODS[took_over].systems[0] if took_over else solver.system
        with recipe(default_recipe(problem, system, large=False)[0] if took_over else solver.recipe), stages("certify"):
            enclosure = enclose(problem, fields, system, Stages())
    if outcome is not Outcome.CONVERGED and isinstance(problem, BoxProblem):
        outcome, message = problem.explain(outcome, message)
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
            "method": chosen.method,
            "took_over": took_over,
            "system": chosen.system or None,
            "scheme": scene.scheme,
            "recipe": recipe_used,
            "ksp_type": ksp_type,
            "pc_type": pc_type,
            "why": [*chosen.why, memory.sentence] if memory else chosen.why,
            **(memory.settings if memory else {}),
            "details": {key: value for key, value in details.items() if key != "levels"},
        },
        times={**stages.seconds, "total": perf_counter() - begin},
        levels=levels if chosen.nested else details.get("levels", []),
        enclosure=enclosure,
    )
