"""Half of a symmetric film and the whole of it, each from the coefficients of the other."""

from dataclasses import replace

import numpy as np
import pytest

import lcp_lube.drivers.film_part as film_part
from lcp_lube import load_scene, solve
from lcp_lube.problems.film.halves import doubled
from lcp_lube.problems.film.rims import state_of
from lcp_lube.problems.film.stored import Dry
from lcp_lube.problems.film.strip import frames

POCKET = [
    {"shape": "linear", "h_start_um": 2.4, "h_end_um": 2.0},
    {"shape": "pocket", "depth_um": 2.5, "x_mm": [2.3, 5.1], "y_mm": [2.5, 7.5]},
]
USERS = {"family": "bearing", "dimension": 2, "L_mm": 10, "width_mm": 10, "U": 1.0, "fluid": {"mu": 0.02, "p_supply": 1e5}}
FILMS = {
    "nodal": ("problem4", {}),
    "face": ("problem4", {"scheme": "face"}),
    "upwind": ("problem4", {"scheme": "upwind"}),
    "at rest": ({**USERS, "U": 0.0, "film": POCKET}, {}),
    "pocket": ({**USERS, "film": POCKET}, {}),
    "ring of lines": ({**USERS, "film": POCKET, "sides": {"south": "periodic", "north": "periodic"}}, {}),
    "round": ("dimpled_pad", {"film.dimples.form": "round"}),
    "grooves": ("two_groove_journal", {}),
    "supply": ({**USERS, "film": POCKET, "supply": [{"x_mm": [6, 8], "y_mm": [3, 7], "p": 3e5}]}, {}),
}


def alike(own, other):
    assert own.arrays == other.arrays
    resting = not own.couette_W.any()  # any speed will do for the void then
    for name in own.arrays if not resting else {*own.arrays} - {"b_C", "b_W"}:
        a, b = (getattr(one, name) * (1.0 if name == "h" else one.flow_unit) for one in (own, other))
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-11 * np.abs(b).max(), err_msg=name)


def frames_of(s):
    return frames(s.k_W, s.k_E, s.k_S, s.k_N, s.c)


@pytest.mark.parametrize("ny", [14, 15, 3])
@pytest.mark.parametrize("name", FILMS)
def test_a_half_is_what_it_would_be_by_itself(name, ny):
    scene = load_scene(*FILMS[name]).with_shape((24 if name == "grooves" else 17, ny))
    problem = scene.build()
    part = film_part.Part(scene, "mirror", problem)
    before = {name: getattr(problem.scheme, name).copy() for name in problem.scheme.arrays}
    taken, built = part.build(), film_part.Part(scene, "mirror").build()
    alike(taken.scheme, built.scheme)
    for own, whole in zip(frames_of(taken.scheme)[:2], frames_of(problem.scheme)[:2], strict=True):
        assert np.shares_memory(own, whole) or name == "supply"  # whose faces beside held cells are other arrays
    assert np.shares_memory(taken.scheme.h, problem.scheme.h)
    for _ in range(2):
        with part.lent.returned():
            for name, values in before.items():
                np.testing.assert_array_equal(getattr(problem.scheme, name), values, err_msg=name)
        alike(taken.scheme, built.scheme)
    part.lent.give_back()
    np.testing.assert_array_equal(problem.scheme.k_N, before["k_N"])
    assert (taken.held is None) == (built.held is None)
    if taken.held is not None:
        np.testing.assert_array_equal(taken.held.owner, built.held.owner)
    for one in (taken, built, problem):
        one.destroy()


@pytest.mark.parametrize("name", ["face", "pocket", "round"])
def test_the_whole_is_its_half_twice(name):
    """Faces made for cavities too."""
    found = solve(load_scene(*FILMS[name]).with_shape((33, 35)), method="active-set", nested=False)
    problem, scene = found.problem, load_scene(*FILMS[name]).with_shape((33, 35))
    dry = Dry(state_of(problem, found.fields["p"], found.fields["r"]), problem.grid)
    model, shape = film_part.Part(scene, "mirror", problem).own
    half = replace(model, dry=dry).build(shape)
    whole = replace(scene.model, dry=dry).build(scene.shape)
    alike(doubled(half.scheme), whole.scheme)
    for one in (half, whole, found):
        one.destroy()


@pytest.mark.parametrize("name", ["pocket", "ring of lines", "round"])
def test_the_problem_that_half_of_was_solved_is_whole(name):
    scene = load_scene(*FILMS[name]).with_shape((33, 35))
    reduced, whole = solve(scene), solve(scene, reduction=False)
    assert reduced.settings["details"]["reduction"] == "mirror" and "revised" in reduced.settings["details"]
    alike(reduced.problem.scheme, whole.problem.scheme)
    reduced.destroy()
    whole.destroy()


@pytest.mark.parametrize("form", ["round", "square"])
def test_faces_made_for_cavities_are_as_symmetric_as_the_film(form, monkeypatch):
    """On 239 points looks lie on rims, by rounding on the one side of it here and on the other in the mirror image."""
    found, part_of = [], film_part.part_of
    monkeypatch.setattr(film_part, "part_of", lambda *given: found.append(part_of(*given)) or found[-1])
    scene = load_scene("dimpled_pad", {"film.dimples.form": form}).with_shape((239, 239))
    half, whole = solve(scene), solve(scene, reduction=False)
    assert [part.kind for part in found] == ["mirror", "mirror"]
    assert half.numbers["pressure_integral"] == pytest.approx(whole.numbers["pressure_integral"], rel=1e-6)
    half.destroy()
    whole.destroy()


@pytest.mark.parametrize("shape", [(120, 39), (240, 79), (250, 61), (181, 40)])
@pytest.mark.parametrize(
    "grooves", [{}, {"angle_deg": 12.0, "depth_um": 60.0, "count": 7}, {"angle_deg": 62.0, "depth_um": 4.0}]
)
def test_herringbones_are_as_symmetric_as_their_film(shape, grooves):
    """What faces lead beside slanted edges differs from its mirror image by 5e-11: one rank had not found them symmetric."""
    keys = {f"film.herringbone.{name}": value for name, value in grooves.items()}
    scene = load_scene("herringbone_journal", keys | {"attitude_deg": 50.0}).with_shape(shape)
    problem = scene.build()
    assert film_part.part_of(scene, problem).kind == "mirror"
    problem.destroy()


@pytest.mark.parametrize("method", ["auto", "fas"])
@pytest.mark.parametrize("ny", [22, 23])
def test_films_with_a_supply_across_their_middle_are_halved(ny, method, monkeypatch):
    """The cells that it holds on the middle line of an even number have no neighbour there."""
    monkeypatch.setattr("lcp_lube.drivers.symmetry.why_not", lambda ask: "" if ask.reduction else "no reduction was asked for")
    scene = load_scene(*FILMS["supply"]).with_shape((31, ny))
    half, whole = solve(scene, method=method), solve(scene, method=method, reduction=False)
    assert half.converged and half.settings["details"]["reduction"] == "mirror"
    for name, value in whole.numbers.items():
        if isinstance(value, float):
            assert half.numbers[name] == pytest.approx(value, rel=1e-8, abs=1e-12), name
    half.destroy()
    whole.destroy()
