"""Scenes of semilinear equations on the unit square: Bratu, and Poisson with a cubic term."""

from typing import Annotated, Any, ClassVar

import numpy as np
from petsc4py import PETSc
from pydantic import Field

from ..base.parallel import Array
from ..problems.grid import Grid
from ..problems.semilinear import Bratu, ManufacturedCubic, PoissonCubic, SemilinearProblem, Source, Surface
from .formula import Formula, FormulaText
from .scene import Count, Finite, NotNegative, Scene

Rectangle = tuple[tuple[float, float], tuple[float, float]]


class OneUnknownScene(Scene):
    """One unknown v on a rectangle."""

    n: Count = Field(64, description="interior points a side")
    nx: Count | None = Field(None, description="interior points in x; default n")
    ny: Count | None = Field(None, description="interior points in y; default n")

    @property
    def shape(self) -> tuple[int, ...]:
        return self.nx or self.n, self.ny or self.n

    @property
    def rectangle(self) -> Rectangle:
        """Where x and y start and end."""
        return (0.0, 1.0), (0.0, 1.0)

    def problem_on(self, grid: Grid) -> Any:
        """The discrete problem on a grid of the rectangle, or of a part of it (`problems.fold`). Collective."""
        raise NotImplementedError

    def build(self, comm: PETSc.Comm | None = None) -> Any:
        """The discrete problem on this scene's grid. Collective."""
        (x0, x1), (y0, y1) = self.rectangle
        return self.problem_on(Grid(self.shape, (x1 - x0, y1 - y0), comm, (x0, y0)))


class SemilinearScene(OneUnknownScene):
    """-Lap v = g(x, y, v) on the unit square, v given on its boundary; a subclass has g."""

    problem_kind: ClassVar[str] = "equations"
    v0: Finite = Field(0.0, description="start of v at every point")

    @property
    def source(self) -> Source:
        """The right-hand side g."""
        raise NotImplementedError

    @property
    def on_boundary(self) -> Surface | None:
        """v on the boundary; None for 0."""
        return None

    def inside(self, x: Array, y: Array) -> list[Array]:
        """What varies over the rectangle and is not v: the source, at v0 and beside it."""
        return [self.source.value(x, y, np.full(np.broadcast(x, y).shape, v)) for v in (self.v0, self.v0 + 1.0)]

    def problem_on(self, grid: Grid) -> SemilinearProblem:
        return SemilinearProblem(grid, self.source, self.v0, self.on_boundary)


class BratuScene(SemilinearScene):
    """-Lap v = lambda e^v."""

    lam: Finite = Field(1.0, alias="lambda", description="strength of the source; no solution beyond 6.808")

    @property
    def source(self) -> Source:
        return Bratu(self.lam)


class PoissonCubicScene(SemilinearScene):
    """-Lap v - v^3/(1 + x^2 + y^2) = 0, equation (9) of Bergamaschi and Zilli, who do not print the values on the boundary."""

    boundary: Annotated[float | str, FormulaText] = Field(1.0, description="v there, a number or a formula in x and y")

    @property
    def source(self) -> Source:
        return PoissonCubic()

    @property
    def on_boundary(self) -> Surface:
        return Formula(self.boundary)


class ManufacturedCubicScene(SemilinearScene):
    """-Lap v + lambda v^3 = s, with s such that the solution is 16 peak x (1 - x) y (1 - y), on every grid to rounding."""

    lam: NotNegative = Field(1.0, alias="lambda", description="factor of the cubic term")
    peak: Finite = Field(1.0, description="largest value of the exact solution")

    @property
    def source(self) -> Source:
        return ManufacturedCubic(self.lam, self.peak)
