"""What a method is asked to do: the one argument of every builder in the registry."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..base.stages import Stages
from ..problems.solution import Fields
from .newton import Stopping


@dataclass(frozen=True)
class Job:
    """A problem, and how to solve it.

    Attributes
    ----------
    problem : of a kind that the method solves.
    stages : clocks that the method's parts of the time go to.
    system : name of the matrix that the inner solver sees.
    options : the method's own, by name.
    stopping : tolerances and limits of the outer loop, to which inner ones may be fitted.
    start : fields to start from; None: the method's own start.
    """

    problem: Any
    stages: Stages
    system: str = ""
    options: dict[str, Any] = field(default_factory=dict)
    stopping: Stopping = field(default_factory=Stopping)
    start: Fields | None = None

    @property
    def inner_floor(self) -> float:
        """The relative tolerance of an inner solve below which the outer test would see nothing of it."""
        return float(np.clip(self.stopping.eps1, 1e-12, 1e-4))
