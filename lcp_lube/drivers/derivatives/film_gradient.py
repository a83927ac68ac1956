"""The derivative of a number by the film at every point, dQ/dh(x, y) per area: where to take material away.

The same lambda as for the scene's numbers (`gradient`), times the derivatives of the scheme's coefficients by the film at their
faces and points, which a complex step through the code of the scheme gives. What belongs to a face is dealt to its two points:
the film between them is then understood as their mean, as interpolation between points has it. In 1D the field is that of the
discrete equations, whose numbers differ from those told by the grid's error (`problems/film/line`).
"""

from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from ...base.parallel import Array
from ...problems.film.borne import by_coefficients
from ...problems.film.contact import areas
from ...problems.film.flows import drag, volume_unit
from ...problems.film.forces import Weight, weights
from ...problems.film.lubrication import LubricationProblem
from ...problems.film.reynolds import BoxScheme, sides
from ...problems.film.slopes import by_points, giving_points, slope
from ...problems.film.strip import line_weights
from ...problems.film.tangent import effective
from ...problems.film.weighed import Weighed, can
from ...problems.grid import Grid
from ...registry import SMALL
from .equations import DRAGS, FLIPPED
from .implicit import Implicit

STEP = 1e-30  # relative: complex steps have no differences whose digits could cancel


def per_area(total: Array, grid: Grid, reported: Any) -> Array:
    """dQ/dh of changes at the owned points, over their areas, where the problem that is told has them."""
    return reported.here({"h": total / areas(grid).ravel()})["h"]


class FilmGradient:
    """dQ/dh of the quantities of an `Adjoint`, or of what has its attributes. Collective, as its methods."""

    def __init__(self, adjoint: Any):
        self.adjoint, eq = adjoint, adjoint.equations
        self.problem = eq.problem(adjoint.p)
        self.model = model = eq.model
        self.at_faces = model.scheme == "face", model.scheme != "upwind"  # whether void and Couette flow are those of faces
        self.mean_cubes = model.mean_cubes

    @cached_property
    def implicit(self) -> Implicit:
        return Implicit.of(self.adjoint)

    @cached_property
    def bare(self) -> BoxScheme:
        """Of the coefficients by the film, of a constant fluid."""
        return self.model.film_slopes(self.adjoint.equations.constant)

    @cached_property
    def slopes(self) -> BoxScheme:
        """Of the coefficients by the film."""
        eq, slopes = self.adjoint.equations, self.bare
        if eq.law is None:
            return slopes
        known = {name: getattr(eq.constant, name) for name in ("p_unit", "p_sides", "film")}
        changed = LubricationProblem(eq.grid, slopes, mu=1.0, U=0.0, p_c=0.0, **known)
        return effective(changed, eq.law, self.adjoint.p, eq._p_sides).scheme

    @cached_property
    def _weighed(self) -> Weighed | None:
        """Where compiled loops know the film."""
        adjoint, constant = self.adjoint, self.adjoint.equations.constant
        known = adjoint.equations.law is None and can(constant, self.model, SMALL)
        return Weighed(constant, self.model, adjoint.p, adjoint.r) if known else None

    @cached_property
    def _mirrored(self) -> bool:
        """Whether the film was solved on half of its width, on one rank."""
        return getattr(self.adjoint, "reduction", None) == "mirror" and self.problem.grid.comm.size == 1

    def _even(self, a: Array) -> bool:
        lines = a.reshape(self.problem.grid.box)
        half = len(lines) // 2
        return np.array_equal(lines[:half], lines[: -half - 1 : -1])

    def field(self, quantity: str) -> Array:
        """dQ/dh at the owned points of the solution's grid, unit of Q per m and m2 (1D: per m and m).

        A change of the film by dh(x, y) changes Q by the sum over the points of dQ/dh dh times their `areas`.
        """
        total: Any = 0.0
        for name, factor in self.implicit.weights(quantity).items():
            total = factor * self.lagrangian(name) + total
        return per_area(total.ravel(), self.adjoint.equations.grid, self.adjoint.reported)

    def destroy(self) -> None:
        """Nothing of its own."""

    def lagrangian(self, name: str) -> Array:
        """Of one L by the film at each point, all that cells store held: by what the balance has, and the number itself."""
        adjoint = self.adjoint
        held = adjoint.equations.given
        rows = -adjoint.lambdas[name] if held is None else np.where(held, 0.0, -adjoint.lambdas[name])
        total: list[Array] = []
        unit = volume_unit(self.problem)
        for part, weight in adjoint.parts[name].items():
            part = FLIPPED.get(part, part) if adjoint.equations.turned else part
            if part.startswith(("groove_flow_", "supply_flow_")):
                inside = giving_points(adjoint.equations.constant, part)
                rows = rows + weight * unit * inside
            elif part in DRAGS:
                polar = self.problem.grid.polar
                lever = polar[0] + self.problem.grid.y if part == "friction_torque" and polar else 1.0
                total.append(weight * (-1.0 if adjoint.equations.turned else 1.0) * self._friction(lever))
            elif part.startswith("flow_"):
                total.append(weight * self._flow(part.removeprefix("flow_")))
            elif part == "p_max" and self.model.cut:
                total.append(weight * slope(self.problem, None, adjoint.p, adjoint.r, part).film)
            elif self.problem.cornered and (carried := weights(self.problem).get(part)) is not None:
                total.append(weight * self._fronts(carried))
        return sum(total, self._balance(rows))

    def _balance(self, rows: Array) -> Array:
        """rows' dG/dh, dealt to the points."""
        if self._weighed is not None:
            return self._weighed.by_film(rows, self.problem.scheme.flow_unit, self._mirrored and self._even(rows))
        grid, s, adjoint = self.problem.grid, self.slopes, self.adjoint
        w = rows.reshape(grid.box)
        frame_p, frame_r = (grid.ghosted(a, outside=0.0) for a in (adjoint.p / self.problem.p_unit, adjoint.r))
        p, r = frame_p[1:-1, 1:-1], frame_r[1:-1, 1:-1]
        around = [frame_p[1:-1, :-2], frame_p[1:-1, 2:], frame_p[:-2, 1:-1], frame_p[2:, 1:-1]]
        pressed = []
        for k, beside, at, p_side in zip((s.k_W, s.k_E, s.k_S, s.k_N), around, sides(grid), self.problem.p_sides, strict=True):
            pressed.append(w * k * (p - np.where(at, p_side / self.problem.p_unit, beside)))
        shares = self._shares() if self.mean_cubes else [0.5] * 4
        faces = [f * share for f, share in zip(pressed, shares, strict=True)]  # the neighbour's part
        own = sum(f - part for f, part in zip(pressed, faces, strict=True))
        void_at_faces, dragged_at_faces = self.at_faces
        for value, face, at_face in (
            (-w * s.couette_W, 0, dragged_at_faces),
            (w * s.couette_E, 1, dragged_at_faces),
            (w * s.b_W * frame_r[1:-1, :-2], 0, void_at_faces),
            (w * s.b_C * r, 1, void_at_faces),
        ):
            part = 0.5 * value if at_face else (value if face == 0 else 0.0 * value)
            faces[face] = faces[face] + part
            own = own + value - part
        return self._dealt(own, faces)

    def _shares(self) -> list[Array]:
        """Of the neighbours, in the derivative of a mean of cubes."""
        h = self.adjoint.equations.grid.ghosted(self.problem.scheme.h.ravel() ** 2)
        here = h[1:-1, 1:-1]
        return [np.nan_to_num(other / (other + here)) for other in (h[1:-1, :-2], h[1:-1, 2:], h[:-2, 1:-1], h[2:, 1:-1])]

    def _dealt(self, own: Array, faces: list[Array]) -> Array:
        """Each face's part to the neighbour behind it; beyond a side to the point itself."""
        grid = self.problem.grid
        west, east, south, north = faces
        frames = [grid.ghosted(a.ravel()) for a in (east, west, north, south)]
        arrived = [frames[0][1:-1, :-2], frames[1][1:-1, 2:], frames[2][:-2, 1:-1], frames[3][2:, 1:-1]]
        beyond = [np.isnan(a) for a in arrived]  # this point's own part has nowhere to go
        kept = [np.where(outside, part, 0.0) for outside, part in zip(beyond, (west, east, south, north), strict=True)]
        return np.asarray(own + sum(kept) + sum(np.nan_to_num(a) for a in arrived))

    def _friction(self, lever: Any) -> Array:
        """Of the friction by the film, fields held."""
        if self._weighed is not None:
            return self._weighed.drag_by_film(lever, self._mirrored)
        problem, s = self.problem, self.slopes
        step = STEP * problem.reduce.max(problem.scheme.h)
        moved = {name: getattr(problem.scheme, name) + 1j * step * getattr(s, name) for name in ("b_C", "couette_E", "h")}
        parts = drag(problem, replace(problem.scheme, **moved), self.adjoint.p, self.adjoint.r, 1j * step)
        east, own = (np.broadcast_to(lever * np.imag(part) / step, problem.grid.box) for part in parts)
        none = np.zeros_like(east)
        return self._dealt(own + 0.5 * east, [none, 0.5 * east, none, none])

    def _fronts(self, weight: Weight) -> Array:
        """Of an integral of the pressure by the film, fields held: as fronts lie elsewhere in it."""
        adjoint, problem = self.adjoint, self.problem
        by_k, by_b = by_coefficients(problem, adjoint.p, adjoint.r, by_points(problem, weight))
        if self._weighed is not None:
            return self._weighed.begun_by_film(by_k, by_b, problem.scheme.flow_unit)
        s = self.bare
        half = 0.5 * (by_k * s.k_W + by_b * s.b_W)
        none = np.zeros_like(half)
        return self._dealt(half, [half, none, none, none])

    def _flow(self, side: str) -> Array:
        """Of the flow through one side by the film of the cells there, fields held."""
        problem, s, grid = self.problem, self.slopes, self.problem.grid
        p, r = (self.adjoint.p / problem.p_unit).reshape(grid.box), self.adjoint.r.reshape(grid.box)
        names = ("west", "east", "south", "north")
        at, p_sides = dict(zip(names, sides(grid), strict=True)), dict(zip(names, problem.p_sides, strict=True))
        k = dict(zip(names, (s.k_W, s.k_E, s.k_S, s.k_N), strict=True))
        leaving, entering = s.couette_E + s.b_C * r, s.couette_W
        out = k[side] * (p - p_sides[side] / problem.p_unit)
        out = out + leaving if side == "east" else out - entering if side == "west" else out
        here = np.where(at[side], out, 0.0)
        for end, rim in zip(("south", "north"), grid.rims(1), strict=True) if grid.dim == 2 else ():
            strip = 0.5 * rim / line_weights(grid)
            if side in ("west", "east"):
                here = here + np.where(at[side] & at[end], strip * (leaving if side == "east" else -entering), 0.0)
            elif side == end:
                here = here + np.where(at[side] & at["west"], strip * entering, 0.0)
                here = here - np.where(at[side] & at["east"], strip * leaving, 0.0)
        size = 0.5 * s.flow_unit * (grid.spacing[1] if grid.dim == 2 else 1.0)
        return size * here
