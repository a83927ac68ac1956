"""[balance] of a scene file: the load that a film is to carry."""

from typing import Annotated

from pydantic import Field, model_validator

from .units import Measured, measured

Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]


class BalanceTable(Measured):
    """[balance] of a scene file: the load to carry, and the key whose value is to be found for it."""

    load: Annotated[Number, Field(gt=0)] = measured(
        "N or N/m", ..., "load to carry, in 1D per metre of width: `load` of the results"
    )
    vary: str | None = Field(None, description="key to find; default eccentricity (journals), else h_offset, the film's level")
    range: tuple[Number, Number] | None = Field(None, description="values allowed for it, in its unit")
    tol: Annotated[Number, Field(gt=1e-12, lt=1)] = Field(1e-6, description="relative error of the load")

    @model_validator(mode="after")
    def _ordered(self) -> "BalanceTable":
        if self.range is not None and not self.range[0] < self.range[1]:
            raise ValueError(f"range = {list(self.range)}: smallest < largest is needed")
        return self
