"""What the caller of `solve` wants, beyond the scene: one value that every driver reads and hands down."""

from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import dataclass, field, fields
from numbers import Integral, Real
from pathlib import Path
from types import NoneType
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

from ..base.options import wants_ksp
from ..base.progress import Progress
from ..errors import InputError, nearest
from ..problems.certificate import Certificate
from ..problems.film.lubrication import LubricationProblem
from ..problems.grid import Grid
from ..problems.solution import Fields, Problem, Solution
from ..solvers.newton import Monitor, Stopping


@dataclass(frozen=True)
class Start:
    """Fields near the answer, and the problem of the same kind, on any grid, that they belong to.

    settings : those of the solution that they come from. made : what the effects that are solved for make of the fields, if
        these are those of the film without effects: channel by channel (`problems.film.effects`).
    """

    problem: Problem
    fields: Fields
    settings: Mapping[str, Any] = field(default_factory=dict)
    made: Mapping[str, Any] | None = None


@dataclass(frozen=True)
class Built:
    """The scene's problem, which a driver has built to look at; before : bytes that this process held until then."""

    problem: Problem
    before: int


def light(problem: Any) -> Any:
    """A plain film's problem as a start from it needs it: without coefficients, which are most of its memory."""
    if type(problem) is not LubricationProblem or not problem.plain:
        return problem
    problem.free_matrices()
    other = copy(problem)
    other.scheme = None  # type: ignore[assignment]
    return other


def bare(problem: Any, grid: Grid) -> Any:
    """What a start on a part of a problem is asked for: the part's grid. Nothing else of it is the part's own."""
    other = copy(problem)
    other.grid, other.reduce = grid, grid.reduce
    return other


# The types of attributes, the usual ones first, and their names in messages: for callers from Python.
KINDS: dict[str, tuple[Any, str]] = {
    **dict.fromkeys(("method", "system", "model"), (str, "a text")),
    **dict.fromkeys(("recipe", "quantity"), ((NoneType, str), "a text")),
    **dict.fromkeys(("checkpoint", "resume"), ((NoneType, str, Path), "a path")),
    **dict.fromkeys(("options", "stopping"), ((NoneType, dict, Stopping, Mapping), "a dictionary")),
    **dict.fromkeys(("monitor", "progress", "watch"), ((NoneType, Callable), "a function")),
    "accuracy": ((NoneType, Real), "a number"),
    "finest": ((NoneType, tuple), "a tuple"),
    "every": ((int, Integral), "an integer"),
    "direct_below": ((NoneType, Integral), "an integer"),
    "start": ((NoneType, Solution, Start), "a Solution"),
}


@dataclass(frozen=True)
class Ask:
    """How a scene is to be solved.

    Attributes
    ----------
    method, system : names in the registry, or 'auto'.
    recipe : options/NAME.opts for the inner solver; PETSc options that are set already win over it. By default see
        `plan`, unless a -ksp_type or -pc_type is set.
    accuracy : relative error allowed in `quantity`, 1e-10 to 0.5: grids from coarse to fine, no finer than that needs.
    quantity : which number `accuracy` is about; default the load, of other scenes 'sum_v', 'k', 'sigma'.
    finest : points a side that no grid of `accuracy` may exceed; default: what memory holds.
    stopping : tolerances and iteration limit; a dictionary gives some of them, the method's own (`MethodEntry.eps`) the rest.
    cavities : ||F|| to which a film with round edges is solved the first time, for its cavities (`rims`), beside a `stopping`
        that is no `Stopping`; default: as that.
    digits : relative error of what is sought, attitudes and places in time, that may be left; default what each one has.
    options : the method's own parameters by name (p0, r0, mu, conditions, ... of `DinOptions`).
    nested : start from the answers on coarser grids; default: where it pays.
    certify : also prove a band around the answer (`Solution.enclosure`), for the price of one linear solve at most.
    checkpoint, every : write the iterate to this file after every so many steps; see `checkpoint`.
    resume : go on from such a file, as if the run had not been stopped. What is not given anew is as it was begun with.
    start : a neighbouring scene's `Solution`, from which this one's own start is interpolated. It takes the coarser grids'
        place, unless `nested` asks for these; where it leads nowhere, the run begins again without it.
    model : effects to solve for, of those the scene names: 'auto' (those that count, `decision`), 'full', 'least', or names.
    rescue : whether other methods may take over where the one asked for fails: `Solution.method` says which.
    reduction : solve no more than symmetry leaves (`symmetry`).
    memory_check : refuse a run that needs more memory than there is, by an estimate (`memory`).
    implied : method and options are a driver's choice, and nobody has named them.
    alone : whether this film is asked for, not one of those that a search goes through (loads, pads): see `rims`.
    direct_below : points up to which a film in 2D is solved directly, where multigrid would do; default `plan.FEW`,
        of the grids of a run to an accuracy none; with 0 a film in 1D is solved by multigrid's loops too.
    monitor : called after every step with its number and record.
    progress : called by the loops over grids, levels and time steps with how far they have come.
    watch : called after every time step of a march with its `time.Moment`; collective.
    judge : certifies the fields of the problem that is solved in that problem's place: a part's on the whole scene's data.
    times : when a march is to end a step, s, where an error estimate says how long these are.
    built : the scene's problem, which the solve takes over.
    comm : communicator of petsc4py or mpi4py; default all ranks.
    """

    method: str = "auto"
    system: str = "auto"
    recipe: str | None = None
    accuracy: float | None = None
    quantity: str | None = None
    finest: tuple[int, ...] | None = None
    stopping: Stopping | Mapping[str, Any] | None = None
    cavities: float | None = None
    digits: float = 0.0
    options: Mapping[str, Any] = field(default_factory=dict)
    nested: bool | None = None
    certify: bool = False
    checkpoint: str | Path | None = None
    every: int = 1
    resume: str | Path | None = None
    start: Solution | Start | None = None
    model: str = "auto"
    rescue: bool = True
    reduction: bool = True
    memory_check: bool = True
    implied: bool = False
    alone: bool = True
    direct_below: int | None = None
    monitor: Monitor | None = None
    progress: Progress | None = None
    watch: Callable[[Any], None] | None = None
    judge: Callable[[Problem, Fields, float], Certificate] | None = None
    times: tuple[float, ...] = ()
    built: Built | None = None
    comm: PETSc.Comm | None = None

    def __post_init__(self) -> None:
        for name, (kind, words) in KINDS.items():
            if not isinstance(value := getattr(self, name), kind):
                raise InputError(f"{name} = {value!r}: {words} is needed")
        known = [one.name for one in fields(Stopping)]
        for name in self.stopping if isinstance(self.stopping, Mapping) else ():
            if name not in known:
                raise InputError(f"stopping.{name}: unknown{nearest(str(name), known)}; there are {', '.join(known)}")
        if self.every < 1:
            raise InputError(f"--every {self.every}: at least 1 is needed")
        if self.options is None:
            object.__setattr__(self, "options", {})
        if self.comm is not None:
            object.__setattr__(self, "comm", PETSc.Comm(self.comm))  # mpi4py's will do too

    def certify_by(self, problem: Problem, fields: Fields, eps1: float) -> Certificate:
        """What the problem's data say of the fields, or those of the whole whose part it is. Collective."""
        return (self.judge or type(problem).certify)(problem, fields, eps1)

    def tell(self, loop: str, words: str, part: float) -> None:
        """How far a loop has come, for `progress`."""
        if self.progress is not None:
            self.progress(loop, words, part)

    @property
    def mpi(self) -> MPI.Comm:
        return (self.comm or PETSc.COMM_WORLD).tompi4py()

    @property
    def named(self) -> bool:
        """Whether a method, a matrix or an inner solver was named: those of the whole scene are meant."""
        chosen = (self.method, self.system) != ("auto", "auto") or self.recipe or self.options
        return bool((chosen and not self.implied) or wants_ksp())

    @property
    def choices(self) -> tuple[Any, ...]:
        """What must be the same on all ranks."""
        how = (self.method, self.system, self.recipe, self.accuracy, self.quantity, self.finest, self.stopping)
        return (
            *how,
            dict(self.options),
            self.nested,
            self.certify,
            self.start is None,
            self.rescue,
            self.reduction,
            self.model,
        )

    def stopping_for(self, eps: tuple[float, float]) -> Stopping:
        """The tolerances asked for, a method's own where none are."""
        if isinstance(self.stopping, Stopping):
            return self.stopping
        return Stopping(**{**dict(zip(("eps1", "eps2"), eps, strict=True)), **(self.stopping or {})})
