"""Films with preset data: the published problems' sliders, rough ones among them, and the textured slider of the FBNS codes."""

from collections.abc import Sequence
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from ..problems.film.model import Side
from ..problems.film.shapes import MEAN_SQUARE, Along, Block, DimpleArray, RandomSurface, Shape
from ..problems.film.views import Travelling
from .effects.table import WithEffects
from .film_scene import ALL, RectangleScene, Sides
from .scene import Finite, NotNegative, Positive
from .units import measured, metres


class LubricationScene(RectangleScene, WithEffects):
    """A film between sides whose pressures are given, above the cavitation pressure p_c, which is added to what is reported."""

    mu: Positive = measured("Pa s", 0.015, "viscosity")
    p_a: NotNegative = measured("Pa", 0.0, "pressure at x = 0; above p_c")
    p_b: NotNegative = measured("Pa", 0.0, "pressure at x = L; above p_c")
    p_side: NotNegative = measured("Pa", 0.0, "pressure at y = 0 and y = width; above p_c (2D)")
    p_c: Finite = measured("Pa", 0.0, "cavitation pressure")

    def check(self) -> None:
        super().check()
        if self.dimension == 1 and self.p_side:
            raise ValueError(f"p_side = {self.p_side}: the scene is one-dimensional")

    @property
    def cavitation_pressure(self) -> float:
        return self.p_c

    def _sides(self) -> Sides:
        west, east, ends = (Side(p=p) for p in (self.p_a, self.p_b, self.p_side))
        return west, east, ends, ends


class SurfaceScene(LubricationScene):
    """One with a surface that may be the moving wall's."""

    moves: bool = Field(False, description="[motion]: wave, roughness or dimples travel with the wall, periodically over L")

    def check(self) -> None:
        super().check()
        self._check_motion()

    def on_wall(self, shape: Shape) -> Shape:
        """A shape, travelling if it does."""
        return Travelling(shape, self._travel, self.side_lengths[0]) if self.moves and self._travel else shape


class SliderScene(SurfaceScene):
    """A slider with one wave of the film; defaults are the published problems' data."""

    film: Literal["sinusoid", "parabola"] = "sinusoid"
    form: Literal["convergent-divergent", "divergent-convergent"] = "convergent-divergent"
    wave: tuple[NotNegative, NotNegative] = Field((0.0, 1.0), description="where the wave starts and ends, in parts of L")
    h_min: Positive = metres(15e-6, "smallest film")
    h_max: Positive = metres(25e-6, "largest film")
    scheme: Literal["nodal", "face", "upwind"] = Field("nodal", description="form of the Couette flux")

    def check(self) -> None:
        super().check()
        if self.h_max < self.h_min:
            raise ValueError(f"h_max = {self.h_max:g}: at least h_min = {self.h_min:g} is needed")
        if not self.wave[0] < self.wave[1] <= 1:
            raise ValueError(f"wave = {list(self.wave)}: 0 <= start < end <= 1 is needed")

    @property
    def _wave(self) -> Shape:
        heights = (self.h_min, self.h_max) if self.form == "convergent-divergent" else (self.h_max, self.h_min)
        start, end = (self.L * part for part in self.wave)
        return Along(self.film, *heights, start, end)

    def _parts(self) -> Sequence[Shape]:
        return [self.on_wall(self._wave)]


class RoughScene(SliderScene):
    """Problem 1's wave over a square, with a random surface, by default 0.1 MPa all round.

    The surface is a smooth spline through random numbers of standard deviation `amplitude`; its own is 0.479 of that, before
    the cut at h_floor. (A bearing's shape `roughness` takes the surface's own, sigma.)
    """

    dimension: Literal[2] = 2
    seed: Annotated[int, Field(ge=0)] = 1
    amplitude: NotNegative = metres(2.5e-6, "standard deviation of the random numbers; the surface's is 0.479 of it")
    cells: Annotated[int, Field(strict=True, ge=1, le=4000)] = Field(40, description="meshes of the surface along a side")
    h_floor: Positive = metres(1e-6, "smallest film that the surface leaves")
    scheme: Literal["nodal", "face", "upwind"] = "face"
    p_a: NotNegative = 1e5
    p_b: NotNegative = 1e5
    p_side: NotNegative = 1e5

    def _parts(self) -> Sequence[Shape]:
        surface = RandomSurface(self.amplitude * MEAN_SQUARE, self.seed, self.cells, self.extent.both)
        return [self._wave, self.on_wall(surface)]


class TexturedScene(SurfaceScene):
    """Textured slider of the FBNS codes: 80 mm square, K x K cells with a square dimple each, 100 kPa all round.

    The reference grid has 30 K interior points a side; a dimple has 20 of a cell's 30, and a rim at half depth of one more on
    either side. Edges lie half-way between these points: other grids see the same film. mean_cubes is the reference's, of its
    scheme 'upwind' alone unless it is given.
    """

    dimension: Literal[2] = 2
    L: Positive = 0.08
    K: Annotated[int, Field(ge=1, le=1000, description="cells a side")] = 4
    h: Positive = metres(15e-6, "film between the dimples")
    depth: Positive = metres(12e-6, "depth of the dimples")
    mu: Positive = 0.03
    p_a: NotNegative = 70e3
    p_b: NotNegative = 70e3
    p_side: NotNegative = 70e3
    p_c: float = 30e3
    scheme: Literal["nodal", "face", "upwind"] = "upwind"
    mean_cubes: bool = True
    p_unit: Positive = 1e5

    @model_validator(mode="before")
    @classmethod
    def _reference_grid(cls, data: Any) -> Any:
        data = cls.in_si_units(data)
        if isinstance(data, dict) and "n" not in data and isinstance(data.get("K", 4), int):
            data = {**data, "n": 30 * data.get("K", 4)}
        if isinstance(data, dict) and data.get("scheme", "upwind") != "upwind":
            data = {"mean_cubes": False, **data}
        return data

    def _parts(self) -> Sequence[Shape]:
        mesh = self.L / (30 * self.K + 1)
        inside = (0.5 * mesh, (30 * self.K + 0.5) * mesh)
        halves = (DimpleArray("square", 0.5 * self.depth, m * mesh, self.K, self.K, inside, inside) for m in (22, 20))
        return [Block(self.h, ALL, ALL), *map(self.on_wall, halves)]
