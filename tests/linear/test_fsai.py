"""FSAI: the equations that define it, exactness on a full pattern, what it refuses, any number of ranks."""

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from petsc4py import PETSc

from lcp_lube.api import solve
from lcp_lube.errors import InputError
from lcp_lube.linear.krylov import Krylov, LinearSolverError
from lcp_lube.linear.pc.fsai import lower_pattern, rows_of_G
from lcp_lube.scenes.scene import load_scene
from lcp_lube.solvers.newton import Stopping

FSAI = {"ksp_type": "cg", "pc_type": "python", "pc_python_type": "lcp_lube.linear.pc.fsai.FSAI"}


def petsc(A):
    A = sp.csr_matrix(A)
    return PETSc.Mat().createAIJ(A.shape, csr=(A.indptr, A.indices, A.data), comm=PETSc.COMM_SELF)


def definite(seed, n):
    rng = np.random.default_rng(seed)
    A = sp.random_array((n, n), density=0.2, rng=rng, data_sampler=rng.standard_normal).toarray()
    A = A + A.T
    return A + np.diag(np.abs(A).sum(axis=1) + rng.uniform(0.1, 1.0, n))


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6), n=st.integers(1, 25), power=st.integers(1, 3))
def test_defining_equations(seed, n, power):
    """(G A)_ij = 0 on the pattern off the diagonal, (G A G')_ii = 1; the pattern is that of tril(A^power)."""
    A = definite(seed, n)
    mat = petsc(A)
    pointers, columns = lower_pattern(mat, power)
    values, ok = rows_of_G(mat, pointers, columns)
    mat.destroy()
    G = sp.csr_matrix((values, columns, pointers), shape=(n, n)).toarray()
    inside = np.zeros((n, n), dtype=bool)
    inside[np.repeat(np.arange(n), np.diff(pointers)), columns] = True
    assert ok
    np.testing.assert_array_equal(inside, np.tril(np.linalg.matrix_power((A != 0).astype(int), power) > 0))
    assert np.abs((G @ A)[inside & ~np.eye(n, dtype=bool)]).max(initial=0.0) < 1e-12
    np.testing.assert_allclose(np.diag(G @ A @ G.T), 1.0, rtol=1e-12)


def test_full_pattern_is_the_cholesky_factor(petsc_options):
    """tril(A^4) of a tridiagonal 5 x 5 matrix is full: G is the inverse factor, one iteration."""
    petsc_options(**FSAI, pc_fsai_power=4)
    A = np.diag(np.full(5, 3.0)) + np.diag(np.full(4, -1.0), 1) + np.diag(np.full(4, -1.0), -1)
    mat = petsc(A)
    krylov = Krylov(mat)
    x, b = mat.createVecs()
    b.setArray(np.arange(1.0, 6.0))
    assert krylov.solve(b, x, 1e-10) == 1
    np.testing.assert_allclose(A @ x.array_r, np.arange(1.0, 6.0), rtol=1e-12)
    for thing in (krylov, mat, x, b):
        thing.destroy()


@pytest.mark.parametrize(("rows", "error", "named"), [
    ([[2.0, 1.0], [0.0, 2.0]], InputError, "symmetric"),
    ([[1.0, 2.0], [2.0, 1.0]], LinearSolverError, "positive definite"),
    ([[1.0, 1.0], [1.0, 1.0]], LinearSolverError, "positive definite"),
])  # fmt: skip
def test_refusals(petsc_options, rows, error, named):
    petsc_options(**FSAI)
    mat = petsc(np.array(rows))
    krylov = Krylov(mat)
    x, b = mat.createVecs()
    with pytest.raises(error, match=named):
        krylov.solve(b, x, 1e-8)
    for thing in (krylov, mat, x, b):
        thing.destroy()


def test_larger_patterns_help(petsc_options):
    """Fewer iterations with each power, and less than half of Jacobi's with the default."""
    counts = {}
    for name, options in {
        "jacobi": {"ksp_type": "cg", "pc_type": "jacobi"},
        **{power: {**FSAI, "pc_fsai_power": power} for power in (1, 2, 3)},
    }.items():
        for key, value in options.items():
            PETSc.Options().setValue(key, value)
        solution = solve(load_scene("bratu", {"n": 40}), stopping=Stopping(1e-9, 0.1))
        counts[name] = solution.total("linear_iterations")
        assert solution.converged
        solution.destroy()
        for key in options:
            PETSc.Options().delValue(key)
    assert counts[3] < counts[2] < counts[1] < counts["jacobi"]
    assert 2.0 < counts["jacobi"] / counts[2] < 3.0


def test_any_number_of_ranks(cli):
    """G depends on the numbering alone: nearly the same counts."""
    counts = []
    for ranks in (1, 3):
        done = cli("solve", "bratu", "--nx", 41, "--ny", 22, "--recipe", "fsai", "--json", ranks=ranks)
        assert done.status == 0, done.err
        counts.append(done.json["linear_iterations"])
    assert max(counts) - min(counts) <= 0.1 * counts[0]


@pytest.mark.parametrize(("options", "named"), [({"pc_fsai_power": 9}, "-pc_fsai_power 9"), ({"mat_type": "dense"}, "aij")])
def test_bad_options(petsc_options, options, named):
    petsc_options(**FSAI, **options)
    with pytest.raises(InputError, match=named):
        solve(load_scene("bratu", {"n": 5}))
