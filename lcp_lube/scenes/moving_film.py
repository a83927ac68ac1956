"""How the film of a bearing moves in time: shapes that change, and a journal among them."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace
from typing import TYPE_CHECKING

from ..problems.film.model import Model
from ..problems.film.turning import Turning
from .film import JournalPart
from .moving import Models

if TYPE_CHECKING:
    from .bearing import BearingScene


def check_motion(scene: BearingScene) -> None:
    """Raise ValueError where shapes and [motion] contradict one another."""
    journals = sum(isinstance(table, JournalPart) for table in scene.film)
    for k, table in enumerate(scene.film, start=1):
        if scene.motion is None and table.changes and not isinstance(table, JournalPart):
            raise ValueError(f"film.{k} ({table.shape}) changes with time: a table [motion] is needed")  # type: ignore[attr-defined]
        if table.moves and isinstance(table, JournalPart):
            raise ValueError(f"film.{k}.moves: a journal's place is motion.journal, motion.file or motion.free")
    if scene.motion is None:
        return
    if scene.balance is not None:
        raise ValueError("balance and motion are both given: one of them; a load in time is that of motion.free")
    if scene.motion.moves_journal and journals != 1:
        raise ValueError(f"motion: its journal is the shape 'journal' of [[film]]; there are {journals}, 1 is needed")


def moving_film(scene: BearingScene) -> Models:
    """The film at the time t (s), its journal, if that moves, at [X, Y] of its clearance; shapes at rest are made once."""
    first, extent = replace(scene.model, exact=None), scene.extent
    known = [None if table.changes else table.part(extent) for table in scene.film]

    def at(t: float, journal: tuple[float, float] | None) -> Model:
        now = replace(extent, t=t, travel=scene.U * t, journal=journal)
        parts = [table.placed(now) if part is None else part for table, part in zip(scene.film, known, strict=True)]
        shaft = first.shaft
        if shaft is not None and journal is not None:
            shaft = replace(shaft, widest=math.pi + math.atan2(journal[1], journal[0]))
        return replace(first, gap=scene.sum_of(parts), shaft=shaft)

    return at


def _journal(scene: BearingScene) -> JournalPart | None:
    return next((table for table in scene.film if isinstance(table, JournalPart)), None)


def place_of(scene: BearingScene) -> tuple[float, float]:
    """[X, Y] of the journal among the shapes, in parts of its clearance."""
    if (table := _journal(scene)) is None:
        return 0.0, 0.0
    e = cmath.rect(table.eccentricity, math.pi + 2.0 * math.pi * table.widest / scene.L)
    return e.real, e.imag


def turning_of(scene: BearingScene) -> Turning | None:
    """The journal among the shapes; None for a flat film."""
    if (table := _journal(scene)) is None:
        return None
    R = scene.L / (2.0 * math.pi)
    return Turning(R, table.c, scene.side_lengths[1] if scene.dimension == 2 else 1.0, scene.U / R, 0.0)
