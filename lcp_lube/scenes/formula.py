"""Formulas in x and y, or in time, from scene files and --set: read by a short list of what is allowed, evaluated on arrays."""

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
    "mod": (2, np.mod),
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
MAX_LENGTH = 2000  # characters: longer than any film that a person writes


class Formula:
    """A function of x and y, '0.28 - 10*((x - 0.2)^2 + (y - 0.2)^2)' say, or a constant.

    names : what it may depend on; 't' is the time.

    Allowed: numbers, these names, pi, e, inf; + - * / and ^ or ** for powers; < <= > >=; `a if x < 0.5 else b`; the names in
    FUNCTIONS. Nothing else of Python is evaluated.

    Raises
    ------
    InputError : anything else in the text.
    """

    def __init__(self, text: str | float, names: tuple[str, ...] = ("x", "y")):
        self.text, self.names = str(text), names
        if len(self.text) > MAX_LENGTH:
            raise InputError(f"formula of {len(self.text)} characters: at most {MAX_LENGTH} are allowed")
        try:
            tree = ast.parse(self.text.strip().replace("^", "**"), mode="eval").body
            self._function = _function(tree, names)
        except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
            if isinstance(error, InputError):
                raise InputError(f"formula {self.text[:60]!r}: {error}") from None
            raise InputError(f"formula {self.text[:60]!r}: not an expression in {' and '.join(names)}") from None
        self.depends = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)} & {*names}

    def __call__(self, x: Array, y: Array, t: float = 0.0) -> Array:
        """Values on the points where x and y meet (they broadcast); NaN or inf where the formula has no value."""
        x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
        with np.errstate(all="ignore"):  # parts of x alone are made once for all y
            values = self._function({"x": x, "y": y, "t": np.float64(t)})
            return np.array(np.broadcast_to(values, np.broadcast_shapes(x.shape, y.shape)), dtype=float)

    def __repr__(self) -> str:
        return f"Formula({self.text!r})"

    def __reduce__(self) -> tuple[type, tuple[str, tuple[str, ...]]]:
        """Pickled as its text."""
        return Formula, (self.text, self.names)


def _check(value: Any, names: tuple[str, ...] = ("x", "y")) -> Any:
    """A number as a number, a text as it is if it is a formula; pydantic prints what InputError says."""
    if isinstance(value, bool) or not isinstance(value, (int, float, str)) or value != value:
        raise InputError(f"a number or a formula in {' and '.join(names)}, as text, is needed")
    if isinstance(value, str):
        Formula(value, names)
        return value
    return float(value)


# For fields of scenes: `v_lower: FormulaText = 0.0`.
FormulaText = BeforeValidator(_check)
TimeText = BeforeValidator(lambda value: _check(value, ("t",)))  # of t alone


def _function(node: ast.expr, names: tuple[str, ...]) -> Callable[[dict[str, Any]], Any]:
    """The syntax tree as nested functions of the values of `names`."""
    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            number = float(value)  # never Python integers: 9^9^9 must overflow, not fill the memory
            return lambda at: number
        case ast.Name(id=name) if name in names:
            return lambda at: at[name]
        case ast.Name(id=name) if name in CONSTANTS:
            return lambda at: CONSTANTS[name]
        case ast.Name(id=name):
            near = nearest(name, [*CONSTANTS, *FUNCTIONS])
            raise InputError(f"{name} is not known; allowed are {', '.join([*names, *CONSTANTS])}{near}")
        case ast.UnaryOp(op=ast.USub() | ast.UAdd() as op, operand=operand):
            inner = _function(operand, names)
            return (lambda at: -inner(at)) if isinstance(op, ast.USub) else inner
        case ast.BinOp(left=left, op=op, right=right) if type(op) in BINARY:
            return _apply(BINARY[type(op)], [left, right], names)
        case ast.Compare(left=left, ops=[op], comparators=[right]) if type(op) in COMPARE:
            return _apply(COMPARE[type(op)], [left, right], names)
        case ast.IfExp(test=test, body=body, orelse=other):
            return _apply(np.where, [test, body, other], names)
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
            if name not in FUNCTIONS:
                raise InputError(f"{name} is no function; allowed are {', '.join(FUNCTIONS)}{nearest(name, FUNCTIONS)}")
            count, function = FUNCTIONS[name]
            if len(arguments) != count:
                raise InputError(f"{name} has {len(arguments)} arguments; {count} are needed")
            return _apply(function, arguments, names)
        case ast.Call(func=ast.Constant() | ast.BinOp() as func):
            raise InputError(f"a * is missing after {ast.unparse(func)}")
    allowed = f"numbers, {', '.join(names)}, + - * / ^ and {', '.join(FUNCTIONS)}"
    raise InputError(f"{ast.unparse(node)} is not allowed; allowed are {allowed}")


def _apply(function: Callable[..., Any], arguments: list[ast.expr], names: tuple[str, ...]) -> Callable[[dict[str, Any]], Any]:
    inner = [_function(argument, names) for argument in arguments]
    return lambda at: function(*(part(at) for part in inner))
