"""[motion] of a scene file: how long and in which steps the film goes on in time, what moves and how."""

from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Field

from ..errors import InputError
from .changes import flat
from .formula import Formula, TimeText
from .scene import Finite, Positive
from .units import Measured, measured

AtTime = Annotated[float | str, TimeText]
Pair = tuple[AtTime, AtTime]
Course = Callable[[float], tuple[float, ...]]  # [X, Y] of a journal, or a film's level, at the time t
LEAST, MOST = 2e-9, 0.5  # tolerances of a finer and a coarser march
TOL = 1e-3  # where neither steps, nor dt, nor tol is given


class MotionTable(Measured):
    """[motion] of a scene file. The film's formulas may then depend on t; shapes with `moves` travel with the wall.

    Places of the journal are [X, Y] in parts of its clearance, in the axes of its angles: the film is
    c (1 - X cos(phi) - Y sin(phi)). Of a film without a journal the level moves: h_offset, by which it is thicker everywhere.
    """

    t_end: Positive = measured("s", ..., "end of the march, which begins at t = 0")
    steps: Annotated[int, Field(strict=True, ge=2, le=10_000_000)] | None = Field(None, description="equal steps up to t_end")
    dt: Positive | None = measured("s", None, "length of the steps, in place of their number")
    tol: Annotated[Finite, Field(gt=1e-9, lt=1)] | None = Field(
        None, description="steps as long as this relative error of the film's rates allows; default 1e-3 without steps and dt"
    )
    scheme: Literal["bdf2", "euler"] = Field("bdf2", description="two-step backward difference, or implicit Euler")
    start: Literal["steady", "full"] = Field("steady", description="at t = 0 the film's steady answer, or a film without void")
    fill: Annotated[Finite, Field(gt=0, le=1)] | None = Field(
        None, description="at t = 0 this part of the film is oil, everywhere, in place of `start`"
    )
    set: Annotated[dict[str, AtTime | list[AtTime]], BeforeValidator(flat)] = Field(
        {}, description="numbers of the scene that change, by their keys (as in --set): formulas of t, in SI"
    )
    journal: Pair | None = Field(None, description="where the journal is: [X, Y], formulas of t")
    file: str | None = Field(
        None, description="where it is: a .csv with rows t, X, Y, or t, h_offset without a journal, a cubic spline between them"
    )
    free: bool = Field(False, description="the journal, or the level of the film, goes where load, film and mass take it")
    load: AtTime | Pair | None = measured("N or N/m", None, "on a free journal [F_X, F_Y], on a film one number; formulas of t")
    mass: Annotated[Finite, Field(ge=0)] | None = measured("kg or kg/m", None, "of a free journal, or of what is on the film")
    position: Finite | tuple[Finite, Finite] | None = Field(
        None, description="of what is free at t = 0: [X, Y], or h_offset in m; default: where the scene has it"
    )
    velocity: Finite | tuple[Finite, Finite] = Field(
        (0.0, 0.0), description="of what is free at t = 0, clearances per second; of a film's level m/s"
    )
    pad_inertia: Annotated[Finite, Field(ge=0)] = measured(
        "kg m2", 0.0, "of a tilting pad about its pivot; 0: no moment is left at any time"
    )

    def check(self) -> None:
        lengths = [key for key in ("steps", "dt", "tol") if getattr(self, key) is not None]
        if len(lengths) > 1:
            raise ValueError(f"{' and '.join(lengths)} are both given: one of them says how long the steps are")
        if self.dt is not None and self.dt > 0.5 * self.t_end:
            raise ValueError(f"dt = {self.dt:g}: at least two steps up to t_end = {self.t_end:g} are needed")
        ways = [key for key in ("journal", "file", "free") if getattr(self, key)]
        if len(ways) > 1:
            raise ValueError(f"{' and '.join(ways)} are both given: one of them says where the journal is")
        if ways and "h_offset" in self.set:
            raise ValueError(f"{ways[0]} and set.h_offset are both given: one of them says where the film's level is")
        for key in ("load", "mass"):
            if self.free and getattr(self, key) is None:
                raise ValueError(f"{key} is missing: a free journal, or film, has a load and a mass")
        if not self.free:
            unused = {"load": None, "mass": None, "position": None, "velocity": (0.0, 0.0)}
            if given := [key for key, none in unused.items() if getattr(self, key) != none]:
                raise ValueError(f"{given[0]}: the journal is not free (free = true is not set)")

    def check_for(self, journal: bool, pads: bool) -> None:
        """Raise ValueError where this is not of such a scene; pads : whether some tilt."""
        if self.journal is not None and not journal:
            raise ValueError("motion.journal: there is no journal; the level of the film is motion.set.h_offset, file or free")
        for key in ("load", "position", "velocity") if self.free else ():
            value: Any = getattr(self, key)
            if value is not None and isinstance(value, tuple) != journal and value != (0.0, 0.0):
                raise ValueError(f"motion.{key} = {value}: {'[X, Y]' if journal else 'one number, of the level,'} is needed")
        if self.pad_inertia and not pads:
            raise ValueError(f"motion.pad_inertia = {self.pad_inertia:g}: no pads follow")

    def start_of(self, place: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
        """Place and velocity of what is free at t = 0; place : where the scene has it."""
        velocity = np.atleast_1d(np.array(self.velocity, dtype=float))
        given = place if self.position is None else self.position
        return np.atleast_1d(np.array(given, dtype=float)), velocity[: len(place)]

    @property
    def moves_journal(self) -> bool:
        return self.free or self.journal is not None or self.file is not None

    @property
    def step(self) -> float | None:
        """Length of the steps, s; None where an error estimate says."""
        if self.steps is not None:
            return self.t_end / self.steps
        return None if self.dt is None else self.t_end / max(2, round(self.t_end / self.dt))

    @property
    def tolerance(self) -> float:
        return self.tol if self.tol is not None else TOL

    def finer(self, times: float) -> Self:
        """The same march in steps shorter by this factor; where an error estimate says how long they are, by its tolerance."""
        if times == 1.0:
            return self
        if self.step is not None:
            return self.model_copy(update={"steps": max(2, round(self.t_end / self.step * times)), "dt": None})
        order = 2 if self.scheme == "bdf2" else 1
        return self.model_copy(update={"tol": min(max(self.tolerance / times**order, LEAST), MOST)})

    def course(self, folder: Path | None, count: int = 2) -> Course | None:
        """Where the journal is at any time, if that is given; count : 1 without a journal.

        Raises
        ------
        InputError : a file that cannot be read, or does not reach t_end.
        """
        if self.file is not None:
            from scipy.interpolate import CubicSpline  # here: it takes a while

            rows = _rows((folder or Path()) / self.file, self.t_end, ("t, X, Y" if count == 2 else "t, h_offset"))
            spline = CubicSpline(rows[:, 0], rows[:, 1:])
            return lambda t: tuple(map(float, spline(t)))
        if "h_offset" in self.set and count == 1:
            return lambda t: _values("motion.set.h_offset", [self.set["h_offset"]], t)  # type: ignore[list-item]
        texts = self.journal
        return None if texts is None else lambda t: _values("motion.journal", texts, t)

    def changes(self, t: float) -> dict[str, Any]:
        """The numbers of the scene at the time t, by their keys.

        Raises
        ------
        InputError : a formula without a value.
        """
        found = {}
        for key, text in self.set.items():
            values = _values(f"motion.set.{key}", text if isinstance(text, list) else [text], t)
            found[key] = [*values] if isinstance(text, list) else values[0]
        return found

    def load_at(self, t: float) -> tuple[float, ...]:
        """On the journal, or the film, N (1D: N/m).

        Raises
        ------
        InputError : a formula without a value.
        """
        assert self.load is not None  # as the validator found
        return _values("motion.load", self.load if isinstance(self.load, tuple) else [self.load], t)


@lru_cache(maxsize=64)  # a march asks for the same few in every step
def _of_time(text: float | str) -> Formula:
    return Formula(text, ("t",))


def _values(name: str, texts: Sequence[float | str], t: float) -> tuple[float, ...]:
    nowhere = np.zeros(())
    found = tuple(float(_of_time(text)(nowhere, nowhere, t)) for text in texts)
    if not np.all(np.isfinite(found)):
        raise InputError(f"{name} = {', '.join(map(str, texts))}: no number at t = {t:g} s")
    return found


def _rows(path: Path, t_end: float, names: str) -> np.ndarray:
    """A file's columns of these names; lines that begin with # and a head line are passed over."""
    rows: list[list[float]] = []
    try:
        lines: list[Any] = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, ValueError) as error:
        raise InputError(f"motion.file {path}: {getattr(error, 'strerror', None) or 'not a text file'}") from None
    for number, line in enumerate(lines, start=1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        try:
            row = [float(word) for word in line.replace(";", ",").split(",")]
        except ValueError:
            if rows or number > 1:
                raise InputError(f"motion.file {path}, line {number}: {line[:60]}: numbers {names} are needed") from None
            continue
        if len(row) != names.count(",") + 1 or not np.all(np.isfinite(row)) or (rows and row[0] <= rows[-1][0]):
            raise InputError(f"motion.file {path}, line {number}: {line[:60]}: {names} with growing t are needed")
        rows.append(row)
    if len(rows) < 2 or rows[0][0] > 0 or rows[-1][0] < t_end * (1 - 1e-12):
        raise InputError(f"motion.file {path}: two rows and more from t = 0 to t_end = {t_end:g} s are needed")
    return np.array(rows)
