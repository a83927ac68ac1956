"""Scenes of elastohydrodynamic contact."""

from dataclasses import replace
from typing import Annotated, ClassVar, Literal

from petsc4py import PETSc
from pydantic import Field

from ..problems.ehl import EhlProblem
from ..problems.facts import Facts
from ..problems.grid import Grid
from .scene import Finite, NotNegative, Positive, Scene


class EhlLineScene(Scene):
    """Line contact of two elastic rollers, dimensionless; defaults are Kostreva's data. The Jacobian is dense.

    n counts the unknowns: n - 1 pressures at start + i dx, dx = (end - start)/n, and k.
    """

    problem_kind: ClassVar[str] = "mixed"
    alpha: NotNegative = Field(2.832, description="how fast viscosity grows with pressure")
    lam: Positive = Field(6.057, alias="lambda", description="speed parameter")
    x: tuple[Finite, Finite] = Field((-3.0, 2.0), description="the interval; p = 0 at its ends")
    k0: Finite = Field(1.6, description="start of k; p starts from the positive part of 1 - x^2/4")
    rows: Literal["flow", "divergence"] = Field(
        "flow", description="flow equations as q_i - q_{i-1}, or that over dx: what ||F|| measures"
    )
    n: Annotated[int, Field(strict=True, ge=2, le=46_340)] = Field(200, description="unknowns: n - 1 pressures and k")

    def check(self) -> None:
        if not self.x[0] < self.x[1]:
            raise ValueError(f"x = {list(self.x)}: start < end is needed")

    @property
    def shape(self) -> tuple[int, ...]:
        return (self.n,)

    def with_shape(self, shape: tuple[int, ...]) -> "EhlLineScene":
        return self.model_copy(update={"n": shape[0]})

    def facts(self, comm: PETSc.Comm | None = None) -> Facts:
        return replace(super().facts(comm), dense=True)

    def build(self, comm: PETSc.Comm | None = None) -> EhlProblem:
        """The discrete problem. Collective."""
        dx = (self.x[1] - self.x[0]) / self.n
        # The grid's last point is the end of the interval, where p = 0 and the place is k's.
        grid = Grid((self.n,), ((self.n + 1) * dx,), comm, (self.x[0], 0.0))
        return EhlProblem(grid, self.alpha, self.lam, self.k0, 1.0 if self.rows == "flow" else 1.0 / dx)
