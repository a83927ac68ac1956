"""Principal pivoting and the certificate's closest look: films of any ratio of heights, right to the last digits."""

import numpy as np
import pytest
from side_scenes import SCENES

from lcp_lube import InputError, load_scene, solve
from lcp_lube.problems.film.graded import GradedJacobian, Pivots, whole

SUPPLY = '[[supply]]\nshape = "rectangle"\nx_mm = [4, 6]\ny_mm = [2, 4]\np = 1e6\n'
FILMS = {**SCENES, "supply": SCENES["dead_end"] + SUPPLY}
POCKET = {
    "family": "bearing",
    "dimension": 2,
    "L": 0.02,
    "width": 0.01,
    "nx": 14,
    "ny": 9,
    "U": 1.0,
    "fluid": {"mu": 0.05, "p_supply": 1e5},
    "film": [
        {"shape": "linear", "h_start": 2e-6, "h_end": 1e-6},
        {"shape": "pocket", "depth": 0.2, "x": [0.006, 0.012], "y": [0.003, 0.007]},
    ],
}


def assembled(mat):
    pointers, columns, values = mat.getValuesCSR()
    out = np.zeros(mat.getSize())
    out[np.repeat(np.arange(len(pointers) - 1), np.diff(pointers)), columns] = values
    return out


@pytest.mark.parametrize("name", FILMS)
def test_jacobian_is_the_assembled_one(name, tmp_path):
    """Sides of every kind: J y = f for the columns of A and -B."""
    (tmp_path / "scene.toml").write_text(FILMS[name])
    problem = load_scene(tmp_path / "scene.toml", {"nx": 7, "ny": 5}).build()
    full = np.random.default_rng(1).random(problem.size) < 0.6
    A, B = assembled(problem.A), assembled(problem.B)
    f = np.random.default_rng(2).uniform(-1, 1, problem.size)
    y = GradedJacobian(problem, full).solve(f)
    J = np.where(full, A, -B)
    assert np.all(np.abs(J @ y - f) <= 1e-13 * (np.abs(J) @ np.abs(y)))
    assert [field.shape for field in whole(problem.grid, f)] == [(5, 7)]
    problem.destroy()


@pytest.mark.parametrize("name", FILMS)
def test_answers_are_those_of_the_active_set(name, tmp_path):
    (tmp_path / "scene.toml").write_text(FILMS[name])
    scene = load_scene(tmp_path / "scene.toml", {"nx": 13, "ny": 7})
    found, other = (solve(scene, method=method, rescue=False) for method in ("pivoting", "active-set"))
    assert found.converged and other.converged
    for key in "pr":
        np.testing.assert_allclose(found.fields[key], other.fields[key], atol=1e-9 * max(1.0, found.fields["p"].max()))
    found.destroy()
    other.destroy()


def test_a_wrong_level_in_a_pocket_is_seen():
    """0.2 m beside 1 um: 1e16 times the conductance. No sum over the pocket's cells sees its level; `p_error` does."""
    found = solve(load_scene(POCKET))
    assert found.converged and found.certificate.measures["p_error"] < 1e-8
    p, r = found.fields["p"], found.fields["r"]
    pocket = found.problem.scheme.h.ravel() > 0.1
    assert 5 < pocket.sum() < 60 and np.ptp(p[pocket]) < 1e-6 * p.max()
    spoilt = found.problem.certify({"p": np.where(pocket, 0.9 * p, p), "r": r}, 1e-8)
    assert spoilt.failure and spoilt.measures["p_error"] > 0.01
    found.destroy()


def test_ordinary_films_are_not_looked_at_twice():
    found = solve(load_scene("problem4", {"n": 12}))
    assert "p_error" not in found.certificate.measures
    found.destroy()


def test_a_start_of_zeros_or_of_nothing(tmp_path):
    """From any start the same set of full cells."""
    problem = load_scene("problem2", {"n": 40}).build()
    answers = []
    for p, r in ((1.0, 0.0), (0.0, 0.9), (0.0, 0.0)):
        pivots = Pivots(problem, np.full(40, p), np.full(40, r))
        for _ in range(60):
            pivots.step()
            if not pivots.wrong:
                break
        assert not pivots.wrong
        answers.append(pivots.p)
    np.testing.assert_allclose(answers[1], answers[0], rtol=1e-12)
    np.testing.assert_allclose(answers[2], answers[0], rtol=1e-12)
    problem.destroy()


def test_large_films_are_refused_in_a_line():
    with pytest.raises(InputError, match="--method pivoting: for at most 20000 points"):
        solve(load_scene("problem4", {"n": 200}), method="pivoting")


@pytest.mark.parametrize("ranks", [2, 3])
def test_on_several_ranks(cli, tmp_path, ranks):
    (tmp_path / "ring.toml").write_text(SCENES["ring"])
    for scene in ("problem4", "problem1", tmp_path / "ring.toml")[: 2 * ranks - 3]:
        words = ("solve", scene, "--nx", 13, *(("--ny", 7) if scene != "problem1" else ()), "--method", "pivoting", "--json")
        several = cli(*words, ranks=ranks)
        assert several.status == 0, several.err
        with solve(load_scene(scene, {"nx": 13} if scene == "problem1" else {"nx": 13, "ny": 7}), method="pivoting") as alone:
            assert several.json["load"] == pytest.approx(alone.load, rel=1e-12)
            assert several.json["iterations"] == alone.iterations
