"""A scene as the text of a file that says the same."""

import json
from pathlib import Path
from typing import Any

from .scene import Scene


def toml_of(scene: Scene) -> str:
    """A TOML file, in SI units, that `load_scene` reads as this scene; defaults are left out, names of other files absolute."""
    data = scene.model_dump(
        mode="json", by_alias=True, exclude_unset=True, exclude_none=True, exclude={"name", *scene._follows}
    )
    data = {"family": scene.family, **data}
    for part in with_files(data):
        part["file"] = str(((scene._folder or Path()) / part["file"]).resolve())
    return "\n".join([f"# made from {scene.name or scene.family}", *_lines(data, "")]) + "\n"


def with_files(data: dict[str, Any]) -> list[dict[str, Any]]:
    """The shapes of a scene's film that name a file."""
    film = data.get("film")
    return [part for part in (film if isinstance(film, list) else [film]) if isinstance(part, dict) and "file" in part]


def _lines(table: dict[str, Any], name: str) -> list[str]:
    """Keys first, then the tables inside."""
    tables = {key: value for key, value in table.items() if isinstance(value, dict)}
    arrays = {key: value for key, value in table.items() if isinstance(value, list) and value and isinstance(value[0], dict)}
    lines = [f"{key} = {toml_value(value)}" for key, value in table.items() if key not in tables and key not in arrays]
    for key, value in tables.items():
        lines += ["", f"[{name}{key}]", *_lines(value, f"{name}{key}.")]
    for key, values in arrays.items():
        for value in values:
            lines += ["", f"[[{name}{key}]]", *_lines(value, f"{name}{key}.")]
    return lines


def toml_value(value: Any) -> str:
    """A value as TOML."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(toml_value, value))}]"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key} = {toml_value(item)}' for key, item in value.items())}}}"
    return repr(value)
