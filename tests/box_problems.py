"""Box-constrained problems of the tests: f(v) = M v + q with any bounds, and the obstacle problem in one call."""

from typing import Any

import numpy as np
import scipy.sparse
from petsc4py import PETSc

from lcp_lube.api import solve
from lcp_lube.problems.box import BoxProblem
from lcp_lube.problems.grid import Grid
from lcp_lube.problems.solution import Solution
from lcp_lube.scenes.scene import load_scene

BOTH = {"v_upper": 0.3, "v_lower": "0.28 - 10*((x - 0.2)^2 + (y - 0.2)^2)"}


def obstacle(changes: dict[str, Any] | None = None, **how: Any) -> Solution:
    """The solved scene obstacle_bratu."""
    return solve(load_scene("obstacle_bratu", changes or {}), **how)


class Affine:
    """f(v) = M v + q on one rank."""

    def __init__(self, M, q):
        self.M, self.q = np.asarray(M, dtype=float), np.asarray(q, dtype=float)
        full = scipy.sparse.csr_matrix(np.ones_like(self.M))
        self.mat = PETSc.Mat().createAIJ(self.M.shape, csr=(full.indptr, full.indices, self.M.ravel()), comm=PETSc.COMM_SELF)

    def residual(self, v):
        return self.M @ v + self.q

    def jacobian(self, v):
        return self.mat

    def scale(self, v):
        return 1.0

    def destroy(self):
        self.mat.destroy()


def affine(M, q, lower, upper, v0=None) -> BoxProblem:
    """The affine problem on a line of points that means nothing."""
    n = len(q)
    grid = Grid((n,), (1.0,), PETSc.COMM_SELF)
    start = np.zeros(n) if v0 is None else v0
    l, u = (np.broadcast_to(np.asarray(bound, dtype=float), n) for bound in (lower, upper))
    return BoxProblem(grid, Affine(M, q), l, u, start)
