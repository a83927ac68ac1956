"""What the march in time asks of a scene that moves."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

from ..problems.film.model import Model
from ..problems.film.turning import Turning
from .scene import Solvable

if TYPE_CHECKING:
    from .motion import MotionTable


# The film at the time t, its journal at [X, Y] in parts of the clearance.
Models = Callable[[float, tuple[float, float] | None], Model]


@runtime_checkable
class Moving(Solvable, Protocol):
    """A scene with a table [motion]; turning : its journal, if any; place : where that is, [X, Y], unless [motion] says."""

    motion: MotionTable | None
    turning: Turning | None
    place: tuple[float, float]

    def models(self) -> Models: ...


def motion_of(scene: Any) -> MotionTable | None:
    """The [motion] of a scene that has one."""
    return getattr(scene, "motion", None)
