"""Journals with axial grooves across the whole width, under a load of given direction; or without any groove."""

import math
from dataclasses import replace
from typing import Annotated

from pydantic import Field

from ..problems.film.bore import Bore, Dam
from ..problems.film.model import Model
from ..problems.film.supplies import Patch, Supply
from .balance import BalanceTable
from .effects.table import WithEffects
from .film import FilmPart
from .scene import Finite, NotNegative
from .shaft import ShaftScene
from .supply import Place, SupplyTable, supplies_of
from .units import metres


class GroovedJournalScene(ShaftScene, WithEffects):
    """A journal under a vertical load, its film cut by axial grooves that hold a pressure; 2D.

    Angles are counted from the line of the load, in the sense of rotation. The film is h = c (1 - eccentricity cos(theta -
    attitude)): thinnest at the attitude angle. With attitude_deg left out the attitude is found for which the film's force
    is opposite to the load. Without grooves the film goes round, fed by the ends, at p_end > 0.

    preload m moves the middle of each lobe between two grooves inwards by m c: its film is less by m c cos(theta - theta_lobe).
    tilt and tilt_across turn the shaft's axis in the plane of the load and across: the far end (y = B) comes nearer to
    theta = 0, and to theta = 90 degrees, by tilt times B/2, the other end moves away as much. dam_deg, dam_depth and dam_width
    say where the bore has a pressure dam, a recess about the middle of the width that ends in a step.
    """

    eccentricity: Annotated[Finite, Field(ge=0, lt=1, description="relative eccentricity")] = 0.5
    attitude_deg: Finite | None = Field(None, description="from the load to the thinnest film, degrees; default: as it follows")
    grooves_deg: list[Finite] = Field([90.0, 270.0], description="middles of the grooves, degrees from the load; [] for none")
    groove_deg: Annotated[Finite, Field(gt=0, lt=180, description="extent of each groove, degrees")] = 20.0
    preload: Annotated[Finite, Field(ge=0, lt=1, description="of the lobes between the grooves; 0: a round bush")] = 0.0
    tilt: Finite = Field(0.0, description="slope of the shaft in the plane of the load, rad")
    tilt_across: Finite = Field(0.0, description="slope of the shaft across the load, rad")
    barrel: Finite = metres(0.0, "by how much the film is larger at both ends: a barrel-shaped journal")
    dam_deg: tuple[Finite, Finite] | None = Field(
        None, description="where a pressure dam begins and ends, degrees from the load"
    )
    dam_depth: NotNegative = metres(0.0, "depth of the pressure dam")
    dam_width: Annotated[Finite, Field(gt=0, le=1)] = Field(0.75, description="width of the dam over the bearing's")
    film: list[FilmPart] = Field([], description="shapes that are added to the film; x from the first groove's edge")
    supply: list[SupplyTable] = Field([], description="supplies inside the film, beside the grooves; pressures are absolute")
    balance: BalanceTable | None = Field(None, description="load to carry; eccentricity and open attitude follow")

    def check(self) -> None:
        super().check()
        places = sorted(angle % 360.0 for angle in self.grooves_deg)
        gaps = [(b - a) % 360.0 or 360.0 for a, b in zip(places, [*places[1:], *places[:1]], strict=True)]
        if places and min(gaps) <= self.groove_deg:
            raise ValueError(f"grooves_deg = {self.grooves_deg}: grooves of {self.groove_deg:g} degrees overlap there")
        if self.balance is not None and self.balance.vary not in (None, "eccentricity"):
            raise ValueError(f"balance.vary = {self.balance.vary}: eccentricity is allowed, which follows from the load")
        if self.motion is not None and self.attitude_deg is None and not self.motion.moves_journal:
            raise ValueError("motion: attitude_deg, or where the journal is (motion.journal, file or free), is needed")
        if self.preload and len(places) < 2:
            raise ValueError(f"preload = {self.preload:g}: lobes lie between at least two grooves")
        if not places and not self.p_end > 0 and not self.supply:
            raise ValueError(f"p_end = {self.p_end:g}: without grooves the ends feed the film: p_end > 0 is needed")
        if self.shape[0] < 12 * max(1, len(places)):
            raise ValueError(f"nx = {self.shape[0]}: at least {12 * max(1, len(places))} points around are needed")
        if (self.dam_deg is None) != (not self.dam_depth):
            raise ValueError(f"dam_deg = {self.dam_deg}, dam_depth = {self.dam_depth:g}: a pressure dam has both")
        if self.dam_deg is not None and not 0 < self.dam_deg[1] - self.dam_deg[0] < 360:
            raise ValueError(f"dam_deg = {list(self.dam_deg)}: start < end < start + 360 is needed")
        self._supplies()
        self._check_motion()

    def _supplies(self) -> tuple[Supply, ...]:
        """The tables' supplies, and behind them the grooves, where there are both: cells held on the whole ring."""
        if not self.supply:
            return ()
        turning, L = self.turning, math.pi * self.D
        place = Place((L, turning.B), True, self.p_c, turning.R, turning.start, self.p_end + self.p_c)
        half = math.radians(0.5 * self.groove_deg) * turning.R
        middles = [(math.radians(at) - turning.start) * turning.R for at in self.grooves_deg]
        grooves = [Supply(Patch(x, 0.0, half, math.inf, period=L), p=self.p_groove) for x in middles]
        return (*supplies_of(self.supply, place), *grooves)

    @property
    def start(self) -> float:
        """The first groove's first edge."""
        return math.radians((self.grooves_deg or [180.0])[0] - 0.5 * (self.groove_deg if self.grooves_deg else 0.0))

    @property
    def gap(self) -> Bore:
        """The film h(x, y), m."""
        turning, dam = self.turning, None
        if self.dam_depth and self.dam_deg is not None:
            start, end = map(math.radians, self.dam_deg)
            dam = Dam(start, end, self.dam_width * turning.B, self.dam_depth)
        return Bore(
            turning,
            self.eccentricity,
            math.radians(self.attitude_deg or 0.0),
            self.preload,
            tuple(math.radians(angle) for angle in self.lobes_deg),
            self.tilt,
            self.tilt_across,
            self.barrel,
            dam,
            tuple(self.shapes_of(self.film)),
        )

    @property
    def lobes_deg(self) -> list[float]:
        """Middles of the lobes between neighbouring grooves, degrees."""
        places = sorted(angle % 360.0 for angle in self.grooves_deg)
        return [a + 0.5 * ((b - a) % 360.0) for a, b in zip(places, [*places[1:], *places[:1]], strict=True)]

    @property
    def edges_deg(self) -> list[float]:
        return [at - self.grooves_deg[0] + edge for at in self.grooves_deg for edge in (0.0, self.groove_deg)]

    def _model(self) -> Model:
        model = super()._model()
        return replace(model, grooves=(), supplies=self._supplies()) if self.supply else model
