"""Accuracy asked for: which runs are to one, and the number that they are to it of."""

from typing import Any

import numpy as np

from ...errors import InputError, nearest
from ...problems.solution import Solution
from ...scenes.scene import Solvable
from ..ask import Ask
from ..compose import Inner
from .estimate import scalars

ALLOWED = (1e-10, 0.5)  # tolerances
WHOLE = {True: 100_000, False: 1500}  # points up to which looking for symmetries costs what it saves, by multigrid or directly
DEFAULT_QUANTITY = ("load", "sum_v", "k", "sigma")


def applies(scene: Solvable, ask: Ask) -> bool:
    """Whether a relative error was asked for.

    Raises
    ------
    InputError : a tolerance out of range, a quantity without one.
    """
    if ask.accuracy is None:
        if ask.quantity is not None:
            raise InputError(f"--quantity {ask.quantity}: --accuracy TOL is needed too")
        return False
    if not ALLOWED[0] <= ask.accuracy <= ALLOWED[1]:
        raise InputError(f"--accuracy {ask.accuracy:g}: allowed are relative errors from {ALLOWED[0]:g} to {ALLOWED[1]:g}")
    return True


def solve(scene: Solvable, ask: Ask, inner: Inner) -> Solution:
    """Its solution on the first grid that is good enough (`ladder.solve`). Collective."""
    from .ladder import solve as climb  # here: small solves load none of it

    return climb(scene, ask, inner)


def find_value(found: dict[str, Any], quantity: str, scene: Solvable) -> float:
    """The quantity among those found; NaN where it has no value on this grid, a front that is not there, say."""
    numbers = list(scalars({name: value for name, value in found.items() if value is not None}))
    if quantity not in found or not (found[quantity] is None or quantity in numbers):
        near = nearest(quantity, numbers)
        raise InputError(
            f"--quantity {quantity}: scene {scene.name} has no such number{near}; allowed are {', '.join(numbers)}"
        )
    return np.nan if found[quantity] is None else float(found[quantity])
