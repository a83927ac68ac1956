"""One time step of a squeeze film between parallel plates that oscillate, as a complementarity problem.

    d/dx(h^3 dp/dx) = 2 d(h theta)/dt on (0, 1),   theta = 1 - r,   p r = 0,   p, r >= 0,   p = p_wall at both ends,

dimensionless; h(t) does not depend on x, theta = 1 at t = 0 (Optasanu and Bonneau; Ausas, Jai and Buscaglia 2009). With M = h
theta per cell and a difference formula w M^m - m_old for dM/dt, step m reads

    k (2 p_i - p_(i-1) - p_(i+1)) - 2 dx w h r_i = 2 dx (m_old,i - w h),   k = h^3/dx,

which is A p + B r = c with B diagonal: a blend of the columns of A and -B is a column diagonally dominant M-matrix as in the
steady problem, and every method for that one solves it.

The step is symmetric about x = 1/2: `HalfLine` is a grid of half of it, with no flow through its end in the middle.
"""

import numpy as np

from ...base.parallel import Array
from ..certificate import Certificate, certificate_tol
from ..fold import FOLDED, column_shares, part_grid
from ..grid import Grid
from ..solution import Fields
from ..transfer import Pick, numbers
from .lubrication import LubricationProblem
from .reynolds import BoxScheme, sides


class SqueezeStep(LubricationProblem):
    """The problem of one time step; it shares its grid with the others.

    Parameters
    ----------
    grid : of the whole line, or of half of it.
    h : gap at the step's end.
    weight : w of the difference formula, 1/time.
    old : m_old, what the formula has of the contents M of earlier steps, per owned point.
    p_wall : pressure at both ends; the unit of p, unless it is zero.
    """

    def __init__(self, grid: Grid, h: float, weight: float, old: Array, p_wall: float):
        dx, box = grid.spacing[0], grid.box
        p_unit = p_wall or 1.0
        none = np.zeros(box)
        k = p_unit * h**3 / dx * np.ones(box)
        k_E = np.where(sides(grid, FOLDED)[1], 0.0, k)  # in the middle nothing flows
        self.h, self.weight, self.old, self._share = h, weight, old, column_shares(grid)
        west, east, *_ = sides(grid)
        c = 2.0 * dx * self._share * (old.reshape(box) - weight * h) + k * (p_wall / p_unit) * (west.astype(int) + east)
        storage = 2.0 * dx * weight * h * self._share
        scheme = BoxScheme(k, k_E, none, none, -storage, none, c, none, none, np.full(box, h))
        super().__init__(
            grid,
            scheme,
            mu=1.0,
            U=0.0,
            p_unit=p_unit,
            p_sides=(p_wall, p_wall, 0.0, 0.0),
            p_c=0.0,
            film=lambda x, y: np.full(np.broadcast(x, y).shape, h),
        )

    def certify(self, fields: Fields, eps1: float) -> Certificate:
        """As for the steady problem, but what flows in and does not flow out must be stored. Collective."""
        steady, red = super().certify(fields, eps1), self.reduce
        p, r = fields["p"], fields["r"]
        rates = 2.0 * self.grid.spacing[0] * self._share.ravel() * (self.weight * self.h * (1.0 - r) - self.old)
        west, east, *_ = self.boundary_flows(p, np.zeros_like(r))
        defect, scale = abs(west - east - red.sum(rates)), abs(west) + abs(east) + red.sum(np.abs(rates))
        # In the middle of a stroke nothing flows: rounding is measured by the contents.
        scale = max(scale, 2.0 * self.weight * self.h * certificate_tol(0.0))
        return Certificate({**steady.measures, "mass_defect": defect / scale}, steady.tol, steady.extremes)

    def destroy(self) -> None:
        """Free the PETSc objects, but for the grid's."""
        self.free_matrices()


class HalfLine:
    """Half of a march's line, its own grid, and what of a step lies there.

    Parameters
    ----------
    whole : the grid of the march. Collective.
    """

    def __init__(self, whole: Grid):
        self.grid = part_grid(whole.shape, whole.lengths, (True,), whole.dm.comm, whole.origin)
        j, i = numbers(whole)
        self.take = Pick(whole, self.grid, *numbers(self.grid))
        self.spread = Pick(self.grid, whole, j, np.minimum(i, whole.shape[0] - 1 - i))

    def step(self, whole: SqueezeStep) -> SqueezeStep:
        """The half's problem of a time step. Collective."""
        return SqueezeStep(self.grid, whole.h, whole.weight, self.take(whole.old), whole.p_sides[0])

    def destroy(self) -> None:
        """Free the PETSc objects. Collective."""
        for obj in (self.spread, self.take, self.grid):
            obj.destroy()
