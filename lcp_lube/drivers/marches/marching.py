"""The steps of a march in time, one after another: what `time` begins, and ends with an answer."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from ...errors import InputError
from ...problems.certificate import Certificate, glance
from ...problems.film.lubrication import LubricationProblem
from ...problems.film.model import Model
from ...problems.grid import EVEN
from ...problems.solution import Outcome, Solution, Step
from ...scenes.motion import MotionTable
from ...scenes.moving import motion_of
from ..ask import Ask, Start, light
from ..compose import Inner
from ..motions.coefficients import supplied
from ..plan import plan
from ..supplies import check_backflow
from .march import March
from .march_coordinates import Coordinates
from .march_file import MarchFile
from .rotor import Rotor
from .step import TimeStep, carried, check_content, check_room, contents

SOME = 0.37  # of t_end: when edges are compared with those at t = 0
FIRST = 1e-3  # of t_end: the first step, where an error estimate says how long the others are
LEAST = 1e-9  # of t_end: the shortest step
RECENT, MANY, SWEEPS = 10, 2.0, 16  # the last steps considered, iterations a solve that are many, sweeps that come first then
REST = 0.05  # of multigrid's residual in a step's guess may be left: that is far below the error of the step's formula
EPS1 = 3e-10  # of multigrid: its root bounds what the certificate lets a step leave (other methods' is 1e-4)
SHARE = 0.01  # of t_end: in shorter steps an error of the rates counts by its part of that time
REPEAT = 2.0  # times the tolerance: the error beyond which a step is taken again
HEAT = ("temperature_max", "temperature_effective", "temperature_out", "heat_power", "heat_out", "heat_stored")
TOLD = ("load", "force", "moment", "p_max", "min_h", "cavitated_fraction", "friction", *HEAT)  # of a step, for the history


@dataclass(frozen=True)
class Moment:
    """A step that was taken, as `Ask.watch` receives it. before, place : before it. dry : of the film at t = 0."""

    t: float
    t_end: float
    problem: LubricationProblem
    fields: dict[str, Any]
    row: dict[str, Any]
    count: int
    before: dict[str, Any] | None
    place: Any = None
    dry: Any = None


class Run:
    """A march under way: `advance` until it is `done`, or `outcome` is no longer converged. Every method is collective."""

    def __init__(self, scene: Any, ask: Ask, inner: Inner):
        self.scene, self.inner = scene, inner
        table = motion_of(scene)
        assert table is not None
        self.table: MotionTable = table
        self.models, self.course = scene.models(), table.course(scene._folder, len(scene.place))
        self.file = MarchFile(ask, scene)
        self.coordinates, self.rotor = Coordinates(scene, table), None
        self.watch, self.seen = ask.watch, getattr(scene, "observer", lambda: None)()
        self.times = sorted({t for t in ask.times if 0 < t < table.t_end})
        ask = replace(ask, nested=None if ask.nested else False, checkpoint=None, resume=None, every=1, watch=None, start=None)
        if self.coordinates.any:
            steady = not self._fill and self.file.resume is None
            place, speed = self.coordinates.begin(self.course, replace(ask, nested=None), inner if steady else None)
            self.rotor = Rotor(self.coordinates, ask.digits, [place], [speed])
        first = first_film(scene, self.models, self._given(0.0))
        problem = self._at(0.0, lambda: first.build(scene.shape, ask.comm))
        problem.shares_grid = True
        self.march = March(problem.grid, table.scheme == "bdf2")
        problem.destroy()
        chosen = plan(replace(first.facts(scene.shape, ask.comm), moving=True), ask, scene.name)
        self.chosen, self.may_sweep, named = chosen, False, ask.named
        if chosen.method == "active-set":  # the steps before have the front to within a cell or two: see `_sweeps`
            self.may_sweep = "sweeps" not in ask.options
            ask = replace(ask, options={"sweeps": 0, **ask.options})
        self.march.curved = (coupled := bool(first.effects) or first.dense) or chosen.method == "fas"
        self.ask = replace(ask, method=chosen.method, implied=not named)
        if chosen.method == "fas" and self.rotor is None and ask.options.get("rest", REST):
            stopping, self.march.ends = ask.stopping or {"eps1": EPS1}, True
            self.ask = replace(self.ask, options={"rest": REST, **ask.options}, stopping=stopping)
            ask = ask if coupled else replace(ask, stopping=stopping)
        self.steps, self.certificates = list[Step](), list[Certificate]()
        self.times_s, self.history, self.lengths = dict[str, float](), list[dict[str, Any]](), [np.inf, 0.0]
        self.rescuer: str | None = None
        self.last: Solution | None = None
        self.settings, self.begun = dict[str, Any](), dict[str, Any]()  # of the steps, and of the steady film
        self.outcome, self.message = Outcome.CONVERGED, ""
        self.step, self.solves = table.step or FIRST * table.t_end, 0
        if not self.file.restore(self, self.march.grid):
            self._begin(first, ask)
        for k in range(len(self.history)):  # of a march that is taken up
            self._sweeps(self.history[max(0, k + 1 - RECENT) : k + 1])

    def _given(self, t: float) -> tuple[float, ...] | None:
        """Where what moves is, if anything does."""
        if self.rotor is not None:
            return tuple(map(float, self.rotor.places[0]))
        return self.course(t) if self.course is not None else None

    @property
    def _fill(self) -> float | None:
        """The part of the film that is oil at t = 0, if that is given."""
        return self.table.fill or (1.0 if self.table.start == "full" else None)

    def _at(self, t: float, call: Callable[[], Any]) -> Any:
        """A call's result; bad input is reported with the time."""
        try:
            return call()
        except InputError as error:
            raise InputError(f"{self.scene.name}: t = {t:.6g} s: {str(error).removeprefix(f'{self.scene.name}: ')}") from None

    def _begin(self, model: Any, ask: Ask) -> None:
        """The film at t = 0."""
        fill = self._fill
        if fill is not None:
            full, none = contents(self.march.grid, model, None), np.zeros(self.march.grid.local_size)
            self.march.begin(fill * full, None if fill == 1 else {"p": none, "r": none + 1.0 - fill}, carried(model, full))
            return
        if model.sealed or not model.fed:
            why = "no side has a pressure" if model.sealed else "nothing feeds the film"
            raise InputError(f"{self.scene.name}: {why}: that at t = 0 is not determined; give motion.fill")
        solution = self.inner(TimeStep(self.scene, model, self.march.grid), ask)
        if not solution.converged:
            raise InputError(f"{self.scene.name}: no steady film at t = 0: {solution.message}; motion.start = full needs none")
        full = contents(self.march.grid, model, solution.fields, solution.problem)
        self.march.begin(full, solution.fields, carried(model, full, solution.problem))
        self.begun = {**solution.settings, "dry": solution.problem.moving.dry}  # type: ignore[attr-defined]
        solution.destroy()

    @property
    def done(self) -> bool:
        return self.march.t >= self.table.t_end * (1.0 - 1e-12)

    def _next(self) -> float:
        """Length of the next step."""
        t, end = self.march.t, self.table.t_end
        if self.table.step is not None:  # from its number: sums of steps have rounding
            return min((round(t / self.table.step) + 1) * self.table.step, end) - t
        targets = [time for time in self.times if time > t * (1.0 + 1e-12)] + [end]
        left = targets[0] - t
        return left if left <= 1.01 * self.step else 0.5 * left if left < 2.0 * self.step else self.step

    def advance(self) -> None:
        """One more step, or the reason why there is none in `outcome`."""
        march = self.march
        while True:
            dt = self._next()
            t = march.t + dt
            solution, place, why, solves = self._step(t, dt)
            problem: Any = solution.problem
            if why or not solution.converged:
                if self.table.step is None and 0.5 * dt > LEAST * self.table.t_end:
                    self.step = 0.5 * dt
                    solution.destroy()
                    continue
                self.outcome = solution.outcome if not solution.converged else Outcome.MAX_ITERATIONS
                self.message = f"time step {len(self.history) + 1}, t = {t:.6g}: {why or solution.message}"
                self._keep(solution, solves)
                return
            new = contents(march.grid, self.model, solution.fields, problem)
            heat, error = carried(self.model, new, problem), None
            if self.table.step is None:
                error = march.error(dt, problem, new, heat)
                if error is not None:  # where a cavity closes rates jump, whatever the step: a short step's error soon passes
                    error *= min(1.0, dt / (SHARE * self.table.t_end))
                if self.rotor is not None:
                    thinnest = problem.reduce.min(problem.scheme.h)
                    other = self.rotor.error(place, dt, march.dts, thinnest)
                    error = max(filter(None, (error, other)), default=None)
                self.step = march.next_step(dt, error, self.table.tolerance)
                too_large = error is not None and error > REPEAT * self.table.tolerance
                negative = march.grid.reduce.max(solution.fields["r"]) > 1.0
                if (too_large or negative) and 0.5 * dt > LEAST * self.table.t_end:
                    self.step = min(self.step, 0.5 * dt)
                    solution.destroy()
                    continue
            check_content(march.grid, solution.fields["r"], t, dt, self.scene.name)
            self._at(t, partial(check_backflow, solution))
            break
        formula = march.formula(dt)
        if self.rotor is not None:
            self.rotor.accept(place, formula)
        flows = march.accept(dt, problem, solution.fields, new, heat)
        self._keep(solution, solves)
        if self.seen is not None:
            self.seen.accept(problem, solution.fields, march.t, dt)
        row = self._row(solution, dt, flows, place, solves)
        self.history.append(row)
        self._sweeps(self.history)
        self.lengths = [min(self.lengths[0], dt), max(self.lengths[1], dt)]
        if self.watch is not None:
            was = march.fields[1] if march.fields[1:] else None, self.rotor and self.rotor.places[1], self.begun.get("dry")
            self.watch(Moment(march.t, self.table.t_end, problem, solution.fields, row, len(self.history), *was))
        self.file.after(self)

    def _step(self, t: float, dt: float) -> tuple[Solution, Any, str, list[list[Step]]]:
        """The film at the step's end, where the journal is, why it has no place, and each solve's steps. Collective."""
        march, formula = self.march, self.march.formula(dt)
        self.last = self.last and replace(self.last, problem=light(self.last.problem))
        term, near = replace(march.term(formula), exact=self.rotor is not None), march.guess(dt)
        solves, newest = list[list[Step]](), near  # of ten films that a free journal solves for a step one alone is kept

        def film_at(e: Any, judge: Any = None) -> Solution:
            nonlocal newest
            model = self.models(t, None if e is None else [float(one) for one in e])
            self.model = replace(model, stored=term, places=march.grid.places)
            if model.sealed:
                check_room(march.grid, self.model, t, self.scene.name)
            last, step = self.last, TimeStep(self.scene, self.model, march.grid)
            problem, known = (last.problem, last.settings) if last is not None else (None, self.settings or self.begun)
            own = None if problem is not None or newest is None else self._at(t, lambda: step.build(self.ask.comm))
            start = None if newest is None else Start(problem or own, newest, known)  # type: ignore[arg-type]
            solution = self._at(t, lambda: self.inner(step, replace(self.ask, start=start, judge=judge)))
            if own is not None:
                own.destroy()
            solves.append(solution.steps)
            newest = solution.fields
            return solution

        def stiffness(solution: Solution) -> Any:
            return self.coordinates.stiffness(TimeStep(self.scene, supplied(self.model, solution), march.grid), solution)

        if self.rotor is None:
            place = self._at(t, lambda: self._given(t))
            return film_at(place), place, "", solves
        guess = self.rotor.guess(dt, march.dts)
        if self.course is not None:
            given = self._at(t, lambda: self.course(t))  # type: ignore[misc]
            guess[: len(given)] = given
        solution, place, why = self.rotor.settle(t, formula, guess, lambda e: film_at(e, glance), stiffness)
        if solution.converged:
            solution.certificate = solution.problem.certify(solution.fields, solution.settings["eps1"])
            if not solution.certificate.holds:
                solution.destroy()
                solution = film_at(place)
        return solution, place, why, solves

    def _keep(self, solution: Solution, solves: list[list[Step]]) -> None:
        """Note what a step was, and hold it in place of the one before."""
        self.settings = self.settings or solution.settings
        self.rescuer = solution.method if solution.took_over else self.rescuer
        self.certificates.append(solution.certificate)
        self.steps += [step for steps in solves for step in steps]
        self.solves += len(solves)
        self.times_s = {name: self.times_s.get(name, 0.0) + seconds for name, seconds in solution.times.items()}
        last, self.last = self.last, solution
        if last is not None:
            last.destroy()

    def _sweeps(self, history: list[dict[str, Any]]) -> None:
        """Fronts that run by several cells a step are put right by sweeps, which a few steps alone would not pay for."""
        late = history[-RECENT:]
        many = len(late) == RECENT and sum(row["solves"] for row in late) * MANY < sum(row["iterations"] for row in late)
        if many and self.may_sweep:
            self.may_sweep = False
            self.ask = replace(self.ask, options={**self.ask.options, "sweeps": SWEEPS})

    def _row(self, solution: Solution, dt: float, flows: dict[str, float], place: Any, solves: list[Any]) -> dict[str, Any]:
        """A step's line of the history."""
        found = solution.problem.quantities(solution.fields)
        row: dict[str, Any] = {"t": self.march.t, "dt": dt}
        if place is not None:
            row |= dict(zip(self.coordinates.names, map(float, place), strict=False))
        for name in TOLD:
            value = found.get(name)
            if isinstance(value, list):
                row |= dict(zip((f"{name}_x", f"{name}_y"), value, strict=True))
            elif value is not None:
                row[name] = value
        row |= flows | {"mass_defect": solution.certificate.measures["mass_defect"]}
        return row | {"iterations": iterations_of(step for steps in solves for step in steps), "solves": len(solves)}

    def worst(self) -> Certificate:
        """Of all steps."""
        found = self.certificates
        names = dict.fromkeys(name for c in found for name in c.measures)
        measures = {name: float(np.max([c.measures.get(name, 0.0) for c in found])) for name in names}  # NaN is the worst
        lowest = {name: min(c.extremes[name] for c in found) for name in found[0].extremes}
        return Certificate(measures, found[0].tol, lowest)


def iterations_of(steps: Iterable[Step]) -> int:
    """Films between grooves are solved side by side: those of the one that takes most count."""
    return sum(not step.beside for step in steps)


def first_film(scene: Any, models: Any, place: Any) -> Model:
    """The film at t = 0, on whose grid the march goes on."""
    first, later = (models(t, place) for t in (0.0, SOME * scene.motion.t_end))
    if any(set(first.edges_along(axis)) != set(later.edges_along(axis)) for axis in "xy"[: len(first.lengths)]):
        first = replace(first, places=EVEN)  # its edges move: no line of points can lie on them
    return first
