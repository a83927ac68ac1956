"""The data of one steady film problem, whole or reduced, and the step from them to the discrete problem."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from petsc4py import PETSc

from ...base.parallel import Array
from ...errors import InputError
from ..facts import Facts
from ..grid import EVEN, Grid, Places, Polar
from .edges import corners_of, jumps_of, kinks_of, one_line
from .effects import Effect
from .exact import ExactSolution
from .fluid import Law
from .grooves import Groove, GroovedProblem
from .integrals import LineIntegrals, line_integrals
from .lines import on_edges, some_places, stretches
from .lubrication import LubricationProblem
from .reynolds import BoxScheme, Film, box_scheme, coefficients
from .stored import Dry, Stored
from .supplies import Held, Supply, hold, owners
from .turned import TurnedProblem
from .turning import Shaft
from .views import Inside, LiftedFilm, MirroredFilm, Raised

Coefficients = tuple[BoxScheme, Held | None]  # and the supplies that they hold
NAMES = ("west", "east", "south", "north")
STEP = 1e-30  # relative, of a complex step: nothing is subtracted, so no digits are lost however small it is
RING = ("periodic", "periodic")
OPPOSITE = dict(zip(NAMES, ("east", "west", "north", "south"), strict=True))


@dataclass(frozen=True)
class Side:
    """What one side of the film is.

    kind : 'open' (pressure given), 'closed' (nothing flows through: a wall in the way, or a line of symmetry), 'periodic'
    (the film goes on at the opposite side) or 'mirror' (closed, with points on it: what `reduction` cuts along).
    p : pressure above the cavitation pressure, Pa (open). r : void fraction that enters (west, with p = 0).
    """

    kind: str = "open"
    p: float = 0.0
    r: float = 0.0


@dataclass(frozen=True)
class Model:
    """A film over [0, L] or [0, L] x [0, Ly] in SI units; the letters are those of `LubricationProblem`.

    U : of either sign, or 0, when the film is a hydrostatic one: p solves the linear complementarity problem p >= 0,
    A p - c >= 0, and as no side is below the cavitation pressure there is no void, r = 0.

    sides : west, east, south, north (the last two in 2D).

    Raises
    ------
    InputError : sides that contradict one another, or leave the pressure's level open.
    """

    lengths: tuple[float, ...]
    sides: tuple[Side, Side, Side, Side]
    gap: Film
    mu: float
    U: float
    p_c: float
    p_unit: float
    scheme: str
    mean_cubes: bool = False
    exact: Callable[[], ExactSolution | None] | None = None
    grooves: tuple[Groove, ...] = ()  # of a film that is periodic in x
    shaft: Shaft | None = None  # of a film that is wrapped round one
    levers: tuple[Film, ...] = ()  # by what the pressure is multiplied in the moments about the pivots of pads, m
    supplies: tuple[Supply, ...] = ()
    law: Law | None = None  # a fluid that depends on the pressure; `build` makes the problem of the constant one
    polar: Polar | None = None  # of a sector (`Grid.polar`)
    integrals: bool = True  # fluxes of a line (1D, scheme face) are exact where full; not so one that stands for a plane
    places: Places | None = None  # of the lines of points; None: on the film's straight edges, if it has any
    effects: tuple[Effect, ...] = ()  # what else makes its coefficients depend on the answer; `build` leaves them out
    stored: Stored | None = None  # by the cells, in a time step
    dry: Dry | None = None  # the cavities for which faces that round edges cut are made; None: a full film's
    in_time: bool = False  # what its cells store goes on: then it may be sealed
    extras: Callable[[dict[str, Any]], dict[str, Any]] | None = None  # the bearing's own numbers, made of the film's

    def __post_init__(self) -> None:
        used = dict(zip(NAMES, self.sides, strict=True) if len(self.lengths) == 2 else zip(NAMES[:2], self.sides, strict=False))
        for name, side in used.items():
            if side.kind == "periodic" and used[OPPOSITE[name]].kind != "periodic":
                raise InputError(f"sides.{name} is periodic, sides.{OPPOSITE[name]} is not: both of them or none")
            inlet = "west" if self.U >= 0 else "east"
            if side.r and (name != inlet or side.p):
                raise InputError(f"sides.{name}.r = {side.r:g}: void enters by the {inlet} side alone, and there at p = p_c")
        if self.sealed and not self.in_time:
            raise InputError("no side has a pressure: without one the level of p is open; give at least one side a p")
        if self.U < 0 and self.grooves:
            raise InputError(f"U = {self.U:g}: a film with axial grooves moves to larger x; turn it round")

    @property
    def sealed(self) -> bool:
        """Whether nothing holds a pressure anywhere: then what the film stores must leave it some void."""
        return not self.supplies and not self.grooves and all(s.kind != "open" for s in self.sides[: 2 * len(self.lengths)])

    @property
    def fed(self) -> bool:
        """Whether oil comes in where the film goes round, or none has to."""
        fed = bool(self.grooves or self.supplies) or any(side.kind == "open" and side.p > 0 for side in self.sides)
        return fed or not self.U or self.sides[0].kind != "periodic"

    @property
    def p_sides(self) -> tuple[float, ...]:
        """Pressures of the sides, Pa above p_c; 0 where none is given."""
        return tuple(side.p if side.kind == "open" else 0.0 for side in self.sides)

    @property
    def dense(self) -> bool:
        """Whether the density follows the pressure."""
        return self.law is not None and self.law.dowson_higginson

    @property
    def knows(self) -> bool:
        """Whether its faces know edges, and fronts, of a film in the plane."""
        return self.scheme == "face" and not self.mean_cubes and len(self.lengths) == 2

    @property
    def cut(self) -> bool:
        """Whether round edges cut faces that are made for cavities (`rims`)."""
        return self.knows and bool(getattr(self.gap, "rims", ()))

    @property
    def cornered(self) -> bool:
        """Whether it has corners about which faces are made for cavities (`recesses`)."""
        return self.knows and bool(corners_of(self.gap).size)

    @property
    def film(self) -> Film:
        """The gap, asked beyond a side that is not open only for what lies inside."""
        dims = len(self.lengths)
        kinds = [tuple(side.kind for side in self.sides[2 * k : 2 * k + 2]) for k in range(dims)]
        if all(pair == ("open", "open") for pair in kinds):
            return self.gap
        return Inside(self.gap, self.lengths, tuple(pair == ("periodic", "periodic") for pair in kinds))

    def facts(self, shape: Sequence[int], comm: PETSc.Comm | None = None) -> Facts:
        """The problem on (nx,) or (nx, ny) points, in numbers."""
        periodic = tuple(self.sides[2 * k].kind == "periodic" for k in range(len(self.lengths)))
        ranks, held = (comm or PETSc.COMM_WORLD).getSize(), bool(self.supplies)
        told = {"held": held, "moving": self.stored is not None, "free": self.stored is not None and self.stored.exact}
        plane = len(shape) == 2 and self.polar is None
        alike = plane and one_line(self.film) and self.lines(shape, (False, True))[1] is None
        twice = plane and (self.cut or self.cornered) and self.dry is None
        return Facts("lubrication", tuple(shape), ranks, periodic, **told, alike=alike, twice=twice)

    @property
    def mirrored(self) -> "Model":
        """The mirror image in x, whose wall moves the other way."""
        west, east, *ends = self.sides
        gap, places = MirroredFilm(self.gap, self.lengths[0]), self.places
        if places is not None and places[0] is not None:
            places = (self.lengths[0] - places[0][::-1], places[1])
        supplies = tuple(replace(one, region=one.region.mirrored(self.lengths[0])) for one in self.supplies)
        changed: dict[str, Any] = {"sides": (east, west, *ends), "supplies": supplies, "places": places}
        changed["effects"] = tuple(effect.mirrored(self.lengths[0]) for effect in self.effects)
        changed["stored"] = self.stored.mirrored if self.stored else None
        return replace(self, gap=gap, U=-self.U, exact=None, **changed)

    def lines(self, shape: Sequence[int], asked: Sequence[bool] = (True, True)) -> Places:
        """Where the lines of points of a grid lie (`Grid.places`): on edges, where scheme 'face' can make use of it in 2D.

        asked : whether of each side; of the others None."""
        if self.places is not None:  # a coarser grid of a part: evenly
            x, y = (None if a is None or a.size != n else a for a, n in zip(self.places, (*shape, 1), strict=False))
            return x, y
        sides = zip(shape, self.edges, asked, strict=True)
        x, y = (on_edges(n, *edges) if of else None for n, edges, of in sides) if self.edges else EVEN
        if x is None and self.grooves and asked[0]:  # even, or with too few lines for what lies between the grooves as well
            x = on_edges(shape[0], self.lengths[0], RING, self._groove_edges)
        return x, y

    def edges_along(self, axis: str) -> list[float]:
        """x or y (m) of the straight lines at which the film, its slope, a supply or a groove jumps or ends."""
        ends = self._groove_edges if axis == "x" else []
        kinks = [t for t in kinks_of(self.gap, axis) if 0.0 < t < self.lengths["xy".index(axis)]]
        return [*jumps_of(self.gap, axis), *kinks, *(t for one in self.supplies for t in one.region.edges(axis)), *ends]

    @property
    def _groove_edges(self) -> list[float]:
        return [at % self.lengths[0] for groove in self.grooves for at in (groove.start, groove.end)]

    @property
    def edges(self) -> list[tuple[float, list[str], list[float]]]:
        """Length, kinds of the ends and edges of each side of a film whose lines of points lie on edges."""
        if not self.knows:
            return []
        kinds = [[side.kind for side in self.sides[2 * k : 2 * k + 2]] for k in (0, 1)]
        return list(zip(self.lengths, kinds, map(self.edges_along, "xy"), strict=True))

    def grid(self, shape: Sequence[int], comm: PETSc.Comm | None = None) -> Grid:
        """(nx,) or (nx, ny) points. Collective."""
        ends = tuple((self.sides[k].kind, self.sides[k + 1].kind) for k in (0, 2))
        return Grid(shape, self.lengths, comm, ends=ends, places=self.lines(shape), polar=self.polar)  # type: ignore[arg-type]

    def fewest_meshes(self) -> tuple[int, ...]:
        """Meshes a side from which a line of points lies on each straight edge."""
        if self.grooves or self.places is not None:
            return ()
        return tuple(max(1, stretches(*edges)[1].size) for edges in self.edges)

    def build(
        self, shape: Sequence[int], comm: PETSc.Comm | None = None, grid: Grid | None = None, made: Coefficients | None = None
    ) -> LubricationProblem:
        """The discrete problem on (nx,) or (nx, ny) points, or on a grid that others use too. Collective.

        made : where that is known.

        Raises
        ------
        InputError : more ranks than the grid can be dealt to, a film that is not positive, one that nothing feeds.
        """
        if not self.fed and not self.in_time:
            raise InputError("periodic along the flow, and no side above the cavitation pressure: nothing feeds the film")
        if self.U < 0:
            return TurnedProblem(self.mirrored.build(shape, comm), self.exact)
        west = self.sides[0]
        shared, grid = grid is not None, grid or self.grid(shape, comm)
        film = self.film
        exact = self.integrals and grid.dim == 1 and self.scheme == "face" and not self.mean_cubes and not self.stored
        integrals = line_integrals(grid, film) if exact and "mirror" not in grid.ends[0] else None
        if integrals is not None and self.supplies:
            from .spans import supplied  # here: of lines alone

            owner = np.concatenate(grid.comm.allgather(owners(grid, self.supplies).ravel()))
            integrals.part(supplied(integrals, grid, self.supplies, owner))

        dry = None if self.dry is None else self.dry.on(grid)
        scheme, held = made or self._scheme(grid, integrals, dry)
        problem = (GroovedProblem if self.grooves else LubricationProblem)(
            grid,
            scheme,
            mu=self.mu,
            U=self.U,
            p_unit=self.p_unit,
            p_sides=self.p_sides,
            p_c=self.p_c,
            film=film,
            exact=self.exact,
            shaft=self.shaft,
            r_in=west.r if west.kind == "open" else 0.0,
            held=held,
            integrals=integrals,
        )
        problem.shares_grid, problem.extras, problem.levers, problem.stored = shared, self.extras, self.levers, self.stored
        problem.edged, problem.tops = not self.mean_cubes, self.scheme == "face" and not self.mean_cubes
        if isinstance(problem, GroovedProblem):
            problem.grooves = self.grooves
        if self.scheme == "face" and grid.dim == 2:
            problem.coefficients_for, problem.dry = partial(self._scheme, grid, integrals), dry
            problem.cornered = self.cornered
            problem.remade = self.cut or problem.cornered or dry is not None
        return problem

    @property
    def _data(self) -> dict[str, Any]:
        """What the box scheme is told beside grid and film."""
        given = {name: getattr(self, name) for name in ("mu", "U", "scheme", "p_unit", "mean_cubes")}
        return {**given, "p_sides": self.p_sides, "r_in": self.sides[0].r, "stored": self.stored}

    def film_slopes(self, problem: LubricationProblem, lifted: LiftedFilm | None = None) -> BoxScheme:
        """Derivatives of the coefficients of a problem built from this (U >= 0) by its film, or along a lift. Collective.

        A coefficient depends on the film at its own face or point alone (`mean_cubes`: at both points; `integrals`: between
        its two points), so one complex step through the code that makes them gives each its own derivative; h has 1.
        """
        grid, integrals, flow_unit = problem.grid, problem.integrals, problem.scheme.flow_unit
        step = STEP * grid.reduce.max(np.abs(np.asarray(self.gap(grid.x, grid.y))))
        lift: Any = None if lifted is None else 1j * step * lifted.lift
        moved: Any = Raised(self.gap, 1j * step) if lifted is None else replace(lifted, lift=lift)
        along = None if integrals is None else integrals.lifted(1j * step)
        box = coefficients(grid, moved, **{**self._data, "stored": None}, cavity=problem.dry, integrals=along)
        changes = {name: np.imag(getattr(box, name)) / step for name in box.arrays}
        slopes = BoxScheme(**{name: a if name == "h" else a / flow_unit for name, a in changes.items()}, flow_unit=flow_unit)
        return self._held(grid, slopes, integrals)[0]

    def _scheme(self, grid: Grid, integrals: LineIntegrals | None, cavity: Array | None) -> Coefficients:
        """Coefficients with supplies, faces at round edges made for these cavities. Collective."""
        return self._held(grid, box_scheme(grid, self.gap, **self._data, integrals=integrals, cavity=cavity), integrals)

    def _held(self, grid: Grid, scheme: BoxScheme, integrals: LineIntegrals | None) -> Coefficients:
        """With its supplies."""
        if not self.supplies:
            return scheme, None
        return hold(grid, scheme, self.supplies, self.p_unit, integrals is not None and integrals.spans is not None)

    def columns(self, shape: Sequence[int]) -> Array:
        """x of all columns of points of a ring, m."""
        x = self.lines(shape)[0]
        return some_places(shape[0], self.lengths[0], RING, shape[0]) if x is None else x
