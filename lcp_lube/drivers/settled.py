"""When coefficients that effects make of an answer count as found."""

import numpy as np

from ..problems.certificate import certificate_tol
from ..problems.film.stored import Stored
from .ask import Ask

SETTLED = 0.1  # of eps1: relative change of the coefficients
IN_TIME = (1e-2, 0.1, 5e-5)  # the same in a time step: of what it changes, of the square of its part in them, and at most


def settled(ask: Ask, stored: Stored | None, moved: float, reach: float = np.inf) -> float:
    """Relative change of the coefficients at which they count as found: by the eps1 asked for, not by a method's own.

    In a time step, which is expected to change effects of a size `reach` by `moved`, as far as its formula's error makes sense
    of it: a part of that change, or where effects are small, of the square of moved/reach, which is that error's size. Nothing
    is lost by it, as what cells store has the very density that flows.
    """
    eps1 = ask.stopping_for((1e-8, 1e-8)).eps1
    given = ask.stopping is not None and not ask.options.get("rest")
    if stored is None or stored.exact or given:
        return SETTLED * eps1
    part = max(IN_TIME[0] * moved, IN_TIME[1] * (moved / reach) ** 2 if reach else 0.0)
    return max(SETTLED * eps1, min(part, IN_TIME[2], certificate_tol(eps1)))
