"""Formulas in x and y from scene files and --set: read by a short list of what is allowed, evaluated on arrays."""

import ast
from collections.abc import Callable
from typing import Any

import numpy as np
from pydantic import BeforeValidator

from ..base.parallel import Array
from ..errors import InputError, nearest

CONSTANTS = {"pi": np.pi, "e": np.e, "inf": np.inf}
FUNCTIONS: dict[str, tuple[int, Callable[..., Any]]] = {
    **{name: (1, getattr(np, name)) for name in ("sqrt", "exp", "log", "sin", "cos", "tan", "sinh", "cosh", "tanh", "abs")},
    **{name: (1, getattr(np, "arc" + name[1:])) for name in ("asin", "acos", "atan")},
    "sign": (1, np.sign),
    "floor": (1, np.floor),
    "hypot": (2, np.hypot),
    "min": (2, np.minimum),
    "max": (2, np.maximum),
    "where": (3, np.where),
}
BINARY: dict[type, Callable[..., Any]] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
    ast.Pow: np.power,
}
COMPARE: dict[type, Callable[..., Any]] = {
    ast.Lt: np.less,
    ast.LtE: np.less_equal,
    ast.Gt: np.greater,
    ast.GtE: np.greater_equal,
}
MAX_LENGTH = 2000


class Formula:
    """A function of x and y, '0.28 - 10*((x - 0.2)^2 + (y - 0.2)^2)' say, or a constant.

    Allowed: numbers, x, y, pi, e, inf; + - * / and ^ or ** for powers; < <= > >=; `a if x < 0.5 else b`; the names in
    FUNCTIONS. Nothing else of Python is evaluated.

    Raises
    ------
    InputError : anything else in the text.
    """

    def __init__(self, text: str | float):
        self.text = str(text)
        if len(self.text) > MAX_LENGTH:
            raise InputError(f"formula of {len(self.text)} characters: at most {MAX_LENGTH} are allowed")
        try:
            tree = ast.parse(self.text.strip().replace("^", "**"), mode="eval").body
            self._function = _function(tree)
        except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
            if isinstance(error, InputError):
                raise InputError(f"formula {self.text[:60]!r}: {error}") from None
            raise InputError(f"formula {self.text[:60]!r}: not an expression in x and y") from None

    def __call__(self, x: Array, y: Array) -> Array:
        """Values on the points where x and y meet (they broadcast); NaN or inf where the formula has no value."""
        x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
        with np.errstate(all="ignore"):
            return np.array(np.broadcast_to(self._function(x, y), x.shape), dtype=float)

    def __repr__(self) -> str:
        return f"Formula({self.text!r})"

    def __reduce__(self) -> tuple[type, tuple[str]]:
        """Pickled as its text."""
        return Formula, (self.text,)


def _check(value: Any) -> Any:
    """A number as a number, a text as it is if it is a formula; pydantic prints what InputError says."""
    if isinstance(value, bool) or not isinstance(value, (int, float, str)) or value != value:
        raise InputError("a number or a formula in x and y, as text, is needed")
    if isinstance(value, str):
        Formula(value)
        return value
    return float(value)


# For fields of scenes: `v_lower: FormulaText = 0.0`.
FormulaText = BeforeValidator(_check)


def _function(node: ast.expr) -> Callable[[Array, Array], Any]:
    """The syntax tree as nested functions of x and y."""
    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            number = float(value)  # never Python integers: 9^9^9 must overflow, not fill the memory
            return lambda x, y: number
        case ast.Name(id="x"):
            return lambda x, y: x
        case ast.Name(id="y"):
            return lambda x, y: y
        case ast.Name(id=name) if name in CONSTANTS:
            return lambda x, y: CONSTANTS[name]
        case ast.Name(id=name):
            near = nearest(name, [*CONSTANTS, *FUNCTIONS])
            raise InputError(f"{name} is not known; allowed are x, y, {', '.join(CONSTANTS)}{near}")
        case ast.UnaryOp(op=ast.USub() | ast.UAdd() as op, operand=operand):
            inner = _function(operand)
            return (lambda x, y: -inner(x, y)) if isinstance(op, ast.USub) else inner
        case ast.BinOp(left=left, op=op, right=right) if type(op) in BINARY:
            return _apply(BINARY[type(op)], [left, right])
        case ast.Compare(left=left, ops=[op], comparators=[right]) if type(op) in COMPARE:
            return _apply(COMPARE[type(op)], [left, right])
        case ast.IfExp(test=test, body=body, orelse=other):
            return _apply(np.where, [test, body, other])
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
            if name not in FUNCTIONS:
                raise InputError(f"{name} is no function; allowed are {', '.join(FUNCTIONS)}{nearest(name, FUNCTIONS)}")
            count, function = FUNCTIONS[name]
            if len(arguments) != count:
                raise InputError(f"{name} has {len(arguments)} arguments; {count} are needed")
            return _apply(function, arguments)
        case ast.Call(func=ast.Constant() | ast.BinOp() as func):
            raise InputError(f"a * is missing after {ast.unparse(func)}")
    raise InputError(f"{ast.unparse(node)} is not allowed; allowed are numbers, x, y, + - * / ^ and {', '.join(FUNCTIONS)}")


def _apply(function: Callable[..., Any], arguments: list[ast.expr]) -> Callable[[Array, Array], Any]:
    inner = [_function(argument) for argument in arguments]
    return lambda x, y: function(*(part(x, y) for part in inner))
