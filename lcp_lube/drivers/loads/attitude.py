"""The attitude at which a journal's film holds up a load of given direction: a secant iteration on the force's angle.

Oil under pressure in grooves may turn the force back where the attitude goes on: then secants of the slope that journals have
lead nowhere, and the attitude is sought between two, all round, from one to the other of which the angle changes its sign.
"""

import math
from collections.abc import Callable
from itertools import pairwise

from ...problems.film.quantities import shaft_force
from ...problems.solution import Outcome, Solution
from ...scenes.grooved import GroovedJournalScene
from ...scenes.moving import motion_of
from ...scenes.scene import Solvable
from ..ask import Ask
from ..chain import Chain
from ..compose import Inner
from .root import Search

MOST_SOLVES, MOST_BETWEEN = 12, 20  # ends of searches that go round; by secants, then within a bracket
AROUND = 12  # attitudes, all round
TOLERANCE, PART = 1e-9, 0.1  # rad: the force across the load is then 1e-9 of it; of an eps1 that was given
JUMP = 1e-3  # rad: as cells fill and empty the force's angle may jump past the load's line; by so little it is there
STEEPEST, FLATTEST = 2.0, 0.3  # slope of the force's angle over the attitude; without grooves it is 1


def applies(scene: Solvable, ask: Ask) -> bool:
    """Whether the attitude is left open."""
    open_ = isinstance(scene, GroovedJournalScene) and scene.attitude_deg is None and scene.balance is None
    return open_ and motion_of(scene) is None


def half_film_attitude(e: float) -> float:
    """The attitude of a short journal with half a film (Ocvirk), as a start, rad."""
    return math.atan2(0.25 * math.pi * math.sqrt(1.0 - e * e), max(e, 1e-3))


def solve(scene: Solvable, ask: Ask, inner: Inner) -> Solution:
    """The solution at the attitude that follows from the load's direction. Collective."""
    assert isinstance(scene, GroovedJournalScene)
    known = ask.start.settings.get("attitude_deg") if ask.start is not None else None
    attitude = math.radians(known) if known is not None else half_film_attitude(scene.eccentricity)
    chain = Chain(ask, inner)
    slope, tol = 1.0, max(TOLERANCE, PART * ask.stopping_for((0.0, 0.0)).eps1, ask.digits)

    def off_at(attitude: float) -> tuple[Solution, float]:
        """The solution, and how far the force is from the load's line, rad; NaN without a film."""
        solution = chain.solve(scene.model_copy(update={"attitude_deg": math.degrees(attitude)}))
        fx, fy = shaft_force(solution.problem, solution.fields)
        return solution, math.atan2(-fy, -fx) if solution.converged else math.nan

    before: tuple[float, float] | None = None
    for _ in range(MOST_SOLVES):
        solution, off = off_at(attitude)
        if before is not None and attitude != before[0]:
            slope = min(max((off - before[1]) / (attitude - before[0]), FLATTEST), STEEPEST)
        if not abs(off) > tol:
            break
        before = (attitude, off)
        attitude -= off / slope
    if abs(off) > tol:
        solution, attitude, off = _around(off_at, attitude, tol)
    jumps = f", but for a jump of its angle, {math.degrees(abs(off)):.1g} degrees off" if tol < abs(off) <= JUMP else ""
    if solution.converged and abs(off) > max(tol, JUMP):
        solution.outcome = Outcome.LOAD_NOT_CARRIED
        solution.message = (
            f"at eccentricity {scene.eccentricity:g} no attitude was found at which the film pushes against the load: the last "
            f"force, at {math.degrees(attitude) % 360.0:.4g} degrees, is {math.degrees(abs(off)):.3g} degrees off"
        )
    solution.settings |= {"attitude_deg": math.degrees(attitude)}
    solution.because(f"attitude {math.degrees(attitude):.6g} degrees, at which the film's force is opposite to the load{jumps}")
    return solution


def _around(off_at: Callable[[float], tuple[Solution, float]], attitude: float, tol: float) -> tuple[Solution, float, float]:
    """The attitude between two of which the angle changes its sign, best where it rises. Collective."""
    attitude = math.remainder(attitude, 2.0 * math.pi)
    places = [attitude + 2.0 * math.pi * k / AROUND for k in range(AROUND + 1)]
    found = [(place, off_at(place)[1]) for place in places[:-1]]
    found.append((places[-1], found[0][1]))
    pairs = [(a, b) for a, b in pairwise(found) if a[1] * b[1] <= 0.0 and abs(a[1] - b[1]) < math.pi]
    if not pairs:
        solution, off = off_at(attitude)
        return solution, attitude, off
    (a, at_a), (b, at_b) = max(pairs, key=lambda pair: pair[1][1] - pair[0][1])
    search = Search(a, b, 1.0, explore=False, points=[(a, at_a), (b, at_b)])
    for _ in range(MOST_BETWEEN):
        if (target := search.next()) is None:
            break
        solution, off = off_at(attitude := target)
        if not abs(off) > tol:
            break
        search.add(attitude, off)
    return solution, attitude, off
