"""Journal bearings of separate pads, fixed or tilting about pivots, under a load of given direction."""

import math
from dataclasses import replace
from typing import Annotated

import numpy as np
from pydantic import Field

from ..problems.film.bore import PadBore, PadLever
from ..problems.film.model import Model
from .balance import BalanceTable
from .effects.table import WithEffects
from .scene import Finite, NotNegative, Positive
from .shaft import ShaftScene
from .units import measured, metres

NARROWEST = 0.01  # gap between two pads, degrees


class TiltingPadScene(ShaftScene, WithEffects):
    """A journal in pads that tilt about their pivots; 2D. Angles are counted from the load, in the sense of rotation.

    The pads' tilts are found at which no moment acts about any pivot, and with balance.load the journal's place at which the
    films carry the load.
    clearance is that of the assembled bearing: between the journal in the middle and a pad at its pivot.
    preload m makes the pads' own bore wider, clearance/(1 - m). Between pads p_groove holds. With `tilts` given they are fixed.
    """

    clearance: Positive = metres(1e-4, "radial clearance at the pivots, the journal in the middle")
    preload: Annotated[Finite, Field(ge=0, lt=1, description="of the pads: 1 - clearance over that of their own bore")] = 0.3
    pivots_deg: list[Finite] = Field(
        [36.0, 108.0, 180.0, 252.0, 324.0], min_length=1, description="pivots of the pads, degrees from the load, ascending"
    )
    pad_deg: Annotated[Finite, Field(gt=0, lt=360, description="extent of each pad, degrees")] = 60.0
    pivot_part: Annotated[Finite, Field(gt=0, lt=1, description="where the pivot is, in parts of the pad from its inlet")] = 0.5
    tilts: list[Finite] | None = Field(
        None, description="tilts of the pads, rad, positive: inlet open; default: as they follow"
    )
    eccentricity: Annotated[Finite, Field(ge=0, lt=2, description="of the journal over the clearance")] = 0.3
    attitude_deg: Finite = Field(0.0, description="from the load to the journal's displacement, degrees")
    p_groove: NotNegative = measured("Pa", 0.0, "pressure between the pads, above p_c")
    balance: BalanceTable | None = Field(None, description="load to carry; the journal's place is found for it")

    def check(self) -> None:
        super().check()
        if sorted(self.pivots_deg) != self.pivots_deg or self.pivots_deg[-1] - self.pivots_deg[0] >= 360.0:
            raise ValueError(f"pivots_deg = {self.pivots_deg}: ascending angles within a turn are needed")
        if self.pad_deg / 360.0 * self.shape[0] < 8:
            needed = math.ceil(2880 / self.pad_deg)
            raise ValueError(f"nx = {self.shape[0]}: pads of {self.pad_deg:g} degrees need {needed} points around")
        turn = [*self.pivots_deg[1:], self.pivots_deg[0] + 360.0]
        least = min(b - a for a, b in zip(self.pivots_deg, turn, strict=True))
        if least - self.pad_deg < NARROWEST * (1 - 1e-9):
            apart = f"pads {least:g} degrees apart " + ("overlap" if self.pad_deg >= least else "touch")
            raise ValueError(f"pad_deg = {self.pad_deg:g}: {apart}; at most {least - NARROWEST:g} is allowed")
        if self.tilts is not None and len(self.tilts) != len(self.pivots_deg):
            raise ValueError(f"tilts = {self.tilts}: {len(self.pivots_deg)} values are needed, one a pad")
        if self.balance is not None and self.balance.vary not in (None, "eccentricity"):
            raise ValueError(f"balance.vary = {self.balance.vary}: the journal's place follows from the load: eccentricity")
        self._check_motion()

    @property
    def pads_follow(self) -> bool:
        return self.tilts is None

    @property
    def start(self) -> float:
        """The first pad's outlet."""
        return math.radians(self.pivots_deg[0] + (1.0 - self.pivot_part) * self.pad_deg)

    @property
    def gap(self) -> PadBore:
        """The film h(x, y), m."""
        middles = (at + (0.5 - self.pivot_part) * self.pad_deg for at in self.pivots_deg)
        return PadBore(
            self.turning,
            self.eccentricity,
            math.radians(self.attitude_deg),
            self.clearance / (1.0 - self.preload),
            math.radians(0.5 * self.pad_deg),
            tuple(map(math.radians, middles)),
            tuple(map(math.radians, self.pivots_deg)),
            tuple(self.tilts or [0.0] * len(self.pivots_deg)),
        )

    def _model(self) -> Model:
        """With the levers of the pads' moments."""
        model, L = super()._model(), math.pi * self.D
        x, above, levers = model.columns(self.shape), min(self.p_groove, self.p_end), []
        steps = np.remainder(np.diff(x, append=x[:1]), L)  # behind each column
        for k, (pivot, behind) in enumerate(zip(self.pivots_deg, model.grooves, strict=True)):
            before = model.grooves[k - 1]
            west, (east, _) = sum(before.columns(x, L)) - 1, behind.columns(x, L)
            own, others = steps[[west % x.size, east - 1]], steps[[west - 1, east]]
            start, length = before.end % L, (behind.start - before.end) % L
            levers.append(PadLever(self.turning, math.radians(pivot), start, length, tuple(own / (own + others)), above))
        return replace(model, levers=tuple(levers))

    @property
    def edges_deg(self) -> list[float]:
        turn = [*self.pivots_deg[1:], self.pivots_deg[0] + 360.0]
        pairs = zip(self.pivots_deg, turn, strict=True)
        return [edge - self.pivots_deg[0] for at, behind in pairs for edge in (at, behind - self.pad_deg)]
