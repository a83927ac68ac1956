"""Public test problems of mixed complementarity by every method: natural residual, published solutions, known failures."""

import numpy as np
import pytest
from mcplib_problems import CASES, Case

from lcp_lube import Complementarity, solve
from lcp_lube.problems.solution import Solution

pytestmark = pytest.mark.rounding

RUNS = [(name, start) for name, case in CASES.items() for start in case().starts]

# Runs that one method alone does not solve, and how it says so: where rounding decides, in one of several ways. The reasons
# stand in benchmarks/README.md.
INTERIOR_FAILS = {
    ("billups", "1"): {"step_length"},
    ("kojshin", "1"): {"step_length"},
    ("kojshin", "6"): {"max_iterations"},
    ("mathiesen", "2"): {"wrong_solution", "step_length"},
}
# Singular matrices in all of them but billups and the third of kojshin, where no step decreases the residual.
ACTIVE_SET_FAILS = {
    *(("josephy", start) for start in "17"),
    *(("kojshin", start) for start in "137"),
    *((name, "1") for name in ("billups", "transport", "pies")),
    ("mathiesen", "2"),
}


def natural_residual(case: Case, x: np.ndarray) -> float:
    return float(np.max(np.abs(np.clip(case.F(x), x - case.upper, x - case.lower))))


def run(name: str, start: str, method: str, alone: bool = False) -> tuple[Case, Solution]:
    """A published problem from a published start; alone: without the method that takes over after a failure."""
    case = CASES[name]()
    problem = Complementarity(case.F, case.J, case.lower, case.upper, case.starts[start], name=name)
    solution = solve(problem, method=method, rescue=not alone, stopping={"eps1": 1e-10, "max_it": 200})
    return case, solution


@pytest.mark.parametrize(("name", "start"), RUNS)
def test_general_solver(name, start):
    """The default method solves them all, to a natural residual of 1e-10, and finds a published solution."""
    case, solution = run(name, start, "auto")
    assert solution.converged, solution.message
    assert solution.settings["method"] == "semismooth"
    x = solution.fields["v"]
    assert np.all(x >= case.lower - 1e-12) and np.all(x <= case.upper + 1e-12)
    assert natural_residual(case, x) <= 1e-10
    assert case.check(x)


@pytest.mark.parametrize(("name", "start"), RUNS)
def test_interior_alone(name, start):
    """The interior point method solves the others; what it does not solve it does not call solved."""
    case, solution = run(name, start, "interior", alone=True)
    assert str(solution.outcome) in INTERIOR_FAILS.get((name, start), {"converged"}), solution.message
    if solution.converged:
        assert natural_residual(case, solution.fields["v"]) <= 1e-7  # ||H|| <= 1e-10 leaves products, not min(x, F), that small
        assert case.check(solution.fields["v"])


@pytest.mark.parametrize(("name", "start"), RUNS)
def test_active_set_alone(name, start):
    """As the interior point method."""
    case, solution = run(name, start, "active-set", alone=True)
    assert solution.converged == ((name, start) not in ACTIVE_SET_FAILS), solution.message
    if solution.converged:
        assert natural_residual(case, solution.fields["v"]) <= 1e-9 and case.check(solution.fields["v"])


@pytest.mark.parametrize(("name", "start"), sorted({*INTERIOR_FAILS, *ACTIVE_SET_FAILS}))
@pytest.mark.parametrize("method", ["interior", "active-set"])
def test_semismooth_takes_over(method, name, start):
    """Where they fail the semismooth method takes over; a wrong solution is not noticed before the certificate."""
    case, solution = run(name, start, method)
    failures = {*INTERIOR_FAILS} if method == "interior" else ACTIVE_SET_FAILS
    took_over = "semismooth took over" in solution.message
    if method == "interior" and str(solution.outcome) == "wrong_solution":
        assert "wrong_solution" in INTERIOR_FAILS[name, start]  # it ran off to 1e15, and so far away the residual vanishes
        return
    assert took_over == ((name, start) in failures)
    assert solution.converged and natural_residual(case, solution.fields["v"]) <= (1e-10 if took_over else 1e-7)
