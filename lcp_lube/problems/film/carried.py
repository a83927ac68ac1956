"""Flows and heat of a film's answer: what goes through each face, also where it turns round, and what warms each cell."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ...base.parallel import Array
from .cavity import cavitated, cavity_sign
from .contact import areas
from .effects import Answer, around, framed_by
from .flows import linear, point_weights, sheared_faces, volume_unit
from .forces import ambient
from .reynolds import sides
from .strip import line_weights

STILL = 1e-11  # of the largest flow out of a cell: what is less is rounding
NOTHING = 1e-18  # of what pressures could turn into heat: the square of what a solve may leave of them
LEVEL = 1e-15  # of the largest pressure: a drop by less is rounding where no wall moves, and what it drives anywhere


@dataclass(frozen=True)
class Carried:
    """Flows and heat of an answer; arrays of shape grid.box, W (1D: W/m) and m3/s (1D: m2/s).

    q : out of a cell's west, east, south and north face. free : cells whose temperature is unknown (the others lie in
        grooves). inside : whether a cell's west, east, south and north neighbour is such a one.
    dissipation : of each cell; sheared : the part of it that the wall drags.
    power : what drag and pumps put in, as the film's own numbers have it; NaN where it was not asked for.
    area : of the cells, m2 (1D: m).
    turns : through the west and east face both ways: what the wall drags out of a part of a cell that is full, and pressure
        drives back into it, as far as it or the cell to the west is empty, m3/s: none all at once as the last void goes;
        beyond the film only where nothing else flows.
    held, kept : of a time step: liquid of a cell over the step's length, m3/s, and what it held before times T, K m3/s.
    rounding : of all that pressure drives, m3/s.
    """

    q: tuple[Array, Array, Array, Array]
    free: Any
    inside: list[Any]
    dissipation: Array
    power: float
    area: Array
    sheared: Array
    turns: tuple[Array, Array]
    held: Array
    kept: Array
    rounding: float

    @cached_property
    def both_ways(self) -> tuple[list[Array], list[Array]]:
        """What leaves a cell through its west, east, south and north face, and what enters it, m3/s."""
        turns = (*self.turns, 0.0, 0.0)
        out, into = ([np.maximum(s * a, 0.0) + b for a, b in zip(self.q, turns, strict=True)] for s in (1.0, -1.0))
        return out, into


def holders(at: Answer) -> list[Any]:
    """For each groove or supply inside the film, whether an owned point lies in it."""
    held: Any = at.problem.held
    count = len(held.supplies) if held is not None else 0
    return [*getattr(at.problem, "columns", []), *((held.owner == k).ravel() for k in range(count))]


def carried(at: Answer, told: bool = True) -> Carried:
    """Flows, dissipation and, where it is to be told, power of an answer. Collective."""
    problem, grid = at.problem, at.grid
    s: Any = problem.scheme
    box, dy = grid.box, grid.spacing[1] if grid.dim == 2 else 1.0
    unit = volume_unit(problem)
    held = holders(at)
    free = ~np.logical_or.reduce(held).reshape(box) if held else np.ones(box, dtype=bool)
    p, r = at.p.reshape(box), at.r.reshape(box)
    beside = around(framed_by(grid, at.p, problem.p_sides))
    k = [unit * a / problem.p_unit for a in (s.k_W, s.k_E, s.k_S, s.k_N)]
    largest = problem.reduce.max(np.abs(p))
    flat = 0.0 if problem.U else LEVEL * largest
    pushed = [np.where(np.abs(p - b) > flat, a * (p - b), 0.0) for a, b in zip(k, beside, strict=True)]  # out of the cell
    void_W = grid.ghosted(at.r, outside=0.0)[1:-1, :-2]
    dragged = [-unit * (s.couette_W - s.b_W * void_W), unit * (s.couette_E + s.b_E * r)]
    q = (pushed[0] + dragged[0], pushed[1] + dragged[1], pushed[2], pushed[3])

    # Whether the neighbour (west, east, south, north) is a cell whose temperature is unknown.
    other_free = [a > 0.5 for a in around(framed_by(grid, free.astype(float), (0.0,) * 4))]
    empty = cavitated(problem.reduce, at.p, at.r)  # some methods leave a rounding of void in full cells
    void = np.where(empty, at.r, 0.0)
    part = np.where(free, np.maximum(void.reshape(box), grid.ghosted(void, outside=0.0)[1:-1, :-2]), 0.0)
    back = np.minimum(dragged[1], -pushed[1]) - np.maximum(pushed[0], 0.0)
    turn = part * np.maximum(back, 0.0)
    # What turns round at a side or groove takes no heat of the film along, however large it is on grids that do not tell its
    # stretch from the rest of the film; but where all else stands still nothing else does.
    west, east, south, north = (np.maximum(a, 0.0) for a in q)
    goes = west + east + south + north
    turn = np.where(other_free[1] | (goes <= STILL * problem.reduce.max(goes)), turn, 0.0)
    turns = (grid.ghosted(turn.ravel(), outside=0.0)[1:-1, :-2], turn)
    heat = np.zeros(box)
    for flow, near, is_free in zip(pushed, beside, other_free, strict=True):
        heat += np.where(is_free, 0.5, 1.0) * flow * (p - near)
    # Where the end is closed or a mirror nothing beyond takes its half, and nothing flows.
    by_wall, drag = _shear(at, dy, other_free)
    sheared = np.where(free, by_wall, 0.0)
    if problem.contact is not None:
        carrying = problem.contact.p_a.reshape(box) * areas(grid) * grid.stretch(grid.y)
        by_wall = by_wall + abs(problem.U) * problem.contact.friction * carrying
    drives = problem.reduce.sum(np.sum(k, axis=0)) * largest
    if not problem.U and not problem.reduce.sum(np.abs(heat)) > NOTHING * drives * largest:  # of what it could turn into heat
        heat = np.zeros(box)  # rounding
    area, stays, was = grid.cell * point_weights(grid).reshape(box), np.zeros(box), np.zeros(box)
    if problem.stored is not None:
        stays = np.where(free, unit * s.storage * (1.0 - r), 0.0)
        was = np.where(free, area * problem.stored.on(grid, problem.stored.carried), 0.0)
    heat, power = np.where(free, heat + by_wall, 0.0), np.nan
    if told:
        # No oil is lost: the pumps' work may be counted from any level of pressure, best from one that is among theirs.
        least = ambient(problem)
        first_west = (sides(grid)[0] | ~other_free[0]) & free
        work = np.where(free, by_wall + drag * (beside[1] - p), 0.0) - np.where(first_west, dragged[0] * (p - beside[0]), 0.0)
        for flow, near, is_free in zip(q, beside, other_free, strict=True):
            work -= np.where(free & ~is_free, flow * (near - least), 0.0)
        if problem.stored is not None:
            work -= np.where(free, p - least, 0.0) * (stays - unit * s.kept)
        power = float(problem.reduce.sum(work))
    return Carried(q, free, other_free, heat, power, area, sheared, turns, stays, was, LEVEL * drives)


def _shear(at: Answer, dy: float, other_free: list[Any]) -> tuple[Array, Array]:
    """mu U^2/h over each cell by the midpoint rule at the x faces, W, and what is dragged through its east face, m3/s.

    As `flows.friction` has it: the outer half meshes at open sides belong to the cells beside them, in the half cell at a
    closed side h^2 dp/dx = 6 mu U where it is full.
    """
    problem, grid = at.problem, at.grid
    s, box = problem.scheme, at.grid.box
    _, _, south, north = sides(grid)
    closed = sides(grid, ("closed",))[:2]
    r = at.r.reshape(box)
    full = (cavity_sign(problem.reduce, at.p, at.r) >= 0).reshape(box)
    mu_east = np.broadcast_to(problem.mu, box)
    mu_west = grid.ghosted(np.ascontiguousarray(mu_east).ravel())[1:-1, :-2]
    mu_west = np.where(np.isnan(mu_west), at.mu.reshape(box), mu_west)
    before, behind = grid.steps(0)[:-1], grid.steps(0)[1:]
    faces = [sheared_faces(problem, grid.x + step)[1:] for step in (-before / 2, behind / 2)]
    liquid = 1.0 + s.b_E * r / np.where(s.couette_E != 0.0, s.couette_E, np.inf)
    liquid_west = grid.ghosted(np.ascontiguousarray(liquid).ravel(), outside=1.0)[1:-1, :-2]
    rims = grid.rims(1) if grid.dim == 2 else (0.0, 0.0)
    rows = problem.U**2 * dy * grid.stretch(grid.y) ** 3 * (line_weights(grid) + 0.5 * (rims[0] * south + rims[1] * north))
    total = np.zeros(box)
    for mu, h, share, is_free, wall, dx in (
        (mu_west, faces[0], liquid_west, other_free[0], closed[0], before),
        (mu_east, faces[1], liquid, other_free[1], closed[1], behind),
    ):
        a, b = linear(np.where, share, *h)
        inner = np.where(is_free, 0.5, 1.0) * (a + share / b)
        at_wall = 0.5 * np.where(full, 4.0, 1.0 - r) / s.h
        total = total + dx * mu * np.where(wall, at_wall, inner)
    return rows * total, volume_unit(problem) * (s.couette_E + s.b_E * r)
