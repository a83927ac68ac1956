"""Time steps: a complementarity problem each, solved by the methods of the steady one, from the answers of the steps before.

`marching` takes the steps; `march` has the formulas, `step` one step's film, `rotor` a journal that is free, `march_file` what
a run is taken up from.
"""

from dataclasses import replace
from typing import Any

from ...errors import InputError
from ...problems.solution import Outcome, Solution
from ...scenes.moving import motion_of
from ...scenes.scene import Solvable
from ..ask import Ask
from ..compose import Inner
from .marching import Run, iterations_of


def applies(scene: Solvable, ask: Ask) -> bool:
    """Whether the scene goes on in time."""
    return motion_of(scene) is not None


def solve(scene: Solvable, ask: Ask, inner: Inner) -> Solution:
    """Take all time steps, or as many as can be solved; the certificate is the worst of theirs. Collective.

    Returns
    -------
    Solution : fields of the last step; `steps` are the iterations of all time steps, one after another; `history` has a row for
        each. settings['details']: time_steps, t_end, step_min, step_max, iterations_per_step, mass_defect_run.

    Raises
    ------
    InputError : a system that is made for the steady problem alone; a wall that touches, a content that becomes negative:
        with the time and the place.
    """
    if ask.system == "cavity":
        raise InputError("--system cavity: cells of a film that moves store liquid; allowed are full, reduced")
    run = Run(scene, ask, inner)
    with run.file.keeper.listening():
        while run.outcome is Outcome.CONVERGED and not run.done:
            run.advance()
            t, end = run.march.t, run.table.t_end
            ask.tell("time", f"t = {t:.4g} of {end:.4g}", min(t / end, 1.0))
    return answer(run)


def answer(run: Run) -> Solution:
    """The solution of the whole march."""
    solution, march = run.last, run.march
    if solution is None:
        raise InputError(f"{run.scene.name}: the march has come to t = {march.t:g} s, its end; a later motion.t_end goes on")
    problem: Any = solution.problem
    if problem.shares_grid:
        problem.shares_grid = False
    else:
        march.grid.destroy()
    count = len(run.history)
    if run.outcome is Outcome.CONVERGED:
        solves = f"{run.solves / max(count, 1):.1f} solves each, " if run.solves > count else ""
        run.message = f"{count} time steps, {solves}{iterations_of(run.steps) / max(run.solves, 1):.1f} iterations a solve"
        run.message += f"; {march.defect:.1e} of the oil lost"
        if march.defect > run.worst().tol:
            run.outcome = Outcome.WRONG_SOLUTION
    if run.seen is not None:
        problem = run.seen.answer(problem)
    details = {
        **run.settings["details"],
        "time_steps": count,
        "t_end": march.t,
        "step_min": run.lengths[0] if count else None,
        "step_max": run.lengths[1] if count else None,
        "solves_per_step": run.solves / max(count, 1),
        "iterations_per_step": iterations_of(run.steps) / max(run.solves, 1),
        "mass_defect_run": march.defect,
    }
    if run.rotor is not None or run.course is not None:
        details |= run.coordinates.told(run._given(march.t) or (0.0, 0.0))
    return replace(
        solution,
        problem=problem,
        outcome=run.outcome,
        message=run.message,
        certificate=run.worst(),
        steps=run.steps,
        settings={
            **run.settings,
            "method": run.rescuer or run.chosen.method,
            "took_over": run.chosen.method if run.rescuer else None,
            "start": "cold",
            "why": [*dict.fromkeys([f"in time by {run.table.scheme}, {count} steps", *run.chosen.why, *run.settings["why"]])],
            "details": details,
        },
        times=run.times_s,
        levels=[],
        history=run.history,
    )
