"""Sliders: films over [0, L] or a rectangle with preset data, those of the published problems among them."""

from typing import Literal

from pydantic import Field, model_validator

from ..problems.film.exact import ExactSolution
from ..problems.film.gaps import Raised, Wave
from ..problems.film.model import Model, Side
from ..problems.film.reynolds import Film
from ..problems.film.turned import exact_either_way
from .balance import BalanceTable
from .film_scene import FilmScene
from .scene import Count, Finite, NotNegative, Positive
from .units import measured, metres


class LubricationScene(FilmScene):
    """A film over [0, L] or [0, L] x [0, width], in SI units; a family adds its film, `gap`.

    Pressures are above the cavitation pressure p_c, which is added to what is reported.
    """

    dimension: Literal[1, 2] = 1
    L: Positive = metres(0.1, "length in the direction of motion")
    width: Positive | None = metres(None, "width Ly; default L (2D)")
    mu: Positive = measured("Pa s", 0.015, "viscosity")
    U: Finite = measured("m/s", 5.0, "speed of the moving wall; negative: to smaller x; 0: at rest")
    p_a: NotNegative = measured("Pa", 0.0, "pressure at x = 0; above p_c")
    p_b: NotNegative = measured("Pa", 0.0, "pressure at x = L; above p_c")
    p_side: NotNegative = measured("Pa", 0.0, "pressure at y = 0 and y = width; above p_c (2D)")
    p_c: Finite = measured("Pa", 0.0, "cavitation pressure")
    scheme: Literal["nodal", "face", "upwind"] = Field("face", description="form of the Couette flux")
    mean_cubes: bool = Field(False, description="h^3 at a face as the mean of the nodal values")
    p_unit: Positive = measured("Pa", 1e6, "pressure unit of the equations")
    h_offset: Finite = metres(0.0, "added to the film everywhere: its level")
    balance: BalanceTable | None = Field(None, description="load to carry, and what is found for it")
    n: Count = Field(100, description="interior points a side")
    nx: Count | None = Field(None, description="interior points in x; default n")
    ny: Count | None = Field(None, description="interior points in y; default n (2D)")

    @model_validator(mode="after")
    def _one_dimensional(self) -> "LubricationScene":
        for key in ("ny", "width", "p_side"):
            if self.dimension == 1 and getattr(self, key):
                raise ValueError(f"{key} = {getattr(self, key)}: the scene is one-dimensional")
        return self

    @property
    def shape(self) -> tuple[int, ...]:
        nx = self.nx or self.n
        return (nx,) if self.dimension == 1 else (nx, self.ny or self.n)

    @property
    def gap(self) -> Film:
        """The film h(x, y) in metres."""
        raise NotImplementedError

    def exact(self) -> ExactSolution | None:
        """The exact solution; None where none is known."""
        return None

    @property
    def sides(self) -> tuple[Side, Side, Side, Side]:
        """West, east, south and north: a pressure each, unless a family says otherwise."""
        west, east, ends = (Side(p=p) for p in (self.p_a, self.p_b, self.p_side))
        return west, east, ends, ends

    @property
    def model(self) -> Model:
        """What is discretised."""
        return Model(
            lengths=(self.L,) if self.dimension == 1 else (self.L, self.width or self.L),
            sides=self.sides,
            gap=Raised(self.gap, self.h_offset) if self.h_offset else self.gap,  # type: ignore[arg-type]
            mu=self.mu,
            U=self.U,
            p_c=self.p_c,
            p_unit=self.p_unit,
            scheme=self.scheme,
            mean_cubes=self.mean_cubes,
            exact=self.exact,
        )


class SliderScene(LubricationScene):
    """A slider with one wave of the film; defaults are the published problems' data."""

    film: Literal["sinusoid", "parabola"] = "sinusoid"
    form: Literal["convergent-divergent", "divergent-convergent"] = "convergent-divergent"
    wave: tuple[NotNegative, NotNegative] = Field((0.0, 1.0), description="where the wave starts and ends, in parts of L")
    h_min: Positive = metres(15e-6, "smallest film")
    h_max: Positive = metres(25e-6, "largest film")
    scheme: Literal["nodal", "face", "upwind"] = Field("nodal", description="form of the Couette flux")

    @model_validator(mode="after")
    def _consistent(self) -> "SliderScene":
        if self.h_max < self.h_min:
            raise ValueError(f"h_max = {self.h_max:g}: at least h_min = {self.h_min:g} is needed")
        if not self.wave[0] < self.wave[1] <= 1:
            raise ValueError(f"wave = {list(self.wave)}: 0 <= start < end <= 1 is needed")
        return self

    @property
    def gap(self) -> Wave:
        start, end = (self.L * part for part in self.wave)
        return Wave(self.film, self.form, self.h_min, self.h_max, start, end - start)

    def exact(self) -> ExactSolution | None:
        if self.dimension == 2:
            return None
        return exact_either_way(Raised(self.gap, self.h_offset), self.L, self.mu, self.U, self.p_a, self.p_b)
