"""What moves rigidly in a march: a journal or a film's level, and pads that tilt, as coordinates with a mass each."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...base.parallel import Array
from ...errors import InputError
from ...problems.film.forces import PIVOT, totals
from ...problems.film.grooves import GroovedProblem
from ...problems.solution import Solution
from ...scenes.motion import Course, MotionTable
from ...scenes.scene import as_scene
from ...scenes.thrust import ThrustScene
from ...scenes.tilting import TiltingPadScene
from ..ask import Ask
from ..compose import Inner
from ..grooves import SideBySide, SolvedFilm, films_of
from ..loads import pads
from ..loads.pad_coordinates import FilmWithModes, JournalPads, ThrustPads
from ..motions.impedance import displacements, rising, stiffness
from ..motions.response import Change
from .step import TimeStep


class Coordinates:
    """Of a scene: first its `place`, behind it the tilts of its pads that follow.

    names : in the history; pushes : the integral of the pressure that acts on each; unit : m or rad of one of each; reach : m
    of the film that one of each moves; free : those that are to be found; mass : kg or kg m2, of the part of the bearing that
    is solved; first : number of coordinates of the place.
    """

    def __init__(self, scene: Any, table: MotionTable):
        self.scene, self.table = scene, table
        journal, follow = scene.turning, scene.pads_follow
        self.journal = journal is not None
        self.pads: Any = None
        place, pushes = (["journal_x", "journal_y"], ["force_x", "force_y"]) if self.journal else (["h_offset"], ["load"])
        names, reach, found = list[str](), list[float](), list[bool]()
        if follow and self.journal:
            self.pads, n = JournalPads(scene), len(scene.pivots_deg)
            names, reach, found = [f"tilt_{k + 1}" for k in range(n)], [journal.R] * n, [True] * n
        elif follow:
            self.pads = ThrustPads(scene)
            names, reach, found = ["pitch", "roll"], list(scene.side_lengths), list(scene.tilts_found)
        self.first, tilts = len(place), len(names)
        self.names = [*place, *names]
        self.pushes = [*pushes, *(f"{PIVOT}{k + 1}" for k in range(tilts))]
        self.shares = scene.pads if isinstance(scene, ThrustScene) else 1  # of the load: one sector is solved
        self.unit = np.array([journal.c if journal else 1.0] * self.first + [1.0] * tilts)
        self.reach = np.array([journal.c if journal else 1.0] * self.first + reach)
        self.free = np.array([table.free] * self.first + found, dtype=bool)
        self.mass = np.array([(table.mass or 0.0) / self.shares] * self.first + [table.pad_inertia] * tilts)

    @property
    def any(self) -> bool:
        """Whether anything is to be found."""
        return bool(self.free.any())

    def loads(self, t: float) -> Array:
        """On each, N or N m; what lies on a film presses it down."""
        out = np.zeros(self.unit.size)
        if self.table.free:
            given = np.array(self.table.load_at(t)) / self.shares
            out[: given.size] = given if self.journal else -given
        return out

    def begin(self, course: Course | None, ask: Ask | None, inner: Inner | None) -> tuple[Array, Array]:
        """Places and speeds at t = 0: pads where the steady film has them; without `inner`, as a search for that begins.

        Raises
        ------
        InputError : pads that find no place. Collective.
        """
        place, velocity = self.table.start_of(self.scene.place)
        if course is not None:
            place, velocity = np.array(course(0.0)), np.zeros(place.size)
        if self.pads is None:
            return place, velocity
        changes = self.table.changes(0.0)
        still: Any = as_scene(self.scene, changes) if changes else self.scene
        still = still.moved(place).model_copy(update={"motion": None})
        q = np.concatenate([place, type(self.pads)(still).start()[place.size :]])
        if ask is not None and inner is not None:
            solution = pads.solve(still, ask, inner)
            if not solution.converged:
                why = f"no steady film at t = 0: {solution.message}; motion.start = full needs none"
                raise InputError(f"{self.scene.name}: {why}")
            q[place.size :] = solution.settings["coordinates"][place.size :]
            solution.destroy()
        return q, np.concatenate([velocity, np.zeros(q.size - place.size)])

    def _film(self, one: SolvedFilm) -> FilmWithModes:
        if isinstance(self.scene, TiltingPadScene) and self.pads is not None:
            return self.pads._pad(one)
        return FilmWithModes(one.problem, one.film.model, one.fields, self._modes(one.first), (0, 1))

    def _modes(self, first: float) -> list[Change]:
        if self.journal:
            return displacements(self.scene.turning, first)
        return [rising, *(self.scene.tilt_modes if self.pads is not None else ())]

    def forces(self, solution: Solution) -> Array:
        """What the film of a solved step does to each, N or N m. Collective."""
        problem: Any = solution.problem
        found = totals(problem, solution.fields["p"] * problem.p_unit, solution.fields["r"], wanted=self.pushes)
        return np.array([found[name] for name in self.pushes])

    def stiffness(self, step: TimeStep, solution: Solution) -> Array:
        """Minus the derivatives of `forces` by m and rad. Collective."""
        problem: Any = solution.problem

        def of(film: FilmWithModes) -> Array:
            return film.spread(stiffness(film.response()), self.unit.size)

        if isinstance(problem, GroovedProblem):
            with films_of(step, problem, solution.fields) as films:
                return films.sum(lambda one: of(self._film(one)))
        comm, modes = problem.grid.comm, self._modes(0.0)
        film = FilmWithModes(problem, step.model, solution.fields, modes, range(len(modes)))
        return SideBySide(comm, comm, [film]).sum(of)

    def told(self, place: Sequence[float]) -> dict[str, Any]:
        """As numbers of an answer."""
        found = [float(one) for one in place]
        tilts = {"pad_tilts": found[self.first :]} if self.pads is not None else {}
        return {"journal": found[:2]} | tilts if self.journal else {"h_offset": found[0]} | tilts
