"""Options of a method: a frozen dataclass whose fields say what they allow, filled from names and values that a user typed."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, fields
from math import inf
from typing import Any, ClassVar, TypeVar

from ..errors import InputError, nearest

T = TypeVar("T", bound="MethodOptions")


def option(default: Any, allowed: Callable[[Any], bool], words: str, flag: str = "") -> Any:
    """A field with the values that it may have, and the words that tell a user who gave another.

    Parameters
    ----------
    flag : how the command line calls it, if not METHOD.NAME.
    """
    return field(default=default, metadata={"allowed": allowed, "words": words, "flag": flag})


def part(default: float) -> Any:
    return option(default, lambda value: 0 < value < 1, "allowed are numbers between 0 and 1")


def least(lowest: float, default: float) -> Any:
    return option(default, lambda value: value >= lowest, f"at least {lowest} is needed")


def positive(default: float, flag: str = "", why: str = "") -> Any:
    return option(default, lambda value: 0 < value < inf, f"a positive number is needed{why}", flag)


def one_of(default: str, names: Iterable[str], flag: str = "") -> Any:
    names = tuple(names)
    return option(default, lambda value: value in names, f"allowed are {', '.join(names)}", flag)


@dataclass(frozen=True)
class MethodOptions:
    """What all options dataclasses share: their method's name in messages, and the check of every field.

    Raises
    ------
    InputError : a value that its field does not allow.
    """

    method: ClassVar[str] = ""

    def __post_init__(self) -> None:
        for known in fields(self):
            value, says = getattr(self, known.name), known.metadata
            if says and not says["allowed"](value):
                name = f"{says['flag']} {value}" if says["flag"] else f"{self.method}.{known.name} = {value}"
                raise InputError(f"{name}: {says['words']}")


def make_options(kind: type[T], given: dict[str, Any]) -> T:
    """An options dataclass from a mapping; numbers are converted to the type of the field's default.

    Raises
    ------
    InputError : an unknown name, or a value of another type; the dataclass itself checks ranges.
    """
    known: dict[str, type] = {field.name: type(field.default) for field in fields(kind)}
    values, method = {}, kind.method
    for name, value in given.items():
        if name not in known:
            near = nearest(name, known) or (f"; known are {', '.join(known)}" if known else ", and no other")
            raise InputError(f"{method}.{name}: method {method} has no such option{near}")
        try:
            if known[name] is not str and isinstance(value, (str, bool)) and known[name] is not type(value):
                raise ValueError
            values[name] = known[name](value)
        except (TypeError, ValueError):
            raise InputError(f"{method}.{name} = {value}: a value of type {known[name].__name__} is needed") from None
    return kind(**values)
