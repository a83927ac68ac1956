"""What was found follows the numbers of a scene: the derivatives of a quantity and of the conditions that were met, together.

Where v was found such that C = 0 holds (an attitude, the eccentricity or level that carries a load), of every L (`adjoint`)

    dQ/da = L_a - L_v (C_v)^-1 C_a.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
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
    errors: dict[str, Array] = field(default_factory=dict)  # of L_v, and of C_v

    @classmethod
    def of(cls, adjoint: Any, other: bool = False) -> "Implicit":
        """other : of `other_side`. Raises InputError where the conditions do not depend on what was found."""
        both = [adjoint.slopes(key) for key in adjoint.found]
        slopes, errors = ([other_side(one[k]) if other else one[k] for one in both] for k in (0, 2))
        conditions = list(adjoint.conditions)
        C_v = np.array([[one[name] for one in slopes] for name in conditions]).reshape(len(conditions), len(slopes))
        C_v += np.diag(~C_v.any(axis=0) & ~C_v.any(axis=1))  # pads that idle keep their tilts: any will do
        try:
            inverse = np.linalg.inv(C_v)
        except np.linalg.LinAlgError:
            raise InputError(f"{', '.join(conditions)} do not depend on {', '.join(adjoint.found)}: no derivatives") from None
        names = list(map(plain, adjoint.lambdas))
        by_found, off = ({name: np.array([one.get(name, 0.0) for one in of]) for name in names} for of in (slopes, errors))
        return cls(adjoint.found, conditions, inverse, by_found, off)

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
        change = self._change(key, slope)
        if quantity in self.found:
            return float(change[self.found.index(quantity)])
        return _sum([slope[quantity], *(self.by_found[quantity] * change)])

    def error(self, quantity: str, key: str, slope: dict[str, float], error: dict[str, float]) -> float:
        """Of `total`, from the errors of all derivatives of L; none where they are not known."""
        if not self.found:
            return error.get(quantity, 0.0)
        size = np.abs(self._change(key, slope))
        of = {name: error.get(name, 0.0) + float(self.errors[name] @ size) for name in self.errors}
        return sum(abs(w) * of[name] for name, w in self.weights(quantity).items())

    def jump(self, quantity: str, jump: dict[str, float]) -> float:
        """By how much derivatives to both sides differ at most, from what those of every L do."""
        return sum(abs(w) * jump[name] for name, w in self.weights(quantity).items() if w and jump.get(name))

    def _change(self, key: str, slope: dict[str, float]) -> Array:
        """Of what was found."""
        C_a = np.array([slope[name] - float(key == "balance.load" and name == "load") for name in self.conditions])
        return -self.inverse @ C_a


def _sum(parts: Sequence[float]) -> float:
    """Their sum; 0 where rounding is all that is left of it."""
    total = float(sum(parts))
    return 0.0 if abs(total) <= CANCELLED * sum(map(abs, parts)) else total
