"""A ring with axial grooves: the films between them are solved by themselves, their fields put together and certified."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from ..base.parallel import Array
from ..base.together import EXPECTED, on_all_ranks
from ..linear.krylov import LinearSolverError
from ..problems.film.grooves import GroovedProblem, Pad, pads_between
from ..problems.film.lines import SAME
from ..problems.film.lubrication import LubricationProblem
from ..problems.film.model import Model, Side
from ..problems.film.views import FromHere
from ..problems.grid import Grid
from ..problems.solution import Enclosure, Fields, Outcome, Solution
from ..problems.transfer import fetch, numbers
from ..scenes.moving import film_of
from ..scenes.scene import Derived, Solvable
from ..solvers.enclosure import bounds_of
from .ask import Ask, Start, bare
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
        # On a coarse grid, for a start, nothing is known of effects.
        whole = self.whole if shape == self.points else self.whole.with_shape(self.whole.shape)
        return replace(self, whole=whole, points=shape)

    def build(self, comm: PETSc.Comm | None = None) -> LubricationProblem:
        problem = self.model.build(self.shape, comm)
        return self.factored(problem, *numbers(problem.grid))  # type: ignore[no-any-return]

    def factored(self, problem: Any, j: NDArray[np.int64], i: NDArray[np.int64]) -> Any:
        return super().factored(problem, j, (self.first + i) % self.whole.shape[0])


PadFilms = list[tuple[Pad, PadFilm]]
Film = TypeVar("Film")


class SolvedFilm(NamedTuple):
    """One of the films of a solved ring; first : x of the ring where its own x is 0, m."""

    problem: LubricationProblem
    film: PadFilm
    fields: Fields
    first: float


@dataclass(frozen=True)
class SideBySide(Generic[Film]):
    """Films dealt out to groups of ranks: those of this rank's group. Its methods are collective on all ranks."""

    comm: MPI.Comm
    group: MPI.Comm
    mine: Sequence[Film]

    def sum(self, of: Callable[[Film], Array]) -> Array:
        """Over the films of all groups, of what is collective on one group; a failure in one is raised on all ranks."""
        with on_all_ranks(self.comm, caught=(*EXPECTED, LinearSolverError)):
            found = sum(of(film) for film in self.mine)
        return self.comm.allreduce(found if self.group.rank == 0 else 0.0)  # type: ignore[return-value]

    def min(self, of: Callable[[Film], float]) -> float:
        return self.comm.allreduce(min(map(of, self.mine)), MPI.MIN)


def applies(scene: Solvable, ask: Ask) -> bool:
    """Whether the film has grooves."""
    return bool(getattr(film_of(scene), "grooves", ()))


def pad_films(scene: Solvable) -> PadFilms:
    """The films between the grooves, and where they lie."""
    model: Model = scene.model  # type: ignore[union-attr]
    return [
        (pad, PadFilm(scene, film, (pad.n, *scene.shape[1:]), pad.first)) for pad, film in films_between(model, scene.shape)
    ]


def films_between(model: Model, shape: Sequence[int]) -> list[tuple[Pad, Model]]:
    """The films between the grooves on a ring of nx columns, whose points they keep."""
    films, y = [], model.lines(shape)[1]
    for pad in pads_between(model.columns(shape), model.lengths[0], model.grooves):
        # Its x = 0 is the last column of the groove before it.
        x = pad.around - pad.around[0]
        lengths = (float(x[-1]), *model.lengths[1:])
        sides = (Side(p=pad.west), Side(p=pad.east), *model.sides[2:])
        gap = FromHere(model.gap, float(pad.around[0]), model.lengths[0])
        stored = model.stored.starting(pad.first) if model.stored else None
        dry = model.dry.starting(pad.first) if model.dry else None
        even = np.allclose(np.diff(x), x[-1] / (pad.n + 1), rtol=SAME, atol=0.0)
        changed: dict[str, Any] = {"grooves": (), "levers": (), "places": (None if even else x[1:-1], y), "stored": stored}
        films.append((pad, replace(model, lengths=lengths, sides=sides, gap=gap, exact=None, dry=dry, **changed)))
    return films


def _dealt(scene: Solvable, films: PadFilms, comm: MPI.Comm) -> tuple[int, MPI.Comm, list[int]]:
    """How many groups of ranks work side by side; this rank's, to be freed if there are several; its films. Collective."""
    # Factors of effects lie on the whole ring, and every rank takes part in handing them out.
    apart = not hasattr(scene, "by") and not scene.facts().moving
    groups = min(comm.size, len(films)) if apart else 1
    some = comm.Split(comm.rank % groups, comm.rank) if groups > 1 else comm
    return groups, some, [k for k, group in enumerate(_group(films, groups)) if group == comm.rank % groups]


@contextmanager
def films_of(scene: Solvable, ring: LubricationProblem, fields: Fields) -> Iterator[SideBySide[SolvedFilm]]:
    """The films between the grooves of a solved ring, side by side as `solve` has them. Collective."""
    comm, films = ring.grid.comm, pad_films(scene)
    groups, some, mine = _dealt(scene, films, comm)
    taken = _taken(ring.grid, fields, films, mine, lambda film: film.build(PETSc.Comm(some)), comm)
    yield SideBySide(
        comm, some, [SolvedFilm(at, films[k][1], own, float(films[k][0].around[0])) for k, (at, own) in taken.items()]
    )
    for problem, _ in taken.values():
        problem.destroy()
    if groups > 1:
        some.Free()


def solve(scene: Solvable, ask: Ask, inner: Inner) -> Solution:
    """The ring's solution from those of its films; the first one that fails gives the outcome of the whole. Collective.

    On several ranks the films are solved side by side, each by some of the ranks.
    """
    ring = scene.build(ask.comm)
    assert isinstance(ring, GroovedProblem)  # as `applies` found
    comm, films = ask.mpi, pad_films(scene)
    groups, some, mine = _dealt(scene, films, comm)
    ask, near, starts = replace(ask, comm=some) if groups > 1 else ask, ask.start, {}
    if near is not None and near.problem.grid.shape == ring.grid.shape:
        of = lambda film: bare(near.problem, film.model.grid(film.shape, ask.comm))  # noqa: E731
        taken = _taken(near.problem.grid, near.fields, films, mine, of, comm)
        starts = {k: Start(*one, near.settings) for k, one in taken.items()}
    done: dict[int, Solution] = {}
    with on_all_ranks(comm):
        for k in mine:
            done[k] = inner(films[k][1], replace(ask, start=starts.get(k)))
    for start in starts.values():
        start.problem.grid.destroy()
    fields = _spread(ring, films, {k: (one.problem, one.fields) for k, one in done.items()}, comm)
    first = {k: (one.outcome, one.message, one.steps, one.settings, one.times) for k, one in done.items()}
    told = sorted({k: one for part in comm.allgather(first) for k, one in part.items()}.items())
    band = _band(ring, films, fields, done, comm) if ask.certify else None
    for one in done.values():
        one.destroy()
    if groups > 1:
        some.Free()
    outcome, message, _, settings, _ = next((one for _, one in told if one[0] is not Outcome.CONVERGED), told[0][1])
    how = "solved one by one" if groups == 1 else f"solved by {groups} groups of ranks side by side"
    settings = {**settings, "why": [f"{len(films)} films between grooves, {how}", *settings["why"]]}
    longest = max(told, key=lambda one: len(one[1][2]))[0]
    times: dict[str, float] = {}
    for _, (*_, seconds) in told:
        times = added(times, seconds)
    return Solution(
        ring,
        fields,
        outcome,
        f"{len(films)} films between grooves; {message}",
        ask.certify_by(ring, fields, settings["eps1"]),
        [step if k == longest else replace(step, beside=True) for k, one in told for step in one[2]],
        enclosure=band,
        settings=settings,
        times=times,
    ).judged()


def _band(ring: Any, films: PadFilms, fields: Fields, done: dict[int, Solution], comm: MPI.Comm) -> Enclosure:
    """The ring's band from those of its films, which grooves part: each is a problem of its own. Collective."""
    mine = {k: one.enclosure or Enclosure(False, "no band: no answer") for k, one in done.items()}
    poor = {k: one.message for k, one in mine.items() if not one.certified}
    missing = sorted(found for part in comm.allgather(poor) for found in part.items())
    if missing:
        return Enclosure(False, f"film {missing[0][0] + 1} of {len(films)} between grooves: {missing[0][1]}")
    lower, upper = (
        _spread(ring, films, {k: (done[k].problem, getattr(band, end)) for k, band in mine.items()}, comm)
        for end in ("lower", "upper")
    )
    bounds = bounds_of(ring, fields, lower, upper)
    message = f"the discrete solution is proved to be within {bounds['band_p']:.1e} Pa of p, film by film between grooves"
    return Enclosure(True, message, lower, upper, bounds)


def _group(films: PadFilms, groups: int) -> list[int]:
    """Which group solves each film: the largest first, to the group that has the least."""
    load, out = [0] * groups, [0] * len(films)
    for k in sorted(range(len(films)), key=lambda k: -films[k][0].n):
        out[k] = load.index(min(load))
        load[out[k]] += films[k][0].n
    return out


def _taken(
    ring: Grid, fields: Fields, films: PadFilms, mine: list[int], of: Callable[[PadFilm], Any], comm: MPI.Comm
) -> dict[int, tuple[LubricationProblem, Fields]]:
    """The problem `of` each of this rank's films, and its part of a ring's fields. Collective."""
    with on_all_ranks(comm):
        at = {k: of(films[k][1]) for k in mine}
    boxes = {k: np.broadcast_arrays(*numbers(problem.grid)) for k, problem in at.items()}
    j = [boxes[k][0].ravel() for k in mine]
    i = [(films[k][0].first + boxes[k][1].ravel()) % ring.shape[0] for k in mine]
    have = [(0, ring, np.array(list(fields.values())))]
    none = np.zeros(0, dtype=np.int64)
    values = fetch(comm, have, 0 * np.concatenate([*j, none]), np.concatenate([*j, none]), np.concatenate([*i, none]))
    parts = np.split(values, np.cumsum([one.size for one in j])[:-1], axis=1) if mine else []
    return {k: (at[k], dict(zip(fields, part, strict=True))) for k, part in zip(mine, parts, strict=True)}


def _spread(ring: GroovedProblem, films: PadFilms, done: dict[int, tuple[Any, Fields]], comm: MPI.Comm) -> Fields:
    """The ring's fields from its films and grooves. Collective."""
    j, i = (one.ravel() for one in np.broadcast_arrays(*numbers(ring.grid)))
    which, column = np.full(j.size, -1), np.zeros(j.size, dtype=np.int64)
    for k, (pad, _) in enumerate(films):
        at = (i - pad.first) % ring.grid.shape[0]
        which, column = np.where(at < pad.n, k, which), np.where(at < pad.n, at, column)
    have = [(k, problem.grid, np.array([found["p"], found["r"]])) for k, (problem, found) in done.items()]
    p, r = fetch(comm, have, which, j, column)
    for inside, groove in zip(ring.columns, ring.grooves, strict=True):
        p[inside] = groove.p / ring.p_unit
    return {"p": p, "r": r}
