"""Single values of a scene changed by their keys: --set KEY=VALUE, with tables as film.pocket.depth or sides.west.p."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..errors import InputError, nearest
from ..registry import METHODS
from .units import stem


def changed(data: dict[str, Any], changes: dict[str, Any], prefixes: set[str], known: set[str]) -> dict[str, Any]:
    """The data of a scene file with some values replaced.

    Parameters
    ----------
    changes : value by key; a dot leads into a table. In an array of tables the next word is a shape's name or a number from
        1 on, and may be left out where the array has one entry, or one with the key; so may `film` itself.
    prefixes : words that may stand in front of a key without meaning anything: the scene's name and family.
    known : the scene's own keys, which win over a prefix.

    Raises
    ------
    InputError : a key that leads nowhere.
    """
    out: dict[str, Any] = plain(data)
    for key, value in changes.items():
        path = key.split(".")
        if len(path) > 1 and stem(path[0]) not in known:
            if path[0] not in prefixes:
                near = nearest(path[0], [*known, *METHODS])
                raise InputError(f"--set {key}: {path[0]} is no table of the scene, and no method{near}")
            path = path[1:]
        if path == ["n"]:  # a new number of points a side replaces the file's nx and ny too
            out = {name: old for name, old in out.items() if name not in ("nx", "ny") or name in changes}
        table: Any = out
        if len(path) == 1 and stem(path[0]) not in known:  # a key of the one shape that has it
            shapes = [entry for entry in out.get("film", []) if isinstance(entry, dict) and stem(path[0]) in map(stem, entry)]
            table = shapes[0] if len(shapes) == 1 and isinstance(out.get("film"), list) else out
        for word in path[:-1]:
            if isinstance(table, dict) and "shape" in table and word not in table and word in ("1", table["shape"]):
                continue  # one [film] instead of [[film]]
            table = _entry(table, word, key) if isinstance(table, list) else _table(table, word)
        if isinstance(table, list):
            table = _only(table, path[-1], key)
        for old in [name for name in table if stem(name) == stem(path[-1])]:  # h_min replaces h_min_um
            del table[old]
        table[path[-1]] = value
    return out


def flat(table: Any, path: str = "") -> Any:
    """Nested tables as one, by the paths of their keys, {'film.pocket.depth': ...}; anything else unchanged."""
    if not isinstance(table, Mapping):
        return table
    found: dict[str, Any] = {}
    for key, value in table.items():
        found |= flat(value, f"{path}{key}.") if isinstance(value, Mapping) else {f"{path}{key}": value}
    return found


def plain(data: Any) -> Any:
    """A copy as a scene file would give it: dictionaries, lists, and Python's own numbers in place of NumPy's."""
    if isinstance(data, dict):
        return {key: plain(value) for key, value in data.items()}
    if isinstance(data, np.ndarray | np.generic):
        return data.tolist()
    return [plain(value) for value in data] if isinstance(data, list | tuple) else data


def _table(table: dict[str, Any], word: str) -> Any:
    """The table or array of this name; made where there is none, or a short form such as west = 1e5."""
    if not isinstance(table.get(word), (dict, list)):
        table[word] = {}
    return table[word]


def _entry(entries: list[Any], word: str, key: str) -> dict[str, Any]:
    """The entry of an array that a word names."""
    tables = [entry for entry in entries if isinstance(entry, dict)]
    if word.isdigit():
        if not 1 <= int(word) <= len(tables):
            raise InputError(f"--set {key}: entries 1 to {len(tables)} are there")
        return tables[int(word) - 1]
    named = [table for table in tables if table.get("shape") == word]
    if len(named) == 1:
        return named[0]
    names = [str(table.get("shape")) for table in tables]
    reason = f"{len(named)} entries are {word}: take a number from 1 to {len(tables)}" if named else f"no entry is {word}"
    raise InputError(f"--set {key}: {reason}; there are {', '.join(names)}{nearest(word, names)}")


def _only(entries: list[Any], word: str, key: str) -> dict[str, Any]:
    """The one entry of an array that has a key, or the only entry."""
    tables = [entry for entry in entries if isinstance(entry, dict)]
    having = tables if len(tables) == 1 else [table for table in tables if stem(word) in map(stem, table)]
    if len(having) != 1:
        names = ", ".join(f"{k}. {table.get('shape')}" for k, table in enumerate(tables, start=1))
        raise InputError(f"--set {key}: {len(having)} entries have {word}; say which, by name or number: {names}")
    return having[0]
