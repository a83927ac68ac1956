"""Design: the numbers of a scene, within bounds, that make one of its results largest or smallest, others kept to limits.

SciPy's L-BFGS-B, with limits on other results SLSQP, on exact gradients (`drivers.gradient`): one solve and one transposed
solve a quantity for every design, each started from the last. Every design is a row of a csv; one that is there is not solved
again, so that a run that was stopped goes on where it was.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from hashlib import sha256
from math import isfinite
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from ..api import solve
from ..base.parallel import Array
from ..base.progress import duration
from ..base.quantity import quantity as read
from ..base.resumable import ResumableCsv
from ..drivers.ask import Ask
from ..drivers.derivatives.gradient import gradients
from ..drivers.marches.march_course import Trace
from ..errors import InputError
from ..problems.solution import Solution
from ..scenes.moving import motion_of
from ..scenes.scene import Scene
from ..scenes.values import key_of, values_of, with_values

WORSE = 1e3  # of the start's value: what stands for a design that has no solution
STUCK, NEAR = 5, 1e-3  # so many designs so near each other, in parts of the ranges and of the goal: a kink
REST = 1e-9  # relative change of the goal that ends it
INSIDE = 1e-6  # relative to a limit: a design that keeps it so nearly keeps it


@dataclass(frozen=True)
class Limit:
    """quantity <= bound (sign 1) or >= bound (sign -1)."""

    quantity: str
    sign: float
    bound: float

    def excess(self, value: float) -> float:
        """Relative; positive where it is not kept."""
        return self.sign * (value - self.bound) / (abs(self.bound) or 1.0)

    def __str__(self) -> str:
        return f"{self.quantity} {'<=' if self.sign > 0 else '>='} {self.bound:g}"


@dataclass(frozen=True)
class Range:
    """A number of the scene between two values, SI."""

    key: str
    low: float
    high: float


@dataclass(frozen=True)
class Design:
    """One set of numbers, what came out of them, and its derivatives; none where there is no solution."""

    values: dict[str, float]
    results: dict[str, float] = field(default_factory=dict)
    slopes: dict[str, dict[str, float]] = field(default_factory=dict)
    message: str = ""


@dataclass(frozen=True)
class Result:
    """start, best : designs. steps : of the optimiser; designs : that were looked at. converged : whether it came to rest."""

    start: Design
    best: Design
    steps: int
    designs: int
    converged: bool
    message: str


def parse_range(scene: Scene, text: str) -> Range:
    """KEY=FROM:TO with units or in SI; InputError for another form, a key without a derivative, a range that is none."""
    key, equals, rest = (part.strip() for part in text.partition("="))
    ends = [read(part) for part in rest.split(":")]
    if not (key and equals) or len(ends) != 2 or None in ends:
        raise InputError(f"--vary {text}: KEY=FROM:TO is needed")
    units = {one.dimension for one in ends if one is not None and one.unit}
    name = key_of(scene, key.removesuffix("_um").removesuffix("_mm"))
    scale = 1e-6 if key.endswith("_um") else 1e-3 if key.endswith("_mm") else 1.0
    low, high = (scale * one.value for one in ends if one is not None)
    if len(units) > 1 or not (isfinite(low) and isfinite(high) and low < high):
        raise InputError(f"--vary {text}: FROM < TO of one dimension are needed")
    return Range(name, low, high)


def parse_limit(text: str) -> Limit:
    """QUANTITY<=BOUND or QUANTITY>=BOUND, the bound in SI or with a unit; InputError for another form."""
    match = re.fullmatch(r"\s*(\w+)\s*(<=|>=)\s*(.+?)\s*", text)
    bound = read(match[3]) if match else None
    if match is None or bound is None:
        raise InputError(f"--subject {text}: QUANTITY<=BOUND or QUANTITY>=BOUND is needed")
    return Limit(match[1], 1.0 if match[2] == "<=" else -1.0, bound.value)


class Designs:
    """Designs as they are asked for, from the csv or by a solve. Collective."""

    def __init__(
        self, scene: Scene, ranges: Sequence[Range], quantities: Sequence[str], ask: Ask, path: Path | None, most: int
    ):
        self.scene, self.ranges, self.quantities, self.ask = scene, list(ranges), list(dict.fromkeys(quantities)), ask
        self.known: dict[bytes, Design] = {}
        self._near: Solution | None = None
        self._most, self._begin = most, perf_counter()
        self._digest = sha256(f"{scene.model_dump_json()} {self.quantities} {ask.choices}".encode()).hexdigest()[:12]
        self._store = ResumableCsv(path, ["design"], ["design"], ask.mpi, growing=True) if path else None
        if self._store:
            self._store.write()

    def at(self, x: Array) -> Design:
        """The design at numbers from 0, the low ends of the ranges, to 1; those beyond are clipped."""
        x = np.clip(x, 0.0, 1.0).astype(float)
        name = x.tobytes()
        if name not in self.known:
            last = [design for design in self.known.values() if design.results][-1:]
            so_far = "".join(f", {name} {design.results[name]:.4g}" for design in last for name in self.quantities)
            done = len(self.known)
            each = (perf_counter() - self._begin) / max(done, 1)  # its end is not known: after all its steps at the latest
            left = f", {duration(each * max(self._most - done, 1))} left if it takes all {self._most} steps" if done else ""
            self.ask.tell("sweep", f"design {done + 1}{so_far}{left}", 0.0)
            values = {one.key: one.low + float(t) * (one.high - one.low) for one, t in zip(self.ranges, x, strict=True)}
            self.known[name] = self._made(values)
        return self.known[name]

    def slopes(self, design: Design, quantity: str) -> Array:
        """By the numbers between 0 and 1."""
        return np.array([design.slopes[quantity][one.key] * (one.high - one.low) for one in self.ranges])

    def stuck(self, best: Design, goal: str, size: float) -> bool:
        """Whether the last designs lie about the best one, and are hardly worse."""
        last = [one for one in self.known.values() if not one.message][-STUCK:]
        far = max(abs(one.values[r.key] - best.values[r.key]) / (r.high - r.low) for one in last for r in self.ranges)
        worse = max(abs(one.results[goal] - best.results[goal]) for one in last)
        return len(last) == STUCK and far < NEAR and worse < NEAR * size

    def _made(self, values: dict[str, float]) -> Design:
        digest = sha256(f"{self._digest} {list(values.items())}".encode()).hexdigest()[:12]
        row = self._store.find(design=digest) if self._store else None
        if row is None:
            design = self._solved(values)
            if self._store:
                slopes = {f"d {q}/d {k}": v for q, by in design.slopes.items() for k, v in by.items()}
                self._store.add({"design": digest, **values, **design.results, **slopes, "message": design.message})
            return design
        if row["message"]:
            return Design(values, message=row["message"])
        results = {q: float(row[q]) for q in self.quantities}
        return Design(values, results, {q: {k: float(row[f"d {q}/d {k}"]) for k in values} for q in self.quantities})

    def _solved(self, values: dict[str, float]) -> Design:
        try:
            scene = with_values(self.scene, values)
            trace = Trace() if motion_of(scene) is not None else None
            solution = solve(scene, self.ask, start=self._near if trace is None else None, watch=trace)
        except InputError as error:
            return Design(values, message=str(error))
        if not solution.converged:
            solution.destroy()
            return Design(values, message=solution.message)
        if self._near is not None:
            self._near.destroy()
        self._near = solution
        found = gradients(scene, solution, self.quantities, list(values), trace)
        for one in found:
            if missing := next((key for key in values if key not in one.gradient), None):
                raise InputError(f"--vary {missing}: no derivative: {one.held[missing]}")
        slopes = {one.quantity: {key: float(np.nan_to_num(one.gradient[key])) for key in values} for one in found}
        return Design(values, {one.quantity: one.value for one in found}, slopes)

    def destroy(self) -> None:
        if self._near is not None:
            self._near.destroy()


@dataclass
class _Task:
    """What an optimiser asks of designs: their goal, in parts of its size at the start, and what exceeds their limits."""

    designs: Designs
    goal: str
    sign: float
    limits: Sequence[Limit]
    size: float

    def worst(self, design: Design) -> float:
        """By how much a limit is exceeded at most."""
        return max((one.excess(design.results[one.quantity]) for one in self.limits), default=0.0)

    def over(self, t: Array, limit: Limit) -> tuple[float, Array]:
        """By how much a limit is exceeded."""
        design = self.designs.at(t)
        if design.message:
            return WORSE, np.zeros(t.size)
        slope = limit.sign * self.designs.slopes(design, limit.quantity) / (abs(limit.bound) or 1.0)
        return limit.excess(design.results[limit.quantity]), slope

    def excess(self, t: Array) -> tuple[float, Array]:
        """Sum of the squares of what exceeds the limits."""
        if self.designs.at(t).message:
            return WORSE, np.zeros(t.size)
        found = [(max(far, 0.0), slope) for far, slope in (self.over(t, one) for one in self.limits)]
        return sum(far**2 for far, _ in found), sum((2.0 * far * slope for far, slope in found), np.zeros(t.size))

    def cost(self, t: Array) -> tuple[float, Array]:
        """The goal, to be made least."""
        design = self.designs.at(t)
        if design.message:
            return WORSE, np.zeros(t.size)
        slope = self.designs.slopes(design, self.goal)
        return -self.sign * design.results[self.goal] / self.size, -self.sign * slope / self.size

    def rule(self, limit: Limit) -> dict[str, Any]:
        """A limit as scipy has them."""
        return {"type": "ineq", "fun": lambda t: -self.over(t, limit)[0], "jac": lambda t: -self.over(t, limit)[1]}

    def best(self) -> Design | None:
        """Of the designs tried, of those within the limits; None: there is none."""
        feasible = [one for one in self.designs.known.values() if not one.message and self.worst(one) <= INSIDE]
        return max(feasible, key=lambda one: self.sign * one.results[self.goal], default=None)


def optimise(
    scene: Scene,
    goal: str,
    sign: float,
    ranges: Sequence[Range],
    limits: Sequence[Limit] = (),
    *,
    ask: Ask | None = None,
    history: Path | None = None,
    most: int = 100,
) -> Result:
    """The design with the largest (sign 1) or smallest (-1) value of a quantity. Collective.

    Parameters
    ----------
    history : csv of all designs. most : steps of the optimiser at most.

    Raises
    ------
    InputError : nothing to vary, a quantity without a derivative, a start without a solution, limits that none of the designs
        tried on the way keeps.
    """
    from scipy.optimize import minimize  # here: it takes a while

    if not ranges:
        raise InputError("--vary KEY=FROM:TO is needed: what may change")
    if len({one.key for one in ranges}) < len(ranges):
        raise InputError("--vary: a key is given twice")
    designs = Designs(scene, ranges, [goal, *(one.quantity for one in limits)], ask or Ask(), history, most)
    known = values_of(scene)
    x = np.array([min(max((known[one.key] - one.low) / (one.high - one.low), 0.0), 1.0) for one in ranges])
    find: Callable[..., Any] = partial(minimize, jac=True, bounds=[(0.0, 1.0)] * len(ranges))
    try:
        start = designs.at(x)
        if start.message:
            raise InputError(f"no start: {', '.join(f'{k} = {v:g}' for k, v in start.values.items())}: {start.message}")
        task = _Task(designs, goal, sign, limits, abs(start.results[goal]) or 1.0)
        if task.worst(start) > INSIDE:  # first into the limits
            x = np.clip(find(task.excess, x, method="L-BFGS-B", options={"maxiter": most}).x, 0.0, 1.0)
            design = designs.at(x)
            if design.message or task.worst(design) > 1e-3:
                off = [f"{one} ({design.results.get(one.quantity, np.nan):.6g})" for one in limits]
                raise InputError(f"no feasible start: no design within the ranges was found that keeps {', '.join(off)}")
        rules = [task.rule(one) for one in limits]
        how: dict[str, Any] = {"method": "SLSQP", "constraints": rules} if rules else {"method": "L-BFGS-B"}
        done = find(task.cost, x, options={"maxiter": most, "ftol": REST}, **how)
        best = task.best()
        if best is None:
            return Result(start, designs.at(done.x), int(done.nit), len(designs.known), False, "the limits are not kept")
        converged, message = bool(done.success), str(done.message)
        if not converged and designs.stuck(best, goal, task.size):
            converged, message = True, "at a kink: no step improves it"
        return Result(start, best, int(done.nit), len(designs.known), converged, message)
    finally:
        designs.destroy()
