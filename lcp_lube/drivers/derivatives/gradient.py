"""Derivatives of a solution's numbers by the scene's: one transposed solve a quantity, whatever the number of parameters.

G(z; a) = 0 is the film's balance, z = p in the full film and -r in the cavity, J = dG/dz. With J' lambda = dQ/dz,

    dQ/da = dQ/da|_z - lambda' dG/da = dL/da,     L(a) = Q(z, a) - lambda' G(z, a) at held z.

L is a number; its derivative comes from values of it at scenes with that one number changed by 1e-4 of itself, by differences
of fourth order: no solve, and an error near 1e-11 (`base.differences`). Where something was found for
the scene its conditions have adjoints of their own (`adjoint.Implicit`).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from ...base.differences import KINK
from ...base.parallel import Array
from ...errors import InputError
from ...problems.solution import Solution
from ...scenes.grooved import GroovedJournalScene
from ...scenes.moving import film_of, motion_of
from ...scenes.scene import Scene
from ...scenes.tilting import TiltingPadScene
from ...scenes.values import key_of, values_of
from ..marches.march_course import Trace, check_march
from ..motions.coefficients import placed, scene_of
from .adjoint import Adjoint
from .coupled_gradient import CoupledGradient
from .equations import check_film
from .film_gradient import FilmGradient
from .implicit import Implicit, other_side
from .march_film_gradient import MarchFilm
from .march_gradient import MarchGradient
from .near_films import plain
from .transposed import CoupledFilm

BY_STEPS = "no derivative on this grid: it changes by steps, whose mean slope is another over other widths"
STEPWISE = "the lines of points go with the edges of grooves, and their number between two by steps"
SURE = 1e-6  # of a derivative: an error that is not told
FOUND = "it was found, and follows the other numbers"


ByKey = dict[str, dict[str, float]]


@dataclass(frozen=True)
class Gradient:
    """Derivatives of one number of a solution.

    Attributes
    ----------
    quantity, value : Q, SI.
    gradient : dQ/da by key, SI.
    elasticity : d ln Q/d ln a by key; None where Q or a is zero.
    held : numbers without a derivative, and why.
    error : of dQ/da by key, an estimate: rounding, truncation of differences, and what is left of the film and its adjoint.
    uncertain : those of them that are more than SURE of the derivative; where it is 0, of the quantity.
    one_sided : by key, how much the derivatives to both sides differ: an edge on a point of the grid, a floor that is touched.
    switching : points at which p and r both vanish, or that tie for the largest pressure; the film answers to a growing and to
        a falling number differently there. switching_gap : the largest relative change of a derivative if they count to the
        other side.
    """

    quantity: str
    value: float
    gradient: dict[str, float]
    elasticity: dict[str, float | None]
    error: dict[str, float] = field(default_factory=dict)
    uncertain: dict[str, float] = field(default_factory=dict)
    held: dict[str, str] = field(default_factory=dict)
    one_sided: dict[str, float] = field(default_factory=dict)
    switching: int = 0
    switching_gap: float = 0.0

    @property
    def ranked(self) -> list[str]:
        """Keys, those that matter most first."""

        def place(key: str) -> tuple[float, float, str]:
            size, slope = self.elasticity[key] or 0.0, self.gradient[key]
            return (1.0, 0.0, key) if slope != slope else (-abs(size), -abs(slope), key)

        return sorted(self.gradient, key=place)


def gradient_of(solution: Solution, quantity: str, keys: str | Sequence[str] | None) -> dict[str, float]:
    """`Solution.gradient`: dQ/da by the keys as they were given, or by all that have a derivative."""
    of = scene_of(solution)
    keys = [keys] if isinstance(keys, str) else keys
    found = gradients(of, solution, [quantity], keys)[0]
    if keys is None:
        return found.gradient
    scene = placed(of, solution)
    out = {}
    for text in keys:
        key = text if text in found.gradient else key_of(scene, text)  # placed, it has no balance.load
        if key in found.held:
            raise InputError(f"{text}: no derivative: {found.held[key]}")
        out[text] = found.gradient[key]
    return out


def film_gradient_of(solution: Solution, quantity: str) -> Array:
    """`Solution.film_gradient`."""
    return film_fields(scene_of(solution), solution, [quantity])[quantity]


def gradients(
    scene: Scene, solution: Solution, quantities: Sequence[str], keys: Sequence[str] | None = None, trace: Trace | None = None
) -> list[Gradient]:
    """Derivatives of numbers of a converged solution by numbers of its scene. Collective.

    Parameters
    ----------
    scene : that was solved. quantities : keys of the results; vectors by their parts (force_x, flow_west), or what a balance
        has found; of a march those at its end, and their means (mean_load).
    keys : of the scene, SI; default all of `values_of`.
    trace : that heard the march; without it, it is marched once more.

    Raises
    ------
    InputError : a quantity without a derivative, a key that is no number, a solution that is none, a scene without a film.
    """
    first, *more = _gradients(scene, solution, quantities, keys, trace=trace)
    if motion_of(scene) is None and not more and any(one.switching for one in first):
        more = _gradients(scene, solution, quantities, keys, flip=True)
    if not more:
        return first
    out = []
    for one, two in zip(first, more[0], strict=True):
        scale = max((abs(value) for value in map(one.elasticity.get, one.gradient) if value), default=1.0)
        gaps = [abs((one.elasticity[key] or 0.0) - (two.elasticity[key] or 0.0)) / scale for key in one.gradient]
        out.append(Gradient(**{**one.__dict__, "switching_gap": max(gaps, default=0.0)}))
    return out


def check(scene: Scene) -> None:
    """Raise InputError for a scene without derivatives."""
    (check_film if motion_of(scene) is None else check_march)(scene)


def film_fields(scene: Scene, solution: Solution, quantities: Sequence[str], trace: Trace | None = None) -> dict[str, Array]:
    """dQ/dh by quantity at the owned points of the solution's grid, per area, in the fields' shape. Collective.

    Of a march by a film that is so much thicker at all times. trace : as of `gradients`.

    Raises
    ------
    InputError : a quantity without a derivative, a scene without a film, a solution that is none.
    """
    check(scene)
    grid = solution.problem.grid
    adjoint: Any = _adjoint(scene, solution, quantities, trace=trace)
    film: Any = None
    try:
        film = (MarchFilm if motion_of(scene) is not None else CoupledFilm if _coupled(scene) else FilmGradient)(adjoint)
        return {name: film.field(name).reshape(grid.box if grid.dim == 2 else -1) for name in quantities}
    finally:
        if film is not None:
            film.destroy()
        adjoint.destroy()


def _stepwise(scene: Any) -> tuple[str, ...]:
    """What the keys begin with that move grooves."""
    if isinstance(scene, TiltingPadScene):
        return "pivot", "pad_deg"
    return ("groove",) if isinstance(scene, GroovedJournalScene) and scene.grooves_deg else ()


def _coupled(scene: Any) -> bool:
    return bool(getattr(film_of(scene), "effects", ()))


def _adjoint(
    scene: Scene,
    solution: Solution,
    quantities: Sequence[str],
    flip: bool = False,
    trace: Trace | None = None,
    both: bool = False,
) -> Any:
    if motion_of(scene) is not None:
        return MarchGradient(scene, solution, quantities, trace)
    if _coupled(scene):
        return CoupledGradient(scene, solution, quantities, flip)
    return Adjoint(scene, solution, quantities, both)


def _gradients(
    scene: Scene,
    solution: Solution,
    quantities: Sequence[str],
    keys: Sequence[str] | None,
    flip: bool = False,
    trace: Trace | None = None,
) -> list[list[Gradient]]:
    """And those of the other side, where it is another's and an `Adjoint`'s."""
    adjoint = _adjoint(scene, solution, quantities, flip, trace, both=True)
    try:
        balance = solution.settings.get("balance")
        if keys is not None:
            asked = ["balance.load" if balance and key == "balance.load" else key_of(adjoint.scene, key) for key in keys]
        else:
            asked = [*(["balance.load"] if balance else []), *values_of(adjoint.scene)]
        slopes, jumps, errors, held = ByKey(), ByKey(), ByKey(), dict[str, str]()
        for key in dict.fromkeys(asked):
            if key in adjoint.found:
                held[key] = FOUND
            elif key.startswith(_stepwise(scene)):
                held[key] = STEPWISE
            elif key == "balance.load":
                slopes[key], jumps[key], errors[key] = dict.fromkeys(adjoint.lambdas, 0.0), {}, {}
            else:
                try:
                    slopes[key], jumps[key], errors[key] = adjoint.slopes(key)
                except InputError as error:
                    held[key] = str(error)
        out = [_told(adjoint, quantities, slopes, jumps, errors, held, balance)]
        if any(plain(name) != name for name in adjoint.lambdas):
            slopes, jumps, errors = ({key: other_side(of) for key, of in one.items()} for one in (slopes, jumps, errors))
            out.append(_told(adjoint, quantities, slopes, jumps, errors, held, balance, other=True))
        return out
    finally:
        adjoint.destroy()


def _told(
    adjoint: Any,
    quantities: Sequence[str],
    slopes: ByKey,
    jumps: ByKey,
    errors: ByKey,
    held: dict[str, str],
    balance: Any,
    other: bool = False,
) -> list[Gradient]:
    """Of every quantity, from dL/da by key."""
    implicit, report, out = Implicit.of(adjoint, other), adjoint.report, []
    of = values_of(adjoint.scene) | ({"balance.load": balance["load"]} if balance else {})
    for name in quantities:
        value = adjoint.value(name) if name in adjoint.found else report[name]
        found = {key: implicit.total(name, key, slope) for key, slope in slopes.items()}
        none = {key: BY_STEPS for key, slope in found.items() if math.isnan(slope)}
        error = {key: implicit.error(name, key, slopes[key], errors[key]) for key in found if key not in none}
        found = {key: slope if abs(slope) > error[key] else 0.0 for key, slope in found.items() if key not in none}
        elasticity = {key: slope * of[key] / value if value and of[key] else None for key, slope in found.items()}
        uncertain = {key: one for key, one in error.items() if one > _least_told(found[key], value, of[key])}
        sides = {key: implicit.jump(name, jumps[key]) for key in found}
        sides = {key: jump for key, jump in sides.items() if jump > KINK * abs(found[key])}
        switching = adjoint.switching + adjoint.ties.get(name, 0)
        out.append(Gradient(name, value, found, elasticity, error, uncertain, held | none, sides, switching))
    return out


def _least_told(slope: float, value: float, a: float) -> float:
    """The error of dQ/da from which on it is told: its SURE, but for elasticities that are nearly 0; Q's where it is 0."""
    size = abs(value / a) if a else 0.0 if slope else math.inf
    return SURE * max(abs(slope), (SURE if slope else 1.0) * size)
