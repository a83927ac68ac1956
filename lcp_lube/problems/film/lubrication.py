"""The door between physics and solvers: the data of A p + B r = c, p r = 0, p, r >= 0, and what certifies an answer."""

from collections.abc import Callable, Iterable, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property
from typing import Any, Self, cast

import numpy as np
from petsc4py import PETSc

from ...base.owned import Owned, made
from ...base.parallel import Array
from ..certificate import Certificate
from ..grid import Grid
from ..solution import Fields
from ..strips import MANY, ghosted
from ..transfer import alike, interpolated
from .assembly import assemble
from .certify import certify
from .exact import ExactSolution
from .integrals import LineIntegrals
from .quantities import open_pressures, quantities, units
from .reynolds import BoxScheme, side_points, sides
from .supplies import Held, Supply, pressed
from .turning import Shaft, ahead
from .views import LiftedFilm


class LubricationProblem:
    """Steady Reynolds problem with mass-conserving cavitation on a grid.

    The fields are arrays of this rank's points, in the grid's order: p in units of `p_unit` above the cavitation
    pressure, r the void fraction.

    Parameters
    ----------
    grid : the interior points. scheme : coefficients of the box scheme there, in units of p_unit.
    mu, U, p_unit : viscosity in Pa s, wall speed in m/s, pressure unit in Pa.
    p_sides : pressures above p_c at west, east, south, north in Pa. r_in : void fraction that enters at the west.
    p_c : cavitation pressure in Pa, added to the pressures that are reported. film : h(x, y) in metres.
    exact : gives the exact 1D solution, where one is known. shaft : what the film is wrapped round; None for a flat one.
    held : the supplies whose cells the scheme holds. integrals : of the film of a line whose fluxes are made of them.
    """

    kind = "lubrication"
    shares_grid, many = False, MANY  # a time step's with those of the others; points from which compiled loops over cells pay
    plain = True  # whether the coefficients are those of the film alone
    edged = True  # whether the coefficients know edges inside cells; not where mean_cubes
    cornered = False  # whether about corners of recesses faces are made for cavities, and integrals know fronts (`borne`)
    tops = False  # whether the largest pressure is looked for between the points (`peak`)
    barus = 0.0  # of the law by which its coefficients were made for its pressures, 1/Pa
    factors: Any = None  # of its faces, that follow from `cells`
    tangent: Any = None  # dG/dp, where that is not A
    oil: Any = None  # `oil_along.Oil`, where nothing else acts but what it knows; rigid: its film in q, of a small one
    rigid: Any = None
    bare: Any = None  # coefficients of the film alone, where `scheme` has them by its answer
    contact: Any = None  # of asperities
    levers: Any = ()  # `Model.levers`
    layers: Any = None  # `flows.layers` of a film near by, which has the same
    stored: Any = None  # by its cells, in a time step (`stored.Stored`)

    def __init__(
        self,
        grid: Grid,
        scheme: BoxScheme,
        *,
        mu: float,
        U: float,
        p_unit: float,
        p_sides: tuple[float, ...],
        p_c: float,
        film: Callable[[Array, Array], Array],
        exact: Callable[[], ExactSolution | None] | None = None,
        shaft: Shaft | None = None,
        r_in: float = 0.0,
        held: Held | None = None,
        integrals: LineIntegrals | None = None,
    ):
        self.grid, self.reduce, self.scheme, self.film = grid, grid.reduce, scheme, film
        self.mu, self.U, self.p_unit, self.p_sides, self.p_c = mu, U, p_unit, p_sides, p_c
        self.exact, self.shaft, self.r_in, self.held, self.integrals = exact, shaft, r_in, held, integrals
        self.coefficients_for: Callable[[Array], tuple[BoxScheme, Any]] | None = None  # of a film with rims, by its cavities
        self.dry: Array | None = None  # for what they have been made (`rims.state_of`); None: those of a full film
        self.remade = False  # whether it has such faces
        self.extras: Callable[[dict[str, Any]], dict[str, Any]] | None = None
        self.more, self.more_fields = dict[str, Any](), dict[str, tuple[Array, str]]()  # of what is solved beside p and r
        self.more_measures, self.cells = dict[str, float](), dict[str, Array]()  # for the certificate; what effects made of it
        self._own = Owned(self, grid.petsc_comm)

    @made
    def A(self) -> PETSc.Mat:
        """Assembled at first use, as B is: a method that works on the stencil alone saves their time and memory."""
        return assemble(self.grid, self.scheme.pressure_entries())

    @made
    def B(self) -> PETSc.Mat:
        return assemble(self.grid, self.scheme.void_entries())

    @made
    def _vectors(self) -> tuple[PETSc.Vec, PETSc.Vec]:
        return self.A.createVecs()

    @property
    def c(self) -> Array:
        return self.scheme.c.ravel()

    @property
    def moving(self) -> "LubricationProblem":
        """The problem that is solved: of a film that is turned round its mirror image."""
        return self

    def here(self, fields: Fields) -> Fields:
        """Fields of `moving` as fields of the film as it stands; `there`: the other way round. Collective."""
        return fields

    there = here

    @property
    def size(self) -> int:
        return self.grid.size

    @property
    def unknowns(self) -> int:
        return 2 * self.size

    def multiply(self, mat: PETSc.Mat, a: Array) -> Array:
        """mat @ a for one of A, B and an array of owned points. Collective."""
        x, y = self._vectors
        x.setArray(a)
        mat.mult(x, y)
        return y.array_r.copy()

    def flow(self, p: Array, r: Array) -> Array:
        """F1 = A p + B r - c, the flow balance of every point in m2/s. Collective."""
        return self.multiply(self.A, p) + self.multiply(self.B, r) - self.c

    def balance(self, p: Array, r: Array) -> Array:
        """F1 as the difference of the flows through each point's faces, to the last bit. Collective.

        A p + B r - c leaks by rounding: of A's diagonal where conductances differ by 1e9, of c where little flows in a ring.
        """
        s, flows = self.scheme, self.face_flows(p, r)
        return flows if s.held is None else np.where(s.held.ravel(), s.diagonal.ravel() * p - self.c, flows)

    def face_flows(self, p: Array, r: Array) -> Array:
        """What leaves each point's cell through its faces, and its sources: its balance, were it not held. Collective."""
        framed = [ghosted(self.grid, a, 0.0) for a in (p, r)]
        out = np.empty(self.grid.box, dtype=np.result_type(p, self.scheme.c))
        for rows, s in self.scheme.in_strips(self.grid):  # what lies between is then no more than the cache holds
            out[rows] = self._strip_flows(rows, s, *(frame(rows) for frame in framed))
        return out.ravel()

    def _strip_flows(self, rows: slice, s: BoxScheme, p: Array, r: Array) -> Array:
        """Of some lines; p, r : with a frame of neighbours."""
        around = [p[1:-1, :-2], p[1:-1, 2:], p[:-2, 1:-1], p[2:, 1:-1]]
        at_sides = zip([mask if len(mask) == 1 else mask[rows] for mask in self._at_sides], self.p_sides, around, strict=True)
        p_W, p_E, p_S, p_N = (np.where(at, side / self.p_unit, beside) if side else beside for at, side, beside in at_sides)
        p = p[1:-1, 1:-1]
        pressed = s.k_E * (p - p_E) - s.k_W * (p_W - p)
        if self.grid.dim == 2:
            pressed += s.k_N * (p - p_N) - s.k_S * (p_S - p)
        # The difference first: it may be small, and the pressures too, where the flows themselves are large.
        dragged = (s.couette_E + s.b_E * r[1:-1, 1:-1]) - (s.couette_W - s.b_W * r[1:-1, :-2])
        if s.storage is None or s.kept is None:
            return pressed + dragged - self.sources(rows, s)
        more = 0.0 if s.gives is None else s.gives * p
        return pressed + dragged + (s.storage * (1.0 - r[1:-1, 1:-1]) + more - s.kept)

    @cached_property
    def _at_sides(self) -> tuple[Any, ...]:
        return sides(self.grid)

    def sources(self, rows: slice, s: BoxScheme) -> Array:
        """What c has beyond the flows of the wall and the sides' pressures on some lines; nothing in a steady film alone."""
        if self.plain and s.held is None and s.storage is None:
            return np.zeros((1, 1))
        c = s.couette_W - s.couette_E
        for k, at_side, p_side in zip((s.k_W, s.k_E, s.k_S, s.k_N), self._at_sides, self.p_sides, strict=True):
            c += np.where(at_side if len(at_side) == 1 else at_side[rows], k * (p_side / self.p_unit), 0.0) if p_side else 0.0
        return s.c - c if s.held is None else np.where(s.held, 0.0, s.c - c)

    def hold_at(self, supplies: Sequence[Supply], P: Iterable[float] = ()) -> None:
        """Other sources for its supplies, with the pressures that were found, Pa above p_c, where these are not their own."""
        found = [replace(one, p=float(p)) for one, p in zip(supplies, P, strict=False)] or supplies
        self.held = held = replace(cast(Held, self.held), supplies=tuple(found))
        self.scheme = pressed(self.scheme, held, self.p_unit)

    def certify(self, fields: Fields, eps1: float, closely: bool = True) -> Certificate:
        """Certificate of the fields p and r for a run whose tolerance was eps1 (`film.certify`). Collective."""
        found = certify(self, fields["p"], fields["r"], eps1, closely)
        return replace(found, measures=found.measures | self.more_measures)

    def boundary_flows(self, p: Array, r: Array) -> tuple[float, float, float, float]:
        """Scaled flow through the west, east, south and north side, positive towards larger x or y.

        In the equation's terms, U h (1 - r) - h^3/(6 mu) dp/dx, that is twice the volume flow; m2/s in 1D, in 2D the sum
        over the side's points (times dy: m3/s).
        """
        s, box, (p, r) = self.scheme, self.grid.box, (a.reshape(self.grid.box) for a in (p, r))
        p_W, p_E, p_S, p_N = (side / self.p_unit for side in self.p_sides)
        west, east, south, north = side_points(self.grid)
        total = lambda at, flows: s.flow_unit * self.reduce.of_some(flows, at, box)  # noqa: E731
        return (
            total(west, s.couette_W[west] + s.k_W[west] * (p_W - p[west])),
            total(east, self.leaving(r)[:, : r[east].shape[1]] + s.k_E[east] * (p[east] - p_E)),
            total(south, s.k_S[south] * (p_S - p[south])),
            total(north, s.k_N[north] * (p[north] - p_N)),
        )

    def leaving(self, r: Array) -> Array:
        """What the wall drags through the east faces of this rank's last column; shape (lines, 1)."""
        (ny, nx), s = self.grid.box, self.scheme
        last = s.b_E_at(np.arange(ny), nx - 1)
        return s.couette_E[:, -1:] + (last * r.reshape(ny, nx)[:, -1])[:, None]

    def quantities(self, fields: Fields) -> dict[str, Any]:
        """Load, friction, flows, largest pressure, cavity, and the scene's own `extras`. Collective."""
        return quantities(self, fields["p"], fields["r"])

    def physical(self, fields: Fields) -> dict[str, tuple[Array, str]]:
        """Absolute pressure in Pa, void fraction, film in m."""
        p = fields["p"] * self.p_unit + self.p_c
        return {"p": (p, "Pa"), "r": (fields["r"], ""), "h": (self.scheme.h.ravel(), "m"), **self.more_fields}

    @property
    def units(self) -> dict[str, str]:
        """Units of the quantities, in 1D per metre of width."""
        return units(self.grid.dim)

    def at_sides(self, name: str, x: Array, y: Array) -> Array:
        """Given pressures (at a corner the mean of its two), the film, and the void: what enters west, none above p_c."""
        if name == "h":
            return np.array(self.film(x, y), dtype=float)
        grid, shape = self.grid, np.broadcast(x, y).shape
        if name in self.more_fields:
            return np.full(shape, np.nan)
        total = count = np.zeros(shape)
        for k, p in enumerate(open_pressures(self)):
            at = (x, y)[k // 2] == grid.origin[k // 2] + (k % 2) * grid.lengths[k // 2]
            total, count = (total + np.where(at, p, 0.0), count + at) if p is not None else (total, count)
        with np.errstate(invalid="ignore"):
            p_sides = total / count  # NaN where no side has a pressure
        if name == "p":
            return p_sides + self.p_c
        return np.where((x == grid.origin[0]) & (grid.ends[0][0] == "open"), self.r_in, np.where(p_sides > 0, 0.0, np.nan))

    def prolong(self, coarse: "LubricationProblem", fields: Fields, interior: bool) -> Fields:
        """p and r on this grid from a coarser one, by interpolating z = p/P - r/R bilinearly (P, R: largest p and r).

        interior: p, r = (+-z + sqrt(z^2 + 4 m))/2, off the boundary with products p r = m P R. The front is known to a mesh
        H of the coarse grid, where p ~ (H/L)^2 and r ~ H/L: m = 10 (H/L)^3, at most 1e-3. Collective.
        """
        shift = ahead(self, coarse)
        if not (interior or shift) and alike(coarse.grid, self.grid):
            return fields
        P, R = (coarse.reduce.max(fields[name]) or 1.0 for name in "pr")
        z = interpolated(coarse.grid, self.grid, fields["p"] / P - fields["r"] / R, shift)
        root = np.sqrt(z * z + 4.0 * min(1e-3, 10.0 / max(coarse.grid.shape) ** 3)) if interior else np.abs(z)
        return {"p": 0.5 * P * (root + z), "r": 0.5 * R * (root - z)}

    def revised(self, dry: Array | None) -> "LubricationProblem":
        """The film with faces at round edges (`rims`), if any, made for these points, if any (`rims.state_of`). Collective."""
        if dry is None or self.coefficients_for is None:
            return self
        scheme = pressed(self.coefficients_for(dry)[0], self.held, self.p_unit)
        (other := copy(self)).__dict__ |= {"dry": dry, "remade": True, "scheme": scheme}
        return other

    def with_scheme(
        self, scheme: BoxScheme, mu: float | Array, p_sides: tuple[float, ...] | None = None, held: Held | None = None
    ) -> Self:
        """The problem on the same grid with other coefficients; mu : viscosity at the east faces, Pa s."""
        (other := copy(self)).scheme, other.mu, other.exact = scheme, mu, None  # type: ignore[assignment]
        other.p_sides, other.held, other.bare = p_sides or self.p_sides, held or self.held, self.bare or self.scheme
        other.__dict__ |= dict.fromkeys(("coefficients_for", "factors", "contact", "tangent", "rigid"), None)
        other.__dict__ |= {name: {} for name in ("more", "more_fields", "more_measures", "cells")} | {"plain": False}
        return other

    def with_lift(self, lift: Array) -> Self:
        """The problem with the film thicker by `lift` at the owned points, m: what is told of it, not its coefficients."""
        (other := copy(self)).plain, other.scheme = False, self.scheme.changed(h=self.scheme.h + lift.reshape(self.grid.box))
        other.film = LiftedFilm.of(self.film, self.grid, lift)
        return other

    def free_matrices(self) -> None:
        """Free A and B, which are assembled again at need. Collective."""
        self._own.free()

    def destroy(self) -> None:
        """Free the PETSc objects, but for a grid that others use too. Collective."""
        self.free_matrices()
        if not self.shares_grid:
            self.grid.destroy()

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name not in (*self._own.names, "_own")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__ |= state | {"_own": Owned(self, state["grid"].petsc_comm)}
