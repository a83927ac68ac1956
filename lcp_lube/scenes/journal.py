"""Journal bearings, unwrapped from one axial groove at the widest gap to the same groove again."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, model_validator

from ..problems.film.lines import graded_across, graded_round
from ..problems.film.model import Model, Side
from ..problems.film.shapes import Journal, Shape
from ..problems.film.supplies import Supply
from ..problems.film.turning import Turning
from ..problems.grid import Places
from .film_scene import Sides
from .published import LubricationScene
from .scene import Finite, Positive
from .supply import Place, SupplyTable, supplies_of
from .units import measured, metres


class JournalScene(LubricationScene):
    """A journal of diameter D turning in a bush of width B: x = D phi/2 from the groove at h_max, y along the axis.

    h = c (1 + eccentricity cos phi), c = psi D/2; the groove keeps p = p_a = p_b and no void, the ends p = p_side. L, width, U
    and p_unit follow from D, width_over_diameter, omega and psi; dimension 1 is the infinitely long bearing. Without a groove
    (round = "periodic") the film goes on at phi = 2 pi, and the ends, at p_side > 0, feed it.
    """

    derived: ClassVar[tuple[str, ...]] = ("L", "U", "width", "p_unit")
    dimension: Literal[1, 2] = 2
    eccentricity: Annotated[Finite, Field(ge=0, lt=1, description="relative eccentricity")] = 0.5
    width_over_diameter: Positive = Field(1.0, description="B/D (2D)")
    round: Literal["groove", "periodic"] = Field("groove", description="at phi = 0: an axial groove, or nothing (2D)")
    graded: bool = Field(
        False, description="lines graded towards the thinnest film and the ends: eccentricities near 1 (2D, groove)"
    )
    D: Positive = metres(0.1, "diameter")
    psi: Annotated[Finite, Field(gt=0, lt=1, description="relative clearance c/(D/2)")] = 1e-3
    omega: Positive = measured("rad/s", 100.0, "angular velocity")
    mu: Positive = 0.02
    supply: list[SupplyTable] = Field([], description="supplies inside the film; pressures are absolute")
    L: Positive = Field(1.0, description="follows from D")
    U: Positive = Field(1.0, description="follows from D and omega")

    @model_validator(mode="before")
    @classmethod
    def _derived(cls, data: Any) -> Any:
        for key in cls.derived:
            if key in data:
                raise ValueError(f"{key} = {data[key]}: follows from D, width_over_diameter, omega, psi and mu in this scene")
        data, fields = cls.in_si_units(data), cls.model_fields
        D, omega, mu, psi = (data.get(key, fields[key].default) for key in ("D", "omega", "mu", "psi"))
        ratio = data.get("width_over_diameter", fields["width_over_diameter"].default)
        try:
            derived = {"L": math.pi * D, "U": 0.5 * D * omega, "p_unit": mu * omega / psi**2}
            if data.get("dimension", 2) == 2:
                derived["width"] = ratio * D
        except (TypeError, ZeroDivisionError, OverflowError):
            return data  # the fields' own checks say what is wrong
        return {**data, **{key: value for key, value in derived.items() if value > 0 and math.isfinite(value)}}

    def check(self) -> None:
        super().check()
        if self.round == "periodic":
            if self.dimension == 1 or not (self.p_side > 0 or self.supply):
                found = "dimension = 1" if self.dimension == 1 else f"p_side = {self.p_side:g}"
                raise ValueError(f"{found}: without a groove (round = periodic) the ends feed the film: 2D, p_side > 0")
            if self.p_a or self.p_b:
                raise ValueError(f"p_a = {self.p_a:g}, p_b = {self.p_b:g}: there is no groove (round = periodic)")
        if self.graded and (self.dimension == 1 or self.round == "periodic" or self.motion is not None):
            raise ValueError("graded = true: lines are graded in 2D, from a groove at the widest gap (round = groove), at rest")
        self._supplies()
        self._check_motion()

    def _supplies(self) -> tuple[Supply, ...]:
        """The supplies inside the film, angles counted from the widest gap."""
        used = [self.p_side] if self.round == "periodic" else [self.p_a, self.p_b, *[self.p_side] * (self.dimension - 1)]
        place = Place(self.side_lengths, self.round == "periodic", self.p_c, 0.5 * self.D, 0.0, min(used) + self.p_c)
        return supplies_of(self.supply, place)

    def _sides(self) -> Sides:
        if self.round == "groove":
            return super()._sides()
        return Side("periodic"), Side("periodic"), Side(p=self.p_side), Side(p=self.p_side)

    @property
    def turning(self) -> Turning:
        """Angles are counted from the widest gap."""
        width = self.width if self.dimension == 2 and self.width else 1.0
        widest = self._widest if self.eccentricity else None
        return Turning(0.5 * self.D, 0.0, widest, c=0.5 * self.psi * self.D, B=width, omega=self.omega)

    @property
    def _widest(self) -> float:
        """Angle of the widest gap, rad: 0, but where [motion] has the journal elsewhere."""
        return 0.0 if self._journal is None else math.atan2(self._journal[1], self._journal[0]) + math.pi

    def _parts(self) -> Sequence[Shape]:
        return [Journal(0.5 * self.psi * self.D, self.eccentricity, self.L, 0.5 * self.D * self._widest)]

    @property
    def place(self) -> tuple[float, ...]:
        """[X, Y] of the journal, in parts of the clearance: away from the widest gap."""
        return -self.eccentricity, 0.0

    def moved(self, place: Sequence[float]) -> Self:
        """Angles are counted from the groove."""
        scene = self.model_copy(update={"eccentricity": math.hypot(*place)})
        scene._journal = place[0], place[1]
        return scene

    def _model(self) -> Model:
        return replace(super()._model(), shaft=self.turning, places=self._places, extras=self.bearing_numbers)

    @property
    def _places(self) -> Places | None:
        """Graded lines, where they are asked for."""
        if not self.graded:
            return None
        nx, ny = self.shape
        reach = 0.5 * self.D * math.sqrt(2.0 * (1.0 - self.eccentricity) / max(self.eccentricity, 0.1))
        return graded_round(nx, self.eccentricity, self.L), graded_across(ny, reach, self.width or self.L)

    def bearing_numbers(self, values: dict[str, Any]) -> dict[str, Any]:
        """Sommerfeld number W psi^2/(B D mu omega), and in 2D the side leakage as Q/((D/2)^3 psi omega)."""
        numbers = {"sommerfeld": self.turning.numbers(values["load"], self.mu_0, self.eccentricity)["sommerfeld"]}
        if self.dimension == 2:
            numbers["side_leakage_number"] = values["side_leakage"] / ((0.5 * self.D) ** 3 * self.psi * self.omega)
        return numbers
