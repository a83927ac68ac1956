"""Guaranteed bands: the exact rational solution is never outside one that was granted, and poor answers get none."""

from fractions import Fraction

import numpy as np
import pytest
from films import knots, make_problem, pressures, schemes
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from lcp_lube.api import solve
from lcp_lube.base.options import recipe
from lcp_lube.base.stages import Stages
from lcp_lube.errors import InputError
from lcp_lube.scenes.scene import load_scene
from lcp_lube.solvers.active_set import ActiveSet
from lcp_lube.solvers.enclosure import balance, conditions, enclose
from lcp_lube.solvers.job import Job
from lcp_lube.solvers.newton import Stopping, iterate

small = st.one_of(st.tuples(st.integers(1, 14)), st.tuples(st.integers(1, 4), st.integers(1, 4)))


def rational(problem):
    """A, B (lists of rows) and c with the stored coefficients as exact numbers, by faces: A's diagonal is an exact sum."""
    s, (ny, nx) = problem.scheme, problem.grid.box
    n = nx * ny
    A, B = ([[Fraction(0)] * n for _ in range(n)] for _ in range(2))
    for j in range(ny):
        for i in range(nx):
            row = j * nx + i
            for k, dj, di in ((s.k_W, 0, -1), (s.k_E, 0, 1), (s.k_S, -1, 0), (s.k_N, 1, 0)):
                A[row][row] += Fraction(k[j, i])
                if 0 <= j + dj < ny and 0 <= i + di < nx:
                    A[row][row + dj * nx + di] -= Fraction(k[j, i])
            B[row][row] = Fraction(s.b_C[j, i])
            if i > 0:
                B[row][row - 1] = Fraction(s.b_W[j, i])
    return A, B, [Fraction(value) for value in problem.c]


def eliminate(M, b):
    """The exact solution of M y = b: Gauss on a banded matrix, the M-matrices here need no pivoting."""
    n = len(b)
    M, b = [row[:] for row in M], b[:]
    for k in range(n):
        for i in range(k + 1, n):
            if M[i][k]:
                factor = M[i][k] / M[k][k]
                b[i] -= factor * b[k]
                for j in range(k, n):
                    if M[k][j]:
                        M[i][j] -= factor * M[k][j]
    for k in reversed(range(n)):
        b[k] = (b[k] - sum(M[k][j] * b[j] for j in range(k + 1, n) if M[k][j])) / M[k][k]
    return b


def exact_solution(problem, cavity):
    """p, r as exact numbers; from the signs of a computed answer, put right where they are wrong."""
    A, B, c = rational(problem)
    n, cavity = len(c), [bool(x) for x in cavity]
    for _ in range(3 * n + 5):
        y = eliminate([[-B[i][j] if cavity[j] else A[i][j] for j in range(n)] for i in range(n)], c)
        if cavity == [value < 0 for value in y]:
            return [max(v, Fraction(0)) for v in y], [max(-v, Fraction(0)) for v in y]
        cavity = [value < 0 for value in y]
    pytest.fail("the signs of the exact solution cycle")


def answer(problem, eps1=1e-10, max_it=200):
    """z by the active set, as p and r."""

    with recipe("umfpack"):
        run = ActiveSet(Job(problem, Stages(), "reduced", stopping=Stopping(eps1)))
        iterate(run, Stopping(eps1, np.inf, max_it))
        run.destroy()
    return run.fields


def band(problem, fields):
    with recipe("umfpack"):
        return enclose(problem, fields, "reduced", Stages())


def assert_inside(problem, fields, found):
    """Compares floating-point bounds with exact numbers: no tolerance anywhere."""
    p, r = exact_solution(problem, fields["r"] > fields["p"])
    for k in range(problem.size):
        assert Fraction(found.lower["p"][k]) <= p[k] <= Fraction(found.upper["p"][k])
        assert Fraction(found.upper["r"][k]) <= r[k] <= Fraction(found.lower["r"][k])
    unit, cell = Fraction(problem.p_unit), Fraction(problem.grid.cell)
    error = [abs(Fraction(value) - exact) for value, exact in zip(fields["p"], p, strict=True)]
    assert max(error) * unit <= Fraction(found.bounds["band_p"])
    assert sum(error) * unit * cell <= Fraction(found.bounds["band_load"])
    assert abs(Fraction(max(fields["p"])) - max(p)) * unit <= Fraction(found.bounds["band_p_max"])
    assert max(abs(Fraction(a) - b) for a, b in zip(fields["r"], r, strict=True)) <= Fraction(found.bounds["band_r"])


@settings(max_examples=40)
@given(shape=small, film=knots(), scheme=schemes, p_sides=pressures)
def test_converged_answers_get_narrow_bands_that_hold_the_exact_solution(shape, film, scheme, p_sides):
    problem = make_problem(shape, film, scheme, p_sides)
    assume(problem.c.any())  # where nothing flows, rounding leaves 1e-164, whose squares are zero: no band, and none needed
    fields = answer(problem)
    found = band(problem, fields)
    assert found.certified, found.message
    assert_inside(problem, fields, found)
    assert found.bounds["band_p"] <= 1e-7 * problem.p_unit * max(1.0, fields["p"].max())
    problem.destroy()


@settings(max_examples=60)
@given(
    shape=small,
    film=knots(),
    scheme=schemes,
    p_sides=pressures,
    size=st.integers(-14, 1),
    seed=st.integers(0, 2**31),
    both=st.booleans(),
)
def test_no_granted_band_misses_the_solution(shape, film, scheme, p_sides, size, seed, both):
    """Answers that are wrong by a part 10^size anywhere, with p and r both positive as interior methods leave them."""
    problem = make_problem(shape, film, scheme, p_sides)
    noise = np.random.default_rng(seed)
    good = answer(problem)
    fields = {
        name: np.abs(a + 10.0**size * noise.normal(size=a.size) * (a.max() if not both else max(a.max(), 1.0)))
        if both
        else a * (1 + 10.0**size * noise.normal(size=a.size))
        for name, a in good.items()
    }
    found = band(problem, fields)
    if found.certified:
        assert_inside(problem, fields, found)
    problem.destroy()


@settings(max_examples=25)
@given(shape=small, film=knots(), scheme=schemes, seed=st.integers(0, 2**31))
def test_rounding_bound_of_the_balance(shape, film, scheme, seed):
    """The sum of face flows is off by no more than it says, against exact arithmetic."""
    problem = make_problem(shape, film, scheme)
    noise = np.random.default_rng(seed)
    p, r = (noise.lognormal(sigma=8, size=problem.size) for _ in range(2))
    F, rounding = balance(problem, {"p": p, "r": r})
    A, B, c = rational(problem)
    for k in range(problem.size):
        exact = sum(A[k][j] * Fraction(p[j]) + B[k][j] * Fraction(r[j]) for j in range(problem.size)) - c[k]
        assert abs(exact - Fraction(F[k])) <= Fraction(rounding[k])
    problem.destroy()


@pytest.mark.parametrize("steps", [0, 1])
def test_poor_answers_are_refused(steps):
    """After one Newton step the balance is far off; a zero answer, NaN and infinity are no better."""
    problem = load_scene("rough", {"nx": 12, "ny": 5}).build()
    good = answer(problem)
    poor = answer(problem, max_it=steps) if steps else {name: np.zeros(60) for name in ("p", "r")}
    for fields in (poor, {**good, "p": np.full(60, np.nan)}, {**good, "r": np.where(np.arange(60) == 7, np.inf, good["r"])}):
        found = band(problem, fields)
        assert not found.certified and "no band" in found.message and not found.bounds
    problem.destroy()


@pytest.mark.parametrize(
    "name, changes, method",
    [
        ("problem1", {"n": 100}, "din"),
        ("problem2", {"n": 57}, "fbn-a"),
        ("problem3", {"n": 101, "scheme": "face"}, "din-pc"),
        ("problem4", {"nx": 33, "ny": 28}, "din"),
        ("problem4", {"n": 63}, "fas"),
        ("rough", {"n": 200}, "fas"),
        ("rough", {"n": 40}, "auto"),
        ("textured_slider", {"K": 1}, "auto"),
        ("journal", {"n": 48}, "auto"),
        ("two_groove_journal", {"nx": 72, "ny": 9, "p_groove": 1e5}, "din"),
        ("problem4", {"n": 150}, "auto"),
    ],
)
def test_every_methods_answer(name, changes, method):
    solution = solve(load_scene(name, changes), method=method, certify=True)
    assert solution.converged and solution.enclosure.certified, solution.enclosure.message
    tight = solve(load_scene(name, changes), method="active-set", nested=False, certify=True)
    distance = np.abs(solution.fields["p"] - tight.fields["p"]).max() * solution.problem.p_unit
    assert distance <= solution.enclosure.bounds["band_p"] + tight.enclosure.bounds["band_p"] < 1.0
    solution.destroy()
    tight.destroy()


def test_films_between_grooves_that_have_no_band():
    with solve(load_scene("two_groove_journal", {"nx": 60, "ny": 5}), method="din", stopping={"max_it": 1}, certify=True) as s:
        assert not s.enclosure.certified and "of 2 between grooves: no band" in s.enclosure.message


def test_conditions_are_checked():
    from dataclasses import replace

    from lcp_lube.problems.film.lubrication import LubricationProblem

    def broken(kind=None, **changes):
        problem = make_problem((5, 4), lambda x, y: 1e-5 + 0 * x + 0 * y)
        problem.scheme = replace(problem.scheme, **changes)
        problem.__class__ = kind or problem.__class__
        said = conditions(problem)
        problem.destroy()
        return said

    s = make_problem((5, 4), lambda x, y: 1e-5 + 0 * x + 0 * y).scheme
    assert broken() == ""
    assert "signs and dominance" in broken(k_E=-s.k_E)
    assert "signs and dominance" in broken(b_C=0.5 * s.b_C)
    assert "signs and dominance" in broken(k_N=0.9 * s.k_N)
    more = type("More", (LubricationProblem,), {"c": property(lambda self: self.scheme.c.ravel() + 1e-6)})
    assert "does not know" in broken(more)


ENDS = {  # ends in x, in y: what stands in docs/guaranteed_bounds.md
    "closed": ((("open", "open"), ("closed", "closed")), True),
    "mirror": ((("open", "open"), ("open", "mirror")), True),
    "west": ((("closed", "open"), ("open", "open")), True),
    "round": ((("open", "open"), ("periodic", "periodic")), True),
    "east": ((("open", "closed"), ("open", "open")), False),
    "endless": ((("periodic", "periodic"), ("open", "open")), True),
}


@pytest.mark.parametrize("case", ENDS)
def test_which_sides_satisfy_them(case):
    from films import MU, U

    from lcp_lube.problems.film.lubrication import LubricationProblem
    from lcp_lube.problems.film.reynolds import box_scheme
    from lcp_lube.problems.grid import Grid

    ends, holds = ENDS[case]
    grid, sides = Grid((7, 5), (0.1, 0.07), ends=ends), (1e5, 1e5, 2e5, 3e5)

    def film(x, y):
        return 1e-5 * (1.5 + np.sin(2 * np.pi * x / 0.1) + 0 * y)

    scheme = box_scheme(grid, film, mu=MU, U=U, scheme="face", p_sides=sides, p_unit=1e6)
    problem = LubricationProblem(grid, scheme, mu=MU, U=U, p_unit=1e6, p_sides=sides, p_c=0.0, film=film)
    assert (conditions(problem) == "") == holds, conditions(problem)
    if holds:
        found = band(problem, answer(problem))
        assert found.certified, found.message
    problem.destroy()


def test_only_films(cli):
    with pytest.raises(InputError, match="--certify: not for scene bratu"):
        solve(load_scene("bratu"), certify=True)
    run = cli("solve", "obstacle_bratu", "--certify")
    assert run.status == 2 and len(run.lines) == 1


@pytest.mark.parametrize(
    "words, ranks",
    [
        ("problem3 --n 101", 3),
        ("problem4 --nx 53 --ny 41", 3),
        ("problem4 --nx 150 --ny 151", 1),
        ("problem4 --nx 150 --ny 151", 2),
        ("two_groove_journal --nx 60 --ny 7", 2),
    ],
)
def test_on_several_ranks(cli, words, ranks):
    data = cli("solve", *words.split(), "--certify", "--json", ranks=ranks).json
    assert data["certified"] and 0 < data["band_p_max"] <= data["band_p"] < 1e-8 * data["p_max"]
    assert 0 < data["band_load"] < 1e-8 * abs(data["pressure_integral"])


def test_said_on_the_command_line(cli):
    words = ("solve", "problem4", "--n", 24, "--set", "p_side=1e6", "--certify")
    good, poor = cli(*words), cli(*words, "--max-it", 2)
    assert good.status == 0 and "proved: the exact discrete solution is within" in good.out
    assert poor.status == 1 and "not proved: no band" in poor.out
