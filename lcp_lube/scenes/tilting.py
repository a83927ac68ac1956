"""Journal bearings of separate pads, fixed or tilting about pivots, under a load of given direction."""

import math
from dataclasses import replace
from typing import Annotated

from pydantic import Field

from ..problems.film.bore import PadBore, PadLever
from ..problems.film.grooves import Groove
from ..problems.film.model import Model
from .balance import BalanceTable
from .effects.table import WithEffects
from .scene import Finite, NotNegative, Positive
from .shaft import ShaftScene
from .units import measured, metres


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
        if least - self.pad_deg < 360.0 / self.shape[0] * (1 - 1e-9):
            most, mesh = least - 360.0 / self.shape[0], f" with nx = {self.shape[0]}, whose mesh is wider than the gap"
            apart = f"pads {least:g} degrees apart " + ("overlap" if self.pad_deg >= least else f"touch{mesh}")
            raise ValueError(f"pad_deg = {self.pad_deg:g}: {apart}; at most {most:g} is allowed")
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
        nx, above, levers = self.shape[0], min(self.p_groove, self.p_end), []
        for k, (pivot, behind) in enumerate(zip(self.pivots_deg, self.grooves, strict=True)):
            before = self.grooves[k - 1]
            first = before.first + before.count
            levers.append(PadLever(self.turning, math.radians(pivot), first, (behind.first - first) % nx, nx, above))
        return replace(super()._model(), levers=tuple(levers))

    @property
    def edges_deg(self) -> list[float]:
        """Of the pads, from the first one's outlet on, degrees."""
        return [at - self.pivots_deg[0] - edge for at in self.pivots_deg for edge in (0.0, self.pad_deg)]

    @property
    def grooves(self) -> tuple[Groove, ...]:
        """The columns between the pads, whose edges are points of the grid: that behind pad k is the k-th."""
        nx, meshes = self.shape[0], self.shape[0] / 360.0
        first = self.pivots_deg[0] + (1.0 - self.pivot_part) * self.pad_deg
        out = []
        for at, behind in zip(self.pivots_deg, [*self.pivots_deg[1:], self.pivots_deg[0] + 360.0], strict=True):
            start = round((at + (1.0 - self.pivot_part) * self.pad_deg - first) * meshes)
            end = round((behind - self.pivot_part * self.pad_deg - first) * meshes)
            out.append(Groove(start % nx, max(1, end - start + 1), self.p_groove))
        return tuple(out)
