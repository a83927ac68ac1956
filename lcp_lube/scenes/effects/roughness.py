"""[roughness]: surfaces rough below the grid, by the flow factors of Patir and Cheng (1978, 1979), isotropic.

    pressure flow  phi_p = 1 - 0.9 exp(-0.56 H),  H = h/sigma
    wall's flow    U (h + sigma phi_s),  phi_s = 1.899 H^0.98 exp(-0.92 H + 0.05 H^2) up to H = 5, 1.126 exp(-0.25 H) beyond,
                   times (V_moving - V_resting), the parts of sigma^2 that the two walls have, 0 if both are as rough

They hold for H above some 1/2; asperities that carry load are not among them.
"""

from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from ...problems.film.effects import Answer, Cells
from ..scene import Finite, Positive
from ..units import metres
from .table import EffectTable

THICKEST = 50.0  # of H: beyond it the factors are 1


class SurfaceRoughness(EffectTable):
    """Combined roughness of both walls, as factors of the flows."""

    sigma: Positive = metres(..., "standard deviation of both walls together: sqrt(sigma_1^2 + sigma_2^2)")
    moving: Annotated[Finite, Field(ge=0, le=1)] = Field(0.5, description="part of sigma^2 that the moving wall has")

    fixed: ClassVar[bool] = True

    @property
    def channels(self) -> tuple[str, ...]:  # type: ignore[override]
        return ("pressure_flow",) if self.moving == 0.5 else ("pressure_flow", "drag_flow")

    def apply(self, at: Answer, out: Cells) -> None:
        H = at.h / self.sigma
        out["pressure_flow"] *= 1.0 - 0.9 * np.exp(-0.56 * H)
        if excess := 2.0 * self.moving - 1.0:  # of the moving wall's part of sigma^2 over the other's
            low = np.clip(H, 0.0, 5.0)
            near = 1.899 * low**0.98 * np.exp(-0.92 * low + 0.05 * low**2)
            far = 1.126 * np.exp(-0.25 * np.minimum(H, THICKEST))
            # The moving wall's valleys carry oil along: they add to the flow where it is the rougher one.
            out["drag_flow"] *= 1.0 + excess * np.where(H <= 5.0, near, far) / H
