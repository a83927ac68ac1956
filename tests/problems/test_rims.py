"""Round edges: faces that they cut, for full and for cavitated dimples."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lcp_lube import load_scene, solve
from lcp_lube.problems.film.lubrication import LubricationProblem
from lcp_lube.problems.film.rims import cut_faces
from lcp_lube.problems.film.shapes import DimpleArray


def half_plane(x0: float):
    """A film of 1, beyond x0 (along t) of 2, and the distance from that edge, negative in the thick part."""
    return (lambda t, s: np.where(t + 0.0 * s < x0, 1.0, 2.0)), (lambda t, s: x0 - t + 0.0 * s)


@pytest.mark.parametrize("cavity, C, H", [(0.0, 1 / (0.25 + 0.75 / 8), (0.25 + 0.75 / 4) / (0.25 + 0.75 / 8)), (1.0, 4.0, 1.0)])
def test_series_where_full_the_thin_part_alone_before_a_cavity(cavity, C, H):
    film, rim = half_plane(0.25)
    dry = np.array([[False, bool(cavity)]])
    cut, cubes, films = cut_faces(film, [rim], np.array([0.0, 1.0]), np.zeros(1), np.ones(1), dry, True)
    assert cut.all()
    np.testing.assert_allclose(cubes, [C], rtol=1e-12)
    np.testing.assert_allclose(films, [H], rtol=1e-12)


def test_where_the_film_thins_again_both_parts_resist():
    """Behind a cavity the film is full before it thins: resistances in series, whatever lies before."""
    film, rim = half_plane(0.25)
    back = (lambda t, s: film(1.0 - t, s)), (lambda t, s: rim(1.0 - t, s))
    dry = np.array([[True, False]])
    _, cubes, _ = cut_faces(back[0], [back[1]], np.array([0.0, 1.0]), np.zeros(1), np.ones(1), dry, True)
    np.testing.assert_allclose(cubes, [1 / (0.25 + 0.75 / 8)], rtol=1e-12)


@pytest.mark.parametrize(
    "before, C", [((True, False), 0.64 / (0.25 + 0.75 / 8) + 0.36 * (0.25 + 8 * 0.75)), ((False, False), None)]
)
def test_where_a_film_reforms_faces_across_the_flow_lead_along_the_rim(before, C):
    """Behind a cavity: resistances in series by the square of the normal's part across the flow, side by side by the rest."""
    film, rim = half_plane(0.25)
    slanted = lambda t, s: 0.8 * rim(t, s) + 0.6 * s  # noqa: E731
    dry = np.array([before, (False, False)])
    _, cubes, _ = cut_faces(film, [slanted], np.array([0.0, 1.0]), np.zeros(1), np.ones(1), dry, False)
    np.testing.assert_allclose(cubes, [C or 1 / (0.25 + 0.75 / 8)], rtol=1e-9)


@pytest.mark.parametrize("dry, C", [((True, False), 0.5 * (1 + 8)), ((False, False), 8.0)])
def test_beside_a_cavity_faces_across_the_flow_have_the_film_of_their_whole_width(dry, C):
    """A rim along the face, beside the line of points: lines on both sides of it, side by side."""
    film, rim = lambda t, s: np.where(s + 0.0 * t < 0.0, 2.0, 1.0), lambda t, s: s + 0.0 * t
    cavity = np.array([(False, False), dry])
    cut, cubes, _ = cut_faces(film, [rim], np.array([0.0, 1.0]), np.array([-1e-9]), np.ones(1), cavity, False)
    np.testing.assert_allclose(cubes, np.full(np.count_nonzero(cut), C), rtol=1e-9)


def dome_face(start: float, end: float, states: list[float]) -> tuple[Any, Any, Any]:
    """C and H of the face between two points on the middle line of a dome of radius 0.6 around 1, and the film there."""
    dome = DimpleArray("dome", 2.0, 1.2, 1, 1, (0.0, 2.0), (0.0, 2.0))
    film = lambda t, s: 1.0 + dome(t, s)  # noqa: E731
    state = np.array([states])
    _, cubes, films = cut_faces(film, [dome.rim], np.array([start, end]), np.ones(1), np.full(1, 0.2), state, True)
    return cubes, films, film(start + (end - start) * (np.arange(10_000) + 0.5) / 10_000, np.ones(1))


@pytest.mark.parametrize("driven", [0.0, 1e-3, 0.01, 0.1, 1.0])
@pytest.mark.parametrize("start", [0.3, 0.33, 0.39])
def test_into_a_cavity_a_dome_lets_through_what_its_front_does(start, driven):
    """Of all places where the film may end, p = 0 there, the front lets the least through; driven: p/(6 mu U)."""
    cubes, films, h = dome_face(start, start + 0.2, [-driven, 1.0])
    least = np.min((driven + np.cumsum(h**-2) * 2e-5) / (np.cumsum(h**-3) * 2e-5))
    assert films[0] + cubes[0] * driven / 0.2 == pytest.approx(least, rel=3e-3)


def test_in_a_dome_the_film_resists_in_series_where_both_points_are_full():
    cubes, films, h = dome_face(1.2, 1.4, [-1.0, -2.0])
    assert cubes == pytest.approx(1.0 / np.mean(h**-3), rel=2e-3)
    assert films == pytest.approx(np.mean(h**-2) / np.mean(h**-3), rel=1e-3)
    assert dome_face(1.2, 1.4, [1.0, -1.0])[0].size == 0


def test_distance_from_the_rim():
    dimples = DimpleArray("round", 1e-6, 1.2, 2, 1, (0.0, 4.0), (0.0, 2.0))
    found = dimples.rim(np.array([1.0, 1.6, 3.0, 2.0]), np.array([1.0, 1.0, 0.0, 1.0]))
    np.testing.assert_allclose(found, [-0.6, 0.0, 0.4, 0.4], rtol=0, atol=1e-12)


def pad(n: int, form: str = "round", **changes) -> object:
    return load_scene("dimpled_pad", {"nx": n, "ny": n, "film.dimples.form": form, **changes})


@pytest.mark.parametrize("form, value", [("round", 7.0695), ("dome", 7.2375)])
def test_round_dimples(form, value):
    """The load above p_c, N, to 1 % at 80 points a side; the values are those of 640 to 1280 points."""
    for n in (79, 80, 95):
        solution = solve(pad(n, form))
        assert solution.converged and solution.numbers["pressure_integral"] == pytest.approx(value, rel=1e-2), n
        assert isinstance(solution.problem, LubricationProblem) and solution.problem.dry is not None
        solution.destroy()


@pytest.mark.parametrize("form, value, most", [("round", 7.0775, (0.36, 0.18, 0.075)), ("dome", 7.2370, (0.21, 0.07, 0.036))])
def test_the_load_over_many_grids(form, value, most):
    """Its error's root mean square, in % of the load above p_c, near 80, 160 and 320 points a side; 0.43, 0.19, 0.09 (round)
    before faces across the flow were looked at side by side beside cavities, 0.93, 0.28, 0.10 (domes) without their fronts."""
    for sizes, limit in zip((range(76, 85), range(152, 169, 2), range(300, 341, 5)), most, strict=True):
        errors = []
        for n in sizes:
            with solve(pad(n, form)) as solution:
                errors.append(100.0 * (solution.numbers["pressure_integral"] / value - 1.0))
        assert np.sqrt(np.mean(np.square(errors))) < limit, errors


def test_a_full_film_is_left_as_it_is():
    """Below the speed at which it cavitates the pad of symmetric dimples carries the ambient pressure alone, exactly."""
    solution = solve(pad(50, U=0.05))
    assert solution.numbers["load"] == pytest.approx(0.0, abs=1e-8) and solution.problem.dry is None
    solution.destroy()


SUPPLY = {"shape": "hole", "at": [1e-5, 1e-5], "diameter": 1e-6, "restrictor": "capillary", "K": 1e-30, "p_s": 2e5}
TINY = {
    "law": {"fluid.barus": 1e-25},
    "shear": {"shear": {"law": "eyring", "tau_0": 1e15}},
    "heat": {"temperature": {"model": "energy", "T_in": 300.0, "beta": 1e-12}},
    "roughness": {"roughness": {"sigma": 1e-13}, "U": -1.0},
    "supply": {"supply": [SUPPLY]},
    "time": {"motion": {"t_end": 1e-5, "steps": 2}, "shear": {"law": "eyring", "tau_0": 1e15}},
}


@pytest.mark.parametrize("name", TINY)
def test_what_has_no_effect_changes_no_load(name):
    """Faces are made for the cavities whatever acts on the film: next to nothing leaves the load as it is without."""
    changes = {"film.dimples.columns": 2, "film.dimples.rows": 1, "film.dimples.size_mm": 4.0, "fluid.p_supply": 2e4}
    plain, other = pad(25, **changes, U=TINY[name].get("U", 1.0)), pad(25, **changes, **TINY[name])
    with solve(plain) as one, solve(other, model="full") as two:
        assert two.converged and one.settings["details"]["revised"] > 20
        assert two.numbers["load"] == pytest.approx(one.numbers["load"], rel=1e-8)
        assert two.numbers["friction"] == pytest.approx(one.numbers["friction"], rel=1e-8)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.1, 1e3), st.sampled_from([-1.0, 0.03, 1.0, 50.0]))
def test_coefficients_keep_the_form_for_any_cavities(seed, depth_um, U):
    """A symmetric M-matrix, -B with column sums >= 0, and a band, whatever points the faces are made for."""
    changes = {"nx": 13, "ny": 11, "film.dimples.columns": 2, "film.dimples.rows": 1, "film.dimples.size_mm": 4.0}
    scene = load_scene("dimpled_pad", {**changes, "film.dimples.form": "round", "film.dimples.depth_um": depth_um, "U": abs(U)})
    problem = scene.build()
    assert isinstance(problem, LubricationProblem)
    rng = np.random.default_rng(seed)
    other = problem.revised((rng.random(problem.size) < 0.5).astype(float))
    s = other.scheme
    np.testing.assert_array_equal(s.k_E[:, :-1], s.k_W[:, 1:])
    np.testing.assert_array_equal(s.k_N[:-1], s.k_S[1:])
    np.testing.assert_array_equal(-s.b_C[:, :-1], s.b_W[:, 1:])
    assert (np.stack([s.k_W, s.k_E, s.k_S, s.k_N, -s.b_C]) > 0).all()
    other.free_matrices()
    problem.destroy()
    solution = solve(scene, certify=True)
    assert solution.converged and solution.certificate.holds and solution.enclosure is not None and solution.enclosure.certified
    solution.destroy()


def test_methods_and_halves_agree():
    scene = load_scene("dimpled_pad", {"nx": 30, "ny": 21, "film.dimples.form": "round", "film.dimples.columns": 2, "U": 2.0})
    first = solve(scene, method="active-set")
    for how in ({}, {"method": "fas"}, {"method": "din"}, {"method": "fbn-a"}):
        other = solve(scene, **how)
        assert other.converged, how
        assert other.numbers["load"] == pytest.approx(first.numbers["load"], rel=1e-5), how
        other.destroy()
    turned = solve(scene.model_copy(update={"U": -2.0}))
    assert turned.numbers["load"] == pytest.approx(first.numbers["load"], rel=1e-8)
    turned.destroy()
    first.destroy()


@pytest.mark.parametrize("barrel", [-1e-10, 1e-10])
def test_a_film_that_leans_by_an_atom_is_the_same(barrel):
    """Faces beside a cavity that no edge crosses have no thin part, though the film varies along them: the load was 7 % off."""
    words = {"nx": 96, "ny": 31}
    with solve("herringbone_journal", **words) as level, solve("herringbone_journal", **words, barrel=barrel) as other:
        assert other.load == pytest.approx(level.load, rel=1e-4)
