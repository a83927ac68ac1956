"""Block Cimmino: projections, partitions, the theory of one block and of orthogonal blocks, the published count."""

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from petsc4py import PETSc

from lcp_lube.api import solve
from lcp_lube.errors import InputError
from lcp_lube.linear.krylov import Krylov, LinearSolverError
from lcp_lube.linear.pc.cimmino import Cimmino
from lcp_lube.scenes.scene import load_scene
from lcp_lube.solvers.newton import Stopping

pytestmark = pytest.mark.rounding

PC = {"pc_type": "python", "pc_python_type": "lcp_lube.linear.pc.cimmino.Cimmino"}
CG = {"ksp_type": "python", "ksp_python_type": "lcp_lube.linear.pc.cimmino.CimminoCG", "pc_type": "none"}


def petsc(A):
    A = sp.csr_matrix(A)
    return PETSc.Mat().createAIJ(A.shape, csr=(A.indptr, A.indices, A.data), comm=PETSc.COMM_SELF)


def random_matrix(seed, n):
    rng = np.random.default_rng(seed)
    A = sp.random_array((n, n), density=0.4, rng=rng, data_sampler=rng.standard_normal).toarray()
    return A + np.diag(rng.uniform(2.0, 3.0, n))


def cimmino(mat, partition, blocks=None, prefix=""):
    """Set up on a matrix; `blocks` overrides the partition, as a test may."""
    made = Cimmino()
    made.partition, made.count, made._prefix = partition, 0, prefix
    if blocks is not None:
        made.blocks, made._work = np.asarray(blocks), mat.createVecLeft()
    made.refresh(mat)
    return made


def whole(made, mat):
    """M^-1 as an array, column by column."""
    n = mat.getSize()[0]
    x, y = mat.createVecs()
    out = np.empty((n, n))
    for k, unit in enumerate(np.eye(n)):
        x.setArray(unit)
        made.multiply(x, y)
        out[:, k] = y.array_r
    x.destroy()
    y.destroy()
    return out


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6), n=st.integers(1, 14), m=st.integers(1, 5))
def test_sum_of_pseudo_inverses(seed, n, m):
    """M^-1 = sum_i A_i^+ for any partition of a nonsymmetric matrix; H is symmetric with eigenvalues in (0, m]."""
    A = random_matrix(seed, n)
    blocks = np.random.default_rng(seed).integers(0, m, n)
    expected = np.zeros((n, n))
    for k in np.unique(blocks):
        expected[:, blocks == k] = np.linalg.pinv(A[blocks == k])
    mat = petsc(A)
    made = cimmino(mat, "contiguous", blocks)
    found = whole(made, mat)
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-8 * np.abs(expected).max())
    H = found @ A
    np.testing.assert_allclose(H, H.T, atol=1e-7)
    eigenvalues = np.linalg.eigvalsh((H + H.T) / 2)
    assert eigenvalues[0] > 0 and eigenvalues[-1] <= m + 1e-7
    made.destroy()
    mat.destroy()


@pytest.mark.parametrize(("shape", "first_fit"), [((8, 8), 7), ((16, 11), 7), ((64, 64), 7)])
def test_orthogonal_blocks_of_the_five_point_stencil(shape, first_fit):
    """(x + 2 y) mod 5 makes five blocks, first fit in natural order seven; both need no factorisation."""
    problem = load_scene("bratu", {"nx": shape[0], "ny": shape[1]}).build()
    problem.A.setAttr("problem", problem)
    for partition, number in (("stencil", 5), ("first_fit", first_fit), ("rows", shape[0] * shape[1])):
        made = cimmino(problem.A, partition)
        assert made.orthogonal and len(np.unique(made.blocks)) == number
        made.destroy()
    problem.destroy()


def first_counts(petsc_options, lam=1.0, n=32, **options):
    """CG iterations of each Newton step at a tolerance of 1e-5."""
    petsc_options(**options)
    scene = load_scene("bratu", {"n": n, "lambda": lam})
    solution = solve(scene, stopping=Stopping(1e-9, 0.1), options={"eta": 1e-5})
    solution.destroy()
    assert solution.converged, solution.message
    return [step.linear_iterations for step in solution.steps]


@pytest.mark.parametrize("outer", ["CimminoCG", "gmres", "bcgs"])
def test_one_block_takes_one_iteration(petsc_options, outer):
    options = CG if outer == "CimminoCG" else {"ksp_type": outer, **PC}
    counts = first_counts(petsc_options, cimmino_partition="contiguous", cimmino_blocks=1, **options)
    assert counts == [1] * len(counts)


def test_more_blocks_more_iterations(petsc_options):
    counts = [first_counts(petsc_options, cimmino_partition="contiguous", cimmino_blocks=m, **CG)[0] for m in (2, 4, 8)]
    assert 1 < counts[0] < counts[1] < counts[2]


def test_orthogonal_blocks_count_alike(petsc_options):
    """However many orthogonal blocks: the operator is A'A with normalised rows, so the counts are the same to the digit."""
    counts = [first_counts(petsc_options, cimmino_partition=p, **CG) for p in ("stencil", "first_fit", "rows")]
    assert counts[0] == counts[1] == counts[2]


@pytest.mark.parametrize("lam", [1.0, 5.0])
def test_published_count(petsc_options, lam):
    """Table 3, n = 4096: 630 is the count of one Newton step, whatever lambda is."""
    assert abs(first_counts(petsc_options, lam=lam, n=64, **CG)[0] - 630) <= 3


@pytest.mark.parametrize("partition", ["stencil", "contiguous"])
def test_in_parallel(cli, partition):
    """Orthogonal blocks: as many iterations on any number of ranks; contiguous blocks: an answer on any."""
    counts = []
    for ranks in (1, 3 if partition == "stencil" else 2):
        words = ["--recipe", "cimmino", "-cimmino_partition", partition, "--eps2", 0.1]
        done = cli("solve", "bratu", "--nx", 17, "--ny", 12, *words, "--json", ranks=ranks)
        assert done.status == 0, done.err
        counts.append(done.json["linear_iterations"] / done.json["iterations"])
    if partition == "stencil":
        assert max(counts) - min(counts) <= 0.03 * counts[0]
    else:
        assert counts[0] == 1 < counts[1]


def test_empty_row(petsc_options):
    petsc_options(**CG)
    mat = petsc(np.array([[1.0, 1.0], [0.0, 0.0]]))
    krylov = Krylov(mat)
    x, b = mat.createVecs()
    b.set(1.0)
    with pytest.raises(LinearSolverError, match="no entries"):
        krylov.solve(b, x, 1e-8)
    for thing in (krylov, mat, x, b):
        thing.destroy()


@pytest.mark.parametrize(("scene", "partition", "named"), [
    ("bratu", "stencl", "nearest is stencil"),
    ("problem1", "stencil", "first_fit"),
])  # fmt: skip
def test_bad_partition(petsc_options, scene, partition, named):
    petsc_options(**CG, cimmino_partition=partition)
    with pytest.raises(InputError, match=named):
        solve(load_scene(scene, {"n": 5}))


@pytest.mark.parametrize(("words", "named"), [
    (("-cimmino_blocks", 3), "no solver in this run reads"),
    (("-cimmino_partition", "contiguous", "-cimmino_blocks", 1), "at least one block a rank"),
])  # fmt: skip
def test_bad_number_of_blocks(cli, words, named):
    """A number that no partition asked for, and fewer blocks than ranks."""
    done = cli("solve", "bratu", "--n", 6, "--recipe", "cimmino", *words, ranks=2)
    assert done.status == 2 and len(done.lines) == 1 and named in done.err, done.err
