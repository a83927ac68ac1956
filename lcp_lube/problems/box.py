"""Box-constrained (mixed) complementarity: l <= v <= u and f(v), a force of the bounds where v touches them.

    v_i = l_i and f_i(v) >= 0,   or   l_i < v_i < u_i and f_i(v) = 0,   or   v_i = u_i and f_i(v) <= 0.

With slacks and multipliers, f(v) = z1 - z2, s1 = v - l, s2 = u - v, all >= 0, s1 z1 = s2 z2 = 0. Bounds may be infinite: with
all of them, these are the equations f(v) = 0.
"""

from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from petsc4py import PETSc

from ..base.owned import Owned
from ..base.parallel import Array, Reduce
from ..errors import InputError
from .certificate import Certificate, certificate_tol
from .grid import Grid
from .solution import Fields, Outcome
from .transfer import Transfer


class BoxProblem:
    """l <= v <= u, f(v) complementary to the bounds; a subclass has f and its Jacobian. The one field is v.

    Parameters
    ----------
    grid : the points; a Grid of one dimension serves where the unknowns are no points of a grid.
    lower, upper : bounds at this rank's points; -inf and inf where there are none.
    v0 : where to start; moved into the bounds.

    Raises
    ------
    InputError : l > u somewhere; a bound or a start that is no number.
    """

    kind = "box"
    units: ClassVar[dict[str, str]] = {}

    def __init__(self, grid: Grid, lower: Array, upper: Array, v0: Array):
        self.grid, self.lower, self.upper = grid, lower, upper
        self.reduce: Reduce = grid.reduce
        self._own = Owned(self, grid.petsc_comm)
        self._check_bounds()
        self.v0 = np.clip(v0, lower, upper)
        if not np.isfinite(self.reduce.sum(self.v0)):
            raise InputError("v0: no finite value at some points of the grid")

    def _check_bounds(self) -> None:
        l, u = self.lower, self.upper
        total = self.reduce.sum
        for name, bound, wrong in (("v_lower", l, np.inf), ("v_upper", u, -np.inf)):
            if total((np.isnan(bound) | (bound == wrong)).astype(float)):
                raise InputError(f"{name}: no number, or {wrong:g}, at some points of the grid")
        crossed = l > u
        count = int(total(crossed.astype(float)))
        if count:
            gap = self.reduce.max(np.where(crossed, l - np.where(crossed, u, l), 0.0))
            raise InputError(
                f"infeasible box: v_lower > v_upper at {count} of {self.unknowns} points, by up to {gap:.3g}; "
                "v_lower <= v_upper is needed everywhere"
            )

    @property
    def unknowns(self) -> int:
        return self.grid.size

    def residual(self, v: Array) -> Array:
        """f(v); entries that overflow are inf or NaN. Collective."""
        raise NotImplementedError

    def jacobian(self, v: Array) -> PETSc.Mat:
        """f'(v), an n-by-n AIJ matrix that stores its whole diagonal; the next call overwrites it. Collective."""
        raise NotImplementedError

    def scale(self, v: Array) -> float:
        """Mean size of the terms of f(v): a residual counts as small against this. Collective."""
        raise NotImplementedError

    def natural_residual(self, v: Array, f: Array, v_scale: float = 1.0, f_scale: float | Array = 1.0) -> Array:
        """mid((v - u)/v_scale, f/f_scale, (v - l)/v_scale): zero at the solutions alone, no less than a bound is violated."""
        with np.errstate(invalid="ignore"):  # where f has overflowed; the outer loop ends the run
            middle = f / f_scale
        np.minimum(middle, (v - self.lower) / v_scale, out=middle)
        return np.maximum(middle, (v - self.upper) / v_scale, out=middle)

    @cached_property
    def idle(self) -> tuple[float, float]:
        """Least scales of v and f: more than 0 where v = 0 is the answer, because nothing drives it. Collective."""
        return 0.0, 0.0

    def scales(self, v: Array) -> tuple[float, float]:
        """max |v| and the mean size of the terms of f; 1 in place of 0. Collective."""
        return self.reduce.max(np.abs(v)) or 1.0, self.scale(v) or 1.0

    def certify(self, fields: Fields, eps1: float) -> Certificate:
        """Certificate of v, from f and the bounds alone. Collective.

        residual: mean of |natural residual|, v measured against max |v| and f against the mean size of its terms: the forces
        that nothing balances against all forces. A force on one point moves v by no more than it is large (times a
        logarithm of the grid), so it is their sum that bounds the error; and f alone, of order dx dy, would be small for
        any smooth v on a fine grid.
        bound_violation: largest violation of a bound against max |v|.
        """
        v, red = fields["v"], self.reduce
        f = self.residual(v)
        v_scale, f_scale = self.scales(v)
        outside = np.maximum(np.maximum(self.lower - v, v - self.upper), 0.0)
        return Certificate(
            measures={
                "residual": red.sum(np.abs(self.natural_residual(v, f, v_scale, f_scale))) / self.unknowns,
                "bound_violation": red.max(outside) / v_scale,
            },
            tol=certificate_tol(eps1),
            extremes={"natural_residual": red.max(np.abs(self.natural_residual(v, f)))},
        )

    def quantities(self, fields: Fields) -> dict[str, Any]:
        """contact_lower, contact_upper: points where the force of the bound exceeds the distance to it, z > s, each in its own
        scale: rounding leaves traces of both. Collective."""
        v, total = fields["v"], self.reduce.sum
        v_scale, f_scale = self.scales(v)
        f, v, lower, upper = self.residual(v) / f_scale, v / v_scale, self.lower / v_scale, self.upper / v_scale
        return {
            "contact_lower": int(total((f > v - lower).astype(float))),
            "contact_upper": int(total((-f > upper - v).astype(float))),
        }

    def physical(self, fields: Fields) -> dict[str, tuple[Array, str]]:
        """v and f(v), the force of the bounds; they have no unit."""
        return {"v": (fields["v"], ""), "f": (self.residual(fields["v"]), "")}

    def at_sides(self, name: str, x: Array, y: Array) -> Array | None:
        """None: the unknowns are no points between sides."""
        return None

    def prolong(self, coarse: Any, fields: Fields, interior: bool) -> Fields:
        """A neighbour's unknowns as they are; nothing for an interior method.

        Raises
        ------
        InputError : a neighbour of another size: there is no grid behind the unknowns.
        """
        if coarse.grid.shape != self.grid.shape:
            raise InputError("--nested: this problem has no coarser grids")
        return {} if interior else {"v": np.clip(fields["v"], self.lower, self.upper)}

    def coarser(self) -> "tuple[BoxProblem, Transfer] | None":
        """The same problem on a coarser grid, and the interpolation from there; None if there is none. For multigrid.

        Both belong to this problem, which destroys them. Collective.
        """
        return None

    def explain(self, outcome: Outcome, message: str) -> tuple[Outcome, str]:
        """Outcome and message of a run that failed, with what the data say about it."""
        return outcome, message

    def destroy(self) -> None:
        """Free the PETSc objects."""
        self._own.free()
        self.grid.destroy()
