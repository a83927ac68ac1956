"""How drivers nest: each solves a scene by solving others through the next one, down to the direct solve of one problem.

A driver is a module with two functions: `applies(scene, ask)`, and `solve(scene, ask, inner) -> Solution`, which calls
`inner(scene', ask')` as often as it needs and merges what comes back. Data goes down as scene and ask, up as a solution.
"""

from collections.abc import Callable
from functools import partial
from typing import Protocol

from ..errors import InputError
from ..problems.solution import Solution
from ..registry import DRIVERS
from ..scenes.scene import Solvable
from .ask import Ask

Inner = Callable[[Solvable, Ask], Solution]


class Driver(Protocol):
    """What a module among the drivers offers."""

    def applies(self, scene: Solvable, ask: Ask) -> bool: ...

    def solve(self, scene: Solvable, ask: Ask, inner: Inner) -> Solution: ...


def solve(scene: Solvable, ask: Ask, level: int = 0) -> Solution:
    """Solve through the drivers from this level on that the scene and the ask call for, outermost first. Collective."""
    for k, name in list(enumerate(DRIVERS))[level:]:
        if DRIVERS[name].idle(scene):
            continue
        driver: Driver = DRIVERS[name].load()  # type: ignore[assignment]
        if driver.applies(scene, ask):
            return driver.solve(scene, ask, partial(solve, level=k + 1))
    raise AssertionError("the innermost driver applies to everything")


NO_FILM = "it is no film with cavitation, for which alone the theorem holds"
# What does not compose, and why: (a driver that applies, or a kind of problem; an attribute of the ask; the reason).
CANNOT = (
    ("box", "certify", NO_FILM),
    ("equations", "certify", NO_FILM),
    ("mixed", "certify", NO_FILM),
    ("user", "certify", NO_FILM),
    ("user", "checkpoint", "its functions are no data that a file could hold"),
    ("user", "resume", "its functions are no data that a file could hold"),
    ("user", "accuracy", "its points are its own, and no grid's that could be refined"),
    ("accuracy", "checkpoint", "its many grids make one answer; give --n for one grid"),
    ("accuracy", "resume", "its many grids make one answer; give --n for one grid"),
    ("balance", "checkpoint", "its many solves make one answer; give the value that was found for one solve"),
    ("balance", "resume", "its many solves make one answer; give the value that was found for one solve"),
    ("pads", "checkpoint", "its many solves make one answer; give the place and the tilts that were found for one solve"),
    ("pads", "resume", "its many solves make one answer; give the place and the tilts that were found for one solve"),
    ("position", "checkpoint", "its many solves make one answer; give the eccentricity that was found for one solve"),
    ("position", "resume", "its many solves make one answer; give the eccentricity that was found for one solve"),
    ("time", "certify", "it goes on in time, and the theorem is of one steady film"),
    ("time", "nested", "it goes on in time, each step from the one before, on one grid"),
    ("grooves", "checkpoint", "its films are solved one by one"),
    ("grooves", "resume", "its films are solved one by one"),
    ("supplies", "checkpoint", "its many solves make one answer; give the pressures that were found for one solve"),
    ("supplies", "resume", "its many solves make one answer; give the pressures that were found for one solve"),
    ("turned", "checkpoint", "U < 0 is solved as its mirror image; give that, with -U"),
    ("turned", "resume", "U < 0 is solved as its mirror image; give that, with -U"),
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
