"""Stiffness and damping of a journal's film, by exact linearisation of the mass-conserving equations.

In the film h(x, y, t) a cell's balance is A(h) p + B(h) r - c(h) + 2 dx d/dt[h (1 - r)] = 0. Let z be p in the full film and -r
in the cavity, J the matrix of the steady problem at its solution, and e exp(i nu t) a small displacement of the journal. At the
signs of z

    (J + i nu M) z' = -dG/de - i nu S,     M = 2 dx h in the cavity, 0 in the full film,     S = 2 dx (1 - r) dh/de,

with G = A p + B r - c, and K + i nu C = -d(force)/de comes from p'. M is the void that is stored and carried: it makes Cxy and
Cyx differ where film forms again inside. At nu = 0 these are two solves with one matrix: J z0' = -dG/de, J z1' = -(S + M z0').
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.parallel import Array
from ..errors import InputError
from ..problems.film.cavity import cavity_sign
from ..problems.film.flows import point_weights
from ..problems.film.lubrication import LubricationProblem
from ..problems.film.model import Model
from ..problems.film.supplies import supply_flows
from ..problems.film.turning import Turning
from ..problems.solution import Fields, Solution
from ..scenes.effects.table import without
from ..scenes.scene import Scene
from .grooves import pad_films, pick_pad
from .linearised import Feed, Linear

STEP = 0.125  # of the thinnest film: G is a cubic in the displacement, which four values give exactly whatever the step


@dataclass(frozen=True)
class Coefficients:
    """K (N/m) and C (N s/m) at one frequency (rad/s), shape (2, 2), x along the load and y a quarter of a turn ahead.

    In 1D per metre of width.
    """

    frequency: float
    K: Array
    C: Array


@dataclass(frozen=True)
class Displaced:
    """A film with the journal displaced by e (m) in the direction `angle`, rad from the line of the load."""

    film: Any
    turning: Turning
    angle: float
    e: float
    first: float  # x of the ring where this film's x is 0, m

    def change(self, x: ArrayLike) -> Array:
        """dh/de."""
        return -np.cos(self.turning.theta(np.asarray(x, dtype=float) + self.first) - self.angle)

    def __call__(self, x: ArrayLike, y: ArrayLike | None = None, /) -> Array:
        return self.film(x, y) + self.e * self.change(x)

    def jumps(self, axis: str) -> tuple[float, ...]:
        """Where the film jumps, as it does without the displacement."""
        return getattr(self.film, "jumps", lambda axis: ())(axis)


def coefficients(scene: Scene, solution: Solution, frequencies: Sequence[float] = (0.0,)) -> list[Coefficients]:
    """K and C of a converged solution of a journal. Collective.

    Parameters
    ----------
    scene : the scene at which the solution was found; it has `turning`, which says where the film lies around the journal.
    frequencies : of the motion, rad/s, >= 0; 0: the limit of slow motion.

    Raises
    ------
    InputError : a scene without a journal, a fluid that depends on the pressure, a frequency below zero.
    """
    scene = placed(scene, solution)
    turning = getattr(scene, "turning", None)
    if turning is None:
        raise InputError(f"scene {scene.name}: coefficients are of journals; it has no part that could be displaced")
    model: Model = scene.model  # type: ignore[attr-defined]
    if supplies := solution.settings.get("supply_pressures"):
        model = replace(model, supplies=tuple(replace(one, p=p) for one, p in zip(model.supplies, supplies, strict=True)))
    if model.law is not None or model.effects:
        raise InputError(f"scene {scene.name}: coefficients are of fluids with constant viscosity and density")
    for nu in frequencies:
        if not (math.isfinite(nu) and nu >= 0):
            raise InputError(f"--frequency {nu:g}: a number of at least 0 rad/s is needed")
    ring = solution.problem
    total = np.zeros((len(frequencies), 2, 2), dtype=complex)
    if model.grooves:
        dx = model.lengths[0] / scene.shape[0]
        for pad, film in pad_films(scene):
            problem = film.build(ring.grid.dm.comm)
            take = pick_pad(ring.grid, problem.grid, pad.first)
            fields = {name: take(values) for name, values in solution.fields.items()}
            total += _of_film(problem, film.model, fields, turning, (pad.first - 0.5) * dx, frequencies)
            problem.destroy()
    else:
        assert isinstance(ring, LubricationProblem)  # as a scene with `turning` has
        total += _of_film(ring, model, solution.fields, turning, 0.0, frequencies)
    fx, fy = turning.force(ring, solution.fields["p"])
    along = math.atan2(-fy, -fx)  # the load, from where theta is counted
    turn = np.array([[math.cos(along), -math.sin(along)], [math.sin(along), math.cos(along)]])
    total = turn.T @ total @ turn
    return [
        Coefficients(nu, found.real, found.imag / nu if nu > 0 else found.imag)
        for nu, found in zip(frequencies, total, strict=True)
    ]


def placed(scene: Scene, solution: Solution) -> Scene:
    """The scene with the journal where the solution found it, without the effects that were left out."""
    if gone := solution.settings.get("model", {}).get("left_out"):
        scene = without(scene, gone)
    found = {"attitude_deg": solution.settings["attitude_deg"]} if "attitude_deg" in solution.settings else {}
    if balance := solution.settings.get("balance"):
        found |= {balance["vary"]: balance["value"]}
    return scene.model_copy(update={**found, "balance": None}) if found else scene


def _of_film(
    problem: LubricationProblem,
    model: Model,
    fields: Fields,
    turning: Turning,
    first: float,
    frequencies: Sequence[float],
) -> Any:
    """K + i nu C of one film (at nu = 0: K + i C), shape (frequencies, 2, 2). Collective."""
    grid, p, r = problem.grid, fields["p"], fields["r"]
    cavity = cavity_sign(problem.reduce, p, r) < 0
    x = grid.x
    theta = np.broadcast_to(turning.theta(x + first), grid.box).ravel()
    size = point_weights(grid)
    storage = 2.0 * grid.spacing[0] * size * problem.scheme.h.ravel()
    M = np.where(cavity, storage, 0.0)
    shift = STEP * problem.reduce.min(problem.scheme.h)
    h = problem.scheme.h.ravel()
    weight = -grid.cell * size * problem.p_unit * np.where(cavity, 0.0, 1.0)  # of z' in the force: cavitated cells have no p'
    sides = np.stack([weight * np.cos(theta), weight * np.sin(theta)])
    out = np.zeros((len(frequencies), 2, 2), dtype=complex)
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
        for column, angle in enumerate((0.0, 0.5 * math.pi)):
            moved = Displaced(model.gap, turning, angle, 0.0, first)
            dG, d_raw = _derivative(problem, model, moved, shift, p, r)
            change = np.broadcast_to(moved.change(x), grid.box).ravel()
            S = storage / h * (1.0 - r) * change
            swept = S if held is None else np.where(held.mask.ravel(), 0.0, S)
            z0 = settled(solver.solve(-dG), d_raw, 0.0)
            for k, nu in enumerate(frequencies):
                if nu:
                    found = settled(solver.at(nu, M, -dG, -nu * swept), d_raw + 1j * nu * S, nu)
                else:
                    found = z0 + 1j * settled(solver.solve(-(swept + M * z0)), S, 0.0)
                out[k, :, column] = [-_dot(problem, row, found) for row in sides]
    finally:
        solver.destroy()
        if feed is not None:
            feed.destroy()
    return out


def _dot(problem: LubricationProblem, row: Array, z: Any) -> complex:
    return complex(problem.reduce.dot(row, z.real), problem.reduce.dot(row, z.imag))


def _derivative(
    problem: LubricationProblem, model: Model, moved: Displaced, step: float, p: Array, r: Array
) -> tuple[Array, Array]:
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


def stability(K: Array, C: Array) -> tuple[float | None, float | None]:
    """Whirl ratio and threshold ws = omega sqrt(c/g) of a rigid rotor, from K c/W and C c omega/W; None where it is stable.

    ke = (Kxx Cyy + Kyy Cxx - Kxy Cyx - Kyx Cxy)/(Cxx + Cyy), whirl^2 = ((ke - Kxx)(ke - Kyy) - Kxy Kyx)/(Cxx Cyy - Cxy Cyx),
    ws = sqrt(ke)/whirl.
    """
    ke = (K[0, 0] * C[1, 1] + K[1, 1] * C[0, 0] - K[0, 1] * C[1, 0] - K[1, 0] * C[0, 1]) / (C[0, 0] + C[1, 1])
    square = ((ke - K[0, 0]) * (ke - K[1, 1]) - K[0, 1] * K[1, 0]) / (C[0, 0] * C[1, 1] - C[0, 1] * C[1, 0])
    if not (square > 0 and ke > 0):
        return None, None
    return math.sqrt(square), math.sqrt(ke / square)
