"""[viscosity]: a viscosity that varies in x and y, by a formula or a file: what the oil is where, whatever the answer."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from ...errors import InputError
from ...problems.film.effects import Answer, Cells, Effect
from ...problems.film.profile import read_profile
from ..film import UNITS, Unit
from ..formula import Formula
from .table import EffectTable


class ViscosityMap(EffectTable):
    """The viscosity as a multiple of the fluid's, by place."""

    hint: ClassVar[str] = " (the viscosity itself is mu)"
    factor: str | None = Field(None, description="formula in x and y (m), of a positive factor")
    file: str | None = Field(None, description=".csv with rows x, factor or x, y, factor, or .npy from side to side")
    unit_x: Unit = Field("mm", description="the file's unit of x and y (.csv)")
    interpolation: Literal["linear", "cubic", "nearest"] = Field("linear", description="between the file's points")

    def check(self) -> None:
        if (self.factor is None) == (self.file is None):
            raise ValueError("factor or file: one of them is needed")
        if self.factor is not None:
            Formula(self.factor)

    def effect(self, scene: Any) -> "Places":
        if self.factor is not None:
            return Places(Formula(self.factor), scene.name)
        assert self.file is not None  # as `check` found
        path, unit = (scene._folder or Path()) / self.file, UNITS[self.unit_x]
        return Places(read_profile(path, scene.side_lengths, self.interpolation, 1.0, unit), scene.name)


@dataclass(frozen=True)
class Places(Effect):
    """mu over the fluid's at x, y; end: x is counted back from there, in a mirror image."""

    factor: Any
    name: str
    end: float | None = None
    even = False
    local: ClassVar[bool] = True
    fixed: ClassVar[bool] = True

    def apply(self, at: Answer, out: Cells) -> None:
        x = at.grid.x if self.end is None else self.end - at.grid.x
        values = np.broadcast_to(self.factor(x, at.grid.y), at.grid.box).ravel()
        least = at.problem.reduce.min(values)
        if not least > 0 or not np.isfinite(at.problem.reduce.max(values)):
            raise InputError(f"{self.name}: viscosity: its factor is {least:g} somewhere: finite and above 0 is needed")
        out["viscosity"] *= values

    def mirrored(self, length: float) -> "Places":
        return Places(self.factor, self.name, length if self.end is None else None)
