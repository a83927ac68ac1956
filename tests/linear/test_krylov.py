"""The KSP behind every step: configured by options alone, and its failures reported."""

import subprocess
import sys

import numpy as np
import pytest
from conftest import ENVIRONMENT
from films import FilmScene, Knots, make_problem
from petsc4py import PETSc

from lcp_lube import InputError, load_scene, solve
from lcp_lube.linear.full import FullSystem
from lcp_lube.linear.krylov import Krylov, LinearSolverError, reason_name
from lcp_lube.problems.solution import Outcome


@pytest.fixture
def system():
    """`system()`: the 2n system of a small problem, with whatever options are set."""
    made = []

    def make(shape=(8,)):
        problem = make_problem(shape, Knots((2e-5, 1e-5, 3e-5)), p_sides=(1e6, 1e6, 0.0, 0.0), p_unit=1e8)
        made.append((problem, FullSystem(problem)))
        return made[-1][1]

    yield make
    for problem, full in made:
        full.destroy()
        problem.destroy()


def residual(system, D_p, D_r, f1, f2, solution):
    dp, dr, _ = solution
    problem = system.problem
    first = problem.multiply(problem.A, dp) + problem.multiply(problem.B, dr) - f1
    return np.linalg.norm(np.concatenate([first, D_p * dp + D_r * dr - f2]))


@pytest.mark.parametrize("shape", [(1,), (8,), (5, 3)])
@pytest.mark.parametrize("options", [{"ksp_type": "preonly", "pc_type": "lu"}, {"ksp_type": "gmres", "pc_type": "ilu"}])
def test_solves_the_newton_system(system, petsc_options, shape, options):
    petsc_options(**options)
    full = system(shape)
    random = np.random.default_rng(1)
    for _ in range(3):  # the values change, the pattern stays
        D_p, D_r, f1, f2 = random.uniform(0.1, 1, (4, full.problem.size))
        f1 *= 1e-4  # as large as U h
        solution = full.solve(D_p, D_r, f1, f2, rtol=1e-8)
        assert residual(full, D_p, D_r, f1, f2, solution) < 1e-5 * np.linalg.norm(np.concatenate([f1, f2]))
        assert (solution[2] == 0) == full.direct == (options["ksp_type"] == "preonly")


def test_fields_are_ordered_one_after_the_other(system, petsc_options):
    petsc_options(ksp_type="preonly", pc_type="lu")
    full = system((8,))
    np.testing.assert_array_equal(full.fields["p"].getIndices(), np.arange(8))
    np.testing.assert_array_equal(full.fields["r"].getIndices(), np.arange(8, 16))
    assert full.mat.getAttr("fields") is full.fields and full.mat.getAttr("problem") is full.problem


def test_refreshing_values_allocates_nothing(system, petsc_options):
    petsc_options(ksp_type="preonly", pc_type="lu")
    full = system((8,))
    entries = full.mat.getInfo()["nz_used"]
    for value in (1.0, 0.0, 2.0):
        full.solve(np.full(8, 1.0), np.full(8, 0.5 + value), np.ones(8), np.ones(8), 1e-8)
        info = full.mat.getInfo()
        assert info["mallocs"] == 0 and info["nz_used"] == entries


def test_rtol_is_ours_unless_the_user_sets_one(system, petsc_options):
    petsc_options(ksp_type="gmres", pc_type="ilu")
    data = np.full((4, 63), 0.5)
    loose, tight = (system((9, 7)).solve(*data, rtol=rtol)[2] for rtol in (1e-1, 1e-5))
    assert loose < tight
    petsc_options(ksp_rtol=1e-1)
    assert system((9, 7)).solve(*data, rtol=1e-5)[2] == loose


def test_iteration_limit_is_no_failure(system, petsc_options):
    """The outer loop can use what was reached; the paper's limit is 10,000."""
    petsc_options(ksp_type="gmres", pc_type="none")
    assert system().krylov.ksp.getTolerances()[3] == 10_000
    petsc_options(ksp_max_it=1)
    assert system().solve(*np.full((4, 8), 0.5), rtol=1e-12)[2] == 1


def test_a_singular_matrix_is_a_linear_solver_error(system, petsc_options):
    petsc_options(ksp_type="preonly", pc_type="lu")
    full = system()
    with pytest.raises(LinearSolverError, match=r"^KSP preonly with PC lu failed: DIVERGED_P\w+$"):
        full.solve(np.zeros(8), np.zeros(8), np.ones(8), np.ones(8), 1e-8)


def test_a_breakdown_ends_the_run_with_its_name(petsc_options):
    petsc_options(ksp_type="cg", pc_type="none")
    solution = solve(load_scene("problem1", {"n": 9}), method="din", system="full")
    assert solution.outcome is Outcome.LINEAR_SOLVER and not solution.converged
    assert "step 1: KSP cg with PC none failed: DIVERGED_INDEFINITE" in solution.message
    assert solution.settings["ksp_type"] == "cg" and solution.settings["recipe"] is None
    solution.destroy()


def test_not_finite_is_a_linear_solver_error(system, petsc_options):
    petsc_options(ksp_type="preonly", pc_type="jacobi")
    with pytest.raises(LinearSolverError):
        system().solve(*np.full((2, 8), 0.5), np.full(8, np.nan), np.ones(8), 1e-8)


def test_mumps_that_runs_out_of_workspace_gets_more(petsc_options, monkeypatch):
    """With no reserve at all pivoting soon outgrows the estimate; the run then goes on with a larger one."""
    if not PETSc.Sys.hasExternalPackage("mumps"):
        pytest.skip("this PETSc has no MUMPS")
    scene = FilmScene.of(Knots((2.5e-5, 1.5e-5, 2.5e-5)), dimension=2, nx=23, ny=17, scheme="nodal")
    plenty = solve(scene, method="din", system="full", recipe="mumps", nested=False)
    petsc_options(mat_mumps_icntl_14=1)
    helped, enlarge = [], Krylov._enlarge_mumps
    monkeypatch.setattr(Krylov, "_enlarge_mumps", lambda self: helped.append(enlarge(self)) or helped[-1])
    short = solve(scene, method="din", system="full", recipe="mumps", nested=False)
    assert plenty.converged and short.converged and short.iterations == plenty.iterations
    assert helped and all(helped)
    assert PETSc.Options().getString("mat_mumps_icntl_14") == "1"
    assert short.settings["recipe"] == "mumps but -mat_mumps_icntl_14 1"
    short.destroy()
    plenty.destroy()


@pytest.mark.parametrize(
    "options, message",
    [
        ({"ksp_type": "gmress"}, "-ksp_type gmress: no such KSP type in this PETSc; nearest is gmres"),
        ({"pc_type": "ilux"}, "-pc_type ilux: no such PC type in this PETSc; nearest is ilu"),
        ({"pc_type": "bjacobi", "sub_pc_type": "ilux"}, "-sub_pc_type ilux: no such PC type in this PETSc; nearest is ilu"),
        (
            {"pc_type": "lu", "pc_factor_mat_solver_type": "mumsp"},
            "-pc_factor_mat_solver_type mumsp: no such solver type in this PETSc; nearest is mumps",
        ),
        ({"mat_type": "dens"}, "-mat_type dens: no such Mat type in this PETSc; nearest is dense"),
        ({"ksp_norm_type": "foo"}, "-ksp_norm_type foo: allowed are none, preconditioned, unpreconditioned, natural"),
        ({"ksp_pc_side": "lefft"}, "-ksp_pc_side lefft: allowed are left, right, symmetric; nearest is left"),
        ({"ksp_rtol": "abc"}, "-ksp_rtol abc: PETSc: Input string abc has no numeric value"),
        ({"ksp_max_it": "1.5"}, "-ksp_max_it 1.5: PETSc: Input string 1.5 has no integer value"),
        ({"pc_type": "python"}, "-pc_type python: -pc_python_type MODULE.CLASS is needed too"),
        ({"pc_type": "python", "pc_python_type": "no.Such"}, "-pc_python_type no.Such: No module named 'no'"),
        ({"pc_type": "python", "pc_python_type": "lcp_lube.api.Such"}, "-pc_python_type lcp_lube.api.Such: No module"),
        ({"pc_factor_shift_type": "nonzeroo"}, "-pc_factor_shift_type nonzeroo: allowed are none, nonzero"),
    ],
)
def test_values_off_the_list(system, petsc_options, options, message):
    petsc_options(**{"ksp_type": "gmres", "pc_type": "ilu", **options})
    with pytest.raises(InputError) as caught:
        system().solve(*np.ones((4, 8)), 1e-8)
    assert str(caught.value).startswith(message) and "\n" not in str(caught.value)


def test_reason_names():
    assert reason_name(PETSc.KSP.ConvergedReason.DIVERGED_BREAKDOWN) == "DIVERGED_BREAKDOWN"
    assert reason_name(-1234) == "-1234"


def test_one_ksp_without_prefix(system, petsc_options):
    petsc_options(ksp_type="gmres", pc_type="jacobi")
    krylov = Krylov(system().mat)
    assert krylov.ksp.getOptionsPrefix() in (None, "")
    assert (krylov.ksp_type, krylov.pc_type, krylov.direct) == ("gmres", "jacobi", False)
    krylov.destroy()


CYCLE = """
import gc
gc.disable()
from petsc4py import PETSc
from lcp_lube.linear.krylov import Krylov

class Held:
    def setUp(self, pc):
        cycle = [pc]
        cycle.append(cycle)

    def apply(self, pc, x, y):
        x.copy(y)

def main():
    mat = PETSc.Mat().createAIJ((2, 2), nnz=1, comm=PETSc.COMM_SELF)
    for k in range(2):
        mat[k, k] = 1.0
    mat.assemble()
    x, b = mat.createVecs()
    krylov = Krylov(mat)
    pc = krylov.ksp.getPC()
    pc.setType("python")
    pc.setPythonContext(Held())
    krylov.solve(b, x, 1e-8)
    for thing in (krylov, mat, x, b):
        thing.destroy()

main()
"""


def test_a_cycle_that_holds_a_pc_is_no_crash(tmp_path):
    """As numba leaves them: PETSc, freeing the PC at its own end, calls a Python that is gone."""
    done = subprocess.run([sys.executable, "-c", CYCLE], cwd=tmp_path, env=ENVIRONMENT, capture_output=True, timeout=60)
    assert done.returncode == 0, done.stderr
