"""What a direct solver's last corrections tell of an answer: where they do not shrink, its digits are those of the factors."""

import numpy as np

from ..base.parallel import Array
from ..problems.film.lubrication import LubricationProblem
from .newton import StalledError

EPS = float(np.finfo(float).eps)
ACCURATE = 1e-7  # of the largest pressure: what the last correction may leave to be desired


def check_refined(problem: LubricationProblem, z: Array, left: float) -> None:
    """Refuse pressures that a solve with what is left of the balance would still move by `left`. Collective.

    A deep pocket behind a film of 1e-15 of its conductance hangs on flows that are rounding to its own: no residual sees that
    its pressure is wrong. Pressures below what one rounding of the wall's flow makes in the thinnest film are as good as none.

    Raises
    ------
    StalledError : left is too much.
    """
    reduce, s, p_max = problem.reduce, problem.scheme, max(problem.reduce.max(z), 0.0)
    if left <= ACCURATE * p_max:
        return
    weakest = reduce.min(np.array([np.min(k, where=k > 0, initial=np.inf) for k in (s.k_W, s.k_E, s.k_S, s.k_N)]))
    rounding = 8 * EPS * problem.size * reduce.max(np.abs(s.b_C)) / weakest
    if left > ACCURATE * p_max + rounding:
        raise StalledError(f"rounding in the factors leaves pressures uncertain by {left / (p_max or 1.0):.1e} of the largest")
