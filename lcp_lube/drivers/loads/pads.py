"""Pads that tilt about pivots, and the place of what they carry: Newton's method with the exact stiffness of the films.

Coordinates q are the runner's or journal's place and the pads' tilts; each moves the film by a mode g_j, dh = sum of g_j dq_j.
The equations are that the integrals of p g_i are those wanted: minus the load, and no moment about a pivot. Their derivatives
come from `response`, one factorisation a film, so a handful of solves do, each started from the last.

A pad without pressure has no moment either, and one that digs in would tip over at a touch. Both have no stiffness against
tilting, and are not what a bearing runs at: their inlets are opened, step by step, before Newton's method goes on. A pad from
which the journal has moved so far that it finds no place with stiffness idles: its inlet is closed until it has no pressure.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.parallel import Array
from ...problems.solution import Outcome, Solution
from ...scenes.moving import motion_of
from ...scenes.scene import Scene, Solvable
from ..ask import Ask
from ..chain import Chain
from ..compose import Inner
from ..levels import halved
from ..motions.impedance import stiffness
from .pad_coordinates import Bearing, FilmWithModes, ModeFilms, bearing_of

MOST_SOLVES = 80  # on a grid: the end of a search that goes round: pads without preload, which idle, took up to 65
FINE = 7  # points across that are halved
THINNER, THICKER = 0.7, 3.0  # parts of a film anywhere by which a step may change it
THINNEST = 1e-5  # film over the clearance, below which no load is looked for: a difference quotient's step is a tenth of it
ROUNDING = 1e-15  # a step, in parts of the coordinates' sizes, too short to change a film
NEAR = 0.05  # a step in parts of the coordinates' sizes
NUDGES, NUDGE = 4, 0.5  # of a pad without stiffness: how often its inlet is opened, and by how much of its size of tilt
SHRINK = 0.25  # of a nudge beside the one before: in a lightly loaded bearing a wide one upsets the other pads


def applies(scene: Solvable, ask: Ask) -> bool:
    """Whether the scene has pads, and their tilts or the place of what they carry are to be found."""
    return motion_of(scene) is None and bearing_of(scene) is not None


def solve(scene: Solvable, ask: Ask, inner: Inner) -> Solution:
    """The solution where everything balances; its outcome is LOAD_NOT_CARRIED where no such place was found. Collective.

    From a cold start a coarse grid comes first, which also shows which pads idle; `nested` = False: none does.
    """
    bearing = bearing_of(scene)
    assert isinstance(scene, Scene) and bearing is not None  # as `applies` found
    known, q = ask.start.settings.get("relative_coordinates") if ask.start is not None else None, bearing.start()
    warm = known is not None and len(known) == q.size and bool(bearing.free[0])
    if warm:
        q = np.where(bearing.free, bearing.sizes * np.asarray(known), q)
    idles, solves, work, first = np.zeros(q.size, dtype=bool), 0, 0.0, None
    if not warm and ask.nested is not False and (coarse := halved(scene.shape, bearing.fewest, FINE)) is not None:
        first = _on_grid(scene.with_shape(coarse), ask, inner, q, idles)
        solves, work = first.count, first.count * math.prod(coarse) / math.prod(scene.shape)
        if first.found:
            q, idles, ask = first.q, first.idles, replace(ask, start=first.solution)
    end = _on_grid(scene, ask, inner, q, idles)
    if first is not None:
        first.solution.destroy()
    _tell(scene, bearing, end, {"iterations": end.count, "solves": solves + end.count, "work": work + end.count})
    return end.solution


@dataclass(frozen=True)
class _End:
    """Where the search on a grid has ended, after `count` solves. idles : tilts of pads that do; why : nothing was found."""

    solution: Solution
    q: Array
    count: int
    found: bool
    idles: NDArray[np.bool_]
    why: str


def _on_grid(scene: Scene, ask: Ask, inner: Inner, q: Array, idles: NDArray[np.bool_]) -> _End:
    """Newton's method on one grid. idles : tilts of pads that idle on a coarser one. Collective."""
    bearing = bearing_of(scene)
    assert bearing is not None  # as in `solve`
    chain = Chain(ask, inner)
    found, again, stiff = False, bool(idles.any()), False
    nudges, nudge, off = NUDGES * idles.astype(int), np.zeros(q.size), np.zeros(q.size)
    counts, idle = off, list[bool]()
    for count in range(1, MOST_SOLVES + 1):
        at = bearing.at(q)
        solution = chain.solve(at)
        why = f"in {count} solves"
        if not solution.converged:
            break
        with bearing.films(at, solution) as films:
            off, counts = bearing.misfit(solution)
            if films.min(lambda one: float(np.min(one.problem.film(*_places(one))))) < THINNEST * bearing.sizes[0]:
                why += ", the film all but gone"
                break
            met = bool(np.all(np.abs(off[bearing.free]) <= counts[bearing.free]))
            if met and stiff and not nudges.any():
                found = True
                break
            K = films.sum(lambda one: one.spread(stiffness(one.response()), q.size))  # noqa: B023
            # As wide as what else is displaced: under a light load, whose film is nearly even, more would push all away.
            wide = NUDGE * bearing.sizes * min(1.0, max(float(np.max(np.abs(q / bearing.sizes))), THINNEST))
            for k in bearing.pitches:
                opens = bearing.free[k] and not K[k, k] > 0 and nudges[k] < NUDGES
                closes = bearing.free[k] and nudges[k] >= NUDGES and abs(off[k]) > counts[k]
                nudge[k] = wide[k] * (opens * SHRINK ** int(nudges[k]) - 1.0 * closes)
            nudges += nudge > 0
            found = met and not nudge.any()
            if found and not again and (nudges >= NUDGES).any():
                # From the place that was found, a pad that idles may find its own.
                nudge = np.where(nudges >= NUDGES, wide, 0.0)
                nudges, found, again = np.zeros_like(nudges), False, True
            step = _step(bearing, films, K, off, counts, nudge, bearing.free & (nudge == 0) & (nudges < NUDGES))
            idle = [bearing.free[k] and (nudges[k] >= NUDGES or not K[k, k] > 0) for k in bearing.pitches]
        if found or count == MOST_SOLVES:
            break
        if float(np.max(np.abs(step / bearing.sizes))) < ROUNDING:
            why += ", the last of them a step of rounding"
            break
        # A place so near has stiffness too: it need not be found once more to know that the pads are stable there.
        stiff = float(np.max(np.abs(step / bearing.sizes))) < NEAR and all(
            K[k, k] > 0 for k in bearing.pitches if bearing.free[k]
        )
        q = q + step
    return _End(solution, q, count, found, nudges >= NUDGES, why + _left(bearing, off, counts, idle))


def _left(bearing: Bearing, off: Array, counts: Array, idle: list[bool]) -> str:
    """What is left of the equations that are not met (N, N m), and which pads bear nothing or tip over."""
    kept = zip(bearing.conditions, off, bearing.free & (np.abs(off) > counts), strict=True)
    rest = [f"{key} {abs(one):.3g}" for key, one, more in kept if more]
    idles = [str(k) for k, one in enumerate(idle, start=1) if one]
    told = {"left over: ": rest, "without stiffness: pad ": idles}
    return "".join(f"; {what}{', '.join(which)}" for what, which in told.items() if which)


def _places(film: FilmWithModes) -> tuple[Array, Array]:
    """x, y of all points of the film, its sides among them, on every rank."""
    grid = film.problem.grid
    return grid.with_neighbours(0)[None, :], grid.with_neighbours(1)[:, None]


def _step(
    bearing: Bearing, films: ModeFilms, K: Array, off: Array, counts: Array, nudge: Array, moves: NDArray[np.bool_]
) -> Array:
    """Newton's step of what moves, and the nudges, shortened where it would change a film by too much. Collective."""
    free, step = np.flatnonzero(moves), nudge.copy()
    scaled = -K[np.ix_(free, free)] * bearing.sizes[free] / counts[free, None]
    step[free] = bearing.sizes[free] * np.linalg.lstsq(scaled, -off[free] / counts[free], rcond=1e-13)[0]

    def share(film: FilmWithModes) -> float:
        x, y = _places(film)
        moved = sum(step[k] * mode(x, y) for k, mode in zip(film.numbers, film.modes, strict=True))
        change = moved / film.problem.film(x, y)
        falls, grows = float(np.max(-change)), float(np.max(change))
        return min(THINNER / max(falls, THINNER), THICKER / max(grows, THICKER))

    return films.min(share) * step


def _tell(scene: Any, bearing: Bearing, end: _End, counts: dict[str, float]) -> None:
    """Outcome, record and the pads' numbers on the solution. Collective."""
    solution, q = end.solution, end.q
    values, told = solution.problem.quantities(solution.fields), bearing.told(q)
    place = f"{told['vary']} = {told['value']:.8g}, tilts {', '.join(f'{tilt:.4g}' for tilt in told['tilts'])} rad"
    if solution.converged and not end.found:
        wanted = "" if scene.balance is None else f"{scene.balance.load:g} asked for; "
        solution.outcome = Outcome.LOAD_NOT_CARRIED
        solution.message = f"{wanted}no balance was found {end.why}; the last: {place} carries {values['load']:.8g}"
    tilts = [float(tilt) for tilt in told["tilts"]]
    solution.problem.more |= {"pad_tilts": tilts}  # type: ignore[attr-defined]
    solution.settings |= {"coordinates": [float(one) for one in q], "relative_coordinates": q / bearing.sizes}
    found_in = f"found in {counts['iterations']} solves on this grid, {counts['solves']} in all"
    solution.because(f"pads: {place}, {found_in}", after=True)
    if "attitude_deg" in told:
        solution.settings["attitude_deg"] = told["attitude_deg"]
    if scene.balance is not None:
        record = {"load": scene.balance.load, "carried": values["load"]}
        solution.settings["balance"] = {"vary": told["vary"], "value": told["value"], **record, **counts}
