"""Semilinear equations -Lap v = g(x, y, v) on a rectangle, v = 0 on its boundary: Bratu, and Poisson with a cubic term."""

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from ..base.parallel import Array, Reduce
from .certificate import Certificate, certificate_tol
from .film.reynolds import assemble, sides
from .grid import Grid
from .solution import Fields
from .transfer import Transfer


class Source(Protocol):
    """The right-hand side g(x, y, v).

    convex: g is convex and increasing in v, and positive. Newton from v0 <= 0 then climbs to the smallest solution
    without any damping, if there is one (see `solvers.plain_newton`).
    """

    @property
    def convex(self) -> bool: ...

    def value(self, x: Array, y: Array, v: Array) -> Array: ...

    def slope(self, x: Array, y: Array, v: Array) -> Array:
        """dg/dv."""
        ...

    def exact(self, x: Array, y: Array) -> Array | None:
        """The solution, where it is known."""
        ...

    @property
    def no_solution(self) -> str:
        """What to say when the equations have none."""
        ...


@dataclass(frozen=True)
class Bratu:
    """g = lambda e^v. On the unit square: two solutions for 0 < lambda < 6.8081, the turning point; none beyond."""

    lam: float

    @property
    def convex(self) -> bool:
        return self.lam > 0

    def value(self, x: Array, y: Array, v: Array) -> Array:
        with np.errstate(over="ignore"):  # inf is what the outer loop then reports
            return self.lam * np.exp(v)

    slope = value

    def exact(self, x: Array, y: Array) -> None:
        return None

    @property
    def no_solution(self) -> str:
        return f"lambda = {self.lam:.10g} lies beyond this grid's turning point (on the unit square 6.8081 in the limit)"


@dataclass(frozen=True)
class Cubic:
    """g = s(x, y) - lambda v^3, lambda >= 0, with s such that v = 16 peak x (1 - x) y (1 - y) on the unit square.

    The five-point formula is exact for this v (its fourth derivatives vanish), so the discrete solution is known on
    every grid. The published paper names the equation only; this source is our choice.
    """

    lam: float
    peak: float
    convex = False
    no_solution = ""  # the equations are monotone: there always is one, and only one

    def value(self, x: Array, y: Array, v: Array) -> Array:
        bulge = 32.0 * self.peak * (x * (1.0 - x) + y * (1.0 - y))  # -Lap of the exact solution
        return bulge + self.lam * (self.exact(x, y) ** 3 - v**3)

    def slope(self, x: Array, y: Array, v: Array) -> Array:
        return -3.0 * self.lam * v**2

    def exact(self, x: Array, y: Array) -> Array:
        return 16.0 * self.peak * x * (1.0 - x) * y * (1.0 - y)


class SemilinearProblem:
    """f(v) = A v - dx dy g(v) = 0 on a grid, A the five-point formula times dx dy: (4, -1) where dx = dy.

    Row i balances what flows out of cell i against its source. The one field is v, on this rank's points.

    Parameters
    ----------
    grid : the interior points.
    source : g.
    v0 : value of v at every point to start from.
    """

    kind = "equations"

    def __init__(self, grid: Grid, source: Source, v0: float = 0.0):
        self.grid, self.source, self.v0 = grid, source, v0
        self.reduce: Reduce = grid.reduce
        self._x, self._y = (np.ravel(a) for a in np.broadcast_arrays(grid.x, grid.y))
        dx, dy = grid.spacing
        across_x, across_y = dy / dx, dx / dy
        self._face = (across_x, across_x, across_y, across_y)  # west, east, south, north
        west_east, south_north = np.full(grid.box, -across_x), np.full(grid.box, -across_y)
        self.diagonal = 2.0 * (across_x + across_y)
        entries = [(0, 0, np.full(grid.box, self.diagonal)), (0, -1, west_east), (0, 1, west_east)]
        self.A = assemble(grid, [*entries, (-1, 0, south_north), (1, 0, south_north)])
        self._in, self._out = self.A.createVecs()

    @property
    def unknowns(self) -> int:
        return self.grid.size

    def flow(self, v: Array) -> Array:
        """A v, what flows out of each cell. Collective."""
        self._in.setArray(v)
        self.A.mult(self._in, self._out)
        return self._out.array_r.copy()

    def supply(self, v: Array) -> Array:
        """dx dy g(v), what the source gives each cell."""
        return self.grid.cell * self.source.value(self._x, self._y, v)

    def residual(self, v: Array) -> Array:
        """f(v) = A v - dx dy g(v). Collective."""
        return self.flow(v) - self.supply(v)

    def jacobian_diagonal(self, v: Array) -> Array:
        """Diagonal of f'(v); off it f' is A."""
        return self.diagonal - self.grid.cell * self.source.slope(self._x, self._y, v)

    def certify(self, fields: Fields, eps1: float) -> Certificate:
        """Certificate of v. Collective.

        residual: ||f(v)|| / (||A v|| + ||dx dy g(v)||);
        balance: |flow out through the boundary - all that the source gives| / all that it gives in absolute value, Gauss's
        theorem for the grid. The flow is taken from the points next to the boundary, without the matrix A.
        """
        v, red = fields["v"], self.reduce
        flow, supply = self.flow(v), self.supply(v)
        scale = red.norm(flow) + red.norm(supply)
        out = sum(
            red.sum(np.where(at, k * v.reshape(self.grid.box), 0.0)) for at, k in zip(sides(self.grid), self._face, strict=True)
        )
        given = red.sum(np.abs(supply))
        with np.errstate(invalid="ignore"):
            return Certificate(
                measures={
                    "residual": red.norm(flow - supply) / scale if scale != 0 else 0.0,  # NaN stays NaN
                    "balance": abs(out - red.sum(supply)) / given if given > 0 else abs(out),
                },
                tol=certificate_tol(eps1),
            )

    def quantities(self, fields: Fields) -> dict[str, Any]:
        """max_v, sum_v = dx dy sum v, and max_error where the solution is known. Collective."""
        v = fields["v"]
        out = {"max_v": self.reduce.max(v), "sum_v": self.grid.cell * self.reduce.sum(v)}
        exact = self.source.exact(self._x, self._y)
        if exact is not None:
            out["max_error"] = self.reduce.max(np.abs(v - exact))
        return out

    def physical(self, fields: Fields) -> dict[str, tuple[Array, str]]:
        """v; it has no unit."""
        return {"v": (fields["v"], "")}

    def prolong(self, coarse: "SemilinearProblem", fields: Fields, interior: bool) -> Fields:
        """v from a coarser grid, interpolated bilinearly. Collective."""
        transfer = Transfer(coarse.grid, self.grid)
        v = transfer(fields["v"])
        transfer.destroy()
        return {"v": v}

    def destroy(self) -> None:
        """Free the PETSc objects."""
        for obj in (self._in, self._out, self.A):
            obj.destroy()
        self.grid.destroy()
