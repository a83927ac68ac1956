"""Scene of a squeeze film: plates that approach and part, with a cavity that opens and fills again."""

import math
from typing import Annotated, ClassVar, Literal

from petsc4py import PETSc
from pydantic import Field

from ..problems.film.lubrication import LubricationProblem
from ..problems.film.model import Model, Side
from ..problems.film.shapes import Block, Sum
from ..problems.film.squeeze import Squeeze
from ..problems.film.turning import Turning
from .motion import MotionTable
from .moving import Models
from .scene import Count, NotNegative, Positive, Scene


class SqueezeScene(Scene):
    """Parallel plates, h = h_mean + h_amplitude cos(2 pi cycles t), 0 <= x <= 1, p = p_wall at both ends; dimensionless."""

    scheme: Literal["bdf2", "euler"] = Field("bdf2", description="time: two-step backward difference, or implicit Euler")
    h_mean: Positive = Field(0.375, description="mean gap")
    h_amplitude: NotNegative = Field(0.125, description="amplitude of the gap, less than the mean")
    cycles: Positive = Field(2.0, description="strokes in a unit of time")
    p_wall: NotNegative = Field(0.025, description="pressure at both ends above the cavitation pressure")
    t_end: Positive = Field(0.75, description="end of the march")
    front_time: Positive = Field(0.5, description="when the front's place is told")
    steps: Annotated[int, Field(strict=True, ge=2, le=10_000_000)] = Field(300, description="time steps")
    n: Count = Field(199, description="interior points")

    def check(self) -> None:
        if not self.h_amplitude < self.h_mean:
            raise ValueError(f"h_amplitude = {self.h_amplitude:g}: less than h_mean = {self.h_mean:g} is needed")

    @property
    def shape(self) -> tuple[int, ...]:
        return (self.n,)

    def with_shape(self, shape: tuple[int, ...]) -> "SqueezeScene":
        """Time steps in proportion: both errors are of the same order."""
        steps = max(2, round(self.steps * (shape[0] + 1) / (self.n + 1)))
        return self.model_copy(update={"n": shape[0], "steps": steps})

    def gap(self, t: float) -> float:
        """h at time t."""
        return self.h_mean + self.h_amplitude * math.cos(2.0 * math.pi * self.cycles * t)

    @property
    def motion(self) -> MotionTable:
        """The march: from a full film, in equal steps."""
        return MotionTable(t_end=self.t_end, steps=self.steps, scheme=self.scheme, start="full")

    turning: ClassVar[Turning | None] = None
    place: ClassVar[tuple[float, ...]] = (0.0,)
    pads_follow: ClassVar[bool] = False

    def models(self) -> Models:
        """The film at the time t: d/dx(h^3 dp/dx) = 2 d(h theta)/dt is that of a viscosity of 1/6."""
        p_wall, unit = Side(p=self.p_wall), self.p_wall or 1.0

        def at(t: float, journal: object) -> Model:
            h = Block(self.gap(t), (-math.inf, math.inf), (-math.inf, math.inf))
            return Model((1.0,), (p_wall, p_wall, p_wall, p_wall), Sum([h]), 1.0 / 6.0, 0.0, 0.0, unit, "face")

        return at

    def observer(self) -> Squeeze:
        """Who reads the events off the steps."""
        return Squeeze(self.p_wall, self.front_time)

    def build(self, comm: PETSc.Comm | None = None) -> LubricationProblem:
        """The full film at t = 0. Collective."""
        return self.models()(0.0, None).build(self.shape, comm)
