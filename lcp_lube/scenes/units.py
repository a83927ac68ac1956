"""Units of a scene's numbers: SI by itself, others by a suffix of the key (h_min_um = 15) or in the value (h_min = "15um")."""

from collections.abc import Iterable
from decimal import Decimal
from typing import Annotated, Any, ClassVar, Literal, Self, get_args, get_origin

from pydantic import BaseModel, ConfigDict, Field, model_validator

from ..base.quantity import in_own, in_si, quantity
from ..errors import InputError

SUFFIXES = {"_um": -6, "_mm": -3}


def measured(unit: str, default: Any, text: str, **limits: Any) -> Any:
    """A field whose number is in this SI unit, and may be given in others of its dimension."""
    what, semicolon, more = text.partition(";")
    return Field(default, description=f"{what}, {unit}{semicolon}{more}", json_schema_extra={"unit": unit}, **limits)


def metres(default: Any, text: str, **limits: Any) -> Any:
    """A field in metres."""
    return measured("m", default, text, **limits)


def stem(key: str) -> str:
    """The key without a unit's suffix."""
    return next((key.removesuffix(suffix) for suffix in SUFFIXES if key.endswith(suffix)), key)


class Measured(BaseModel):
    """A model whose numbers may be texts with a unit; lengths understand the suffixes of their keys too.

    Attributes
    ----------
    units : SI unit by field, of those that `measured` made, here or in a model above.
    lengths : the fields in metres.
    numbers : the fields that hold nothing but numbers, and whether these are whole; a dimensionless one has no unit.
    """

    # Schemas are made at first use: of all families a run needs one.
    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)
    units: ClassVar[dict[str, str]] = {}
    lengths: ClassVar[frozenset[str]] = frozenset()
    numbers: ClassVar[dict[str, bool]] = {}

    @classmethod
    def __pydantic_init_subclass__(cls, **kwargs: Any) -> None:
        super().__pydantic_init_subclass__(**kwargs)
        cls.units = {name: unit for name in cls.model_fields if (unit := _unit(cls, name))}
        cls.lengths = frozenset(name for name, unit in cls.units.items() if unit == "m")
        kinds = {field.alias or name: _leaves(field.annotation) for name, field in cls.model_fields.items()}
        cls.numbers = {name: float not in leaves for name, leaves in kinds.items() if leaves and leaves <= {float, int}}

    def __repr_args__(self) -> Iterable[tuple[str | None, Any]]:
        """What was given; the rest is defaults."""
        return [(name, value) for name, value in super().__repr_args__() if name in self.model_fields_set]

    @model_validator(mode="before")
    @classmethod
    def _in_si(cls, data: Any) -> Any:
        return cls.in_si_units(data)

    @model_validator(mode="after")
    def _checked(self) -> Self:
        self.check()
        return self

    def check(self) -> None:
        """Raise ValueError where keys contradict one another."""

    @classmethod
    def in_si_units(cls, data: Any) -> Any:
        """The data with every number in SI. What is no number stays as it is, for the fields to refuse.

        Raises
        ------
        ValueError : a unit of another dimension, or none; a key given twice, in two units.
        """
        if not isinstance(data, dict):
            return data
        out: dict[str, Any] = {}
        for key, value in data.items():
            name, power = key, 0
            if stem(key) != key and stem(key) in cls.lengths:
                name, power = stem(key), SUFFIXES[key[len(stem(key)) :]]
            if name in cls.numbers:
                # A suffix leaves no room for a unit in the value.
                value = _read(value, "" if power else cls.units.get(name, ""), cls.numbers[name], key)
                value = _scaled(value, power) if power else value
            if name in out:
                found = [other for other in data if stem(other) == name]
                raise ValueError(f"{' and '.join(found)} are both given: one of them is allowed")
            out[name] = value
        return out


def units_of(model: Measured, prefix: str = "") -> dict[str, str]:
    """The SI unit of every value that has one, by its path; entries of arrays of tables count from 1, as in --set."""
    found: dict[str, str] = {}
    for name, field in type(model).model_fields.items():
        value, key = getattr(model, name), f"{prefix}{field.alias or name}"
        if isinstance(value, Measured):
            found |= units_of(value, f"{key}.")
        elif isinstance(value, list):
            for k, item in enumerate(value, start=1):
                found |= units_of(item, f"{key}.{k}.") if isinstance(item, Measured) else {}
        if value is not None and name in model.units:
            found[key] = model.units[name]
    return found


def is_quantity(value: Any) -> bool:
    """Whether this is a text that begins with a number."""
    try:
        return isinstance(value, str) and quantity(value) is not None
    except InputError:
        return True  # and has a unit that is none


def _read(value: Any, unit: str, whole: bool, key: str) -> Any:
    """The number that a text says."""
    if isinstance(value, (list, tuple)):
        return [_read(item, unit, whole, key) for item in value]
    if whole and isinstance(value, float) and value.is_integer():
        return int(value)  # 1e3 is a whole number
    if not isinstance(value, str):
        return value
    try:
        number = in_own(value, key)
        number = in_si(value, unit) if number is None else number
    except InputError as error:
        raise ValueError(f"{key} = {value}: {error}") from None
    if number is None:
        return value
    return int(number) if whole and number.is_integer() else number


def _unit(model: type[BaseModel], name: str) -> str:
    """A field's unit; a model that only changes a default leaves it to the one above."""
    for one in model.__mro__:
        field = getattr(one, "model_fields", {}).get(name)
        extra = field.json_schema_extra if field is not None else None
        if isinstance(extra, dict) and "unit" in extra:
            return str(extra["unit"])
    return ""


def _leaves(annotation: Any) -> set[type]:
    """The types inside a field's type, but for None."""
    if get_origin(annotation) is Annotated:
        return _leaves(get_args(annotation)[0])
    if get_origin(annotation) is Literal:
        return {type(value) for value in get_args(annotation)}
    inner = get_args(annotation)
    if inner:
        return {leaf for one in inner if one not in (..., type(None)) for leaf in _leaves(one)}
    return {annotation} if isinstance(annotation, type) else {object}


def _scaled(value: Any, power: int) -> Any:
    """value times 10^power, rounded once, as if it had been written so; what is no number stays for the field to refuse."""
    if isinstance(value, list):
        return [_scaled(item, power) for item in value]
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return value
    return float(Decimal(repr(value)).scaleb(power))
