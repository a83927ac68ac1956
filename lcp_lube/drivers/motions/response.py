"""How a film's force answers to small motions of its walls: the exact derivative of the mass-conserving equations.

In the film h(x, y, t) a cell's balance is A(h) p + B(h) r - c(h) + 2 dx d/dt[h (1 - r)] = 0. Let z be p in the full film and -r
in the cavity, J the matrix of the problem at its solution, and e exp(i nu t) a small rigid motion. At the signs of z

    (J + i nu M) z' = -dG/de - i nu S,     M = 2 dx h in the cavity, 0 in the full film,     S = 2 dx (1 - r) dh/de,

with G = A p + B r - c. A motion e_k moves the wall by dh/de_k; its force is F_k = Int p dh/de_k, and K + i nu C = -dF/de comes
from p'. M is the void that is stored and carried. At nu = 0 these are two solves with one matrix: J z0' = -dG/de,
J z1' = -(S + M z0'). Of a time step J has the storage in it, and z0' alone says how the force answers to where the wall is at
the step's end.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...base.parallel import Array
from ...problems.film.cavity import cavity_sign
from ...problems.film.flows import point_weights
from ...problems.film.fronts import counted
from ...problems.film.known import known_of
from ...problems.film.lubrication import LubricationProblem
from ...problems.film.model import Model
from ...problems.film.stored import Stored
from ...problems.film.supplies import supply_flows
from ...problems.film.views import View
from ...problems.solution import Fields
from ...registry import SMALL
from ...scenes.scene import Solvable
from .halved import Halved
from .line_forces import OfLine, carried_by, line_forces, stiffness_of
from .linearised import Feed, Linear

STEP = 1e-5  # of the thinnest film
Change = Callable[[Array, Array], Array]  # dh/de at x and y (m) of the scene's film


@dataclass(frozen=True)
class Moved(View):
    """A film whose wall has moved by e in a rigid motion; first : x of the scene where this film's x is 0, m."""

    change_: Change
    e: float
    first: float

    @property
    def rims(self) -> tuple[Any, ...]:
        return tuple(getattr(self.film, "rims", ()))

    def change(self, x: ArrayLike, y: ArrayLike | None = None) -> Array:
        """dh/de."""
        return self.change_(np.asarray(x, dtype=float) + self.first, np.asarray(0.0 if y is None else y, dtype=float))

    def __call__(self, x: ArrayLike, y: ArrayLike | None = None, /) -> Array:
        return self.film(x, y) + self.e * self.change(x, y)


def near(model: Model, gap: Any, problem: LubricationProblem) -> LubricationProblem:
    """A problem's film near by on its grid, with faces at round edges made for the same cavities. Collective."""
    return replace(model, gap=gap).build(problem.grid.shape, problem.grid.petsc_comm, problem.grid).revised(problem.dry)


class Response(OfLine):
    """The film of one problem at its solution, linearised. Collective, until `destroy`.

    Parameters
    ----------
    problem : solved by `fields`; model : what it is the discretisation of.
    motions : dh/de of each.
    first : x of the scene where this film's x is 0, m.
    film : what was solved on half its width, as it is symmetric.
    """

    def __init__(
        self,
        problem: LubricationProblem,
        model: Model,
        fields: Fields,
        motions: Sequence[Change],
        first: float = 0.0,
        film: Solvable | None = None,
    ):
        grid, self.p, self.r = problem.grid, fields["p"], fields["r"]
        self.problem = problem
        stored = model.stored and Stored(model.stored.weight, model.stored.on(grid).ravel(), grid)
        self.model = replace(model, stored=stored, exact=None)
        self.cavity = cavity_sign(problem.reduce, self.p, self.r) < 0
        self._moved = [Moved(model.gap, motion, 0.0, first) for motion in motions]
        self.changes = [np.broadcast_to(moved.change(grid.x, grid.y), grid.box).ravel() for moved in self._moved]
        size = point_weights(grid)
        weight = grid.cell * problem.p_unit * size
        self._carried = [weight * change for change in self.changes]
        self._sides = [carried_by(problem, self.p, self.r, self.cavity, one) for one in self._carried]
        unit = 2.0 * grid.spacing[0] / problem.scheme.flow_unit * size
        self._M = np.where(self.cavity, unit * problem.scheme.h.ravel(), 0.0)
        self._S = [unit * (1.0 - self.r) * change for change in self.changes]
        halved = film is not None and grid.size > SMALL
        self._solver: Linear | Halved = (
            Halved(problem, self.cavity, film, self._M) if halved else Linear(problem, self.cavity, M=self._M)  # type: ignore[arg-type]
        )
        held = problem.held
        supplies = held.supplies if held is not None else ()
        taken = supply_flows(problem, self.p, self.r)
        self._sources = np.array([one.misfit(one.p, q)[1:] for one, q in zip(supplies, taken, strict=True)])
        free = [one.open for one in supplies]
        self._feed = Feed(problem, self.cavity, free) if any(free) else None
        self._answers: dict[float, list[Any]] = {}
        swept = (lambda S: S) if held is None else (lambda S: np.where(held.mask.ravel(), 0.0, S))
        self._swept = [swept(S) for S in self._S]
        self._told = known_of(problem) is not None  # numbers are the film's own, not those of the fields
        self._forces_of_line: list[Array | None] = []
        self._dG, self._raw, borne, steps = zip(*(self._derivative(moved) for moved in self._moved), strict=True)
        self._fronts = -np.stack(borne, axis=1)
        self._line = stiffness_of(self._forces_of_line, steps)

    def _solved(self, rows: Sequence[Any], raws: Sequence[Any], nu: float = 0.0, stored: bool = True) -> list[Any]:
        """The film's answers, with the change of the supplies' pressures that follow."""
        solve = partial(self._solver.at, nu, stored=stored) if nu else self._solver.solve
        found = solve(rows)
        if self._feed is None:
            return found
        key = nu if stored else 0.0
        if key not in self._answers:
            self._answers[key] = solve([self._feed.pushed(t) for t in self._feed.free])
        answers = self._answers[key]
        return [self._feed.corrected(z, raw, answers, self._sources) for z, raw in zip(found, raws, strict=True)]

    @cached_property
    def _slow(self) -> list[Any]:
        """What stiffness and damping are both made of."""
        return self._solved([-dG for dG in self._dG], self._raw)

    def damping(self) -> Array:
        """-dF/d(de/dt) in the limit of slow motion."""
        rows = [-(swept + self._M * z) for swept, z in zip(self._swept, self._slow, strict=True)]
        return self._forces(self._solved(rows, self._S)).real

    def at(self, nu: float, stored: bool = True) -> Any:
        """K + i nu C at this frequency, rad/s > 0; stored = False: as if the cavity's void were not stored (M = 0)."""
        rows = [-dG - 1j * nu * swept for dG, swept in zip(self._dG, self._swept, strict=True)]
        raws = [raw + 1j * nu * S for raw, S in zip(self._raw, self._S, strict=True)]
        return self._forces(self._solved(rows, raws, nu, stored)) + self._misplaced

    def _forces(self, found: Any) -> Any:
        """-F of each motion's answer, shape (motions, motions)."""
        dot = self.problem.reduce.dot
        return np.array([[-complex(dot(row, z.real), dot(row, z.imag)) for z in found] for row in self._sides])

    def _derivative(self, moved: Moved) -> tuple[Array, Array, Array, float]:
        """dG/de at fixed fields, and that of the cells' own balances, were none held: G is a cubic in e (conductances in h^3,
        Couette and stored terms in h), whose third derivative the step makes small; that of what is carried, as fronts move in
        their cells; and the step."""
        size = self.problem.reduce.max(np.abs(moved.change(self.problem.grid.x, self.problem.grid.y)))
        step = STEP * self.problem.reduce.min(self.problem.scheme.h) / (size or 1.0)
        values, carried = [], []
        for part in (1.0, -1.0):
            other = near(self.model, replace(moved, e=part * step), self.problem)
            if self.problem.factors is not None:
                other = self.problem.factors.film(other)
            balance = other.balance(self.p, self.r)
            raw = balance if other.held is None else other.face_flows(self.p, self.r)
            values.append(np.stack([balance, raw]) * (other.scheme.flow_unit / self.problem.scheme.flow_unit))
            p = counted(other, self.p * self.problem.p_unit, self.r) / self.problem.p_unit
            carried.append(np.array([self.problem.reduce.dot(one, p) for one in self._carried]))
            if self._told:
                self._forces_of_line.append(line_forces(other, self.changes))
            other.destroy()
        dG, raw = (values[0] - values[1]) / (2.0 * step)
        return dG, raw, (carried[0] - carried[1]) / (2.0 * step), step

    def destroy(self) -> None:
        """Free the PETSc objects. Collective."""
        self._solver.destroy()
        if self._feed is not None:
            self._feed.destroy()
