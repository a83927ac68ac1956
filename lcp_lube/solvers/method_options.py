"""Options of a method: a frozen dataclass filled from names and values that a user typed."""

from dataclasses import fields
from typing import Any, TypeVar

from ..errors import InputError, nearest

T = TypeVar("T")


def make_options(kind: type[T], method: str, given: dict[str, Any]) -> T:
    """An options dataclass from a mapping; numbers are converted to the type of the field's default.

    Raises
    ------
    InputError : an unknown name, or a value of another type; the dataclass itself checks ranges.
    """
    known: dict[str, type] = {field.name: type(field.default) for field in fields(kind)}  # type: ignore[arg-type]
    values = {}
    for name, value in given.items():
        if name not in known:
            near = nearest(name, known) or f"; known are {', '.join(known)}"
            raise InputError(f"{method}.{name}: method {method} has no such option{near}")
        try:
            if known[name] is not str and isinstance(value, (str, bool)) and known[name] is not type(value):
                raise ValueError
            values[name] = known[name](value)
        except (TypeError, ValueError):
            raise InputError(f"{method}.{name} = {value}: a value of type {known[name].__name__} is needed") from None
    return kind(**values)
