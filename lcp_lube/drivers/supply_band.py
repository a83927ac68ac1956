"""The guaranteed band of a film whose supplies' pressures follow from flows and restrictors (docs/guaranteed_bounds.md).

The pressure P_s of a supply's cells joins the film's z as one unknown, and its flow balance H_s = Q_s(z, P) - R_s(P_s) joins G:
what the supply gives to the film less what its source gives at that pressure. H_s falls with every z and every other P, and
grows with P_s; so G and H together are inverse isotone as G alone is, and signs of both at two points are the proof.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from ..base.parallel import Array
from ..linear.krylov import LinearSolverError
from ..problems.film.flows import volume_unit
from ..problems.film.lubrication import LubricationProblem
from ..problems.film.supplies import Supply
from ..problems.solution import Enclosure, Fields
from ..solvers.enclosure import RESERVE, UNIT, Band, concluded, conditions
from .motions.linearised import Feed, Linear

WIDER, TRIES = 2.0, 12  # bands of the pressures are widened so much, so often, until their signs are shown
ROOM = 1.5  # times what the balances need by the linear film
SUMMED = 32  # roundings that a term of a balance passes beside those of the sum over the supply's cells


def enclose_fed(problem: LubricationProblem, fields: Fields) -> Enclosure:
    """A band around p and r that provably contains the discrete solution with its supplies' pressures, or why not. Collective.

    It costs one linear solve, and one more for each supply whose pressure follows.
    """
    held: Any = problem.held
    if broken := conditions(problem):
        return Enclosure(False, f"no band: {broken}")
    P, free = np.array([one.p for one in held.supplies]), np.array([one.open for one in held.supplies])
    start = _at(problem, P)
    band = Band(problem, {"p": np.where(np.isnan(start), fields["p"], start), "r": np.where(np.isnan(start), fields["r"], 0.0)})
    inside = held.mask.ravel()
    full = (band.z >= 0) | inside
    linear, feed = Linear(problem, ~full), Feed(problem, ~full, free)
    try:
        w = np.where(inside, 0.0, np.abs(band.G) + band.slack)
        w += np.where(inside, 0.0, RESERVE * problem.reduce.norm(w) / np.sqrt(problem.size))
        answers = linear.solve([w, *(feed.pushed(t) for t in feed.free)])
        slopes = feed.slopes(answers[1:])
    except LinearSolverError as error:
        return Enclosure(False, f"no band: {error}")
    finally:
        linear.destroy()
        feed.destroy()
    width, *pushed = (np.maximum(np.where(full, x, x / band.form.s), 0.0) for x in answers)
    off = np.zeros(free.size)
    for sign in (-1.0, 1.0):  # what supplies lack if the film's own band is added, and rounding
        z = np.where(inside, band.z, band.z + sign * width)
        off = np.maximum(off, _lacking(problem, band.form.fields(z), P, sign))
    by = np.array([_falls(one) for one in held.supplies])
    e_P = np.zeros(free.size)
    e_P[free] = ROOM * np.abs(np.linalg.solve(slopes + np.diag(by[free]), off[free])) + 16 * UNIT * P[free]

    def side(sign: float, e_P: Array) -> Fields | None:
        """The fields on one side of the answer if all balances have that sign there, None if it cannot be shown."""
        for _ in range(TRIES):
            beside = P + sign * e_P
            if not (np.isfinite(beside).all() and beside.min() >= 0.0):
                return None
            e = width + sum((part * by for part, by in zip(e_P[free], pushed, strict=True)), np.zeros_like(width))
            pair = band.prove(e, sign, _at(problem, beside))
            lacks = np.ones(P.size) if pair is None else _lacking(problem, pair, beside, sign)
            if pair is not None and not (lacks[free] > 0.0).any():
                return pair
            e_P = np.where(free & (lacks > 0.0), WIDER, 1.0) * e_P
        return None

    return concluded(problem, fields, side(-1.0, e_P), side(1.0, e_P))


def _at(problem: Any, P: Array) -> Array:
    """Pressures (Pa) of supplies at their cells, in the problem's unit, NaN elsewhere: one number a supply."""
    return np.append(P / problem.p_unit, np.nan)[problem.held.owner].ravel()


def _lacking(problem: Any, fields: Fields, P: Array, sign: float) -> Array:
    """By how much sign H_s, less the rounding in it, falls short of zero, m3/s. Collective.

    Each term of Q_s passes at most N + SUMMED roundings, N the supply's cells.
    """
    grid, s, held, unit = problem.grid, problem.scheme, problem.held, volume_unit(problem)
    p, r = fields["p"], fields["r"]
    Q = problem.face_flows(p, r).reshape(grid.box)
    sides = max((side / problem.p_unit for side in problem.p_sides), default=0.0)
    around = grid.ghosted(p, outside=sides)
    moduli = s.diagonal * p.reshape(grid.box) + s.k_W * around[1:-1, :-2] + s.k_E * around[1:-1, 2:]
    if grid.dim == 2:
        moduli = moduli + s.k_S * around[:-2, 1:-1] + s.k_N * around[2:, 1:-1]
    moduli = moduli + np.abs(s.couette_W) + np.abs(s.couette_E) + s.b_W * grid.ghosted(r, outside=0.0)[1:-1, :-2]
    lacking = np.zeros(P.size)
    for k, one in enumerate(held.supplies):
        if not one.open:
            continue
        mine = held.owner == k
        total, size, cells = (problem.reduce.sum(np.where(mine, a, 0.0)) for a in (Q, moduli, np.ones_like(Q)))
        rounding = (cells + SUMMED) * UNIT * unit * size * (1 + 1e-6)
        R = _source(one, float(P[k]), -sign)
        lacking[k] = rounding + 4 * UNIT * (abs(unit * total) + abs(R)) - sign * (unit * total - R)
    return lacking


def _falls(one: Supply) -> float:
    """-dR/dp, m3/s/Pa: a guess, of which the proof knows nothing."""
    if one.law == "orifice":
        return 0.5 * one.K / abs(one.p_s - one.p) ** 0.5 if one.p != one.p_s else 0.0
    return one.K if one.law else 0.0


def _source(one: Supply, p: float, sign: float) -> float:
    """What the source gives at the pressure p, its rounding added with this sign: R(p) lies on the other side."""
    if one.flow is not None:
        return one.flow
    moved = replace(one, p_s=one.p_s + sign * 8 * UNIT * (abs(one.p_s) + abs(p)))
    flow = moved.given(p)
    return flow + sign * 8 * UNIT * abs(flow)
