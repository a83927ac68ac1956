"""Pads that tilt about pivots, and the place of what they carry: Newton's method with the exact stiffness of the films.

Coordinates q are the runner's or journal's place and the pads' tilts; each moves the film by a mode g_j, dh = sum of g_j dq_j.
The equations are that the integrals of p g_i are those wanted: minus the load, and no moment about a pivot. Their derivatives
come from `impedance`, one factorisation a film, so a handful of solves do, each started from the last.

A pad without pressure has no moment either, and one that digs in would tip over at a touch. Both have no stiffness against
tilting, and are not what a bearing runs at: their inlets are opened, step by step, before Newton's method goes on. A pad from
which the journal has moved so far that it finds no place with stiffness idles: its inlet is closed until it has no pressure.
"""

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..base.parallel import Array
from ..errors import InputError
from ..problems.film.forces import ambient, integral
from ..problems.film.lubrication import LubricationProblem
from ..problems.film.model import Model
from ..problems.solution import Fields, Outcome, Solution
from ..scenes.scene import Scene, Solvable
from ..scenes.thrust import ThrustScene
from ..scenes.tilting import TiltingPadScene
from .ask import Ask
from .chain import Chain
from .compose import Inner
from .grooves import films_of
from .impedance import Mode, displacements, impedance
from .loop import held

MOST_SOLVES = 80
MOMENTS = 1e-8  # of the load times the lever, about a pivot
THINNER, THICKER = 0.7, 3.0  # parts of a film anywhere by which a step may change it
THINNEST = 1e-5  # film over the clearance, below which no load is looked for: a difference quotient's step is a tenth of it
NUDGES, NUDGE = 8, 0.5  # of a pad without stiffness: how often its inlet is opened, and by how much of its size of tilt


@dataclass(frozen=True)
class PadFilm:
    """A film with its modes and the numbers of the coordinates that they belong to."""

    problem: LubricationProblem
    model: Model
    fields: Fields
    modes: Sequence[Mode]
    numbers: Sequence[int]

    def pushes(self, mode: Mode) -> float:
        """Integral of (p - ambient) g. Collective."""
        return integral(self.problem, self.fields["p"] * self.problem.p_unit, ambient(self.problem), mode)


class Bearing(Protocol):
    """A scene seen as coordinates. sizes : what counts as a change of each; free : those that are to be found; pitches : the
    tilts that open an inlet."""

    sizes: Array
    free: NDArray[np.bool_]

    @property
    def pitches(self) -> Sequence[int]: ...

    def start(self) -> Array: ...

    def at(self, q: Array) -> Scene: ...

    def films(self, scene: Scene, solution: Solution) -> Iterator[PadFilm]: ...

    def misfit(self, solution: Solution, films: Sequence[PadFilm]) -> tuple[Array, Array]:
        """What is left of each equation, and what it counts by."""
        ...

    def told(self, solution: Solution, q: Array) -> dict[str, Any]: ...


@dataclass
class JournalPads:
    """Coordinates: the journal's displacement along the load and ahead of it (m), and a tilt (rad) a pad."""

    scene: TiltingPadScene
    sizes: Array = field(init=False)
    free: NDArray[np.bool_] = field(init=False)

    def __post_init__(self) -> None:
        scene, n = self.scene, len(self.scene.pivots_deg)
        self.sizes = np.array([scene.clearance] * 2 + [2.0 * scene.clearance / scene.D] * n)
        self.free = np.array([scene.balance is not None] * 2 + [scene.tilts is None] * n)

    @property
    def pitches(self) -> Sequence[int]:
        return range(2, self.sizes.size)

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

    def films(self, scene: Scene, solution: Solution) -> Iterator[PadFilm]:
        turning = self.scene.turning
        for problem, film, fields, first in films_of(held(scene, solution), solution.problem, solution.fields):  # type: ignore[arg-type]
            middle = math.degrees(float(turning.theta(np.array(first + 0.5 * problem.grid.lengths[0]))))
            off = [
                abs(math.remainder(middle - at - (0.5 - self.scene.pivot_part) * self.scene.pad_deg, 360.0))
                for at in self.scene.pivots_deg
            ]
            k = int(np.argmin(off))
            pivot = math.radians(self.scene.pivots_deg[k])

            def tilt(x: Array, y: Array, first: float = first, pivot: float = pivot) -> Array:
                return -turning.R * np.sin(turning.theta(x + first) - pivot) + 0.0 * y

            yield PadFilm(problem, film.model, fields, [*displacements(turning, first), tilt], [0, 1, 2 + k])

    def misfit(self, solution: Solution, films: Sequence[PadFilm]) -> tuple[Array, Array]:
        fx, fy = solution.problem.quantities(solution.fields)["force"]
        load = self.scene.balance.load if self.scene.balance is not None else math.hypot(fx, fy)
        moments = np.zeros(len(self.scene.pivots_deg))
        for film in films:
            moments[film.numbers[-1] - 2] = film.pushes(film.modes[-1])
        tol = self.scene.balance.tol if self.scene.balance is not None else 1.0
        lever = MOMENTS * (load or 1.0) * 0.5 * self.scene.D
        return np.array([fx + load, fy, *moments]), np.array([tol * load] * 2 + [lever] * moments.size)

    def told(self, solution: Solution, q: Array) -> dict[str, Any]:
        value = float(np.hypot(*q[:2])) / self.scene.clearance
        return {"vary": "eccentricity", "value": value, "attitude_deg": math.degrees(math.atan2(q[1], q[0])), "tilts": q[2:]}


@dataclass
class ThrustPads:
    """Coordinates: the film at the pivot (m), and a pad's pitch and, on a point, roll (rad)."""

    scene: ThrustScene
    sizes: Array = field(init=False)
    free: NDArray[np.bool_] = field(init=False)

    def __post_init__(self) -> None:
        scene = self.scene
        slope = scene.h_min / scene.side_lengths[0]
        self.sizes = np.array([scene.h_min, slope, slope])
        self.free = np.array(
            [scene.balance is not None, scene.pitch is None, scene.roll is None and scene.pivot_radius is not None]
        )

    @property
    def pitches(self) -> Sequence[int]:
        return (1,)

    def start(self) -> Array:
        scene = self.scene
        return np.array([scene.h_min, self.sizes[1] if scene.pitch is None else scene.pitch, scene.roll or 0.0])

    def at(self, q: Array) -> Scene:
        found = dict(zip(("h_min", "pitch", "roll"), map(float, q), strict=True))
        return self.scene.model_copy(update={**found, "balance": None})

    def films(self, scene: Scene, solution: Solution) -> Iterator[PadFilm]:
        assert isinstance(scene, ThrustScene) and isinstance(solution.problem, LubricationProblem)
        modes = [lambda x, y: 1.0 + 0.0 * (x + y), *scene.tilt_modes]
        film = held(scene, solution)
        yield PadFilm(film.build(solution.problem.grid.petsc_comm), film.model, solution.fields, modes, [0, 1, 2])

    def misfit(self, solution: Solution, films: Sequence[PadFilm]) -> tuple[Array, Array]:
        (film,) = films
        pushes = np.array([film.pushes(mode) for mode in film.modes])
        table = self.scene.balance
        load = table.load / self.scene.pads if table is not None else pushes[0]
        lever = MOMENTS * abs(load or 1.0) * self.scene.side_lengths[0]
        return pushes - np.array([load, 0.0, 0.0]), np.array([(table.tol if table else 1.0) * abs(load or 1.0), lever, lever])

    def told(self, solution: Solution, q: Array) -> dict[str, Any]:
        return {"vary": "h_min", "value": float(q[0]), "tilts": q[1:]}


def bearing_of(scene: Solvable) -> Bearing | None:
    """The scene as coordinates, where it has some that are to be found."""
    if isinstance(scene, TiltingPadScene) and (scene.balance is not None or scene.tilts is None):
        return JournalPads(scene)
    if isinstance(scene, ThrustScene) and scene.pivot_part is not None:
        return ThrustPads(scene)
    return None


def applies(scene: Solvable, ask: Ask) -> bool:
    """Whether the scene has pads whose tilts, or a place that, are to be found."""
    return bearing_of(scene) is not None


def solve(scene: Solvable, ask: Ask, inner: Inner) -> Solution:
    """The solution where everything balances; its outcome is LOAD_NOT_CARRIED where no such place was found. Collective."""
    bearing = bearing_of(scene)
    assert bearing is not None  # as `applies` found
    q = bearing.start()
    known = ask.start.settings.get("relative_coordinates") if ask.start is not None else None
    if known is None or len(known) != q.size or not bearing.free[0]:
        return _from(bearing, q, scene, ask, inner)
    with suppress(InputError):  # a neighbour's pads may leave no film here
        solution = _from(bearing, np.where(bearing.free, bearing.sizes * known, q), scene, ask, inner)
        if solution.converged:
            return solution
        solution.destroy()
    return _from(bearing, q, scene, replace(ask, start=None), inner)


def _from(bearing: Bearing, q: Array, scene: Solvable, ask: Ask, inner: Inner) -> Solution:
    """From one place. Collective."""
    chain = Chain(ask, inner)
    found, again = False, False
    nudges, nudge = np.zeros(q.size, dtype=int), np.zeros(q.size)
    for count in range(1, MOST_SOLVES + 1):
        at = bearing.at(q)
        solution = chain.solve(at)
        if not solution.converged:
            break
        films = list(bearing.films(at, solution))
        off, counts = bearing.misfit(solution, films)
        if min(float(np.min(one.problem.film(*_places(one)))) for one in films) < THINNEST * bearing.sizes[0]:
            _free(films)
            break
        K = _stiffness(films, q.size)
        for k in bearing.pitches:
            opens = bearing.free[k] and not K[k, k] > 0 and nudges[k] < NUDGES
            closes = bearing.free[k] and nudges[k] >= NUDGES and abs(off[k]) > counts[k]
            nudge[k] = NUDGE * bearing.sizes[k] * (opens - 1.0 * closes)
        nudges += nudge > 0
        found = bool(np.all(np.abs(off[bearing.free]) <= counts[bearing.free])) and not nudge.any()
        if found and not again and (nudges >= NUDGES).any():  # from the place that was found, a pad that idles may find its own
            nudge = np.where(nudges >= NUDGES, NUDGE * bearing.sizes, 0.0)
            nudges, found, again = np.zeros_like(nudges), False, True
        step = _step(bearing, films, K, off, counts, nudge, bearing.free & (nudge == 0) & (nudges < NUDGES))
        _free(films)
        if found or count == MOST_SOLVES:
            break
        q = q + step
    _tell(scene, bearing, solution, q, found, count)
    return solution


def _places(film: PadFilm) -> tuple[Array, Array]:
    """x, y of all points of the film, its sides among them, on every rank."""
    grid = film.problem.grid
    return grid.with_neighbours(0)[None, :], grid.with_neighbours(1)[:, None]


def _free(films: Sequence[PadFilm]) -> None:
    """Collective."""
    for film in films:
        film.problem.destroy()


def _stiffness(films: Sequence[PadFilm], size: int) -> Array:
    """-d(integral of p g_i)/dq_j of all films together. Collective."""
    K = np.zeros((size, size))
    for film in films:
        (one,) = impedance(film.problem, film.model, film.fields, film.modes, (0.0,))
        K[np.ix_(film.numbers, film.numbers)] += one.real
    return K


def _step(
    bearing: Bearing, films: Sequence[PadFilm], K: Array, off: Array, counts: Array, nudge: Array, moves: NDArray[np.bool_]
) -> Array:
    """Newton's step of what moves, and the nudges, shortened where it would change a film by too much. Collective."""
    free, step = np.flatnonzero(moves), nudge.copy()
    scaled = -K[np.ix_(free, free)] * bearing.sizes[free] / counts[free, None]
    step[free] = bearing.sizes[free] * np.linalg.lstsq(scaled, -off[free] / counts[free], rcond=1e-13)[0]
    share = 1.0
    for film in films:
        x, y = _places(film)
        moved = sum(step[k] * mode(x, y) for k, mode in zip(film.numbers, film.modes, strict=True))
        change = moved / film.problem.film(x, y)
        falls, grows = float(np.max(-change)), float(np.max(change))
        share = min(share, THINNER / max(falls, THINNER), THICKER / max(grows, THICKER))
    return share * step


def _tell(scene: Any, bearing: Bearing, solution: Solution, q: Array, found: bool, count: int) -> None:
    """Outcome, record and the pads' numbers on the solution. Collective."""
    values, told = solution.problem.quantities(solution.fields), bearing.told(solution, q)
    place = f"{told['vary']} = {told['value']:.8g}, tilts {', '.join(f'{tilt:.4g}' for tilt in told['tilts'])} rad"
    if solution.converged and not found:
        wanted = "" if scene.balance is None else f"{scene.balance.load:g} asked for; "
        solution.outcome = Outcome.LOAD_NOT_CARRIED
        solution.message = f"{wanted}no balance was found in {count} solves; the last: {place} carries {values['load']:.8g}"
    tilts = [float(tilt) for tilt in told["tilts"]]
    solution.problem.more |= {"pad_tilts": tilts}  # type: ignore[attr-defined]
    solution.settings |= {"coordinates": [float(one) for one in q], "relative_coordinates": q / bearing.sizes}
    solution.because(f"pads: {place}, found in {count} solves", after=True)
    if "attitude_deg" in told:
        solution.settings["attitude_deg"] = told["attitude_deg"]
    if scene.balance is not None:
        record = {"load": scene.balance.load, "carried": values["load"], "iterations": count, "solves": count}
        solution.settings["balance"] = {"vary": told["vary"], "value": told["value"], **record}
