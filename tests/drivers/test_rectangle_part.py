"""Half or a quarter of a rectangle: the answer is the whole's, and so is what is said of it."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from side_scenes import reduced_solve

from lcp_lube import load_scene, solve
from lcp_lube.drivers import rectangle_part
from lcp_lube.drivers.rectangle_part import Quarter, part_of

FEW = settings(max_examples=12, deadline=None)
CUBIC = {"family": "manufactured_cubic", "lambda": 2.0, "peak": 3.0, "name": "cubic"}
# Bounds that v touches from both sides, symmetric about x = 0.25 and y = 1, and a boundary that is not 0.
BOX = {
    "family": "obstacle",
    "name": "box",
    "lambda": 2.0,
    "x": [-0.5, 1.0],
    "y": [0.0, 2.0],
    "v_lower": "0.02 - 0.5*(x - 0.25)^2",
    "v_upper": "0.05 + (y - 1)^2",
    "boundary": "0.01*(y - 1)^2",
}
SCENES = {"bratu": "bratu", "cubic": CUBIC, "box": BOX, "obstacle": "obstacle_bratu"}


def axes_of(scene):
    problem = scene.build()
    part = part_of(scene, problem)
    problem.destroy()
    return part.axes if part else None


def assert_same(scene, reduction, error=1e-9, **how):
    """By any method: fields to 1e-9 of the largest value (or what the method reaches), quantities likewise."""
    part, whole = reduced_solve(scene, **how), solve(scene, reduction=False, **how)
    assert part.converged and whole.converged, (part.message, whole.message)
    assert part.settings["details"].get("reduction") == reduction
    v = whole.fields["v"]
    np.testing.assert_allclose(part.fields["v"], v, rtol=0, atol=error * np.abs(v).max())
    for key, value in whole.problem.quantities(whole.fields).items():
        mine = part.problem.quantities(part.fields)[key]
        assert mine is None if value is None else mine == pytest.approx(value, rel=error, abs=error), key
    assert part.problem.grid.shape == scene.shape
    for solution in (part, whole):
        solution.destroy()


@pytest.mark.parametrize("nx, ny", [(16, 12), (17, 13), (16, 13), (2, 3), (1, 8)])
@pytest.mark.parametrize("name", SCENES)
def test_even_and_odd_numbers(name, nx, ny):
    scene = load_scene(SCENES[name], {"nx": nx, "ny": ny})
    tight = {} if name in ("bratu", "cubic") else {"stopping": {"eps1": 1e-13}}
    assert_same(scene, "half in y" if nx == 1 else "quarter", **tight)


@pytest.mark.parametrize(
    "changes, kind",
    [
        ({"v_lower": "-0.1 + 0.1*x"}, "half in y"),
        ({"v_upper": "0.05 + 0.1*y"}, "half in x"),
        ({"boundary": "0.01*y"}, "half in x"),
        ({"v0": "0.03 + 0.01*x"}, "half in y"),
    ],
)
@pytest.mark.parametrize("n", [16, 17])
def test_one_axis(changes, kind, n):
    assert_same(load_scene(BOX, {"n": n, **changes}), kind, stopping={"eps1": 1e-13})


@pytest.mark.parametrize(
    "name, changes",
    [
        ("box", {"v_lower": "-0.1 + 0.1*x*y"}),
        ("box", {"v_upper": "1 + 1e-9*(x + y)"}),
        ("box", {"boundary": "0.01*(x + y)"}),
        ("box", {"v0": "0.01*(x + y)"}),
        ("poisson_cubic", {}),
    ],
)
def test_what_differs_is_not_reduced(name, changes):
    scene = load_scene(SCENES.get(name, name), {"n": 12, **changes})
    assert axes_of(scene) is None
    solution = solve(scene)
    assert solution.converged and "reduction" not in solution.settings["details"]
    assert solution.settings["why"][0].startswith("the whole model: source, bounds, start and boundary")
    solution.destroy()


@FEW
@given(
    st.integers(3, 20),
    st.integers(3, 20),
    st.floats(0.5, 4),
    st.floats(0.01, 0.3),
    st.floats(-0.2, 0.2),
)
def test_any_symmetric_obstacles(nx, ny, lam, top, low):
    assume(low < top)  # they would cross in the middle
    scene = load_scene(
        "obstacle_bratu",
        {"nx": nx, "ny": ny, "lambda": lam, "v_upper": f"{top} + abs(x - 0.5)", "v_lower": f"{low} - (y - 0.5)^2"},
    )
    assert_same(scene, "quarter", stopping={"eps1": 1e-13})


@pytest.mark.parametrize(
    "how",
    [
        {"method": "interior", "stopping": {"eps1": 1e-12}},
        {"method": "fas", "stopping": {"eps1": 1e-13}},
        {"method": "active-set", "recipe": "multigrid", "stopping": {"eps1": 1e-13}},
        {"method": "active-set", "recipe": "multigrid", "nested": True, "stopping": {"eps1": 1e-13}},
        {"method": "semismooth", "stopping": {"eps1": 1e-13}},
    ],
    ids=lambda how: "-".join(map(str, how.values())),
)
@pytest.mark.parametrize("n", [54, 55])
def test_all_methods_take_a_part(how, n):
    if how["method"] == "fas":
        pytest.importorskip("numba")
    assert_same(load_scene(BOX, {"n": n}), "quarter", error=1e-6 if how["method"] == "interior" else 1e-9, **how)


@pytest.mark.parametrize("n", [63, 64, 127])
def test_multigrid_holds_on_a_quarter(n):
    """Its coarse grids are the parts of the whole's; sweeps begin elsewhere: an iteration more a step, on no grid more."""
    scene = load_scene("obstacle_bratu", {"n": n})
    how = {"method": "active-set", "recipe": "multigrid", "nested": False}
    part, whole = reduced_solve(scene, **how), solve(scene, **how)
    assert part.iterations == whole.iterations and part.linear_iterations <= whole.linear_iterations + part.iterations
    for solution in (part, whole):
        solution.destroy()


def test_the_quarter_has_the_wholes_rows():
    """Halved on the mirror lines, where the matrix stays symmetric."""
    scene = load_scene(BOX, {"nx": 5, "ny": 6})
    whole, quarter = scene.build(), Quarter(scene, (True, True)).build()
    assert quarter.grid.shape == (3, 3) and Quarter(scene, (True, True)).facts().size == 9
    i = np.arange(3)[None, :]
    v = np.sin(1.0 + np.arange(9.0)).reshape(3, 3)
    spread = v[np.ix_([0, 1, 2, 2, 1, 0], [0, 1, 2, 1, 0])]
    rows = whole.residual(spread.ravel()).reshape(6, 5)[:3, :3] * np.where(i == 2, 0.5, 1.0)
    np.testing.assert_allclose(quarter.residual(v.ravel()).reshape(3, 3), rows, rtol=0, atol=1e-14)
    A = quarter.semilinear.A
    assert A.isSymmetric(1e-15)
    for problem in (whole, quarter):
        problem.destroy()


def test_auto_reduces_and_says_so():
    part, whole = (solve(load_scene("bratu", {"n": 20}), reduction=reduction) for reduction in (True, False))
    assert part.settings["details"]["reduction"] == "quarter" and "100 of 400 points" in part.settings["why"][0]
    assert "reduction" not in whole.settings["details"]
    assert whole.settings["why"][0] == "the whole model: no reduction was asked for"
    np.testing.assert_allclose(part.fields["v"], whole.fields["v"], rtol=0, atol=1e-9 * whole.fields["v"].max())
    named = solve(load_scene("bratu", {"n": 20}), method="newton")
    assert "reduction" not in named.settings["details"] and "was named" in named.settings["why"][0]
    for solution in (part, whole, named):
        solution.destroy()


def test_a_wrong_reduction_is_found_out(monkeypatch):
    monkeypatch.setattr(rectangle_part, "_mirrored", lambda *_: (True, True))
    scene = load_scene(BOX, {"n": 14, "boundary": "0.02*x + 0.01*y"})
    solution = solve(scene)
    assert solution.converged and "reduction" not in solution.settings["details"]
    assert solution.settings["why"][0].startswith("the whole model: the reduced one's answer (quarter) is not")
    solution.destroy()


def test_no_solution_is_told_by_a_quarter_too():
    solution = solve(load_scene("bratu", {"n": 20, "lambda": 7.0}))
    assert solution.outcome == "no_solution" and solution.settings["details"]["reduction"] == "quarter"
    solution.destroy()


def test_from_a_neighbours_answer():
    first = solve(load_scene("obstacle_bratu", {"n": 24}))
    near = load_scene("obstacle_bratu", {"n": 31, "lambda": 6.1})
    warm, cold = solve(near, start=first), solve(near)
    assert warm.converged and warm.settings["details"]["reduction"] == "quarter" and warm.iterations <= cold.iterations
    np.testing.assert_allclose(warm.fields["v"], cold.fields["v"], rtol=0, atol=1e-8)
    for solution in (first, warm, cold):
        solution.destroy()


@pytest.mark.parametrize("ranks", [2, 3])
def test_on_several_ranks(script, ranks):
    job = script("mpi_parts.py", ranks=ranks)
    assert job.status == 0, job.err
    for name, record in job.json.items():
        assert record["converged"] and record["reduction"] and record["difference"] < 1e-9, (name, record)
