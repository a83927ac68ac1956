"""Nonlinear Gauss-Seidel on the flow balance: a few sweeps put the fronts right to the cell, for the price of a residual.

With its neighbours fixed, the balance of one point is piecewise linear in its own z and has one solution: t, the flow that
arrives, is carried off by pressure if t > 0, p = t/A_ii, and by a lack of fluid otherwise, r = t/B_ii. Sweeps go along x, as
the void does. G is an M-function (off-diagonally antitone, inverse isotone), for which these sweeps converge from any start
(Ortega and Rheinboldt, 13.5); here only what a few of them do locally is wanted.
"""

import numpy as np

from ..base.compiled import compiled, has_numba
from ..base.parallel import Array
from ..problems.film.lubrication import LubricationProblem
from ..problems.solution import Fields


def relaxation(problem: LubricationProblem) -> "Relaxation | None":
    """Sweeps for a problem; None without numba, as interpreted ones cost more than the Newton steps they save."""
    return Relaxation(problem) if has_numba() else None


class Relaxation:
    """Gauss-Seidel within a rank's points, Jacobi between ranks."""

    def __init__(self, problem: LubricationProblem):
        self.problem = problem

    def __call__(self, fields: Fields, sweeps: int) -> Fields:
        """p and r after so many sweeps, to and fro in y. Collective."""
        grid, s, p, r = self.problem.grid, self.problem.scheme, fields["p"], fields["r"]
        coefficients = (*s.coupling, s.entering, s.c, 1.0 / s.diagonal, 1.0 / s.b_C)
        alone = grid.comm.size == 1 and not any(grid.periodic)
        for k in range(sweeps):
            if k == 0 or not alone:
                framed_p, framed_r = (np.nan_to_num(grid.ghosted(field), nan=0.0) for field in (p, r))
            compiled(_sweep)(framed_p, framed_r, *coefficients, k % 2 == 1)
            if not alone or k == sweeps - 1:
                p, r = (framed[1:-1, 1:-1].ravel() for framed in (framed_p, framed_r))
        return {"p": p, "r": r}


def _sweep(
    p: Array,
    r: Array,
    k_W: Array,
    k_E: Array,
    k_S: Array,
    k_N: Array,
    b_W: Array,
    c: Array,
    over_a: Array,
    over_b: Array,
    down: bool,
) -> None:
    """One sweep in place; p and r have a frame of neighbours, the coefficients (`BoxScheme`) have none.

    over_a, over_b: one over the diagonals of A and B.
    """
    ny, nx = c.shape
    for line in range(ny):
        j = ny - line if down else line + 1
        for i in range(1, nx + 1):
            m, l = j - 1, i - 1
            t = c[m, l] + k_W[m, l] * p[j, i - 1] + k_E[m, l] * p[j, i + 1] + k_S[m, l] * p[j - 1, i] + k_N[m, l] * p[j + 1, i]
            t -= b_W[m, l] * r[j, i - 1]
            if t > 0.0:
                p[j, i] = t * over_a[m, l]
                r[j, i] = 0.0
            else:
                p[j, i] = 0.0
                r[j, i] = t * over_b[m, l]
