"""The numbers of a scene by their keys, film.pocket.depth or film.pocket.x.1, and scenes with one of them changed."""

from typing import Any

from ..errors import InputError, nearest
from .scene import Scene, as_scene

UNITS_ALONE = ("p_unit",)  # numbers that change no answer


def values_of(scene: Scene) -> dict[str, float]:
    """Every number that has a derivative, in SI, by its key as --set takes it; elements of a list count from 1.

    Counts, seeds and switches have none; tables of shapes go by the shape's name, by their number where it is there twice.
    """
    data = scene.data_si()
    for key in (*scene._follows, *UNITS_ALONE):
        data.pop(key, None)
    data.pop("tolerance", None)
    if isinstance(balance := data.get("balance"), dict):
        data["balance"] = {"load": balance["load"]}
    found: dict[str, float] = {}
    _collect(data, "", found)
    return found


def _collect(value: Any, path: str, found: dict[str, float]) -> None:
    if isinstance(value, dict):
        for key, inner in value.items():
            _collect(inner, f"{path}.{key}" if path else key, found)
    elif isinstance(value, list):
        named = path == "film"  # of others the shape may be a default, which is not written
        names = [one.get("shape") if named and isinstance(one, dict) else None for one in value]
        for k, (name, one) in enumerate(zip(names, value, strict=True), start=1):
            _collect(one, f"{path}.{name if name and names.count(name) == 1 else k}", found)
    elif isinstance(value, float):
        found[path] = value


def key_of(scene: Scene, text: str) -> str:
    """The key of `values_of` that a text means; its table, or which one of several, may be left out where that leaves one.

    Raises
    ------
    InputError : no such key, or one without a derivative.
    """
    known = values_of(scene)
    if text in known:
        return text
    ends = [key for key in known if key.endswith(f".{text}") or text in (_numbered(scene, key), _of_any(key))]
    if len(ends) == 1:
        return ends[0]
    words = text.split(".")
    if ends:
        raise InputError(f"{text}: {len(ends)} keys are meant: {', '.join(ends)}")
    data: Any = scene.data_si()
    for word in words:
        if isinstance(data, list):
            data = next(
                (one for k, one in enumerate(data, 1) if word in (str(k), isinstance(one, dict) and one.get("shape"))), None
            )
        else:
            data = data.get(word) if isinstance(data, dict) else None
    if isinstance(data, list) and data and isinstance(data[0], float):
        raise InputError(
            f"{text} = {data}: {len(data)} numbers; say which: {', '.join(f'{text}.{k + 1}' for k in range(len(data)))}"
        )
    if data is not None or words[0] in scene._follows:
        kind = "a count" if isinstance(data, int) and not isinstance(data, bool) else "no number that could be varied"
        raise InputError(f"{text}: {kind}, which has no derivative; numbers of this scene: {', '.join(known)}")
    raise InputError(f"{text}: no number of scene {scene.name}{nearest(text, known)}; there are {', '.join(known)}")


def unit_of(scene: Scene, key: str) -> str:
    """SI unit of a number of `values_of`; empty if it has none."""
    units, name = scene.data_units(), _numbered(scene, key)
    return units.get(name, units.get(name.rpartition(".")[0], ""))


def _of_any(key: str) -> str:
    """film.depth for film.pocket.depth."""
    table, _, rest = key.partition(".")
    return f"{table}.{rest.partition('.')[2]}"


def _numbered(scene: Scene, key: str) -> str:
    """film.2.depth for film.pocket.depth: as units go by."""
    words = key.split(".")
    tables = getattr(scene, words[0], None)
    if len(words) < 3 or not isinstance(tables, list):
        return key
    number = next((str(k) for k, one in enumerate(tables, 1) if getattr(one, "shape", None) == words[1]), words[1])
    return ".".join([words[0], number, *words[2:]])


def with_values(scene: Scene, values: dict[str, float]) -> Scene:
    """The scene with some of its numbers (`values_of`) changed, checked as a file's are.

    Raises
    ------
    InputError : a value that is not allowed.
    """
    changes: dict[str, Any] = {}
    for key, value in values.items():
        base, _, last = key.rpartition(".")
        if last.isdigit():
            listed = changes.get(base) or _listed(scene, base)
            changes[base] = [value if k == int(last) else old for k, old in enumerate(listed, start=1)]
        else:
            changes[key] = value
    return as_scene(scene, changes)


def _listed(scene: Scene, base: str) -> list[float]:
    """The list of numbers at a key."""
    known = values_of(scene)
    found: list[float] = []
    while f"{base}.{len(found) + 1}" in known:
        found.append(known[f"{base}.{len(found) + 1}"])
    return found
