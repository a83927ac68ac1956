"""[balance] of a scene file: the load that a film is to carry."""

from typing import Annotated, Any

from pydantic import Field

from ..base.quantity import in_si, quantity
from .scene import Finite
from .units import Measured, measured, stem

UNITS = {"eccentricity": "", "h_offset": "m"}  # of the keys that are found most; another's number is taken in SI


class BalanceTable(Measured):
    """[balance] of a scene file: the load to carry, and the key whose value is to be found for it."""

    load: Annotated[Finite, Field(gt=0)] = measured(
        "N or N/m", ..., "load to carry, in 1D per metre of width: `load` of the results"
    )
    vary: str | None = Field(None, description="key to find; default eccentricity (journals), else h_offset, the film's level")
    range: tuple[Finite, Finite] | None = Field(None, description="values allowed for it, in SI or with its unit ('5um')")
    tol: Annotated[Finite, Field(gt=1e-12, lt=1)] = Field(1e-6, description="relative error of the load")

    @classmethod
    def in_si_units(cls, data: Any) -> Any:
        """The ends of the range have the unit of the key that varies: a length for a film's level, none for an eccentricity."""
        ends = data.get("range") if isinstance(data, dict) else None
        if isinstance(ends, (list, tuple)) and any(isinstance(end, str) for end in ends):
            last = str(data.get("vary") or "").rpartition(".")[2]
            found = [quantity(end) if isinstance(end, str) else None for end in ends]
            for end, read in zip(ends, found, strict=True):
                if read is not None and read.unit and (unit := UNITS.get(stem(last))) is not None:
                    in_si(end, unit)  # raises where the dimension is another
            data = {**data, "range": [end if read is None else read.value for end, read in zip(ends, found, strict=True)]}
        return super().in_si_units(data)

    def check(self) -> None:
        if self.range is not None and not self.range[0] < self.range[1]:
            raise ValueError(f"range = {list(self.range)}: smallest < largest is needed")
