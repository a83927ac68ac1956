"""How far a number is from its value on ever finer grids: from its values on grids from coarse to fine, and from the film.

With spacings d_k the value w_k = v_k + c_k, c_k = (v_k - v_(k-1)) d_k^2/(d_(k-1)^2 - d_k^2), is free of an error of second
order (Richardson). What moves w from grid to grid is what does not fall like that: fronts that stand anywhere in their cells,
edges, an order that is not two. So

    n = f max(|w_k - w_j| min(1, (2 d_k/d_j)^2), |c_j| (d_k/d_j)^2/3), j = k-1 and k-2,
    answer v_k + (3/4) c_k, error 1.1 n + |c_k|/4;    v_k itself: error |c_k| + 1.1 n,

f = 12 over the square of how many times finer the finest grid is than the coarsest, at least 1: the little that grids of
nearly one spacing tell can be chance. Three quarters of the correction instead of the whole are a little worse as a value and
far better known: the whole one is right to a part of n that no few values tell. Where the moves of w leave less than a
hundredth of c_k second order is beyond doubt, and the whole correction is taken, with what they leave for its error. The
answer is the one of the two with the lesser error. The constants were taken from the loads, largest pressures and frictions of
100 random plane films, for 95 of 100 estimates to hold, and of those that end a run because they are the first
below its tolerance; `benchmarks/estimates.py` draws others and tells how often the truth was within, and how far below.

Areas of cavities err by chance: fronts stand anywhere in the cells of 1/d lines, each of which adds d^2 with either sign, all
together d^(3/2) (to a count of points d). Of such numbers the corrections for that order, carried to the last grid by it, are a
sample of the error: SPREAD times their root mean square, beside the value with HALF of the last correction.

Values from grids so coarse that the scheme did not see the film's edges tell nothing of those that do, and are left out. Values
cannot tell of what no grid has met: where the film has detail inside cells that the scheme does not see (`unseen`), the share
of Int h^-3 that it misplaces is an error too. Where edges run across the lines of points (spirals, herringbones) errors hang on
where, and values agree by chance: no less is taken to remain than by first order.

A line needs none of this: it is solved by quadrature (`film.line`), so the first grid's error is known (`known_line`).
"""

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from math import inf, isfinite
from typing import Any

import numpy as np

from ...problems.film.integrals import line_integrals
from ...problems.film.lubrication import LubricationProblem
from ...problems.film.model import Model
from ...problems.film.turned import TurnedProblem
from ...problems.solution import Fields, Problem
from ...scenes.moving import film_of, motion_of
from ...scenes.scene import Solvable

MOVED, PART = 1.1, 0.75  # factor of n, and what is added of a correction
NOISY = {
    "cavitated_area": 1.5,
    "cavitated_fraction": 1.0,
}  # numbers that chance has more part in, and the order of their errors
SPREAD, HALF, LAST = 1.8, 0.5, 4  # of these: factor of the root mean square of so many last corrections, part added of the last
EXPECTED = 1.0 / 3.0  # of what corrections before lead one to expect of the last one, which can be small by chance
SPAN = 12.0  # over the square of finest over coarsest grid: factor of n
ENOUGH = 3.9  # finest over coarsest of grids that are enough without those before
INTEGRALS = ("load", "pressure_integral")  # whose change from grid to grid is at most that of the pressure
PAIR = {False: 1.4, True: 0.7}  # factor of their error from two grids, with cavities and without: a linear problem
RIMS, CORNERS = 1.7, 1.2  # times that where rims cut faces, or corners of recesses are in them
RIMS_BESIDE = 4.0  # of other numbers
MORE, STEADY, PART_MOVED = 1.5, 0.02, 0.25  # from the third grid on: factor, least move of the correction over it, exponent
BESIDE, SHARE = 3.0, 0.3  # factors of an error of other numbers from two grids, and of the pressure's change in it
CLEAN = 0.01  # what moves of w leave over the last correction
QUADRATURE = 1e-9  # relative: what a line's quadrature may leave
ANSWER = (1.0, 10.0)  # least and greatest answer to what is misplaced: relative change over share of Int h^-3
FOLLOWING = {  # numbers that are a power of another times what does not change with it
    "load": {"sommerfeld": 1, "pad_load": 1, "S": -1, "friction_coefficient": -1},
    "friction": {"friction_coefficient": 1},
}


@dataclass(frozen=True)
class Estimate:
    """value : the answer. error : how far it may be off, in the value's unit. extrapolated : whether no grid has that value."""

    value: float
    error: float
    extrapolated: bool = False

    @property
    def relative(self) -> float:
        """Of the value; inf where there is none, or it is 0 and not known to be."""
        if not self.error:
            return 0.0
        return self.error / abs(self.value) if self.value and isfinite(self.value) else inf


@dataclass(frozen=True)
class Traits:
    """What a film's estimates hang on.

    line : whether the film is known by quadrature (`is_known`). pairs : whether an integral of the pressure is estimated from
    each two grids (`of_pair`). rims, corners : whether rims cut faces, and corners of recesses are in them. slanted : whether
    edges run across the lines of points, and errors hang on where. order : of the scheme.
    """

    line: bool = False
    pairs: bool = False
    rims: bool = False
    corners: bool = False
    slanted: bool = False
    order: float = 2.0


def estimate(
    values: Sequence[float], misplaced: Sequence[float], finer: Sequence[float], name: str = "", film: Traits = Traits()
) -> Estimate:
    """The best value of a quantity and its error, from its values on grids from coarse to fine.

    Parameters
    ----------
    values : NaN where a grid gave none.
    misplaced : `misplaced_film` on the same grids.
    finer : how fine they are: meshes a side, over any number.
    name : of the quantity, which may be one of NOISY. film : its order stands in the place of two above (`upwind` has the
        first); where it is slanted no less than by first order remains.
    """
    v, m = np.array(values, dtype=float), np.array(finer, dtype=float)
    usable = np.flatnonzero(np.isnan(v))
    first = int(usable[-1]) + 1 if usable.size else 0
    blind = np.flatnonzero(np.array(misplaced) > 0.0)
    if not misplaced[-1] and blind.size and m[-1] > ENOUGH * m[blind[-1] + 1]:
        first = max(first, int(blind[-1]) + 1)
    v, m, last = v[first:], m[first:], float(values[-1])
    if len(v) < 3:
        return Estimate(last, inf)
    steps = np.diff(v)
    corrections = steps / ((m[1:] / m[:-1]) ** film.order - 1.0)
    w = v[1:] + corrections
    shrink = ((m[1:-1] / m[-1]) ** film.order)[-2:]  # of the two grids before the last
    if name in NOISY:
        moves = (steps * (m[1:] / m[-1]) ** NOISY[name] / ((m[1:] / m[:-1]) ** NOISY[name] - 1.0))[-LAST:]
        error = SPREAD * float(np.sqrt(np.mean(moves * moves)))
        return Estimate(max(0.0, last + HALF * float(moves[-1])), max(error, _of_film(np.abs(steps), misplaced, last)), True)
    few = max(1.0, SPAN * (m[0] / m[-1]) ** 2)
    left = few * float(np.max(np.abs(w[-1] - w[:-1][-2:]) * np.minimum(1.0, 2.0**film.order * shrink)))
    noise = max(left, few * EXPECTED * float(np.max(np.abs(corrections[:-1][-2:]) * shrink)))
    correction = float(corrections[-1])
    whole, unseen = abs(correction), _of_film(np.abs(steps), misplaced, last)
    if film.slanted:
        unseen = max(unseen, float(np.max(np.abs(v[-1] - v[:-1][-2:]) / (m[-1] / m[:-1][-2:] - 1.0))))
    clean = left < CLEAN * whole
    of_grid, of_limit = whole + MOVED * noise, left if clean else MOVED * noise + (1.0 - PART) * whole
    if of_limit < of_grid:
        return Estimate(last + (1.0 if clean else PART) * correction, max(of_limit, unseen), True)
    return Estimate(last, max(of_grid, unseen))


def of_pair(
    values: Sequence[float],
    misplaced: Sequence[float],
    finer: Sequence[float],
    change: float,
    name: str,
    other: int = -2,
    full: bool = False,
    film: Traits = Traits(),
) -> Estimate:
    """The best value and its error from two grids, and from how far the pressure changed between them.

    Values can agree by chance, pressures in all parts of a film do not: what its integrals over parts change by is never less,
    added up, than the change of the whole one. By second order the last grid's error is the change over (d_j/d_k)^2 - 1.
    A third grid tells whether it is of second order: how far the last correction is from what that makes of the one before.
    Of an integral that has a part in the error, which no chance makes nought of.

    Parameters
    ----------
    values, misplaced, finer : as in `estimate`. change : that sum over the quantity, or for a quantity that is no integral of p
        the integral of |p_k - p_j| over that of p. other : number of the grid j that the last one is compared with.
    full : whether nothing is cavitated. film : what makes errors of its own is its rims and corners.
    """
    if name in NOISY or len(values) < 2:
        return Estimate(values[-1], inf)
    told = name in INTEGRALS
    step, to_come = values[-1] - values[other], 1.0 / ((finer[-1] / finer[other]) ** 2 - 1.0)
    error = to_come * max(abs(step), (1.0 if told else SHARE) * change * abs(values[-1]))
    if told and isfinite(moved := _moved(values, finer)) and error:
        error *= MORE * max(moved / error, STEADY) ** PART_MOVED
    at_corners, at_rims = (CORNERS, RIMS) if told else (1.0, RIMS_BESIDE)
    error *= (PAIR[full] if told else BESIDE) * (at_rims if film.rims else at_corners if film.corners else 1.0)
    if not isfinite(error):
        return Estimate(values[-1], inf)
    unseen = _of_film(np.abs(np.diff(values)), misplaced, values[-1])
    return Estimate(values[-1] + PART * to_come * step, max(error, unseen), True)


def _moved(values: Sequence[float], finer: Sequence[float]) -> float:
    """How far the last correction is from what second order makes of the one before; NaN where there are not two."""
    if len(values) < 3:
        return np.nan
    before, last = np.diff(values[-3:]) / np.diff(np.square(finer[-3:])) * np.square(finer[-3:-1])
    return float(abs(last - before * (finer[-2] / finer[-1]) ** 2))


def _of_film(steps: np.ndarray, misplaced: Sequence[float], value: float) -> float:
    """The error that detail unseen inside cells makes: its share, times how strongly the value was seen to answer to it."""
    if not misplaced[-1] or not value:
        return inf if misplaced[-1] else 0.0
    shares = (np.array(misplaced[:-1]) + misplaced[1:])[-len(steps) :]
    answers = steps[shares > 0] / shares[shares > 0] / abs(value)
    return float(np.clip(np.max(answers, initial=0.0), *ANSWER) * misplaced[-1] * abs(value))


def follow(numbers: dict[str, Any], quantity: str, value: float, best: float) -> None:
    """Put the best value in the place of the grid's own, and let what is this number times others follow, in place."""
    numbers[quantity] = best
    if not value:  # nothing has no direction, and nothing to scale by
        return
    for name, power in FOLLOWING.get(quantity, {}).items():
        if numbers.get(name) is not None:
            numbers[name] *= (best / value) ** power
    if quantity == "load" and value == np.hypot(*(force := numbers.get("force") or [0.0, 0.0])):
        numbers["force"] = [part * best / value for part in force]  # the grid's direction


def scalars(found: Mapping[str, Any]) -> dict[str, float]:
    """The numbers among quantities; None becomes NaN."""
    kinds = (int, float, type(None))
    return {
        name: np.nan if value is None else float(value)
        for name, value in found.items()
        if isinstance(value, kinds) and not isinstance(value, bool)
    }


def given_film(scene: Solvable) -> Model | None:
    """A film whose heights and past are known before it is solved: steady, and in no balance; None of other scenes."""
    return None if getattr(scene, "balance", None) is not None or motion_of(scene) is not None else film_of(scene)


def is_known(scene: Solvable) -> bool:
    """Whether a film in 1D can be solved by quadrature: its ends open or closed, steady, no supplies, effects local."""
    model = given_film(scene)
    if model is None or len(scene.shape) != 1 or model.supplies or model.grooves:
        return False
    if (model.law or model.effects) and not (model.scheme == "face" and all(effect.local for effect in model.effects)):
        return False
    from ...problems.film.known import KINDS  # here: of lines alone

    return {side.kind for side in model.sides[:2]} <= KINDS


def known_line(problem: Problem) -> tuple[LubricationProblem, Fields] | None:
    """A problem and its fields that have a film's numbers by quadrature, from its problem on any grid. Collective.

    None where they overflow. The film is one that `is_known`; the scheme may be any.
    """
    if not isinstance(problem, LubricationProblem):
        return None
    line = solved = copy(problem)
    if isinstance(line, TurnedProblem):
        solved = line.image = copy(line.image)
    solved.integrals = solved.integrals or line_integrals(solved.grid, solved.film, checked=True)
    from ...problems.film.known import known_fields  # here: of lines alone

    fields = known_fields(line)
    return None if fields is None else (line, fields)
