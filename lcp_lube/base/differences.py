"""Derivatives of cheap functions of one variable by differences, to rounding; kinks and jumps are told apart from bends."""

from collections.abc import Callable
from typing import Any

import numpy as np

from ..errors import InputError
from .parallel import Array

STEP, SMALLER, TRIES = 1e-4, 0.1, 4  # of a number, relative; where its effect is not smooth, smaller ones
LARGER, WANTED = (1e-3, 1e-2), 1e-7  # steps where rounding leaves more than this of the slope
QUIET, LEFT = 1e-5, 0.1  # of the slope: rounding at most, of which this part is left, where two values do
TRUNCATED = 0.1  # an error, of what lower order differs by
SCATTER, ODD = 0.7, 1.9  # six standard deviations of rounding, of fourth differences and of third ones, which pass by kinks
LESS = 0.03  # by which smaller steps leave less scatter that is no rounding, and less of a kink beside a than of what bends
SMOOTH = 3e-7  # relative error that is left to truncation
QUICK, BENT = 1e-5, 1e-4  # of a number, relative; least part of the slope that the second difference must have to be heeded
KINK = 1e-2  # relative difference between both sides
CHORD, SLIGHT = 1e-2, 1e-2  # relative: width and least slope of a function that changes by steps
ROUNDING, TINY = 1e-15, 1e-300  # of a value, generously (2^-53 is 1.1e-16); what stands for 0 in a quotient
WIDTHS, APART = (0.5, 1.0, 2.0), 0.2  # of chords, in CHORD; by what part they may differ where f changes by steps


def differences(
    f: Callable[[float], Array],
    a: float,
    scale: float,
    sizes: Array,
    wary: bool = False,
    points: int = 1,
    least: Array | float = 0.0,
) -> tuple[Array, Array, Array]:
    """df/da of a vector function to rounding, by how much its derivatives to both sides differ where it has a kink, and an
    estimate of its error, of rounding and truncation.

    A kink's derivative is the mean of both sides. Where f changes by steps (it jumps at a, or nothing changes but over a wider
    range), it is the slope of its chord over a hundredth to both sides, and the difference inf. Where it hardly bends, two
    values of it do beside f(a). Rounding is seen by fourth differences; where it is not small against the slope steps are
    larger, as far as f is as smooth there, up to a hundredth of what f is linear in.

    Parameters
    ----------
    scale : a change of a that is not small. sizes : of the terms that f is made of, whose rounding is left in it.
    points : by whose terms' chance rounding is less than of all terms together.
    least : of f, small changes that need not be better known.
    wary : f may change by many steps, though it seems smooth next to a: NaN where chords half and twice as wide differ.

    Raises
    ------
    InputError : f has values on neither side of a.
    """
    near = _Near(f, a, scale, sizes, least)
    chords: list[Array] = []
    for width in WIDTHS if wary else ():
        chords.append(near.chord(width * CHORD * scale) + np.zeros_like(sizes))
        if near.by_steps(chords).all():  # before more is looked at
            return np.full_like(sizes, np.nan), np.full_like(sizes, np.inf), np.zeros_like(sizes)
    slope, error = _by_two(near, points)
    kinks = np.zeros_like(sizes)
    if error is None:
        slope, kinks, error = _by_stencils(near, slope)
    none = near.by_steps([slope, *chords]) if chords else np.zeros(sizes.shape, dtype=bool)
    return np.where(none, np.nan, slope), np.where(none, np.inf, kinks), error


class _Near:
    """Values of f near a, each looked at once. None where f has none."""

    def __init__(self, f: Callable[[float], Array], a: float, scale: float, sizes: Array, least: Array | float):
        self.f, self.a, self.scale, self.sizes, self.least = f, a, scale, sizes, least
        self.known: dict[float, Array | InputError] = {}

    def at(self, change: float) -> Array | None:
        if change not in self.known:
            try:
                self.known[change] = self.f(self.a + change)
            except InputError as error:
                self.known[change] = error
        value = self.known[change]
        return None if isinstance(value, InputError) else value

    @property
    def size(self) -> Array:
        """Of f at a; 0 where it has no value."""
        here = self.at(0.0)
        return np.zeros_like(self.sizes) if here is None else np.abs(np.nan_to_num(here))

    def enough(self, error: Array, slope: Array, part: float) -> Any:
        return error <= part * np.maximum(np.abs(slope), self.least / self.scale)

    def chord(self, d: float) -> Array:
        """Slope between a - d and a + d, or from a on where one of them has no value; NaN where neither has."""
        low, high, here = self.at(-d), self.at(d), self.at(0.0)
        if low is not None and high is not None:
            return (high - low) / (2.0 * d)
        if here is None or (low is None and high is None):
            return np.asarray(np.nan)
        return (high - here) / d if high is not None else (here - low) / d  # type: ignore[operator]

    def stepped(self, none: Any) -> tuple[Array, Any]:
        """The chord's slope, and where it is more than what bends leaves though there is no derivative."""
        chord = self.chord(CHORD * self.scale)
        return chord, none & (np.abs(chord) * self.scale > SLIGHT * (self.size + SLIGHT * self.sizes))

    def by_steps(self, slopes: list[Array]) -> Any:
        """Where slopes differ too much to be those of one derivative."""
        apart, most = np.ptp(slopes, axis=0), np.abs(slopes).max(axis=0)
        least = SLIGHT * self.size + 1e-9 * self.sizes
        return (apart > APART * most) & (apart * self.scale > least)

    def stencil(self, d: float) -> tuple[Array, Array, Array, Array] | None:
        """Differences of fourth and of second order with step d, and of both sides; and what they scatter by, by rounding
        and what bends more than these do. To one side where the other has no values."""
        low2, low, here, high, high2 = (self.at(m * d) for m in (-2, -1, 0, 1, 2))
        if low2 is not None and low is not None and high is not None and high2 is not None and here is not None:
            fourth = (8.0 * (high - low) - (high2 - low2)) / (12.0 * d)
            even, odd = low2 - 4.0 * low + 6.0 * here - 4.0 * high + high2, high2 - 2.0 * high + 2.0 * low - low2
            scattered = np.minimum(SCATTER * np.abs(even), ODD * np.abs(odd))
            return fourth, (high - low) / (2.0 * d), np.abs(high - 2.0 * here + low) / d, scattered
        side = 1.0 if high is not None else -1.0
        v: list[Any] = [self.at(side * m * d) for m in range(5)]
        if any(value is None for value in v):
            return None
        fourth = side * (-25.0 * v[0] + 48.0 * v[1] - 36.0 * v[2] + 16.0 * v[3] - 3.0 * v[4]) / (12.0 * d)
        second = side * (-1.5 * v[0] + 2.0 * v[1] - 0.5 * v[2]) / d
        apart = np.abs(4.0 * v[1] - 6.0 * v[2] + 4.0 * v[3] - v[4] - v[0])  # what the others foretell of v_0
        return fourth, second, apart / d, 2.0 * apart


def _by_two(near: _Near, points: int) -> tuple[Any, Array | None]:
    """The slope by two values beside f(a), None where there are not two, and its error where f hardly bends, else None."""
    d, scale = QUICK * near.scale, near.scale
    low, high = near.at(-d), near.at(2.0 * d)  # not as far to both sides: bends that cancel would not be seen
    if low is None and high is None:
        raise near.known[-d]  # type: ignore[misc]
    here = near.at(0.0)
    one_sided = here is not None and (low is None) != (high is None)
    if one_sided:
        d = d if low is None else -d
        low, here, high = here, near.at(d), near.at(2.0 * d)
    if low is None or here is None or high is None:
        return None, None
    ahead, behind, noise = high - here, here - low, 10.0 * ROUNDING * near.sizes / abs(d)
    slope = (3.0 * behind - ahead) / (2.0 * d) if one_sided else (ahead + 4.0 * behind) / (6.0 * d)
    noise = noise * (2.0 if one_sided else 1.0) / np.sqrt(points)
    bend = np.abs(ahead * (1.0 if one_sided else 0.5) - behind) / abs(d)
    none = (ahead == 0.0) & (behind == 0.0)
    quiet = near.enough(noise, slope, QUIET) & near.enough(bend, slope, BENT) | none
    if not quiet.all() or (none.any() and near.stepped(none)[1].any()):
        return slope, None
    return slope, np.where(none, 0.0, LEFT * noise + bend**2 / (np.abs(slope) + near.least / scale + TINY))


class _Tried:
    """Slopes, what truncation leaves of them, and by what rounding is in them; and the rounding of f that was seen."""

    def __init__(self, sizes: Array):
        self._of: list[tuple[Array, Array, float]] = []
        self.rounding = np.full_like(sizes, np.inf)

    def __bool__(self) -> bool:
        return bool(self._of)

    def add(self, slope: Array, off: Array, part: float) -> None:
        self._of.append((slope, off, part))

    def forget(self, passed: Any) -> None:
        """What was told by steps that reach a kink."""
        for _, off, _ in self._of:
            np.copyto(off, np.inf, where=passed)

    def best(self) -> tuple[Array, Array]:
        """Of the slopes those with the least error each, and the errors."""
        errors = np.array([off + self.rounding * part for _, off, part in self._of])
        slopes, least = np.array([one for one, *_ in self._of]), errors.argmin(axis=0)[None]
        return np.take_along_axis(slopes, least, 0)[0], np.take_along_axis(errors, least, 0)[0]


def _by_stencils(near: _Near, last: Any) -> tuple[Array, Array, Array]:
    """Slope, kinks and error by ever smaller steps, and larger ones where rounding asks for them; last : of `_by_two`."""
    sizes, scale = near.sizes, near.scale
    before, kinks, bent, kinked = np.zeros_like(sizes), np.zeros_like(sizes), np.zeros_like(sizes), False
    tried, limit = _Tried(sizes), None
    for k in range(TRIES):
        d = STEP * SMALLER**k * scale
        noise = 10.0 * ROUNDING * sizes / d
        found = near.stencil(d)
        if found is None:
            continue
        slope, second, jump, scattered = found
        scattered = np.minimum(scattered, noise * d) + ROUNDING * near.size
        passed, bent = (before > 0.0) & (jump < LESS * bent), jump  # a kink beside a, which smaller steps no longer reach
        tried.forget(passed)
        tried.rounding = np.where(scattered < LESS * tried.rounding, scattered, np.maximum(scattered, tried.rounding))
        off = TRUNCATED * np.abs(slope - second)
        if k == 0 and last is not None:  # of a smaller step
            off = np.maximum(off, np.abs(slope - last) - tried.rounding * (1.0 / d + 1.0 / (QUICK * scale)))
        elif last is not None:  # what bends otherwise to either side leaves an error in proportion to the step
            off = np.where(passed, off, np.maximum(off, SMALLER * np.abs(slope - last)))
            to = slope + (slope - last) * SMALLER / (1.0 - SMALLER)
            if limit is not None:
                tried.add(to, np.where(passed, np.inf, TRUNCATED * np.abs(to - limit)), 2.0 / d)
            limit = to
        tried.add(slope, off, 1.0 / d)
        last = slope
        jump = np.where(jump > KINK * np.abs(slope) + 10.0 * noise, jump, 0.0)
        # What bends falls with the step, a kink stays, and a jump grows.
        kinks = np.where(jump > 0.3 * before, jump, 0.0) if k else jump
        kinks = np.where((jump > 3.0 * before) & (before > 0.0), np.inf, kinks)
        before, kinked, (slope, error) = jump, kinked or bool(jump.any()), tried.best()
        smooth = near.enough(error - 2.0 * tried.rounding / d, slope, SMOOTH).all() and not jump.any()
        if smooth or np.isinf(kinks).any():
            break
    if not tried:
        raise next(one for one in near.known.values() if isinstance(one, InputError))
    slope, error = tried.best()
    for step in LARGER if not kinked else ():
        if near.enough(error, slope, WANTED).all() or (found := near.stencil(step * scale)) is None:
            break
        tried.add(found[0], TRUNCATED * np.abs(found[0] - found[1]) + found[3] / (step * scale), 1.0 / (step * scale))
        slope, error = tried.best()
    slope, steps = np.where(np.abs(slope) <= error, 0.0, slope), np.isinf(kinks)
    if steps.any() or not slope.all():
        chord, more = near.stepped(slope == 0.0)
        steps = steps | more
        slope, kinks = np.where(steps, chord, slope), np.where(steps, np.inf, kinks)
    return slope, kinks, np.where(steps, 0.0, error)
