"""Bytes a point of whole multigrid solves: counted, not timed."""

import tracemalloc

import numpy as np
import pytest

from lcp_lube.api import solve
from lcp_lube.problems.strips import ghosted, in_strips, places_of
from lcp_lube.scenes.scene import load_scene
from lcp_lube.solvers.fas.finest import finest, give_up, own, put, take_back
from lcp_lube.solvers.fas.loops import pressure_and_void


@pytest.mark.parametrize(
    "name, changes, most",
    [("problem4", {}, 50), ("problem4", {"scheme": "face"}, 50), ("journal", {}, 60), ("rough", {}, 66)],
)
def test_bytes_a_point(name, changes, most):
    """Coefficients 40, 24 where all lines have the same film; grids, iterate and fields beside them, and what output takes
    for a moment: 168 once.

    A journal's second grid has half as many points where a slider's has a quarter.
    """
    n = 599  # so large that strips of lines count little
    solve(
        load_scene(name, {"nx": 510, "ny": 510, **changes}), method="fas"
    ).destroy()  # loads or compiles all that the larger needs
    tracemalloc.start()
    try:
        with solve(load_scene(name, {"nx": n, "ny": n, **changes}), method="fas", memory_check=False) as solution:
            held, peak = (count / n**2 for count in tracemalloc.get_traced_memory())
            assert solution.converged
            foreseen = (solution.settings["memory_estimate_mb"] - solution.settings["memory_base_mb"]) * 2**20 / n**2
    finally:
        tracemalloc.stop()
    assert held < 60  # 40, p and r
    assert peak < most
    assert 0.9 * peak < foreseen < 1.2 * peak


@pytest.mark.parametrize("name", ["problem4", "journal"])
@pytest.mark.parametrize("n", [598, 599])
def test_bytes_a_point_of_halves(name, n):
    """Half of a film has no coefficients of its own; the whole's fields are made while the half's are there. 67 once."""
    solve(load_scene(name, {"nx": 511, "ny": 510})).destroy()
    tracemalloc.start()
    try:
        with solve(load_scene(name, {"nx": n, "ny": n}), memory_check=False) as solution:
            assert solution.converged and solution.settings["details"]["reduction"] == "mirror"
            assert tracemalloc.get_traced_memory()[1] < 53 * n**2
            foreseen = (solution.settings["memory_estimate_mb"] - solution.settings["memory_base_mb"]) * 2**20 / n**2
    finally:
        tracemalloc.stop()
    assert 51 < foreseen + 24 < 60  # the whole film's coefficients are in the base


@pytest.mark.parametrize("form, south, most", [("square", 1e5, 127), ("round", 1e5, 132), ("dome", 3e5, 165)])
def test_bytes_a_point_of_films_that_are_solved_twice(form, south, most):
    """Of the first solve fields and states are kept, no coefficients. The second one starts from its fields, not from copies.

    187 once, by halves; of it 51 were foreseen.
    """
    scene, n = load_scene("dimpled_pad", {"film.dimples.form": form, "sides.south": south}), 559
    solve(scene.with_shape((511, 511))).destroy()
    tracemalloc.start()
    try:
        with solve(scene.with_shape((n, n)), memory_check=False) as solution:
            assert solution.converged and "revised" in solution.settings["details"]
            assert (solution.settings["details"].get("reduction") == "mirror") == (south == 1e5)
            assert tracemalloc.get_traced_memory()[1] < most * n**2
            foreseen = (solution.settings["memory_estimate_mb"] - solution.settings["memory_base_mb"]) * 2**20 / n**2
    finally:
        tracemalloc.stop()
    assert 0.8 * most < foreseen + 40 * (south == 1e5) < 1.1 * most  # the whole film's coefficients are in the base


def test_bytes_a_point_in_time():
    """Of a march: what is kept of earlier steps, a step's coefficients once and not those of the step before, multigrid's."""
    scene, ask = load_scene("piston_skirt", {"motion.t_end": 4e-3, "motion.steps": 5}), {"method": "fas", "memory_check": False}
    solve(scene.with_shape((140, 140)), **ask).destroy()  # as above
    tracemalloc.start()
    try:
        with solve(scene.with_shape((260, 261)), **ask) as solution:
            assert solution.converged and len(solution.history) == 5
            assert tracemalloc.get_traced_memory()[1] < 300 * 260 * 261  # 276
    finally:
        tracemalloc.stop()


def test_the_finest_grid_is_the_problems_own():
    """Its conductances and right-hand side are not stored twice; a scheme that was changed is not mistaken for them."""
    from dataclasses import replace

    problem = load_scene("problem4", {"n": 30}).build()
    level, s = finest(problem), problem.scheme
    for mine, theirs in ((level.kx, s.k_W), (level.kx, s.k_E), (level.ky, s.k_S), (level.ky, s.k_N), (level.c, s.c)):
        assert np.shares_memory(mine, theirs)
    for name in ("k_E", "k_N", "c"):
        other = problem.with_scheme(replace(s, **{name: 2.0 * getattr(s, name)}), problem.mu)
        changed, whole = finest(other), {"k_E": "kx", "k_N": "ky", "c": "c"}[name]
        assert not np.shares_memory(getattr(changed, whole), getattr(s, name))
    problem.destroy()


@pytest.mark.parametrize("name", ["problem4", "journal"])
def test_fields_in_the_place_of_the_iterate(monkeypatch, name):
    """p and r are those made beside z, in any strips, and z comes back but for the rounding of r."""
    monkeypatch.setattr("lcp_lube.problems.strips.STRIP", 60)
    problem = load_scene(name, {"nx": 24, "ny": 17}).build()
    level, grid = finest(problem), problem.grid
    put(level, grid, level.z, np.random.default_rng(1).normal(size=grid.local_size))
    before, expected = level.z.copy(), pressure_and_void(own(level, grid, level.z), problem.scheme, grid)
    fields = give_up([level], problem)
    assert fields["p"].base is not None and not level.z.size
    for key in "pr":
        assert np.array_equal(fields[key], expected[key]), key
    take_back(level, problem, fields)
    np.testing.assert_allclose(level.z, before, rtol=1e-15, atol=0)
    problem.destroy()


@pytest.mark.parametrize("name", ["problem4", "journal", "misaligned_journal"])
def test_strips_are_parts_of_the_whole(monkeypatch, name):
    """Coefficients made and read a few lines at a time are those made at once, and so are the neighbours' values."""
    scene = load_scene(name, {"nx": 24, "ny": 17})
    whole = scene.build()
    monkeypatch.setattr("lcp_lube.problems.strips.STRIP", 60)
    problem, grid = scene.build(), whole.grid
    field = np.random.default_rng(0).random(grid.size)
    frame, framed = grid.ghosted(field, 0.0), ghosted(grid, field, 0.0)
    for rows in in_strips(grid):
        part, lines = problem.scheme.rows(rows), slice(rows.start, rows.stop + 2)
        assert np.array_equal(places_of(grid, rows).y, grid.y[rows])
        assert np.array_equal(framed(rows)[1:-1], frame[lines][1:-1])
        assert np.array_equal(framed(rows)[:, 1:-1], frame[lines][:, 1:-1])
        for coefficient in whole.scheme.arrays:
            assert np.array_equal(getattr(part, coefficient), getattr(whole.scheme, coefficient)[rows]), coefficient
    whole.destroy()
    problem.destroy()
