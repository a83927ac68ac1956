"""A ring with axial grooves: the films between the grooves are solved one by one, their fields put together and certified."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from ..problems.facts import Facts
from ..problems.film.effects import FaceFactors
from ..problems.film.grooves import GroovedProblem, Pad
from ..problems.film.lubrication import LubricationProblem
from ..problems.film.model import Model
from ..problems.grid import Grid
from ..problems.solution import Fields, Outcome, Solution
from ..problems.transfer import Pick, numbers
from ..scenes.scene import Derived, Solvable
from .ask import Ask, Start
from .chain import added
from .compose import Inner


@dataclass(frozen=True)
class PadFilm(Derived):
    """One of the films, on this grid."""

    model: Model
    points: tuple[int, ...]
    first: int  # column of the ring where it begins

    @property
    def shape(self) -> tuple[int, ...]:
        return self.points

    def with_shape(self, shape: tuple[int, ...]) -> "PadFilm":
        return replace(self, points=shape)

    def facts(self, comm: PETSc.Comm | None = None) -> Facts:
        return self.model.facts(self.shape, comm)

    def build(self, comm: PETSc.Comm | None = None) -> LubricationProblem:
        problem = self.model.build(self.shape, comm)
        if hasattr(self.whole, "by"):  # of effects, which the faces at round edges are not made for
            problem.coefficients_for = None
        by: FaceFactors | None = getattr(self.whole, "by", None)
        if by is None or self.shape[1:] != by.grid.shape[1:]:  # a coarse grid, for a start
            return problem
        j, i = numbers(problem.grid)
        return by.on(problem.grid, j, (self.first + i) % by.grid.shape[0]).film(problem)


def applies(scene: Solvable, ask: Ask) -> bool:
    """Whether the film has grooves."""
    return bool(getattr(getattr(scene, "model", None), "grooves", ()))


def pad_films(scene: Solvable) -> list[tuple[Pad, PadFilm]]:
    """The films between the grooves, and where they lie."""
    model: Model = scene.model  # type: ignore[attr-defined]
    return [(pad, PadFilm(scene, film, (pad.n, *scene.shape[1:]), pad.first)) for pad, film in model.pads(scene.shape)]


def films_of(
    scene: Solvable, ring: LubricationProblem, fields: Fields
) -> Iterator[tuple[LubricationProblem, Model, Fields, float]]:
    """The films between the grooves of a solved ring, with their fields and the x where each begins. Collective.

    The problems are the caller's to free.
    """
    for pad, film in pad_films(scene):
        problem = film.build(ring.grid.dm.comm)
        take = pick_pad(ring.grid, problem.grid, pad.first)
        taken = {name: take(values) for name, values in fields.items()}
        take.destroy()
        yield problem, film.model, taken, (pad.first - 0.5) * ring.grid.lengths[0] / ring.grid.shape[0]


def solve(scene: Solvable, ask: Ask, inner: Inner) -> Solution:
    """The ring's solution from those of its films; the first one that fails tells how the whole ends. Collective."""
    ring = scene.build(ask.comm)
    assert isinstance(ring, GroovedProblem)  # as `applies` found
    n = ring.grid.local_size
    fields = {"p": np.zeros(n), "r": np.zeros(n)}
    for inside, groove in zip(ring.columns, ring.grooves, strict=True):
        fields["p"][inside] = groove.p / ring.p_unit
    near = ask.start if ask.start is not None and ask.start.problem.grid.shape == ring.grid.shape else None
    done: list[Solution] = []
    dry = np.zeros(n)
    times: dict[str, float] = {}
    for pad, film in pad_films(scene):
        start = None
        if near is not None:
            at = film.build(ask.comm)
            take = pick_pad(near.problem.grid, at.grid, pad.first)
            start = Start(at, {name: take(values) for name, values in near.fields.items()}, near.settings)
        solution = inner(film, replace(ask, start=start))
        if start is not None:
            start.problem.destroy()
        spread, within = place_pad(solution.problem.grid, ring.grid, pad)
        for name, values in solution.fields.items():
            fields[name] = np.where(within, spread(values), fields[name])
        if (of_pad := getattr(solution.problem, "dry", None)) is not None:
            dry = np.where(within, spread(of_pad), dry)
        times = added(times, solution.times)
        done.append(solution)
    if dry.any():
        ring = ring.revised(dry)  # type: ignore[assignment]
    failed = next((one for one in done if not one.converged), done[0])
    steps = [step for one in done for step in one.steps]
    message = f"{len(done)} films between grooves; {failed.message}"
    failed.because(f"{len(done)} films between grooves, solved one by one")
    outcome: Outcome = failed.outcome
    certificate = ring.certify(fields, failed.settings["eps1"])
    for one in done:
        one.destroy()
    levels: list[dict] = []
    changed = {"problem": ring, "fields": fields, "outcome": outcome, "message": message, "certificate": certificate}
    return replace(failed, **changed, steps=steps, times=times, levels=levels).judged()  # type: ignore[arg-type]


def pick_pad(ring: Grid, pad: Grid, first: int) -> Pick:
    """Takes a film's values from the ring's grid."""
    j, i = numbers(pad)
    return Pick(ring, pad, j, (first + i) % ring.shape[0])


def place_pad(pad: Grid, ring: Grid, where: Pad) -> tuple[Pick, NDArray[np.bool_]]:
    """Takes the ring's values from a film's grid (any value outside the film), and which of the ring's points are inside."""
    j, i = numbers(ring)
    column = (i - where.first) % ring.shape[0]
    inside = np.broadcast_to(column < where.n, ring.box).ravel()
    return Pick(pad, ring, j, np.minimum(column, where.n - 1)), inside
