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

import numpy as np

from ..base.parallel import Array
from ..errors import InputError
from ..problems.film.lubrication import LubricationProblem
from ..problems.film.model import Model
from ..problems.solution import Solution
from ..scenes.effects.table import without
from ..scenes.scene import Scene
from ..scenes.tilting import TiltingPadScene
from .grooves import pad_films, pick_pad
from .impedance import displacements, impedance
from .pads import JournalPads


@dataclass(frozen=True)
class Coefficients:
    """K (N/m) and C (N s/m) at one frequency (rad/s), shape (2, 2), x along the load and y a quarter of a turn ahead.

    In 1D per metre of width.
    """

    frequency: float
    K: Array
    C: Array


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
    if isinstance(scene, TiltingPadScene):
        total += _of_pads(scene, solution, frequencies)
    elif model.grooves:
        dx = model.lengths[0] / scene.shape[0]
        for pad, film in pad_films(scene):
            problem = film.build(ring.grid.dm.comm)
            take = pick_pad(ring.grid, problem.grid, pad.first)
            fields = {name: take(values) for name, values in solution.fields.items()}
            modes = displacements(turning, (pad.first - 0.5) * dx)
            total += impedance(problem, film.model, fields, modes, frequencies)
            problem.destroy()
    else:
        assert isinstance(ring, LubricationProblem)  # as a scene with `turning` has
        total += impedance(ring, model, solution.fields, displacements(turning, 0.0), frequencies)
    fx, fy = turning.force(ring, solution.fields["p"])
    along = math.atan2(-fy, -fx)  # the load, from where theta is counted
    turn = np.array([[math.cos(along), -math.sin(along)], [math.sin(along), math.cos(along)]])
    total = turn.T @ total @ turn
    return [
        Coefficients(nu, found.real, found.imag / nu if nu > 0 else found.imag)
        for nu, found in zip(frequencies, total, strict=True)
    ]


def _of_pads(scene: TiltingPadScene, solution: Solution, frequencies: Sequence[float]) -> Array:
    """The journal's K + i nu C (at nu = 0: K + i C) with massless pads that follow. Collective."""
    total = np.zeros((len(frequencies), 2, 2), dtype=complex)
    bearing = JournalPads(scene)
    for film in bearing.films(scene, solution):
        found = impedance(film.problem, film.model, film.fields, film.modes, frequencies)
        film.problem.destroy()
        for k, nu in enumerate(frequencies):
            total[k] += found[k, :2, :2] if "coordinates" not in solution.settings else _reduced(found[k], nu)
    return total


def _reduced(Z: Array, nu: float) -> Array:
    """What two coordinates feel where the third one is free of force; of K + i C at nu = 0."""
    e, d = slice(0, 2), 2
    K, C = Z.real, Z.imag
    if not abs(K[d, d]) > 0:  # a pad that idles
        return Z[e, e]
    if nu:
        return Z[e, e] - np.outer(Z[e, d], Z[d, e]) / Z[d, d]
    follows, pushed = -K[d, e] / K[d, d], -K[e, d] / K[d, d]  # tilt by displacement; forces by moment
    damped = C[e, e] + np.outer(C[e, d], follows) + np.outer(pushed, C[d, e]) + C[d, d] * np.outer(pushed, follows)
    return K[e, e] + np.outer(K[e, d], follows) + 1j * damped


def placed(scene: Scene, solution: Solution) -> Scene:
    """The scene with the journal, and its pads, where the solution found them, without the effects that were left out."""
    if gone := solution.settings.get("model", {}).get("left_out"):
        scene = without(scene, gone)
    if isinstance(scene, TiltingPadScene) and "coordinates" in solution.settings:
        return JournalPads(scene).at(np.array(solution.settings["coordinates"]))
    found = {"attitude_deg": solution.settings["attitude_deg"]} if "attitude_deg" in solution.settings else {}
    if balance := solution.settings.get("balance"):
        found |= {balance["vary"]: balance["value"]}
    return scene.model_copy(update={**found, "balance": None}) if found else scene


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
