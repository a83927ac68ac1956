"""Scenes whose films are hard on solvers: dimples and roughness."""

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from ..problems.film.textures import Dimples, Rough
from .published import LubricationScene, SliderScene
from .scene import NotNegative, Positive
from .units import metres


class TexturedScene(LubricationScene):
    """Textured slider of the FBNS codes: 80 mm square, K x K cells with a square dimple each, 100 kPa all round.

    The reference grid has 30 K interior points a side; others see the same film. mean_cubes is the reference's, of its scheme
    'upwind' alone unless it is given.
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

    @property
    def gap(self) -> Dimples:
        return Dimples(self.h, self.depth, self.L, self.K, edged=self.scheme == "face" and not self.mean_cubes)


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

    @property
    def gap(self) -> Any:
        wave = super().gap
        return Rough(wave, self.amplitude, self.seed, self.cells, (self.L, self.width or self.L), self.h_floor)
