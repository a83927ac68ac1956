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
LEAK = 1e-4  # right-hand side, in parts of diag(S): larger ones let the boundary's distance show, which spoils w
SWEEPS = 3  # symmetric Gauss-Seidel sweeps before and after, and on the coarsest level


def near_null(S: PETSc.Mat, i: np.ndarray, j: np.ndarray, w: Array, cycles: int) -> Array:
    """w after some cycles; every entry stays positive. Collective.

    Parameters
    ----------
    S : the matrix, any number of ranks.
    i, j : grid column and line of each of this rank's unknowns; aggregates are 2 x 2 blocks of them.
    """
    prolongations: list[PETSc.Mat] = []
    size = S.getSize()[0]
    while size > COARSEST:
        i, j = i // 2, j // 2
        width = int(i.max(initial=0)) + 1
        blocks, aggregate = np.unique(j * width + i, return_inverse=True)
        i, j = blocks % width, blocks // width
        prolongations.append(_aggregation(aggregate, blocks.size, S.comm))
        size = prolongations[-1].getSize()[1]
    x, f = S.createVecs()
    x.setArray(w)
    S.getDiagonal(f)
    f.scale(LEAK)
    for _ in range(cycles):
        _cycle(S, x, f, prolongations)
    out = x.array_r.copy()
    for obj in (x, f, *prolongations):
        obj.destroy()
    return out


def _cycle(S: PETSc.Mat, x: PETSc.Vec, f: PETSc.Vec, prolongations: list[PETSc.Mat]) -> None:
    symmetric = PETSc.Mat.SORType.LOCAL_SYMMETRIC_SWEEP
    S.SOR(f, x, sortype=symmetric, its=SWEEPS)
    if not prolongations:
        return
    P, *coarser = prolongations
    scaled = S.duplicate(copy=True)
    scaled.diagonalScale(None, x)
    coarse = scaled.ptap(P)
    e, f_coarse = coarse.createVecs()
    P.multTranspose(f, f_coarse)
    e.set(1.0)
    _cycle(coarse, e, f_coarse, coarser)
    fine = x.duplicate()
    P.mult(e, fine)
    x.pointwiseMult(x, fine)
    for obj in (scaled, coarse, e, f_coarse, fine):
        obj.destroy()
    S.SOR(f, x, sortype=symmetric, its=SWEEPS)


def _aggregation(aggregate: np.ndarray, count: int, comm: PETSc.Comm) -> PETSc.Mat:
    """The matrix of ones that spreads a value an aggregate over its unknowns."""
    n = aggregate.size
    first = int(comm.tompi4py().exscan(count) or 0)
    pointers = np.arange(n + 1, dtype=PETSc.IntType)
    columns = (first + aggregate).astype(PETSc.IntType)
    return PETSc.Mat().createAIJWithArrays(((n, None), (count, None)), (pointers, columns, np.ones(n)), comm=comm)
