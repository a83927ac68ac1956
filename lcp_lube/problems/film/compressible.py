"""Density that follows the pressure, as an effect."""

from dataclasses import dataclass
from typing import ClassVar

from .effects import Answer, Cells, Effect
from .fluid import Law


@dataclass(frozen=True)
class Compressible(Effect):
    """Dowson and Higginson's density, from the pressure."""

    law: Law
    channels: ClassVar[tuple[str, ...]] = ("density",)

    def apply(self, at: Answer, out: Cells) -> None:
        out["density"] *= self.law.density(at.p)
