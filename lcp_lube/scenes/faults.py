"""pydantic's complaints about a scene as one line: key, what was found, what is allowed, the nearest name."""

from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from ..errors import nearest
from .units import SUFFIXES, Measured

LONGEST = 60  # of what was found


def first_fault(error: ValidationError, model: type[BaseModel]) -> str:
    """The first complaint, in words."""
    faults = error.errors()
    fault = next(
        (fault for fault in faults if fault["type"] == "extra_forbidden"), faults[0]
    )  # a typo explains what is missing
    path, tables = _walk(model, fault["loc"])
    key, context = ".".join(path), fault.get("ctx", {})
    found = "none" if fault["input"] is None else _short(fault["input"])  # as --set has it
    if fault["type"] == "extra_forbidden":
        known = [name for table in tables for name in known_keys(table)]
        return f"unknown key {key}{nearest(path[-1], known) or '; known are ' + ', '.join(_plain(tables))}"
    if fault["type"] == "missing":
        return f"{key} is missing"
    if fault["type"] == "union_tag_not_found":
        return f"{key}: shape is missing; allowed are {', '.join(tags_of(tables))}"
    if fault["type"] == "union_tag_invalid":
        tag = str(context["tag"])
        return f"{key}.shape = {tag}: allowed are {', '.join(tags_of(tables))}{nearest(tag, tags_of(tables))}"
    if fault["type"] in ("model_type", "model_attributes_type", "dict_type"):
        return f"{key} = {found}: a table is needed"
    allowed = fault["msg"].removeprefix("Value error, ").replace("Input should be ", "allowed is ")
    if fault["type"] == "value_error" and isinstance(fault["input"], dict):  # a table's own check, which names its key
        return f"{key}: {allowed}" if key else allowed
    return f"{key} = {found}: {allowed}" if key else allowed


def known_keys(model: type[BaseModel]) -> list[str]:
    """The keys of a table, with those that carry a unit."""
    suffixed = model.lengths if issubclass(model, Measured) else frozenset()
    return _plain([model]) + [name + suffix for name in suffixed for suffix in SUFFIXES]


def _plain(tables: list[type[BaseModel]]) -> list[str]:
    return list(dict.fromkeys(field.alias or name for table in tables for name, field in table.model_fields.items()))


def _walk(model: type[BaseModel], loc: tuple[int | str, ...]) -> tuple[list[str], list[type[BaseModel]]]:
    """The key as people write it, and the models of the table that it stands in."""
    path: list[str] = []
    tables, of_tables = [model], False
    for k, part in enumerate(loc):
        if isinstance(part, int):
            path.append(str(part + 1 if of_tables else part))  # entries count from 1, as in --set
            continue
        tagged = [table for table in tables if part in tags_of([table])]
        if tagged and len(tables) > 1:
            tables = tagged
            path[-1] = f"{part}" if path and path[-1].isdigit() else path[-1]
            continue
        path.append(part)
        fields = [field for table in tables for name, field in table.model_fields.items() if part in (name, field.alias)]
        below = [inner for field in fields for inner in models_of(field.annotation)]
        of_tables = bool(below)
        tables = below if below and (k + 1 < len(loc) or len(below) > 1) else tables
    return path, tables


def models_of(annotation: Any) -> list[type[BaseModel]]:
    """The models inside a field's type."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for inner in get_args(annotation) for model in models_of(inner)]


def tags_of(tables: list[type[BaseModel]]) -> list[str]:
    """What `shape` may be in these tables."""
    return [
        tag for table in tables if "shape" in table.model_fields for tag in get_args(table.model_fields["shape"].annotation)
    ]


def _short(value: Any) -> str:
    text = str(value)
    return text if len(text) <= LONGEST else text[:LONGEST] + "..."
