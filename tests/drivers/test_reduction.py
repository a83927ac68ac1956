"""Less model than the scene's grid: the answer is the whole model's, and so is what is said of it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from side_scenes import REDUCED, SCENES, reduced_solve

from lcp_lube import load_scene, solve
from lcp_lube.drivers.film_part import Part, part_of
from lcp_lube.problems.film.model import Model
from lcp_lube.scenes.bearing import BearingScene

FEW = settings(max_examples=15, deadline=None)


def bearing(film, **data):
    fluid = {"mu": 0.01, "p_supply": 1e5}
    return BearingScene(**{"dimension": 2, "L": 0.01, "width": 0.006, "U": 1.0, "nx": 14, "fluid": fluid, "film": film, **data})


def kind(scene):
    problem = scene.build()
    part = part_of(scene, problem)
    problem.destroy()
    return part.kind if part else None


def both(scene):
    """Reduced and whole, by the method that ends at the exact discrete solution: p, r, quantities, solution."""
    out = []
    for solver in (reduced_solve, solve):
        solution = solver(scene, method="active-set", nested=False)
        assert solution.converged, solution.message
        quantities = solution.problem.quantities(solution.fields)
        out.append((solution.fields["p"], solution.fields["r"], quantities, solution))
        solution.destroy()
    return out


def assert_same(reduced, whole):
    """Fields to 1e-9 of the largest pressure, quantities likewise; places only where they are not one of several."""
    for mine, theirs in zip(reduced[:2], whole[:2], strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=0, atol=1e-9 * max(np.abs(theirs).max(), 1.0))
    for key in ("load", "friction", "p_max", "cavitated_fraction", "min_h"):
        assert reduced[2][key] == pytest.approx(whole[2][key], rel=1e-9, abs=1e-9), key
    for side, flow in whole[2]["flow"].items():
        assert reduced[2]["flow"][side] == pytest.approx(flow, abs=1e-9 * abs(whole[2]["flow"]["west"]) + 1e-20), side


@pytest.mark.parametrize("ny", [1, 2, 9, 10])
@pytest.mark.parametrize("ends", ["pressure", "periodic", "closed"])
def test_mirrored_films(ny, ends):
    if ends == "periodic" and ny < 3:
        return
    film = {"shape": "formula", "h": "1e-6 + 1e-4*(0.01 - x) + 1e-6*cos(2*pi*(y - 0.003)/0.006)^2"}
    scene = bearing(film, ny=ny, sides={"south": ends, "north": ends})
    if ny == 1:
        assert kind(scene) in (None, "line")
        return
    assert kind(scene) == "mirror"
    reduced, whole = both(scene)
    assert_same(reduced, whole)
    assert reduced[3].problem.grid.shape == (14, ny) and reduced[3].iterations == whole[3].iterations


@pytest.mark.parametrize("name", ["problem4", "journal", "textured_slider"])
@pytest.mark.parametrize("ny", [12, 13])
def test_built_in_scenes_that_are_symmetric(name, ny):
    scene = load_scene(name, {"nx": 24, "ny": ny, **({"K": 1} if name == "textured_slider" else {})})
    assert kind(scene) == "mirror"
    reduced, whole = both(scene)
    assert_same(reduced, whole)
    for key in ("sommerfeld", "attitude_deg", "side_leakage_number"):
        assert reduced[2].get(key, 0) == pytest.approx(whole[2].get(key, 0), rel=1e-9)


@pytest.mark.parametrize("south, north", [("closed", "symmetry"), ("periodic", "periodic")])
def test_films_that_do_not_depend_on_y(south, north):
    scene = bearing({"shape": "wedge", "h_start_um": 3, "h_end_um": 1}, ny=7, sides={"south": south, "north": north})
    assert kind(scene) == "line"
    reduced, whole = both(scene)
    assert_same(reduced, whole)
    assert reduced[3].settings["details"]["reduction"] == "line" and "solved in 1D" in reduced[3].settings["why"][0]


@pytest.mark.parametrize("around", ["pressure", "periodic"])
def test_a_constant_film_needs_no_step(around):
    scene = bearing({"shape": "constant", "h_um": 2}, ny=7, sides={"west": around, "east": around})
    assert kind(scene) == "constant"
    reduced, whole = both(scene)
    assert_same(reduced, whole)
    assert reduced[3].iterations == 0 and reduced[3].settings["method"] == "none"
    assert kind(load_scene("problem3", {"h_max": 15e-6})) == "constant"


@pytest.mark.parametrize(
    "film, data",
    [
        ({"shape": "wedge", "along": "y", "h_start_um": 2, "h_end_um": 1}, {}),
        ({"shape": "formula", "h": "1e-6*(1 + 1e-9*y/0.006)"}, {"sides": {"south": "closed", "north": "closed"}}),
        ({"shape": "wedge", "h_start_um": 2, "h_end_um": 1}, {"sides": {"south": 2e5}}),
        ({"shape": "wedge", "h_start_um": 2, "h_end_um": 1}, {"sides": {"south": "symmetry"}}),
        ({"shape": "constant", "h_um": 2}, {"sides": {"south": 2e5}}),
        ({"shape": "constant", "h_um": 2}, {"sides": {"south": 2e5, "east": "closed"}}),
        ({"shape": "roughness", "sigma_um": 0.1}, {"h_floor": 1e-12, "h_offset_um": 2}),
    ],
)
def test_what_differs_is_not_reduced(film, data):
    assert kind(bearing(film, ny=8, **data)) is None


def test_symmetric_pressures_with_a_constant_film():
    """Not one pressure: the sides differ, but south and north are alike."""
    assert kind(bearing({"shape": "constant", "h_um": 2}, ny=8, sides={"west": 3e5})) == "mirror"
    assert kind(bearing({"shape": "constant", "h_um": 2}, ny=8, sides={"east": "closed"})) == "mirror"


@FEW
@given(st.integers(2, 9), st.lists(st.floats(0.2, 3), min_size=2, max_size=4), st.sampled_from(["face", "nodal", "upwind"]))
def test_any_mirrored_film(ny, waves, scheme):
    """Cosines of the distance from the middle: whatever their number and the scheme, half the width says it all."""
    terms = " + ".join(f"{a}*cos({500 * k}*(y - 0.003))*sin({300 * (k + 1)}*x)" for k, a in enumerate(waves, start=1))
    scene = bearing({"shape": "formula", "h": f"8 + 0.5*({terms})", "unit": "um"}, ny=ny, scheme=scheme, nx=9)
    reduced, whole = both(scene)
    assert_same(reduced, whole)


@pytest.mark.parametrize(
    "how",
    [{"method": "active-set"}, {"method": "din"}, {"system": "full"}, {"recipe": "superlu"}, {"options": {"p0": 2.0}}],
)
def test_who_names_how_gets_the_whole_model(how):
    solution = solve(load_scene("problem4", {"n": 12}), **how)
    assert solution.converged and "reduction" not in solution.settings["details"]
    solution.destroy()


def test_a_set_pc_keeps_the_whole_model(petsc_options):
    petsc_options(ksp_type="preonly", pc_type="lu")
    solution = solve(load_scene("problem4", {"n": 12}))
    assert (
        solution.settings["details"] == {} and "a method, a matrix or an inner solver was named" in solution.settings["why"][0]
    )
    solution.destroy()


@pytest.mark.parametrize("name", ["problem4", "journal"])
def test_auto_reduces(name):
    auto, whole = (solve(load_scene(name, {"nx": 40, "ny": 31}), method=method) for method in ("auto", "active-set"))
    assert auto.converged and auto.settings["details"]["reduction"] == "mirror" and "half the width" in auto.settings["why"][0]
    for field, other in zip((auto.fields["p"], auto.fields["r"]), (whole.fields["p"], whole.fields["r"]), strict=True):
        np.testing.assert_allclose(field, other, rtol=0, atol=1e-6 * other.max())
    for solution in (auto, whole):
        solution.destroy()


@pytest.mark.parametrize(
    "data",
    [
        {},  # as much alike at a few points as a mirrored film, and a little off where nobody has looked
        {"sides": {"south": "pressure", "north": "closed"}},  # nothing to look for
    ],
)
def test_a_film_without_parts_is_built_once(monkeypatch, data):
    count, build = [], Model.build
    monkeypatch.setattr(Model, "build", lambda self, *args, **how: count.append(1) or build(self, *args, **how))
    film = {"shape": "formula", "h": "1e-6 + 1e-4*(0.01 - x) + 1e-9*max(0, 1 - abs(y - 0.0007)/0.0001)"}
    with solve(bearing(film, ny=39, **data)) as solution:
        assert solution.converged
        assert any("the whole model" in why for why in solution.settings["why"])
    assert len(count) == 1


def test_a_wrong_reduction_is_found_out(monkeypatch):
    """The certificate is that of the whole scene: a film that only seems symmetric is solved whole."""
    for check in ("_is_symmetric", "promising"):
        monkeypatch.setattr(f"lcp_lube.drivers.film_part.{check}", lambda *_: True)
    scene = bearing({"shape": "formula", "h": "2e-6 - 1e-4*x + 5e-5*y"}, ny=9)
    assert kind(scene) == "mirror"
    solution, whole = solve(scene), solve(scene, method="active-set")
    assert solution.converged and "reduction" not in solution.settings["details"]
    assert solution.settings["why"][0].startswith("the whole model: the reduced one's answer (mirror) is not")
    np.testing.assert_allclose(solution.fields["p"], whole.fields["p"], rtol=0, atol=1e-6 * whole.fields["p"].max())
    for one in (solution, whole):
        one.destroy()


def test_nested_and_from_a_neighbours_answer():
    scene = load_scene("journal", {"nx": 60, "ny": 51})
    first = solve(scene, nested=True)
    assert first.converged and first.levels and first.settings["details"]["reduction"] == "mirror"
    near = load_scene("journal", {"nx": 60, "ny": 51, "eccentricity": 0.51})
    warm, cold = solve(near, start=first), solve(near)
    assert warm.converged and warm.iterations <= cold.iterations
    np.testing.assert_allclose(warm.fields["p"], cold.fields["p"], rtol=0, atol=1e-8)
    for solution in (first, warm, cold):
        solution.destroy()


def test_the_part_is_the_lower_half_of_the_whole():
    """The very same coefficients; on the mirror line half of them."""
    scene = load_scene("problem4", {"nx": 6, "ny": 7})
    whole, half = scene.build(), Part(scene, "mirror").build()
    assert half.grid.shape == (6, 4)
    for name in ("k_W", "k_E", "k_S", "b_C", "b_W", "c"):
        mine, theirs = getattr(half.scheme, name), getattr(whole.scheme, name)
        np.testing.assert_array_equal(mine[:3], theirs[:3])
        np.testing.assert_array_equal(mine[3], theirs[3] * (1.0 if name == "k_S" else 0.5))
    assert not half.scheme.k_N[3].any()
    for problem in (whole, half):
        problem.destroy()


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """The quantities of `SCENES`, whole, on this one rank."""
    folder, out = tmp_path_factory.mktemp("scenes"), {}
    for name, text in SCENES.items():
        (folder / f"{name}.toml").write_text(text)
        solution = solve(load_scene(folder / f"{name}.toml"), method="active-set")
        out[name] = solution.problem.quantities(solution.fields)
        solution.destroy()
    return out


@pytest.mark.parametrize("ranks", [2, 3])
def test_on_several_ranks(script, tmp_path, ranks, alone):
    job = script("mpi_sides.py", tmp_path, ranks=ranks)
    assert job.status == 0, job.err
    for name, record in job.json.items():
        assert record["converged"] and record["difference"] < 1e-9 and record["reduction"] == REDUCED.get(name), name
        for key in ("load", "friction", "p_max", "cavitated_fraction"):
            assert record[key] == pytest.approx(alone[name][key], rel=1e-9), (name, key)


def test_numpys_settings_are_the_callers():
    """A scene that is solved in part calls `solve` inside `solve`."""
    before = np.geterr()
    solve(load_scene("problem4", {"n": 12})).destroy()
    assert np.geterr() == before


@pytest.mark.parametrize("shape", [{"ny": 12}, {"ny": 13, "sides": {"south": "closed"}}, {"dimension": 1, "width": None}])
def test_a_flat_texture_needs_no_pressure(shape):
    """No side has one, and the film is nowhere narrower than at its inlet: p = 0 and 1 - r = h_in/h, by any method."""
    pits = {"shape": "pocket", "x_mm": [2, 7], "depth_um": 5} | ({"y_mm": [1, 5]} if "ny" in shape else {})
    keys = {"nx": 29, "fluid": {"mu": 0.01}, **shape}
    flat = bearing([{"shape": "constant", "h_um": 10}, pits], **keys)
    assert kind(flat) == "unpressed"
    with solve(flat) as least, solve(flat, reduction=False) as whole:
        assert (least.method, least.converged, whole.converged) == ("none", True, True)
        assert least.fields["p"].max() == 0.0 and max(least.numbers["p_max"], whole.numbers["p_max"]) < 1e-6
        assert np.abs(least.fields["r"] - whole.fields["r"]).max() < 1e-9
        assert least.fields["r"].max() == pytest.approx(1 / 3, rel=1e-9)
    assert kind(bearing([{"shape": "linear", "h_start_um": 11, "h_end_um": 10}, pits], **keys)) != "unpressed"
    assert (
        kind(bearing([{"shape": "constant", "h_um": 10}, pits], **keys | {"fluid": {"mu": 0.01, "p_supply": 1e5}}))
        != "unpressed"
    )
