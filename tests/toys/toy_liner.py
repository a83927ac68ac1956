"""A toy: elasticity as one file, h = h_rigid + D p."""

from dataclasses import dataclass

from lcp_lube.problems.film.effects import Effect
from lcp_lube.scenes.effects.table import EffectTable


class ToyLiner(EffectTable):
    """A wall that gives way."""

    D: float

    def effect(self, scene):
        return Bends(self.D)


@dataclass(frozen=True)
class Bends(Effect):
    """D : m/Pa."""

    D: float
    channels: tuple = ("lift",)

    def apply(self, at, out):
        out["lift"] += self.D * at.p
