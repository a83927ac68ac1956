"""Parameters that no printed count depends on: largest forcing terms, the Armijo slope of inexact steps, default tolerances."""

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from lcp_lube import load_scene, solve
from lcp_lube.base.options import recipe
from lcp_lube.base.parallel import Array, Reduce
from lcp_lube.base.stages import Stages
from lcp_lube.problems.solution import Step
from lcp_lube.registry import METHODS
from lcp_lube.solvers.din import DIN, DinOptions
from lcp_lube.solvers.fischer import ArmijoNewton, FischerOptions, derivatives
from lcp_lube.solvers.interior import InteriorOptions
from lcp_lube.solvers.job import Job
from lcp_lube.solvers.newton import Stopping
from lcp_lube.solvers.plain_newton import NewtonOptions
from lcp_lube.solvers.steplength import Centrality, inexact_decrease


def steps(scene: str, method: str, recipe_name: str, system: str = "full", max_it: int = 3, **options: Any) -> list[Step]:
    """The first steps of a run."""
    solution = solve(
        load_scene(scene, {"n": 20}),
        method=method,
        system=system,
        recipe=recipe_name,
        stopping=Stopping(max_it=max_it),
        options=options,
        nested=False,
    )
    solution.destroy()
    return solution.steps


@pytest.mark.parametrize("sigma_max", [0.9, 0.3])
def test_sigma_of_din(sigma_max: float) -> None:
    """sigma = min(sigma_max, 0.01 ||F||), 0.9 the default: from a start of large ||F|| down to one of small ||F||."""
    options: dict[str, Any] = {} if sigma_max == 0.9 else {"sigma_max": sigma_max}
    record = steps("problem1", "din", "lu", max_it=60, p0=100.0, r0=1.0, **options)
    first, *later = record
    assert first.sigma == sigma_max  # ||F|| of the start is above 440 = 100 sqrt(20)
    expected = [min(sigma_max, 0.01 * step.norm) for step in record[:-1]]
    assert [step.sigma for step in later] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("sigma_max", [0.2, 0.05])
def test_sigma_of_the_interior_point_method(sigma_max: float) -> None:
    """sigma = min(sigma_max, mu), mu = 2 at the start v = z = 1 with slacks 1 and 3."""
    assert InteriorOptions().sigma_max == 0.2
    options: dict[str, Any] = {} if sigma_max == 0.2 else {"sigma_max": sigma_max}
    record = steps("obstacle_bratu", "interior", "umfpack", "jacobian", max_it=40, **options)
    assert record[0].sigma == sigma_max
    assert 0 < record[-1].sigma < 1e-3 * sigma_max


@pytest.mark.parametrize("delta_max", [0.1, 0.02])
@pytest.mark.parametrize("method", ["fbn-a", "fbn-i"])
def test_delta_of_fbn(method: str, delta_max: float) -> None:
    """Inner solves to max(tol_min, min(delta_max, 0.01 ||F~||)), delta_max = 0.1 by default."""
    options: dict[str, Any] = {} if delta_max == 0.1 else {"delta_max": delta_max}
    record = steps("problem1", method, "gmres_ilu", max_it=40, p0=-100.0, **options)
    assert record[0].rtol == delta_max  # ||F~|| of the start is above 890 = 200 sqrt(20)
    expected = [max(1e-8, min(delta_max, 0.01 * step.norm)) for step in record[:-1]]
    assert [step.rtol for step in record[1:]] == pytest.approx(expected, rel=1e-12)


def test_the_armijo_slope_is_that_of_an_inexact_step() -> None:
    """F~ . F~' d by differences of ||F~||^2 / 2; -2 Phi, its value for an exact step, is far off."""
    problem = load_scene("problem1", {"n": 20}).build()
    with recipe("gmres_ilu"):
        method = ArmijoNewton(Job(problem, Stages(), "full"))
        assert not method.system.direct
        rng = np.random.default_rng(1)
        method.p, method.r = rng.uniform(0.5, 2.0, 20), rng.uniform(0.1, 0.9, 20)
        method.F1, method.F2 = problem.flow(method.p, method.r), np.hypot(method.p, method.r) - method.p - method.r
        method.norm = float(np.hypot(np.linalg.norm(method.F1), np.linalg.norm(method.F2)))
        dp, dr = rng.standard_normal(20), rng.standard_normal(20)

        def merit(t: float) -> float:
            p, r = method.p + t * dp, method.r + t * dr
            F: Array = np.concatenate([problem.flow(p, r), np.hypot(p, r) - p - r])
            return 0.5 * float(F @ F)

        D_p, D_r = derivatives(method.p, method.r)
        change = np.asarray(D_p * dp + D_r * dr, dtype=float)
        slope = method._slope(dp, dr, change)
        assert slope == pytest.approx((merit(1e-5) - merit(-1e-5)) / 2e-5, rel=1e-6)
        assert abs(slope + 2.0 * merit(0.0)) > 0.1 * abs(slope)
    method.destroy()
    problem.destroy()


@pytest.mark.parametrize("inner", ["relative", "residual"])
def test_inner_residuals_of_din(inner: str, petsc_options: Any) -> None:
    """'residual' keeps ||F' d + F - sigma mu e|| <= delta_k ||F|| in every step; 'relative' breaks that here."""
    petsc_options(ksp_pc_side="right")
    problem = load_scene("problem1", {"n": 100}).build()
    with recipe("gmres_ilu"):
        method = DIN(Job(problem, Stages(), "full", {"inner": inner, "tol_min": 1e-4}))
        solve_step, found = method.system.solve, []

        def watched(D1: Array, D2: Array, f1: Array, f2: Array, rtol: float) -> tuple[Array, Array, int]:
            dp, dr, iterations = solve_step(D1, D2, f1, f2, rtol)
            first = problem.multiply(problem.A, dp) + problem.multiply(problem.B, dr) - f1
            found.append(np.hypot(np.linalg.norm(first), np.linalg.norm(D1 * dp + D2 * dr - f2)))
            return dp, dr, iterations

        method.system.solve = watched  # type: ignore
        allowed = []
        for _ in range(25):
            norm = method.norm
            step = method.advance()
            allowed.append(method.forcing(step.sigma) * norm)
    assert all(a <= 1.01 * b for a, b in zip(found, allowed, strict=True)) == (inner == "residual")
    method.destroy()
    problem.destroy()


def test_eta_of_newton() -> None:
    """Inner solves of 'newton' to 1e-3 by default, as table 4 has them."""
    assert NewtonOptions().eta == 1e-3
    default = steps("bratu", "newton", "bcgs_jacobi", "jacobian")
    assert {step.rtol for step in default} == {1e-3}
    named, tight = (steps("bratu", "newton", "bcgs_jacobi", "jacobian", eta=eta) for eta in (1e-3, 1e-6))
    count = [sum(step.linear_iterations for step in record) for record in (default, named, tight)]
    assert count[0] == count[1] < count[2]


def test_defaults_are_the_papers() -> None:
    """Those whose change no printed count of the fast tables shows."""
    din_options, fbn = DinOptions(), FischerOptions()
    assert (din_options.gamma, din_options.beta, din_options.theta, fbn.beta, fbn.theta) == (0.5, 1e-4, 0.5, 1e-4, 0.5)
    assert InteriorOptions().halvings == 5
    reduce = Reduce(MPI.COMM_SELF)
    assert Centrality(reduce, np.array([1.0]), 10**8, 1.0).tau1 == 0.99  # min(n min(p r)/p'r 1e-7/2, 0.99)


@pytest.mark.parametrize("n, tau1, tau2, worst", [(4, 0.5, 0.0, 2.25 / 0.75), (1, 0.0, 100.0, 51.0)])
def test_delta_by_hand(n: int, tau1: float, tau2: float, worst: float) -> None:
    """delta_k = min(0.1, eps^ sigma_k/max(...)) with eps^ = 1/n: one case for each of the two terms of (31)."""

    class Given:
        options = DinOptions()
        problem = type("P", (), {"size": n})
        central = type("C", (), {"tau1": tau1, "tau2": tau2})

    given: Any = Given()
    assert DIN.forcing(given, 0.2) == pytest.approx(0.2 / n / worst, rel=1e-14)


@pytest.mark.parametrize("recipe_name", ["lu", "gmres_ilu"])
def test_the_decrease_that_din_asks_for(recipe_name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """||F(new)|| <= (1 - beta alpha (1 - (sigma_k + delta_k))) ||F||, delta_k = 0 for a direct solver; inner solves to
    max(tol_min, delta_k ||F||); gamma of (28), (29) is the option's."""
    asked: list[float] = []

    def watched(norm: float, new_norm: float, alpha: float, forcing: float, beta: float) -> bool:
        asked.append(forcing)
        return inexact_decrease(norm, new_norm, alpha, forcing, beta)

    monkeypatch.setattr("lcp_lube.solvers.din.inexact_decrease", watched)
    problem = load_scene("problem1", {"n": 20}).build()
    with recipe(recipe_name):
        method = DIN(Job(problem, Stages(), "full", {"gamma": 0.3, "tol_min": 1e-9}))
        assert method.central.gamma == 0.3 and method.system.direct == (recipe_name == "lu")
        for _ in range(6):
            norm, before = method.norm, len(asked)
            step = method.advance()
            delta = 0.0 if method.system.direct else method.forcing(step.sigma)
            assert asked[before:] == [step.sigma + delta] * (len(asked) - before) and len(asked) > before
            assert step.rtol == max(1e-9, delta * norm)
    assert recipe_name == "lu" or delta > 0
    method.destroy()
    problem.destroy()


def test_the_decrease_that_fbn_asks_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """FBN-I: ||F~(new)|| <= (1 - beta alpha (1 - delta)) ||F~||, delta that of the inner solve; FBN-A, exact: slope -2 Phi."""
    asked: list[float] = []

    def watched(norm: float, new_norm: float, alpha: float, forcing: float, beta: float) -> bool:
        asked.append(forcing)
        return inexact_decrease(norm, new_norm, alpha, forcing, beta)

    monkeypatch.setattr("lcp_lube.solvers.fischer.inexact_decrease", watched)
    record = steps("problem1", "fbn-i", "gmres_ilu", max_it=4)
    assert set(asked) == {step.rtol for step in record} and min(asked) > 0
    problem = load_scene("problem1", {"n": 20}).build()
    with recipe("lu"):
        method = ArmijoNewton(Job(problem, Stages(), "full"))
        none = np.zeros(20)
        assert method._slope(none, none, none) == -(method.norm**2)
    method.destroy()
    problem.destroy()


@pytest.mark.parametrize("method", ["din", "fbn-a"])
@pytest.mark.parametrize("eps1, floor", [(1e-5, 1e-5), (1e-2, 1e-4), (1e-13, 1e-12)])
def test_inner_tolerance_follows_the_outer_one(method: str, eps1: float, floor: float) -> None:
    """tol_min is eps1 between 1e-12 and 1e-4 where nobody names it."""
    job = Job(load_scene("problem1", {"n": 5}).build(), Stages(), "full", stopping=Stopping(eps1=eps1))
    built: Any = METHODS[method].load()(job)
    assert built.options.tol_min == floor
    built.destroy()
    job.problem.destroy()
