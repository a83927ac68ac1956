"""`lcp-lube new FILE --from SCENE`: a scene file to edit, with every key, its unit, meaning, default and what is allowed."""

import os
import textwrap
from contextlib import suppress
from pathlib import Path
from typing import Any, get_args, get_origin

from mpi4py import MPI
from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from ..base.together import on_all_ranks
from ..errors import InputError
from .faults import models_of, tags_of
from .scene import family_of, load_scene, read_scene
from .units import SUFFIXES, Measured, stem
from .written import toml_value, with_files

WIDTH = 110
LIMITS = {"exclusiveMinimum": "> {:g}", "minimum": ">= {:g}", "exclusiveMaximum": "< {:g}", "maximum": "<= {:g}"}


def run(path: Path, source: str) -> int:
    """The command. Collective.

    Raises
    ------
    InputError : no such scene, or `path` is there already or cannot be written.
    """
    with on_all_ranks(MPI.COMM_WORLD):
        if MPI.COMM_WORLD.rank == 0:
            _write(path, template(source, path.parent))
            print(f"{path}: made from {source}; solve it by 'lcp-lube solve {path}'", flush=True)
    return 0


def _write(path: Path, text: str) -> None:
    if path.suffix != ".toml":
        raise InputError(f"new {path}: a name that ends in .toml is needed")
    if "\0" in str(path):
        raise InputError(f"new {path}: a name that no file can have")
    temporary = path.with_name(f".{path.stem}.{os.getpid()}.toml")
    try:
        temporary.write_text(text, encoding="utf-8")
        os.link(temporary, path)  # never over another file, not even one made this moment
    except FileExistsError:
        raise InputError(f"new {path}: the file is there already; it is not overwritten") from None
    except OSError as error:
        raise InputError(f"new {path}: could not be written: {error.strerror or error}") from None
    finally:
        with suppress(OSError):  # a name too long for any file
            temporary.unlink(missing_ok=True)


def template(source: str, folder: Path = Path()) -> str:
    """The text of a scene file that says the same as `source`, for a file in `folder`.

    Raises
    ------
    InputError : no such scene, or one that cannot be read.
    """
    data, path, name = read_scene(source)
    scene = load_scene(source)  # nothing is copied that does not hold
    model = family_of(source, scene.family)
    data = {"family": scene.family, **data}
    for part in with_files(data):
        part["file"] = os.path.relpath(path.parent / part["file"], folder)
    line = path.read_text(encoding="utf-8").partition("\n")[0]
    head = [line.lstrip("# ") if line.startswith("#") else f"{name}: {_sentence(model)}"]
    head += textwrap.wrap(_sentence(model), WIDTH) if line.startswith("#") else []
    head += [f"Made from {name}. A line that begins with # says what a key means; '# key = value' is a key at its default."]
    if issubclass(model, Measured) and model.units:
        head += ['Values are in SI units; a text may have others, "15um" or "1 MPa".']
        head += [f"Lengths are in metres; a key with {' or '.join(SUFFIXES)} at its end is in those."]
    return "\n".join(f"# {line}" for line in head) + "\n\n" + "\n".join(_table(model, data, "")).strip() + "\n"


def _sentence(model: type[BaseModel]) -> str:
    return " ".join((model.__doc__ or "").split())


def _table(model: type[BaseModel], data: dict[str, Any], prefix: str) -> list[str]:
    """The lines of a table: its keys, then the tables inside it; `prefix` is its name and a dot."""
    schema = model.model_json_schema(by_alias=True)["properties"]
    lines: list[str] = []
    below: list[str] = []
    own = ["family", *model.__annotations__]  # what the family adds comes first
    order = sorted(model.model_fields, key=lambda name: own.index(name) if name in own else len(own))
    for name in order:
        field = model.model_fields[name]
        key = field.alias or name
        if name in ("name", *getattr(model, "derived", ())):
            continue
        given = next((k for k in data if k == key or (stem(k) == key and k != key)), None)
        inner = [one for one in models_of(field.annotation) if one.__name__ != "SideTable"]
        if not inner:
            lines += _key(model, field, key, schema.get(key, {}), given, data)
        elif len(inner) == 1:
            below += _inner(field, inner[0], f"{prefix}{key}", data.get(key))
        else:
            below += _parts(inner, f"{prefix}{key}", data.get(key, []))
    return lines + below


def _key(
    model: type[BaseModel], field: FieldInfo, key: str, schema: dict, given: str | None, data: dict[str, Any]
) -> list[str]:
    """A key with its comment; at its default it is a comment itself."""
    fixed = get_args(field.annotation)
    if given is None and len(fixed) == 1 and fixed[0] == field.default:
        return []  # a family's own number of dimensions: there is nothing to choose
    text = described(model, key, field)
    allowed = _allowed(schema)
    default = field.default
    none = default is PydanticUndefined or default is None or isinstance(default, BaseModel)
    value = "" if none else toml_value(default)
    words = [text, f"allowed: {allowed}" if allowed else "", "" if none or key == "family" else f"default {value}"]
    comment = textwrap.wrap("; ".join(word for word in words if word), WIDTH)
    line = f"{given} = {toml_value(data[given])}" if given is not None else f"# {key} = {value}".rstrip()
    return [*(f"# {part}" for part in comment), line, ""]


def _inner(field: FieldInfo, model: type[BaseModel], name: str, given: Any) -> list[str]:
    """A table inside the table; where it is not given and cannot be empty, a comment."""
    text = f"# {field.description}" if field.description else f"# {_sentence(model)}"
    if get_origin(field.annotation) is list:
        tables = given if isinstance(given, list) else [{}]
        body = [line for table in tables for line in (f"[[{name}]]", *_table(model, table, f"{name}."))]
        return [text, *(_commented(body) if given is None else body)]
    lines = _table(model, given if isinstance(given, dict) else {}, f"{name}.")
    needed = field.default is None or any(inner.is_required() for inner in model.model_fields.values())
    lines = [f"[{name}]", *lines]
    return [text, *(_commented(lines) if given is None and needed else lines)]


def _commented(lines: list[str]) -> list[str]:
    return [line if line.startswith("#") or not line else f"# {line}" for line in lines]


def _parts(models: list[type[BaseModel]], name: str, given: Any) -> list[str]:
    """An array of tables of several kinds, told by `shape`; then the kinds that there are."""
    lines = ["# The film is the sum of these shapes; there may be as many as you like. There are:"]
    for model in models:
        keys = ", ".join(key for key in model.model_fields if key != "shape")
        about = f"{' or '.join(tags_of([model]))} ({keys}): {_sentence(model)}"
        lines += textwrap.wrap(about, WIDTH, initial_indent="#   ", subsequent_indent="#       ")
    lines.append("")
    for part in given if isinstance(given, list) else [given]:
        model = next(model for model in models if part["shape"] in tags_of([model]))
        body = _table(model, part, f"{name}.")
        shape = f'shape = "{part["shape"]}"'
        start = body.index(shape)
        lines += [f"[[{name}]]", f"# {_sentence(model)}", shape, "", *body[:start][:-1], *body[start + 2 :]]
    return lines


def described(model: type[BaseModel], key: str, field: FieldInfo) -> str:
    """What the field means; a family that only changes a default leaves that to the model above it."""
    for one in model.__mro__:
        above = getattr(one, "model_fields", {}).get(key)
        if above is not None and above.description:
            return str(above.description)
    return {"family": "the model that reads this file", "dimension": "1: h(x), per metre of width; 2: h(x, y)"}.get(
        key, str(field.description or "")
    )


def _allowed(schema: dict[str, Any]) -> str:
    """What a JSON schema allows, in words."""
    found = []
    for one in [schema, *schema.get("anyOf", [])]:
        if "enum" in one:
            found.append(", ".join(map(str, one["enum"])))
        found += [words.format(one[limit]) for limit, words in LIMITS.items() if limit in one and abs(one[limit]) < 2**31 - 2]
    return ", ".join(dict.fromkeys(found))
