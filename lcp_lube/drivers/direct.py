"""One problem solved: the chosen method on grids from coarse to fine, then the methods that take over where it fails."""

from dataclasses import astuple, dataclass, field, replace
from time import perf_counter
from typing import Any

import numpy as np

from ..base.options import recipe
from ..base.progress import decades
from ..base.stages import Stages
from ..problems.box import BoxProblem
from ..problems.certificate import Certificate
from ..problems.facts import Facts
from ..problems.film.lubrication import LubricationProblem
from ..problems.grid import Grid
from ..problems.solution import Enclosure, Fields, Outcome, Problem, Solution, Step
from ..registry import METHODS
from ..scenes.scene import Solvable
from ..solvers.enclosure import enclose
from ..solvers.job import Job
from ..solvers.method import Method
from ..solvers.newton import Monitor, Stopping
from . import memory
from .ask import Ask, Start
from .checkpoint import Checkpoint, Checkpointer, load, scene_record
from .compose import Inner
from .levels import guess, level_shapes
from .plan import Plan, default_recipe, plan

# A coarse answer is a start: its front matters, not its last digits. An interior method's layer there must be thin, though.
COARSE_EPS = {False: 1e-4, True: 1e-8}  # by MethodEntry.interior


def applies(scene: Solvable, ask: Ask) -> bool:
    return True


def solve(scene: Solvable, ask: Ask, inner: Inner | None = None) -> Solution:
    """Plan, build, solve and certify: the innermost driver. Collective.

    Raises
    ------
    InputError : an unknown name, a value out of range, an option that does not fit, too little memory.
    """
    begin, held = perf_counter(), ask.built.before if ask.built else memory.resident()
    stages = Stages()
    facts = scene.facts(ask.comm)
    if ask.start is not None and ask.nested is None:
        ask = replace(ask, nested=False)
    saved = None
    if ask.resume is None:  # whose method is not known yet
        chosen = plan(facts, ask, scene.name)
    with stages("setup"):
        if ask.memory_check and ask.resume is None:
            memory.look_ahead(facts, chosen, ask.mpi)
        problem = ask.built.problem if ask.built else scene.build(ask.comm)
    keeper = Checkpointer(ask.checkpoint, ask.every, problem.grid.comm)
    if ask.resume is not None:
        saved = load(ask.resume, scene_record(scene), problem.grid.comm)
        ask = saved.settled(ask)
        chosen = plan(facts, ask, scene.name)
    entry = METHODS[chosen.method].of(facts.kind)
    run = Run(scene, problem, facts, chosen, replace(ask, stopping=ask.stopping_for(entry.eps)), stages, keeper, saved)
    keeper.begin(scene, (chosen.method, chosen.system, ask.recipe, chosen.nested, dict(ask.options)))
    with recipe(chosen.recipe) as run.recipe:
        estimate = memory.check(facts, chosen, problem.grid.comm, ask.memory_check, held)
        run.grids(ask.start)
    run.take_over()
    outcome, message = run.outcome, run.message
    certificate = run.certificate or ask.certify_by(problem, run.fields, run.stopping.eps1)
    enclosure = run.enclose(problem) if ask.certify and isinstance(problem, LubricationProblem) else None
    if outcome is not Outcome.CONVERGED and isinstance(problem, BoxProblem):
        outcome, message = problem.explain(outcome, message)
    return Solution(
        problem,
        run.fields,
        outcome,
        message,
        certificate,
        run.steps,
        settings=run.settings(estimate),
        times={**stages.seconds, "total": perf_counter() - begin},
        levels=run.levels if chosen.nested else run.details.get("levels", []),
        enclosure=enclosure,
    ).judged()


@dataclass
class Run:
    """How far a problem's solve has got: `grids`, then `take_over`. Every method is collective.

    Parameters
    ----------
    problem : on the scene's own grid; facts : of it.
    chosen : method, system, recipe and nesting.
    ask : with its `stopping` settled.
    keeper : writes checkpoints, if any. saved : the one to go on from.

    Attributes
    ----------
    outcome, message, fields, steps : of the last method, on the finest grid; steps of those before it come first.
    method, system, recipe, ksp_type, pc_type : of the last method, the chosen one or the one that took over from it.
    levels : a record of every grid, coarse to fine. details : what the method reports beyond its steps.
    """

    scene: Solvable
    problem: Problem
    facts: Facts
    chosen: Plan
    ask: Ask
    stages: Stages
    keeper: Checkpointer
    saved: Checkpoint | None
    outcome: Outcome = Outcome.MAX_ITERATIONS
    message: str = "no step was taken"
    fields: Fields = field(default_factory=dict)
    steps: list[Step] = field(default_factory=list)
    levels: list[dict[str, Any]] = field(default_factory=list)
    details: dict[str, Any] = field(default_factory=dict)
    certificate: Certificate | None = None  # of the fields, where somebody has made one
    recipe: str | None = None
    ksp_type: str | None = None
    pc_type: str | None = None

    def __post_init__(self) -> None:
        self.stopping, self.options = self.ask.stopping_for((0.0, 0.0)), dict(self.ask.options)
        self.method, self.system = self.chosen.method, self.chosen.system

    def grids(self, start: Solution | Start | None = None) -> None:
        """The chosen method on every grid; start: what lies near the answer on the first one."""
        entry = METHODS[self.chosen.method].of(self.problem.kind)
        finest = self.scene.shape
        shapes = level_shapes(finest, self.problem.grid.comm.size) if self.chosen.nested else [finest]
        near: tuple[Problem, Fields] | None = (start.problem, start.fields) if start is not None else None
        previous = None  # near: what the next grid starts from, and the problem on the grid before
        if self.saved is not None:
            shapes, self.levels, near = self.saved.shapes, self.saved.record["levels"], None
        for k, shape in enumerate(shapes):
            begin = perf_counter()
            with self.stages("setup"):
                level = self.problem if shape == finest else self.scene.with_shape(shape).build(self.problem.grid.petsc_comm)
            with self.stages("prolongation"):
                start_from = guess(level, near, entry.interior)
            if previous is not None:
                previous.destroy()
            coarse = Stopping(max(COARSE_EPS[entry.interior], self.stopping.eps1), np.inf, self.stopping.max_it)
            stopping = self.stopping if shape == finest else coarse
            method = entry.load()(Job(level, self.stages, self.chosen.system, self.options, stopping, start_from))
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
        if not self.ask.rescue:
            return
        reached, record, failures, steps = self.fields, [], "", self.steps
        others = METHODS[self.chosen.method].of(self.problem.kind).fallback
        for k, name in enumerate((name for name in others if self.facts.size <= METHODS[name].at_most), start=1):
            if self.outcome is Outcome.CONVERGED:
                self.certificate = self.certificate or self.ask.certify_by(self.problem, self.fields, self.stopping.eps1)
                if not (failure := self.certificate.failure):
                    break
                self.outcome, self.message = Outcome.WRONG_SOLUTION, f"{self.message}, but the certificate fails: {failure}"
            record.append((self.outcome, self.message, [astuple(step) for step in self.steps]))
            failures += f"{self.method} failed ({self.message}); "
            entry = METHODS[name].of(self.problem.kind)
            system, inner = self._rescue_solver(name)
            # An interior method begins anew; another may take up what was reached, if it is not zero everywhere.
            anything = self.problem.reduce.max(np.concatenate([np.abs(values) for values in reached.values()]))
            start = None if entry.interior or anything == 0.0 else reached
            ring = self.facts.periodic[0] and self.facts.dim == 2 and not self.facts.moving
            if entry.nested and not entry.interior and ring:
                start = self._from_coarse(name)
            with recipe(inner) as self.recipe:
                method = entry.load()(Job(self.problem, self.stages, system, {}, self.stopping, start))
                self._iterate(method, self.problem, self.stopping, k, reached, failed=record)
            self.method, self.system, steps = name, system, steps + self.steps
        self.steps = steps
        if failures:
            self.message = f"{failures}{self.method} took over: {self.message}"

    def _from_coarse(self, name: str) -> Fields | None:
        """A start from half the points each way: on a ring that is hardly fed, what goes round is not in what was reached."""
        ask = Ask(method=name, comm=self.ask.comm, memory_check=False, rescue=False)
        coarse = solve(self.scene.with_shape(tuple(max(3, n // 2) for n in self.facts.shape)), ask)
        start = self.problem.prolong(coarse.problem, coarse.fields, False) if coarse.converged else None
        coarse.destroy()
        return start

    def _plan(self, method: str, nested: bool | None = None) -> Plan:
        """As if this method had been asked for, and nothing else."""
        return plan(self.facts, Ask(method=method, nested=nested), self.scene.name)

    def _rescue_solver(self, name: str) -> tuple[str, str | None]:
        """System and recipe for a method that takes over.

        Interior methods converge from anywhere, and only direct inner solves keep up with them on films like these. Behind a
        method without linear systems the next one is chosen as if it had been the first.
        """
        entry = METHODS[name].of(self.problem.kind)
        if not entry.systems:
            return "", None
        inner = default_recipe(self.facts, entry.systems[0], large=False)[0]
        if self.chosen.system or entry.interior:
            return entry.systems[0], inner
        first = self._plan(name)
        return first.system, first.recipe or inner

    def _iterate(
        self, method: Method, level: Problem, stopping: Stopping, tried: int, reached: Fields | None = None, **record: Any
    ) -> None:
        """Run a method to its end, or take its end from the checkpoint; tried: how many methods had failed before it."""
        saved = self.saved
        try:
            if saved is not None and len(saved.failures) > tried:  # another method had taken over
                self.outcome, self.message, self.steps = saved.failures[tried]
            else:
                before = saved.restore(method, level.grid, reached) if saved is not None else []
                self.saved = None
                monitor = self._watching(level.grid, stopping)
                ended = self.keeper.iterate(method, level.grid, stopping, monitor, before, reached, **record)
                self.outcome, self.message, self.steps = ended
            self.fields, self.certificate = method.fields, method.certificate
            if not tried:
                self.details = getattr(method, "details", {})
            krylov = method.krylov
            self.ksp_type, self.pc_type = (krylov.ksp_type, krylov.pc_type) if krylov else (None, None)
        finally:
            method.destroy()

    def _watching(self, grid: Grid, stopping: Stopping) -> Monitor | None:
        """The caller's monitor, and the report to `Ask.progress`: the grid, and how far ||F|| has come down on it."""
        ask, norms = self.ask, list[float]()
        if ask.progress is None:
            return ask.monitor
        name = " x ".join(map(str, grid.shape))
        share = grid.size / self.problem.grid.size  # coarser ones take a part of the time

        def watch(k: int, step: Step) -> None:
            if ask.monitor is not None:
                ask.monitor(k, step)
            norms.append(step.norm)
            part = share * decades(max(norms), step.norm, stopping.eps1)
            ask.tell("grids", f"grid {name}, step {k}, ||F|| {step.norm:.1e}", part)

        return watch

    def enclose(self, problem: LubricationProblem) -> Enclosure:
        """A band around the answer, by the inner solver that has just solved this problem, or would have."""
        solver = self.chosen if self.chosen.system else self._plan("active-set", nested=False)
        system, inner = solver.system, solver.recipe
        if self.method != self.chosen.method:
            system = (METHODS[self.method].systems or METHODS["active-set"].systems)[0]
            inner = default_recipe(self.facts, system, large=False)[0]
        with recipe(inner), self.stages("certify"):
            return enclose(problem, self.fields, system, Stages())

    def settings(self, estimate: memory.Estimate | None) -> dict[str, Any]:
        """How it was solved, as the JSON prints it."""
        return {
            "scene": self.scene.name,
            "method": self.method,
            "took_over": self.chosen.method if self.method != self.chosen.method else None,
            "system": self.system or None,
            "scheme": self.scene.scheme,
            "recipe": self.recipe,
            "ksp_type": self.ksp_type,
            "pc_type": self.pc_type,
            "eps1": self.stopping.eps1,
            "why": [*self.chosen.why, *([estimate.sentence] if estimate else [])],
            **(estimate.settings if estimate else {}),
            "details": {key: value for key, value in self.details.items() if key != "levels"},
        }
