"""The rules for the step length alpha, each on its own: distributed arrays and scalars, no PETSc, no method."""

from collections.abc import Callable

import numpy as np

from ..base.parallel import Array, Reduce

MAX_HALVINGS = 99  # to 1.6e-30 of a step: beyond any rounding, so that it is the criterion that fails, not the count


class StepLengthError(ArithmeticError):
    """No acceptable step length: a rule has cut alpha as often as it may."""


def feasible(reduce: Reduce, *pairs: tuple[Array, Array]) -> float:
    """F: the largest step alpha in [0, 1] that keeps every x + alpha dx >= 0, for pairs (x, dx) with x >= 0. Collective."""
    limit = 1.0
    for x, dx in pairs:
        bounds = np.divide(x, -dx, out=np.full_like(x, np.inf), where=dx < 0)
        limit = min(limit, float(np.min(bounds, initial=np.inf)))
    return max(reduce.min(np.array([limit])), 0.0)  # rounding may have left an x at -1e-25


def reduction(alpha: float, gap: float) -> float:
    """R: the factor of Argaez, Tapia and Velazquez that keeps off the boundary; gap = p'r before the step."""
    towards = 1.0 - 100.0 * gap
    return alpha * max(0.8, towards if alpha == 1.0 else min(0.9995, towards))


def halve_until(
    accept: Callable[[float], bool], alpha: float, theta: float = 0.5, most: int = MAX_HALVINGS
) -> tuple[float, int]:
    """Multiply alpha by theta until it is accepted; returns alpha and the number of cuts.

    Raises
    ------
    StepLengthError : not accepted after `most` cuts.
    """
    for cuts in range(most + 1):
        if accept(alpha):
            return alpha, cuts
        alpha *= theta
    raise StepLengthError(f"alpha fell to {alpha:.1e}")


class Centrality:
    """C: conditions (28) and (29), phi(alpha) >= 0 and psi(alpha) >= 0, with tau1, tau2 from the start (30).

    phi = min_i p_i r_i - tau1 gamma p'r/n keeps products together, psi = p'r - tau2 gamma ||F1|| keeps them from
    vanishing before the flow balance does.

    Parameters
    ----------
    products : p r of the starting vector; n points in all.
    norm_F1 : ||A p + B r - c|| there.
    """

    def __init__(self, reduce: Reduce, products: Array, n: int, norm_F1: float, gamma: float = 0.5):
        self.reduce, self.n, self.gamma = reduce, n, gamma
        gap = reduce.sum(products)
        tau1_max = n * reduce.min(products) / gap if gap > 0 else 0.0
        tau2_max = gap / norm_F1 if norm_F1 > 0 else 0.0
        self.tau1 = min(tau1_max * 1e-7 / 2.0, 0.99)
        self.tau2 = tau2_max * 1e-7

    def holds(self, products: Array, norm_F1: float) -> bool:
        """Whether phi >= 0 and psi >= 0 for the products p r and ||F1|| of a trial point. Collective."""
        gap = self.reduce.sum(products)
        phi = self.reduce.min(products) - self.tau1 * self.gamma * gap / self.n
        return bool(phi >= 0.0 and gap - self.tau2 * self.gamma * norm_F1 >= 0.0)


def inexact_decrease(norm: float, new_norm: float, alpha: float, forcing: float, beta: float) -> bool:
    """B: ||F(x + alpha d)|| <= (1 - beta alpha (1 - forcing)) ||F(x)||, the decrease of an inexact Newton step."""
    return new_norm <= (1.0 - beta * alpha * (1.0 - forcing)) * norm


def armijo(merit: float, new_merit: float, alpha: float, slope: float, beta: float) -> bool:
    """Armijo: Phi(x + alpha d) <= Phi(x) + beta alpha slope, with the slope of Phi along d (negative)."""
    return new_merit <= merit + beta * alpha * slope
