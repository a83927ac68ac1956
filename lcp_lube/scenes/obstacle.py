"""Scenes of obstacle problems: -Lap v = lambda e^v on a rectangle, between two obstacles given by formulas."""

from typing import Annotated, ClassVar

from pydantic import Field, PrivateAttr

from ..base.parallel import Array
from ..problems.grid import Grid
from ..problems.obstacle import ObstacleProblem
from .formula import Formula, FormulaText
from .scene import Finite
from .semilinear import OneUnknownScene

Surface = Annotated[float | str, FormulaText]


class ObstacleScene(OneUnknownScene):
    """-Lap v = lambda e^v where v touches no obstacle, v_lower <= v <= v_upper; defaults are the paper's data.

    Surfaces are numbers or formulas in x and y; inf and -inf stand for no obstacle.
    """

    problem_kind: ClassVar[str] = "box"
    lam: Finite = Field(6.0, alias="lambda", description="strength of the source")
    v_lower: Surface = Field(0.0, description="lower obstacle, a number or a formula in x and y")
    v_upper: Surface = Field(4.0, description="upper obstacle, a number or a formula in x and y")
    v0: Surface | None = Field(
        None, description="start; default 0.01, or v_upper where lambda lies beyond the turning point 6.808"
    )
    boundary: Surface = Field(0.0, description="v on the boundary")
    x: tuple[Finite, Finite] = Field((0.0, 1.0), description="the rectangle's sides")
    y: tuple[Finite, Finite] = Field((0.0, 1.0), description="the rectangle's sides")
    _coarse: bool = PrivateAttr(False)

    def check(self) -> None:
        for name in ("x", "y"):
            start, end = getattr(self, name)
            if not start < end:
                raise ValueError(f"{name} = {[start, end]}: start < end is needed")

    def with_shape(self, shape: tuple[int, ...]) -> "ObstacleScene":
        """The same scene on a grid that serves this one."""
        scene = self.model_copy(update={"nx": shape[0], "ny": shape[1]})
        scene._coarse = True
        return scene

    def problem_on(self, grid: Grid) -> ObstacleProblem:
        v0 = None if self.v0 is None else Formula(self.v0)
        return ObstacleProblem(
            grid, self.lam, Formula(self.v_lower), Formula(self.v_upper), v0, self.on_boundary, coarse=self._coarse
        )

    @property
    def rectangle(self) -> tuple[tuple[float, float], tuple[float, float]]:
        return self.x, self.y

    @property
    def on_boundary(self) -> Formula:
        """v on the boundary."""
        return Formula(self.boundary)

    def inside(self, x: Array, y: Array) -> list[Array]:
        """What varies over the rectangle and is not v: the obstacles, and a start that was given."""
        return [Formula(text)(x, y) for text in (self.v_lower, self.v_upper, self.v0) if text is not None]
