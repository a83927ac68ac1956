"""Bearings of any kind: a film made of named shapes, a fluid, and a condition for each side."""

import cmath
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, field_validator, model_validator

from ..problems.film.fluid import Law
from ..problems.film.model import NAMES, OPPOSITE, Model, Side
from ..problems.film.reynolds import Film
from ..problems.film.shapes import Shape
from ..problems.film.supplies import Supply
from ..problems.film.turning import Turning
from .effects.table import WithEffects
from .film import FilmPart, JournalPart
from .film_scene import RectangleScene, Sides
from .scene import Finite, Positive
from .supply import Place, SupplyTable, supplies_of
from .units import Measured, is_quantity, measured, metres

SAMPLES = 65  # points a side of the film from which the pressure unit is taken: the same on every grid


class Fluid(Measured):
    """The lubricant; pressures are absolute, as everywhere in a bearing's file."""

    mu: Positive | None = measured("Pa s", None, "viscosity")
    p_c: Finite = measured("Pa", 0.0, "cavitation pressure")
    barus: Annotated[Finite, Field(ge=0, lt=1e-3)] = measured("1/Pa", 0.0, "viscosity is mu exp(barus (p - p_c))")
    density: Literal["constant", "dowson-higginson"] = Field("constant", description="how the density depends on the pressure")
    p_supply: Finite | None = measured("Pa", None, "pressure of the sides that name none; default p_c")


class SideTable(Measured):
    """One side of the film."""

    kind: Literal["pressure", "symmetry", "closed", "periodic"] = Field(
        "pressure", description="pressure given; symmetry or closed: nothing flows through; periodic, with the opposite side"
    )
    p: Finite | None = measured("Pa", None, "pressure; default fluid.p_supply")
    r: Annotated[Finite, Field(ge=0, lt=1)] = Field(0.0, description="void fraction that enters (west, at p = p_c)")

    @model_validator(mode="before")
    @classmethod
    def _short(cls, data: Any) -> Any:
        """A number is a pressure, with a unit or without; a word is a kind."""
        if (isinstance(data, (int, float)) and not isinstance(data, bool)) or is_quantity(data):
            return {"p": data}
        return {"kind": data} if isinstance(data, str) else data

    def check(self) -> None:
        if self.kind != "pressure":
            for key in ("p", "r"):
                if getattr(self, key):
                    raise ValueError(f"{key} = {getattr(self, key):g}: the side is {self.kind}")


class SidesTable(Measured):
    """West (x = 0, where the flow enters), east (x = L), south (y = 0) and north (y = width)."""

    west: SideTable = Field(SideTable(), description="x = 0: a pressure in Pa, 'symmetry', 'closed', 'periodic', or {p, r}")
    east: SideTable = Field(SideTable(), description="x = L")
    south: SideTable = Field(SideTable(), description="y = 0 (2D)")
    north: SideTable = Field(SideTable(), description="y = width (2D)")


class BearingScene(RectangleScene, WithEffects):
    """A bearing under a wall that moves in x: its film is the sum of the [[film]] shapes. SI units, pressures absolute."""

    family: Literal["bearing"] = "bearing"
    L: Positive = metres(..., "length in the direction of motion")
    U: Finite = measured("m/s", ..., "speed of the moving wall, towards larger x; negative: to smaller x; 0: at rest")
    p_in: Finite | None = measured("Pa", None, "pressure of the west side; short for sides.west.p")
    p_out: Finite | None = measured("Pa", None, "pressure of the east side; short for sides.east.p")
    fluid: Fluid = Field(..., description="the lubricant")
    film: list[FilmPart] = Field(..., min_length=1, description="shapes, which are added up")
    sides: SidesTable = Field(SidesTable(), description="condition at each side")
    supply: list[SupplyTable] = Field([], description="supplies inside the film")
    p_unit: Positive | None = measured("Pa", None, "pressure unit of the equations; default from mu U L/h^2")

    @field_validator("film", mode="before")
    @classmethod
    def _one_shape(cls, film: Any) -> Any:
        return [film] if isinstance(film, dict) else film

    def check(self) -> None:
        super().check()
        if self.dimension == 1:
            for name in NAMES[2:]:
                if name in self.sides.model_fields_set:
                    raise ValueError(f"sides.{name}: the scene is one-dimensional (dimension = 2 is not set)")
        for name, key in (("west", "p_in"), ("east", "p_out")):
            if getattr(self, key) is not None and getattr(self.sides, name).model_fields_set - {"r"}:
                raise ValueError(f"{key} and sides.{name} are both given: one of them is allowed")
        for name in NAMES[: 2 * self.dimension]:
            if (p := self._pressure(name)) < self.fluid.p_c:
                raise ValueError(
                    f"sides.{name}: p = {p:g}: at least the cavitation pressure p_c = {self.fluid.p_c:g} is needed"
                )
            if getattr(self.sides, name).kind == "periodic" and getattr(self.sides, OPPOSITE[name]).kind != "periodic":
                raise ValueError(f"sides.{name} is periodic, sides.{OPPOSITE[name]} is not: both of them or none")
        self._supplies()
        self._check_motion()
        own = self.temperature.own_mu if self.temperature is not None else None
        if self.fluid.mu is None and own is None:
            raise ValueError("fluid.mu is missing")
        if self.fluid.mu is not None and own is not None:
            raise ValueError(f"fluid.mu = {self.fluid.mu:g} and the viscosities of [temperature] are both given: one of them")

    def _check_motion(self) -> None:
        count, motion = len(self._journals), self.motion
        if motion is not None and (motion.journal is not None or (motion.moves_journal and count)) and count != 1:
            raise ValueError(f"motion: its journal is the shape 'journal' of [[film]]; there are {count}, 1 is needed")
        super()._check_motion()

    def _supplies(self) -> tuple[Supply, ...]:
        """The supplies inside the film; angles are counted from x = 0 of a film with a journal."""
        names = [name for name in NAMES[: 2 * self.dimension] if getattr(self.sides, name).kind == "pressure"]
        least = min((self._pressure(name) for name in names), default=self.fluid.p_c)
        radius = self.L / (2.0 * math.pi) if self._journals else None
        place = Place(self.side_lengths, self.sides.west.kind == "periodic", self.fluid.p_c, radius, 0.0, least)
        return supplies_of(self.supply, place)

    @property
    def mu_0(self) -> float:
        """mu, Pa s; at T_in where it depends on the temperature."""
        return self.fluid.mu or self.temperature.own_mu

    def isothermal(self) -> dict[str, Any]:
        """The keys that change where the temperature is left out, and their values."""
        return {"fluid": self.fluid.model_copy(update={"mu": self.mu_0})}

    def _pressure(self, name: str) -> float:
        """Absolute pressure of a side, Pa."""
        given = {"west": self.p_in, "east": self.p_out}.get(name)
        candidates = (given, getattr(self.sides, name).p, self.fluid.p_supply, self.fluid.p_c)
        return next(p for p in candidates if p is not None)

    def _sides(self) -> Sides:
        sides = []
        for name in NAMES:
            table: SideTable = getattr(self.sides, name)
            if table.kind == "pressure":
                sides.append(Side("open", self._pressure(name) - self.fluid.p_c, table.r))
            else:
                sides.append(Side("periodic" if table.kind == "periodic" else "closed"))
        return tuple(sides)  # type: ignore[return-value]

    def data_si(self) -> dict[str, Any]:
        data = super().data_si()
        if self.dimension == 1:  # which has no such sides
            data["sides"] = {name: data["sides"][name] for name in NAMES[:2]}
        return data

    @property
    def cavitation_pressure(self) -> float:
        return self.fluid.p_c

    def _parts(self) -> Sequence[Shape]:
        return self.shapes_of(self.film)

    def moved(self, place: Sequence[float]) -> Self:
        if len(place) == 1:
            return super().moved(place)
        scene = self.model_copy()
        scene._journal = place[0], place[1]
        return scene

    @property
    def _journals(self) -> list[JournalPart]:
        return [table for table in self.film if isinstance(table, JournalPart)]

    @property
    def place(self) -> tuple[float, ...]:
        """[X, Y] of the journal among the shapes, in parts of its clearance; without one the film's level."""
        if not self._journals:
            return super().place
        table = self._journals[0]
        e = cmath.rect(table.eccentricity, math.pi + 2.0 * math.pi * table.widest / self.L)
        return e.real, e.imag

    @property
    def turning(self) -> Turning | None:
        """What the film is wrapped round: the journal among its shapes; eccentricities of several add up as vectors."""
        if not self._journals:
            return None
        where, widest = self._journal, None
        R, B = self.L / (2.0 * math.pi), self.side_lengths[1] if self.dimension == 2 else 1.0
        offset = sum(one.c * one.eccentricity * cmath.exp(2j * math.pi * one.widest / self.L) for one in self._journals)
        if where is not None:
            widest = math.pi + math.atan2(where[1], where[0])
        elif offset:
            widest = cmath.phase(offset)
        return Turning(R, 0.0, widest, c=self._journals[0].c, B=B, omega=self.U / R)

    def _model(self) -> Model:
        model = super()._model()
        unit = self.p_unit or self._pressure_unit(model.gap)
        return replace(model, p_unit=unit, shaft=self.turning, law=self._law)

    @property
    def _law(self) -> Law | None:
        law = Law(self.fluid.barus, self.fluid.density != "constant")
        return None if law == Law() else law

    def _pressure_unit(self, gap: Film) -> float:
        """The power of ten next to mu U L/h^2 with the thinnest film, or to the largest pressure at a side, if that is more.

        p and r are then of like size, or p is what a film at rest has.
        """
        places = [(np.arange(SAMPLES) + 0.5) / SAMPLES * length for length in self.side_lengths]
        h = gap(places[0][None, :], places[1][:, None] if self.dimension == 2 else np.zeros((1, 1)))
        positive = h[np.isfinite(h) & (h > 0)]
        if not positive.size:
            return 1e6  # the discretisation says where the film is not positive
        drag = self.mu_0 * abs(self.U) * self.L / float(positive.min()) ** 2
        unit = max(drag, *(side.p for side in self._sides()), *(max(one.p, one.p_s) for one in self._supplies()))
        return 10.0 ** round(math.log10(unit)) if 1e-90 < unit < 1e90 else 1e6
