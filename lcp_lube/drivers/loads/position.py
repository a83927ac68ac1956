"""Where a journal lies under a load of given size, and direction too where its attitude is open: Newton's method with the
film's exact stiffness.

Unknowns are t = log(s/(1 - s)) of s = e/e_touch, the eccentricity in parts of that at which the journal touches its bore, in
which the logarithm of the load is nearly linear, and the attitude; the equations are log(W/load) = 0 and that the force lies
in the load's line. The stiffness matrix of the film (`coefficients`) gives their derivatives, so a handful of solves do, each
started from the last; coarse grids come first, where they cost next to nothing. Where none is found on one of them with the
attitude open, as with a groove near the load, places all round are looked at on the coarsest (`winding`), and the likeliest are
followed through all grids. Where none is found, the answer is the place at which least of the load is left.
"""

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from ...base.parallel import Array
from ...errors import NotFound
from ...problems.film.quantities import shaft_force
from ...problems.solution import Outcome, Solution
from ...scenes.effects.named import named, without
from ...scenes.grooved import GroovedJournalScene
from ...scenes.scene import Solvable
from ..ask import Ask
from ..chain import Chain
from ..compose import Inner
from ..levels import halved
from ..motions.coefficients import by_film, motions_of, placed
from ..motions.impedance import stiffness
from .attitude import half_film_attitude
from .place import WIDEST, eccentricity, half_film_eccentricity, moved, moves_of, place_of, touching
from .winding import places

MOST_SOLVES = 25  # on a grid
ENOUGH = 3e-4  # of GMRES for what effects make of a stiffness: a fifth less time than to all digits, in as many solves
COARSEST, COARSE_TOL = (36, 7), 1e-2  # fewest points around and across, and how well a coarse grid's place is worth knowing
SEEN = 0.5  # largest mesh, in parts of the stretch sqrt(2 (1 - s)) on which the film is thin
MOST_COARSE = 8  # solves on a grid that is not the last
LONGEST = (2.0, 0.4)  # of a step in t and in the attitude (rad)
MOST_FAILED = 4  # solves without an answer on a grid, from each of which half of the step is taken
RETREAT = np.array([0.7, 0.0])  # from a first place without an answer: some twice the thinnest film
SHORTEST = 1e-4  # of a step that was halved
AWRY = 0.7  # rad off the load's line, beyond which the force is extrapolated linearly, not its logarithm
ACROSS = 0.4  # longest such step, clearances
HELD = 0.5  # part of the force that is there without eccentricity: from that on likewise


def applies(scene: Solvable, ask: Ask) -> bool:
    """Whether it is a journal of which load and direction are given, and its place is sought."""
    return isinstance(scene, GroovedJournalScene) and scene.balance is not None


def solve(scene: Solvable, ask: Ask, inner: Inner) -> Solution:
    """The solution at the place where the film's force is opposite to the load. Collective.

    Returns
    -------
    Solution : settings['balance'] as of any balance; where no place carries the load, outcome LOAD_NOT_CARRIED.
    """
    assert isinstance(scene, GroovedJournalScene)  # as `applies` found
    search = _Search(scene, replace(ask, alone=False), inner)
    search.through(search.begin)
    if not search.found and search.elsewhere:
        search.look_around()
    if not search.found and search.best.q is not None:
        search.at_best()
    return search.told()


class _Search:
    """A place sought on grids from coarse to fine: where it has got to (solution, q = t and attitude), and whether found.

    best : of the last grid. elsewhere : whether other places may be tried. counts : solves on each grid.
    """

    solution: Solution
    found = False

    def __init__(self, scene: GroovedJournalScene, ask: Ask, inner: Inner):
        assert scene.balance is not None  # as `applies` found
        self.scene, self.ask, self.inner, self.table = scene, ask, inner, scene.balance
        self.free = scene.model_copy(update={"balance": None})
        known, load = ask.start.settings if ask.start is not None else {}, self.table.load
        guess = half_film_eccentricity(scene.turning, scene.mu_0, load)
        phi = math.radians(known.get("attitude_deg", scene.attitude_deg or 0.0))
        if scene.attitude_deg is None and "attitude_deg" not in known:
            phi = half_film_attitude(guess)
        value = known.get("balance", {}).get("value")
        s = guess if value is None else value / touching(scene, phi)
        self.begin = self.q = np.array([math.log(max(s, 1e-3) / max(1.0 - s, 1e-6)), phi])
        nested = ask.nested is not False and (not known or "foretold" in known.get("balance", {}))
        self.shapes = _coarse(scene, s) if nested else [scene.shape]
        self.counts, self.best = np.zeros(len(self.shapes), dtype=int), _Best()
        self.elsewhere = not known and scene.shape[0] >= _fewest(scene, s)

    def through(self, q: Array) -> None:
        """From a place on the coarsest grid through all, or to the first where none is found if others may be tried."""
        near = self.ask.start
        for k, shape in enumerate(self.shapes):
            tol, most, seen = self.table.tol, MOST_SOLVES, self.best
            if shape != self.shapes[-1]:
                tol, most, seen = max(tol, COARSE_TOL), MOST_COARSE, _Best()
            at, ask = self.free.with_shape(shape), replace(self.ask, start=near)
            self.solution, q, count, self.found = _on_grid(at, ask, self.inner, q, self.table.load, tol, most, seen)
            self.counts[k] += count
            if near is not None and near is not self.ask.start:
                near.destroy()  # type: ignore[union-attr]
            near, self.q = self.solution, q
            if not self.found and self.elsewhere:
                break

    def look_around(self) -> None:
        """From the likeliest of places all round on the coarsest grid, one after another until one leads to the end."""
        self.solution.destroy()
        chain, given = Chain(replace(self.ask, start=None), self.inner), self.scene.attitude_deg is not None

        def left_at(t: float, phi: float) -> complex:
            self.solution = chain.solve(moved(self.free.with_shape(self.shapes[0]), max(t, -WIDEST), phi))
            fx, fy = shaft_force(self.solution.problem, self.solution.fields)
            force = complex(-math.hypot(fx, fy), 0.0) if given else complex(fx, fy)
            return 1.0 + force / self.table.load if self.solution.converged else complex(math.nan, math.nan)

        likely, count = places(left_at, self.begin[0], self.begin[1] if given else None)
        self.counts[0] += count
        for q in likely:
            self.solution.destroy()
            self.through(q)
            if self.found:
                break
        self.elsewhere = False
        if not self.found and self.best.q is None:  # the last grid was not met
            self.solution.destroy()
            self.through(likely[0] if likely else self.begin)

    def at_best(self) -> None:
        """To the place at which least of the load is left."""
        assert self.best.q is not None  # as the caller found
        self.q = self.best.q
        self.solution.destroy()
        self.solution = self.inner(moved(self.free, *self.q), self.ask)
        self.counts[-1] += 1

    def told(self) -> Solution:
        """The solution, with what was found of the load."""
        (t, phi), solution, load, counts = self.q, self.solution, self.table.load, self.counts.tolist()
        work = sum(n * math.prod(s) for n, s in zip(counts, self.shapes, strict=True)) / math.prod(self.shapes[-1])
        carried = solution.problem.quantities(solution.fields)["load"]
        value = eccentricity(self.scene, t, phi)
        answer = f"eccentricity = {value:.8g} at {math.degrees(phi):.6g} degrees carries {carried:.8g}"
        if solution.converged and not self.found:
            solution.outcome = Outcome.LOAD_NOT_CARRIED
            solution.message = f"{load:g} asked for; the nearest: {answer}, |F + W| = {self.best.miss:.3g} W"
        record = {"vary": "eccentricity", "value": value, "load": load, "carried": carried}
        solution.settings |= {
            "balance": record | {"iterations": counts[-1], "solves": sum(counts), "work": work},
            "attitude_deg": math.degrees(phi),
        }
        solution.because(f"balance: {answer}, found in {counts[-1]} solves on this grid, {sum(counts)} in all", after=True)
        return solution


@dataclass
class _Best:
    """The place that came nearest: what is left of the load over the load, there."""

    q: Array | None = None
    miss: float = math.inf

    def add(self, q: Array, force: Array, load: float, given: bool) -> None:
        miss = abs(float(np.hypot(*force)) / load - 1.0) if given else math.hypot(force[0] / load + 1.0, force[1] / load)
        if miss < self.miss:
            self.q, self.miss = q, miss


def _fewest(scene: GroovedJournalScene, s: float) -> float:
    """Points around of a grid with a few on the stretch where the film is thin at s."""
    return max(COARSEST[0], 12 * len(scene.grooves_deg), 2.0 * math.pi / (SEEN * math.sqrt(2.0 * (1.0 - s))))


def _coarse(scene: GroovedJournalScene, s: float) -> list[tuple[int, ...]]:
    """Grids from coarse to fine."""
    shapes, fewest = [scene.shape], math.ceil(_fewest(scene, s))
    while (coarser := halved(shapes[0], fewest, 2 * COARSEST[1])) is not None:
        shapes.insert(0, coarser)
    return shapes


def _on_grid(
    scene: Any, ask: Ask, inner: Inner, q: Array, load: float, tol: float, most: int, best: _Best
) -> tuple[Solution, Array, int, bool]:
    """Newton's method on one grid: solution, t and attitude, number of solves, whether the place was found. Collective.

    A step that makes residuals larger, or leads to where no film is found, is taken again, half as long.
    """
    chain, given = Chain(ask, inner), scene.attitude_deg is not None
    before, failed = None, 0  # before : place, residual and step
    for count in range(1, most + 1):
        t, phi = map(float, q)
        at = moved(scene, t, phi)
        solution = chain.solve(at)
        if not solution.converged:
            failed += 1
            if count == most or failed > MOST_FAILED or (before is None and t < 0.0):
                return solution, q, count, False
            solution.destroy()
            chain = Chain(replace(ask, start=None), inner)
            if before is not None:
                before = (before[0], before[1], 0.5 * before[2])
            # At first the film alone was taken to carry the load: asperities may, farther from the bore.
            q = q - RETREAT if before is None else before[0] + before[2]
            continue
        force: Array = np.array(shaft_force(solution.problem, solution.fields))
        best.add(q, force, load, given)
        W = float(np.hypot(*force))
        off = math.atan2(-force[1], -force[0])
        left = np.array([math.log(W / load) if W > 0 else -math.inf, 0.0 if given else off])
        if np.abs(left).max() <= tol:
            return solution, q, count, True
        if count == most or (abs(t) >= WIDEST and left[0] * t < 0):
            return solution, q, count, False
        if not W > 0 and (before is None or before[1][0] == -math.inf):
            step = np.array([LONGEST[0], 0.0])
        elif before is not None and np.abs(left).sum() > np.abs(before[1]).sum():
            q, left, step = before[0], before[1], 0.5 * before[2]
            if np.abs(step).max() < SHORTEST:
                return solution, q + 2.0 * step, count, False
        else:
            K = _stiffness(at, solution)
            still = force + K @ place_of(scene, t, phi)  # that of the supplies alone
            supplied = not given and not at.model.effects and t < 0 and np.hypot(*still) > HELD * W
            if abs(left[1]) > AWRY or supplied:
                q, before = _across(scene, t, phi, K, np.array([force[0] + load, force[1]])), None
                continue
            change = -K @ moves_of(scene, t, phi)
            jacobian = np.stack([force @ change, force[0] * change[1] - force[1] * change[0]]) / W**2
            if given:
                jacobian[:, 1], jacobian[1] = 0.0, [0.0, 1.0]
            inverse = _inverse(jacobian)
            step = -inverse @ left
            if before is not None:  # what residuals bend by along the step before
                size = float(before[2] @ before[2])
                bend = (before[1] - left + jacobian @ before[2]) * (float(step @ before[2]) / size) ** 2
                bent = inverse @ bend
                step = step - bent if np.abs(bent).max() < 0.5 * np.abs(step).max() else step
            step = np.clip(step, [-LONGEST[0], -LONGEST[1]], LONGEST)
        before = (q, left, step)
        q = q + step
        q[0] = min(max(q[0], -WIDEST), WIDEST)
    raise AssertionError("the loop returns")


def _across(scene: Any, t: float, phi: float, K: Array, left: Array) -> Array:
    """The journal's next place if forces (N) change linearly, as they do near the place without load."""
    step = np.linalg.lstsq(K * scene.clearance, left, rcond=None)[0]
    at = eccentricity(scene, t, phi) * np.array([math.cos(phi), math.sin(phi)])
    at += step * min(1.0, ACROSS / float(np.hypot(*step)))
    phi, s = math.atan2(at[1], at[0]), 1.0 / (1.0 + math.exp(-t))
    s = min(max(float(np.hypot(*at)) / touching(scene, phi), 1e-6), 0.5 * (s + 1.0))  # at most half the way to the bore
    return np.array([math.log(s / (1.0 - s)), phi])


def _stiffness(at: Any, solution: Solution) -> Array:
    """K in the axes of the load. Collective."""
    at = placed(at, solution)
    motions, nearly = motions_of(at.turning, False, 0.0), partial(stiffness, rtol=ENOUGH)
    try:
        return by_film(nearly, at, solution, motions)
    except NotFound:  # with the effects' part; then without it
        return by_film(nearly, without(at, named(at)), solution, motions)


def _inverse(jacobian: Array) -> Array:
    """Of the derivatives of log W and of the force's angle in t and in the attitude; where there is none, that of a line."""
    return np.linalg.inv(jacobian) if abs(np.linalg.det(jacobian)) > 1e-12 else np.diag([0.5, 1.0])
