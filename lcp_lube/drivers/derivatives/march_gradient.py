"""Derivatives of a film that goes on in time by its scene's numbers: the discrete adjoint of the march.

A step's balance is G_n(z_n, z_{n-1}, z_{n-2}; a) = 0, z = p in the full film and -r in the cavity; what it has of
earlier fields are the contents u = h (1 - r) of cells of size s, d/dt u ~ w_n u_n - l_n u_{n-1} - b_n u_{n-2}. From the last on

    J_n' lambda_n = dQ/dz_n + s h (l_{n+1} lambda_{n+1} + b_{n+2} lambda_{n+2}) in the cavity,
    dQ/da = d/da [ Q - sum over n of lambda_n' G_n ] at held z:

one transposed solve a step and quantity, whatever the number of parameters. A journal that is free adds its place e_n and speed
v_n, with V_n = v_n - d/dt e and E_n = m c d/dt v - F(z_n) - W: G_n(e_n) makes their adjoints four numbers a step; a film whose
level is free adds two, and so does each tilt of pads that follow, of which the steady film at t = 0 leaves no moment. A supply
whose pressure P_n follows adds what its source and the film disagree by, M_n(z_n, P_n) = 0, and one number a step.
"""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from ...base.differences import QUICK, differences
from ...base.parallel import Array
from ...errors import InputError
from ...problems.film.edges import oblique
from ...problems.film.flows import layers, point_weights, volume_unit
from ...problems.film.slopes import giving_points
from ...problems.film.stored import mean_film
from ...problems.solution import Solution
from ...scenes.scene import Scene
from ...scenes.values import values_of, with_values
from ..ask import Ask
from ..compose import solve
from ..marches.march_course import Course, Trace, check_march
from ..motions.linearised import Linear
from .adjoint import points_of, scale_of
from .equations import MISFIT, Equations, cavity_of, right_side, unknowns
from .laid import Laid
from .march_films import MarchFilms

MEAN = "mean_"  # of a quantity: its mean over the march, of the steps' ends
GIVEN = ("supply_flow_", "groove_flow_")
HELD = ("t_end", "dt", "tol")
STEPS = "the steps in time are held"


class MarchGradient:
    """As `adjoint.Adjoint`, of a march: quantities at its end, and their means by `mean_`. Collective, as its methods.

    Raises
    ------
    InputError : no converged solution, a march without derivatives, a quantity without one.
    """

    found: Sequence[str] = ()

    def __init__(self, scene: Scene, solution: Solution, quantities: Sequence[str], trace: Trace | None = None):
        if not solution.converged:
            raise InputError(f"{scene.name}: {solution.outcome.sentence}: no solution, no derivatives")
        check_march(scene)
        comm = solution.problem.grid.petsc_comm
        if trace is None or len(trace.steps) != len(solution.history):
            trace = Trace()
            solve(scene, Ask(method=solution.settings.get("method", "auto"), implied=True, comm=comm, watch=trace)).destroy()
        self.scene, self.trace, self.comm, self.names = scene, trace, comm, list(dict.fromkeys(quantities))
        self.reported = solution.problem
        self.lambdas: dict[str, list[Any]] = {name: [None] * (len(trace.steps) + 1) for name in self.names}
        self.left: dict[str, list[Any]] = {name: [None] * (len(trace.steps) + 1) for name in self.names}  # lambda, of contents
        self.course = Course(scene, trace, comm)
        shape = (len(trace.steps) + 1, 2 * self.course.free.size)
        self.journal: dict[str, Array] = {name: np.zeros(shape) for name in self.names}  # of E and V
        self.fed: dict[str, list[Any]] = {name: [np.zeros(0)] * (len(trace.steps) + 1) for name in self.names}  # of supplies
        self.units: dict[int, float] = {}  # of flow, of each step
        self.sizes = dict.fromkeys(self.names, 0.0)
        self.report, self.conditions, self.ties = dict[str, float](), dict[str, float](), dict[str, int]()
        self.switching = 0
        for n in range(len(trace.steps), 0 if self.course.kept(0) is None else -1, -1):
            self._back(n)

    def _asked(self, n: int) -> dict[str, tuple[str, float]]:
        """By quantity the number of step n that it has, and the share of it."""
        last = n == len(self.trace.steps)
        share = self.trace.steps[n - 1].dt / self.trace.steps[-1].t if n else 0.0
        parts = {name: (name.removeprefix(MEAN), share if name.startswith(MEAN) else float(last)) for name in self.names}
        return {name: part for name, part in parts.items() if part[1]}

    def later(self, n: int) -> list[tuple[int, float]]:
        """The steps that keep what step n left, and by what part."""
        N, found = len(self.trace.steps), []
        for m, name in ((n + 1, "last"), (n + 2, "before")):
            if m <= N and (part := getattr(self.course.formula(m), name)):
                found.append((m, part))
        return found

    def kept_on(self, name: str, n: int) -> Array:
        """What later steps make of a content that step n left, by their adjoints."""
        kept = (part * self.left[name][m] / self.units[m] for m, part in self.later(n))
        return sum(kept, np.zeros(self.course.grid.local_size))

    def _back(self, n: int) -> None:
        """The adjoints of step n, from those of later ones."""
        eq, kept = self.course.at(n), self.course.solved(n)
        p, r, asked = kept.p, kept.r, self._asked(n)
        if asked:
            self.course.layers[n] = layers(eq.problem(p), r)
        numbers, grid = eq.numbers(p, r, None if asked else self.course.forces), eq.grid
        told = eq.report(numbers)
        for name, (base, share) in asked.items():
            self.report[name] = self.report.get(name, 0.0) + share * told.get(base, np.nan)
        if n == len(self.trace.steps):
            self.report = told | self.report
        cavity, switching = cavity_of(eq, p, r)
        self.switching += int(grid.reduce.sum(switching.astype(float)))
        parts = {
            name: {part: share * w for part, w in eq.partials(numbers, base).items()} for name, (base, share) in asked.items()
        }
        forces = [name for name, found in zip(self.course.forces, self.course.sought(n), strict=True) if found]
        slopes = {part: eq.slope(p, r, part) for part in dict.fromkeys([*(q for one in parts.values() for q in one), *forces])}
        later = self.later(n)
        of_full = 0.0 if eq.law is None else (1.0 - r) * eq.law.density_slope(p) * eq.constant.p_unit
        left = 2.0 * grid.spacing[0] * point_weights(grid) * mean_film(grid, self.course.film(n).film).ravel()
        left *= np.where(cavity, 1.0, of_full)  # of the content, by z
        rows = {name: right_side(slopes, parts.get(name, {}), cavity) + left * self.kept_on(name, n) for name in self.names}
        problem = eq.problem(p)
        entries = None if eq.law is None else eq.tangent(p, r).entries(problem.scheme)
        linear = Linear(problem, cavity, entries, eq.held)
        z = unknowns(cavity, p, r, problem.p_unit)
        some = [*rows.values(), *(right_side(slopes, {force: 1.0}, cavity) for force in forces)]
        off = [eq.partials(numbers, name) for name in told if name.startswith(MISFIT)]
        by_flow = {part: eq.slope(p, r, part) for part in dict.fromkeys(part for one in off for part in one)}
        some += [right_side(by_flow, one, cavity) for one in off]
        solved = linear.solve_transposed(some, z)
        linear.destroy()
        self.units[n] = problem.scheme.flow_unit
        found = dict(zip(rows, solved, strict=False))
        pushed, off_by = solved[len(rows) : len(rows) + len(forces)], solved[len(rows) + len(forces) :]
        if forces or off:
            self._follow(n, found, pushed, off_by, later)
        terms = eq.terms(p, list(found.values()))
        for (name, one), driven in zip(found.items(), terms.tolist(), strict=True):
            self.lambdas[name][n] = self.left[name][n] = one
            if eq.given is not None:  # what was left in a supply is missing in what it gives
                gives = {part: -w for part, w in parts.get(name, {}).items() if part.startswith(GIVEN)}
                for fed, by in zip(self.fed[name][n], off, strict=True):
                    gives |= {part: gives.get(part, 0.0) + fed * w for part, w in by.items()}
                own = sum((w * giving_points(problem, part) for part, w in gives.items()), np.zeros(one.size))
                self.left[name][n] = np.where(eq.given, volume_unit(problem) * own, one)
            size = sum(abs(w * numbers[part]) for part, w in parts.get(name, {}).items())
            self.sizes[name] += size + driven
        eq.destroy()

    def _follow(
        self, n: int, found: dict[str, Array], pushed: list[Array], off_by: list[Array], later: list[tuple[int, float]]
    ) -> None:
        """Adjoints of E_n and V_n of what is free, and of M_n; those of the film with them.

        pushed, off_by : J'^-1 of the forces on what is free, and of what supplies and film disagree by.
        """
        course, kept, dot = self.course, self.course.solved(n), self.course.grid.reduce.dot
        weight, at, count = course.formula(n).weight if n else 0.0, np.flatnonzero(course.sought(n)), course.free.size
        inertia = course.inertia[at]
        size = course.by_film(n)
        by = course.by_followed(n, at, self.units[n])
        C = np.zeros((len(by), len(by)))  # of what follows, by the conditions
        for row, (G, _, told) in zip(C, by, strict=True):
            misfits = [value for name, value in told.items() if name.startswith(MISFIT)]
            row[: at.size] = [dot(one, G) for one in pushed]
            row[at.size :] = [value - dot(one, G) for value, one in zip(misfits, off_by, strict=True)]
        C[: at.size, : at.size] += np.diag(inertia * weight**2)
        if not np.linalg.det(C):
            raise InputError(f"{self.scene.name}: t = {kept.t:.6g} s: the film bears nothing: no derivatives of what it bears")
        for name in self.names:
            mu, nu = (sum((part * self.journal[name][m, k + at] for m, part in later), np.zeros(at.size)) for k in (0, count))
            kept_on = self.kept_on(name, n)
            base, share = self._asked(n).get(name, ("", 0.0))
            own = [share * told.get(base, 0.0) - dot(found[name], G) + dot(kept_on, size * h) for G, h, told in by]
            own[: at.size] += weight * inertia * mu - nu
            one, fed = np.split(np.linalg.solve(C, own), [at.size])
            self.journal[name][n, at] = one
            self.journal[name][n, count + at] = inertia * (mu - weight * one) * (n > 0)  # speeds at t = 0 are given
            self.fed[name][n] = fed
            found[name] = found[name] + sum(part * answer for part, answer in zip(one, pushed, strict=True))
            found[name] = found[name] - sum(part * answer for part, answer in zip(fed, off_by, strict=True))

    def parts(self, n: int, eq: Equations) -> dict[str, dict[str, float]]:
        """By quantity the numbers of step n, and the shares of them, that it and what its supplies ask for are made of."""
        kept = self.course.solved(n)
        numbers, asked = eq.numbers(kept.p, kept.r), self._asked(n)
        off = [eq.partials(numbers, name) for name in eq.report(numbers) if name.startswith(MISFIT)]
        out: dict[str, dict[str, float]] = {name: {} for name in self.names}
        for name, of in out.items():
            base, share = asked.get(name, ("", 0.0))
            mine = [(share, eq.partials(numbers, base))] if base else []
            for w, found in [*mine, *zip(-self.fed[name][n], off, strict=True)]:
                for part, value in found.items():
                    of[part] = of.get(part, 0.0) + w * value
        return out

    def _scaled(self, n: int, eq: Equations) -> Array:
        """G of step n in the units of its adjoints."""
        kept = self.course.solved(n)
        return eq.scaled(kept.p, kept.r, self.units[n])

    def lagrangians(self, course: Course) -> Array:
        """Q minus what the adjoints make of all equations, of a scene near by, what was solved for held. Collective."""
        total = dict.fromkeys(self.names, 0.0)
        start, free = course.begun[1][course.free], course.forces  # of what is free, which is held later
        quick = None if self._films is None else self._films.sums(course)
        for n in range(1 if self.course.kept(0) is None else 0, len(self.trace.steps) + 1):
            asked = self._asked(n)
            if quick is not None and n and not asked:
                continue
            eq, kept, dot = course.at(n), course.solved(n), course.grid.reduce.dot
            numbers = eq.numbers(kept.p, kept.r, None if asked else free)
            told = eq.report(numbers)
            for name, (base, share) in asked.items():
                total[name] += share * told[base]
            if quick is not None and n:
                eq.destroy()
                continue
            G = self._scaled(n, eq)
            rest = np.zeros(2 * len(free))
            if free:
                rest[: len(free)] = [-numbers[name] for name in free]
            if free and n:
                own, at = self.speeds[n], [*self.speeds[1:n][::-1], start]
                formula = course.formula(n)
                rest[: len(free)] += course.inertia * (formula.weight * own - formula.old(at)) - course.load(kept.t)
                rest[len(free) :] = own - course.speed(n)
            off = np.array([value for name, value in told.items() if name.startswith(MISFIT)])
            for name in self.names:
                total[name] -= dot(self.lambdas[name][n], G) + float(self.journal[name][n] @ rest)
                total[name] -= float(self.fed[name][n] @ off)
            eq.destroy()
        return np.array([total[name] for name in self.names]) - (0.0 if quick is None else quick)

    @cached_property
    def _films(self) -> MarchFilms | None:
        return MarchFilms(self.course, self.lambdas, self.units) if MarchFilms.can(self.course) else None

    @cached_property
    def _laid(self) -> Laid:
        return Laid(self.course.alone, self.course.grid.shape)

    @cached_property
    def speeds(self) -> list[Array]:
        """Of what is free at the end of each step, the first at t = 0, clearances per second; of a level m/s."""
        course = self.course
        return [course.begun[1][course.free], *(course.speed(n) for n in range(1, len(self.trace.steps) + 1))]

    @cached_property
    def _here(self) -> Array:
        return self.lagrangians(self.course)

    def value(self, key: str) -> float:
        return values_of(self.scene)[key]

    def slopes(self, key: str) -> tuple[dict[str, float], dict[str, float], dict[str, float]]:
        """dQ/da, the difference between both sides, and an estimate of the error, by quantity. Collective.

        Raises
        ------
        InputError : no scene on either side.
        """
        if key.removeprefix("motion.") in HELD:
            raise InputError(STEPS)
        value, last, steps = self.value(key), self.trace.steps[-1], list[float]()

        def at(a: float) -> Array:
            if a == value:
                return self._here
            course = Course(with_values(self.scene, {key: a}), self.trace, self.comm, self.course)
            try:
                if self._laid.anew(course.alone):
                    steps.append(a)
                if course.grid.shape != self.course.grid.shape:
                    raise InputError("the grid has another number of points")
                return self.lagrangians(course)
            finally:
                course.destroy()

        scale = abs(value)
        if not scale:
            eq = self.course.at(len(self.trace.steps))
            scale = scale_of(self.scene, key, eq.constant, last.p)
            eq.destroy()
        sizes = np.array([self.sizes[name] for name in self.names])
        found = differences(at, value, scale, sizes, bool(oblique(self.course.first.gap)), points_of(self.course.grid))
        slope, jump, error = (dict(zip(self.names, map(float, one), strict=True)) for one in found)
        anew = any(abs(a - value) <= 2.0 * QUICK * scale for a in steps)
        return slope, dict.fromkeys(jump, np.inf) if anew else jump, error

    def destroy(self) -> None:
        self.course.destroy()


def means(history: Sequence[dict[str, Any]]) -> dict[str, float]:
    """Those over a march, of what its history has."""
    t_end = sum(row["dt"] for row in history)
    numbers = [name for name, value in (history[-1] if history else {}).items() if isinstance(value, float)]
    return {MEAN + name: sum(row["dt"] * row[name] for row in history) / t_end for name in numbers}
