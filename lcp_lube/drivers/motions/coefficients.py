"""Stiffness and damping of a film: of a journal in its bush, with tilt too, and of a flat film along its normal.

`response` has the derivation. K + i nu C = -d(force)/de, exact at the discrete solution, at any frequency nu;
in 1D, where numbers are the film's own, K is theirs.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from ...base.parallel import Array
from ...errors import InputError
from ...problems.film.forces import totals
from ...problems.film.grooves import GroovedProblem
from ...problems.film.known import known_of
from ...problems.film.lubrication import LubricationProblem
from ...problems.film.model import Model
from ...problems.film.turning import Turning
from ...problems.solution import Solution
from ...scenes.effects.named import without
from ...scenes.moving import film_of, motion_of
from ...scenes.scene import Scene
from ...scenes.thrust import ThrustScene
from ...scenes.tilting import TiltingPadScene
from ..grooves import SolvedFilm, films_of
from ..loads.pad_coordinates import Bearing, JournalPads, ThrustPads, bearing_of
from ..turned import Mirrored, as_solved
from .coupled_response import CoupledResponse
from .impedance import displacements, impedance, rising, stiffness
from .response import Change, Moved, Response

FASTEST = 1e100  # rad/s: beyond it a factorisation overflows, and K and C are long those of void that has no time to change
JOURNAL, TILTED, FLAT = ("x", "y"), ("x", "y", "tilt", "tilt_across"), ("z",)  # names of the motions


@dataclass(frozen=True)
class Coefficients:
    """K and C at one frequency (rad/s), shape (motions, motions), in N/m and N s/m; with tilt also N, N m and their rates.

    Motions of a journal: x along the load, y a quarter of a turn ahead, and its axis' slopes in the planes of both, whose
    forces are the moments about the middle of the width. Of a flat film: z along its normal, apart. In 1D per metre of width.
    """

    frequency: float
    K: Array
    C: Array
    motions: tuple[str, ...] = JOURNAL


def motions_of(turning: Turning | None, tilt: bool, middle: float, along: float = 0.0) -> list[Change]:
    """dh/de of each motion; along : angle of the load, rad from where theta is counted."""
    if turning is None:
        return [rising]
    moved = displacements(turning, along=along)
    tilted: list[Change] = [lambda x, y, one=one: (y - middle) * one(x, y) for one in moved]  # type: ignore[misc]
    return [*moved, *tilted] if tilt else moved


def coefficients(
    scene: Any,
    solution: Solution,
    frequencies: Sequence[float] = (0.0,),
    tilt: bool = False,
    stored: bool = True,
    damped: bool = True,
) -> list[Coefficients]:
    """K and C of a converged solution. Collective.

    Parameters
    ----------
    scene : the scene at which the solution was found; where it has `turning`, that says where its film lies around a journal.
    frequencies : of the motion, rad/s, >= 0; 0: the limit of slow motion.
    tilt : with the slopes of a journal's axis, 4 x 4 (2D).
    stored : False: as if void were not stored in the cavity; what others leave out (above 0 rad/s).
    damped : False: K alone, at 0 rad/s; of what is no pad that spares half of the solves.

    Raises
    ------
    InputError : a scene without a film, a frequency below zero, tilt of what has no axis.
    NotFound : effects whose linearised equations GMRES does not solve.
    """
    pads, scene = bearing_of(scene), placed(scene, solution)
    check_film(scene, tilt)
    check_frequencies(frequencies)
    model: Model = scene.model
    turning: Turning | None = getattr(scene, "turning", None)
    if model.U < 0:  # a flat film: its mirror image answers to motions along the normal as it does
        scene, solution = Mirrored(scene), as_solved(solution)
    ring = solution.problem
    assert isinstance(ring, LubricationProblem)  # as a scene with a `model` has
    along = 0.0
    if turning is not None:
        p_pa = solution.fields["p"] * ring.p_unit
        force = totals(ring, p_pa, solution.fields["r"], known_of(ring), wanted=("force_x", "force_y"))
        along = math.atan2(-force["force_y"], -force["force_x"])
    motions = motions_of(turning, tilt, 0.5 * model.lengths[-1], along)
    names = FLAT if turning is None else TILTED if tilt else JOURNAL
    if isinstance(scene, TiltingPadScene) or pads is not None:
        turn = np.array([[math.cos(along), -math.sin(along)], [math.sin(along), math.cos(along)]])
        follow = np.zeros(0, dtype=bool) if pads is None else pads.free
        own = _of_pads(scene, solution, frequencies, follow, has_effects(model), stored)
        total = turn.T @ own @ turn if turning is not None else own
    else:
        of = partial(impedance, frequencies=frequencies, stored=stored) if damped else lambda one: stiffness(one)[None]
        total = by_film(of, scene, solution, motions)
    total = total * (scene.pads if isinstance(scene, ThrustScene) else 1)  # one of which was solved
    return [
        Coefficients(nu, one.real, one.imag / nu if nu > 0 else one.imag, names)
        for nu, one in zip(frequencies, total, strict=True)
    ]


def coefficients_of(solution: Solution, frequency: float | Sequence[float], tilt: bool) -> Coefficients | list[Coefficients]:
    """`Solution.coefficients`: at one frequency, or a list for several."""
    if not solution.converged:
        raise InputError(f"coefficients are of solutions that converged: {solution.message}")
    try:
        frequencies = [float(nu) for nu in np.atleast_1d(frequency)]
    except (TypeError, ValueError):
        raise InputError(f"frequency = {frequency!r}: numbers in rad/s are needed") from None
    found = coefficients(scene_of(solution), solution, frequencies, tilt)
    return found if np.ndim(frequency) else found[0]


def scene_of(solution: Solution) -> Scene:
    """What was solved; InputError for a problem that no scene describes."""
    if not isinstance(solution.solved_scene, Scene):
        raise InputError("derivatives and coefficients are of solutions that solve() has made of a scene")
    return solution.solved_scene


def has_effects(model: Model) -> bool:
    return model.law is not None or bool(model.effects)


def by_film(of: Callable[[Any], Any], scene: Any, solution: Solution, motions: Sequence[Change]) -> Any:
    """What `of` finds, and frees, of the response to these motions: of the problem that was solved, or of the films between its
    grooves side by side. Not of tilting pads: see `_of_pads`. Collective."""
    ring: Any = solution.problem
    model = supplied(scene.model, solution)
    if has_effects(model):  # as a whole: a ring's films share their oil
        gaps = [lambda e, motion=motion: Moved(model.gap, motion, e, 0.0) for motion in motions]
        return of(CoupledResponse(scene, solution, gaps))
    halved = solution.settings.get("details", {}).get("reduction") == "mirror"  # solved on half the width
    if not isinstance(ring, GroovedProblem):
        return of(Response(ring, model, solution.fields, motions, film=scene if halved else None))

    def found(one: SolvedFilm) -> Any:
        film = one.film if halved else None
        return of(Response(one.problem, one.film.model, one.fields, motions, one.first, film=film))

    with films_of(scene, ring, solution.fields) as films:
        return films.sum(found)


def check_film(scene: Any, tilt: bool) -> None:
    """Raise InputError for what has no coefficients."""
    model = film_of(scene)
    if model is None:
        raise InputError(f"scene {scene.name}: coefficients are of films; it has no part that could be displaced")
    if motion_of(scene) is not None:
        raise InputError(f"scene {scene.name}: coefficients are of films at rest in time; leave [motion] out")
    if tilt and (getattr(scene, "turning", None) is None or len(model.lengths) == 1 or isinstance(scene, TiltingPadScene)):
        raise InputError(f"scene {scene.name}: --tilt is of journals with a width")


def check_frequencies(frequencies: Sequence[float]) -> None:
    """Raise InputError for one that no motion has."""
    for nu in frequencies:
        if not 0 <= nu <= FASTEST:
            raise InputError(f"--frequency {nu:g}: numbers from 0 to {FASTEST:g} rad/s are needed")


def _of_pads(
    scene: Any, solution: Solution, frequencies: Sequence[float], free: Any, with_effects: bool, stored: bool
) -> Array:
    """K + i nu C (at nu = 0: K + i C) of what pads carry, with massless pads that follow where they are free. Collective."""
    bearing: Bearing = JournalPads(scene) if isinstance(scene, TiltingPadScene) else ThrustPads(scene)
    n, felt = bearing.sizes.size, 2 if isinstance(scene, TiltingPadScene) else 1
    if with_effects:
        q, each = bearing.start(), np.eye(n)
        gaps = [lambda e, one=one: bearing.at(q + e * one).gap for one in each]  # type: ignore[attr-defined]
        total = impedance(CoupledResponse(scene, solution, gaps), frequencies, stored)
    else:
        with bearing.films(scene, solution) as films:
            total = films.sum(lambda film: film.spread(impedance(film.response(), frequencies, stored), n))
    return np.array(
        [_reduced(Z, nu, felt, np.flatnonzero(free[felt:]) + felt) for Z, nu in zip(total, frequencies, strict=True)]
    )


def _reduced(Z: Array, nu: float, felt: int, tilts: Any) -> Array:
    """What the first coordinates feel where tilts are free of moments; of K + i C at nu = 0."""
    K, C = Z.real, Z.imag
    d, e = [k for k in tilts if abs(K[k, k]) > 0], slice(0, felt)  # the others idle
    Kd = K[np.ix_(d, d)]
    if nu:
        return Z[e, e] - Z[e, d] @ np.linalg.solve(Z[np.ix_(d, d)], Z[d, e])
    # Tilts by displacement; forces by moment.
    follows, pushed = -np.linalg.solve(Kd, K[d, e]), -np.linalg.solve(Kd.T, K[e, d].T).T
    damped = C[e, e] + C[e, d] @ follows + pushed @ C[d, e] + pushed @ C[np.ix_(d, d)] @ follows
    return K[e, e] + K[e, d] @ follows + 1j * damped


def placed(scene: Scene, solution: Solution) -> Scene:
    """The scene with the journal, and its pads, where the solution found them, without the effects that were left out."""
    if gone := solution.settings.get("model", {}).get("left_out"):
        scene = without(scene, gone)
    pads = bearing_of(scene)
    if pads is not None and "coordinates" in solution.settings:
        return pads.at(np.array(solution.settings["coordinates"]))
    found = {"attitude_deg": solution.settings["attitude_deg"]} if "attitude_deg" in solution.settings else {}
    if balance := solution.settings.get("balance"):
        found |= {balance["vary"]: balance["value"]}
    return scene.model_copy(update={**found, "balance": None}) if found else scene


def supplied(model: Model, solution: Solution) -> Model:
    """The model with its supplies at the pressures that the solution found."""
    found = solution.settings.get("supply_pressures")
    if not found:
        return model
    return replace(model, supplies=tuple(replace(one, p=p) for one, p in zip(model.supplies, found, strict=True)))


def stability(K: Array, C: Array) -> tuple[float | None, float | None]:
    """Whirl ratio and threshold ws = omega sqrt(c/g) of a rigid rotor, from K c/W and C c omega/W; None where it is stable.

    ke = (Kxx Cyy + Kyy Cxx - Kxy Cyx - Kyx Cxy)/(Cxx + Cyy), whirl^2 = ((ke - Kxx)(ke - Kyy) - Kxy Kyx)/(Cxx Cyy - Cxy Cyx),
    ws = sqrt(ke)/whirl. The threshold mass is ws^2 W/(c omega^2).
    """
    ke = (K[0, 0] * C[1, 1] + K[1, 1] * C[0, 0] - K[0, 1] * C[1, 0] - K[1, 0] * C[0, 1]) / (C[0, 0] + C[1, 1])
    square = ((ke - K[0, 0]) * (ke - K[1, 1]) - K[0, 1] * K[1, 0]) / (C[0, 0] * C[1, 1] - C[0, 1] * C[1, 0])
    if not (square > 0 and ke > 0):
        return None, None
    return math.sqrt(square), math.sqrt(ke / square)
