"""What journals under a load of given direction share, in one bush with grooves or in pads; 2D, unwrapped round the shaft."""

import math
from collections.abc import Sequence
from typing import Any, Literal, Self

import numpy as np
from pydantic import Field

from ..problems.film.grooves import Groove
from ..problems.film.model import Model, Side
from ..problems.film.reynolds import Film
from ..problems.film.turning import Turning
from .balance import BalanceTable
from .film_scene import FilmScene
from .scene import Count, Finite, NotNegative, Positive
from .units import measured, metres


class ShaftScene(FilmScene):
    """A journal of diameter D that turns at speed_rpm. Angles are counted from the load, in the sense of rotation."""

    D: Positive = metres(0.1, "diameter")
    L_over_D: Positive = Field(0.5, description="width over diameter")
    clearance: Positive = metres(1e-4, "radial clearance")
    speed_rpm: Positive = Field(3000.0, description="speed of the journal, rpm")
    mu: Positive = measured("Pa s", 0.02, "viscosity")
    eccentricity: float
    attitude_deg: Finite | None
    p_groove: NotNegative = measured("Pa", 0.0, "pressure in the grooves, above p_c")
    p_end: NotNegative = measured("Pa", 0.0, "pressure at both ends, above p_c")
    p_c: Finite = measured("Pa", 0.0, "cavitation pressure")
    scheme: Literal["face"] = Field("face", description="form of the Couette flux")
    n: Count = Field(360, description="points around, and an odd number near a sixteenth of them across")
    nx: Count | None = Field(None, description="points around; default n")
    ny: Count | None = Field(None, description="points across; default as n says")
    balance: BalanceTable | None

    @property
    def shape(self) -> tuple[int, ...]:
        return self.nx or self.n, self.ny or max(3, self.n // 16 | 1)

    @property
    def side_lengths(self) -> tuple[float, float]:
        return math.pi * self.D, self.L_over_D * self.D

    @property
    def omega(self) -> float:
        """Angular velocity, rad/s."""
        return 2.0 * math.pi * self.speed_rpm / 60.0

    @property
    def U(self) -> float:
        """Speed of the journal's surface, m/s."""
        return 0.5 * self.D * self.omega

    @property
    def start(self) -> float:
        """Angle of an edge on which points of the grid lie, rad."""
        raise NotImplementedError

    @property
    def turning(self) -> Turning:
        """Place x = 0 lies half a mesh before `start`."""
        start = self.start - math.pi / self.shape[0]
        widest = math.radians(self.attitude_deg or 0.0) + math.pi if self.eccentricity else None
        return Turning(0.5 * self.D, start, widest, c=self.clearance, B=self.L_over_D * self.D, omega=self.omega)

    @property
    def place(self) -> tuple[float, ...]:
        """[X, Y] of the journal, in parts of the clearance."""
        phi = math.radians(self.attitude_deg or 0.0)
        return self.eccentricity * math.cos(phi), self.eccentricity * math.sin(phi)

    def moved(self, place: Sequence[float]) -> Self:
        """Its `place`, and behind it the tilts of pads that follow."""
        x, y, *tilts = place
        found = {"eccentricity": math.hypot(x, y), "attitude_deg": math.degrees(math.atan2(y, x))}
        return self.model_copy(update={**found, "tilts": tilts} if tilts else found)

    @property
    def gap(self) -> Film:
        """The film h(x, y), m."""
        raise NotImplementedError

    @property
    def edges_deg(self) -> list[float]:
        """Where the grooves begin and end, one behind the other, degrees from `start`."""
        raise NotImplementedError

    @property
    def grooves(self) -> tuple[Groove, ...]:
        """What has p_groove."""
        x = (np.radians(self.edges_deg) + math.pi / self.shape[0]) * (0.5 * self.D)
        return tuple(Groove(float(a), float(b), self.p_groove) for a, b in zip(x[::2], x[1::2], strict=True))

    def _model(self) -> Model:
        turning, ends = self.turning, Side(p=self.p_end)
        return Model(
            lengths=self.side_lengths,
            sides=(Side("periodic"), Side("periodic"), ends, ends),
            gap=self.gap,
            mu=self.mu_0,
            U=self.U,
            p_c=self.p_c,
            p_unit=self.mu_0 * self.omega * (turning.R / self.clearance) ** 2,
            scheme="face",
            shaft=turning,
            grooves=self.grooves,
            extras=self.bearing_numbers,
        )

    def bearing_numbers(self, values: dict[str, Any]) -> dict[str, Any]:
        """Eccentricity and Sommerfeld numbers."""
        return self.turning.numbers(values["load"], self.mu_0, self.eccentricity)
