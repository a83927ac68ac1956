"""A scene's keys as a page's controls, made from its model: sliders for numbers, in ranges that limits and values suggest."""

from dataclasses import dataclass
from math import isfinite, pi
from typing import Any, Literal, get_args, get_origin

from ...scenes.faults import models_of
from ...scenes.scene import Scene
from ...scenes.template import described
from ...scenes.units import Measured
from ...scenes.written import toml_value

HIDDEN = ("family", "name", "n", "nx", "ny", "p_unit", "shape")  # the page's own: grids and units follow
REACH = 10.0  # a positive number is varied by as much, up and down
EDGE = 0.02  # of a range, left out at a limit that is not allowed itself
SMALL = 0.05  # of a range: its width says nothing of the value
# Where a zero says nothing.
USUAL = {"m": 1e-5, "Pa": 1e5, "rad": 1e-3, "m/s": 1.0, "N": 1e3, "deg": 90.0, "Pa s": 0.05, "rad/s": pi * 100}


@dataclass(frozen=True)
class Control:
    """One key of a scene as a page shows it.

    key : as --set has it.
    kind : 'number' (a slider and a field), 'choice', 'switch', or 'text' (anything else, as TOML).
    value : now, in SI; None where the key is not set.
    unit, text : SI unit and meaning.
    low, high, log, whole : the slider's range and scale.
    options : of a choice.
    first : shown at once; the others when asked for.
    """

    key: str
    kind: Literal["number", "choice", "switch", "text"]
    value: Any
    unit: str = ""
    text: str = ""
    low: float = 0.0
    high: float = 1.0
    log: bool = False
    whole: bool = False
    options: tuple[str, ...] = ()
    first: bool = False


def controls(scene: Scene) -> list[Control]:
    """Every key of the scene that can be varied, those of its family and its file first."""
    found = _table(scene, "", scene._follows | set(getattr(scene, "derived", ())))
    return sorted(found, key=lambda control: not control.first)  # stable


def _table(model: Measured, prefix: str, hidden: frozenset[str] | set[str] = frozenset()) -> list[Control]:
    schema = type(model).model_json_schema(by_alias=True)["properties"]
    found: list[Control] = []
    for name, field in type(model).model_fields.items():
        key, value = field.alias or name, getattr(model, name)
        if name in HIDDEN or name in hidden:
            continue
        if len(_literal(field.annotation)) == 1 and value is not None:
            continue  # there is nothing to choose
        if isinstance(value, Measured):
            found += _table(value, f"{prefix}{key}.")
        elif isinstance(value, list) and value and all(isinstance(item, Measured) for item in value):
            for k, item in enumerate(value, start=1):
                found += _table(item, f"{prefix}{key}.{k}.")
        elif value is None and models_of(field.annotation):
            continue  # a table that is not given
        else:
            found.append(_control(model, name, f"{prefix}{key}", value, schema.get(key, {})))
    return found


def _control(model: Measured, name: str, path: str, value: Any, schema: dict[str, Any]) -> Control:
    field = type(model).model_fields[name]
    key, unit = field.alias or name, model.units.get(name, "")
    text = described(type(model), key, field)
    given = name in model.model_fields_set
    options = _literal(field.annotation)
    if isinstance(value, bool):
        return Control(path, "switch", value, text=text, first=given)
    if value is not None and len(options) > 1:
        return Control(path, "choice", str(value), text=text, options=options, first=given)
    if isinstance(value, int | float) and isfinite(value):
        whole = model.numbers.get(key, False)
        return Control(
            path, "number", value, unit, text, **slider(value, unit, whole, schema), whole=whole, first=given or value != 0
        )
    return Control(path, "text", None if value is None else toml_value(value), unit, text, first=given)


def slider(value: float, unit: str, whole: bool, schema: dict[str, Any]) -> dict[str, Any]:
    """A range: between the limits where there are two, a decade to each side of a positive number, else about zero."""
    kinds = [schema, *schema.get("anyOf", [])]
    limits = {name: kind[name] for kind in kinds for name in kind if "inimum" in name or "aximum" in name}
    low = max((limits[name] for name in ("minimum", "exclusiveMinimum") if name in limits), default=None)
    high = min(
        (limits[name] for name in ("maximum", "exclusiveMaximum") if name in limits and limits[name] < 2**31 - 2), default=None
    )

    def around(least: float, most: float) -> dict[str, Any]:
        return {"low": least if low is None else low, "high": most if high is None else high, "log": False}

    if whole:
        return around(min(0, value), max(4 * value, 10))
    small = low is not None and high is not None and 0 <= low < value < SMALL * high  # a clearance ratio, of those below 1
    if low is not None and high is not None and not small:
        step = EDGE * (high - low)
        least, most = low + step * ("exclusiveMinimum" in limits), high - step * ("exclusiveMaximum" in limits)
        return {"low": least, "high": max(most, value), "log": False}
    if low is not None and low >= 0 and value > low:
        return {"low": max(value / REACH, low), "high": value * REACH, "log": True}
    size = 2.0 * abs(value) or USUAL.get(unit, 1.0)
    return around(-size, size)


def _literal(annotation: Any) -> tuple[str, ...]:
    """What a field may be, where it is one of a few words or numbers."""
    if get_origin(annotation) is Literal:
        return tuple(map(str, get_args(annotation)))
    return tuple(word for inner in get_args(annotation) for word in _literal(inner))
