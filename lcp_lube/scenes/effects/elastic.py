"""[elastic]: a wall that gives way, as a local foundation: h = h_rigid + compliance (p - p_c).

A thin soft liner of thickness t on a stiff backing, bonded to it, has the compliance t (1 + nu) (1 - 2 nu)/(E (1 - nu)).
"""

from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from ...problems.film.effects import Answer, Cells, Effect, Report
from ...problems.grid import Grid
from ..scene import Finite, Positive
from ..units import measured, metres
from .table import EffectTable


class GivingWay(Effect):
    """Walls that pressure moves apart."""

    channels: ClassVar[tuple[str, ...]] = ("lift",)

    def report(self, at: Answer) -> Report:
        lift = at.cells["lift"]
        return Report({"deflection_max": at.problem.reduce.max(np.abs(lift))}, {}, {"lift": (lift, "m")})


class Elastic(GivingWay, EffectTable):
    """A local foundation: its compliance, or thickness, modulus and Poisson's ratio of a thin liner."""

    compliance: Positive | None = measured("m/Pa", None, "how far the wall gives way under a pressure")
    thickness: Positive | None = metres(None, "of a liner on a stiff backing")
    E: Positive | None = measured("Pa", None, "its modulus")
    nu: Annotated[Finite, Field(ge=0, lt=0.5)] = Field(0.3, description="its Poisson's ratio")

    def check(self) -> None:
        liner = (self.thickness is not None, self.E is not None)
        if (self.compliance is not None) == any(liner) or any(liner) != all(liner):
            raise ValueError("compliance, or thickness and E, are needed")
        if self.E is not None and self.E < 1e4:
            raise ValueError(f"E = {self.E:g}: at least 10 kPa is needed (SI units?)")

    def yields(self, grid: Grid) -> float:
        if self.compliance is not None:
            return self.compliance
        assert self.thickness is not None and self.E is not None  # as `check` found
        return self.thickness * (1.0 + self.nu) * (1.0 - 2.0 * self.nu) / (self.E * (1.0 - self.nu))

    def apply(self, at: Answer, out: Cells) -> None:
        out["lift"] += self.yields(at.grid) * (at.p + out.get("contact", 0.0))
