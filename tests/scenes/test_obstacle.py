"""Obstacle scenes: reference values, exact solution, branches, turning point, certificate, bad input."""

import numpy as np
import pytest
from box_problems import BOTH, obstacle
from hypothesis import given, settings
from hypothesis import strategies as st

from lcp_lube.api import solve
from lcp_lube.errors import InputError
from lcp_lube.problems.solution import Outcome
from lcp_lube.scenes.scene import load_scene


@pytest.mark.parametrize("method", ["active-set", "interior"])
@pytest.mark.parametrize(
    "lam, max_v, sum_v", [(1, 0.07805522, 0.03696526), (4, 0.39529769, 0.18180085), (6, 0.79667635, 0.35275905)]
)
def test_lower_branch(method, lam, max_v, sum_v):
    """Values of an independent solver at N = 64, from v0 = 0.01."""
    solution = obstacle({"n": 64, "lambda": lam, "v0": 0.01}, method=method, stopping={"eps1": 1e-10})
    found = solution.problem.quantities(solution.fields)
    assert solution.converged
    assert found["max_v"] == pytest.approx(max_v, abs=1.1e-8)
    assert found["sum_v"] == pytest.approx(sum_v, abs=1.1e-8)
    assert found["contact_lower"] == found["contact_upper"] == 0
    solution.destroy()


@pytest.mark.parametrize("n, turning_point", [(32, 6.80674), (64, 6.80777), (128, 6.80803)])
def test_turning_point(n, turning_point):
    """The reference values; just below them there is a solution."""
    problem = load_scene("obstacle_bratu", {"n": n}).build()
    assert problem.turning_point == pytest.approx(turning_point, abs=1.1e-5)
    problem.destroy()
    if n == 64:
        solution = obstacle({"n": n, "lambda": turning_point - 1e-4})
        assert solution.converged and 1.2 < solution.problem.quantities(solution.fields)["max_v"] < 1.5
        solution.destroy()


def test_turning_point_of_other_squares():
    """lambda L^2 is what counts; of a rectangle or with v < 0 on the boundary nothing is known."""
    small = load_scene("obstacle_bratu", {"n": 9, "x": [0, 0.5], "y": [2, 2.5]}).build()
    unit = load_scene("obstacle_bratu", {"n": 9}).build()
    assert small.turning_point == pytest.approx(4 * unit.turning_point, rel=1e-12)
    for unknown in ({"x": [0, 2]}, {"boundary": "-x"}):
        problem = load_scene("obstacle_bratu", {"n": 9, **unknown}).build()
        assert problem.turning_point is None
        problem.destroy()
    small.destroy()
    unit.destroy()


def test_branches():
    """One lambda, three solutions: the start decides."""
    reached = []
    for v0 in (0.01, 2, 4):
        solution = obstacle({"n": 32, "lambda": 6, "v0": v0})
        assert solution.converged
        reached.append(solution.problem.quantities(solution.fields)["max_v"])
        solution.destroy()
    assert reached == pytest.approx([0.7954318, 2.2323399, 4.0], abs=1e-6)


def test_beyond_the_turning_point():
    """In contact with v_upper from a start there, which is the default; else the outcome says what is the matter."""
    solution = obstacle({"n": 64, "lambda": 10})
    found = solution.problem.quantities(solution.fields)
    assert solution.converged and found["contact_upper"] == 1828 and found["max_v"] == 4
    flowed = obstacle({"n": 64, "lambda": 10, "v0": 1})
    np.testing.assert_allclose(flowed.fields["v"], solution.fields["v"], atol=1e-8)
    flowed.destroy()
    fails = obstacle({"n": 64, "lambda": 10, "v0": 1}, method="interior")
    assert fails.outcome is Outcome.STEP_LENGTH
    assert "lambda = 10 lies beyond the turning point 6.8" in fails.message and "v0" in fails.message
    for each in (solution, fails):
        each.destroy()
    none = obstacle({"n": 64, "lambda": 6.9, "v_upper": np.inf})
    assert none.outcome is Outcome.NO_SOLUTION and "there is no solution" in none.message
    none.destroy()


def test_overflow_is_an_outcome():
    solution = obstacle({"n": 16, "v_upper": 1e6, "v0": 1e5})
    assert solution.outcome is Outcome.NOT_FINITE
    solution.destroy()


class TestBall:
    """Membrane over a ball (PETSc's snes tutorial ex9): contact radius 0.697965148223374, u = -A log r + B outside."""

    RADIUS, A, B = 0.697965148223374, 0.680259411891719, 0.471519893402112
    expected_rate = 1.0

    def exact(self, x, y):
        r = np.hypot(x, y)
        inside = np.sqrt(np.maximum(1 - r**2, 0))
        return np.where(r < self.RADIUS, inside, -self.A * np.log(np.maximum(r, self.RADIUS)) + self.B)

    def test_order(self):
        sizes, errors, radii = [19, 39, 79, 159], [], []
        for n in sizes:
            solution = solve(load_scene("obstacle_ball", {"n": n}))
            assert solution.converged
            grid = solution.problem.grid
            errors.append(np.abs(solution.fields["v"] - self.exact(grid.x, grid.y).ravel()).max())
            contact = solution.problem.quantities(solution.fields)["contact_lower"]
            radii.append(np.sqrt(contact * grid.cell / np.pi))
            solution.destroy()
        rate = -np.polyfit(np.log(sizes), np.log(errors), 1)[0]
        assert rate > self.expected_rate and errors[-1] < 1e-3
        assert radii[-1] == pytest.approx(self.RADIUS, abs=0.01)


@settings(max_examples=15, deadline=None)
@given(
    lam=st.floats(0, 5),
    more=st.floats(0, 1.5),
    bump=st.floats(0, 0.3),
    level=st.floats(0, 0.4),
    n=st.integers(3, 14),
)
def test_v_grows_with_lambda_and_with_the_lower_obstacle(lam, more, bump, level, n):
    """Comparison principle on the lower branch."""
    cases = ({"lambda": lam}, {"lambda": lam + more, "v_lower": f"{level} + {bump} - (x - 0.4)^2 - y^2"})
    low, high = (
        obstacle({"n": n, "v_lower": f"{level} - (x - 0.4)^2 - y^2", "v0": 0, "v_upper": 0.9, **case}) for case in cases
    )
    assert low.converged and high.converged
    assert (high.fields["v"] >= low.fields["v"] - 1e-7).all()
    low.destroy()
    high.destroy()


@pytest.mark.parametrize("factor", [0.0, 0.9, 1.02])
def test_certificate_sees_wrong_answers_on_any_grid(factor):
    """v = 0 has f = -lambda h^2 only: small, and yet no solution. Neither is what an inner solver left 2 % off."""
    for n in (16, 256):
        problem = load_scene("obstacle_bratu", {**BOTH, "n": n}).build()
        x, y = problem.grid.x, problem.grid.y
        near = np.clip((5 * x * (1 - x) * y * (1 - y)).ravel(), problem.lower, problem.upper)
        certificate = problem.certify({"v": np.clip(factor * near, problem.lower, problem.upper)}, 1e-8)
        assert not certificate.holds
        problem.destroy()
    solution = obstacle({**BOTH, "n": 64})
    v = factor * solution.fields["v"]
    certificate = solution.problem.certify({"v": v}, 8e-8)
    assert not certificate.holds and "residual" in certificate.failure
    solution.destroy()


def test_certificate_of_a_violated_bound():
    solution = obstacle({**BOTH, "n": 31})
    v = solution.fields["v"].copy()
    v[np.argmax(v)] += 0.01
    certificate = solution.problem.certify({"v": v}, 1e-8)
    assert certificate.measures["bound_violation"] == pytest.approx(0.01 / 0.31)
    assert "bound_violation" in certificate.failure
    solution.destroy()


@pytest.mark.parametrize(
    "changes, said",
    [
        ({"v_lower": 5}, "infeasible box: v_lower > v_upper at 256 of 256 points, by up to 1;"),
        ({"v_lower": "x", "v_upper": 0.5}, "infeasible box: v_lower > v_upper at 128 of 256"),
        ({"v_lower": "log(x - 0.5)"}, "v_lower: no number"),
        ({"v_upper": "-inf"}, "v_upper: no number"),
        ({"v0": "0/0*x"}, "v0: no finite value"),
        ({"boundary": "1/x"}, "boundary: no finite value"),
        ({"n": 0}, "n = 0: allowed is greater than or equal to 1"),
        ({"nx": -1}, "nx = -1: allowed is greater than or equal to 1"),
        ({"lambda": "six"}, "lambda = six"),
        ({"lamda": 6}, "unknown key lamda; nearest is lambda"),
        ({"v_upper": "10(x)"}, "v_upper = 10[(]x[)]: formula '10[(]x[)]': a [*] is missing after 10"),
        ({"v_upper": np.nan}, "v_upper = nan"),
        ({"v_upper": True}, "v_upper = True"),
        ({"x": [1, 0]}, "start < end"),
    ],
)
def test_bad_input_in_one_line(changes, said):
    with pytest.raises(InputError, match=said) as error:
        load_scene("obstacle_bratu", {"n": 16, **changes}).build()
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("n", [1, 2, 3])
def test_smallest_grids(n):
    for method in ("active-set", "interior"):
        solution = obstacle({"n": n, "lambda": 4}, method=method)
        assert solution.converged
        solution.destroy()


def test_obstacles_may_meet_and_cross_between_the_points():
    """Equal at some points; crossing on a coarser grid's points only, which nested iteration has to bear."""
    meeting = obstacle({"n": 15, "v_lower": "0.1 if x < 0.5 else 0", "v_upper": 0.1})
    v = meeting.fields["v"].reshape(15, 15)
    assert meeting.converged and (v[:, :7] == 0.1).all() and (v[:, 7:] <= 0.1).all()
    meeting.destroy()
    # A spike through the upper obstacle at (1/2, 1/2), a point of the 49 x 49 grid and not of 100 x 100.
    spike = obstacle({"n": 100, "v_lower": "5 if hypot(x - 0.5, y - 0.5) < 1e-3 else 0", "v_upper": 0.2}, nested=True)
    assert spike.converged and spike.levels[0]["nx"] == 24
    spike.destroy()


def test_command_line(cli):
    words = ["solve", "obstacle_bratu", "--n", "64", "--set", "lambda=6"]
    run = cli(*words, "--json", "--monitor")
    data = run.json
    assert run.status == 0 and data["converged"] and len(run.lines) == data["iterations"]
    assert data["unknowns"] == 4096 and data["method"] == "active-set"
    assert data["max_v"] == pytest.approx(0.79667635, abs=1e-8)
    assert {"sum_v", "contact_lower", "contact_upper", "residual", "bound_violation", "natural_residual"} <= set(data)
    assert data["certificate_tol"] == pytest.approx(1e-4)
    interior = cli(*words, "--method", "interior", "--set", "v0=0.01", "--json").json
    assert interior["converged"] and interior["certificate_tol"] == pytest.approx(8e-8**0.5)
    fails = cli("solve", "obstacle_bratu", "--set", "lambda=10", "--set", "v0=1", "--method", "interior")
    assert fails.status == 1 and "step_length" in fails.out and "beyond the turning point" in fails.out
    bad = cli("solve", "obstacle_bratu", "--set", "v_lower=5", ranks=2)
    assert bad.status == 2 and len(bad.lines) == 1 and "infeasible box" in bad.lines[0]
