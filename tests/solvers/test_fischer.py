"""Fischer-Burmeister Newton: phi and its derivatives, the published counts and residues, inexact steps, bad input."""

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcp_lube import load_scene, solve
from lcp_lube.base.options import recipe
from lcp_lube.base.parallel import Array
from lcp_lube.base.stages import Stages
from lcp_lube.errors import InputError
from lcp_lube.linear.full import FullSystem
from lcp_lube.problems.solution import Outcome, Solution
from lcp_lube.solvers.fischer import ArmijoNewton, FischerNewton, derivatives, fischer_burmeister
from lcp_lube.solvers.job import Job
from lcp_lube.solvers.newton import Stopping, iterate
from lcp_lube.solvers.steplength import armijo

pytestmark = pytest.mark.rounding

PUBLISHED = Path(__file__).parents[2] / "benchmarks" / "published" / "mezzadri_galligani_2018"
METHODS = ("fbn-a", "fbn-i")
numbers = st.floats(-1e150, 1e150)


def published(name: str) -> list[dict[str, str]]:
    with (PUBLISHED / name).open(newline="") as file:
        return list(csv.DictReader(file))


def run(scene: str, method: str, recipe: str = "lu", eps: float = 1e-8, n: int = 100, **options: float) -> Solution:
    solution = solve(
        load_scene(scene, {"n": n}),
        method=method,
        system="full",
        recipe=recipe,
        stopping=Stopping(eps, eps),
        options=options,
    )
    solution.destroy()
    return solution


@pytest.mark.parametrize("row", [row for row in published("table6.csv") if row["method"] != "DIN"], ids=str)
def test_table_6(row):
    solution = run(f"problem{row['problem']}", row["method"].lower())
    assert solution.converged, solution.message
    assert (solution.iterations, solution.total("backtracking")) == (int(row["it"]), int(row["back"]))
    # c1 and c2 are rounding by then: their size is all there is to compare.
    assert solution.steps[-1].norm < 10 * float(row["c1"])
    assert solution.steps[-1].step_norm < 10 * float(row["c2"])


@pytest.mark.parametrize("method", METHODS)
def test_table_7_residues_in_the_cavity(method):
    """DIN stays positive, at 1e-25; FBN leaves rounding of either sign, some 1e-18 (points 70 to 75, in MPa)."""
    printed = published("table7.csv")
    cavity = slice(int(printed[0]["i"]) - 1, int(printed[-1]["i"]))
    din, fbn = run("problem1", "din").fields["p"][cavity], run("problem1", method).fields["p"][cavity]
    np.testing.assert_allclose(din, [float(row["p_din"]) for row in printed], rtol=0.01)
    sizes = [abs(float(row[f"p_{method.replace('-', '_')}"])) for row in printed]
    assert fbn.min() < 0 < fbn.max()
    assert min(sizes) / 10 < np.abs(fbn).mean() < max(sizes) * 10


@pytest.mark.parametrize("method", METHODS)
def test_loose_tolerances_leave_larger_negative_pressures(method):
    """At eps = 1e-4 some pressures are about -1e-9 MPa (text under table 7)."""
    solution = run("problem3", method, eps=1e-4)
    assert solution.converged
    assert -1e-8 < solution.fields["p"].min() < -1e-10


@given(numbers, numbers)
def test_derivatives_are_an_element_of_the_generalised_jacobian(p, r):
    D_p, D_r = derivatives(np.array([p]), np.array([r]))
    radius = np.hypot(D_p + 1.0, D_r + 1.0)[0]
    assert radius == pytest.approx(1.0, rel=1e-12)
    if max(abs(p), abs(r)) > 1e-290:  # below, the element at the origin is taken
        assert (D_p * np.hypot(p, r))[0] == pytest.approx(p - np.hypot(p, r), rel=1e-9, abs=1e-15 * np.hypot(p, r))


def test_derivatives_at_the_origin():
    D_p, D_r = derivatives(np.zeros(3), np.array([0.0, -0.0, 1.0]))
    np.testing.assert_allclose(D_p, [np.sqrt(0.5) - 1, np.sqrt(0.5) - 1, -1.0])
    np.testing.assert_allclose(D_r, [np.sqrt(0.5) - 1, np.sqrt(0.5) - 1, 0.0])


@given(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3))
def test_phi_vanishes_at_complementary_pairs_alone(p, r):
    """|phi| lies between (2 - sqrt 2) and (2 + sqrt 2) times |min(p, r)| (Tseng)."""
    phi, least = abs(fischer_burmeister(np.array([p]), np.array([r]))[0]), abs(min(p, r))
    rounding = 1e-15 * (abs(p) + abs(r))
    assert (2 - np.sqrt(2)) * least - rounding <= phi <= (2 + np.sqrt(2)) * least + rounding


def test_armijo():
    assert armijo(1.0, 0.9998, 1.0, -2.0, 1e-4)
    assert not armijo(1.0, 0.9999, 1.0, -2.0, 1e-4)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("start", [(0.0, 0.0), (-1.0, 0.5)])
def test_starts_outside_the_interior(method, start):
    """Not an interior method: a start at the origin, where phi has no derivative, or below zero will do."""
    solution = run("problem1", method, p0=start[0], r0=start[1])
    assert solution.converged, solution.message
    assert solution.fields["p"].max() == pytest.approx(run("problem1", method).fields["p"].max(), rel=1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_inexact_steps_lead_to_the_same_answer(method):
    exact, inexact = run("problem1", method), run("problem1", method, "gmres_ilu")
    assert inexact.converged, inexact.message
    np.testing.assert_allclose(inexact.fields["p"], exact.fields["p"], atol=1e-10)
    np.testing.assert_allclose(inexact.fields["r"], exact.fields["r"], atol=1e-10)
    assert inexact.total("linear_iterations") > inexact.iterations
    rtols = [step.rtol for step in inexact.steps]
    assert all(1e-8 <= rtol <= 0.1 for rtol in rtols)
    assert {step.rtol for step in exact.steps} == {0.0}


class Backwards(FullSystem):
    """An inner solver whose answer points the wrong way."""

    @property
    def direct(self) -> bool:
        return False

    def solve(self, *args: Any) -> tuple[Array, Array, int]:
        dp, dr, iterations = super().solve(*args)
        return -dp, -dr, iterations


@pytest.mark.parametrize("kind, ending", [(ArmijoNewton, Outcome.STEP_LENGTH), (FischerNewton, Outcome.MAX_ITERATIONS)])
def test_a_direction_of_ascent_is_reported(kind, ending):
    """FBN-A sees the slope; FBN-I halves until the step drowns in rounding, and gets nowhere."""
    problem = load_scene("problem1", {"n": 20}).build()
    with recipe("umfpack"):
        method = kind(Job(problem, Stages(), "full"))
        method.system.destroy()
        method.system = Backwards(problem)
        start = method.norm
        outcome, message, steps = iterate(method, Stopping(max_it=5))
    assert outcome is ending
    assert steps or "not one of descent" in message
    assert method.norm == pytest.approx(start, rel=1e-12)
    method.destroy()
    problem.destroy()


def test_stagnation_is_reported():
    """From p = 0, r = 0.1, complementary everywhere, the merit function lets no step go far."""
    solution = run("problem1", "fbn-i", "umfpack", p0=0.0, r0=0.1)
    assert solution.outcome is Outcome.MAX_ITERATIONS


def test_counts_in_parallel(cli):
    job = cli("solve", "problem3", "--method=fbn-a", "--system=full", "--json", "--no-nested", ranks=3, timeout=240)
    assert job.status == 0, job.err
    assert (job.json["iterations"], job.json["backtracking"]) == (24, 62)


@pytest.mark.parametrize(
    "options, words",
    [
        ({"p0": np.nan}, "--p0 nan"),
        ({"beta": 1.0}, "beta = 1.0"),
        ({"gamma": 0.5}, "fbn-a.gamma"),
        ({"delta_max": 0.0}, "delta_max = 0.0"),
    ],
)
def test_bad_input(options, words):
    with pytest.raises(InputError, match=words):
        run("problem1", "fbn-a", **options)
