"""What all families of films share: a model, from which facts and problem are made, and films over a rectangle."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, Self

from petsc4py import PETSc
from pydantic import Field, PrivateAttr

from ..errors import InputError
from ..problems.facts import Facts
from ..problems.film.effects import Effect
from ..problems.film.exact import ExactSolution, exact_solution
from ..problems.film.lubrication import LubricationProblem
from ..problems.film.model import Model, Side
from ..problems.film.shapes import Block, Shape, Sum
from ..problems.film.supplies import Supply
from ..problems.film.turning import Turning
from .balance import BalanceTable
from .effects.named import FLUID, named
from .motion import MotionTable
from .moving import Models, models_of
from .scene import Count, Finite, Positive, Scene
from .units import measured, metres

Sides = tuple[Side, Side, Side, Side]
ALL = (-math.inf, math.inf)


@dataclass(frozen=True)
class Extent:
    """What a shape may need of its scene: side lengths (m), and the folder that file names are relative to.

    t : time, s; travel : of the wall since t = 0, m; journal : [X, Y] of the journal in its clearance, if it moves.
    """

    lengths: tuple[float, ...]
    folder: Path
    t: float = 0.0
    travel: float = 0.0
    journal: tuple[float, float] | None = None

    @property
    def both(self) -> tuple[float, float]:
        return self.lengths[0], self.lengths[-1]


class FilmScene(Scene):
    """A scene that is a film; a family says which, in `_model`."""

    motion: MotionTable | None = Field(None, description="how the film goes on in time")
    _t: float = PrivateAttr(0.0)  # the time, s
    _travel: float = PrivateAttr(0.0)  # of the wall since t = 0, m
    _journal: tuple[float, float] | None = PrivateAttr(None)  # where it is, if it moves
    _shapes: dict[int, Shape] | None = PrivateAttr(None)  # of [[film]] at rest, where they are made once
    _made: tuple[dict[str, Any], Any, Model] | None = PrivateAttr(None)  # `model`, and what it was made of

    def check(self) -> None:
        temperature, field = getattr(self, "temperature", None), type(self).model_fields.get("mu")
        mu = getattr(self, "mu", None)
        if field is not None and temperature is not None and temperature.own_mu and mu != field.default:
            raise ValueError(f"mu = {mu:g} and the viscosities of [temperature] are both given: one of them")
        if self.motion is not None and getattr(self, "balance", None) is not None:
            raise ValueError("balance and motion are both given: one of them; a load in time is that of motion.free")
        shapes = getattr(self, "film", None)
        for k, table in enumerate(shapes if isinstance(shapes, list) else [], start=1):
            if self.motion is None and table.changes and table.shape != "journal":
                raise ValueError(f"film.{k} ({table.shape}) changes with time: a table [motion] is needed")
            if table.moves and table.shape == "journal":
                raise ValueError(f"film.{k}.moves: a journal's place is motion.journal, motion.file or motion.free")
        if self.motion is None and getattr(self, "moves", False):
            raise ValueError("moves = true: the film changes with time: a table [motion] is needed")

    def _check_motion(self) -> None:
        """Raise ValueError where the scene and its [motion] contradict one another; for the end of a family's `check`."""
        if self.motion is not None:
            self.motion.check_for(self.turning is not None, self.pads_follow)

    @property
    def turning(self) -> Turning | None:
        """What the film is wrapped round, if it is."""
        return None

    @property
    def place(self) -> tuple[float, ...]:
        """Where what [motion] moves is: [X, Y] of a journal in parts of its clearance, else the film's level [h_offset], m."""
        return (self.h_offset,)  # type: ignore[attr-defined]

    @property
    def pads_follow(self) -> bool:
        """Whether pads tilt as their films have it."""
        return False

    def moved(self, place: Sequence[float]) -> Self:
        """With what [motion] moves at this place."""
        return self.model_copy(update={"h_offset": float(place[0])})

    def at(self, t: float, travel: float, place: Sequence[float] | None = None) -> Self:
        """As it is at the time t (s), when its wall has come by `travel` (m), and what else moves is at this place."""
        scene = self.model_copy() if place is None else self.moved(place)
        scene._t, scene._travel = t, travel
        return scene

    def refined(self, shape: tuple[int, ...]) -> Self:
        scene: Any = self.with_shape(shape)
        if self.motion is None:
            return scene  # type: ignore[no-any-return]
        finer = math.prod((n + 1) / (own + 1) for n, own in zip(shape, self.shape, strict=True)) ** (1.0 / len(shape))
        return scene.model_copy(update={"motion": self.motion.finer(finer)})  # type: ignore[no-any-return]

    def models(self) -> Models:
        """The film in time."""
        return models_of(self)

    def shapes_of(self, tables: Sequence[Any]) -> list[Shape]:
        """Of [[film]], at the scene's time."""
        made = {} if self._shapes is None else self._shapes
        for k, table in enumerate(tables):
            if k not in made or table.changes:
                made[k] = table.placed(self.extent)
        return [made[k] for k in range(len(tables))]

    @property
    def mu_0(self) -> float:
        """Viscosity, Pa s; where it varies, that from which it does: at T_in, if it follows from the temperature's data."""
        temperature = getattr(self, "temperature", None)
        return float((temperature.own_mu if temperature is not None else None) or self.mu)  # type: ignore[attr-defined]

    def isothermal(self) -> dict[str, Any]:
        """The keys that change where the temperature is left out, and their values."""
        return {"mu": self.mu_0}

    @property
    def effects(self) -> tuple[Effect, ...]:
        """What the scene's tables do to its film, in the registry's order."""
        return tuple(getattr(self, name).effect(self) for name in named(self) if name not in FLUID)

    def _model(self) -> Model:
        raise NotImplementedError

    @property
    def model(self) -> Model:
        """What is discretised.

        Raises
        ------
        InputError : sides that contradict one another, a profile that cannot be read.
        """
        private: dict[str, Any] = self.__pydantic_private__ or {}  # read at once: asked for a dozen times a solve
        made, where = private["_made"], [private[name] for name in ("_folder", "_t", "_travel", "_journal")]
        if made is None or made[1] != where or made[0] != vars(self):  # a copy may have changed
            try:
                model, effects = self._model(), self.effects
            except InputError as error:
                raise self._named(error) from None
            made = self._made = dict(vars(self)), where, replace(model, effects=effects) if effects else model
        return made[2]

    def __getstate__(self) -> dict[Any, Any]:
        state = super().__getstate__()
        return {**state, "__pydantic_private__": {**(state["__pydantic_private__"] or {}), "_made": None}}

    def __deepcopy__(self, memo: dict[int, Any] | None = None) -> "FilmScene":
        self._made = None
        return super().__deepcopy__(memo)

    @property
    def side_lengths(self) -> tuple[float, ...]:
        """Of the rectangle that the film is unwrapped to, m."""
        raise NotImplementedError

    @property
    def extent(self) -> Extent:
        """What its shapes need of it."""
        return Extent(self.side_lengths, self._folder or Path(), self._t, self._travel, self._journal)

    def facts(self, comm: PETSc.Comm | None = None) -> Facts:
        return self.model.facts(self.shape, comm)

    def build(self, comm: PETSc.Comm | None = None) -> LubricationProblem:
        """The discrete problem on this scene's grid. Collective."""
        model = self.model
        try:
            return model.build(self.shape, comm)
        except InputError as error:
            raise self._named(error) from None

    def _named(self, error: InputError) -> InputError:
        return InputError(f"{self.name}: {error}") if self.name else error


class RectangleScene(FilmScene):
    """A film over [0, L] or [0, L] x [0, width] under a wall that moves in x: shapes added up, and a condition a side."""

    dimension: Literal[1, 2] = Field(1, description="1: a film h(x), per metre of width; 2: h(x, y)")
    L: Positive = metres(0.1, "length in the direction of motion")
    width: Positive | None = metres(None, "width in y; default L (2D)")
    U: Finite = measured("m/s", 5.0, "speed of the moving wall, towards larger x; negative: to smaller x; 0: at rest")
    scheme: Literal["nodal", "face", "upwind"] = Field("face", description="form of the Couette flux")
    mean_cubes: bool = Field(False, description="h^3 at a face as the mean of the nodal values")
    p_unit: Positive | None = measured("Pa", 1e6, "pressure unit of the equations")
    h_offset: Finite = metres(0.0, "added to the film everywhere: its level")
    h_floor: Positive | None = metres(None, "smallest film: the sum is cut there; default no cut")
    balance: BalanceTable | None = Field(None, description="load to carry, and what is found for it")
    n: Count = Field(100, description="points a side")
    nx: Count | None = Field(None, description="points in x; default n")
    ny: Count | None = Field(None, description="points in y; default n (2D)")

    def check(self) -> None:
        super().check()
        for key in ("ny", "width"):
            if self.dimension == 1 and (value := getattr(self, key)) is not None:
                raise ValueError(f"{key} = {value}: the scene is one-dimensional (dimension = 2 is not set)")

    @property
    def shape(self) -> tuple[int, ...]:
        nx = self.nx or self.n
        return (nx,) if self.dimension == 1 else (nx, self.ny or self.n)

    def with_shape(self, shape: tuple[int, ...]) -> Self:
        """The film that has been made is that of any grid, unless its lines are graded."""
        scene: Any = super().with_shape(shape)
        made = self._made
        if made is not None and made[0] == vars(self) and made[2].places is None and not made[2].effects:
            scene._made = dict(vars(scene)), *made[1:]
        return scene

    @property
    def side_lengths(self) -> tuple[float, ...]:
        return (self.L,) if self.dimension == 1 else (self.L, self.width or self.L)

    @property
    def cavitation_pressure(self) -> float:
        """p_c, absolute, Pa."""
        raise NotImplementedError

    def _sides(self) -> Sides:
        """West, east, south and north."""
        raise NotImplementedError

    def _parts(self) -> Sequence[Shape]:
        """The shapes of the film."""
        raise NotImplementedError

    @property
    def gap(self) -> Sum:
        """The film h(x, y) in metres."""
        level = [Block(self.h_offset, ALL, ALL)] if self.h_offset else []
        return Sum([*self._parts(), *level], self.h_floor)

    def _model(self) -> Model:
        return Model(
            lengths=self.side_lengths,
            sides=self._sides(),
            gap=self.gap,
            mu=self.mu_0,
            U=self.U,
            p_c=self.cavitation_pressure,
            p_unit=self.p_unit or 1.0,
            scheme=self.scheme,
            mean_cubes=self.mean_cubes,
            exact=self.exact,
            in_time=self.motion is not None,
            supplies=self._supplies(),  # at once: they may be all that sets the pressure
        )

    def _supplies(self) -> tuple[Supply, ...]:
        """Supplies inside the film."""
        return ()

    def exact(self) -> ExactSolution | None:
        """The exact solution; None where none is known."""
        model = self.model
        west, east, *_ = model.sides
        known = self.dimension == 1 and {west.kind, east.kind} == {"open"} and getattr(model.gap, "smooth_between", False)
        if not known or model.law or model.effects or model.supplies or west.r:
            return None
        return exact_solution(model.gap, self.L, model.mu, self.U, west.p, east.p)
