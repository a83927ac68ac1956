"""Elimination without subtraction for column diagonally dominant M-matrices (Grassmann, Taksar and Heyman), in a band.

What such a matrix says is what each unknown hands to the others and what it loses: its diagonal is the sum of both. Keeping
the loss instead of the diagonal, every number of the elimination is a sum of products of nonnegative ones, so that factors
and inverse are right to nearly all digits *in every entry*, whatever the ratio of the entries (O'Cinneide, Numer. Math. 65,
1993). An LU of the entries themselves loses a loss of 1e-16 of the diagonal, and with it the level of what hangs on it.
"""

import numpy as np

from .compiled import compiled
from .parallel import Array


class Elimination:
    """Factors of M, M[i, j] = -handed from j to i, M[j, j] = (all that j hands on) + loss[j].

    Parameters
    ----------
    handed : of shape (n, 2 b + 1): handed[j, i - j + b] from j to i, nonnegative; taken over.
    loss : of every unknown, nonnegative; taken over.

    Attributes
    ----------
    singular : the first unknown of a closed group that loses nothing, -1 if there is none.
    """

    def __init__(self, handed: Array, loss: Array):
        self._handed, self._pivots = handed, np.empty(len(loss))
        self.singular = int(compiled(_factor)(handed, loss, self._pivots))

    def solve(self, f: Array) -> Array:
        """M^-1 f: exact to rounding of M^-1 |f|."""
        x = np.array(f, dtype=float)
        compiled(_substitute)(self._handed, self._pivots, x)
        return x


def _factor(handed: Array, loss: Array, pivots: Array) -> int:
    n, width = handed.shape
    b = width // 2
    for k in range(n):
        last = min(k + b, n - 1)
        pivot = loss[k]
        for i in range(k + 1, last + 1):
            pivot += handed[k, i - k + b]
        if not pivot > 0.0:
            return k
        pivots[k] = pivot
        for j in range(k + 1, last + 1):
            share = handed[j, k - j + b] / pivot
            if share > 0.0:
                loss[j] += loss[k] * share
                for i in range(k + 1, last + 1):
                    if i != j:  # what comes back to it was never lost
                        handed[j, i - j + b] += handed[k, i - k + b] * share
    return -1


def _substitute(handed: Array, pivots: Array, x: Array) -> None:
    n, width = handed.shape
    b = width // 2
    for k in range(n):
        part = x[k] / pivots[k]
        for i in range(k + 1, min(k + b, n - 1) + 1):
            x[i] += handed[k, i - k + b] * part
    for k in range(n - 1, -1, -1):
        total = x[k]
        for j in range(k + 1, min(k + b, n - 1) + 1):
            total += handed[j, k - j + b] * x[j]
        x[k] = total / pivots[k]
