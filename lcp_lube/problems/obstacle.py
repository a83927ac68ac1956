"""Obstacle problems: -Lap v = g(x, y, v) on a rectangle where v touches neither of two obstacles, l <= v <= u; Bratu's g.

f(v) = A v - b - dx dy g(v), A the five-point formula times dx dy, (4, -1) where dx = dy, and b the values on the boundary.
"""

from functools import cached_property
from typing import Any

import numpy as np
from petsc4py import PETSc

from ..base.owned import made
from ..base.parallel import Array
from .box import BoxProblem
from .fold import folded_axes, part_grid, part_shape, whole_lengths, whole_shape
from .grid import Grid
from .semilinear import Bratu, SemilinearProblem, Surface
from .solution import Fields, Outcome
from .transfer import Transfer, interpolated

# Largest lambda for which -Lap v = lambda e^v, v = 0 on the boundary of the unit square, has a solution; the five-point
# formula's is smaller by 1.5 h^2 (6.80674, 6.80777, 6.80803 for n = 32, 64, 128).
TURNING_POINT, FIVE_POINT = 6.808124, 1.5
LEFT = 1e-3  # part of a start that is as good as none
COARSEST = 8  # points a side of the whole rectangle on multigrid's coarsest grid, at least


class ObstacleProblem(BoxProblem):
    """-Lap v = lambda e^v between two obstacles.

    Parameters
    ----------
    grid : the interior points, or those of a part (`fold`).
    lam : lambda.
    lower, upper : the obstacles as functions of x and y.
    v0 : the start as a function; None: 0.01, the lower branch's side; or, where lambda lies beyond the turning point and
        only contact with the upper obstacle can hold v, that obstacle.
    boundary : v on the boundary.
    coarse : this grid only serves a finer one: obstacles that cross between that one's points are no error.

    Raises
    ------
    InputError : the obstacles cross, or a formula has no value somewhere.
    """

    def __init__(
        self,
        grid: Grid,
        lam: float,
        lower: Surface,
        upper: Surface,
        v0: Surface | None,
        boundary: Surface,
        coarse: bool = False,
    ):
        self.lam, self._data = lam, (lower, upper, v0, boundary)
        l, u = (surface(grid.x, grid.y).ravel() for surface in (lower, upper))
        if coarse:
            l = np.minimum(l, u)
        self.semilinear = SemilinearProblem(grid, Bratu(lam), boundary=boundary)
        least, most = grid.reduce.min(self.semilinear.b), grid.reduce.max(self.semilinear.b)
        self.homogeneous = least == most == 0.0
        L, width = whole_lengths(grid)
        square, h = np.isclose(L, width, rtol=1e-12), max(grid.spacing)
        self.turning_point = (TURNING_POINT - FIVE_POINT * (h / L) ** 2) / L**2 if square and least >= 0 else None
        self._beyond = self.turning_point is not None and lam > self.turning_point
        self._bounded = grid.reduce.max(u) < np.inf
        if v0 is not None:
            start = v0(grid.x, grid.y).ravel()
        else:
            # The same choice on every grid, or nested iteration would begin on another branch.
            contact = self._bounded and self.turning_point is not None and lam > TURNING_POINT / L**2
            start = u if contact else np.full(grid.local_size, 0.01)
        self._coarser: ObstacleProblem | None = None
        self._transfer: Transfer | None = None
        super().__init__(grid, l, u, start)

    @made
    def _jacobian(self) -> PETSc.Mat:
        mat = self.semilinear.A.duplicate(copy=True)
        for option in (PETSc.Mat.Option.SYMMETRIC, PETSc.Mat.Option.SYMMETRY_ETERNAL):
            mat.setOption(option, True)
        return mat

    @made
    def _diagonal(self) -> PETSc.Vec:
        return self._jacobian.createVecLeft()

    def residual(self, v: Array) -> Array:
        return self.semilinear.residual(v)

    def jacobian(self, v: Array) -> PETSc.Mat:
        self._diagonal.setArray(self.semilinear.jacobian_diagonal(v))
        self._jacobian.setDiagonal(self._diagonal)
        self._jacobian.assemble()
        return self._jacobian

    def scale(self, v: Array) -> float:
        """Mean of |A v - b| + |dx dy g(v)|: the two sides of the equation."""
        terms = np.abs(self.semilinear.flow(v)) + np.abs(self.semilinear.supply(v))
        return self.reduce.sum(terms) / self.unknowns

    @cached_property
    def idle(self) -> tuple[float, float]:
        """Scales of v and f where nothing drives: v = 0 is then the answer, and what is left of it is measured by the start."""
        zero = self.reduce.max(self.lower) <= 0.0 <= self.reduce.min(self.upper)
        if self.lam != 0.0 or not self.homogeneous or not zero:
            return 0.0, 0.0
        start = self.v0 if self.reduce.max(np.abs(self.v0)) > 0 else np.ones_like(self.v0)
        return LEFT * self.reduce.max(np.abs(start)), LEFT * self.scale(start)

    def scales(self, v: Array) -> tuple[float, float]:
        (v_scale, f_scale), (v_least, f_least) = super().scales(v), self.idle
        return max(v_scale, v_least), max(f_scale, f_least)

    def quantities(self, fields: Fields) -> dict[str, Any]:
        """max_v, sum_v = dx dy sum v, the contact counts, and the turning point where it is known. Collective."""
        v = fields["v"]
        return {
            "max_v": self.reduce.max(v),
            "sum_v": self.grid.cell * self.reduce.sum(v),
            **super().quantities(fields),
            "turning_point": self.turning_point,
        }

    def at_sides(self, name: str, x: Array, y: Array) -> Array:
        """v is given there; f, the force of the obstacles, goes on."""
        return self._data[3](x, y) if name == "v" else np.full(np.broadcast(x, y).shape, np.nan)

    def explain(self, outcome: Outcome, message: str) -> tuple[Outcome, str]:
        """Beyond the turning point there is no solution without contact with the upper obstacle.

        Proof: where no upper bound acts, f(v) >= 0, so v is a supersolution of the equation without obstacles, and 0 is a
        subsolution (v >= 0 on the boundary); the equation would then have a solution between them.
        """
        if not self._beyond:
            return outcome, message
        where = f"lambda = {self.lam:g} lies beyond the turning point {self.turning_point:.6g}"
        if not self._bounded:
            return Outcome.NO_SOLUTION, f"{where} and no upper bound holds v: there is no solution ({message})"
        return outcome, (
            f"{message}; {where}: a solution must touch v_upper, and this start did not reach it; "
            "start nearer to v_upper with --set v0=..."
        )

    def coarser(self) -> "tuple[ObstacleProblem, Transfer] | None":
        axes = folded_axes(self.grid)
        shape = tuple((n - 1) // 2 for n in whole_shape(self.grid))
        if self._coarser is None and min(shape) >= COARSEST and min(part_shape(shape, axes)) >= self.grid.comm.size:
            grid = part_grid(shape, whole_lengths(self.grid), axes, self.grid.petsc_comm, self.grid.origin)
            self._coarser = ObstacleProblem(grid, self.lam, *self._data, coarse=True)
        return None if self._coarser is None else (self._coarser, self._interpolation(self._coarser.grid))

    def _interpolation(self, coarse: Grid) -> Transfer:
        """Bilinear interpolation from a coarser grid, zero on the boundary; made once. Collective."""
        if self._transfer is not None and self._transfer.coarse_meshes != coarse.meshes:
            self._transfer.destroy()
            self._transfer = None
        if self._transfer is None:
            self._transfer = Transfer(coarse, self.grid, zero_boundary=True)
        return self._transfer

    def prolong(self, coarse: "ObstacleProblem", fields: Fields, interior: bool) -> Fields:
        """v from a coarser grid, interpolated bilinearly and moved into the bounds. Collective."""
        if self.homogeneous:
            v = self._interpolation(coarse.grid)(fields["v"])
        else:
            v = interpolated(coarse.grid, self.grid, fields["v"])
        return {"v": np.clip(v, self.lower, self.upper)}

    def destroy(self) -> None:
        if self._coarser is not None:
            self._coarser.destroy()
        if self._transfer is not None:
            self._transfer.destroy()
        self._own.free()
        self.semilinear.destroy()

    def __reduce__(self) -> tuple[Any, ...]:
        return ObstacleProblem, (self.grid, self.lam, *self._data)
