"""Gap shapes against their printed formulas."""

import numpy as np
import pytest
from films import CD, DC, WAVES, Wave
from hypothesis import given
from hypothesis import strategies as st

FORMS = (CD, DC)
H_MIN, H_MAX, L = 15e-6, 25e-6, 0.1


@pytest.mark.parametrize("start, length", [(0.0, L), (3 * L / 8, L / 4)])
def test_printed_formulas(start, length):
    x = start + length * np.linspace(0, 1, 101)
    s = (x - start) / length
    sinusoid = (H_MAX + H_MIN) / 2 + (H_MAX - H_MIN) / 2 * np.cos(2 * np.pi * s)
    parabola = H_MIN + (H_MAX - H_MIN) * (2 * s - 1) ** 2
    for shape, h in (("sinusoid", sinusoid), ("parabola", parabola)):
        np.testing.assert_allclose(Wave(shape, CD, H_MIN, H_MAX, start, length)(x), h, rtol=1e-13)
        np.testing.assert_allclose(Wave(shape, DC, H_MIN, H_MAX, start, length)(x), H_MIN + H_MAX - h, rtol=1e-13)


@given(
    st.sampled_from(WAVES),
    st.sampled_from(FORMS),
    st.floats(1e-9, 1e-3),
    st.floats(1, 1e4),
    st.floats(-1, 1),
    st.floats(1e-6, 1),
    st.lists(st.floats(-3, 3), min_size=1),
)
def test_range_and_ends(shape, form, h_min, ratio, start, length, x):
    film = Wave(shape, form, h_min, ratio * h_min, start, length)
    h = film(x)
    assert h.shape == (len(x),)
    assert np.all((h >= film.h_min) & (h <= film.h_max * (1 + 1e-15)))
    end, middle = (film.h_max, film.h_min) if form == CD else (film.h_min, film.h_max)
    np.testing.assert_allclose(film([-10, 10]), end, rtol=1e-15)
    np.testing.assert_allclose(Wave(shape, form, h_min, ratio * h_min, 0, length)(length / 2), middle, rtol=1e-15)


@pytest.mark.parametrize("shape", WAVES)
def test_no_cancellation_next_to_h_min(shape):
    """1e4 h_min and K + a cos: twelve digits at most. Here all of them, at the end of the D-C wave."""
    s = 2.0**-20
    expected = {"sinusoid": np.sin(np.pi * s) ** 2, "parabola": 4 * s * (1 - s)}[shape]
    h = Wave(shape, DC, 1e-6, 1e-2, 0, 1)([s])[0]
    assert h == pytest.approx(1e-6 + (1e-2 - 1e-6) * expected, rel=1e-15)


def test_broadcasts_over_y():
    film = Wave("sinusoid", CD, H_MIN, H_MAX, 3 * L / 8, L / 4)
    x, y = np.linspace(0, L, 7), np.linspace(0, L, 5)[:, None]
    h = film(x, y)
    assert h.shape == (5, 7) and h.flags.writeable
    assert np.all(h == film(x))
    assert film(0.05).shape == () and film(0.05) == H_MIN


def test_breakpoints():
    assert Wave("parabola", DC, H_MIN, H_MAX, 1.0, 2.0).breakpoints() == (1.0, 2.0, 3.0)
