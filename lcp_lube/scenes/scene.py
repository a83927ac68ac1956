"""Scenes: a TOML file with the data of one bearing, validated, from which a Problem is built."""

import tomllib
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc
from pydantic import Field, PrivateAttr, ValidationError

from ..errors import InputError, nearest
from ..problems.facts import Facts
from ..problems.solution import Problem
from ..registry import FAMILIES, SCENE_DIR, is_scene, own_text, scene_names
from .changes import changed, plain
from .faults import first_fault, known_keys
from .units import Measured, stem, units_of

# Strict: neither true nor "1e-5" is a number.
Finite = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[Finite, Field(gt=0)]
NotNegative = Annotated[Finite, Field(ge=0)]
Count = Annotated[int, Field(strict=True, ge=1, le=2**31 - 2)]


@dataclass(frozen=True)
class Derived:
    """A scene that a driver derives from another: with its name, scheme and grid, unless a subclass changes them."""

    whole: Any

    @property
    def name(self) -> str:
        return self.whole.name

    @property
    def scheme(self) -> str | None:
        return self.whole.scheme

    @property
    def shape(self) -> tuple[int, ...]:
        return self.whole.shape

    def with_shape(self, shape: tuple[int, ...]) -> Self:
        return replace(self, whole=self.whole.with_shape(shape))

    def refined(self, shape: tuple[int, ...]) -> Self:
        """As `Scene.refined`: what is derived has no steps in time of its own."""
        return self.with_shape(shape)

    def facts(self, comm: PETSc.Comm | None = None) -> Facts:
        return self.model.facts(self.shape, comm)  # type: ignore[attr-defined]

    def build(self, comm: PETSc.Comm | None = None) -> Any:
        """The discrete problem. Collective."""
        return self.model.build(self.shape, comm)  # type: ignore[attr-defined]

    def factored(self, problem: Any, j: NDArray[np.int64], i: NDArray[np.int64]) -> Any:
        """A problem on these lines and columns, with what effects make of its coefficients. Collective."""
        of_whole = getattr(self.whole, "factored", None)
        return problem if of_whole is None else of_whole(problem, j, i)


class Scene(Measured):
    """What every scene has; a family (registry.FAMILIES) adds its data and builds its problem.

    problem_kind : of the discrete problem.
    """

    problem_kind: ClassVar[str] = "lubrication"
    family: str = "slider"
    name: str = ""
    scheme: str | None = None
    tolerance: dict[str, Any] | None = Field(None, description="standard deviations of numbers by key, for error bars")
    _folder: Path | None = PrivateAttr(None)  # of the scene's file: other files' names are relative to it
    _follows: frozenset[str] = PrivateAttr(frozenset())  # keys whose values follow from those that were given

    def __init__(self, **data: Any):
        super().__init__(**data)
        given = {stem(key) for key in data}
        fields = type(self).model_fields
        self._follows = frozenset(name for name in self.model_fields_set if not {name, fields[name].alias} & given)

    def __repr_args__(self) -> Iterable[tuple[str | None, Any]]:
        """What was given; the rest is the family's defaults."""
        given = self.model_fields_set - self._follows - {"family"}
        return [(name, value) for name, value in super().__repr_args__() if name in given]

    def data_si(self) -> dict[str, Any]:
        """What was solved: every key that has a value, changes made, in SI units; tables as dictionaries."""
        return self.model_dump(mode="json", by_alias=True, exclude_none=True, exclude={"name"})

    def data_units(self) -> dict[str, str]:
        """The SI unit of each key of `data_si` that has one, by its path: {'fluid.mu': 'Pa s', 'film.1.depth': 'm'}."""
        per_width = getattr(self, "dimension", 2) == 1
        return {key: unit.split(" or ")[-1 if per_width else 0] for key, unit in units_of(self).items()}

    def facts(self, comm: PETSc.Comm | None = None) -> Facts:
        """The problem in numbers, before it is built."""
        return Facts(self.problem_kind, self.shape, (comm or PETSc.COMM_WORLD).getSize())

    @property
    def shape(self) -> tuple[int, ...]:
        """Numbers of interior points, (nx,) or (nx, ny)."""
        raise NotImplementedError

    def with_shape(self, shape: tuple[int, ...]) -> "Scene":
        """The same scene on another grid."""
        return self.model_copy(update=dict(zip(("nx", "ny"), shape, strict=False)))

    def refined(self, shape: tuple[int, ...]) -> "Scene":
        """On another grid, and in time in steps in proportion, as the errors of both are of one order."""
        return self.with_shape(shape)

    def build(self, comm: PETSc.Comm | None = None) -> Problem:
        """The discrete problem on this scene's grid. Collective."""
        raise NotImplementedError


Solvable = Scene | Derived  # what can be solved


def scene_line(name: str) -> str:
    """First line of a built-in scene: what it is."""
    return (SCENE_DIR / f"{name}.toml").read_text().partition("\n")[0].lstrip("# ")


def load_scene(source: str | Path | dict[str, Any], changes: dict[str, Any] | None = None, /, **keys: Any) -> Scene:
    """A scene from a built-in name, a .toml file or a dictionary of the same form, with some of its values changed.

    Parameters
    ----------
    changes, keys : new values by key, ``load_scene("journal", eccentricity=0.7)``; with a dot into a table as --set has them,
        ``load_scene("pocketed_pad", {"film.pocket.depth": 2e-5})``.

    Raises
    ------
    InputError : no such scene, an unreadable file, an unknown key, a value of the wrong type or out of range; one line
        that names the file, the key, what was found and what is allowed.
    """
    return as_scene(source, {**(changes or {}), **keys})


def as_scene(source: "str | Path | dict[str, Any] | Scene", changes: dict[str, Any], also: Iterable[str] = ()) -> Scene:
    """The scene that a caller means: a Scene, or what `load_scene` takes; with the changes made, checked like a file's values.

    Parameters
    ----------
    also : names that the caller takes beside the scene's keys, of which an unknown key may be a misspelling.

    Raises
    ------
    InputError : as `load_scene`; a change of a problem that has no scene file's keys.
    """
    if hasattr(source, "build") and not changes:
        return source  # type: ignore[return-value]  # a Scene, or what stands for one
    model: Any = None
    if isinstance(source, Scene):
        if source.family not in FAMILIES:
            raise InputError(f"{source.name}: {', '.join(changes)}: a problem of one's own has no keys to change")
        data = source.model_dump(by_alias=True, exclude_unset=True, exclude=set(source._follows))
        folder, name, label, model = source._folder, source.name, source.name or source.family, type(source)
    elif isinstance(source, dict):
        data, folder, name, label = plain(source), None, "", str(source.get("name", "scene"))
    else:
        data, path, name = read_scene(source)
        folder, label = path.parent, str(source)
    family = changes.get("family", data.get("family", getattr(source, "family", None)))
    if model is None or "family" in changes:
        model = family_of(label, family)
    keys = set(known_keys(model))
    for key in changes:
        if key.partition(".")[0] not in keys and (near := nearest(key, also)):
            raise InputError(f"{label}: {key} is neither a key of the scene nor an argument{near}")
    try:
        scene: Scene = model(**{"name": name or str(family), **changed(data, plain(changes), {name, str(family)}, keys)})
    except ValidationError as error:
        raise InputError(f"{label}: {first_fault(error, model)}") from None
    scene._folder = folder
    return scene


def read_scene(source: str | Path) -> tuple[dict[str, Any], Path, str]:
    """What the file of a scene says, the file, and the scene's name.

    Raises
    ------
    InputError : no such scene, an unreadable file.
    """
    source = str(source)
    if source.endswith(".toml"):
        path, name = Path(source), Path(source).stem
    elif is_scene(source):
        path, name = SCENE_DIR / f"{source}.toml", source
    else:
        raise InputError(
            f"scene {source}: neither a .toml file nor a built-in name{nearest(source, scene_names())}; see 'lcp-lube list'"
        )
    try:
        data = plain(_parsed(path)) if path.parent == SCENE_DIR else tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:  # ValueError: no UTF-8, no TOML, a number too long for Python
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise InputError(f"{source}: {reason}") from None
    if not data:
        raise InputError(f"{source}: the file sets nothing; 'family' and the data of a bearing are needed")
    return data, path, name


@cache
def _parsed(path: Path) -> dict[str, Any]:
    """A built-in scene's data: each file is read once."""
    return tomllib.loads(own_text(path))


def family_of(source: str | Path, family: Any) -> Any:
    """The model of a family.

    Raises
    ------
    InputError : no such family, or none at all.
    """
    if family is None:
        raise InputError(f"{source}: family is missing; allowed are {', '.join(FAMILIES)}")
    if family not in [*FAMILIES]:  # which may be no string at all
        raise InputError(f"{source}: family = {family}: allowed are {', '.join(FAMILIES)}{nearest(str(family), FAMILIES)}")
    return FAMILIES[family].load()


def parse_changes(assignments: Iterable[str]) -> dict[str, Any]:
    """{'h_min': 1e-5} from ['h_min=1e-5']; values as TOML, bare words as strings; balance=none leaves a table or a number out.

    Raises
    ------
    InputError : not of the form KEY=VALUE.
    """
    changes = {}
    for text in assignments:
        key, equals, value = (part.strip() for part in text.partition("="))
        if not (key and equals and value):
            raise InputError(f"--set {text}: KEY=VALUE is needed")
        changes[key] = None if value == "none" and "." not in key else _value(value)
    return changes


def _value(text: str) -> Any:
    """A value as TOML; what is none, 15um say, as it stands, in a list too."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError):
        inner = text[1:-1]
        listed = text.startswith("[") and text.endswith("]") and not set("[]{}\"'") & set(inner)
        return [_value(word.strip()) for word in inner.split(",")] if listed else text
