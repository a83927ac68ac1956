"""Lengths in scene files: SI by itself, micrometres and millimetres by a suffix of the key (h_min_um = 15, L_mm = 100)."""

from collections.abc import Iterable
from decimal import Decimal
from typing import Any, ClassVar

from pydantic import BaseModel, ConfigDict, Field, model_validator

SUFFIXES = {"_um": -6, "_mm": -3}


def metres(default: Any, text: str, **limits: Any) -> Any:
    """A field in metres, which may be given in other units by a suffix."""
    what, semicolon, more = text.partition(";")
    return Field(default, description=f"{what}, m{semicolon}{more}", json_schema_extra={"unit": "m"}, **limits)


def stem(key: str) -> str:
    """The key without a unit's suffix."""
    return next((key.removesuffix(suffix) for suffix in SUFFIXES if key.endswith(suffix)), key)


class Measured(BaseModel):
    """A model whose fields made by `metres` understand the suffixes."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    lengths: ClassVar[frozenset[str]] = frozenset()

    @classmethod
    def __pydantic_init_subclass__(cls, **kwargs: Any) -> None:
        super().__pydantic_init_subclass__(**kwargs)
        extras = ((name, field.json_schema_extra) for name, field in cls.model_fields.items())
        cls.lengths = frozenset(name for name, extra in extras if isinstance(extra, dict) and extra.get("unit") == "m")

    def __repr_args__(self) -> Iterable[tuple[str | None, Any]]:
        """What was given; the rest is defaults."""
        return [(name, value) for name, value in super().__repr_args__() if name in self.model_fields_set]

    @model_validator(mode="before")
    @classmethod
    def _in_metres(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        out: dict[str, Any] = {}
        for key, value in data.items():
            name = stem(key)
            if name == key or name not in cls.lengths:
                name = key
            else:
                value = _scaled(value, SUFFIXES[key[len(name) :]])
            if name in out:
                found = [other for other in data if stem(other) == name]
                raise ValueError(f"{' and '.join(found)} are both given: one of them is allowed")
            out[name] = value
        return out


def _scaled(value: Any, power: int) -> Any:
    """value times 10^power, rounded once, as if it had been written so; what is no number stays for the field to refuse."""
    if isinstance(value, list):
        return [_scaled(item, power) for item in value]
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return value
    return float(Decimal(repr(value)).scaleb(power))
