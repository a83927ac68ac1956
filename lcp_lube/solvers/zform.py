"""The flow balance as one piecewise linear equation: p = max(z, 0), r = s max(-z, 0), so that p r = 0 for every z.

    G(z) = A max(z, 0) + B s max(-z, 0) - c = 0,   s = diag A / diag(-B)

With this s both kinds of columns of G's Jacobian have A's diagonal: a step in z means the same in both phases.
"""

from collections.abc import Callable
from copy import copy

import numpy as np
from numpy.typing import NDArray

from ..base.parallel import Array
from ..problems.film.lubrication import LubricationProblem
from ..problems.solution import Fields
from .newton import StalledError

EPS = float(np.finfo(float).eps)
REFINEMENTS, REFINED = 8, 1e-12  # solves that a direct solver adds to the last step, until z moves by less of itself
ACCURATE = 1e-7  # of the largest pressure: what the last correction may leave to be desired


class ZForm:
    """z of fields, fields of z, G and its norm, for one problem."""

    def __init__(self, problem: LubricationProblem):
        scheme = problem.scheme.changed(b_C=problem.scheme.b_C, b_W=problem.scheme.b_W)  # made once, not for each residual
        self.problem = copy(problem)
        self.problem.scheme = scheme
        self.diagonal, b_C = scheme.diagonal.ravel(), scheme.b_C.ravel()
        self.s = self.diagonal / -b_C
        self._dragged, self._driven = (problem.reduce.norm(a) for a in (b_C, problem.c))

    def z(self, fields: Fields) -> Array:
        return fields["p"] - fields["r"] / self.s

    def fields(self, z: Array) -> Fields:
        """p and r, complementary to the last bit."""
        return {"p": np.maximum(z, 0.0), "r": self.s * np.maximum(-z, 0.0)}

    def residual(self, z: Array) -> Array:
        """G. Collective."""
        return self.problem.balance(np.maximum(z, 0.0), self.s * np.maximum(-z, 0.0))

    def norm(self, z: Array, G: Array, eps1: float) -> float:
        """||G|| / ||c||; where rounding in G's sums alone exceeds eps1, on very fine grids, relative to that. Collective."""
        reduce, c = self.problem.reduce, self.problem.c
        # c is a difference of the wall's flows, and knows no more than they do.
        rounding = max(16 * EPS * reduce.norm(self.diagonal * np.abs(z) + np.abs(c)), EPS * self._dragged)
        driven = self._driven or reduce.norm(self.diagonal)  # nothing drives the film: p is measured by its unit
        return reduce.norm(G) / max(driven, rounding / eps1)

    def refine(self, z: Array, G: Array, full: NDArray[np.bool_], solve_again: Callable[[Array], Array]) -> Array:
        """Solve again with the same factors for what is left of G: their rounding is that of A's diagonal, G's is not.

        Parameters
        ----------
        G : of z. full : where z is a pressure for the factors.
        solve_again : d with J d = f for the J of the last step.

        Raises
        ------
        StalledError : a deep pocket behind a film of 1e-15 of its conductance hangs on flows that are rounding to its own: no
            residual sees that its pressure is wrong, but the last correction does. Pressures below what one rounding of the
            wall's flow makes in the thinnest film are as good as none.
        """
        reduce, last, left = self.problem.reduce, np.inf, 0.0
        for _ in range(REFINEMENTS):
            d = solve_again(-G)
            parts = [(np.where(some, np.abs(d), 0.0), np.where(some, np.abs(z), 0.0)) for some in (full, ~full)]
            size = max(reduce.max(moved) / (reduce.max(whole) or 1.0) for moved, whole in parts)
            left = reduce.max(parts[0][0])
            if not size < 0.5 * last:  # rounding, or NaN
                break
            z, last = z + d, size
            if size <= REFINED:
                break
            G = self.residual(z)
        p_max, s = max(reduce.max(z), 0.0), self.problem.scheme
        if left > ACCURATE * p_max:
            weakest = reduce.min(np.array([np.min(k, where=k > 0, initial=np.inf) for k in (s.k_W, s.k_E, s.k_S, s.k_N)]))
            dragged = max(reduce.max(np.abs(flow)) for flow in (s.couette_W, s.couette_E))  # b_C stands for a wall at rest too
            rounding = 8 * EPS * self.problem.size * dragged / weakest
            if left > ACCURATE * p_max + rounding:
                words = f"{left / (p_max or 1.0):.1e} of the largest"
                raise StalledError(f"rounding in the factors leaves pressures uncertain by {words}")
        return z
