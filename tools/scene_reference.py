#!/usr/bin/env python3
"""docs/guide/scenes.md from the models that validate scene files: `python tools/scene_reference.py` writes it anew."""

import json
import tomllib
from pathlib import Path
from typing import Any

from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from lcp_lube.registry import FAMILIES, SCENE_DIR, scene_names
from lcp_lube.scenes.faults import models_of, tags_of
from lcp_lube.scenes.scene import scene_line
from lcp_lube.scenes.units import SUFFIXES, Measured

PAGE = Path(__file__).parent.parent / "docs" / "guide" / "scenes.md"
LIMITS = {"exclusiveMinimum": "> {:g}", "minimum": ">= {:g}", "exclusiveMaximum": "< {:g}", "maximum": "<= {:g}"}
UNDESCRIBED = {"dimension": "1: h(x), per metre of width; 2: h(x, y)", "film": "its shape", "form": "of the wave"}
HEAD = f"""# Scenes

*Written by `tools/scene_reference.py` from the models that validate scene files: edit those, not this page.*

A scene is a TOML file (`lcp-lube solve my.toml`), or one of the built-in names below. `lcp-lube new my.toml --from NAME`
writes a built-in one with every key and its meaning as a comment. `--set KEY=VALUE` changes a key, `--set TABLE.KEY=VALUE`
one inside a table.

Values are in SI units. A text may carry another unit of the key's dimension: `h_min = "15um"`, `p_in = "1 MPa"`,
`mu = "40 mPa s"`, `omega = "3000 rpm"`, `eccentricity = "75%"`; with `--set` and `--vary` no quotes are needed. A length for a
pressure is refused. Keys that are lengths may carry {" or ".join(f"`{one}`" for one in SUFFIXES)} at their end instead
(`h_min_um = 15`). A key that is not listed is refused, with the nearest one that is.
"""


def sentence(model: type[BaseModel]) -> str:
    return " ".join((model.__doc__ or "").split())


def text(value: Any) -> str:
    """A default as TOML would have it."""
    if isinstance(value, BaseModel):
        return ""
    return f"`{json.dumps(list(value) if isinstance(value, tuple) else value, ensure_ascii=False)}`"


def allowed(schema: dict[str, Any]) -> str:
    """What a JSON schema allows, in words."""
    found = []
    for one in [schema, *schema.get("anyOf", [])]:
        found += [", ".join(f"`{word}`" for word in one["enum"])] if "enum" in one else []
        found += [words.format(one[limit]) for limit, words in LIMITS.items() if limit in one and abs(one[limit]) < 2**31 - 2]
        found += (
            {"integer": ["whole"], "boolean": ["`true`, `false`"]}.get(one.get("type", ""), []) if "enum" not in one else []
        )
    return ", ".join(dict.fromkeys(found))


def described(model: type[BaseModel], name: str) -> str:
    """What a key means; a family that only changes a default leaves that to the model above it."""
    fields = [getattr(one, "model_fields", {}).get(name) for one in model.__mro__]
    return next((field.description for field in fields if field and field.description), "")


def table(model: type[BaseModel], title: str, seen: dict[str, str]) -> list[str]:
    """The keys of a model, then the tables inside it; `seen` says where a table has been described already."""
    schema = model.model_json_schema(by_alias=True)["properties"]
    lines = ["", "| key | default | allowed | meaning |", "|---|---|---|---|"]
    below: list[str] = []
    for name, field in model.model_fields.items():
        key = field.alias or name
        if key in ("family", "name", "shape"):
            continue
        meaning = described(model, name).replace("|", "\\|") or UNDESCRIBED.get(key, "")
        for one in models_of(field.annotation):
            place = f"{title}{key}" + "".join(f', shape = "{tag}"' for tag in tags_of([one])[:1])
            if one.__name__ not in seen:
                seen[one.__name__] = place
                below += ["", f"### `{place}`", "", sentence(one), *table(one, f"{title}{key}.", seen)]
            where = f"see `{seen[one.__name__].partition(',')[0]}` below"
            meaning = meaning if where in meaning else f"{meaning}; {where}"
        missing = field.default is PydanticUndefined or field.default is None
        default = "needed" if field.is_required() else "" if missing else text(field.default)
        lines.append(f"| `{key}` | {default} | {allowed(schema.get(key, {}))} | {meaning} |")
    keys = lengths(model)
    units = ["", f"Lengths may end in {' or '.join(f'`{suffix}`' for suffix in SUFFIXES)}: {keys}."] if keys else []
    return [*lines, *units, *below]


def lengths(model: type[BaseModel]) -> str:
    return ", ".join(f"`{key}`" for key in sorted(model.lengths)) if issubclass(model, Measured) else ""


def page() -> str:
    """The whole page."""
    families: dict[str, list[str]] = {family: [] for family in FAMILIES}
    for name in scene_names():
        data = tomllib.loads((SCENE_DIR / f"{name}.toml").read_text(encoding="utf-8"))
        families[data.get("family", "slider")].append(name)
    lines = [HEAD, "## Built-in scenes", "", "| name | family | |", "|---|---|---|"]
    lines += [f"| `{name}` | `{family}` | {scene_line(name)} |" for family, names in families.items() for name in names]
    for family, entry in FAMILIES.items():
        model: Any = entry.load()
        built_in = ", ".join(f"`{name}`" for name in families[family]) or "none"
        lines += ["", f'## `family = "{family}"`', "", f"{sentence(model)} Built-in: {built_in}.", *table(model, "", {})]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
