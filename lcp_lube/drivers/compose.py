"""How drivers nest: each solves a scene by solving others through the next one, down to the direct solve of one problem.

A driver is a module with two functions: `applies(scene, ask)`, and `solve(scene, ask, inner) -> Solution`, which calls
`inner(scene', ask')` as often as it needs and merges what comes back. Data goes down as scene and ask, up as a solution.
"""

from collections.abc import Callable
from functools import partial

from ..errors import InputError
from ..problems.solution import Solution
from ..registry import DRIVERS
from ..scenes.scene import Solvable
from .ask import Ask

Inner = Callable[[Solvable, Ask], Solution]


def solve(scene: Solvable, ask: Ask, level: int = 0) -> Solution:
    """Solve through the drivers from this level on that the scene and the ask call for, outermost first. Collective."""
    for k, name in list(enumerate(DRIVERS))[level:]:
        if DRIVERS[name].idle(scene):
            continue
        driver = DRIVERS[name].load()
        if driver.applies(scene, ask):
            return driver.solve(scene, ask, partial(solve, level=k + 1))
    raise AssertionError("the innermost driver applies to everything")


def _no_file(name: str, reason: str) -> list[tuple[str, str, str]]:
    return [(name, option, reason) for option in ("checkpoint", "resume")]


NO_FILM = "it is no film with cavitation, for which alone the theorem holds"
# What does not compose, and why: (a driver that applies, or a kind of problem; an attribute of the ask; the reason).
CANNOT = (
    *((kind, "certify", NO_FILM) for kind in ("box", "equations", "mixed", "user")),
    *_no_file("user", "its functions are no data that a file could hold"),
    ("user", "accuracy", "its points are its own, and no grid's that could be refined"),
    *_no_file("accuracy", "its many grids make one answer; give --n for one grid"),
    *_no_file("balance", "its many solves make one answer; give the value that was found for one solve"),
    *_no_file("pads", "its many solves make one answer; give the place and the tilts that were found for one solve"),
    *_no_file("position", "its many solves make one answer; give the eccentricity that was found for one solve"),
    ("time", "certify", "it goes on in time, and the theorem is of one steady film"),
    ("time", "nested", "it goes on in time, each step from the one before, on one grid"),
    *_no_file("grooves", "its films are solved one by one"),
    *_no_file("supplies", "its many solves make one answer; give the pressures that were found for one solve"),
    *_no_file("turned", "U < 0 is solved as its mirror image; give that, with -U"),
)


def check(scene: Solvable, ask: Ask) -> None:
    """Refuse what does not compose.

    Raises
    ------
    InputError : names the option, the scene, and the reason.
    """
    kind, order = getattr(scene, "problem_kind", ""), [*DRIVERS]
    marches = getattr(scene, "motion", None) is not None  # which has checkpoints of its own, whatever solves its steps
    for name, option, reason in CANNOT:
        if marches and option in ("checkpoint", "resume") and name in order[order.index("time") :]:
            continue
        if getattr(ask, option) and (DRIVERS[name].load().applies(scene, ask) if name in DRIVERS else name == kind):
            raise InputError(f"--{option}: not for scene {scene.name} ({name}): {reason}")
