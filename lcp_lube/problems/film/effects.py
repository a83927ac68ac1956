"""What physical effects do to a film: fields at its points that change viscosity, density, thickness and flows.

An effect reads an answer (p, r, the flows through every face) and says what follows from it for the film's coefficients, in
`CHANNELS`. Those multiply the scheme of the rigid, isoviscous film face by face, so that every effect composes with every other
and with whatever solves the film. `drivers.coupling` finds the fields that reproduce themselves.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ...base.parallel import Array
from ..grid import Grid
from ..transfer import Pick
from .fluid import Law
from .lubrication import LubricationProblem
from .reynolds import sides
from .supplies import Held, pressed

# A field at the owned points, and its value where nothing has an effect. viscosity: over mu. density: over rho_0. lift: what is
# added to the film, m. pressure_flow, drag_flow: factors of the flows that pressure and wall drive (roughness below the grid).
# No coefficients of the film's: contact, pressure of asperities, Pa; warmth, what of the viscosity is the temperature's factor;
# pressure, in a time step: that at which what cells store is linearised, Pa.
CHANNELS = {
    "viscosity": 1.0,
    "density": 1.0,
    "lift": 0.0,
    "pressure_flow": 1.0,
    "drag_flow": 1.0,
    "contact": 0.0,
    "warmth": 1.0,
    "pressure": 0.0,
}
Cells = dict[str, Array]
THINNEST = 0.05  # of the rigid film: no lift of an iterate leaves less
FACTORS = ("k_W", "k_E", "k_S", "k_N", "u_W", "u_E", "mu", "stored")


@dataclass(frozen=True)
class Report:
    """What an effect tells of an answer.

    numbers : further quantities (docs/numbers.md). measures : how far its own equations are from holding, for the certificate.
    fields : further fields at the points, with their units. failure : why there is no such answer; empty if there is one.
    """

    numbers: dict[str, Any]
    measures: dict[str, float]
    fields: dict[str, tuple[Array, str]]
    failure: str = ""


NOTHING = Report({}, {}, {})


class Effect:
    """A rung: what one effect makes of an answer; these are most: even, the same in the mirror image, nothing to tell.

    channels : what it may change. even : whether what it makes of an answer that is symmetric in y is so too. local : whether
    what it makes at a place is made of what the answer has there; where it is `fixed`, not even of that between rigid walls.
    carried : of a field that the oil carries along in time: its name among those told, and the level from which it counts.
    What makes viscosity grow without bound has `beyond(at)`: why no pressure carries the flow of a film without it, or "".
    """

    channels: ClassVar[tuple[str, ...]] = ("viscosity",)
    even = True
    local: ClassVar[bool] = False

    @property
    def carried(self) -> tuple[str, float] | None:
        return None

    def apply(self, at: "Answer", out: Cells) -> None:
        """Change `out` by what follows from the answer. Collective."""
        raise NotImplementedError

    def yields(self, grid: Grid) -> Array | float:
        """By how much walls give way where the pressure rises by 1 Pa everywhere, m/Pa. Collective."""
        return 0.0

    def report(self, at: "Answer") -> Report:
        """Numbers and measures of the answer. Collective."""
        return NOTHING

    def mirrored(self, length: float) -> Any:
        """The effect in the mirror image of a film of this length."""
        return self


@dataclass
class Answer:
    """A film's answer as effects see it.

    problem : the film with the coefficients that it was solved with. p : Pa above p_c. r : void fraction. cells : those
    coefficients at the points; factors : what they make of its scheme. law : how viscosity depends on the pressure.
    base : the rigid, isoviscous film.
    """

    problem: LubricationProblem
    p: Array
    r: Array
    cells: Cells
    law: Law
    base: LubricationProblem
    factors: dict[str, Array] = field(default_factory=dict)
    memory: dict[Any, Any] = field(default_factory=dict)  # what an effect found, by its id
    lasting: dict[Any, Any] = field(default_factory=dict)  # what serves for the answers that follow too
    rough: bool = False  # whether three digits of what effects make of it will do
    once: bool = False  # whether one step of Newton's method will, from what its coefficients stand for

    @property
    def grid(self) -> Grid:
        return self.problem.grid

    @cached_property
    def mu(self) -> Array:
        """Viscosity at the points, Pa s."""
        return self.base.mu * self.cells.get("viscosity", 1.0) * self.law.viscosity(self.p)

    @cached_property
    def h(self) -> Array:
        """Film at the points, m."""
        return self.problem.scheme.h.ravel()

    @property
    def stored(self) -> Array:
        """What a full cell holds, of what the rigid film has room for at p_c."""
        return self.factors["stored"].ravel()

    @cached_property
    def speed(self) -> Array:
        """Of the wall at the points, m/s."""
        return np.broadcast_to(self.problem.U * self.grid.stretch(self.grid.y), self.grid.box).ravel()

    @cached_property
    def gradient(self) -> tuple[Array, Array]:
        """dp/dx and dp/dy at the points, Pa/m: means of those at the two faces. Collective."""
        framed = framed_by(self.grid, self.p, self.problem.p_sides)
        here = framed[1:-1, 1:-1]
        dx = self.grid.steps(0)
        along = (framed[1:-1, 2:] - framed[1:-1, :-2]) / (dx[:-1] + dx[1:]) / self.grid.stretch(self.grid.y)
        across = np.zeros_like(here)
        if self.grid.dim == 2:
            dy = self.grid.steps(1)[:, None]
            across = (framed[2:, 1:-1] - framed[:-2, 1:-1]) / (dy[:-1] + dy[1:])
        return along.ravel(), across.ravel()


@dataclass(frozen=True)
class FaceFactors:
    """Factors of a rigid, isoviscous film's scheme on the points of `grid`, each of shape grid.box.

    k_W, k_E, k_S, k_N : of the conductances. u_W, u_E : of the wall's flows. mu : viscosity at the east face, over mu.
    stored : of what a full cell holds, in a time step; gives : by how much more for 1 Pa more, if it is not held, 1/Pa.
    law : by which density follows the pressure while the film is solved (`tangent.renew`); None: all is held.
    rigid : the film without them. at : its q (p_unit) that they were renewed at.
    """

    grid: Grid
    values: dict[str, Array]
    law: Law | None = None
    rigid: LubricationProblem | None = None
    at: Array | None = None

    def on(self, grid: Grid, j: NDArray[np.int64], i: NDArray[np.int64]) -> "FaceFactors":
        """Those of a part of the film, whose points are the lines j and columns i of this one's grid. Collective."""
        take = Pick(self.grid, grid, j, i)
        found = {name: take(values.ravel()).reshape(grid.box) for name, values in self.values.items()}
        take.destroy()
        return FaceFactors(grid, found, self.law)

    def film(self, problem: LubricationProblem) -> LubricationProblem:
        """The film with these factors."""
        film = scaled(problem, self)
        film.factors = replace(self, rigid=problem)
        return film


def framed_by(grid: Grid, values: Array, at_sides: Sequence[float] | None = None) -> Array:
    """Owned values with their neighbours'; beyond an open side the side's value, where given, else their own. Collective."""
    out = grid.ghosted(values)
    own = out[1:-1, 1:-1]
    rim = (out[1:-1, :1], out[1:-1, -1:], out[:1, 1:-1], out[-1:, 1:-1])
    edge = (own[:, :1], own[:, -1:], own[:1], own[-1:])
    at_side = (None,) * 4 if at_sides is None else [end == "open" for pair in (*grid.ends, ("", ""))[:2] for end in pair]
    for k, (view, inner) in enumerate(zip(rim, edge, strict=True)):
        np.copyto(view, at_sides[k] if at_side[k] else inner, where=np.isnan(view))  # type: ignore[index]
    return out


def face_means(framed: Array) -> list[Array]:
    """Means over the west, east, south and north face."""
    return [0.5 * (framed[1:-1, 1:-1] + other) for other in around(framed)]


def around(framed: Array) -> tuple[Array, Array, Array, Array]:
    """The west, east, south and north neighbours."""
    return framed[1:-1, :-2], framed[1:-1, 2:], framed[:-2, 1:-1], framed[2:, 1:-1]


def factors(problem: LubricationProblem, cells: Cells, density_at_sides: Sequence[float] | None = None) -> FaceFactors:
    """What the fields make of the scheme of a rigid, isoviscous film. Collective."""
    grid, ones = problem.grid, np.ones(problem.grid.box)
    k, u, mu, stored = [ones] * 4, [ones] * 4, ones, ones
    if "viscosity" in cells:
        at_faces = face_means(framed_by(grid, cells["viscosity"]))
        k, mu = [a / b for a, b in zip(k, at_faces, strict=True)], at_faces[1]
    if "lift" in cells:
        thicker = cells["lift"] / problem.scheme.h.ravel()
        thick, stored = [1.0 + part for part in face_means(framed_by(grid, thicker))], 1.0 + thicker.reshape(grid.box)
        k, u = [a * b**3 for a, b in zip(k, thick, strict=True)], thick
    for name, driven in (("pressure_flow", (True, False)), ("drag_flow", (False, True)), ("density", (True, True))):
        if name in cells:
            at = face_means(framed_by(grid, cells[name], density_at_sides if name == "density" else None))
            k = [a * b for a, b in zip(k, at, strict=True)] if driven[0] else k
            u = [a * b for a, b in zip(u, at, strict=True)] if driven[1] else u
    if "density" in cells:
        stored = stored * cells["density"].reshape(grid.box)
    return FaceFactors(grid, dict(zip(FACTORS, [*k, *u[:2], mu, stored], strict=True)))


def scaled(
    problem: LubricationProblem,
    by: FaceFactors,
    mobility: Sequence[Array] | None = None,
    p_sides: tuple[float, ...] | None = None,
    held: Held | None = None,
) -> LubricationProblem:
    """The film with factors at its faces, conductances times mobilities, and other pressures at its sides and supplies."""
    s, f, grid = problem.scheme, by.values, problem.grid
    names = ("k_W", "k_E", "k_S", "k_N")
    k: dict[str, Any] = {name: getattr(s, name) * f[name] * (mobility[i] if mobility else 1.0) for i, name in enumerate(names)}
    couette_W, couette_E = s.couette_W * f["u_W"], s.couette_E * f["u_E"]
    c, carried = couette_W - couette_E + problem.sources(slice(None), s), s.b_E * f["u_E"]
    stored: dict[str, Any] = {}
    if s.storage is not None:
        stored["storage"] = s.storage * f["stored"]
        stored["gives"] = s.storage * f["gives"] * problem.p_unit if "gives" in f else None
        c, carried = c + s.storage - stored["storage"], carried - stored["storage"]
    for conductance, at_side, p_side in zip(k.values(), sides(grid), p_sides or problem.p_sides, strict=True):
        c = c + np.where(at_side, conductance * (p_side / problem.p_unit), 0.0)
    u: dict[str, Any] = {"b_C": carried, "b_W": s.b_W * f["u_W"], "couette_W": couette_W, "couette_E": couette_E}
    scheme = pressed(replace(s, **k, **u, **stored, c=c), held or problem.held, problem.p_unit)
    return problem.with_scheme(scheme, problem.mu * f["mu"], p_sides, held)


def answer(
    base: LubricationProblem,
    law: Law,
    cells: Cells,
    by: FaceFactors,
    p: Array,
    r: Array,
    p_sides: tuple[float, ...],
    effects: Sequence[Effect] = (),
) -> Answer:
    """An answer of `base` with these coefficients: p in Pa above p_c and r, whatever unknown it was solved in. Collective.

    effects : those that have made the cells of an answer.
    """
    given = by
    framed = framed_by(base.grid, p, p_sides)
    here = framed[1:-1, 1:-1]
    mobility = [law.mobility(here, np.nan_to_num(other)) for other in around(framed)] if law.barus else None
    if law.barus:
        at_face = law.viscosity(0.5 * (here + np.nan_to_num(framed[1:-1, 2:])))
        by = replace(by, values={**by.values, "mu": by.values["mu"] * at_face})
    held = base.held
    if held is not None and law.barus:  # back from q
        supplies = tuple(replace(one, p=float(law.pressure(np.array(one.p)))) for one in held.supplies)
        held = replace(held, supplies=supplies, law=None)
    film = scaled(base, by, mobility, p_sides, held)
    if base.integrals is not None:
        from .oil_along import oil_of  # here: of lines alone

        film.oil = oil_of(base, law, cells, given.values, effects)
    film.barus = law.barus
    if "lift" in cells:
        film = film.with_lift(cells["lift"])
    return Answer(film, p, r, cells, law, base, by.values)


def neutral(effects: Sequence[Effect], size: int) -> Cells:
    """The fields of a film without effects, of those that the effects may change."""
    used = {name for effect in effects for name in effect.channels}
    return {name: np.full(size, value) for name, value in CHANNELS.items() if name in used}
