"""[motion] of a scene file: how long and in which steps the film goes on in time, and where its journal is."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from ..errors import InputError
from .formula import TimeText, of_time
from .scene import Finite, Positive
from .units import Measured, measured

AtTime = Annotated[float | str, TimeText]
Pair = tuple[AtTime, AtTime]
Course = Callable[[float], tuple[float, float]]  # [X, Y] of a journal at the time t
TOL = 1e-3  # where neither steps, nor dt, nor tol is given


class MotionTable(Measured):
    """[motion] of a scene file. The film's formulas may then depend on t; shapes with `moves` travel with the wall.

    Places of the journal are [X, Y] in parts of its clearance, in the axes of its angles: the film is
    c (1 - X cos(phi) - Y sin(phi)).
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
    journal: Pair | None = Field(None, description="where the journal is: [X, Y], formulas of t")
    file: str | None = Field(None, description="where the journal is: a .csv with rows t, X, Y, a cubic spline between them")
    free: bool = Field(False, description="the journal goes where load, film and its mass take it")
    load: Pair | None = measured("N or N/m", None, "on a free journal: [F_X, F_Y], formulas of t")
    mass: Annotated[Finite, Field(ge=0)] | None = measured("kg or kg/m", None, "of a free journal")
    position: tuple[Finite, Finite] | None = Field(
        None, description="of a free journal at t = 0: [X, Y]; default: where the scene has it"
    )
    velocity: tuple[Finite, Finite] = Field((0.0, 0.0), description="of a free journal at t = 0, clearances per second")

    def check(self) -> None:
        lengths = [key for key in ("steps", "dt", "tol") if getattr(self, key) is not None]
        if len(lengths) > 1:
            raise ValueError(f"{' and '.join(lengths)} are both given: one of them says how long the steps are")
        if self.dt is not None and self.dt > 0.5 * self.t_end:
            raise ValueError(f"dt = {self.dt:g}: at least two steps up to t_end = {self.t_end:g} are needed")
        ways = [key for key in ("journal", "file", "free") if getattr(self, key)]
        if len(ways) > 1:
            raise ValueError(f"{' and '.join(ways)} are both given: one of them says where the journal is")
        for key in ("load", "mass"):
            if self.free and getattr(self, key) is None:
                raise ValueError(f"{key} is missing: a free journal has a load and a mass")
        if not self.free:
            unused = {"load": None, "mass": None, "position": None, "velocity": (0.0, 0.0)}
            if given := [key for key, none in unused.items() if getattr(self, key) != none]:
                raise ValueError(f"{given[0]}: the journal is not free (free = true is not set)")

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

    def course(self, folder: Path | None) -> Course | None:
        """Where the journal is at any time, if that is given.

        Raises
        ------
        InputError : a file that cannot be read, or does not reach t_end.
        """
        if self.file is not None:
            from scipy.interpolate import CubicSpline  # here: it takes a while

            rows = _rows((folder or Path()) / self.file, self.t_end)
            spline = CubicSpline(rows[:, 0], rows[:, 1:])
            return lambda t: tuple(map(float, spline(t)))  # type: ignore[return-value]
        texts = self.journal
        return None if texts is None else lambda t: _values("motion.journal", texts, t)

    def load_at(self, t: float) -> tuple[float, float]:
        """On the journal, N (1D: N/m).

        Raises
        ------
        InputError : a formula without a value.
        """
        assert self.load is not None  # as the validator found
        return _values("motion.load", self.load, t)


def _values(name: str, texts: Pair, t: float) -> tuple[float, float]:
    found = of_time(texts[0], t), of_time(texts[1], t)
    if not np.all(np.isfinite(found)):
        raise InputError(f"{name} = [{texts[0]}, {texts[1]}]: no number at t = {t:g} s")
    return found


def _rows(path: Path, t_end: float) -> np.ndarray:
    """t, X, Y of a file; lines that begin with # and a head line are passed over."""
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
                raise InputError(f"motion.file {path}, line {number}: {line[:60]}: three numbers t, X, Y are needed") from None
            continue
        if len(row) != 3 or not np.all(np.isfinite(row)) or (rows and row[0] <= rows[-1][0]):
            raise InputError(f"motion.file {path}, line {number}: {line[:60]}: t, X, Y with growing t are needed")
        rows.append(row)
    if len(rows) < 2 or rows[0][0] > 0 or rows[-1][0] < t_end * (1 - 1e-12):
        raise InputError(f"motion.file {path}: two rows and more from t = 0 to t_end = {t_end:g} s are needed")
    return np.array(rows)
