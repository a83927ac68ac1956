"""Scenes: a TOML file with the data of one bearing, validated, from which a Problem is built."""

import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Protocol

from petsc4py import PETSc
from pydantic import Field, PrivateAttr, ValidationError, model_validator

from ..errors import InputError, nearest
from ..problems.facts import Facts
from ..problems.film.exact import ExactSolution, exact_solution
from ..problems.film.gaps import Raised, Wave
from ..problems.film.lubrication import LubricationProblem
from ..problems.film.model import Model, Side
from ..problems.film.reynolds import Film
from ..problems.solution import Problem
from ..registry import FAMILIES, SCENE_DIR, scene_names
from .balance import BalanceTable
from .changes import changed, plain
from .faults import first_fault, known_keys
from .units import Measured, measured, metres, stem, units_of

# Strict: neither true nor "1e-5" is a number.
Finite = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[Finite, Field(gt=0)]
NotNegative = Annotated[Finite, Field(ge=0)]
Count = Annotated[int, Field(strict=True, ge=1, le=2**31 - 2)]


class Solvable(Protocol):
    """What can be solved: a scene, or what a driver makes of one (a part, a step, a fluid held)."""

    @property
    def name(self) -> str: ...

    @property
    def scheme(self) -> str | None: ...

    @property
    def shape(self) -> tuple[int, ...]: ...

    def with_shape(self, shape: tuple[int, ...]) -> "Solvable": ...

    def facts(self, comm: PETSc.Comm | None = None) -> Facts: ...

    def build(self, comm: PETSc.Comm | None = None) -> Problem: ...


class Scene(Measured):
    """What every scene has; a family (registry.FAMILIES) adds its data and builds its problem.

    problem_kind : of the discrete problem. transient : it goes on in time.
    """

    problem_kind: ClassVar[str] = "lubrication"
    transient: ClassVar[bool] = False
    family: str = "slider"
    name: str = ""
    scheme: str | None = None
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

    def build(self, comm: PETSc.Comm | None = None) -> Problem:
        """The discrete problem on this scene's grid. Collective."""
        raise NotImplementedError


class LubricationScene(Scene):
    """A film over [0, L] or [0, L] x [0, width], in SI units; a family adds its film, `gap`.

    Pressures are above the cavitation pressure p_c, which is added to what is reported.
    """

    dimension: Literal[1, 2] = 1
    L: Positive = metres(0.1, "length in the direction of motion")
    width: Positive | None = metres(None, "width Ly; default L (2D)")
    mu: Positive = measured("Pa s", 0.015, "viscosity")
    U: Positive = measured("m/s", 5.0, "speed of the moving wall")
    p_a: NotNegative = measured("Pa", 0.0, "pressure at x = 0; above p_c")
    p_b: NotNegative = measured("Pa", 0.0, "pressure at x = L; above p_c")
    p_side: NotNegative = measured("Pa", 0.0, "pressure at y = 0 and y = width; above p_c (2D)")
    p_c: Finite = measured("Pa", 0.0, "cavitation pressure")
    scheme: Literal["nodal", "face", "upwind"] = Field("face", description="form of the Couette flux")
    mean_cubes: bool = Field(False, description="h^3 at a face as the mean of the nodal values")
    p_unit: Positive = measured("Pa", 1e6, "pressure unit of the equations")
    h_offset: Finite = metres(0.0, "added to the film everywhere: its level")
    balance: BalanceTable | None = Field(None, description="load to carry, and what is found for it")
    n: Count = Field(100, description="interior points a side")
    nx: Count | None = Field(None, description="interior points in x; default n")
    ny: Count | None = Field(None, description="interior points in y; default n (2D)")

    @model_validator(mode="after")
    def _one_dimensional(self) -> "LubricationScene":
        for key in ("ny", "width", "p_side"):
            if self.dimension == 1 and getattr(self, key):
                raise ValueError(f"{key} = {getattr(self, key)}: the scene is one-dimensional")
        return self

    @property
    def shape(self) -> tuple[int, ...]:
        nx = self.nx or self.n
        return (nx,) if self.dimension == 1 else (nx, self.ny or self.n)

    @property
    def gap(self) -> Film:
        """The film h(x, y) in metres."""
        raise NotImplementedError

    def exact(self) -> ExactSolution | None:
        """The exact solution; None where none is known."""
        return None

    @property
    def sides(self) -> tuple[Side, Side, Side, Side]:
        """West, east, south and north: a pressure each, unless a family says otherwise."""
        west, east, ends = (Side(p=p) for p in (self.p_a, self.p_b, self.p_side))
        return west, east, ends, ends

    @property
    def model(self) -> Model:
        """What is discretised."""
        return Model(
            lengths=(self.L,) if self.dimension == 1 else (self.L, self.width or self.L),
            sides=self.sides,
            gap=Raised(self.gap, self.h_offset) if self.h_offset else self.gap,  # type: ignore[arg-type]
            mu=self.mu,
            U=self.U,
            p_c=self.p_c,
            p_unit=self.p_unit,
            scheme=self.scheme,
            mean_cubes=self.mean_cubes,
            exact=self.exact,
        )

    def facts(self, comm: PETSc.Comm | None = None) -> Facts:
        return self.model.facts(self.shape, comm)

    def build(self, comm: PETSc.Comm | None = None) -> LubricationProblem:
        """The discrete problem on this scene's grid. Collective.

        Raises
        ------
        InputError : more ranks than the grid can be dealt to.
        """
        return self.model.build(self.shape, comm)


class SliderScene(LubricationScene):
    """A slider with one wave of the film; defaults are the published problems' data."""

    film: Literal["sinusoid", "parabola"] = "sinusoid"
    form: Literal["convergent-divergent", "divergent-convergent"] = "convergent-divergent"
    wave: tuple[NotNegative, NotNegative] = Field((0.0, 1.0), description="where the wave starts and ends, in parts of L")
    h_min: Positive = metres(15e-6, "smallest film")
    h_max: Positive = metres(25e-6, "largest film")
    scheme: Literal["nodal", "face", "upwind"] = Field("nodal", description="form of the Couette flux")

    @model_validator(mode="after")
    def _consistent(self) -> "SliderScene":
        if self.h_max < self.h_min:
            raise ValueError(f"h_max = {self.h_max:g}: at least h_min = {self.h_min:g} is needed")
        if not self.wave[0] < self.wave[1] <= 1:
            raise ValueError(f"wave = {list(self.wave)}: 0 <= start < end <= 1 is needed")
        return self

    @property
    def gap(self) -> Wave:
        start, end = (self.L * part for part in self.wave)
        return Wave(self.film, self.form, self.h_min, self.h_max, start, end - start)

    def exact(self) -> ExactSolution | None:
        if self.dimension == 2:
            return None
        return exact_solution(Raised(self.gap, self.h_offset), self.L, self.mu, self.U, self.p_a, self.p_b)


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
        scene: Scene = model(**{"name": name, **changed(data, plain(changes), {name, str(family)}, keys)})
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
    elif source in scene_names():
        path, name = SCENE_DIR / f"{source}.toml", source
    else:
        raise InputError(
            f"scene {source}: neither a .toml file nor a built-in name{nearest(source, scene_names())}; see 'lcp-lube list'"
        )
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:  # ValueError: no UTF-8, no TOML, a number too long for Python
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise InputError(f"{source}: {reason}") from None
    if not data:
        raise InputError(f"{source}: the file sets nothing; 'family' and the data of a bearing are needed")
    return data, path, name


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
    """{'h_min': 1e-5} from ['h_min=1e-5']; values as TOML, bare words as strings.

    Raises
    ------
    InputError : not of the form KEY=VALUE.
    """
    changes = {}
    for text in assignments:
        key, equals, value = (part.strip() for part in text.partition("="))
        if not (key and equals and value):
            raise InputError(f"--set {text}: KEY=VALUE is needed")
        changes[key] = _value(value)
    return changes


def _value(text: str) -> Any:
    """A value as TOML; what is none, 15um say, as it stands, in a list too."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError):
        inner = text[1:-1]
        listed = text.startswith("[") and text.endswith("]") and not set("[]{}\"'") & set(inner)
        return [_value(word.strip()) for word in inner.split(",")] if listed else text
