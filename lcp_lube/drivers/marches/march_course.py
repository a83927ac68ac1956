"""A march in time as scenes near by have it: the equations of its steps at the fields that were found."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...base.parallel import Array
from ...errors import InputError
from ...problems.film.flows import point_weights
from ...problems.film.stored import Stored, mean_film
from ...problems.grid import Grid
from ...scenes.scene import Scene
from ..derivatives.equations import Equations, followed
from .march import Formula, March
from .march_coordinates import Coordinates
from .marching import Moment, first_film
from .step import TimeStep, contents

STEP = 1e-3  # of a supply's pressure, in which G and the numbers reported are linear
NUDGE = 1e-5  # of the thinnest film: of the journal's place, for differences
PLACES = ("journal_x", "journal_y", "h_offset", "pitch", "roll")


@dataclass(frozen=True)
class Kept:
    """A step's end; p in Pa above p_c; where U < 0 all fields in the mirror image's frame.

    dry : as the film's own. place : of all coordinates. pressures : of the supplies.
    """

    t: float
    dt: float
    p: Array
    r: Array
    dry: Array | None
    place: Any
    pressures: tuple[float, ...] = ()


class Trace:
    """Keeps the fields of all steps; heard as `Ask.watch`."""

    def __init__(self) -> None:
        self.begun: Kept | None = None  # what the march began with; None: a full film
        self.steps: list[Kept] = []

    def __call__(self, moment: Moment) -> None:
        problem, row = moment.problem.moving, moment.row

        def of(fields: Any) -> tuple[Array, Array]:
            seen = moment.problem.there({name: fields[name] for name in ("p", "r")})
            return seen["p"] * problem.p_unit, seen["r"].copy()

        if not self.steps and moment.before is not None:
            p, r = of(moment.before)
            self.begun = Kept(0.0, 0.0, p, r, moment.dry, moment.place, _pressures(problem, p))
        place = np.array([row[name] for name in PLACES if name in row])
        p, r = of(moment.fields)
        self.steps.append(Kept(moment.t, row["dt"], p, r, problem.dry, place, _pressures(problem, p)))


def _pressures(problem: Any, p: Array) -> tuple[float, ...]:
    """Of the supplies, Pa above p_c, from the film's at their points. Collective."""
    held = problem.held
    owner = held.owner.ravel() if held is not None else None
    return tuple(
        problem.reduce.max(np.where(owner == k, p, -np.inf)) for k in range(len(held.supplies) if held is not None else 0)
    )


def check_march(scene: Scene) -> None:
    """Raise InputError for a march whose derivatives are not known, with the reason."""
    model: Any = scene.models()(0.0, None)  # type: ignore[attr-defined]
    follow = getattr(scene, "pads_follow", False)
    for found, what in (
        (bool(model.effects), "effects"),
        (hasattr(scene, "observer"), "events"),
        (follow and model.polar is None, "pads that follow a journal"),
    ):
        if found:
            raise InputError(f"scene {scene.name}: [motion]: no derivatives in time through {what}")


class Course:
    """A march at the times, voids and places of a trace; where U < 0 that of the mirror image, except for the numbers reported.

    near : whose grid's edges are followed.

    Raises
    ------
    InputError : by most methods, a wall that turns back.
    """

    def __init__(self, scene: Any, trace: Trace, comm: Any, near: "Course | None" = None):
        self.scene, self.trace, self.comm, self.table = scene, trace, comm, scene.motion
        self._models, self._given = scene.models(), scene.motion.course(scene._folder, len(scene.place))
        self.turned: bool | None = None  # known with the first film
        of = Coordinates(scene, self.table)
        self.free = free = np.flatnonzero(of.free)
        self.forces = [of.pushes[k] for k in free]  # on what is free
        self.reach, self.inertia = of.reach[free], (of.unit * of.mass)[free]
        self.tilts = free >= len(scene.place)
        self.load: Callable[[float], Array] = lambda t: of.loads(t)[free]
        self.begun = of.begin(self._given, None, None)  # places and speeds, of pads where a search for them begins
        self.first = self.alone = first_film(scene, self.models, self.place(0))  # alone: whose lines follow no others
        if near is not None:
            places = followed(near.grid, near.first, self.first)
            if places is None and not near.grid.even:
                raise InputError("the film's edges are others beside this value")
            if places is not None and any(at is not None for at in places):
                self.first = replace(self.first, places=places)
        problem = self.first.build(scene.shape, comm)
        problem.shares_grid = True
        self.grid: Grid = problem.grid
        problem.destroy()
        self.known: dict[int, Array] = {}
        self.layers: dict[int, Array | None] = {} if near is None else near.layers  # of steps (`flows.layers`)

    def models(self, t: float, place: Any) -> Any:
        """The film at a time."""
        model = self._models(t, place)
        self.turned = model.U < 0 if self.turned is None else self.turned
        if self.turned != (model.U < 0):
            raise InputError(f"scene {self.scene.name}: [motion]: no derivatives in time where the wall turns back")
        return model.mirrored if self.turned else model

    def kept(self, n: int) -> Kept | None:
        """What step n left; None where no equation gave the film at t = 0."""
        return self.trace.steps[n - 1] if n else self.trace.begun if self.table.fill is None else None

    def solved(self, n: int) -> Kept:
        """What step n left, of those that have adjoints: an equation gave their film."""
        kept = self.kept(n)
        assert kept is not None
        return kept

    @property
    def fill(self) -> float:
        """The part of a film that no equation gave that is oil at t = 0."""
        return self.table.fill or 1.0

    def place(self, n: int, shift: Any = 0.0) -> Any:
        kept, given = self.kept(n), None if self._given is None else self._given(self.trace.steps[n - 1].t if n else 0.0)
        if not self.free.size:
            return given
        q = self.begun[0].copy()
        if given is not None:
            q[: len(given)] = given
        if kept is not None:
            found = self.free[self.sought(n)]
            q[found] = kept.place[found]
        q[self.free] += shift
        return tuple(map(float, q))

    def sought(self, n: int) -> Any:
        """Which of what is free step n's equations give; those of the steady film at t = 0 its pads' tilts. bool of each."""
        return self.tilts | (n > 0)

    def speed(self, n: int) -> Array:
        """Of what is free, by the formula of step n."""
        formula, places = self.formula(n), [np.array(self.place(k))[self.free] for k in range(n, max(n - 2, 0) - 1, -1)]
        return np.asarray(formula.weight * places[0] - formula.old(places[1:]))

    def film(self, n: int, shift: Any = 0.0) -> Any:
        t = self.trace.steps[n - 1].t if n else 0.0
        return replace(self.models(t, self.place(n, shift)), places=self.grid.places)

    def formula(self, n: int) -> Formula:
        steps = self.trace.steps
        before = [steps[n - 2].dt] if n > 1 else []
        return March(self.grid, self.table.scheme == "bdf2", dts=before).formula(steps[n - 1].dt)

    def content(self, n: int) -> Array:
        """h (1 - r), times the density, at the end of step n; those of the last few are kept."""
        if n not in self.known:
            kept = self.kept(n)
            self.known = {k: a for k, a in self.known.items() if abs(k - n) <= 2}
            film = contents(self.grid, self.film(n), None if kept is None else {"r": kept.r})
            self.known[n] = film * self.density(n) * (1.0 if n else self.fill)
        return self.known[n]

    def by_film(self, n: int) -> Array:
        """2 dx (1 - r), times the density, at the end of step n: what each cell stores, as G has it, for each m of its film."""
        kept = self.kept(n)
        liquid: Any = self.fill if kept is None else 1.0 - kept.r
        return 2.0 * self.grid.spacing[0] * point_weights(self.grid) * liquid * self.density(n)

    def density(self, n: int) -> Any:
        """At the end of step n, over that at p_c."""
        kept, law = self.kept(n), self.first.law
        return 1.0 if kept is None or law is None else law.density(kept.p)

    def at(self, n: int, shift: Any = 0.0, pressures: Any = None) -> Equations:
        """G and Q of step n; n = 0: of the steady film that it begins with. pressures : of the supplies, other than its own."""
        model, kept = self.film(n, shift), self.solved(n)
        if n:
            formula = self.formula(n)
            old = formula.old([self.content(n - 1), self.content(n - 2) if formula.before else None])
            model = replace(model, stored=Stored(formula.weight, old, self.grid))
        pressures = kept.pressures if pressures is None else pressures
        found = Equations(TimeStep(self.scene, model, self.grid), self.comm, pressures, dry=kept.dry)  # type: ignore[arg-type]
        found.turned, found.constant.layers = bool(self.turned), self.layers.get(n)
        return found

    def by_followed(self, n: int, at: Any, unit: float) -> list[tuple[Array, Array, dict[str, float]]]:
        """Derivatives of G in a unit of flow, the film and the numbers reported, by each place and pressure that follows."""
        kept = self.solved(n)
        step = NUDGE * self.grid.reduce.min(mean_film(self.grid, self.film(n).film)) / self.reach
        P, changes = np.array(kept.pressures), [(step[k], {"shift": np.eye(self.free.size)[k]}) for k in at]
        for k, one in enumerate(self.film(n).supplies):
            if one.open:
                changes.append((STEP * (abs(P[k]) or P.max() or 1.0), {"pressures": np.eye(P.size)[k]}))
        found = []
        for d, change in changes:
            ends = []
            for way in (d, -d):
                moved = {name: (way * one + (P if name == "pressures" else 0.0)).tolist() for name, one in change.items()}
                eq = self.at(n, **moved)
                h = mean_film(self.grid, eq.constant.film).ravel()
                ends.append((eq.scaled(kept.p, kept.r, unit), h, eq.report(eq.numbers(kept.p, kept.r))))
                eq.destroy()
            (G, h, above), (G_below, h_below, below) = ends
            told = {name: (above[name] - below[name]) / (2.0 * d) for name in above}
            found.append(((G - G_below) / (2.0 * d), (h - h_below) / (2.0 * d), told))
        return found

    def destroy(self) -> None:
        self.grid.destroy()
