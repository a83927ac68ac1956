"""What certifies an answer: bounds on measures that the problem's data give, whatever the method believes."""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Certificate:
    """Measures of how far fields are from a solution.

    Attributes
    ----------
    measures : name -> value; every one must be at most `tol`.
    tol : their common bound, `certificate_tol(eps1)`.
    extremes : name -> value, reported beside them (smallest p and r, say); implied by the measures.
    """

    measures: dict[str, float]
    tol: float
    extremes: dict[str, float] = field(default_factory=dict)

    @property
    def failure(self) -> str:
        """Which bounds are broken, as a sentence; empty if the certificate holds. NaN breaks every bound."""
        broken = {name: value for name, value in self.measures.items() if not value <= self.tol}
        return ", ".join(f"{name} {value:.2e} > {self.tol:.1e}" for name, value in broken.items())

    @property
    def holds(self) -> bool:
        return not self.failure


def certificate_tol(eps1: float) -> float:
    """The one rule for every run: sqrt(eps1), from 1e-7 up to 1e-2.

    A run that stops at ||F|| = eps1 leaves products p_i r_i near eps1, so min(p, r) near sqrt(eps1) at the front; below
    1e-14 rounding takes over, and above 1e-2 nobody would call the answer a solution.
    """
    return float(np.clip(np.sqrt(eps1), 1e-7, 1e-2))


def glance(problem: Any, fields: Any, eps1: float) -> Certificate:
    """A film's certificate but for the closer look at p, which takes longer than the film: for those on the way. Collective."""
    seen = problem.certify(fields, eps1, closely=False)
    return replace(seen, measures={name: value for name, value in seen.measures.items() if name != "p_error"})
