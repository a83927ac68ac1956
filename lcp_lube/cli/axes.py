"""The axes of a sweep: --vary's grammar, the points of their product, and the chains that these fall into."""

import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from math import isfinite, prod
from typing import Any

import numpy as np

from ..base.quantity import Quantity, in_own, quantity
from ..errors import InputError

MOST_POINTS = 100_000  # a slip of the pen (1:2:1e9) is refused before a list of it is made


@dataclass(frozen=True)
class Axis:
    """A key of the scene and the values it takes."""

    key: str
    values: tuple[Any, ...]
    unit: str = ""  # of all values, in SI base units, where units were given

    def given(self, value: Any) -> Any:
        """The value as the scene is to read it, which checks its unit."""
        return f"{value!r} {self.unit}" if self.unit else value


def parse_axis(text: str) -> Axis:
    """KEY=FROM:TO:N (N values, both ends among them), KEY=FROM:TO:N:log (at equal ratios) or KEY=A,B,C.

    Whole numbers stay whole where FROM, TO and the step are.
    """
    key, equals, values = (part.strip() for part in text.partition("="))
    forms = "KEY=FROM:TO:N, KEY=FROM:TO:N:log or KEY=A,B,C is needed"
    if not (key and equals and values):
        raise InputError(f"--vary {text}: {forms}")
    match [part.strip() for part in values.split(":")]:
        case [listed]:
            return _listed(text, key, listed)
        case [start, end, count, *log] if log in ([], ["log"]):
            pass
        case _:
            raise InputError(f"--vary {text}: {forms}")
    start, end = (_own(key, word) for word in (start, end))
    first, last = quantity(start), quantity(end)
    if first is None or last is None or not re.fullmatch(r"[+-]?\d{1,9}", count):
        raise InputError(f"--vary {text}: {forms}")
    a, b, n, unit = first.value, last.value, int(count), _common(text, [first, last])
    if not (isfinite(a) and isfinite(b) and isfinite(b - a) and 1 <= n <= MOST_POINTS):
        raise InputError(f"--vary {text}: FROM and TO must be finite, N from 1 to {MOST_POINTS}")
    if log:
        if min(a, b) <= 0:
            raise InputError(f"--vary {text}: equal ratios need FROM > 0 and TO > 0")
        return Axis(key, tuple(_rounded(number) for number in np.geomspace(a, b, n)), unit)
    numbers = np.linspace(a, b, n)
    whole = all(end.lstrip("+-").isdigit() for end in (start, end)) and bool(np.all(numbers == np.rint(numbers)))
    return Axis(key, tuple(int(number) if whole else _rounded(number) for number in numbers), unit)


def _own(key: str, word: str) -> str:
    """speed_rpm = 1000 rpm without the unit, which the key has named."""
    return word if (number := in_own(word, key)) is None else repr(number)


def _common(text: str, found: Sequence[Quantity]) -> str:
    """The unit of quantities that belong together; empty if they have none."""
    if len({one.dimension for one in found if one.unit}) > 1 or len({one.unit for one in found if one.value}) > 1:
        raise InputError(f"--vary {text}: values of one dimension are needed, all with a unit or none")
    return next((one.text.partition(" ")[2] for one in found if one.unit), "")


def _rounded(number: float) -> float:
    """0.3, not 0.30000000000000004."""
    return float(f"{number:.14g}")


def _listed(text: str, key: str, values: str) -> Axis:
    """The values of A,B,C as TOML, as quantities, or as bare words."""
    try:
        return Axis(key, tuple(tomllib.loads(f"values = [{values}]")["values"]))
    except (ValueError, RecursionError):
        pass
    words = [_own(key, value.strip()) for value in values.split(",")]
    found = [one for word in words if (one := quantity(word)) is not None]
    if len(found) < len(words):
        return Axis(key, tuple(words))
    return Axis(key, tuple(one.value for one in found), _common(text, found))


def points(axes: Sequence[Axis], read: bool = False) -> list[dict[str, Any]]:
    """Each point of the product, the last axis moving fastest; read: as scenes read them, units with their values."""
    values = product(*([axis.given(value) if read else value for value in axis.values] for axis in axes))
    return [dict(zip((axis.key for axis in axes), point, strict=True)) for point in values]


def chains(axes: Sequence[Axis], warm: bool) -> list[range]:
    """The points' numbers in pieces that do not need one another: lines along the last axis, or each point by itself."""
    length = len(axes[-1].values) if warm else 1
    return [range(first, first + length) for first in range(0, prod(len(axis.values) for axis in axes), length)]


def check(axes: Sequence[Axis]) -> None:
    """Refuse a key that is given twice, and too many points."""
    for k, axis in enumerate(axes):
        if axis.key in [other.key for other in axes[:k]]:
            raise InputError(f"--vary {axis.key}: given twice")
    if (count := prod(len(axis.values) for axis in axes)) > MOST_POINTS:
        raise InputError(f"--vary: {count} points; at most {MOST_POINTS} are allowed")
