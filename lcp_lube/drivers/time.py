"""Time steps: a complementarity problem each, solved by the methods of the steady one, from the answer of the step before."""

from time import perf_counter
from typing import Any

from ..base.options import recipe
from ..base.stages import Stages
from ..errors import InputError
from ..problems.certificate import Certificate
from ..problems.film.squeeze import SqueezeProblem
from ..problems.solution import Fields, Outcome, Solution, Step
from ..registry import METHODS
from ..scenes.scene import Scene
from ..solvers.job import Job
from ..solvers.newton import Monitor, Stopping, iterate
from .plan import Plan, default_recipe


def march(
    problem: SqueezeProblem,
    scene: Scene,
    chosen: Plan,
    stopping: Stopping,
    options: dict[str, Any],
    monitor: Monitor | None,
    stages: Stages,
) -> Solution:
    """Take all time steps, or as many as can be solved; the certificate is the worst of theirs. Collective.

    Returns
    -------
    Solution : fields of the last step; `steps` are the iterations of all time steps, one after another.

    Raises
    ------
    InputError : a system that is made for the steady problem alone.
    """
    begin = perf_counter()
    if chosen.system == "cavity":
        raise InputError(f"--system cavity: it needs a flow along x; scene {scene.name} has none; allowed are full, reduced")
    if chosen.method == "active-set":
        options = {"sweeps": 0, **options}  # the step before has the front to within a cell or two
    tries = [(chosen.method, chosen.system, chosen.recipe, options)]
    for name in METHODS[chosen.method].of(problem.kind).fallback:
        system = METHODS[name].systems[0]
        tries.append((name, system, default_recipe(problem, system, large=False)[0], {}))
    fields: Fields | None = None
    record: list[Step] = []
    certificates: list[Certificate] = []
    took_over: str | None = None
    inner: dict[str, str | None] = {}
    outcome, message = Outcome.CONVERGED, ""
    while problem.steps > len(certificates) and outcome is Outcome.CONVERGED:
        with stages("setup"):
            step = problem.next_step()
        for name, system, recipe_name, own in tries:
            entry = METHODS[name].of(problem.kind)
            with recipe(recipe_name) as recipe_used:
                run = entry.load()(Job(step, stages, system, own, stopping, None if entry.interior else fields))
                try:
                    outcome, message, steps = iterate(run, stopping, monitor)
                    if name == chosen.method:
                        krylov = run.krylov
                        inner = {"recipe": recipe_used}
                        inner |= {"ksp_type": krylov.ksp_type, "pc_type": krylov.pc_type} if krylov else {}
                    else:
                        took_over = name
                    reached = run.fields
                finally:
                    run.destroy()
            record += steps
            if outcome is Outcome.CONVERGED:
                break
        fields = reached
        with stages("history"):
            certificates.append(step.certify(fields, stopping.eps1))
            if outcome is Outcome.CONVERGED and not certificates[-1].holds:
                outcome, message = Outcome.WRONG_SOLUTION, f"the certificate fails: {certificates[-1].failure}"
            if outcome is Outcome.CONVERGED:
                problem.accept(step, fields)
            step.destroy()
    if outcome is Outcome.CONVERGED:
        message = f"{problem.steps} time steps, {len(record) / problem.steps:.1f} iterations each"
    else:
        message = f"time step {len(certificates)} of {problem.steps}, t = {problem.time + problem.dt:.6g}: {message}"
    worst = {name: max((c.measures[name] for c in certificates), key=_badness) for name in certificates[0].measures}
    lowest = {name: min(c.extremes[name] for c in certificates) for name in certificates[0].extremes}
    assert fields is not None  # at least two steps
    return Solution(
        problem,
        fields,
        outcome,
        message,
        Certificate(worst, certificates[0].tol, lowest),
        record,
        settings={
            "scene": scene.name,
            "method": chosen.method,
            "took_over": took_over,
            "system": chosen.system,
            "scheme": scene.scheme,
            **{"recipe": None, "ksp_type": None, "pc_type": None, **inner},
            "why": chosen.why,
        },
        times={**stages.seconds, "total": perf_counter() - begin},
    )


def _badness(measure: float) -> float:
    """NaN is the worst."""
    return measure if measure == measure else float("inf")
