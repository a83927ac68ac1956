"""Bearings of pads that tilt as coordinates: the place of what they carry, and their tilts (`pads` finds them)."""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...base.parallel import Array
from ...problems.film.forces import PIVOT, totals
from ...problems.film.lubrication import LubricationProblem
from ...problems.film.model import Model
from ...problems.solution import Fields, Solution
from ...scenes.scene import Scene, Solvable
from ...scenes.thrust import ThrustScene
from ...scenes.tilting import TiltingPadScene
from ..grooves import SideBySide, SolvedFilm, films_of
from ..motions.impedance import displacements, held, rising
from ..motions.response import Change, Response

FEWEST = 8  # points of a coarse grid along a pad
MOMENTS = 1e-8  # of the load times the lever, about a pivot


@dataclass(frozen=True)
class FilmWithModes:
    """A film with its modes and the numbers of the coordinates that they belong to."""

    problem: LubricationProblem
    model: Model
    fields: Fields
    modes: Sequence[Change]
    numbers: Sequence[int]

    def response(self) -> Response:
        """To its modes. Collective."""
        return Response(self.problem, self.model, self.fields, self.modes)

    def spread(self, found: Any, n: int) -> Any:
        """What was found of its modes, shape (..., modes, modes), at their places among n coordinates."""
        out = np.zeros((*found.shape[:-2], n, n), dtype=found.dtype)
        out[..., *np.ix_(self.numbers, self.numbers)] = found
        return out


ModeFilms = SideBySide[FilmWithModes]


class JournalPads:
    """Coordinates: the journal's displacement along the load and ahead of it (m), and a tilt (rad) a pad.

    sizes : what counts as a change of each; free : those that are to be found.
    """

    def __init__(self, scene: TiltingPadScene):
        self.scene, n = scene, len(scene.pivots_deg)
        self.sizes = np.array([scene.clearance] * 2 + [2.0 * scene.clearance / scene.D] * n)
        self.free = np.array([scene.balance is not None] * 2 + [scene.tilts is None] * n)

    @property
    def pitches(self) -> Sequence[int]:
        """The tilts that open an inlet."""
        return range(2, self.sizes.size)

    @property
    def fewest(self) -> int:
        """Points around of a coarse grid."""
        return math.ceil(FEWEST * 360.0 / self.scene.pad_deg)

    def start(self) -> Array:
        scene = self.scene
        angle = math.radians(scene.attitude_deg)
        e = scene.clearance * scene.eccentricity * np.array([math.cos(angle), math.sin(angle)])
        # Pads that follow the journal, each inlet open by a part of the film at its pivot: no film is below 0 that need not be.
        towards = np.radians(scene.pivots_deg) - angle
        film = np.maximum(1.0 - scene.eccentricity * np.cos(towards), 0.0)
        tilts = self.sizes[2:] * (scene.eccentricity * np.sin(towards) + film / math.radians(scene.pad_deg))
        return np.array([*e, *(scene.tilts if scene.tilts is not None else tilts)])

    def at(self, q: Array) -> Scene:
        e = {
            "eccentricity": float(np.hypot(*q[:2])) / self.scene.clearance,
            "attitude_deg": math.degrees(math.atan2(q[1], q[0])),
        }
        return self.scene.model_copy(update={**e, "tilts": [float(tilt) for tilt in q[2:]], "balance": None})

    @contextmanager
    def films(self, scene: Scene, solution: Solution) -> Iterator[ModeFilms]:
        with films_of(held(scene, solution), solution.problem, solution.fields) as films:  # type: ignore[arg-type]
            yield replace(films, mine=[self._pad(one) for one in films.mine])  # type: ignore[misc]

    def _pad(self, one: SolvedFilm) -> FilmWithModes:
        turning, first = self.scene.turning, one.first
        middle = math.degrees(float(turning.theta(np.array(first + 0.5 * one.problem.grid.lengths[0]))))
        off = [
            abs(math.remainder(middle - at - (0.5 - self.scene.pivot_part) * self.scene.pad_deg, 360.0))
            for at in self.scene.pivots_deg
        ]
        k = int(np.argmin(off))
        pivot = math.radians(self.scene.pivots_deg[k])

        def tilt(x: Array, y: Array) -> Array:
            return -turning.R * np.sin(turning.theta(x + first) - pivot) + 0.0 * y

        return FilmWithModes(one.problem, one.film.model, one.fields, [*displacements(turning, first), tilt], [0, 1, 2 + k])

    @property
    def keys(self) -> Sequence[str]:
        """The scene's, of the coordinates."""
        return ["eccentricity", "attitude_deg", *(f"tilts.{k + 1}" for k in self._pads)]

    @property
    def conditions(self) -> dict[str, float]:
        """The numbers of the results that are met by what is found, and their values: in the order of the coordinates."""
        table = self.scene.balance
        return {"load": table.load if table is not None else 0.0, "force_y": 0.0} | {f"{PIVOT}{k + 1}": 0.0 for k in self._pads}

    @property
    def _pads(self) -> range:
        return range(len(self.scene.pivots_deg))

    def misfit(self, solution: Solution) -> tuple[Array, Array]:
        """What is left of each equation, and what it counts by."""
        told = _integrals(solution)
        fx, fy = told["force_x"], told["force_y"]
        table, moments = self.scene.balance, [told[f"{PIVOT}{k + 1}"] for k in self._pads]
        load, tol = (table.load, table.tol) if table is not None else (math.hypot(fx, fy), 1.0)
        lever = _moments(self.scene) * (load or 1.0) * 0.5 * self.scene.D
        return np.array([fx + load, fy, *moments]), np.array([tol * load] * 2 + [lever] * len(moments))

    def told(self, q: Array) -> dict[str, Any]:
        value = float(np.hypot(*q[:2])) / self.scene.clearance
        return {"vary": "eccentricity", "value": value, "attitude_deg": math.degrees(math.atan2(q[1], q[0])), "tilts": q[2:]}


class ThrustPads:
    """Coordinates: the film at the pivot (m), and a pad's pitch and, on a point, roll (rad); `sizes` and `free` as above."""

    def __init__(self, scene: ThrustScene):
        self.scene, slope = scene, scene.h_min / scene.side_lengths[0]
        self.sizes = np.array([scene.h_min, slope, slope])
        self.free = np.array([scene.balance is not None, *scene.tilts_found])

    @property
    def pitches(self) -> Sequence[int]:
        return (1,)

    @property
    def fewest(self) -> int:
        return FEWEST

    def start(self) -> Array:
        scene = self.scene
        return np.array([scene.h_min, self.sizes[1] if scene.pitch is None else scene.pitch, scene.roll or 0.0])

    def at(self, q: Array) -> Scene:
        found = dict(zip(("h_min", "pitch", "roll"), map(float, q), strict=True))
        return self.scene.model_copy(update={**found, "balance": None})

    @contextmanager
    def films(self, scene: Scene, solution: Solution) -> Iterator[ModeFilms]:
        assert isinstance(scene, ThrustScene) and isinstance(solution.problem, LubricationProblem)
        modes = [rising, *scene.tilt_modes]
        film, grid = held(scene, solution), solution.problem.grid
        problem = film.build(grid.petsc_comm)
        yield SideBySide(grid.comm, grid.comm, [FilmWithModes(problem, film.model, solution.fields, modes, [0, 1, 2])])
        problem.destroy()

    @property
    def keys(self) -> Sequence[str]:
        return "h_min", "pitch", "roll"

    @property
    def conditions(self) -> dict[str, float]:
        table = self.scene.balance
        return {"load": table.load if table is not None else 0.0, f"{PIVOT}1": 0.0, f"{PIVOT}2": 0.0}

    def misfit(self, solution: Solution) -> tuple[Array, Array]:
        told = _integrals(solution)
        pushes = np.array([told["load"], told[f"{PIVOT}1"], told[f"{PIVOT}2"]])
        table = self.scene.balance
        load = table.load / self.scene.pads if table is not None else pushes[0]
        lever = _moments(self.scene) * abs(load or 1.0) * self.scene.side_lengths[0]
        return pushes - np.array([load, 0.0, 0.0]), np.array([(table.tol if table else 1.0) * abs(load or 1.0), lever, lever])

    def told(self, q: Array) -> dict[str, Any]:
        return {"vary": "h_min", "value": float(q[0]), "tilts": q[1:]}


Bearing = JournalPads | ThrustPads


def _integrals(solution: Solution) -> dict[str, float]:
    """Of the pressure: forces and moments. Collective."""
    problem: Any = solution.problem
    return totals(problem, solution.fields["p"] * problem.p_unit, solution.fields["r"])


def _moments(scene: Any) -> float:
    """What may be left of a moment: less than of the load, if that need not be met to the last digits."""
    return max(MOMENTS, 0.01 * scene.balance.tol) if scene.balance is not None else MOMENTS


def bearing_of(scene: Solvable) -> Bearing | None:
    """The scene as coordinates, where it has some that are to be found."""
    if isinstance(scene, TiltingPadScene) and (scene.balance is not None or scene.tilts is None):
        return JournalPads(scene)
    if isinstance(scene, ThrustScene) and scene.pivot_part is not None:
        return ThrustPads(scene)
    return None
