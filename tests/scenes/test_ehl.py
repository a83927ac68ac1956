"""Elastohydrodynamic line contact: formulas, reference values, methods, kept Jacobians, ranks, bad input."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lcp_lube import InputError, load_scene, solve
from lcp_lube.problems.ehl import EhlProblem

pytestmark = pytest.mark.rounding

# n: k, p_max, h_min and x_b of an independent program.
REFERENCE = {
    200: (1.14870584, 1.06489626, 1.75823666, 1.2023),
    1000: (1.14923125, 1.06485020, 1.75798605, 1.20628),
}


def problem_of(n, **changes) -> EhlProblem:
    return load_scene("ehl_line", {"n": n, **changes}).build()


def equations_by_loops(n, p, k, alpha=2.832, lam=6.057):
    """h_j for j = 0 ... n - 1 and the n equations, written out as in the module's docstring."""
    dx = 5.0 / n
    p = np.concatenate([[0.0], p, [0.0]])
    h, q = np.zeros(n), np.zeros(n)
    for j in range(n):
        x = -3.0 + (j + 0.5) * dx
        total = 0.0
        for i in range(n + 1):
            d = (i - j - 0.5) * dx
            before, after = p[i - 1] if i > 0 else 0.0, p[i + 1] if i < n else 0.0
            total += (0.5 if i in (0, n) else 1.0) * d * np.log(abs(d)) * (after - before)
        h[j] = x**2 + k + 1.0 + total / np.pi
        q[j] = lam * h[j] - h[j] ** 3 * np.exp(-alpha * (p[j] + p[j + 1]) / 2) * (p[j + 1] - p[j]) / dx
    return h, np.append(np.diff(q), 1.0 - 2.0 * dx / np.pi * p.sum())


@pytest.mark.parametrize("n", [2, 3, 11])
def test_equations_as_printed(n):
    problem = problem_of(n)
    rng = np.random.default_rng(n)
    v = np.append(rng.uniform(0, 1, n - 1), 1.3)
    h, F = equations_by_loops(n, v[:-1], v[-1])
    assert np.allclose(problem.gap(*problem.split(v))[:-1], h, rtol=1e-13)
    assert np.allclose(problem.residual(v), F, rtol=1e-11)
    assert np.allclose(problem_of(n, rows="divergence").residual(v)[:-1], F[:-1] * n / 5, rtol=1e-11)
    problem.destroy()


@pytest.mark.parametrize("n", [2, 3, 7, 40])
@pytest.mark.parametrize("rows", ["flow", "divergence"])
def test_jacobian(n, rows):
    """Central differences in every direction, to what they can tell; 40 is more than one block of columns."""
    problem = problem_of(n, rows=rows)
    v = np.append(np.random.default_rng(n).uniform(0.1, 1, n - 1), 1.3)
    J = problem.jacobian(v).getDenseArray().copy()
    step = 1e-6
    D = np.stack([(problem.residual(v + step * e) - problem.residual(v - step * e)) / (2 * step) for e in np.eye(n)], axis=1)
    assert np.max(np.abs(J - D)) <= 1e-8 * np.max(np.abs(J))
    problem.destroy()


@pytest.mark.parametrize("n", sorted(REFERENCE))
def test_reference_values(n):
    solution = solve(load_scene("ehl_line", {"n": n}))
    assert solution.converged and solution.settings["method"] == "interior"
    found = solution.problem.quantities(solution.fields)
    k, p_max, h_min, x_b = REFERENCE[n]
    assert found["k"] == pytest.approx(k, rel=1e-8) and found["p_max"] == pytest.approx(p_max, rel=1e-8)
    assert found["h_min"] == pytest.approx(h_min, rel=1e-8)
    assert round(found["x_b"], 4 if n == 200 else 5) == x_b
    solution.destroy()


@pytest.mark.parametrize(("n", "iterations"), [(200, 14), (1000, 19)])
def test_published_counts(n, iterations):
    """The counts of the printed table come out with ||H|| of the divergence, as printed, and k = 1.6 at the start."""
    solution = solve(load_scene("ehl_line", {"n": n, "rows": "divergence"}), stopping={"eps1": 2e-7, "eps2": np.inf})
    norms = [step.norm for step in solution.steps]
    assert solution.converged and solution.iterations == iterations
    assert norms[-1] / norms[-2] < 0.01 < norms[-4] / norms[-5]  # superlinear
    solution.destroy()


def test_solution_is_one():
    """What the equations mean: one flow where p > 0, a gap that opens behind x_b, the load carried; methods agree."""
    scene = load_scene("ehl_line", {"n": 120})
    answers = []
    for method in ("interior", "semismooth", "active-set"):
        solution = solve(scene, method=method)
        assert solution.converged, solution.message
        answers.append(solution.fields["v"])
        if method == "semismooth":
            contact, v = solution.problem, solution.fields["v"]
            p, k = contact.split(v)
            q = contact.flow(p, contact.gap(p, k))[0][:-1]
            pressure, opening = solution.problem.scaled(v)
            touching = np.flatnonzero(pressure > opening)  # p > 0 may be a trace that rounding leaves
            assert touching[0] == 0 and np.all(np.diff(touching) == 1)  # from the inlet to x_b without a hole
            end = touching[-1] + 1
            assert np.ptp(q[: end + 1]) <= 1e-9 * q[0] and np.all(np.diff(q[end:]) > 0)
            assert solution.certificate.measures["balance"] <= 1e-14
            x_b = solution.problem.quantities(solution.fields)["x_b"]
            assert abs(x_b - contact.x_faces[end]) < 2 * contact.dx
        solution.destroy()
    assert np.allclose(answers[0], answers[1], atol=1e-6) and np.allclose(answers[1], answers[2], atol=1e-9)


@pytest.mark.parametrize("n", [100, 200])
def test_kept_jacobian(monkeypatch, n):
    """The same answer with fewer Jacobians and a step or two more; with n = 100 one turns out too old and is renewed."""
    calls = []
    jacobian = EhlProblem.jacobian
    monkeypatch.setattr(EhlProblem, "jacobian", lambda self, v: calls.append(1) or jacobian(self, v))
    its, evaluations, answers = {}, {}, {}
    for keep in (1, 3):
        calls.clear()
        solution = solve(load_scene("ehl_line", {"n": n}), options={"keep": keep})
        assert solution.converged, solution.message
        its[keep], evaluations[keep], answers[keep] = solution.iterations, len(calls), solution.fields["v"]
        assert n == 100 or not solution.total("backtracking")
        solution.destroy()
    assert evaluations[1] == its[1] + 1  # one for the layout
    assert its[3] <= its[1] + 2
    assert evaluations[3] == (its[3] + 2) // 3 + 1 if n == 200 else evaluations[3] < 0.6 * evaluations[1]
    assert np.allclose(answers[1], answers[3], atol=1e-5) and answers[1][-1] == pytest.approx(answers[3][-1], rel=1e-8)


@settings(max_examples=15, deadline=None)
@given(alpha=st.floats(0.0, 3.0), lam=st.floats(2.0, 12.0), n=st.integers(20, 60))
def test_other_loads_and_speeds(alpha, lam, n):
    """A run says that it converged exactly where its answer satisfies the equations written out."""
    solution = solve(load_scene("ehl_line", {"n": n, "alpha": alpha, "lambda": lam}), stopping={"max_it": 100})
    v = solution.fields["v"]
    _, F = equations_by_loops(n, v[:-1], v[-1], alpha, lam)
    wrong = np.max(np.abs(np.append(np.minimum(v[:-1], F[:-1]), F[-1])))
    assert solution.converged == (wrong <= 1e-4)
    solution.destroy()


def test_certificate_is_not_the_method_s_belief():
    """A wrong k, a missing part of the load, a negative pressure: each is told."""
    solution = solve(load_scene("ehl_line", {"n": 60}))
    problem, v = solution.problem, solution.fields["v"]
    assert problem.certify({"v": v}, 1e-10).holds
    shifted, scaled, negative = v.copy(), 0.99 * v, v.copy()
    shifted[-1] += 0.01
    scaled[-1] = v[-1]
    negative[-2] = -0.01
    assert "residual" in problem.certify({"v": shifted}, 1e-10).failure
    assert "balance" in problem.certify({"v": scaled}, 1e-10).failure
    assert "residual" in problem.certify({"v": negative}, 1e-10).failure
    solution.destroy()


@pytest.mark.parametrize("ranks", [1, 2, 3])
def test_command_line_and_ranks(cli, ranks, tmp_path):
    """The same answer, keys and files on any number of ranks; 53 unknowns divide by none."""
    run = cli("solve", "ehl_line", "--n", 53, "--json", "--output", "fields.npz", ranks=ranks)
    assert run.status == 0, run.err
    data = run.json
    assert data["unknowns"] == data["nx"] == 53 and data["ranks"] == ranks
    assert data["recipe"] == ("dense_lu" if ranks == 1 else "redundant_lu")
    alone = solve(load_scene("ehl_line", {"n": 53}))
    expected = alone.problem.quantities(alone.fields)
    assert data["iterations"] == alone.iterations
    assert {name: data[name] for name in expected} == pytest.approx(expected, rel=1e-9)
    with np.load(tmp_path / "fields.npz") as fields:
        assert fields["x"][[0, -1]] == pytest.approx([-3 + 5 / 53, 2.0]) and fields["p"][-1] == 0.0
        assert np.all(fields["p"] >= 0) and fields["p"].max() == pytest.approx(data["p_max"])
        assert fields["h"].min() == pytest.approx(data["h_min"], rel=2e-3)
        assert str(fields["units"]) == '{"p": "", "h": "", "x": ""}'
    alone.destroy()


def test_few_points():
    """Where the contact has fewer points than x_b's line needs, x_b is None; the rest is there."""
    solution = solve(load_scene("ehl_line", {"n": 5}))
    assert solution.converged and solution.problem.quantities(solution.fields)["x_b"] is None
    solution.destroy()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"n": 1}, ["n = 1", "greater than or equal to 2"]),
        ({"lambda": 0.0}, ["lambda", "greater than 0"]),
        ({"alpha": -1.0}, ["alpha = -1"]),
        ({"x": [2.0, -3.0]}, ["start < end"]),
        ({"rows": "flows"}, ["rows = flows", "'flow' or 'divergence'"]),
        ({"lamda": 6.0}, ["unknown key lamda", "nearest is lam"]),
    ],
)
def test_bad_scenes(changes, words):
    with pytest.raises(InputError) as error:
        load_scene("ehl_line", changes)
    assert all(word in str(error.value) for word in words)


@pytest.mark.parametrize(
    ("options", "words"),
    [({"keep": 0}, "interior.keep = 0: at least 1"), ({"kep": 2}, "nearest is keep"), ({"z0": -1.0}, "z0 = -1")],
)
def test_bad_options(options, words):
    with pytest.raises(InputError, match=words):
        solve(load_scene("ehl_line", {"n": 20}), options=options)


def test_no_factors_in_place(petsc_options):
    """PETSc would overwrite the matrix of the next step."""
    petsc_options(pc_factor_in_place=None)
    with pytest.raises(InputError, match="pc_factor_in_place"):
        solve(load_scene("ehl_line", {"n": 20}))
