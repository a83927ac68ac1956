"""Formulas in x and y: what they compute, and that nothing else of Python gets through."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcp_lube.errors import InputError
from lcp_lube.scenes.formula import Formula

X, Y = np.linspace(0.1, 0.9, 5)[None, :], np.linspace(0.1, 0.7, 4)[:, None]


@pytest.mark.parametrize(
    "text, value",
    [
        ("0.28 - 10*((x-.2)^2 + (y-.2)**2)", 0.28 - 10 * ((X - 0.2) ** 2 + (Y - 0.2) ** 2)),
        ("-x^2", -(X**2) + 0 * Y),
        (" .3 ", 0.3 + 0 * (X + Y)),
        ("1 if x < 0.5 else inf", np.where(X < 0.5, 1.0, np.inf) + 0 * Y),
        ("min(x, y) + max(x, y) - hypot(x, y)*sin(pi)", X + Y),
        ("where(x >= y, exp(log(x)), abs(-y))", np.where(X >= Y, X, Y)),
        ("9^9^9^9", np.full((4, 5), np.inf)),
    ],
)
def test_values(text, value):
    np.testing.assert_allclose(Formula(text)(X, Y), value, rtol=1e-14, atol=1e-14)


@given(st.floats(allow_nan=False))
def test_a_number_is_itself(value):
    assert (Formula(value)(X, Y) == value).all()


def test_no_value_is_nan_without_a_warning():
    assert np.isnan(Formula("sqrt(-1) + 0/0*x")(X, Y)).all()


@pytest.mark.parametrize(
    "text, said",
    [
        ("10((x-.2)^2)", "a [*] is missing after 10"),
        ("sqr(x)", "nearest is sqrt"),
        ("min(x)", "2 are needed"),
        ("z + 1", "z is not known"),
        ("x +", "not an expression"),
        ("x = 1", "not an expression"),
        ("", "not an expression"),
        ("(" * 500, "not an expression"),
        ("1" * 3000, "at most"),
        ("__import__('os').getcwd()", "not allowed"),
        ("x.real", "not allowed"),
        ("(lambda: 1)()", "not allowed"),
        ("[x for x in (1, 2)]", "not allowed"),
        ("'text'", "not allowed"),
        ("True", "not allowed"),
        ("1j", "not allowed"),
        ("x if y and 1 else 0", "not allowed"),
        ("0 < x < 1", "not allowed"),
    ],
)
def test_refused_in_one_line(text, said):
    with pytest.raises(InputError, match=said) as error:
        Formula(text)
    assert "\n" not in str(error.value)
