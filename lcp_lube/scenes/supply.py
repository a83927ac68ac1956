"""[[supply]] of a scene file: holes, grooves and recesses inside a film, and what feeds them."""

import math
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from ..problems.film.supplies import Patch, Region, Supply, Where
from .formula import Formula
from .scene import Finite, Positive
from .units import Measured, measured, metres

Span = tuple[Finite, Finite]
SLACK = 1e-6  # of a side: a supply may reach so far beyond it
LATTICE, CLOSER = 101, 12  # values of a formula along a side among which a positive one is looked for, and how often nearer


@dataclass(frozen=True)
class Place:
    """What a supply needs of its scene: side lengths (m), whether it closes in x, p_c (Pa absolute), and where angles are."""

    lengths: tuple[float, ...]
    ring: bool
    p_c: float
    radius: float | None = None  # of a journal, m
    start: float = 0.0  # its angle at x = 0, rad
    p_least: float = 0.0  # the smallest pressure at a side, Pa absolute


class SupplyTable(Measured):
    """A supply inside the film, its cells at one pressure: given, or that of a flow or of a restrictor before it."""

    shape: Literal["rectangle", "hole", "axial_groove", "circumferential_groove", "formula"] = Field(
        "rectangle",
        description="an axial groove reaches right across unless y or length say otherwise; a circumferential one round",
    )
    x: Span | None = metres(None, "where it starts and ends in x")
    y: Span | None = metres(None, "where it starts and ends in y (2D)")
    at: Span | None = metres(None, "x and y of a hole's middle")
    diameter: Positive | None = metres(None, "of a hole")
    angle_deg: Finite | None = Field(None, description="of its middle on a journal, degrees from the load (or from x = 0)")
    extent_deg: Annotated[Finite, Field(gt=0, le=360)] | None = Field(None, description="its extent round a journal, degrees")
    middle: Finite | None = metres(None, "y of its middle; default the film's")
    length: Positive | None = metres(None, "its extent in y")
    where: str | None = Field(None, description="formula in x and y (m), positive inside")
    p: Finite | None = measured("Pa", None, "pressure of its cells")
    flow: Annotated[Finite, Field(ge=0)] | None = measured("m3/s or m2/s", None, "volume flow that it gives to the film")
    restrictor: Literal["capillary", "orifice"] | None = Field(
        None, description="capillary: flow = K (p_s - p); orifice: flow = K sqrt(p_s - p)"
    )
    K: Positive | None = Field(None, description="the restrictor's; m3/s per Pa, or per sqrt(Pa)")
    p_s: Finite | None = measured("Pa", None, "pressure before the restrictor")
    backflow: bool = Field(
        False, description="whether oil may flow back through a restrictor where the film's pressure is above p_s"
    )

    def check(self) -> None:
        given = [name for name in ("p", "flow", "restrictor") if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(f"{' and '.join(given) or 'no source'} given: one of p, flow, restrictor is needed")
        for name in ("K", "p_s"):
            if (getattr(self, name) is None) == (self.restrictor is not None):
                raise ValueError(f"{name}: a restrictor has K and p_s, no other supply has")
        needed = {"hole": ("diameter",), "formula": ("where",)}.get(self.shape, ())
        for name in needed:
            if getattr(self, name) is None:
                raise ValueError(f"{name} is missing: a supply of shape {self.shape} needs it")
        for name, span in (("x", self.x), ("y", self.y)):
            if span is not None and not span[0] < span[1]:
                raise ValueError(f"{name} = {list(span)}: start < end is needed")
        if self.where is not None:
            Formula(self.where)

    def supply(self, place: Place) -> Supply:
        """The supply in its scene.

        Raises
        ------
        ValueError : a place that is not in the film, or not said; a pressure below the cavitation pressure or the film's.
        """
        region = self._region(place)
        if self.p is not None:
            if self.p < place.p_c:
                raise ValueError(f"p = {self.p:g}: at least the cavitation pressure p_c = {place.p_c:g} is needed")
            return Supply(region, p=self.p - place.p_c)
        if self.flow is not None:
            return Supply(region, flow=self.flow)
        assert self.K is not None and self.p_s is not None  # as `check` found
        if not self.p_s > place.p_least:
            raise ValueError(
                f"p_s = {self.p_s:g}: more than the film's least pressure at a side, {place.p_least:g} Pa, is needed"
            )
        return Supply(region, law=self.restrictor, K=self.K, p_s=self.p_s - place.p_c, backflow=self.backflow)

    def _region(self, place: Place) -> Region:
        L, width = place.lengths[0], place.lengths[1] if len(place.lengths) == 2 else math.inf
        if self.where is not None and self.shape == "formula":
            return Where(Formula(self.where), _deepest(Formula(self.where), place.lengths))
        x, half_x = self._along(place)
        y, half_y = self._across(width)
        if not place.ring:
            _check_inside("x", x, half_x, L)
        if width < math.inf:
            _check_inside("y", y, half_y, width)
        return Patch(x, y, half_x, half_y, self.shape == "hole", L if place.ring else None)

    def _along(self, place: Place) -> tuple[float, float]:
        """Middle and half extent in x."""
        L = place.lengths[0]
        if self.shape == "circumferential_groove" and self.x is None and self.extent_deg is None:
            return 0.5 * L, math.inf
        if self.at is not None and self.diameter is not None:
            return self.at[0], 0.5 * self.diameter
        if self.x is not None:
            return 0.5 * (self.x[0] + self.x[1]), 0.5 * (self.x[1] - self.x[0])
        if self.angle_deg is not None and place.radius is not None:
            x = (math.radians(self.angle_deg) - place.start) * place.radius
            x = x % L if not 0 <= x <= L else x
            if self.shape == "hole" and self.diameter is not None:
                return x, 0.5 * self.diameter
            if self.extent_deg is not None:
                return x, 0.5 * math.radians(self.extent_deg) * place.radius
            raise ValueError("extent_deg is missing: it says how far round the supply reaches")
        if self.angle_deg is not None:
            raise ValueError(f"angle_deg = {self.angle_deg:g}: the film is no journal's; x is needed")
        raise ValueError(f"a supply of shape {self.shape} needs x, or angle_deg{', or at' if self.shape == 'hole' else ''}")

    def _across(self, width: float) -> tuple[float, float]:
        """Middle and half extent in y."""
        middle = 0.5 * width if self.middle is None else self.middle
        if width == math.inf:
            return 0.0, math.inf
        if self.shape == "hole" and self.diameter is not None:
            return (self.at[1] if self.at is not None else middle), 0.5 * self.diameter
        if self.y is not None:
            return 0.5 * (self.y[0] + self.y[1]), 0.5 * (self.y[1] - self.y[0])
        if self.length is not None:
            return middle, 0.5 * self.length
        if self.shape == "axial_groove":
            return 0.5 * width, math.inf
        raise ValueError(f"a supply of shape {self.shape} needs y, or length")


def _deepest(where: Formula, lengths: tuple[float, ...]) -> tuple[float, float]:
    """A point at which a formula is positive: where its supply lies on grids too coarse to have a point in it.

    The largest of LATTICE values along each side of the film, and of as many about it, ever nearer, until one is positive.

    Raises
    ------
    ValueError : none is.
    """
    sides = np.array([*lengths, 0.0][:2])
    low, high = 0.0 * sides, sides
    for _ in range(CLOSER):
        x, y = np.linspace(low, high, LATTICE).T
        values = np.broadcast_to(np.nan_to_num(where(x, y[:, None]), nan=-np.inf), (LATTICE, LATTICE))
        j, i = np.unravel_index(np.argmax(values), values.shape)
        best, reach = np.array([x[i], y[j]]), 0.1 * (high - low)
        if values[j, i] > 0:
            return float(x[i]), float(y[j])
        low, high = np.maximum(best - reach, 0.0), np.minimum(best + reach, sides)
    size = " x ".join(f"{side:g}" for side in lengths)
    raise ValueError(f"where = {where.text}: positive nowhere in the film, which is {size} m: the supply lies outside it")


def _check_inside(axis: str, middle: float, half: float, length: float) -> None:
    if half < math.inf and not (middle - half >= -SLACK * length and middle + half <= (1.0 + SLACK) * length):
        start, end = middle - half, middle + half
        raise ValueError(f"{axis} = {start:g} to {end:g} m lies outside the film, which is 0 to {length:g} m")


def supplies_of(tables: list[SupplyTable], place: Place) -> tuple[Supply, ...]:
    """All supplies of a scene.

    Raises
    ------
    ValueError : as `SupplyTable.supply`, with the supply's number.
    """
    out: list[Any] = []
    for number, table in enumerate(tables, start=1):
        try:
            out.append(table.supply(place))
        except ValueError as error:
            raise ValueError(f"supply.{number}: {error}") from None
    return tuple(out)
