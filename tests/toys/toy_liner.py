"""A toy: elasticity as one file, h = h_rigid + D p."""

from typing import ClassVar

from lcp_lube.scenes.effects.table import EffectTable


class ToyLiner(EffectTable):
    """A wall that gives way. D : m/Pa."""

    D: float
    channels: ClassVar = ("lift",)

    def apply(self, at, out):
        out["lift"] += self.D * at.p
