"""Bratu and Poisson with a cubic term: known values, the turning point, order, Newton's climb, the command line."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from lcp_lube.api import solve
from lcp_lube.base.stages import Stages
from lcp_lube.errors import InputError
from lcp_lube.problems.solution import Outcome
from lcp_lube.scenes.scene import load_scene
from lcp_lube.solvers.job import Job
from lcp_lube.solvers.newton import Stopping
from lcp_lube.solvers.plain_newton import PlainNewton

# lambda, max v, h^2 sum v on the lower branch, 64 interior points a side (computed by another code)
LOWER_BRANCH = [(1, 0.07805522, 0.03696526), (4, 0.39529769, 0.18180085), (6, 0.79667635, 0.35275905)]
TURNING_POINT_32 = 6.80674
INNER = {"direct": {}, "cg": {"ksp_type": "cg", "pc_type": "jacobi"}, "bcgs": {"ksp_type": "bcgs", "pc_type": "jacobi"}}


def run(name, changes=None, **arguments):
    solution = solve(load_scene(name, changes or {}), **arguments)
    quantities = solution.problem.quantities(solution.fields)
    solution.destroy()
    return solution, quantities


@pytest.mark.parametrize(("lam", "max_v", "sum_v"), LOWER_BRANCH)
def test_lower_branch(lam, max_v, sum_v):
    solution, found = run("bratu", {"lambda": lam})
    assert solution.converged
    assert found["max_v"] == pytest.approx(max_v, abs=6e-9)
    assert found["sum_v"] == pytest.approx(sum_v, abs=6e-9)


@pytest.mark.parametrize("inner", INNER)
def test_turning_point_to_five_digits(petsc_options, inner):
    """Both sides of the discrete turning point; the outcome beyond it says what is wrong."""
    petsc_options(**INNER[inner])
    below, _ = run("bratu", {"n": 32, "lambda": TURNING_POINT_32 - 1e-4})
    assert below.converged, below.message
    beyond, _ = run("bratu", {"n": 32, "lambda": TURNING_POINT_32 + 1e-4})
    assert beyond.outcome is Outcome.NO_SOLUTION
    assert "turning point" in beyond.message and "6.80684" in beyond.message


@settings(max_examples=25, deadline=None)
@given(lam=st.floats(-20.0, 1000.0), n=st.integers(3, 17))
def test_solution_exists_up_to_the_turning_point(lam, n):
    """The discrete turning point lies between 6.5 (coarse grids) and 6.81."""
    assume(not 6.5 < lam < 6.81)
    solution, found = run("bratu", {"n": n, "lambda": lam})
    assert solution.outcome is (Outcome.CONVERGED if lam < 6.6 else Outcome.NO_SOLUTION), solution.message
    assert solution.iterations < 20 and (lam > 0 or found["max_v"] <= 0)


def test_newton_climbs():
    """v_k rises, f(v_k) <= 0 and f' stays an M-matrix: what the proof of no_solution stands on."""
    problem = load_scene("bratu", {"n": 20, "lambda": 6.7}).build()
    newton = PlainNewton(Job(problem, Stages(), options={"eta": 1e-12}))
    for _ in range(6):
        before = newton.v
        newton.advance()
        assert (newton.v >= before - 1e-12).all()
        assert newton.f.max() <= 1e-12
        assert problem.jacobian_diagonal(newton.v).min() < 4
    newton.destroy()
    problem.destroy()


def test_two_solutions():
    """From v0 = 2 Newton reaches the upper branch: both answers are certified."""
    lower, low = run("bratu", {"n": 32, "lambda": 4.0})
    upper, high = run("bratu", {"n": 32, "lambda": 4.0, "v0": 2.0})
    assert lower.converged and upper.converged
    assert high["max_v"] > 3.0 > low["max_v"]


def test_start_above_claims_nothing():
    """From v0 > 0 the climb proves nothing: whatever happens is not reported as 'no solution'."""
    solution, _ = run("bratu", {"n": 16, "lambda": 7.0, "v0": 1.0}, stopping=Stopping(max_it=30))
    assert solution.outcome not in (Outcome.NO_SOLUTION, Outcome.CONVERGED)


@settings(max_examples=20, deadline=None)
@given(
    nx=st.integers(1, 24),
    ny=st.integers(1, 24),
    lam=st.floats(0.0, 100.0),
    peak=st.floats(-5.0, 5.0),
)
def test_cubic_is_exact_on_every_grid(nx, ny, lam, peak):
    """The five-point formula is exact for the known solution, so only rounding is left."""
    solution, found = run("manufactured_cubic", {"nx": nx, "ny": ny, "lambda": lam, "peak": peak})
    assert solution.converged
    assert found["max_error"] <= 1e-11 * max(1.0, abs(peak))


class TestOrder:
    """v at the centre of the square, on grids that share it."""

    expected = 2.0
    ceiling = 2e-4

    def test_centre(self):
        values = [run("bratu", {"n": n, "lambda": 6.0})[1]["max_v"] for n in (15, 31, 63, 127)]
        changes = np.abs(np.diff(values))
        slopes = np.polyfit(np.log([16, 32, 64]), np.log(changes), 1)
        assert -slopes[0] == pytest.approx(self.expected, abs=0.05)
        assert changes[-1] < self.ceiling


def test_equation_9_as_printed():
    """-Lap u - u^3/(1 + x^2 + y^2): 1 + x y is harmonic, also on the grid, and leaves the cubic term alone."""
    problem = load_scene("poisson_cubic", {"nx": 7, "ny": 5, "boundary": "1 + x*y"}).build()
    x, y = (a.ravel() for a in np.broadcast_arrays(problem.grid.x, problem.grid.y))
    u = 1.0 + x * y
    np.testing.assert_allclose(problem.residual(u), -problem.grid.cell * u**3 / (1.0 + x**2 + y**2), atol=1e-14)
    slope = (problem.residual(u + 1e-6) - problem.residual(u - 1e-6)) / 2e-6
    constant = problem.residual(u + 1.0) - problem.residual(u)  # of A alone, and of the cubic term
    linear = constant + problem.grid.cell * ((u + 1.0) ** 3 - u**3) / (1.0 + x**2 + y**2)
    expected = linear - problem.grid.cell * 3.0 * u**2 / (1.0 + x**2 + y**2)
    np.testing.assert_allclose(slope, expected, atol=1e-8)
    np.testing.assert_allclose(problem.jacobian_diagonal(u), problem.diagonal - linear + expected, atol=1e-12)
    problem.destroy()


@pytest.mark.parametrize("boundary", [1e-5, 1e-3, 0.1, 1.0, 2.0, "x", "1 + x + y", "sin(pi*x)"])
def test_equation_9_is_solved_for_small_values_on_the_boundary(boundary):
    """u >= the harmonic function with its values; of tiny values rounding is all that the cubic term can be told from."""
    solution, found = run("poisson_cubic", {"n": 20, "boundary": boundary})
    assert solution.converged, solution.message
    assert found["max_v"] > 0


def test_equation_9_on_finer_grids():
    """Second order at the centre of the square."""
    fields = [run("poisson_cubic", {"n": n})[0].fields["v"] for n in (7, 15, 31, 63)]
    changes = np.abs(np.diff([v[v.size // 2] for v in fields]))
    assert changes[:-1] / changes[1:] == pytest.approx(4.0, rel=0.1)


def test_equation_9_has_no_solution_for_large_values():
    """Newton climbs past every u >= 0; from below zero, and with negative values, nothing is claimed."""
    assert run("poisson_cubic", {"n": 20, "boundary": 4.0})[0].outcome is Outcome.NO_SOLUTION
    for changes in ({"boundary": -4.0}, {"boundary": 4.0, "v0": -1.0}, {"boundary": "4 - 9*x"}):
        solution, _ = run("poisson_cubic", {"n": 20, **changes}, stopping=Stopping(max_it=20))
        assert solution.outcome is not Outcome.NO_SOLUTION


def test_the_certificate_sees_a_missing_cubic_term():
    """The harmonic function with the same values: nearly right where they are small, refused all the same."""
    for value in (1e-2, 0.3, 1.0):
        problem = load_scene("poisson_cubic", {"n": 20, "boundary": value}).build()
        constant = {"v": np.full(problem.grid.local_size, value)}
        assert problem.certify(constant, 1e-8).measures["balance"] > 0.5
        problem.destroy()


@pytest.mark.parametrize(("relative", "steps"), [(0.0, 4), (1e-2, 2), (1e-4, 3)])
def test_relative_stop(relative, steps):
    """The run ends with the first step whose ||f|| is small enough against that of the start."""
    solution, _ = run("bratu", {"lambda": 6.0, "n": 20}, options={"relative": relative})
    problem = load_scene("bratu", {"lambda": 6.0, "n": 20}).build()
    start = np.linalg.norm(problem.residual(np.zeros(400)))
    problem.destroy()
    reached = [step.norm / start <= relative for step in solution.steps]
    assert not any(reached[:-1]) and reached[-1] == (relative > 0)
    assert solution.iterations >= steps


def test_strong_cubic_needs_damping():
    """f is not order-concave there: the decrease of ||f|| is what brings it home."""
    solution, found = run("manufactured_cubic", {"n": 31, "lambda": 1e4, "peak": 5.0})
    assert solution.converged and solution.total("backtracking") > 0
    assert found["max_error"] < 1e-10


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6), size=st.floats(1e-3, 10.0))
def test_certificate_refuses_other_fields(seed, size):
    problem = load_scene("bratu", {"nx": 9, "ny": 7}).build()
    wrong = {"v": size * np.random.default_rng(seed).random(problem.grid.local_size)}
    assert not problem.certify(wrong, 1e-8).holds
    problem.destroy()


def test_balance_alone_sees_a_lost_source():
    """Half the answer satisfies neither the equations nor Gauss's theorem."""
    solution, _ = run("bratu", {"n": 16})
    problem = load_scene("bratu", {"n": 16}).build()
    assert problem.certify(solution.fields, 1e-8).measures["balance"] < 1e-12
    assert problem.certify({"v": solution.fields["v"] / 2}, 1e-8).measures["balance"] > 0.4
    problem.destroy()


@pytest.mark.parametrize("options", [{"eta": 0.0}, {"eta": "x"}, {"p0": 1.0}, {"beta": 1.0}, {"relative": -1.0}])
def test_bad_method_options(options):
    with pytest.raises(InputError, match=r"newton\."):
        run("bratu", {"n": 4}, options=options)


@pytest.mark.parametrize("ranks", [1, 2, 3])
def test_command_line(cli, ranks):
    """The same values on every number of ranks, none of which divides the sizes."""
    done = cli("solve", "bratu", "--nx", 37, "--ny", 23, "--set", "lambda=6", "--json", "-ksp_type", "cg", ranks=ranks)
    assert done.status == 0, done.err
    data = done.json
    _, found = run("bratu", {"nx": 37, "ny": 23, "lambda": 6})
    assert data["converged"] and data["ranks"] == ranks and data["unknowns"] == 37 * 23
    assert data["max_v"] == pytest.approx(found["max_v"], rel=1e-9)
    assert data["sum_v"] == pytest.approx(found["sum_v"], rel=1e-9)
    assert data["residual"] <= data["certificate_tol"] and data["balance"] <= data["certificate_tol"]


@pytest.mark.parametrize("ranks", [1, 2])
def test_command_line_beyond_the_turning_point(cli, ranks):
    done = cli("solve", "bratu", "--set", "lambda=7", "--n", 21, "--json", ranks=ranks)
    assert done.status == 1
    assert done.json["outcome"] == "no_solution" and "turning point" in done.json["message"]


@pytest.mark.parametrize(("name", "changes", "named"), [
    ("bratu", {"n": 0}, "n = 0"),
    ("bratu", {"nx": -3}, "nx = -3"),
    ("bratu", {"lamda": 2.0}, "unknown key lamda"),
    ("bratu", {"lambda": np.inf}, "lambda = inf"),
    ("manufactured_cubic", {"lambda": -1.0}, "lambda = -1"),
    ("poisson_cubic", {"boundary": "1 +"}, "boundary"),
    ("poisson_cubic", {"lambda": 1.0}, "unknown key lambda"),
])  # fmt: skip
def test_bad_scene(name, changes, named):
    with pytest.raises(InputError, match=named):
        load_scene(name, changes)


def test_other_methods_refuse(cli):
    done = cli("solve", "bratu", "--method", "din")
    assert done.status == 2 and len(done.lines) == 1 and "newton" in done.err
