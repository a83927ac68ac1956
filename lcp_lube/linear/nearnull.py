"""The near-null vector of the full film's Schur complement, by aggregation and disaggregation.

Flow lost where the film ruptures re-enters where it forms again, so the vector w > 0 with S w ~ 0 has kinks at the fronts,
and multigrid that reproduces constants alone breaks down there. S is, up to the leak through the boundary, the generator of
a Markov chain turned round, and w its stationary vector: multiplicative aggregation cycles find it (Horton and Leutenegger;
De Sterck et al.). On S diag(w) constants are near-null again.
"""

import numpy as np
from petsc4py import PETSc

from ..base.parallel import Array

# benchmarks/constants.py sweeps them: all flat around these values.
COARSEST = 200  # unknowns of the coarsest level
COARSEST_SWEEPS = 20  # there
LEAK = 1e-4  # right-hand side, in parts of diag(S): larger ones let the boundary's distance show, which spoils w
SWEEPS = 3  # symmetric Gauss-Seidel sweeps before and after


class NearNull:
    """Aggregation hierarchy for one sparsity of S.

    Parameters
    ----------
    S : the matrix, any number of ranks.
    i, j : grid column and line of each of this rank's unknowns; aggregates are 2 x 2 blocks of them.
    """

    def __init__(self, S: PETSc.Mat, i: np.ndarray, j: np.ndarray):
        self._S = S
        self._prolongations: list[PETSc.Mat] = []
        size = S.getSize()[0]
        while size > COARSEST:
            i, j = i // 2, j // 2
            width = int(i.max(initial=0)) + 1
            block = j * width + i
            used = np.zeros(int(block.max(initial=0)) + 1, dtype=bool)
            used[block] = True
            aggregate = (np.cumsum(used) - 1)[block]
            blocks = np.flatnonzero(used)
            i, j = blocks % width, blocks // width
            P = _aggregation(aggregate, int(used.sum()), S.comm)
            self._prolongations.append(P)
            size = P.getSize()[1]

    def improve(self, w: Array, cycles: int) -> Array:
        """w after some cycles; every entry stays positive. Collective."""
        S = self._S
        x, f = S.createVecs()
        x.setArray(w)
        S.getDiagonal(f)
        f.scale(LEAK)
        for _ in range(cycles):
            self._cycle(S, x, f, 0)
        out = x.array_r.copy()
        x.destroy()
        f.destroy()
        return out

    def _cycle(self, S: PETSc.Mat, x: PETSc.Vec, f: PETSc.Vec, level: int) -> None:
        symmetric = PETSc.Mat.SORType.LOCAL_SYMMETRIC_SWEEP
        if level == len(self._prolongations):
            S.SOR(f, x, sortype=symmetric, its=COARSEST_SWEEPS)
            return
        S.SOR(f, x, sortype=symmetric, its=SWEEPS)
        P = self._prolongations[level]
        scaled = S.duplicate(copy=True)
        scaled.diagonalScale(None, x)
        coarse = scaled.ptap(P)
        e, f_coarse = coarse.createVecs()
        P.multTranspose(f, f_coarse)
        e.set(1.0)
        self._cycle(coarse, e, f_coarse, level + 1)
        fine = x.duplicate()
        P.mult(e, fine)
        x.pointwiseMult(x, fine)
        for obj in (scaled, coarse, e, f_coarse, fine):
            obj.destroy()
        S.SOR(f, x, sortype=symmetric, its=SWEEPS)

    def destroy(self) -> None:
        for P in self._prolongations:
            P.destroy()


def _aggregation(aggregate: np.ndarray, count: int, comm: PETSc.Comm) -> PETSc.Mat:
    """The matrix of ones that spreads a value an aggregate over its unknowns."""
    n = aggregate.size
    first = int(comm.tompi4py().exscan(count) or 0)
    pointers = np.arange(n + 1, dtype=PETSc.IntType)
    columns = (first + aggregate).astype(PETSc.IntType)
    return PETSc.Mat().createAIJWithArrays(((n, None), (count, None)), (pointers, columns, np.ones(n)), comm=comm)
