"""Thrust bearings: equal sectors side by side, one of which is solved in polar coordinates."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field

from ..base.parallel import Array
from ..problems.film.model import Model, Side
from ..problems.film.shapes import Along, Block, Shape, Sum
from ..problems.film.slanted import SpiralGrooves
from .balance import BalanceTable
from .effects.table import WithEffects
from .film import FilmPart
from .scene import Count, Finite, NotNegative, Positive
from .supply import Place, SupplyTable, supplies_of
from .units import measured, metres


@dataclass(frozen=True)
class _Tilt:
    """Rise of a sector's point, by its arc x at the mean radius and y beyond the inner one, about the radius at `at`; about the
    circle of radius `about` if that is given. by : the angle, rad."""

    inner: float
    mean: float
    at: float
    about: float | None = None
    by: float = 1.0

    def __call__(self, x: Array, y: Array) -> Array:
        radius, angle = self.inner + y, x / self.mean - self.at
        return self.by * (-radius * np.sin(angle) if self.about is None else radius * np.cos(angle) - self.about)


class ThrustScene(WithEffects):
    """A thrust bearing of equal sectors under a flat runner that turns towards larger angles; 2D, polar coordinates.

    Lines run along the angle: x is the arc at the mean radius from where the runner enters, y the radius beyond the inner one.
    What is printed is of the whole bearing, fields are of one sector. Profiles: flat; tapered_land, a film that falls by
    `taper` over taper_part of the pad's angle, and a flat land (taper_part = 1: an inclined sector); step, by `taper` at
    taper_part; spiral, grooves of depth `taper`, one of them with its land a sector. With pivot_part the pads tilt, h_min being
    the film at the pivot.
    """

    D_inner: Positive = metres(0.06, "inner diameter")
    D_outer: Positive = metres(0.12, "outer diameter")
    pads: Annotated[int, Field(strict=True, ge=1, le=10_000)] = Field(6, description="number of pads, or of spiral grooves")
    pad_deg: Annotated[Finite, Field(gt=0, le=360)] | None = Field(
        None, description="angle of a pad, degrees; between pads p_groove holds; default: no grooves, the film is periodic"
    )
    profile: Literal["flat", "tapered_land", "step", "spiral"] = Field("tapered_land", description="form of the pads")
    h_min: Positive = metres(2.5e-5, "film on the lands")
    taper: NotNegative = metres(0.0, "by how much the film is larger where the runner enters, or in a groove")
    taper_part: Annotated[Finite, Field(gt=0, le=1)] = Field(0.8, description="part of the pad's angle before the flat land")
    angle_deg: Annotated[Finite, Field(gt=-90, lt=90)] = Field(
        15.0, description="of spirals against the motion, degrees; negative: they pump outwards"
    )
    ratio: Annotated[Finite, Field(gt=0, lt=1)] = Field(0.5, description="groove over groove and land, of spirals")
    seal: NotNegative = metres(0.0, "width at the inner radius without spirals (angle below 0: at the outer one)")
    pivot_part: Annotated[Finite, Field(gt=0, lt=1)] | None = Field(
        None, description="pads tilt about a pivot at this part of their angle from the inlet; default: fixed pads"
    )
    pivot_radius: Positive | None = metres(None, "of a pivot that is a point; default: a radial line")
    pitch: Finite | None = Field(
        None, description="tilt about the radius through the pivot, rad, positive: inlet open; default: found"
    )
    roll: Finite | None = Field(None, description="tilt across, rad, positive: outer radius open; default: found on a point")
    film: list[FilmPart] = Field([], description="shapes that are added to the film; x along the mean radius, y outwards")
    speed_rpm: Positive = Field(3000.0, description="speed of the runner, rpm")
    mu: Positive = measured("Pa s", 0.02, "viscosity")
    p_inner: NotNegative = measured("Pa", 0.0, "pressure at the inner radius, above p_c")
    p_outer: NotNegative = measured("Pa", 0.0, "pressure at the outer radius, above p_c")
    p_groove: NotNegative = measured("Pa", 0.0, "pressure between the pads, above p_c")
    p_c: Finite = measured("Pa", 0.0, "cavitation pressure")
    supply: list[SupplyTable] = Field([], description="supplies inside each pad; pressures are absolute")
    h_offset: Finite = metres(0.0, "added to the film everywhere: its level")
    balance: BalanceTable | None = Field(None, description="load for the whole bearing to carry, and what is found for it")
    scheme: Literal["face"] = Field("face", description="form of the Couette flux")
    n: Count = Field(100, description="points along a pad, and half of them across")
    nx: Count | None = Field(None, description="points along the angle; default n")
    ny: Count | None = Field(None, description="points along the radius; default half of n")

    def check(self) -> None:
        super().check()
        if not self.D_inner < self.D_outer:
            raise ValueError(f"D_inner = {self.D_inner:g}: less than D_outer = {self.D_outer:g} is needed")
        if self.pad_deg is not None and self.pads * self.pad_deg > 360.0 * (1 + 1e-9):
            raise ValueError(f"pads = {self.pads}, pad_deg = {self.pad_deg:g}: pads overlap; {360 / self.pads:g} deg at most")
        if self.profile == "spiral" and (self.pad_deg is not None or not self.angle_deg):
            raise ValueError("profile = spiral: a sector is a groove and its land; neither pad_deg nor angle_deg = 0")
        if self.profile != "spiral" and self.pad_deg is None and not max(self.p_inner, self.p_outer) > 0 and not self.supply:
            raise ValueError("pad_deg is missing: without grooves between the pads p_inner or p_outer > 0 has to feed them")
        if self.pivot_part is None and (self.pivot_radius or self.pitch or self.roll):
            raise ValueError("pivot_part is missing: pads that tilt have a pivot")
        if self.pivot_part is not None and self.pad_deg is None:
            raise ValueError(f"pivot_part = {self.pivot_part:g}: pads that tilt are apart: pad_deg is needed")
        if self.pivot_radius is not None and not self.D_inner < 2 * self.pivot_radius < self.D_outer:
            raise ValueError(f"pivot_radius = {self.pivot_radius:g}: between the inner and the outer radius is needed")
        if self.pivot_part is not None and self.balance is not None and self.balance.vary not in (None, "h_min"):
            raise ValueError(f"balance.vary = {self.balance.vary}: the film at the pivot follows from the load: h_min")
        self._supplies()
        self._check_motion()

    @property
    def tilts_found(self) -> tuple[bool, bool]:
        """Whether pitch and roll follow from the film."""
        tilts = self.pivot_part is not None
        return tilts and self.pitch is None, tilts and self.roll is None and self.pivot_radius is not None

    @property
    def pads_follow(self) -> bool:
        return any(self.tilts_found)

    def moved(self, place: Sequence[float]) -> Self:
        """The level, and behind it pitch and roll of pads that follow."""
        return self.model_copy(update=dict(zip(("h_offset", "pitch", "roll"), map(float, place), strict=False)))

    def _supplies(self) -> Any:
        least = min(self.p_inner, self.p_outer, *([] if self.pad_deg is None else [self.p_groove])) + self.p_c
        return supplies_of(self.supply, Place(self.side_lengths, self.pad_deg is None, self.p_c, p_least=least))

    @property
    def shape(self) -> tuple[int, ...]:
        return self.nx or self.n, self.ny or max(3, self.n // 2)

    @property
    def radii(self) -> tuple[float, float]:
        """The inner radius, and the mean one, m."""
        return 0.5 * self.D_inner, 0.25 * (self.D_inner + self.D_outer)

    @property
    def omega(self) -> float:
        """Angular velocity, rad/s."""
        return 2.0 * math.pi * self.speed_rpm / 60.0

    @property
    def U(self) -> float:
        """Speed of the runner at the mean radius, m/s."""
        return self.radii[1] * self.omega

    @property
    def side_lengths(self) -> tuple[float, float]:
        """Arc of a sector at the mean radius, and its width, m."""
        angle = 360.0 / self.pads if self.pad_deg is None else self.pad_deg
        return math.radians(angle) * self.radii[1], 0.5 * (self.D_outer - self.D_inner)

    @property
    def gap(self) -> Sum:
        """The film h(x, y), m."""
        L, inf = self.side_lengths[0], math.inf
        parts: list[Shape] = [Block(self.h_min + self.h_offset, (-inf, inf), (-inf, inf))]
        if self.profile == "tapered_land":
            parts.append(Along("linear", self.taper, 0.0, 0.0, self.taper_part * L))
        elif self.profile == "step":
            parts.append(Block(self.taper, (-inf, self.taper_part * L), (-inf, inf)))
        elif self.profile == "spiral":
            inner, outer = 0.5 * self.D_inner, 0.5 * self.D_outer
            between = (inner + self.seal, outer) if self.angle_deg > 0 else (inner, outer - self.seal)
            angle = math.radians(self.angle_deg)
            parts.append(SpiralGrooves(self.taper, self.pads, angle, self.ratio, between, self.radii))
        if self.pivot_part is not None:
            pitch, roll = self.tilt_modes
            parts += [replace(pitch, by=self.pitch or 0.0), replace(roll, by=self.roll or 0.0)]
        return Sum([*parts, *self.shapes_of(self.film)])

    @property
    def tilt_modes(self) -> tuple[Any, Any]:
        """dh of a tilt about the radius through the pivot that opens the inlet, and of one that opens the outer radius."""
        (L, _), (inner, mean) = self.side_lengths, self.radii
        at, radius = (self.pivot_part or 0.0) * L / mean, self.pivot_radius or mean
        return _Tilt(inner, mean, at), _Tilt(inner, mean, at, radius)

    def _model(self) -> Model:
        """One sector."""
        along = Side("periodic") if self.pad_deg is None else Side(p=self.p_groove)
        least = self.h_min + self.h_offset
        drag = self.mu_0 * self.U * self.side_lengths[0] / least**2 if least > 0 else 1.0
        return Model(
            lengths=self.side_lengths,
            sides=(along, along, Side(p=self.p_inner), Side(p=self.p_outer)),
            gap=self.gap,
            mu=self.mu_0,
            U=self.U,
            p_c=self.p_c,
            p_unit=10.0 ** round(math.log10(max(drag, self.p_inner, self.p_outer, self.p_groove, 1e-90))),
            scheme="face",
            extras=self.bearing_numbers,
            polar=self.radii,
            levers=() if self.pivot_part is None else self.tilt_modes,
            supplies=self._supplies(),
        )

    def bearing_numbers(self, values: dict[str, Any]) -> dict[str, Any]:
        """The whole bearing's numbers from one sector's."""
        n = self.pads
        flow = {side: n * value for side, value in values["flow"].items()}
        keys = ("load", "pressure_integral", "cavitated_area", "friction", "friction_torque", "side_leakage")
        total = {key: n * values[key] for key in keys}
        total |= {key: n * values[key] for key in ("heat_power", "heat_out", "heat_stored") if key in values}
        if "supply_flow" in values:
            total["supply_flow"] = [n * value for value in values["supply_flow"]]
        return total | {
            "pad_load": values["load"],
            "flow": flow,
            "inner_flow": flow["south"],
            "outer_flow": flow["north"],
            "power_loss": total["friction_torque"] * self.omega,
        }
