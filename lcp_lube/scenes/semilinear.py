"""Scenes of semilinear equations on the unit square: Bratu, and Poisson with a cubic term."""

from typing import ClassVar

from petsc4py import PETSc
from pydantic import Field

from ..problems.grid import Grid
from ..problems.semilinear import Bratu, Cubic, SemilinearProblem, Source
from .scene import Count, Finite, NotNegative, Scene


class SemilinearScene(Scene):
    """-Lap v = g(x, y, v) on the unit square, v = 0 on its boundary; a subclass has g."""

    problem_kind: ClassVar[str] = "equations"
    v0: Finite = Field(0.0, description="start of v at every point")
    n: Count = Field(64, description="interior points a side")
    nx: Count | None = Field(None, description="interior points in x; default n")
    ny: Count | None = Field(None, description="interior points in y; default n")

    @property
    def shape(self) -> tuple[int, ...]:
        """Numbers of interior points, (nx, ny)."""
        return self.nx or self.n, self.ny or self.n

    @property
    def source(self) -> Source:
        """The right-hand side g."""
        raise NotImplementedError

    def build(self, comm: PETSc.Comm | None = None) -> SemilinearProblem:
        """The discrete problem on this scene's grid. Collective.

        Raises
        ------
        InputError : more ranks than the grid can be dealt to.
        """
        return SemilinearProblem(Grid(self.shape, (1.0, 1.0), comm), self.source, self.v0)


class BratuScene(SemilinearScene):
    """-Lap v = lambda e^v."""

    lam: Finite = Field(1.0, alias="lambda", description="strength of the source; no solution beyond 6.808")

    @property
    def source(self) -> Source:
        return Bratu(self.lam)


class PoissonCubicScene(SemilinearScene):
    """-Lap v + lambda v^3 = s, with s such that the solution is 16 peak x (1 - x) y (1 - y)."""

    lam: NotNegative = Field(1.0, alias="lambda", description="factor of the cubic term")
    peak: Finite = Field(1.0, description="largest value of the exact solution")

    @property
    def source(self) -> Source:
        return Cubic(self.lam, self.peak)
