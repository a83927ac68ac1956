"""The attitude at which a journal's film holds up a load of given direction: a secant iteration on the force's angle."""

import math

from ..problems.solution import Outcome, Solution
from ..scenes.grooved import GroovedJournalScene
from ..scenes.moving import motion_of
from ..scenes.scene import Solvable
from .ask import Ask
from .chain import Chain
from .compose import Inner

MOST_SOLVES = 20
TOLERANCE, PART = 1e-9, 0.1  # rad: the force across the load is then 1e-9 of it; of an eps1 that was given
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
    before: tuple[float, float] | None = None
    slope, tol = 1.0, max(TOLERANCE, PART * ask.stopping_for((0.0, 0.0)).eps1)
    for _ in range(MOST_SOLVES):
        solution = chain.solve(scene.model_copy(update={"attitude_deg": math.degrees(attitude)}))
        if not solution.converged:
            break
        fx, fy = solution.problem.quantities(solution.fields)["force"]
        off = math.atan2(-fy, -fx)
        if before is not None and attitude != before[0]:
            slope = min(max((off - before[1]) / (attitude - before[0]), FLATTEST), STEEPEST)
        if abs(off) <= tol:
            break
        before = (attitude, off)
        attitude -= off / slope
    if solution.converged and abs(off) > tol:
        solution.outcome = Outcome.LOAD_NOT_CARRIED
        solution.message = (
            f"at eccentricity {scene.eccentricity:g} no attitude was found at which the film pushes against the load: the last "
            f"force, at {math.degrees(attitude) % 360.0:.4g} degrees, is {math.degrees(abs(off)):.3g} degrees off"
        )
    solution.settings |= {"attitude_deg": math.degrees(attitude)}
    solution.because(f"attitude {math.degrees(attitude):.6g} degrees, at which the film's force is opposite to the load")
    return solution
