"""Time steps: a complementarity problem each, solved by the methods of the steady one, from the answer of the step before.

The film is symmetric about the middle of its line: half of it is solved, spread out and certified on the whole. Where that
fails, this step and those after it are solved whole.
"""

from dataclasses import dataclass, replace
from typing import Any

from petsc4py import PETSc

from ..errors import InputError
from ..problems.certificate import Certificate
from ..problems.facts import Facts
from ..problems.film.squeeze import SqueezeProblem
from ..problems.film.squeeze_step import HalfLine, SqueezeStep
from ..problems.solution import Fields, Outcome, Solution, Step
from ..scenes.scene import Derived, Solvable
from .ask import Ask, Start
from .compose import Inner
from .plan import plan
from .symmetry import why_not

# Points below which spreading and certifying a half costs more than the banded solve saves (1999: 0.9 of the time, 199: 1.4).
SHORT = 1500
HALF = "half of the line is solved: gap and pressures at the ends are symmetric about its middle"


@dataclass(frozen=True)
class TimeStep(Derived):
    """One step of a march."""

    step: SqueezeStep

    @property
    def shape(self) -> tuple[int, ...]:
        return self.step.grid.shape

    def with_shape(self, shape: tuple[int, ...]) -> "TimeStep":
        raise NotImplementedError("a step is on its march's grid")

    def facts(self, comm: PETSc.Comm | None = None) -> Facts:
        return replace(self.whole.facts(comm), shape=self.shape)

    def build(self, comm: PETSc.Comm | None = None) -> SqueezeStep:
        return self.step


def applies(scene: Solvable, ask: Ask) -> bool:
    """Whether the scene goes on in time."""
    return getattr(scene, "transient", False)


def solve(scene: Solvable, ask: Ask, inner: Inner) -> Solution:
    """Take all time steps, or as many as can be solved; the certificate is the worst of theirs. Collective.

    Returns
    -------
    Solution : fields of the last step; `steps` are the iterations of all time steps, one after another. Its start is cold:
        every march begins with the full film.

    Raises
    ------
    InputError : a system that is made for the steady problem alone.
    """
    if ask.system == "cavity":
        raise InputError(f"--system cavity: it needs a flow along x; scene {scene.name} has none; allowed are full, reduced")
    reason = why_not(ask)
    ask = replace(ask, nested=False, reduction=False)
    chosen = plan(scene.facts(ask.comm), ask, scene.name)
    if chosen.method == "active-set":  # the step before has the front to within a cell or two
        ask = replace(ask, options={"sweeps": 0, **ask.options})
    ask = replace(ask, method=chosen.method, start=None)
    problem: SqueezeProblem = scene.build(ask.comm)  # type: ignore[assignment]
    if not reason and problem.grid.size < max(SHORT, 2 * problem.grid.comm.size):
        reason = "half of so short a line costs more than it saves"
    half = None if reason else HalfLine(problem.grid)
    near: Fields | None = None  # of the step before
    record: list[Step] = []
    certificates: list[Certificate] = []
    times: dict[str, float] = {}
    rescuer: str | None = None
    outcome = Outcome.CONVERGED
    while problem.steps > len(certificates) and outcome is Outcome.CONVERGED:
        step = problem.next_step()
        if half is not None:
            solution = _on_half(scene, step, half, near, ask, inner)
            if not solution.converged:
                reason = f"half of it gave no answer of the whole at time step {len(certificates) + 1}, nor was it asked again"
                half.destroy()
                half = None
        if half is None:
            solution = inner(TimeStep(scene, step), replace(ask, start=Start(problem, near) if near else None))
        outcome, message = solution.outcome, solution.message
        if not certificates:
            settings: dict[str, Any] = solution.settings
        rescuer = solution.method if solution.took_over else rescuer
        certificates.append(solution.certificate)
        record += solution.steps
        times = {name: times.get(name, 0.0) + seconds for name, seconds in solution.times.items()}
        if solution.converged:
            problem.accept(step, solution.fields)
        near = solution.fields
        solution.destroy()
        done = len(certificates)
        ask.tell("time", f"time step {done} of {problem.steps}", done / problem.steps)
    if outcome is Outcome.CONVERGED:
        message = f"{problem.steps} time steps, {len(record) / problem.steps:.1f} iterations each"
    else:
        message = f"time step {len(certificates)} of {problem.steps}, t = {problem.time + problem.dt:.6g}: {message}"
    if half is not None:
        half.destroy()
    worst = {name: max((c.measures[name] for c in certificates), key=_badness) for name in certificates[0].measures}
    lowest = {name: min(c.extremes[name] for c in certificates) for name in certificates[0].extremes}
    return replace(
        solution,
        problem=problem,
        outcome=outcome,
        message=message,
        certificate=Certificate(worst, certificates[0].tol, lowest),
        steps=record,
        settings={
            **settings,
            "method": rescuer or chosen.method,
            "took_over": chosen.method if rescuer else None,
            "start": "cold",
            "why": [f"the whole line: {reason}" if reason else HALF, *chosen.why],
            "details": {**settings["details"], **({} if reason else {"reduction": "mirror"})},
        },
        times=times,
        levels=[],
    )


def _on_half(scene: Solvable, step: SqueezeStep, half: HalfLine, near: Fields | None, ask: Ask, inner: Inner) -> Solution:
    """A step's solution from that of its half, certified on the whole. Collective."""
    part = half.step(step)
    start = Start(part, {name: half.take(values) for name, values in near.items()}) if near else None
    solution = inner(TimeStep(scene, part), replace(ask, start=start))
    part.destroy()
    fields = {name: half.spread(values) for name, values in solution.fields.items()}
    certificate = step.certify(fields, solution.settings["eps1"])
    return replace(solution, problem=step, fields=fields, certificate=certificate).judged()


def _badness(measure: float) -> float:
    """NaN is the worst."""
    return measure if measure == measure else float("inf")
