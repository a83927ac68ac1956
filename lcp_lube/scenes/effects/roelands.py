"""[roelands]: viscosity by pressure, and by temperature with it (Roelands 1966).

    mu(p, T) = mu_T exp((log(mu_T) + 9.67) ((1 + p/1.96e8)^z - 1)),   p above p_c (Pa),

mu_T the viscosity at that temperature and p_c, whatever law it follows; by law = "roelands" of [temperature] it is his equation
in both. z, some 0.6 for mineral oils, or from the slope alpha = dlog(mu)/dp at p_c: z = alpha 1.96e8/(log(mu) + 9.67).
"""

from dataclasses import dataclass
from math import exp, log
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.polynomial.laguerre import laggauss
from pydantic import Field

from ...errors import InputError
from ...problems.film.effects import Answer, Cells, Effect
from ...problems.film.oils import ROELANDS_MU, ROELANDS_P
from ..scene import Finite
from ..units import measured
from .table import EffectTable

LARGEST = 60.0  # of the exponent, of an iterate
NODES, LEAST_Z = 32, 0.02  # of a quadrature that is exact for powers 1/z - 1 of up to 63


class RoelandsTable(EffectTable):
    """Viscosity by pressure: Roelands' exponent z, or alpha."""

    alpha: Annotated[Finite, Field(ge=0, lt=1e-6)] | None = measured("1/Pa", None, "dlog(mu)/dp at p_c")
    z: Annotated[Finite, Field(ge=0, le=2)] | None = Field(None, description="Roelands' exponent")

    def check(self) -> None:
        if (self.alpha is None) == (self.z is None):
            raise ValueError("alpha or z: one of them is needed")

    def effect(self, scene: Any) -> "Roelands":
        mu = scene.mu_0
        if getattr(getattr(scene, "fluid", None), "barus", 0.0):
            raise InputError("fluid.barus and [roelands] are both given: one law for viscosity by pressure")
        if not log(mu) + ROELANDS_MU > 0:
            raise InputError(f"mu = {mu:g}: Roelands' law is for viscosities above {exp(-ROELANDS_MU):.3g} Pa s")
        z = self.z if self.alpha is None else self.alpha * ROELANDS_P / (log(mu) + ROELANDS_MU)
        return Roelands(float(z or 0.0))


@dataclass(frozen=True)
class Roelands(Effect):
    """z : the exponent."""

    z: float
    local: ClassVar[bool] = True

    def apply(self, at: Answer, out: Cells) -> None:
        at_p_c = np.log(at.base.mu * out["viscosity"]) + ROELANDS_MU
        growth = np.expm1(self.z * np.log1p(np.maximum(at.p, 0.0) / ROELANDS_P))
        out["viscosity"] *= np.exp(np.minimum(np.maximum(at_p_c, 0.0) * growth, LARGEST))

    def beyond(self, at: Answer) -> str:
        """With p = P ((1 + s/a)^(1/z) - 1), s the exponent, a = log(mu_T) + 9.67: Int exp(-s) dp/ds ds is finite. By the
        thinnest oil, whose is the largest."""
        a = log(at.base.mu * at.problem.reduce.min(at.cells["viscosity"])) + ROELANDS_MU
        if not (a > 0.0 and self.z > LEAST_Z):
            return ""
        s, weights = laggauss(NODES)
        most = ROELANDS_P / (self.z * a) * float(weights @ (1.0 + s / a) ** (1.0 / self.z - 1.0))
        needed = at.problem.reduce.max(at.p)
        if needed < most:
            return ""
        return (
            f"no pressure carries the flow: viscosity grows without bound by Roelands' law (z = {self.z:.3g}), which reaches "
            f"what needs less than {most:.3g} Pa with the viscosity at p_c, and this film needs {needed:.3g} Pa with it"
        )
