"""The two-field preconditioners: dense algebra, theory, the documented difficulty, one result for all, bad input."""

import numpy as np
import pytest
from mpi_preconditioners import gathered, main
from recipes import lacking

from lcp_lube import load_scene, solve
from lcp_lube.base.options import recipe
from lcp_lube.errors import InputError
from lcp_lube.linear.full import FullSystem
from lcp_lube.linear.pc.fields import TwoFields
from lcp_lube.problems.solution import Outcome, Solution
from lcp_lube.registry import read_recipe, recipe_line
from lcp_lube.solvers.newton import Stopping

SMALL = ("problem4", {"nx": 7, "ny": 6})
AUGMENTATION = {"pc_type": "python", "pc_python_type": "lcp_lube.linear.pc.augmentation.AugmentationPC"}
SADDLE = {"pc_type": "python", "pc_python_type": "lcp_lube.linear.pc.splittings.SaddlePC"}
SPLIT = {key: value for key, value in read_recipe("fieldsplit_schur").items() if not key.startswith("fieldsplit_p_pc")}
RECIPES = """augmentation augmentation_identity augmentation_amg saddle_jacobi saddle_gs saddle_approx saddle_amg
    fieldsplit_schur fieldsplit_gamg fieldsplit_schur_p""".split()  # noqa: SIM905


def iterations(options, petsc_options, sign=1.0, rtol=1e-10):
    """GMRES iterations on a Newton system with random diagonals."""
    petsc_options(**{"ksp_type": "gmres", "ksp_pc_side": "right", **options})
    rng = np.random.default_rng(3)
    problem = load_scene(*SMALL).build()
    n = problem.size
    system = FullSystem(problem)
    D_p, D_r = (sign * 10.0 ** rng.uniform(-2, 0, n) for _ in range(2))
    f1, f2 = 1e-4 * rng.standard_normal(n), rng.standard_normal(n)  # A and B have entries of 1e-4
    dp, dr, count = system.solve(D_p, D_r, f1, f2, rtol)
    np.testing.assert_allclose(D_p * dp + D_r * dr, f2, atol=1e-6 * np.abs(f2).max())
    system.destroy()
    problem.destroy()
    return count


def test_dense_algebra():
    """Every option of both preconditioners gives the inverse that its documentation names."""
    assert main() == []


def test_dense_algebra_in_parallel(script):
    """Lines and sweeps that cross ranks are solved exactly: 4 ranks are 2 by 2 of a plane, and 4 in a row of a line."""
    job = script("mpi_preconditioners.py", ranks=4, timeout=240)
    assert job.status == 0, job.out + job.err


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    "options, bound",
    [
        pytest.param({**AUGMENTATION, "pc_augmentation_form": "triangular"}, 2, id="augmentation triangular"),
        pytest.param({**AUGMENTATION, "pc_augmentation_form": "full"}, 1, id="augmentation full"),
        pytest.param({**SPLIT, "fieldsplit_p_pc_type": "lu", "pc_fieldsplit_schur_fact_type": "upper"}, 2, id="split upper"),
        pytest.param({**SPLIT, "fieldsplit_p_pc_type": "lu", "pc_fieldsplit_schur_fact_type": "full"}, 1, id="split full"),
    ],
)
def test_exact_block_preconditioners(options, bound, sign, petsc_options):
    """K (block triangular)^-1 = I + N with N^2 = 0: at most 2 GMRES iterations; with both factors 1."""
    assert 1 <= iterations(options, petsc_options, sign) <= bound


def test_the_smaller_E_the_fewer_iterations(petsc_options):
    """Jacobi against Gauss-Seidel, and an exact Schur complement against its diagonal."""
    count = {}
    for kind, schur in (("jacobi", "exact"), ("gauss_seidel", "exact"), ("jacobi", "diagonal")):
        given = {**SADDLE, "pc_saddle_splitting": kind, "pc_saddle_schur": schur, "ksp_gmres_restart": "200"}
        count[kind, schur] = iterations(given, petsc_options)
    assert count["gauss_seidel", "exact"] < count["jacobi", "exact"] < count["jacobi", "diagonal"]


def test_eigenvalues_of_the_diagonal_form():
    """W = P: those of diag(S, P)^-1 [A B; -R -P] solve (1 + g) l^2 + g l = 1 + g, g an eigenvalue of -A^-1 B P^-1 R."""
    problem = load_scene(*SMALL).build()
    rng = np.random.default_rng(5)
    R, P = (np.diag(10.0 ** rng.uniform(-2, 1, problem.size)) for _ in range(2))
    A, B = gathered(problem.A), gathered(problem.B)
    G = -B @ np.linalg.solve(P, R)
    zero = np.zeros_like(A)
    found = np.linalg.eigvals(np.linalg.solve(np.block([[A + G, zero], [zero, P]]), np.block([[A, B], [-R, -P]])))
    g = np.linalg.eigvals(np.linalg.solve(A, G)).astype(complex)
    root = np.sqrt(g**2 + 4 * (1 + g) ** 2)
    expected = np.concatenate([(-g + root), (-g - root)]) / np.tile(2 * (1 + g), 2)
    distance = np.abs(found[:, None] - expected[None, :])
    assert distance.min(axis=0).max() < 1e-6 and distance.min(axis=1).max() < 1e-6
    assert np.abs(expected).min() > 0.6 and np.abs(expected).max() < 1.7
    problem.destroy()


def run(scene: str, recipe_name: str | None, method: str = "din", eps: float = 1e-8, **changes: int) -> Solution:
    solution = solve(
        load_scene(scene, changes),
        method=method,
        system="full",
        recipe=recipe_name,
        stopping=Stopping(eps, eps, 100),
        nested=False,
    )
    solution.destroy()
    return solution


@pytest.mark.parametrize("name", RECIPES)
@pytest.mark.parametrize("scene, changes", [("problem1", {"n": 40}), ("problem4", {"nx": 17, "ny": 13})], ids=["line", "plane"])
def test_the_result_does_not_depend_on_the_preconditioner(name, scene, changes):
    if package := lacking(name):
        pytest.skip(f"this PETSc has no {package}")
    direct, other = run(scene, "umfpack", **changes), run(scene, name, **changes)
    assert other.converged, other.message
    np.testing.assert_allclose(other.fields["p"], direct.fields["p"], atol=1e-7 * direct.fields["p"].max())
    np.testing.assert_allclose(other.fields["r"], direct.fields["r"], atol=1e-6)


@pytest.mark.hypre
@pytest.mark.parametrize("method", ["din", "fbn-a", "fbn-i"])
def test_full_augmentation_with_multigrid_suits_every_method(method):
    """Also where a diagonal is exactly 0, as in Fischer-Burmeister systems; a handful of iterations a step."""
    solution = run("problem4", "augmentation_amg", method, nx=31, ny=23)
    assert solution.converged, solution.message
    assert solution.total("linear_iterations") <= 4 * solution.iterations


@pytest.mark.hypre
def test_multigrid_counts_do_not_grow_with_the_grid():
    def count(n: int) -> float:
        solution = run("problem4", "fieldsplit_schur", eps=1e-4, n=n)
        assert solution.converged, solution.message
        return solution.total("linear_iterations") / solution.iterations

    assert count(64) < 1.5 * count(32) < 6


class TestDocumentedDifficulty:
    """Augmentation with W = P divides by pressures that vanish; W = I does not, but its iterations grow."""

    def test_entries_and_their_remedy(self, petsc_options):
        """At DIN's answer the columns of S = A - B P^-1 R grow as r/p, to 1e15 times A and more; scaled ones do not."""
        solution = run("problem1", "umfpack", n=100)
        problem = load_scene("problem1", {"n": 100}).build()
        with recipe("umfpack"):
            system = FullSystem(problem)
            zero = np.zeros(100)
            system.solve(solution.fields["r"], solution.fields["p"], zero, zero, 1e-8)
        fields = FakePC(system).fields
        A, B, R, P = gathered(fields.A), gathered(fields.B), fields.R, fields.P
        largest = np.abs(A).max()
        assert np.abs(A - B * (R / P)).max() > 1e15 * largest
        assert np.abs(A * (P / (P + R)) - B * (R / (P + R))).max() < 10 * largest
        assert np.abs(A - B * R).max() < 10 * largest
        fields.destroy()
        system.destroy()
        problem.destroy()

    def test_identity_needs_more_and_more_iterations(self):
        """A step, W = P: at most 2 or little more at every n. W = I: it grows with n."""

        def count(name: str, n: int) -> float:
            solution = run("problem1", name, eps=1e-4, n=n)
            return solution.total("linear_iterations") / solution.iterations

        assert max(count("augmentation", n) for n in (20, 40, 80)) < 5
        assert 10 < count("augmentation_identity", 20) < count("augmentation_identity", 40) < count("augmentation_identity", 80)

    def test_a_zero_weight_is_reported(self):
        """In Fischer-Burmeister systems the derivative that takes P's place underflows to 0."""
        solution = run("problem1", "augmentation", "fbn-a", n=50)
        assert solution.outcome is Outcome.LINEAR_SOLVER
        assert "smallest entry of the weight 0, not positive" in solution.message


class FakePC:
    """Gives TwoFields what it asks of a python PC."""

    def __init__(self, system: FullSystem):
        self._mat = system.mat
        self.fields = TwoFields(self)

    def getOperators(self):
        return self._mat, self._mat

    def getPythonType(self):
        return "a test"


@pytest.mark.hypre
def test_multiplicative_split_fails_and_says_so():
    """BoomerAMG on A, Jacobi on P: P vanishes in the cavity. The recipe's first line says so, and the outcome does."""
    assert "fails" in recipe_line("fieldsplit_multiplicative")
    solution = run("problem1", "fieldsplit_multiplicative", n=21)
    assert solution.outcome is Outcome.LINEAR_SOLVER


AUG, SAD = AUGMENTATION, SADDLE


@pytest.mark.parametrize(
    "options, expected",
    [
        (
            {**SAD, "pc_saddle_splitting": "jakobi"},
            "-pc_saddle_splitting jakobi: allowed are jacobi, gauss_seidel, none; nearest",
        ),
        ({**SAD, "pc_saddle_splitting": "none", "pc_saddle_schur": "exact"}, "-pc_saddle_schur exact: allowed are lines, diag"),
        ({**AUG, "pc_augmentation_weight": "0"}, "-pc_augmentation_weight 0: allowed are p, identity and positive numbers"),
        ({**AUG, "pc_augmentation_weight": "-1e-3"}, "-pc_augmentation_weight -1e-3: allowed are"),
        ({**AUG, "pc_augmentation_weight": "inf"}, "-pc_augmentation_weight inf: allowed are"),
        ({**AUG, "pc_augmentation_weight": "identiy"}, "positive numbers; nearest is identity"),
        ({**AUG, "pc_augmentation_floor": "nan"}, "-pc_augmentation_floor nan: allowed are positive numbers"),
        ({**AUG, "pc_augmentation_form": "full", "pc_augmentation_weight": "2"}, "-pc_augmentation_form full: only with"),
        ({**AUG, "augmentation_pc_type": "amg"}, "-augmentation_pc_type amg: no such PC type"),
        ({**AUG, "system": "reduced"}, "it needs a matrix of the two fields p and r"),
        ({**SAD, "mat_type": "dense"}, "it needs a matrix of the two fields p and r"),
        (
            {**SAD, "pc_python_type": "lcp_lube.linear.pc.splittings.SadlePC"},
            "-pc_python_type lcp_lube.linear.pc.splittings.SadlePC: ",
        ),
        ({"pc_type": "fieldsplit", "system": "reduced"}, "-pc_type fieldsplit: it needs a matrix of two fields"),
        ({"pc_type": "fieldsplit", "fieldsplit_order": "r,q"}, "-fieldsplit_order r,q: allowed are p,r in any order"),
    ],
)
def test_bad_input(options, expected, petsc_options):
    system = options.get("system", "full")
    petsc_options(ksp_type="gmres", **{name: value for name, value in options.items() if name != "system"})
    with pytest.raises(InputError) as error:
        solve(load_scene("problem1", {"n": 20}), method="din", system=system, nested=False)
    assert expected in str(error.value)
    assert "\n" not in str(error.value)


FULL = ("solve", "problem1", "--n=20", "--method=din", "--system=full", "--no-nested")
PYTHON = ("-ksp_type", "gmres", "-pc_type", "python", "-pc_python_type")


@pytest.mark.parametrize(
    "words, expected",
    [
        (
            ("splittings.SaddlePC", "-pc_saddle_spliting", "jacobi"),
            "-pc_saddle_spliting: no solver in this run reads this option",
        ),
        (("augmentation.AugmentationPC", "-pc_augmentation_weight", "0"), "-pc_augmentation_weight 0: allowed are"),
    ],
)
def test_bad_input_is_one_line_and_status_2(cli, words, expected):
    job = cli(*FULL, *PYTHON, f"lcp_lube.linear.pc.{words[0]}", *words[1:])
    assert job.status == 2
    assert len(job.lines) == 1 and expected in job.lines[0]


def test_a_run_with_a_python_pc_ends_cleanly(cli):
    job = cli(*FULL, "--recipe=saddle_gs", "--json")
    assert (job.status, job.lines) == (0, [])
    assert job.json["pc_type"] == "python"
