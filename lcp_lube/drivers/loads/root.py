"""Roots of functions of one variable that are expensive to evaluate."""

from dataclasses import dataclass, field
from itertools import pairwise
from math import inf, isfinite

LONGEST_STEP = 2.5  # while there is no bracket
FLATTEST = 0.05  # slope below which a step is taken as if it were this
WIDEST_GAP, FINEST_GAP = 1.5, 0.3  # largest gaps left between known points, and beside the best point
PATIENCE = 8  # evaluations without a bracket, after which secant steps are left


@dataclass
class Search:
    """A root of g between low and high: Newton's steps where slopes are known, else secants, in the bracket once there is one.

    Where secant steps lead nowhere, as they may if g is not monotone, the ends are tried, the one towards which g should grow
    first, and then the widest gaps between what is known. g may be -inf where all that is known is that it is too small.

    Parameters
    ----------
    slope : that of g, to begin with: its sign says where g should grow.
    explore : where secant steps lead nowhere, look elsewhere.
    least : width of a bracket, relative to t or 1, in which g jumps.
    """

    low: float
    high: float
    slope: float
    explore: bool = True
    least: float = 1e-14
    points: list[tuple[float, float]] = field(default_factory=list)  # t, g(t), in the order of their evaluation
    slopes: dict[float, float] = field(default_factory=dict)  # of g where they are known, by t
    left: set[float] = field(default_factory=set)  # where g could not be evaluated: t
    widths: list[float] = field(default_factory=list)  # of the bracket, after each point since there is one

    def __post_init__(self) -> None:
        self.ends = [self.low, self.high] if self.slope < 0 else [self.high, self.low]

    def add(self, t: float, g: float, slope: float | None = None) -> None:
        """Take up a value of g, and its slope if that is known."""
        self.points.append((t, g))
        if slope is not None and isfinite(slope):
            self.slopes[t] = slope
        known = [point for point in self.points if isfinite(point[1])][-2:]
        if len(known) == 2 and known[1][1] != known[0][1]:
            self.slope = (known[1][1] - known[0][1]) / (known[1][0] - known[0][0])
        if (bracket := self.bracket) is not None:
            self.widths.append(bracket[1] - bracket[0])

    def leave(self, t: float, back: float) -> None:
        """g could not be evaluated here; it may be half-way to the nearest point or, where there is none, to `back`."""
        near = min((point[0] for point in self.points), key=lambda known: abs(known - t), default=back)
        self.low, self.high = (self.low, t) if t > near else (t, self.high)
        self.left.add(t)
        self.ends = [0.5 * (near + t) if (end - t) * (t - near) >= 0 else end for end in self.ends]

    def slope_at(self, t: float) -> float | None:
        """That of g at one of the points, by its own or by another one's and the secant between; None where none is known."""
        g = dict(self.points)[t]
        near = min(self.slopes, key=lambda known: abs(known - t), default=t)
        if near == t:
            return self.slopes.get(t)
        return 2.0 * (g - dict(self.points)[near]) / (t - near) - self.slopes[near]

    @property
    def bracket(self) -> tuple[float, float] | None:
        """The narrowest interval between two points with g of different sign; None without one."""
        pairs = [(a[0], b[0]) for a, b in pairwise(sorted(self.points)) if min(a[1], b[1]) < 0 < max(a[1], b[1])]
        return min(pairs, key=lambda pair: pair[1] - pair[0], default=None)

    def next(self) -> float | None:
        """Where to evaluate next; None where there is nothing left to be tried."""
        up = 1.0 if self.slope >= 0 else -1.0
        t, g = min(self.points, key=lambda point: (abs(point[1]), -up * point[0]))
        step = self._newton(t, g, -g / (up * max(abs(self.slope), FLATTEST)))
        if (bracket := self.bracket) is None:
            target = min(max(t + min(max(step, -LONGEST_STEP), LONGEST_STEP), self.low), self.high)
            target = 0.5 * (t + target) if target in self.left else target
            return self._elsewhere() if self._known(target) or len(self.points) + len(self.left) >= PATIENCE else target
        a, b = bracket
        if b - a <= self.least * max(abs(a), abs(b), 1.0):
            return None
        slow = len(self.widths) > 3 and self.widths[-1] > 0.5 * self.widths[-4]
        return t + step if a < t + step < b and not slow else 0.5 * (a + b)

    def _newton(self, t: float, g: float, step: float) -> float:
        """The step from the best point by its own slope, corrected by that of the next best point; else the one given."""
        if not abs(self.slopes.get(t, 0.0)) > min(FLATTEST, abs(g)):  # a step of 1 by the slope itself is no leap
            return step
        to, others = 1.0 / self.slopes[t], [p for p in self.points if p[0] in self.slopes and p[1] != g]
        step = -g * to
        if others:  # the inverse function's cubic through both, with both slopes
            t_2, g_2 = min(others, key=lambda point: abs(point[1]))
            d, mean, to_2 = g_2 - g, (t_2 - t) / (g_2 - g), 1.0 / (self.slopes[t_2] or inf)
            bend = (3.0 * mean - 2.0 * to - to_2) / d
            bent = step + g * g * (bend - g * (to + to_2 - 2.0 * mean) / d**2)
            step = bent if 0.5 < bent / step < 2.0 else step
        return step

    def _known(self, t: float) -> bool:
        return any(abs(t - point[0]) <= 1e-9 * (self.high - self.low) for point in self.points)

    def _elsewhere(self) -> float | None:
        """An end that was not tried, or the middle of the widest gap; of those beside the best point the smaller ones too."""
        if not self.explore:
            return None
        for end in self.ends:
            if not self._known(end):
                return end
        known = sorted(point[0] for point in self.points)
        best = min(self.points, key=lambda point: abs(point[1]))[0]
        wide = [(a, b) for a, b in pairwise(known) if b - a > (FINEST_GAP if best in (a, b) else WIDEST_GAP)]
        a, b = max(wide, key=lambda gap: gap[1] - gap[0], default=(0.0, 0.0))
        return 0.5 * (a + b) if b > a else None
