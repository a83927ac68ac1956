"""[asperity]: asperities that touch and carry a part of the load (Greenwood and Tripp 1970).

    p_a = K E' F(H),  H = (h - delta)/sigma,  F(H) = 4.4086e-5 (4 - H)^6.804 where H < 4, else 0

with K = (16 sqrt(2) pi/15) (sigma beta n)^2 sqrt(sigma/beta), some 0.0003 to 0.003. p_a adds to load, force and moment, and
friction times p_a to `friction`. F fits the integral over normally distributed heights between H = 0 and 4, and is taken for
H < 0 too. The film's flow does not know of the contact: that is what [roughness] is for.
"""

from typing import ClassVar

import numpy as np
from pydantic import Field

from ...problems.film.contact import Contact
from ...problems.film.effects import Answer, Cells, Report
from ..scene import NotNegative, Positive
from ..units import measured, metres
from .table import EffectTable

FIT, REACH, POWER = 4.4086e-5, 4.0, 6.804  # of F(H), as printed above


class Asperity(EffectTable):
    """Greenwood and Tripp's contact of both surfaces."""

    sigma: Positive = metres(..., "standard deviation of the summits' heights, of both surfaces together")
    delta: NotNegative = metres(0.0, "height of the summits' mean plane above the surfaces'")
    K: Positive = Field(0.001, description="Greenwood and Tripp's number")
    E_reduced: Positive = measured("Pa", ..., "E' = 1/((1 - nu_1^2)/E_1 + (1 - nu_2^2)/E_2)")
    friction: NotNegative = Field(0.1, description="coefficient of boundary friction")

    channels: ClassVar[tuple[str, ...]] = ("contact",)

    def apply(self, at: Answer, out: Cells) -> None:
        H = (at.h - self.delta) / self.sigma
        at.problem.contact = Contact(at.cells["contact"], self.friction)
        out["contact"] += self.K * self.E_reduced * FIT * np.maximum(REACH - H, 0.0) ** POWER

    def report(self, at: Answer) -> Report:
        p_a, problem = at.cells["contact"], at.problem
        problem.contact = Contact(p_a, self.friction)
        carried = problem.contact.total(problem, lambda x, y: np.ones(1))
        numbers = {"asperity_load": carried, "asperity_p_max": problem.reduce.max(p_a)}
        return Report(numbers, {}, {"p_a": (p_a, "Pa")})
