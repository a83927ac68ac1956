"""[shear]: oils that are thinner where they are sheared fast: a generalised viscosity, which depends on the shear rate.

    shear rate  g^2 = (U/h)^2 + (h |grad p|)^2/(12 mu^2), the mean of its square across the film
    Eyring      mu_N asinh(mu_N g/tau_0)/(mu_N g/tau_0)
    Carreau     mu_N (s + (1 - s) (1 + (lambda g)^2)^((n - 1)/2)),  s = mu at the highest rates over mu_N

mu_N is the viscosity at that place's pressure and temperature. Reynolds' equation keeps its form with the mean viscosity, as is
usual; profiles across the film are not resolved.
"""

from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from ...problems.film.effects import Answer, Cells
from ..scene import Finite, Positive
from ..units import measured
from .table import EffectTable


class Shear(EffectTable):
    """Shear thinning, by Eyring's or Carreau's law."""

    local: ClassVar[bool] = True
    law: Literal["eyring", "carreau"] = Field(..., description="which law")
    tau_0: Positive | None = measured("Pa", None, "Eyring stress")
    time: Positive | None = measured("s", None, "Carreau's time lambda")
    n: Annotated[Finite, Field(gt=0, le=1)] | None = Field(None, description="Carreau's exponent")
    least: Annotated[Finite, Field(ge=0, lt=1)] = Field(0.0, description="Carreau: viscosity at the highest rates, over mu_N")

    def check(self) -> None:
        needed = ("tau_0",) if self.law == "eyring" else ("time", "n")
        missing = [name for name in needed if getattr(self, name) is None]
        if missing:
            raise ValueError(f"law = {self.law}: {' and '.join(missing)} is missing")

    @property
    def logarithmic(self) -> bool:
        """Whether a viscosity that grows by pressure comes out as its logarithm."""
        return self.law == "eyring"

    def apply(self, at: Answer, out: Cells) -> None:
        U, h = at.speed, at.h
        along, across = at.gradient
        rate = np.sqrt((U / h) ** 2 + (h**2 * (along**2 + across**2)) / (12.0 * at.mu**2))
        if self.law == "eyring":
            x = at.base.mu * out["viscosity"] * at.law.viscosity(at.p) * rate / self.tau_0
            out["viscosity"] *= np.where(x > 1e-4, np.arcsinh(x) / np.maximum(x, 1e-4), 1.0 - x * x / 6.0)
        else:
            thin = (1.0 + (self.time * rate) ** 2) ** (0.5 * (self.n - 1.0))  # type: ignore[operator]
            out["viscosity"] *= self.least + (1.0 - self.least) * thin
