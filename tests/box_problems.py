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


class Affine(BoxProblem):
    """f(v) = M v + q on one rank, on a line of points that means nothing."""

    def __init__(self, M, q, lower, upper, v0):
        self.M, self.q = np.asarray(M, dtype=float), np.asarray(q, dtype=float)
        super().__init__(Grid((len(q),), (1.0,), PETSc.COMM_SELF), lower, upper, v0)
        full = scipy.sparse.csr_matrix(np.ones_like(self.M))
        csr = (full.indptr, full.indices, self.M.ravel())
        self.mat = self._own(PETSc.Mat().createAIJ(self.M.shape, csr=csr, comm=PETSc.COMM_SELF))

    def residual(self, v):
        return self.M @ v + self.q

    def jacobian(self, v):
        return self.mat

    def scale(self, v):
        return 1.0


def affine(M, q, lower, upper, v0=None) -> BoxProblem:
    """The affine problem; one bound may stand for all."""
    n = len(q)
    l, u = (np.broadcast_to(np.asarray(bound, dtype=float), n) for bound in (lower, upper))
    return Affine(M, q, l, u, np.zeros(n) if v0 is None else v0)
