"""Heat in a film: where it arises, how the liquid carries it, what leaves. Temperatures are means across the film.

Cell by cell, with the volume flows q of the box scheme through the faces of a cell, upwind (f: faces; T_f that of the cell from
which the liquid comes; beyond the sides T_in, beyond a groove what is mixed there):

    rho c_p sum_f q_f T_f = dissipation - H area (T - T_wall)

Dissipation is what the wall drags, mu U^2/h times the liquid's share, and what pressure drives through the faces, q_P dp. Its
sum is the power that goes in, drag U plus the pumping at the sides, because liquid is conserved; the sum of the equations is
the heat that goes out. Both are told, and their difference is in the certificate. In the cavity the liquid carries heat.

Where a cavity ends, the wall drags liquid out of a cell that is partly full, and pressure drives some of it back through the
same face: heat goes both ways there, not with the net flow alone, which may be nothing. Cells without oil have no temperature.

In time cells hold heat, rho c_p d/dt [area h (1 - r) T] by the step's formula (`stored`) and the film's own contents, and what
walls that approach do to the film goes in too. What is in minus what is out is stored.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from petsc4py import PETSc

from ...base.parallel import Array
from .assembly import assemble
from .cavity import cavity_sign
from .contact import areas
from .effects import Answer, around, framed_by
from .flows import point_weights, sheared_faces, volume_unit
from .forces import open_pressures
from .reynolds import sides
from .strip import line_weights

RTOL = 1e-13  # of the linear solves
NOTHING = 1e-18  # of what pressures could turn into heat: the square of what a solve may leave of them
LEVEL = 1e-15  # of the largest pressure: a drop by less is rounding where no wall moves
STILL = 1e-11  # of the largest flow out of a cell: what is less is rounding
EMPTY = 1e-9  # of a cell's liquid: less is rounding
SAME = 1e-300  # what stands for 0 in a quotient


@dataclass(frozen=True)
class Carried:
    """Flows and heat of an answer; arrays of shape grid.box, W (1D: W/m) and m3/s (1D: m2/s).

    q : out of a cell's west, east, south and north face. free : cells whose temperature is unknown (the others lie in grooves).
    dissipation : of each cell; sheared : the part of it that the wall drags.
    power : what drag and pumps put in, as the film's own numbers have it.
    area : of the cells, m2 (1D: m).
    turns : through the west and east face both ways: what the wall drags out of a part of a cell that is full, and pressure
        drives back into it, m3/s.
    held, kept : of a time step: liquid of a cell over the step's length, m3/s, and what it held before times T, K m3/s.
    """

    q: tuple[Array, Array, Array, Array]
    free: Any
    dissipation: Array
    power: float
    area: Array
    sheared: Array
    turns: tuple[Array, Array]
    held: Array
    kept: Array

    @property
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


def carried(at: Answer) -> Carried:
    """Flows, dissipation and power of an answer. Collective."""
    problem, grid = at.problem, at.grid
    s: Any = problem.scheme
    box, dy = grid.box, grid.spacing[1] if grid.dim == 2 else 1.0
    unit = volume_unit(problem)
    held = holders(at)
    free = ~np.logical_or.reduce(held).reshape(box) if held else np.ones(box, dtype=bool)
    p, r = at.p.reshape(box), at.r.reshape(box)
    beside = around(framed_by(grid, at.p, problem.p_sides))
    k = [unit * a / problem.p_unit for a in (s.k_W, s.k_E, s.k_S, s.k_N)]
    flat = 0.0 if problem.U else LEVEL * problem.reduce.max(np.abs(p))
    pushed = [np.where(np.abs(p - b) > flat, a * (p - b), 0.0) for a, b in zip(k, beside, strict=True)]  # out of the cell
    void_W = grid.ghosted(at.r, outside=0.0)[1:-1, :-2]
    dragged = [-unit * (s.couette_W - s.b_W * void_W), unit * (s.couette_E + s.b_E * r)]
    q = (pushed[0] + dragged[0], pushed[1] + dragged[1], pushed[2], pushed[3])

    other_free = [a > 0.5 for a in _inside(at, free)]
    front = free & ((r > 0.0) | (void_W > 0.0))
    back = np.minimum(dragged[1], -pushed[1]) - np.maximum(pushed[0], 0.0)
    turn = np.where(front, np.maximum(back, 0.0), 0.0)
    turns = (grid.ghosted(turn.ravel(), outside=0.0)[1:-1, :-2], turn)
    heat = np.zeros(box)
    for flow, near, is_free in zip(pushed, beside, other_free, strict=True):
        heat += np.where(is_free, 0.5, 1.0) * flow * (p - near)
    # Where the end is closed or a mirror nothing beyond takes its half, and nothing flows.
    shear, drag = _shear(at, dy, other_free)
    sheared = np.where(free, shear, 0.0)
    if problem.contact is not None:
        carrying = problem.contact.p_a.reshape(box) * areas(problem) * grid.stretch(grid.y)
        shear = shear + abs(problem.U) * problem.contact.friction * carrying
    power_shear = float(problem.reduce.sum(np.where(free, shear, 0.0)))
    pressures = problem.reduce.sum(np.sum(k, axis=0)) * problem.reduce.max(np.abs(at.p)) ** 2  # what they could turn into heat
    if not problem.U and not problem.reduce.sum(np.abs(heat)) > NOTHING * pressures:
        heat = np.zeros(box)  # rounding
    push = float(problem.reduce.sum(np.where(free, drag * (beside[1] - p), 0.0)))
    west, *_ = sides(grid)
    first_west = (west | ~other_free[0]) & free
    push += float(problem.reduce.sum(np.where(first_west, -dragged[0] * (p - beside[0]), 0.0)))
    # No oil is lost: the pumps' work may be counted from any level of pressure, best from one that is among theirs.
    pumped, least = 0.0, min((a for a in open_pressures(problem) if a is not None), default=0.0)
    for flow, near, is_free in zip(q, beside, other_free, strict=True):
        pumped -= float(problem.reduce.sum(np.where(free & ~is_free, flow * (near - least), 0.0)))
    area = grid.cell * point_weights(grid).reshape(box)
    stays = was = np.zeros(box)
    if problem.stored is not None:
        stays = np.where(free, unit * s.storage * (1.0 - r), 0.0)
        pumped -= float(problem.reduce.sum(np.where(free, p - least, 0.0) * (stays - unit * s.kept)))
        was = np.where(free, area * problem.stored.on(grid, problem.stored.carried), 0.0)
    return Carried(q, free, np.where(free, heat + shear, 0.0), power_shear + push + pumped, area, sheared, turns, stays, was)


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
    shear = np.zeros(box)
    for mu, h, share, is_free, wall, dx in (
        (mu_west, faces[0], liquid_west, other_free[0], closed[0], before),
        (mu_east, faces[1], liquid, other_free[1], closed[1], behind),
    ):
        inner = np.where(is_free, 0.5, 1.0) * (h[0] + share / h[1])
        at_wall = 0.5 * np.where(full, 4.0, 1.0 - r) / s.h
        shear = shear + dx * mu * np.where(wall, at_wall, inner)
    return rows * shear, volume_unit(problem) * (s.couette_E + s.b_E * r)


@dataclass(frozen=True)
class Heated:
    """Temperatures above T_in at the points (K; in grooves those of their oil), and where the heat goes.

    out : all that leaves, W. residual : relative, of the equations. stored : what stays in the film in a time step, W.
    """

    theta: Array
    out: float
    residual: float
    stored: float = 0.0


def heated(
    at: Answer,
    flow: Carried,
    rho_c: float,
    exchange: float,
    wall: float,
    carry_over: float | None,
    falls: Array | float = 0.0,
    more: Array | float = 0.0,
) -> Heated:
    """The averaged energy equation, solved. Collective.

    Parameters
    ----------
    rho_c : J/(m3 K). exchange : with the walls, W/(m2 K), at T - T_in = wall. carry_over : share of the oil arriving at a
        groove (or at the east side, for the west one) that goes on; the rest leaves, fresh oil at T_in takes its place. None:
        all of it at grooves, nothing at sides.
    falls, more : of a step of Newton's method: cells turn `more - falls (T - T_in)` into heat beside the dissipation, W.
    """
    grid, reduce, free = at.grid, at.problem.reduce, flow.free
    leaves, enters = flow.both_ways
    inside = _inside(at, free)
    H, falls = exchange * flow.area, np.where(free, falls, 0.0)
    diagonal = np.where(free, rho_c * (sum(leaves) + flow.held) + H, 0.0)  # type: ignore[operator]
    still = diagonal <= STILL * reduce.max(diagonal)  # grooves, and cells whose liquid does not go on
    dry = free & (at.r > 1.0 - EMPTY).reshape(grid.box) & (H <= 0.0)  # behind a closed side, say: no oil, no temperature
    still |= dry
    diagonal = np.where(still, 1.0, diagonal + falls)
    offsets = ((0, -1), (0, 1), (-1, 0), (1, 0))
    entries = [(0, 0, diagonal)]
    for (dj, di), a, near in list(zip(offsets, enters, inside, strict=True))[: 2 * grid.dim]:
        entries.append((dj, di, np.where(still, 0.0, -rho_c * a * near)))
    solver = reduce.through(transport := _Transport(assemble(grid, entries)))
    heat = np.where(still, 0.0, flow.dissipation + np.where(free, more, 0.0) + H * wall + rho_c * flow.kept).ravel()
    left = reduce.sum(np.where(free & still & ~dry, np.maximum(flow.dissipation, 0.0), 0.0))
    nowhere = left > STILL * reduce.sum(np.abs(flow.dissipation))  # heat that no liquid carries away
    try:
        theta, residual = solver(heat)
        theta = np.full_like(theta, np.inf) if nowhere else theta
        mixers = _mixers(at, flow, carry_over)
        if mixers:
            responses = [solver(rho_c * (into * free).ravel())[0] for _, into, _ in mixers]
            hot = [lambda T, a=away: reduce.sum(a.ravel() * T) / max(reduce.sum(a), SAME) for away, _, _ in mixers]
            share = np.array([one[2] for one in mixers])
            start = share * [find(theta) for find in hot]
            M = share[:, None] * np.array([[find(response) for response in responses] for find in hot])
            try:
                mixed = np.linalg.solve(np.eye(len(mixers)) - M, start)
            except np.linalg.LinAlgError:
                mixed = np.full(len(mixers), np.inf)
            with np.errstate(invalid="ignore"):
                theta = theta + sum(T * response for T, response in zip(mixed, responses, strict=True))
        else:
            mixed = np.zeros(0)
    finally:
        transport.destroy()
    T = theta.reshape(grid.box)
    edge = _over_edge(flow, inside)
    on = [float(back) * reduce.sum(into) for (_, into, _), back in zip(mixers, mixed, strict=True)]  # goes on with the oil
    out = rho_c * (reduce.sum(edge * T) - sum(on)) + reduce.sum(np.where(free, H * (T - wall), 0.0))
    for columns, back in zip(holders(at), mixed, strict=False):
        theta = np.where(columns, back, theta)
    return Heated(theta, float(out), residual, float(rho_c * reduce.sum(flow.held * T - flow.kept)))


def _mixers(at: Answer, flow: Carried, carry_over: float | None) -> list[tuple[Array, Array, float]]:
    """For each place where oil is mixed: what flows to it and from it at the cells (m3/s), and T(from)/T(to). Collective."""
    grid, reduce, free, found = at.grid, at.problem.reduce, flow.free, []
    grooves = holders(at)
    if grooves:
        share = 1.0 if carry_over is None else carry_over
        for columns in grooves:
            near = around(framed_by(grid, columns.astype(float), (0.0,) * 4))
            found.append((*_to_and_from(flow, [free & (a > 0.5) for a in near]), share))
    elif carry_over:
        found.append((*_to_and_from(flow, sides(grid)[:2]), carry_over))
    out = []
    for away, into, share in found:
        arriving, going = reduce.sum(away), reduce.sum(into)
        out.append((away, into, min(share * arriving / going, 1.0) if going > 0 else 0.0))
    return out


def fresh_flow(at: Answer, flow: Carried, carry_over: float | None) -> float:
    """Oil that enters at T_in and leaves again, m3/s (1D: m2/s). Collective."""
    reduce = at.problem.reduce
    mixers = _mixers(at, flow, carry_over)
    away = reduce.sum(_over_edge(flow, _inside(at, flow.free)))
    return float(away - sum(share * reduce.sum(into) for _, into, share in mixers))


def _inside(at: Answer, free: Any) -> list[Any]:
    """1 where the neighbour (west, east, south, north) is a cell whose temperature is unknown, else 0. Collective."""
    return [np.where(a > 0.5, 1.0, 0.0) for a in around(framed_by(at.grid, free.astype(float), (0.0,) * 4))]


def _over_edge(flow: Carried, inside: list[Any]) -> Array:
    """What leaves each cell over the edge of the film, m3/s."""
    return _to_and_from(flow, [flow.free & (near < 0.5) for near in inside])[0]


def _to_and_from(flow: Carried, faces: Sequence[Any]) -> tuple[Array, Array]:
    """What leaves and enters each cell through some of its faces, which are told west, east, south, north, m3/s."""
    sums = (sum(np.where(face, a, 0.0) for face, a in zip(faces, way, strict=False)) for way in flow.both_ways)
    away, into = sums
    return away, into  # type: ignore[return-value]


class _Transport:
    """The upwind matrix and its inner solver: incomplete factors follow the flow, so that few steps do."""

    def __init__(self, mat: PETSc.Mat):
        self.mat = mat
        self.ksp = PETSc.KSP().create(mat.comm)
        self.ksp.setOptionsPrefix("energy_")
        self.ksp.setOperators(mat)
        self.ksp.setType("gmres")
        self.ksp.setTolerances(rtol=RTOL, atol=0.0, max_it=2000)
        self.ksp.setGMRESRestart(60)
        pc = self.ksp.getPC()
        pc.setType("ilu" if mat.comm.getSize() == 1 else "bjacobi")
        self.ksp.setFromOptions()

    def __call__(self, heat: Array, transposed: bool = False) -> tuple[Array, float]:
        """The solution, and its residual in parts of the right-hand side; transposed : that up the flow. Collective."""
        x, b = self.mat.createVecs()
        b.setArray(heat)
        size = b.norm()
        (self.ksp.solveTranspose if transposed else self.ksp.solve)(b, x)
        values = x.array_r.copy()
        b.aypx(-1.0, self.mat * x)
        residual = b.norm() / size if size > 0 else 0.0
        for obj in (x, b):
            obj.destroy()
        return values, float(residual)

    def destroy(self) -> None:
        self.ksp.destroy()
        self.mat.destroy()
