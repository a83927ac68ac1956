"""A scene's run: the chosen method on grids from coarse to fine, then the methods that take over where it fails."""

from collections.abc import Sequence
from dataclasses import astuple
from time import perf_counter
from typing import Any

import numpy as np

from ..base.options import recipe
from ..base.stages import Stages
from ..problems.film.lubrication import LubricationProblem
from ..problems.solution import Fields, Outcome, Problem, Step
from ..registry import METHODS
from ..scenes.scene import Scene
from ..solvers.enclosure import Enclosure, enclose
from ..solvers.job import Job
from ..solvers.newton import Method, Monitor, Stopping
from .checkpoint import Checkpoint, Checkpointer
from .levels import level_shapes
from .plan import Plan, default_recipe, plan

# A coarse answer is a start: its front matters, not its last digits. An interior method's layer there must be thin, though.
COARSE_EPS = {False: 1e-4, True: 1e-8}  # by MethodEntry.interior


class Run:
    """How far a scene's solve has got: `grids`, then `take_over`. Every method is collective.

    Parameters
    ----------
    problem : on the scene's own grid.
    chosen : method, system, recipe and nesting.
    options : the method's parameters by name.
    keeper : writes checkpoints, if any. saved : the one to go on from.

    Attributes
    ----------
    outcome, message, fields, steps : of the last method, on the finest grid; steps of those before it come first.
    took_over : the method that took the chosen one's place, if any.
    levels : a record of every grid, coarse to fine. details : what the method tells of itself beyond its steps.
    ksp_type, pc_type : of the chosen method's inner solver.
    """

    def __init__(
        self,
        scene: Scene,
        problem: Problem,
        chosen: Plan,
        stopping: Stopping,
        options: dict[str, Any],
        monitor: Monitor | None,
        stages: Stages,
        keeper: Checkpointer,
        saved: Checkpoint | None,
    ):
        self.scene, self.problem, self.chosen, self.stopping = scene, problem, chosen, stopping
        self.options, self.monitor, self.stages = options, monitor, stages
        self._keeper, self._saved = keeper, saved
        self.outcome, self.message = Outcome.MAX_ITERATIONS, "no step was taken"
        self.fields: Fields = {}
        self.steps: list[Step] = []
        self.levels: list[dict[str, Any]] = []
        self.details: dict[str, Any] = {}
        self.took_over: str | None = None
        self.ksp_type: str | None = None
        self.pc_type: str | None = None

    def grids(self, start: tuple[Problem, Fields] | None = None) -> None:
        """The chosen method on every grid; start: a problem and fields near the answer on the first one."""
        entry = METHODS[self.chosen.method].of(self.problem.kind)
        finest = self.scene.shape
        shapes = level_shapes(finest, self.problem.grid.comm.size) if self.chosen.nested else [finest]
        near, previous = start, None  # what the next grid starts from, and the problem on the grid before
        if self._saved is not None:
            shapes, self.levels, near = self._saved.shapes, self._saved.record["levels"], None
        for k, shape in enumerate(shapes):
            begin = perf_counter()
            with self.stages("setup"):
                level = self.problem if shape == finest else self.scene.with_shape(shape).build(self.problem.grid.dm.comm)
            with self.stages("prolongation"):
                guess = level.prolong(*near, entry.interior) if near is not None else None
            if previous is not None:
                previous.destroy()
            coarse = Stopping(max(COARSE_EPS[entry.interior], self.stopping.eps1), np.inf, self.stopping.max_it)
            stopping = self.stopping if shape == finest else coarse
            method = entry.load()(Job(level, self.stages, self.chosen.system, self.options, stopping, guess))
            self._iterate(method, level, stopping, 0, shapes=shapes[k:], levels=self.levels)
            near, previous = (level, self.fields), level
            if shape != finest and self.outcome in (Outcome.NOT_FINITE, Outcome.LINEAR_SOLVER):
                near = None  # nothing to start from: the next grid begins by itself
            self.levels.append(
                {
                    **dict(zip(("nx", "ny"), shape, strict=False)),
                    "iterations": len(self.steps),
                    "linear_iterations": sum(step.linear_iterations for step in self.steps),
                    "time_s": perf_counter() - begin,
                }
            )

    def take_over(self) -> None:
        """Where the chosen method failed, those that the registry has for that, one after another."""
        if not set(self.options) <= {"p0"}:
            return  # who sets a method's parameters wants to see what becomes of it
        reached, record, failures = self.fields, [], ""
        steps = self.steps
        for k, name in enumerate(METHODS[self.chosen.method].of(self.problem.kind).fallback, start=1):
            if self.outcome is Outcome.CONVERGED:
                break
            record.append((self.outcome, self.message, [astuple(step) for step in self.steps]))
            failures += f"{self.took_over or self.chosen.method} failed ({self.message}); "
            entry = METHODS[name].of(self.problem.kind)
            system, inner = self._rescue_solver(name)
            with recipe(inner):
                # An interior method begins anew; another may take up what was reached, if it is not zero everywhere.
                anything = self.problem.reduce.max(np.concatenate([np.abs(values) for values in reached.values()]))
                start = None if entry.interior or anything == 0.0 else reached
                method = entry.load()(Job(self.problem, self.stages, system, {}, self.stopping, start))
                self._iterate(method, self.problem, self.stopping, k, reached, failed=record)
            self.took_over, steps = name, steps + self.steps
        self.steps = steps
        if self.took_over:
            self.message = f"{failures}{self.took_over} took over: {self.message}"

    def _rescue_solver(self, name: str) -> tuple[str, str | None]:
        """System and recipe for a method that takes over.

        Interior methods converge from anywhere, and only direct inner solves keep up with them on films like these. Behind a
        method without linear systems the next one is chosen as if it had been the first.
        """
        entry = METHODS[name].of(self.problem.kind)
        inner = default_recipe(self.problem, entry.systems[0], large=False)[0]
        if self.chosen.system or entry.interior:
            return entry.systems[0], inner
        first = plan(self.problem, self.scene.name, name)
        return first.system, first.recipe or inner

    def _iterate(
        self, method: Method, level: Problem, stopping: Stopping, tried: int, reached: Fields | None = None, **record: Any
    ) -> None:
        """Run a method to its end, or take its end from the checkpoint; tried: how many methods had failed before it."""
        saved = self._saved
        try:
            if saved is not None and len(saved.failures) > tried:  # another method had taken over
                self.outcome, self.message, self.steps = saved.failures[tried]
            else:
                before = saved.restore(method, level.grid, reached) if saved is not None else []
                self._saved = None
                ended = self._keeper.iterate(method, level.grid, stopping, self.monitor, before, reached, **record)
                self.outcome, self.message, self.steps = ended
            self.fields = method.fields
            if not tried:
                self.details = getattr(method, "details", {})
                if krylov := method.krylov:
                    self.ksp_type, self.pc_type = krylov.ksp_type, krylov.pc_type
        finally:
            method.destroy()

    def enclose(self, problem: LubricationProblem) -> Enclosure:
        """A band around the answer, by the inner solver that has just solved this problem, or would have."""
        solver = self.chosen if self.chosen.system else plan(problem, self.scene.name, "active-set", nested=False)
        system, inner = solver.system, solver.recipe
        if self.took_over:
            system = METHODS[self.took_over].systems[0]
            inner = default_recipe(problem, system, large=False)[0]
        with recipe(inner), self.stages("certify"):
            return enclose(problem, self.fields, system, Stages())

    def settings(self, recipe_used: str | None, why: Sequence[str]) -> dict[str, Any]:
        """How it was solved, as the JSON prints it."""
        return {
            "scene": self.scene.name,
            "method": self.chosen.method,
            "took_over": self.took_over,
            "system": self.chosen.system or None,
            "scheme": self.scene.scheme,
            "recipe": recipe_used,
            "ksp_type": self.ksp_type,
            "pc_type": self.pc_type,
            "why": [*self.chosen.why, *why],
            "details": {key: value for key, value in self.details.items() if key != "levels"},
        }
