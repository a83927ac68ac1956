"""Heat in a film: where it arises, how the liquid carries it, what leaves. Temperatures are means across the film.

Cell by cell, with the volume flows q of the box scheme through the faces of a cell, upwind (f: faces; T_f that of the cell from
which the liquid comes; beyond the sides T_in, beyond a groove what is mixed there):

    rho c_p sum_f q_f T_f = dissipation - H area (T - T_wall)

Dissipation is what the wall drags, mu U^2/h times the liquid's share, and what pressure drives through the faces, q_P dp. Its
sum is the power that goes in, drag U plus the pumping at the sides, because liquid is conserved; the sum of the equations is
the heat that goes out. Both are told, and their difference is in the certificate. In the cavity the liquid carries heat.

Where a cavity ends, the wall drags liquid out of a cell that is partly full, and pressure drives some of it back through the
same face: heat goes both ways there, not with the net flow alone, which may be nothing, as far as cells are empty (what came
all at once with the first void would leave films without an answer). Cells without oil have no temperature.

In time cells hold heat, rho c_p d/dt [area h (1 - r) T] by the step's formula (`stored`) and the film's own contents, and what
walls that approach do to the film goes in too. What is in minus what is out is stored.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base.parallel import Array
from .assembly import assemble
from .carried import STILL, Carried, holders
from .effects import Answer, around, framed_by
from .reynolds import sides
from .transport import Transport

EMPTY = 1e-9  # of a cell's liquid: less is rounding
SAME = 1e-300  # what stands for 0 in a quotient


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
    H, falls = exchange * flow.area, np.where(free, falls, 0.0)
    # What enters leaves, but for what a solve leaves of that: as heat it would count once for each turn that oil takes.
    through = sum(enters) if at.problem.stored is None else sum(leaves) + flow.held
    diagonal = np.where(free, rho_c * through + H, 0.0)
    still = diagonal <= STILL * reduce.max(diagonal)  # grooves, and cells whose liquid does not go on
    dry = free & (at.r > 1.0 - EMPTY).reshape(grid.box) & (H <= 0.0)  # behind a closed side, say: no oil, no temperature
    still |= dry
    diagonal = np.where(still, 1.0, diagonal + falls)
    offsets = ((0, -1), (0, 1), (-1, 0), (1, 0))
    entries = [(0, 0, diagonal)]
    for (dj, di), a, near in list(zip(offsets, enters, flow.inside, strict=True))[: 2 * grid.dim]:
        entries.append((dj, di, np.where(still, 0.0, -rho_c * a * near)))
    cut = grid.shape[0] - 1 if grid.periodic[0] else 0
    solver = reduce.through(transport := Transport(assemble(grid, entries), at.lasting, cut))
    heat = np.where(still, 0.0, flow.dissipation + np.where(free, more, 0.0) + H * wall + rho_c * flow.kept).ravel()
    arises = np.abs(flow.sheared if at.problem.U else flow.dissipation)  # by a wall everywhere, however thin the oil gets
    nowhere = reduce.sum(np.where(free & still & ~dry, arises, 0.0)) > STILL * reduce.sum(arises)  # no liquid carries it away
    try:
        theta, residual = solver(heat)
        theta = np.full_like(theta, np.inf) if nowhere else theta
        mixers = _mixers(at, flow, carry_over)
        theta, mixed = _mixed(at, theta, mixers, lambda into: solver(rho_c * (into * free).ravel())[0])
    finally:
        transport.destroy()
    T = theta.reshape(grid.box)
    edge = _over_edge(flow)
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
        goes_on = share * (arriving if arriving > flow.rounding else 0.0)
        out.append((away, into, goes_on / max(goes_on, going, SAME)))  # all where nothing leaves, but for rounding
    return out


def _mixed(
    at: Answer, theta: Array, mixers: list[tuple[Array, Array, float]], response: Callable[[Array], Array]
) -> tuple[Array, Array]:
    """Temperatures with what mixers send on, and the oil's in each of these; theta : where all of that is at T_in.

    response : temperatures by oil that flows to the cells so and is 1 K warmer. Collective.
    """
    if not mixers:
        return theta, np.zeros(0)
    reduce = at.problem.reduce
    responses = [response(into) for _, into, _ in mixers]
    hot = [lambda T, a=away: reduce.sum(a.ravel() * T) / max(reduce.sum(a), SAME) for away, _, _ in mixers]
    share = np.array([one[2] for one in mixers])
    start = share * [find(theta) for find in hot]
    M = share[:, None] * np.array([[find(one) for one in responses] for find in hot])
    try:
        mixed = np.linalg.solve(np.eye(len(mixers)) - M, start)
    except np.linalg.LinAlgError:
        mixed = np.full(len(mixers), np.inf)
    with np.errstate(invalid="ignore"):
        return theta + sum(T * one for T, one in zip(mixed, responses, strict=True)), mixed


def fresh_flow(at: Answer, flow: Carried, carry_over: float | None) -> float:
    """Oil that enters at T_in and leaves again, m3/s (1D: m2/s). Collective."""
    reduce = at.problem.reduce
    mixers = _mixers(at, flow, carry_over)
    away = reduce.sum(_over_edge(flow))
    fresh = float(away - sum(share * reduce.sum(into) for _, into, share in mixers))
    return fresh if abs(fresh) > flow.rounding else 0.0


def _over_edge(flow: Carried) -> Array:
    """What leaves each cell over the edge of the film, m3/s."""
    return _to_and_from(flow, [flow.free & ~near for near in flow.inside])[0]


def _to_and_from(flow: Carried, faces: Sequence[Any]) -> tuple[Array, Array]:
    """What leaves and enters each cell through some of its faces, which are told west, east, south, north, m3/s."""
    away, into = (sum(np.where(face, a, 0.0) for face, a in zip(faces, way, strict=False)) for way in flow.both_ways)
    return away, into  # type: ignore[return-value]
