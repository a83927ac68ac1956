"""Semilinear equations -Lap v = g(x, y, v) on a rectangle, v given on its boundary: Bratu, and Poisson with a cubic term."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from petsc4py import PETSc

from ..base.owned import Owned, made
from ..base.parallel import Array, Reduce
from ..errors import InputError
from .certificate import Certificate, certificate_tol
from .film.assembly import assemble
from .film.reynolds import sides
from .fold import FOLDED
from .grid import Grid
from .solution import Fields
from .transfer import interpolated

Surface = Callable[[Array, Array], Array]

ROUNDING = 4.0 * float(np.finfo(float).eps)  # of one entry of A v - b, relative to its largest terms


@dataclass(frozen=True)
class Bratu:
    """g = lambda e^v. On the unit square: two solutions for 0 < lambda < 6.8081, the turning point; none beyond.

    A source g(x, y, v) has its value, its slope dg/dv, both at once, and words for where there is no solution.
    """

    lam: float

    def climbs_from(self, v0: float) -> bool:
        """Whether g(v) is convex, increasing and >= 0 for v >= v0, and v0 <= 0.

        With v >= 0 on the boundary, Newton from v0 then climbs to the smallest solution above v0 without any damping, if
        there is one (see `solvers.plain_newton`).
        """
        return self.lam > 0 and v0 <= 0

    def value(self, x: Array, y: Array, v: Array) -> Array:
        with np.errstate(over="ignore"):  # inf is what the outer loop then reports
            g = np.exp(v)
            return np.multiply(self.lam, g, out=g)  # fresh memory takes longer than the product

    slope = value

    def both(self, x: Array, y: Array, v: Array) -> tuple[Array, Array]:
        g = self.value(x, y, v)
        return g, g

    @property
    def no_solution(self) -> str:
        return f"lambda = {self.lam:.10g} lies beyond this grid's turning point (on the unit square 6.8081 in the limit)"


@dataclass(frozen=True)
class PoissonCubic:
    """g = v^3/(1 + x^2 + y^2): equation (9) of Bergamaschi and Zilli, -Lap v - v^3/(1 + x^2 + y^2) = 0.

    With v >= 0 on the boundary there is a smallest solution v >= 0 as long as those values are small enough, and none
    where they are too large; with v = 0 there it is v = 0.
    """

    no_solution = "v on the boundary is too large: there is no solution v >= 0 on this grid"

    def climbs_from(self, v0: float) -> bool:
        return v0 == 0

    def value(self, x: Array, y: Array, v: Array) -> Array:
        return v**3 / (1.0 + x**2 + y**2)

    def slope(self, x: Array, y: Array, v: Array) -> Array:
        return 3.0 * v**2 / (1.0 + x**2 + y**2)

    def both(self, x: Array, y: Array, v: Array) -> tuple[Array, Array]:
        return self.value(x, y, v), self.slope(x, y, v)


@dataclass(frozen=True)
class ManufacturedCubic:
    """g = s(x, y) - lambda v^3, lambda >= 0, with s such that v = 16 peak x (1 - x) y (1 - y) on the unit square.

    No problem of the paper's, whose cubic term has the other sign and a weight (`PoissonCubic`): a test whose answer is known.
    The five-point formula is exact for this v (its fourth derivatives vanish), so the discrete solution is known on
    every grid.
    """

    lam: float
    peak: float
    no_solution = ""  # the equations are monotone: there always is one, and only one

    def climbs_from(self, v0: float) -> bool:
        return False

    def value(self, x: Array, y: Array, v: Array) -> Array:
        bulge = 32.0 * self.peak * (x * (1.0 - x) + y * (1.0 - y))  # -Lap of the exact solution
        return bulge + self.lam * (self.exact(x, y) ** 3 - v**3)

    def slope(self, x: Array, y: Array, v: Array) -> Array:
        return -3.0 * self.lam * v**2

    def both(self, x: Array, y: Array, v: Array) -> tuple[Array, Array]:
        return self.value(x, y, v), self.slope(x, y, v)

    def exact(self, x: Array, y: Array) -> Array:
        return 16.0 * self.peak * x * (1.0 - x) * y * (1.0 - y)


Source = Bratu | PoissonCubic | ManufacturedCubic


class SemilinearProblem:
    """f(v) = A v - b - dx dy g(v) = 0 on a grid, A the five-point formula times dx dy: (4, -1) where dx = dy.

    Row i balances what flows out of cell i against its source. The one field is v, on this rank's points. b is what the
    values on the boundary bring. On a part of a rectangle (`fold`) nothing flows through the ends in its middle.

    Parameters
    ----------
    grid : the interior points, or those of a part.
    source : g.
    v0 : value of v at every point to start from.
    boundary : v on the boundary as a function of x and y; default 0.

    Raises
    ------
    InputError : the boundary's formula has no finite value at a point next to which a grid point lies.
    """

    kind = "equations"
    units: ClassVar[dict[str, str]] = {}

    def __init__(self, grid: Grid, source: Source, v0: float = 0.0, boundary: Surface | None = None):
        self.grid, self.source, self.v0, self._boundary = grid, source, v0, boundary
        self.reduce: Reduce = grid.reduce
        self._x, self._y = (np.ravel(a) for a in np.broadcast_arrays(grid.x, grid.y))
        dx, dy = grid.spacing
        x_share, y_share = grid.widths(0), grid.widths(1)[:, None]
        self.cells = (grid.cell * x_share * y_share).ravel()
        across_x, across_y = dy / dx * y_share, dx / dy * x_share
        _, east, _, north = sides(grid, FOLDED)
        # Conductances of the faces west, east, south, north; they broadcast to the box.
        self.faces = (across_x, np.where(east, 0.0, across_x), across_y, np.where(north, 0.0, across_y))
        west_east, south_north = (self.faces[k] + self.faces[k + 1] for k in (0, 2))
        self.diagonal = np.broadcast_to(west_east + south_north, grid.box).ravel()
        self.largest_diagonal = 2.0 * (dy / dx + dx / dy)
        self._own = Owned(self, grid.petsc_comm)
        self.b = np.zeros(grid.local_size) if boundary is None else _boundary_terms(grid, boundary)

    @made
    def A(self) -> PETSc.Mat:
        """The five-point formula, times dx dy."""
        grid, beside = self.grid, zip(((0, -1), (0, 1), (-1, 0), (1, 0)), self.faces, strict=True)
        diagonal = (0, 0, self.diagonal.reshape(grid.box))
        return assemble(grid, [diagonal, *((*at, np.broadcast_to(-k, grid.box)) for at, k in beside)])

    @property
    def unknowns(self) -> int:
        return self.grid.size

    @property
    def climbs(self) -> bool:
        """Whether Newton from v0 climbs to the smallest solution above it, if there is one. Collective."""
        return self.source.climbs_from(self.v0) and self.reduce.min(self.b) >= 0

    def flow(self, v: Array) -> Array:
        """A v - b, what flows out of each cell: differences, which rounding leaves nothing of where v is even. Collective."""
        around = self.grid.ghosted(v, outside=0.0)
        beside = around[1:-1, :-2], around[1:-1, 2:], around[:-2, 1:-1], around[2:, 1:-1]
        here, work = around[1:-1, 1:-1], np.empty(self.grid.box)
        out = -self.b.reshape(self.grid.box)
        for k, there in zip(self.faces, beside, strict=True):
            np.subtract(here, there, out=work)
            out += np.multiply(k, work, out=work)
        return out.ravel()

    def supply(self, v: Array) -> Array:
        """dx dy g(v), what the source gives each cell."""
        return self.cells * self.source.value(self._x, self._y, v)

    def residual(self, v: Array) -> Array:
        """f(v) = A v - b - dx dy g(v). Collective."""
        return self.flow(v) - self.supply(v)

    def jacobian_diagonal(self, v: Array) -> Array:
        """Diagonal of f'(v); off it f' is A."""
        return self.diagonal - self.cells * self.source.slope(self._x, self._y, v)

    def certify(self, fields: Fields, eps1: float) -> Certificate:
        """Certificate of v. Collective.

        residual: ||f(v)|| / (||A v - b|| + ||dx dy g(v)||);
        balance: |flow out through the boundary - all that the source gives| / all that it gives in absolute value, Gauss's
        theorem for the grid. The flow is taken from the points next to the boundary, without the matrix A.
        Both leave out what rounding does to differences from the values on the boundary.
        """
        v, red = fields["v"], self.reduce
        flow, supply = self.flow(v), self.supply(v)
        scale = red.norm(flow) + red.norm(supply)
        rounding = ROUNDING * (self.largest_diagonal * red.norm(v) + red.norm(self.b))
        at_sides = [np.where(at, k * v.reshape(self.grid.box), 0.0) for at, k in zip(sides(self.grid), self.faces, strict=True)]
        out = sum(red.sum(part) for part in at_sides) - red.sum(self.b)
        rounding_out = ROUNDING * (sum(red.sum(np.abs(part)) for part in at_sides) + red.sum(np.abs(self.b)))
        given = red.sum(np.abs(supply))
        with np.errstate(invalid="ignore"):
            return Certificate(
                measures={
                    "residual": _share(red.norm(flow - supply) - rounding, scale),
                    "balance": _share(abs(out - red.sum(supply)) - rounding_out, given),
                },
                tol=certificate_tol(eps1),
            )

    def quantities(self, fields: Fields) -> dict[str, Any]:
        """Of a whole rectangle: max_v, sum_v = dx dy sum v, and max_error where the solution is known. Collective."""
        v = fields["v"]
        out = {"max_v": self.reduce.max(v), "sum_v": self.grid.cell * self.reduce.sum(v)}
        if isinstance(self.source, ManufacturedCubic):
            out["max_error"] = self.reduce.max(np.abs(v - self.source.exact(self._x, self._y)))
        return out

    def physical(self, fields: Fields) -> dict[str, tuple[Array, str]]:
        """v; it has no unit."""
        return {"v": (fields["v"], "")}

    def at_sides(self, name: str, x: Array, y: Array) -> Array:
        """v is given there."""
        return np.zeros(np.broadcast(x, y).shape) if self._boundary is None else self._boundary(x, y)

    def prolong(self, coarse: "SemilinearProblem", fields: Fields, interior: bool) -> Fields:
        """v from a coarser grid, interpolated bilinearly. Collective."""
        return {"v": interpolated(coarse.grid, self.grid, fields["v"])}

    def destroy(self) -> None:
        """Free the PETSc objects. Collective."""
        self._own.free()
        self.grid.destroy()

    def __reduce__(self) -> tuple[Any, ...]:
        return SemilinearProblem, (self.grid, self.source, self.v0, self._boundary)


def _share(part: float, whole: float) -> float:
    """part / whole, 0 where the part is negative, the part itself where the whole is 0; NaN stays NaN."""
    part = max(part, 0.0) if part == part else part
    return part / whole if whole > 0 else part + 0.0 * whole


def _boundary_terms(grid: Grid, boundary: Surface) -> Array:
    """What the values on the boundary add to f: (dy/dx) v west and east, (dx/dy) v south and north."""
    dx, dy = grid.spacing
    b, x_share, y_share = np.zeros(grid.box), grid.widths(0), grid.widths(1)[:, None]
    for at_side, (ox, oy) in zip(sides(grid), ((-dx, 0.0), (dx, 0.0), (0.0, -dy), (0.0, dy)), strict=True):
        weight = dy / dx * y_share if ox else dx / dy * x_share
        b += np.where(at_side, weight * boundary(grid.x + ox, grid.y + oy), 0.0)
    if not np.isfinite(grid.reduce.sum(b)):
        raise InputError("boundary: no finite value at some points of the boundary")
    return b.ravel()
