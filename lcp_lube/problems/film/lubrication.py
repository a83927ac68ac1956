"""The door between physics and solvers: the data of A p + B r = c, p r = 0, p, r >= 0, and what certifies an answer."""

from collections.abc import Callable
from functools import cached_property
from importlib.util import find_spec
from typing import Any

import numpy as np
from petsc4py import PETSc

from ...base.compiled import compiled
from ...base.parallel import Array
from ..certificate import Certificate, certificate_tol
from ..grid import Grid
from ..solution import Fields
from ..transfer import Transfer
from .exact import ExactSolution
from .forces import Shaft
from .quantities import quantities
from .reynolds import BoxScheme, assemble, side_points, term_squares

IDLE = 1e-8  # share of the Couette flow below which a flow is none


class LubricationProblem:
    """Steady Reynolds problem with mass-conserving cavitation on a grid.

    The fields are arrays of this rank's points, in the grid's order: p in units of `p_unit` above the cavitation
    pressure, r the void fraction.

    Parameters
    ----------
    grid : the interior points.
    scheme : coefficients of the box scheme there, in units of p_unit.
    mu, U : viscosity in Pa s and wall speed in m/s.
    p_unit : pressure unit in Pa.
    p_sides : pressures above p_c at west, east, south, north in Pa.
    p_c : cavitation pressure in Pa, added to the pressures that are reported.
    film : h(x, y) in metres.
    exact : gives the exact 1D solution, where one is known.
    shaft : what the film is wrapped round; None for a flat one.
    r_in : void fraction that enters at the west.
    """

    kind = "lubrication"

    def __init__(
        self,
        grid: Grid,
        scheme: BoxScheme,
        *,
        mu: float,
        U: float,
        p_unit: float,
        p_sides: tuple[float, float, float, float],
        p_c: float,
        film: Callable[[Array, Array], Array],
        exact: Callable[[], ExactSolution | None] | None = None,
        shaft: Shaft | None = None,
        r_in: float = 0.0,
    ):
        self.grid, self.scheme, self.film = grid, scheme, film
        self.mu, self.U, self.p_unit, self.p_sides, self.p_c = mu, U, p_unit, p_sides, p_c
        self.exact, self.shaft, self.r_in = exact, shaft, r_in
        self.extras: Callable[[dict[str, Any]], dict[str, Any]] | None = None
        self.reduce = grid.reduce
        self.c = scheme.c.ravel()

    @cached_property
    def A(self) -> PETSc.Mat:
        """Assembled at first use, as B is: a method that works on the stencil alone is spared their time and memory."""
        return assemble(self.grid, self.scheme.pressure_entries())

    @cached_property
    def B(self) -> PETSc.Mat:
        return assemble(self.grid, self.scheme.void_entries())

    @cached_property
    def _vectors(self) -> tuple[PETSc.Vec, PETSc.Vec]:
        """`multiply` lends them its arrays."""
        return self.A.createVecs()

    @property
    def unknowns(self) -> int:
        return 2 * self.size

    @property
    def size(self) -> int:
        """Number n of unknown points; there are 2 n unknowns."""
        return self.grid.size

    def multiply(self, mat: PETSc.Mat, a: Array) -> Array:
        """mat @ a for one of A, B and an array of owned points. Collective."""
        x, y = self._vectors
        out = np.empty(self.grid.local_size)
        x.placeArray(np.ascontiguousarray(a))
        y.placeArray(out)
        mat.mult(x, y)
        x.resetArray()
        y.resetArray()
        return out

    def term_norms(self, p: Array, r: Array) -> tuple[float, float, float]:
        """||A p||, ||B r|| and ||A p + B r - c||: by the matrices where they stand already, else by the stencil. Collective."""
        if "A" in self.__dict__ or find_spec("numba") is None:
            Ap, Br = self.multiply(self.A, p), self.multiply(self.B, r)
            return self.reduce.norm(Ap), self.reduce.norm(Br), self.reduce.norm(Ap + Br - self.c)
        s, framed = self.scheme, (self.grid.ghosted(field, outside=0.0) for field in (p, r))
        squares = compiled(term_squares)(*framed, s.k_W, s.k_E, s.k_S, s.k_N, s.b_C, s.b_W, s.c)
        norms = np.sqrt([self.reduce.sum(np.array([square])) for square in squares])
        return float(norms[0]), float(norms[1]), float(norms[2])

    def flow(self, p: Array, r: Array) -> Array:
        """F1 = A p + B r - c, the flow balance of every point in m2/s. Collective."""
        return self.multiply(self.A, p) + self.multiply(self.B, r) - self.c

    def certify(self, fields: Fields, eps1: float) -> Certificate:
        """Certificate of the fields p and r for a run whose tolerance was eps1. Collective.

        residual: ||A p + B r - c|| / (||A p|| + ||B r|| + ||c||);
        complementarity: max_i |min(p_i / max|p|, r_i)|, which bounds negative p, negative r and products alike;
        mass_defect: |flow in - flow out| / flow in, over the open sides.
        """
        red, p, r = self.reduce, fields["p"], fields["r"]
        pressure, void, residual = self.term_norms(p, r)
        scale = pressure + void + red.norm(self.c)
        p_max = red.max(np.abs(p))
        return Certificate(
            measures={
                "residual": residual / scale if scale != 0 else 0.0,  # NaN stays NaN
                "complementarity": red.max(np.abs(np.minimum(p / p_max if p_max > 0 else p, r))),
                "mass_defect": self.mass_defect(p, r),
            },
            tol=certificate_tol(eps1),
            extremes={"min_p": red.min(p) * self.p_unit, "min_r": red.min(r)},
        )

    def mass_defect(self, p: Array, r: Array) -> float:
        """|flow in - flow out| / flow in, over the open sides. Collective."""
        west, east, south, north = self.boundary_flows(p, r)
        inflow = max(west, 0.0) + max(-east, 0.0) + max(south, 0.0) + max(-north, 0.0)
        # Nothing may flow through at all: what rounding leaves is measured by what the wall drags along.
        dragged = self.reduce.max(np.abs(self.scheme.b_C)) * (self.grid.shape[1] if self.grid.dim == 2 else 1)
        inflow = max(inflow, IDLE * dragged)
        return abs(west - east + south - north) / inflow if inflow != 0 else 0.0

    def boundary_flows(self, p: Array, r: Array) -> tuple[float, float, float, float]:
        """Scaled flow through the west, east, south and north side, positive towards larger x or y.

        In the equation's terms, U h (1 - r) - h^3/(6 mu) dp/dx, that is twice the volume flow; m2/s in 1D, in 2D the sum
        over the side's points (times dy: m3/s).
        """
        s, box = self.scheme, self.grid.box
        p, r = p.reshape(box), r.reshape(box)
        p_W, p_E, p_S, p_N = (side / self.p_unit for side in self.p_sides)
        west, east, south, north = side_points(self.grid)
        total = self.reduce.sum
        return (
            total(s.couette_W[west] + s.k_W[west] * (p_W - p[west])),
            total(s.couette_E[east] + s.b_C[east] * r[east] + s.k_E[east] * (p[east] - p_E)),
            total(s.k_S[south] * (p_S - p[south])),
            total(s.k_N[north] * (p[north] - p_N)),
        )

    def quantities(self, fields: Fields) -> dict[str, Any]:
        """Load, friction, flows, largest pressure, cavity, and the scene's own `extras`. Collective."""
        return quantities(self, fields["p"], fields["r"])

    def physical(self, fields: Fields) -> dict[str, tuple[Array, str]]:
        """Absolute pressure in Pa, void fraction, film in m."""
        return {
            "p": (fields["p"] * self.p_unit + self.p_c, "Pa"),
            "r": (fields["r"], ""),
            "h": (self.scheme.h.ravel(), "m"),
        }

    def prolong(self, coarse: "LubricationProblem", fields: Fields, interior: bool) -> Fields:
        """p and r on this grid from a coarser one, by interpolating z = p/P - r/R bilinearly (P, R: largest p and r).

        interior: p, r = (+-z + sqrt(z^2 + 4 m))/2, off the boundary with products p r = m P R. The front is known to a mesh
        H of the coarse grid, where p ~ (H/L)^2 and r ~ H/L: m = 10 (H/L)^3, at most 1e-3. Collective.
        """
        P = coarse.reduce.max(fields["p"]) or 1.0
        R = coarse.reduce.max(fields["r"]) or 1.0
        transfer = Transfer(coarse.grid, self.grid)
        z = transfer(fields["p"] / P - fields["r"] / R)
        transfer.destroy()
        m = min(1e-3, 10.0 / max(coarse.grid.shape) ** 3)
        root = np.sqrt(z * z + 4.0 * m) if interior else np.abs(z)
        return {"p": 0.5 * P * (root + z), "r": 0.5 * R * (root - z)}

    def destroy(self) -> None:
        """Free the PETSc objects."""
        made = self.__dict__
        for obj in (made.get("A"), made.get("B"), *made.get("_vectors", ())):
            if obj is not None:
                obj.destroy()
        self.grid.destroy()
