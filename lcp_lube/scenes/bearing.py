"""Bearings of any kind: a film made of named shapes, a fluid, and a condition for each side."""

import cmath
import math
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from petsc4py import PETSc
from pydantic import Field, field_validator, model_validator

from ..errors import InputError
from ..problems.film.exact import ExactSolution
from ..problems.film.fluid import Law
from ..problems.film.forces import Shaft
from ..problems.film.lubrication import LubricationProblem
from ..problems.film.model import NAMES, OPPOSITE, Model, Side
from ..problems.film.shapes import Block, Shape, Sum
from ..problems.film.supplies import Supply
from ..problems.film.turned import exact_either_way
from .balance import BalanceTable
from .effects.table import WithEffects, effects_of
from .film import Extent, FilmPart, JournalPart
from .motion import MotionTable
from .moving_film import check_motion, moving_film, place_of, turning_of
from .scene import Count, Finite, Positive
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

    @model_validator(mode="after")
    def _meant(self) -> "SideTable":
        if self.kind != "pressure":
            for key in ("p", "r"):
                if getattr(self, key):
                    raise ValueError(f"{key} = {getattr(self, key):g}: the side is {self.kind}")
        return self


class SidesTable(Measured):
    """West (x = 0, where the flow enters), east (x = L), south (y = 0) and north (y = width)."""

    west: SideTable = Field(SideTable(), description="x = 0: a pressure in Pa, 'symmetry', 'closed', 'periodic', or {p, r}")
    east: SideTable = Field(SideTable(), description="x = L")
    south: SideTable = Field(SideTable(), description="y = 0 (2D)")
    north: SideTable = Field(SideTable(), description="y = width (2D)")


class BearingScene(WithEffects):
    """A bearing under a wall that moves in x: its film is the sum of the [[film]] shapes. SI units, pressures absolute."""

    family: Literal["bearing"] = "bearing"
    dimension: Literal[1, 2] = Field(1, description="1: a film h(x), per metre of width; 2: h(x, y)")
    L: Positive = metres(..., "length in the direction of motion")
    width: Positive | None = metres(None, "width in y; default L (2D)")
    U: Finite = measured("m/s", ..., "speed of the moving wall, towards larger x; negative: to smaller x; 0: at rest")
    p_in: Finite | None = measured("Pa", None, "pressure of the west side; short for sides.west.p")
    p_out: Finite | None = measured("Pa", None, "pressure of the east side; short for sides.east.p")
    fluid: Fluid = Field(..., description="the lubricant")
    film: list[FilmPart] = Field(..., min_length=1, description="shapes, which are added up")
    h_floor: Positive | None = metres(None, "smallest film: the sum is cut there; default no cut")
    sides: SidesTable = Field(SidesTable(), description="condition at each side")
    supply: list[SupplyTable] = Field([], description="supplies inside the film")
    scheme: Literal["nodal", "face", "upwind"] = Field("face", description="form of the Couette flux")
    mean_cubes: bool = Field(False, description="h^3 at a face as the mean of the nodal values")
    p_unit: Positive | None = measured("Pa", None, "pressure unit of the equations; default from mu U L/h^2")
    h_offset: Finite = metres(0.0, "added to the film everywhere: its level")
    balance: BalanceTable | None = Field(None, description="load to carry, and what is found for it")
    motion: MotionTable | None = Field(None, description="how the film goes on in time")
    n: Count = Field(100, description="points a side")
    nx: Count | None = Field(None, description="points in x; default n")
    ny: Count | None = Field(None, description="points in y; default n (2D)")

    @field_validator("film", mode="before")
    @classmethod
    def _one_shape(cls, film: Any) -> Any:
        return [film] if isinstance(film, dict) else film

    @model_validator(mode="after")
    def _consistent(self) -> "BearingScene":
        if self.dimension == 1:
            for key in ("ny", "width"):
                if getattr(self, key) is not None:
                    raise ValueError(f"{key} = {getattr(self, key)}: the scene is one-dimensional (dimension = 2 is not set)")
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
        check_motion(self)
        return self

    def _supplies(self) -> tuple[Supply, ...]:
        """The supplies inside the film; angles are counted from x = 0 of a film with a journal."""
        names = [name for name in NAMES[: 2 * self.dimension] if getattr(self.sides, name).kind == "pressure"]
        least = min((self._pressure(name) for name in names), default=self.fluid.p_c)
        journal = any(isinstance(table, JournalPart) for table in self.film)
        radius = self.L / (2.0 * math.pi) if journal else None
        place = Place(self.side_lengths, self.sides.west.kind == "periodic", self.fluid.p_c, radius, 0.0, least)
        return supplies_of(self.supply, place)

    @model_validator(mode="after")
    def _viscosity_once(self) -> "BearingScene":
        own = self.temperature.own_mu if self.temperature is not None else None
        if self.fluid.mu is None and own is None:
            raise ValueError("fluid.mu is missing")
        if self.fluid.mu is not None and own is not None:
            raise ValueError(f"fluid.mu = {self.fluid.mu:g} and the viscosities of [temperature] are both given: one of them")
        return self

    @property
    def mu_0(self) -> float:
        """mu, Pa s; at T_in where it depends on the temperature."""
        return self.fluid.mu or self.temperature.own_mu

    def isothermal(self) -> dict[str, Any]:
        """What changes where the temperature is left out."""
        return {"fluid": self.fluid.model_copy(update={"mu": self.mu_0})}

    def _pressure(self, name: str) -> float:
        """Absolute pressure of a side, Pa."""
        given = {"west": self.p_in, "east": self.p_out}.get(name)
        candidates = (given, getattr(self.sides, name).p, self.fluid.p_supply, self.fluid.p_c)
        return next(p for p in candidates if p is not None)

    def _sides(self) -> tuple[Side, Side, Side, Side]:
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
    def shape(self) -> tuple[int, ...]:
        nx = self.nx or self.n
        return (nx,) if self.dimension == 1 else (nx, self.ny or self.n)

    @property
    def side_lengths(self) -> tuple[float, ...]:
        """L, and the width in 2D, m."""
        return (self.L,) if self.dimension == 1 else (self.L, self.width or self.L)

    @property
    def gap(self) -> Sum:
        """The film h(x, y) in metres."""
        return self.sum_of([table.part(self.extent) for table in self.film])

    @property
    def extent(self) -> Extent:
        """What its shapes need of it."""
        return Extent(self.side_lengths, self._folder or Path())

    def sum_of(self, parts: list[Shape]) -> Sum:
        """The film of these shapes."""
        level = [Block(self.h_offset, (-math.inf, math.inf), (-math.inf, math.inf))] if self.h_offset else []
        return Sum([*parts, *level], self.h_floor)

    models: ClassVar[Any] = moving_film
    place: ClassVar[Any] = property(place_of)
    turning: ClassVar[Any] = property(turning_of)

    @property
    def model(self) -> Model:
        """What is discretised.

        Raises
        ------
        InputError : sides that contradict one another, a profile that cannot be read.
        """
        try:
            return self._model()
        except InputError as error:
            raise InputError(f"{self.name}: {error}") from None

    def _model(self) -> Model:
        gap = self.gap
        return Model(
            lengths=self.side_lengths,
            sides=self._sides(),
            gap=gap,
            mu=self.mu_0,
            U=self.U,
            p_c=self.fluid.p_c,
            p_unit=self.p_unit or self._pressure_unit(gap),
            scheme=self.scheme,
            mean_cubes=self.mean_cubes,
            exact=self.exact,
            shaft=self._shaft,
            supplies=self._supplies(),
            law=self._law,
            effects=effects_of(self),
        )

    @property
    def _shaft(self) -> Shaft | None:
        """What the film is wrapped round: it has a journal among its shapes, whose eccentricities add up as vectors."""
        journals = [table for table in self.film if isinstance(table, JournalPart)]
        if not journals:
            return None
        offset = sum(table.c * table.eccentricity * cmath.exp(2j * math.pi * table.widest / self.L) for table in journals)
        return Shaft(self.L / (2.0 * math.pi), cmath.phase(offset) if offset else None)

    @property
    def _law(self) -> Law | None:
        law = Law(self.fluid.barus, self.fluid.density != "constant")
        return None if law == Law() else law

    def _pressure_unit(self, gap: Sum) -> float:
        """The power of ten next to mu U L/h^2 with the thinnest film, or to the largest pressure at a side, if that is more.

        p and r are then of like size, or p is what a film at rest has.
        """
        places = [(np.arange(SAMPLES) + 0.5) / SAMPLES * length for length in self.side_lengths]
        h = gap(places[0][None, :], places[1][:, None] if self.dimension == 2 else None)
        positive = h[np.isfinite(h) & (h > 0)]
        if not positive.size:
            return 1e6  # the discretisation says where the film is not positive
        drag = self.mu_0 * abs(self.U) * self.L / float(positive.min()) ** 2
        unit = max(drag, *(side.p for side in self._sides()), *(max(one.p, one.p_s) for one in self._supplies()))
        return 10.0 ** round(math.log10(unit)) if 1e-90 < unit < 1e90 else 1e6

    def exact(self) -> ExactSolution | None:
        gap, (west, east, *_) = self.gap, self._sides()
        if (
            self.dimension == 2
            or {west.kind, east.kind} != {"open"}
            or west.r
            or not gap.smooth_between
            or self._law
            or self.supply
            or effects_of(self)
        ):
            return None
        return exact_either_way(gap, self.L, self.mu_0, self.U, west.p, east.p)

    def build(self, comm: PETSc.Comm | None = None) -> LubricationProblem:
        """The discrete problem on this scene's grid. Collective.

        Raises
        ------
        InputError : more ranks than the grid can be dealt to, a film that is not positive, a profile that cannot be read.
        """
        model = self.model
        try:
            return model.build(self.shape, comm)
        except InputError as error:
            raise InputError(f"{self.name}: {error}") from None
