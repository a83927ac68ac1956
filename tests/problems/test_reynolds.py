"""The box scheme: what its matrices are, what it conserves, and the facts that hold between its three forms."""

from dataclasses import replace

import numpy as np
import pytest
from films import MU, FilmScene, Knots, L, U, dense, knots, make_problem, pressures, schemes, shapes
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from lcp_lube import InputError, load_scene, solve
from lcp_lube.solvers.newton import Stopping

SMALL = settings(max_examples=40, deadline=None)


def parts(size):
    """theta in [0, 1] at every point, with the ends often."""
    return arrays(float, size, elements=st.one_of(st.sampled_from([0.0, 1.0]), st.floats(0, 1)))


def is_column_dominant(M):
    """Off-diagonal entries <= 0 < diagonal, column sums >= 0 up to rounding."""
    diagonal = np.diag(M)
    off = M - np.diag(diagonal)
    return (off <= 0).all() and (diagonal > 0).all() and (M.sum(axis=0) >= -1e-13 * diagonal).all()


@SMALL
@given(shapes, knots(), pressures)
def test_A_is_a_symmetric_positive_definite_M_matrix(shape, film, p_sides):
    problem = make_problem(shape, film, p_sides=p_sides)
    A = dense(problem.A)
    np.testing.assert_allclose(A, A.T, rtol=1e-13)
    assert is_column_dominant(A)
    assert np.linalg.eigvalsh(A).min() > 0
    problem.destroy()


@SMALL
@given(shapes, knots(), schemes, st.data())
def test_any_mix_of_columns_is_a_nonsingular_M_matrix(shape, film, scheme, data):
    """J(theta) = A diag(theta) - B diag(1 - theta): A and -B are its ends."""
    problem = make_problem(shape, film, scheme)
    A, B, n = dense(problem.A), dense(problem.B), problem.size
    theta = data.draw(parts(n))
    assert is_column_dominant(-B)
    scaled = np.sqrt(np.diag(A) * -np.diag(B))  # both kinds of columns of like size, or the inverse drowns in rounding
    A, B = A * (scaled / np.diag(A)), B * (scaled / -np.diag(B))
    J = A * theta - B * (1 - theta)
    assert is_column_dominant(J)
    inverse = np.linalg.inv(J)
    assert inverse.min() >= -1e-11 * inverse.max()
    problem.destroy()


@SMALL
@given(shapes, knots(), schemes, pressures, st.data())
def test_rows_telescope_to_the_boundary_flows(shape, film, scheme, p_sides, data):
    """Whatever p and r are, the sum of the balances is what leaves minus what enters."""
    problem = make_problem(shape, film, scheme, p_sides)
    p = data.draw(arrays(float, problem.size, elements=st.floats(0, 10)))
    r = data.draw(arrays(float, problem.size, elements=st.floats(0, 1)))
    west, east, south, north = problem.boundary_flows(p, r)
    balance = problem.flow(p, r)
    size = np.abs(problem.scheme.k_W).max() * (1 + p.max()) + U * problem.scheme.h.max()
    assert balance.sum() == pytest.approx(east - west + north - south, abs=1e-12 * size * problem.size)
    problem.destroy()


class MiddleScene(FilmScene):
    """Fluxes from the film half-way between two points, in 1D too."""

    @property
    def model(self):
        return replace(super().model, integrals=False)


def found(film, shape=(40,), kind=FilmScene, **data):
    """p and r of a scene with any film, from the method that ends at the exact discrete solution."""
    names = dict(zip(("nx", "ny"), shape, strict=False))
    scene = kind.of(film, dimension=len(shape), **names, **data)
    solution = solve(scene, method="active-set", recipe="superlu", nested=False)
    assert solution.converged, solution.message
    p, r = solution.fields["p"].reshape(shape[::-1]), solution.fields["r"].reshape(shape[::-1])
    h = solution.problem.scheme.h.reshape(shape[::-1])
    solution.destroy()
    return p, r, h


@settings(max_examples=25, deadline=None)
@given(knots(10.0), st.sampled_from([0.0, 1e6]), st.sampled_from([0.0, 2e5]))
def test_nodal_and_face_have_the_same_pressure_in_1d(film, p_a, p_b):
    """Their void fractions carry the same flow: h_i r_i and h_{i+1/2} r_i. With 'face' no density is negative."""
    p, r, h = found(film, scheme="nodal", p_a=p_a, p_b=p_b)
    p_face, r_face, _ = found(film, kind=MiddleScene, scheme="face", p_a=p_a, p_b=p_b)
    scale = max(p.max(), 1.0)  # p ~ 6 mu U L/h^2 is some 1000 MPa before it cancels
    np.testing.assert_allclose(p_face, p, rtol=0, atol=1e-9 * scale)
    x = (np.arange(p.size) + 1.5) * L / (p.size + 1)
    np.testing.assert_allclose(film(x) * r_face, h * r, rtol=0, atol=1e-9 * h.max())
    assert r_face.min() >= -1e-12 and r_face.max() < 1


def test_a_step_makes_nodal_densities_negative_and_face_ones_not():
    step = Knots((5e-6, 50e-6))  # a ramp so steep within one cell that it is a step

    def film(x, y=0.0):
        return np.where(np.asarray(x) < L / 2, step.heights[0], step.heights[1]) + 0 * np.asarray(y)

    assert found(film, scheme="nodal")[1].max() > 1
    assert found(film, scheme="face")[1].max() < 1


@settings(max_examples=15, deadline=None)
@given(knots(5.0), schemes)
def test_flow_is_one_constant_along_a_line(film, scheme):
    """A solution's flow is the same through both ends: nothing is lost in the cavity."""
    scene = FilmScene.of(film, n=30, scheme=scheme, p_a=1e6)
    solution = solve(scene, method="active-set", recipe="superlu")
    west, east, *_ = solution.problem.boundary_flows(solution.fields["p"], solution.fields["r"])
    assert solution.converged and west == pytest.approx(east, rel=1e-10)
    solution.destroy()


@pytest.mark.parametrize("scheme", ["nodal", "face", "upwind"])
@pytest.mark.parametrize("shape", [(17,), (7, 6)])
def test_constant_film_has_a_linear_pressure(scheme, shape):
    p_sides = {"p_a": 3e6, "p_b": 1e6}
    if len(shape) == 1:
        p, r, _ = found(Knots((2e-5,)), shape, scheme=scheme, **p_sides)
        np.testing.assert_allclose(p[:], 3 - 2 * (np.arange(17) + 1) / 18, rtol=1e-12)
    else:  # equal pressures all round: the constant
        p, r, _ = found(Knots((2e-5,)), shape, scheme=scheme, p_a=1e6, p_b=1e6, p_side=1e6)
        np.testing.assert_allclose(p, 1.0, rtol=1e-12)
    np.testing.assert_allclose(r, 0, atol=1e-14)


def test_mean_cubes_is_the_mean_of_the_nodal_cubes():
    film = Knots((1e-5, 3e-5))
    scene = FilmScene.of(film, n=1, mean_cubes=True)
    problem = scene.build()
    h = film(np.array([0.0, L / 2, L]))
    expected = 1e6 / (6 * MU) * (h[:-1] ** 3 + h[1:] ** 3) / 2 / (L / 2)
    np.testing.assert_allclose([problem.scheme.k_W[0, 0], problem.scheme.k_E[0, 0]], expected, rtol=1e-14)
    problem.destroy()


def din(changes, name="problem3"):
    solution = solve(load_scene(name, changes), method="din", system="full", recipe="superlu", nested=False)
    assert solution.converged
    fields = solution.fields["p"] * solution.problem.p_unit, solution.fields["r"], solution.iterations
    solution.destroy()
    return fields


@pytest.mark.parametrize("p_unit", [1e5, 3e6])
def test_another_pressure_unit_is_the_same_physics(p_unit):
    p, r, _ = din({"n": 40})
    p_other, r_other, _ = din({"n": 40, "p_unit": p_unit})
    np.testing.assert_allclose(p_other, p, rtol=0, atol=1e-6 * p.max())
    np.testing.assert_allclose(r_other, r, rtol=0, atol=1e-6)


def test_viscosity_and_pressures_scale_together():
    """mu, the supply pressure and the pressure unit doubled: the very same equations."""
    p, r, iterations = din({"n": 40})
    p_2, r_2, iterations_2 = din({"n": 40, "mu": 0.03, "p_a": 2e6, "p_b": 2e6, "p_unit": 2e6})
    np.testing.assert_array_equal(p_2, 2 * p)
    np.testing.assert_array_equal(r_2, r)
    assert iterations_2 == iterations


def test_lengths_scale():
    """L and h times 4: p over 4 (p ~ mu U L/h^2)."""
    p, r, _ = din({"n": 40}, "problem1")
    p_4, r_4, _ = din({"n": 40, "L": 0.4, "h_min": 60e-6, "h_max": 100e-6}, "problem1")
    np.testing.assert_allclose(4 * p_4, p, rtol=0, atol=1e-6 * p.max())
    np.testing.assert_allclose(r_4, r, rtol=0, atol=1e-6)


@pytest.mark.parametrize("method", ["din", "active-set"])
def test_problem_4_is_symmetric_in_y(method):
    solution = solve(load_scene("problem4", {"nx": 22, "ny": 13}), method=method, nested=False, stopping=Stopping(1e-10, 1e-8))
    assert solution.converged
    for field in (solution.fields["p"], solution.fields["r"]):
        field = field.reshape(13, 22)
        np.testing.assert_allclose(field, field[::-1], rtol=0, atol=1e-9 * field.max())
        assert np.ptp(field, axis=0).max() > 0.1 * field.max()  # it does depend on y
    solution.destroy()


@pytest.mark.parametrize(
    "changes, found_text",
    [
        ({"mu": 1e-300}, "mu = 1e-300 Pa s"),
        ({"U": 1e300}, "U = 1e\\+300 m/s"),
        ({"h_max": 1e300}, "film .* m"),
        ({"p_unit": 1e-300}, "p_unit = 1e-300 Pa"),
    ],
)
def test_data_that_overflow_are_refused(changes, found_text):
    with pytest.raises(InputError, match=rf"{found_text}.*flow balance with coefficients .* \(SI units\?\)$"):
        load_scene("problem1", changes).build()


def test_a_film_that_touches_is_refused():
    with pytest.raises(InputError, match=r"film 0 m at x = .* m: it must be positive everywhere"):
        make_problem((9,), Knots((1e-5, 0.0, 0.0, 0.0, 1e-5)))
