"""One time step: the film at its end, with what its cells store, as a scene that the inner drivers solve."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from petsc4py import PETSc

from ...base.parallel import Array
from ...errors import InputError
from ...problems.film.flows import point_weights
from ...problems.film.lubrication import LubricationProblem
from ...problems.film.model import Model
from ...problems.film.stored import mean_film
from ...problems.grid import Grid
from ...problems.solution import Fields
from ...scenes.scene import Derived

LEAST_ROOM = 1e-9  # of a sealed film, for void
FULLEST = 1.0 + 1e-5  # void fraction beyond which a cell's content is negative, by more than a cycle may leave


@dataclass(frozen=True)
class TimeStep(Derived):
    """The film of a scene at the time t, on the march's grid."""

    model: Model
    grid: Grid

    @property
    def shape(self) -> tuple[int, ...]:
        return self.grid.shape

    def with_shape(self, shape: tuple[int, ...]) -> "TimeStep":
        raise NotImplementedError("a step is on its march's grid")

    def build(self, comm: PETSc.Comm | None = None) -> LubricationProblem:
        """The discrete problem; on the march's own grid, unless the wall moves to smaller x. Collective."""
        return self.model.build(self.shape, comm, self.grid if self.model.U >= 0 else None)


def contents(grid: Grid, model: Model, fields: Fields | None, problem: Any = None) -> Array:
    """h (1 - r) of the owned cells, m, times the density over that at p_c; without fields the full film's. Collective.

    problem : solved by the fields; it knows how much its full cells hold, in parts of their room.
    """
    h = mean_film(grid, model.film).ravel()
    if fields is None:
        return h
    cells = {} if problem is None else problem.here(problem.moving.cells)
    return h * (1.0 - fields["r"]) * cells.get("stored", 1.0)


def carried(model: Model, content: Array, problem: Any = None) -> Array | None:
    """What the contents carry along, times temperature, m K; without a problem, of oil as it comes in. None: nothing."""
    found = [effect.carried for effect in model.effects if effect.carried]
    if problem is None:
        return 0.0 * content if found else None
    parts = [content * (problem.more_fields[name][0] - level) for name, level in found]
    return parts[0] if parts else None


def check_room(grid: Grid, model: Model, t: float, name: str) -> None:
    """Raise InputError where a sealed film of constant density has no room for its oil, and none to spare. Collective.

    With void in it the step's equations have one solution. Full it has none, or one for every level of the pressure.
    """
    assert model.stored is not None  # as a time step has
    room = model.stored.weight * mean_film(grid, model.film).ravel()
    weights = point_weights(grid)
    left, whole = grid.reduce.sum(weights * (room - model.stored.old)), grid.reduce.sum(weights * room)
    if left <= LEAST_ROOM * whole:
        raise InputError(
            f"{name}: t = {t:g} s: no side has a pressure, and the film has no room for its oil ({-left / whole:.2g} of it too "
            "little): full of a fluid that does not give way it has no pressure, or any; less motion.fill"
        )


def check_content(grid: Grid, r: Array, t: float, dt: float, name: str) -> None:
    """Raise InputError, with time and place, where a cell's content is negative. Collective."""
    largest = grid.reduce.max(r)
    if not largest > FULLEST:
        return
    box = r.reshape(grid.box)
    own = np.argwhere(box == largest)
    found = [(float(grid.x[0, i]), float(grid.y[j, 0])) for j, i in own[:1]]
    x, y = next(place for places in grid.comm.allgather(found) for place in places)
    where = f"x = {x:g}" + (f", y = {y:g}" if grid.dim == 2 else "")
    raise InputError(
        f"{name}: t = {t:g} s: the content at {where} m is negative ({1 - largest:.2g} of the film): the step of {dt:g} s is "
        "too large; take more steps, motion.tol, or motion.scheme = euler, which empties no cell below nothing"
    )
