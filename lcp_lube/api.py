"""solve(scene) -> Solution: what to solve and how, handed to the drivers that they call for."""

from dataclasses import fields, replace
from pathlib import Path
from time import perf_counter
from typing import Any

from .base.alarm import check_same
from .base.parallel import overflow_is_no_warning
from .drivers import compose
from .drivers.ask import Ask
from .drivers.memory import peak
from .drivers.supplies import check_backflow
from .errors import InputError
from .problems.solution import Solution
from .scenes.scene import Scene, as_scene

ASKED = tuple(field.name for field in fields(Ask))


@overflow_is_no_warning  # but an outcome
def solve(scene: str | Path | dict[str, Any] | Scene, ask: Ask | None = None, **given: Any) -> Solution:
    """Solve a scene and certify the answer. Collective.

    Parameters
    ----------
    scene : what to solve: a Scene, or a name, a file or a dictionary as `load_scene` takes them.
    ask : how to solve it; default: as the program finds best.
    given : attributes of `Ask` by name, which win over those of `ask`: ``method="din"``, ``accuracy=1e-3``; any other name is
        a key of the scene, and its new value: ``solve("problem4", n=200)``.

    Returns
    -------
    Solution : everything about it; in a with statement, or until its `destroy` is called, it can be solved on from.

    Raises
    ------
    InputError : an unknown name, a value out of range, an option that does not fit, things that do not compose.
    """
    begin = perf_counter()
    if not isinstance(ask, Ask | None):
        raise InputError(f"ask = {ask!r}: an Ask is allowed; a scene's keys are given by name, as in solve(scene, n=200)")
    ask = replace(ask or Ask(), **{name: value for name, value in given.items() if name in ASKED})
    scene = as_scene(scene, {name: value for name, value in given.items() if name not in ASKED}, ASKED)
    if scene.family != "user":  # whose data are each rank's own
        check_same(ask.mpi, f"scene {scene.name} or how to solve it", (scene, ask.choices))
    compose.check(scene, ask)
    solution = compose.solve(scene, ask)
    check_backflow(solution)
    solution.solved_scene = _solved(scene, solution)
    solution.settings["memory_mb"] = solution.problem.grid.comm.allreduce(peak() / 2**20)
    if solution.problem.grid.comm.size > 1:
        solution.numbers  # noqa: B018  (all that needs every rank is taken now: later look-ups are each rank's own)
    solution.times["total"] = perf_counter() - begin
    return solution


def _solved(scene: Scene, solution: Solution) -> Scene:
    """The scene as it was solved: on the last grid, with the value that a balance found."""
    found, shape = solution.settings.get("balance"), solution.problem.grid.shape
    last = as_scene(scene, {found["vary"]: found["value"]}) if found else scene
    if "accuracy" in solution.settings:
        return last.refined(shape)
    return last.with_shape(shape) if shape != scene.shape else last
