"""AINV: the exact inverse without dropping, compiled or not, failures that are reported, counts in Newton's method."""

import sys

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from petsc4py import PETSc

from lcp_lube.api import solve
from lcp_lube.base.compiled import compiled
from lcp_lube.errors import InputError
from lcp_lube.linear.krylov import Krylov, LinearSolverError
from lcp_lube.linear.pc.ainv import biconjugate, factorise, scaling
from lcp_lube.scenes.scene import load_scene
from lcp_lube.solvers.newton import Stopping

LOOSE = Stopping(eps1=1e-9, eps2=0.1)
AINV = {"pc_type": "python", "pc_python_type": "lcp_lube.linear.pc.ainv.AINV"}


def random_matrix(seed, n, symmetric):
    """Sparse, with a dominant diagonal, rows and columns of different sizes."""
    rng = np.random.default_rng(seed)
    A = sp.random_array((n, n), density=0.3, rng=rng, data_sampler=rng.standard_normal).toarray()
    A = A + A.T if symmetric else A
    np.fill_diagonal(A, np.abs(A).sum(axis=0) + np.abs(A).sum(axis=1) + 0.1)
    row = 10.0 ** rng.uniform(-2, 2, n)
    column = row if symmetric else 10.0 ** rng.uniform(-2, 2, n)
    return sp.csr_matrix(row[:, None] * A * column)


def run(name, changes=None, **arguments):
    solution = solve(load_scene(name, changes or {}), **arguments)
    solution.destroy()
    return solution


def petsc(A):
    return PETSc.Mat().createAIJ(A.shape, csr=(A.indptr, A.indices, A.data), comm=PETSc.COMM_SELF)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6), n=st.integers(1, 30), symmetric=st.booleans())
def test_no_dropping_gives_the_inverse(seed, n, symmetric):
    A = random_matrix(seed, n, symmetric)
    Z, DW, failed = factorise(A, 0.0)
    assert failed == -1
    np.testing.assert_allclose((Z @ DW @ A).toarray(), np.eye(n), atol=1e-10 * np.linalg.cond(A.toarray()))


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6), n=st.integers(1, 30), symmetric=st.booleans(), drop=st.sampled_from([0.01, 0.1, 0.3]))
def test_dropping_only_leaves_out(seed, n, symmetric, drop):
    """No entry of Z or W below the tolerance but those that it would be 1 beside; symmetric for symmetric matrices."""
    A = random_matrix(seed, n, symmetric)
    row, column = scaling(A)
    Z, DW, failed = factorise(A, drop)
    assert failed == -1
    unit = sp.csr_matrix(sp.diags_array(1.0 / column) @ Z)
    assert np.abs(unit.data).min() >= drop and np.allclose(unit.diagonal(), 1.0)
    assert sp.triu(unit).nnz == unit.nnz
    M = (Z @ DW).toarray()
    if symmetric:
        np.testing.assert_allclose(M, M.T, rtol=1e-12, atol=1e-14 * np.abs(M).max())
        assert np.linalg.eigvalsh(M * row[:, None] * row).min() > 0


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6), n=st.integers(1, 25))
def test_scaling_equilibrates(seed, n):
    A = random_matrix(seed, n, False)
    row, column = scaling(A)
    largest = np.abs(row[:, None] * A.toarray() * column)
    for axis in (0, 1):
        assert largest.max(axis=axis).min() > 0.5 and largest.max() < 2.0


@pytest.mark.parametrize("drop", [0.0, 0.05])
def test_compiled_and_plain_python_agree(drop):
    pytest.importorskip("numba")
    A = random_matrix(3, 60, False)
    T = sp.csr_matrix(A.T)
    arguments = [a.astype(np.int64) for a in (A.indptr, A.indices)] + [A.data]
    arguments += [a.astype(np.int64) for a in (T.indptr, T.indices)] + [drop]
    assert compiled(biconjugate) is not biconjugate
    for fast, plain in zip(compiled(biconjugate)(*arguments), biconjugate(*arguments), strict=True):
        np.testing.assert_array_equal(fast, plain)


def kernel(n):
    return n + 1


def test_without_numba(monkeypatch):
    monkeypatch.setitem(sys.modules, "numba", None)
    compiled.cache_clear()
    assert compiled(kernel) is kernel
    compiled.cache_clear()


def test_no_place_for_the_cache(monkeypatch):
    """An installation that cannot be written, without a home directory: compiled all the same, in every run."""
    numba = pytest.importorskip("numba")
    njit, asked = numba.njit, []

    def refuse(*arguments, **options):
        asked.append(options)
        if options.get("cache"):
            raise RuntimeError("cannot cache function: no locator available")
        return njit(*arguments, **options)

    monkeypatch.setattr(numba, "njit", refuse)
    compiled.cache_clear()
    assert compiled(kernel)(1) == 2 and asked == [{"cache": True}, {}]
    compiled.cache_clear()


@pytest.mark.parametrize("scene", [("bratu", {"nx": 13, "ny": 9}), ("poisson_cubic", {"n": 10}), ("problem1", {"n": 40})])
@pytest.mark.parametrize("ksp", ["gmres", "bcgs"])
def test_drop_0_takes_one_iteration(petsc_options, scene, ksp):
    """The inverse itself: one iteration a step, symmetric or not, also on the 2n system of a bearing."""
    petsc_options(ksp_type=ksp, pc_ainv_drop=0, **AINV)
    name, changes = scene
    solution = run(name, changes, **({"method": "din", "system": "full"} if name == "problem1" else {}))
    assert solution.converged and solution.iterations > 2
    assert [step.linear_iterations for step in solution.steps] == [1] * solution.iterations


def test_published_counts():
    """Table 4, n = 4096: 3 steps; 57 iterations with AINV are printed, 134 with Jacobi. Rounding moves a few."""
    ainv = run("bratu", {"n": 64}, recipe="ainv", stopping=LOOSE)
    jacobi = run("bratu", {"n": 64}, recipe="bcgs_jacobi", stopping=LOOSE)
    assert ainv.iterations == jacobi.iterations == 3
    assert abs(ainv.total("linear_iterations") - 57) <= 6
    assert abs(jacobi.total("linear_iterations") - 134) <= 20


def test_transposed(petsc_options):
    """bicg needs the transposed preconditioner: without dropping it too is exact."""
    A = random_matrix(5, 40, False)
    petsc_options(ksp_type="bicg", ksp_rtol=1e-8, pc_ainv_drop=0, **AINV)
    mat = petsc(A)
    krylov = Krylov(mat)
    x, b = mat.createVecs()
    b.set(1.0)
    assert krylov.solve(b, x, 1e-8) <= 2
    np.testing.assert_allclose(A @ x.array_r, 1.0, rtol=1e-6)
    for thing in (krylov, mat, x, b):
        thing.destroy()


@pytest.mark.parametrize("rows", [[[0.0, 1.0], [1.0, 0.0]], [[1.0, 1.0], [1.0, 1.0]], [[1.0, 0.0], [0.0, 0.0]]])
def test_breakdown_is_heard_of(petsc_options, rows):
    """A zero diagonal, a singular matrix, an empty row."""
    petsc_options(ksp_type="bcgs", **AINV)
    mat = petsc(sp.csr_matrix(np.array(rows)))
    krylov = Krylov(mat)
    x, b = mat.createVecs()
    b.set(1.0)
    with pytest.raises(LinearSolverError, match="pivot in column"):
        krylov.solve(b, x, 1e-8)
    for thing in (krylov, mat, x, b):
        thing.destroy()


def test_nothing_to_invert():
    """A rank without unknowns, a film without full cells."""
    Z, DW, failed = factorise(sp.csr_matrix((0, 0)), 0.05)
    assert Z.shape == DW.shape == (0, 0) and failed == -1


@pytest.mark.parametrize("ranks", [2, 3])
def test_in_parallel(cli, ranks):
    """The counts of one rank but for rounding, more with a block a rank; the view, and an end without a crash."""
    words = ("solve", "bratu", "--nx", 41, "--ny", 22, "--method", "newton", "--recipe", "ainv", "--json")
    one = cli(*words).json["linear_iterations"]
    done = cli(*words, "-ksp_view", ":view.txt", ranks=ranks)
    assert done.status == 0, done.err
    assert done.json["converged"] and abs(done.json["linear_iterations"] - one) <= 3
    block = cli(*words, "-pc_ainv_block", ranks=ranks)
    assert block.json["converged"] and one < block.json["linear_iterations"] < 120


def test_the_inverse_on_two_ranks(cli):
    """Without dropping the whole inverse: one iteration a step, which no inverse of the blocks can give."""
    words = ("solve", "bratu", "--n", 12, "--method", "newton", "--json", "-ksp_type", "gmres", "-pc_type", "python")
    words = (*words, "-pc_python_type", "lcp_lube.linear.pc.ainv.AINV", "-pc_ainv_drop", 0)
    whole, block = (cli(*words, *more, ranks=2).json for more in ((), ("-pc_ainv_block",)))
    assert whole["converged"] and whole["linear_iterations"] == whole["iterations"]
    assert block["converged"] and block["linear_iterations"] > 2 * block["iterations"]


@pytest.mark.parametrize(("options", "named"), [
    ({"pc_ainv_drop": -0.1}, "-pc_ainv_drop -0.1: allowed are"),
    ({"pc_ainv_drop": "small"}, "small"),
    ({"mat_type": "dense"}, "aij"),
])  # fmt: skip
def test_bad_options(petsc_options, options, named):
    petsc_options(**AINV, **options)
    with pytest.raises(InputError, match=named):
        run("bratu", {"n": 5})


def test_misspelt_option(cli):
    done = cli("solve", "bratu", "--n", 5, "--recipe", "ainv", "-pc_ainv_dropp", 0.1)
    assert done.status == 2 and len(done.lines) == 1 and "nearest is -pc_ainv_drop" in done.err
