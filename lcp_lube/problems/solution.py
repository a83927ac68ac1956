"""What a run gives back: fields, outcome, record, and the certificate that the problem's data give it."""

from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, Protocol, Self

from ..base.parallel import Array, Reduce
from .certificate import Certificate
from .grid import Grid
from .shown import Shown

Fields = dict[str, Array]  # this rank's points of each field, by name, in the grid's order


class Problem(Protocol):
    """What every problem offers, whatever it models: the door between the physics and everything else.

    Attributes
    ----------
    kind : which methods apply (`Entry.kinds` in the registry): 'lubrication', 'box', ...
    grid : the points; `grid.reduce` reduces over them.
    unknowns : number of unknowns of the complementarity problem.
    """

    kind: str
    grid: Grid
    reduce: Reduce

    @property
    def unknowns(self) -> int: ...

    def certify(self, fields: Fields, eps1: float) -> Certificate:
        """How far the fields are from a solution, from the problem's data alone. Collective."""
        ...

    def quantities(self, fields: Fields) -> dict[str, Any]:
        """The JSON keys that are this problem's own: loads, fronts, counts. Collective."""
        ...

    @property
    def units(self) -> dict[str, str]:
        """Units of `quantities`, by key; what is left out has none."""
        ...

    def physical(self, fields: Fields) -> dict[str, tuple[Array, str]]:
        """Fields to print, plot and store: name -> (values in SI, unit)."""
        ...

    def at_sides(self, name: str, x: Array, y: Array) -> Array | None:
        """One of the physical fields at points of the sides, SI, shape of x + y; NaN where its value follows from the inside.

        None where the unknowns have no sides.
        """
        ...

    def prolong(self, coarse: Any, fields: Fields, interior: bool) -> Fields:
        """A start on this grid from the same problem's fields on a coarser one; strictly inside if `interior`. Collective."""
        ...

    def destroy(self) -> None: ...


class Outcome(StrEnum):
    """How a run ended. Only `converged` is a success."""

    CONVERGED = "converged"
    MAX_ITERATIONS = "max_iterations"
    STEP_LENGTH = "step_length"
    STALLED = "stalled"
    LINEAR_SOLVER = "linear_solver"
    NOT_FINITE = "not_finite"
    WRONG_SOLUTION = "wrong_solution"
    NO_SOLUTION = "no_solution"
    ACCURACY = "accuracy_not_reached"
    LOAD_NOT_CARRIED = "load_not_carried"

    @property
    def sentence(self) -> str:
        return {
            Outcome.CONVERGED: "converged, and the certificate holds",
            Outcome.MAX_ITERATIONS: "the iteration limit was reached",
            Outcome.STEP_LENGTH: "no acceptable step length was found",
            Outcome.STALLED: "the iteration stalled or went in circles",
            Outcome.LINEAR_SOLVER: "the inner linear solver failed",
            Outcome.NOT_FINITE: "the iterates overflowed or became NaN",
            Outcome.WRONG_SOLUTION: "the method stopped, but its answer is not a solution",
            Outcome.NO_SOLUTION: "the problem has no solution",
            Outcome.LOAD_NOT_CARRIED: "no film of those allowed carries the load",
            Outcome.ACCURACY: "solved, but the accuracy asked for was not reached",
        }[self]


@dataclass(frozen=True)
class Step:
    """One step of the outer loop: the letters of the paper.

    norm is ||F|| after the step, step_norm ||alpha d||; centrality and backtracking count halvings of alpha; enough: the
    method's own stopping rule holds, whatever eps1 and eps2 say; beside: of a film between grooves, while another one took
    more steps.
    """

    norm: float
    step_norm: float
    alpha: float
    linear_iterations: int = 0
    centrality: int = 0
    backtracking: int = 0
    sigma: float = 0.0
    rtol: float = 0.0
    enough: bool = False
    beside: bool = False


@dataclass(frozen=True)
class Enclosure:
    """A band around an answer, or why there is none.

    Attributes
    ----------
    certified : whether the band is proved.
    message : a sentence.
    lower, upper : fields p and r, this rank's points: lower p <= p* <= upper p and upper r <= r* <= lower r for the discrete
        solution p*, r*; empty if not certified.
    bounds : band_p, band_p_max (Pa), band_load (N; N/m in 1D), band_r: how far the answer's p anywhere, its p_max, its load
        and its r anywhere are from the discrete solution's at most; empty if not certified.
    held : what the discrete solution takes as given, in words; empty: nothing but the scene.
    """

    certified: bool
    message: str
    lower: Fields = field(default_factory=dict)
    upper: Fields = field(default_factory=dict)
    bounds: dict[str, float] = field(default_factory=dict)
    held: str = ""

    def as_dict(self) -> dict[str, Any]:
        """The keys of the command line's --json."""
        bounds = {name: self.bounds.get(name) for name in ("band_p", "band_p_max", "band_load", "band_r")}
        return {"certified": self.certified, "certified_message": self.message, "certified_held": self.held or None, **bounds}


@dataclass(eq=False, repr=False)
class Solution(Shown):
    """Fields and record of one run: everything a user asks about it.

    ``with solve("problem4") as s:`` frees the PETSc objects at the end of the block, as `destroy` does; the fields, numbers and
    record stay. A solution that is merely dropped frees them too, on several ranks with the next solve.

    The numbers that --json prints are attributes (s.load, s.p_max, s.flow ...), as a dictionary `quantities`, their units
    `units`. The fields are attributes in SI as arrays of shape (ny, nx), or (nx,) in 1D: s.p, s.r, s.h and the points' s.x, s.y
    of a film, s.v of other problems. On several ranks they are the rank's own part, and s.x, s.y say which; asking for a
    field is then collective, asking for numbers is not.

    Attributes
    ----------
    problem : the problem that was solved; it owns PETSc objects.
    fields : the solver's unknowns at this rank's points, flat; for a lubrication problem p (units of problem.p_unit above the
        cavitation pressure) and r.
    outcome, message : how the run ended, in a word and in a sentence.
    certificate : from the problem's data alone.
    steps : the record of the outer loop.
    settings : method (which gave the answer), system, recipe, ksp_type ... as the JSON prints them.
    times : seconds by stage: setup, assembly, linear, total.
    levels : nested iteration's grids, coarse to fine: nx, ny, iterations, linear_iterations, time_s; the last is this one.
    enclosure : the band that `certify` asked for.
    solved_scene : the scene as it was solved, on the last grid and with the value that a balance found.
    history : of a march in time, a row for each step: t, dt, load, p_max, min_h, flows ...
    told_by : of a run to an accuracy, what all its grids say of the numbers (`drivers.values.Values`).
    """

    problem: Problem
    fields: Fields
    outcome: Outcome
    message: str
    certificate: Certificate
    steps: list[Step]
    settings: dict[str, Any] = field(default_factory=dict)
    times: dict[str, float] = field(default_factory=dict)
    levels: list[dict[str, Any]] = field(default_factory=list)
    enclosure: Enclosure | None = None
    solved_scene: Any = None
    history: list[dict[str, Any]] = field(default_factory=list)
    told_by: Any = None

    @property
    def method(self) -> str:
        """The method that gave the answer."""
        return self.settings["method"]

    @property
    def took_over(self) -> str | None:
        """The method that gave the answer in the place of the one asked for, which failed; None where that one gave it."""
        return self.method if self.settings.get("took_over") else None

    @property
    def asked(self) -> str:
        """The method that was asked first, whether or not it gave the answer."""
        return self.settings.get("took_over") or self.method

    @property
    def converged(self) -> bool:
        return self.outcome is Outcome.CONVERGED

    @property
    def iterations(self) -> int:
        return len(self.steps)

    def total(self, name: str) -> int:
        """Sum of `linear_iterations`, `centrality` or `backtracking` over the steps."""
        return sum(getattr(step, name) for step in self.steps)

    def judged(self) -> "Solution":
        """This solution; one that the method takes for converged though its certificate fails is a wrong one from now on."""
        if self.outcome is Outcome.CONVERGED and not self.certificate.holds:
            self.outcome = Outcome.WRONG_SOLUTION
            self.message = f"{self.message}, but the certificate fails: {self.certificate.failure}"
        return self

    def because(self, *reasons: str, after: bool = False) -> None:
        """Add to what was chosen and why, before what stands there or after it."""
        why = self.settings.get("why", [])
        self.settings["why"] = [*why, *reasons] if after else [*reasons, *why]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.destroy()

    def destroy(self) -> None:
        """Free the PETSc objects behind the problem; a second time does nothing."""
        self.problem.destroy()
