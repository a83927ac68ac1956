"""Stiffness and damping of a film against rigid motions of its walls, by exact linearisation (see `coefficients`)."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.parallel import Array
from ..problems.film.cavity import cavity_sign
from ..problems.film.flows import point_weights
from ..problems.film.lubrication import LubricationProblem
from ..problems.film.model import Model
from ..problems.film.supplies import supply_flows
from ..problems.film.turning import Turning
from ..problems.solution import Fields
from .linearised import Feed, Linear

STEP = 0.125  # of the thinnest film: G is a cubic in a motion, which four values give exactly whatever the step
Mode = Callable[[Array, Array], Array]  # dh of a rigid motion of a wall, by its coordinate, of x and y (m)


@dataclass(frozen=True)
class Bent:
    """A film and e times a motion of its wall."""

    film: Any
    mode: Mode
    e: float

    def __call__(self, x: ArrayLike, y: ArrayLike | None = None, /) -> Array:
        at, along = np.asarray(x, dtype=float), np.asarray(0.0 if y is None else y, dtype=float)
        return self.film(x, y) + self.e * self.mode(at, along)

    def jumps(self, axis: str) -> tuple[float, ...]:
        """Where the film jumps, as it does without the motion."""
        return getattr(self.film, "jumps", lambda axis: ())(axis)


def displacements(turning: Turning, first: float) -> list[Mode]:
    """dh of a displacement of the journal along the load and a quarter of a turn ahead; first : x of the ring at x = 0, m."""

    def towards(angle: float) -> Mode:
        return lambda x, y: -np.cos(turning.theta(x + first) - angle) + 0.0 * y

    return [towards(0.0), towards(0.5 * math.pi)]


def impedance(
    problem: LubricationProblem, model: Model, fields: Fields, modes: Sequence[Mode], frequencies: Sequence[float]
) -> Any:
    """-d(integral of p g_i)/de_j of one film for motions exp(i nu t) of its modes g, i.e. K + i nu C. Collective.

    Returns an array of shape (frequencies, modes, modes); at nu = 0 (the limit of slow motion) it is K + i C.
    """
    grid, p, r = problem.grid, fields["p"], fields["r"]
    cavity = cavity_sign(problem.reduce, p, r) < 0
    size, h = point_weights(grid), problem.scheme.h.ravel()
    storage = 2.0 * grid.spacing[0] * size * h / problem.scheme.flow_unit
    M = np.where(cavity, storage, 0.0)
    shift = STEP * problem.reduce.min(problem.scheme.h)
    # Of z' in the force: cavitated cells have no p'.
    weight = grid.cell * size * problem.p_unit * np.where(cavity, 0.0, 1.0)
    changes = [np.broadcast_to(mode(grid.x, grid.y), grid.box).ravel() for mode in modes]
    out = np.zeros((len(frequencies), len(modes), len(modes)), dtype=complex)
    solver, held = Linear(problem, cavity), problem.held
    free = [one.open for one in held.supplies] if held is not None else []
    feed = Feed(problem, cavity, free) if any(free) else None
    taken = supply_flows(problem, p, r)
    sources = np.array([one.misfit(one.p, q)[1:] for one, q in zip(held.supplies if held else (), taken, strict=True)])
    answers: dict[float, list[Any]] = {}

    def settled(z: Any, raw: Any, nu: float) -> Any:
        """z with the change of the pressures that follow."""
        if feed is None:
            return z
        if nu not in answers:
            pushed, none = [feed.pushed(t) for t in feed.free], np.zeros_like(h)
            answers[nu] = [solver.at(nu, M, b, none) if nu else solver.solve(b) for b in pushed]
        return feed.corrected(z, raw, answers[nu], sources)

    try:
        for column, (mode, change) in enumerate(zip(modes, changes, strict=True)):
            steepest = problem.reduce.max(np.abs(change)) or 1.0
            dG, d_raw = _derivative(problem, model, Bent(model.gap, mode, 0.0), shift / steepest, p, r)
            S = storage / h * (1.0 - r) * change
            swept = S if held is None else np.where(held.mask.ravel(), 0.0, S)
            z0 = settled(solver.solve(-dG), d_raw, 0.0)
            for k, nu in enumerate(frequencies):
                if nu:
                    found = settled(solver.at(nu, M, -dG, -nu * swept), d_raw + 1j * nu * S, nu)
                else:
                    found = z0 + 1j * settled(solver.solve(-(swept + M * z0)), S, 0.0)
                out[k, :, column] = [-_dot(problem, weight * row, found) for row in changes]
    finally:
        solver.destroy()
        if feed is not None:
            feed.destroy()
    return out


def _dot(problem: LubricationProblem, row: Array, z: Any) -> complex:
    return complex(problem.reduce.dot(row, z.real), problem.reduce.dot(row, z.imag))


def _derivative(problem: LubricationProblem, model: Model, moved: Bent, step: float, p: Array, r: Array) -> tuple[Array, Array]:
    """dG/de at fixed fields, and that of the cells' own balances, were none held: exact, as G is a cubic in e (conductances in
    h^3, Couette terms in h). Collective."""
    values = []
    for size in (-2.0, -1.0, 1.0, 2.0):
        gap, places = replace(moved, e=size * step), problem.grid.places
        other = replace(model, gap=gap, exact=None, places=places).build(problem.grid.shape, problem.grid.dm.comm)  # type: ignore[arg-type]
        balance = other.flow(p, r)
        values.append(np.stack([balance, balance if other.held is None else other.face_flows(p, r)]))
        other.destroy()
    a, b, c, d = values
    dG, raw = (8.0 * (c - b) - (d - a)) / (12.0 * step)
    return dG, raw
