"""What was found follows the numbers of a scene: the derivatives of a quantity and of the conditions that were met, together.

Where v was found such that C = 0 holds (an attitude, the eccentricity or level that carries a load), of every L (`adjoint`)

    dQ/da = L_a - L_v (C_v)^-1 C_a.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base.parallel import Array
from ...errors import InputError
from .near_films import OTHER, plain

CANCELLED = 1e-10  # of its parts: what lambda errs by may make so much of a sum that is none


def other_side(of: dict[str, float]) -> dict[str, float]:
    """Of something by quantity that of the other side, where it differs."""
    return {name: of.get(name + OTHER, value) for name, value in of.items() if name == plain(name)}


@dataclass(frozen=True)
class Implicit:
    """Conditions C = 0 that what was found, v, meets: C_v inverted, and L_v of every quantity."""

    found: list[str]
    conditions: list[str]
    inverse: Array
    by_found: dict[str, Array]  # L_v

    @classmethod
    def of(cls, adjoint: Any, other: bool = False) -> "Implicit":
        """other : of `other_side`. Raises InputError where the conditions do not depend on what was found."""
        slopes = [adjoint.slopes(key)[0] for key in adjoint.found]
        slopes = [other_side(one) for one in slopes] if other else slopes
        conditions = list(adjoint.conditions)
        C_v = np.array([[one[name] for one in slopes] for name in conditions]).reshape(len(conditions), len(slopes))
        C_v += np.diag(~C_v.any(axis=0) & ~C_v.any(axis=1))  # pads that idle keep their tilts: any will do
        try:
            inverse = np.linalg.inv(C_v)
        except np.linalg.LinAlgError:
            raise InputError(f"{', '.join(conditions)} do not depend on {', '.join(adjoint.found)}: no derivatives") from None
        by_found = {name: np.array([one[name] for one in slopes]) for name in map(plain, adjoint.lambdas)}
        return cls(adjoint.found, conditions, inverse, by_found)

    def weights(self, quantity: str) -> dict[str, float]:
        """Of the derivatives of each L by something, in what the quantity changes by where v follows."""
        out = {} if quantity in self.found else {quantity: 1.0}
        if self.found:
            change = (
                -self.inverse[self.found.index(quantity)] if quantity in self.found else -self.by_found[quantity] @ self.inverse
            )
            for name, part in zip(self.conditions, change, strict=True):
                out[name] = out.get(name, 0.0) + float(part)
        return out

    def total(self, quantity: str, key: str, slope: dict[str, float]) -> float:
        """dQ/da from the derivatives of every L by a."""
        if not self.found:
            return slope[quantity]
        C_a = np.array([slope[name] - float(key == "balance.load" and name == "load") for name in self.conditions])
        change = -self.inverse @ C_a
        if quantity in self.found:
            return float(change[self.found.index(quantity)])
        parts = [slope[quantity], *(self.by_found[quantity] * change)]
        return _sum(parts)


def _sum(parts: Sequence[float]) -> float:
    """Their sum; 0 where rounding is all that is left of it."""
    total = float(sum(parts))
    return 0.0 if abs(total) <= CANCELLED * sum(map(abs, parts)) else total
