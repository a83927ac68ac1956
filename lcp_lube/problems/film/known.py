"""What is known of a film in 1D without a solver: its numbers as the film has them, and the discrete solution, by quadrature.

What is read off the fields of a solve is corrected by what the film says minus what the discrete solution says (`quantities`):
the fields' own error stays in it, the grid's goes. Supplies part a line into films of their own (`spans`); pressures that
follow from a flow or a restrictor are found for the film's flows, and for the discrete ones. Barus' fluid is one of constant
viscosity in q (`fluid`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.parallel import Array
from ..solution import Fields
from .fluid import Law
from .integrals import LineIntegrals
from .line import ISOVISCOUS, Flow, Line, line_flow, solve_line, solve_points
from .oil_along import Oil, Settling, with_densities
from .spans import SIDE, Span, whole
from .supplies import Supply

if TYPE_CHECKING:
    from .lubrication import LubricationProblem

KINDS = {"open", "closed"}  # ends of a line that is known, if it does not go round
MOST, DIGITS = 60, 1e-14  # steps for the pressures of supplies, and their last relative change
SETTLED = 1e-12  # of densities and viscosities, which then are off by a part of it
NEAR = 1e-9  # relative: of such changes those that grow are rounding


@dataclass(frozen=True)
class Fed:
    """The films between what holds a pressure, and the pressures of the supplies, Pa above p_c.

    lines : of the spans. integrals : of the whole. ends : where each supply begins and ends, m.
    """

    lines: tuple[Line, ...]
    spans: tuple[Span, ...]
    integrals: LineIntegrals
    ends: tuple[tuple[float, float], ...]
    P: Array

    def integral(self, antiderivative: Callable[[Array], Array], above: float = 0.0) -> float:
        """`Line.integral` of all, supplies among them."""
        total = sum(line.integral(antiderivative, above) for line in self.lines)
        for (a, b), p in zip(self.ends, self.P, strict=True):
            x = np.array([a, b])
            if (ring := self.integrals.ring) is not None and np.ptp(back := self.integrals.turned_back(x)):
                x = np.array([a, back[1] + ring[0], back[1] + ring[0], b])  # of an end that is the turn both sides count
            start, end = x[::2], x[1::2]
            back = self.integrals.turned_back(0.5 * (start + end))
            total += (p - above) * float(np.sum(antiderivative(end - back) - antiderivative(start - back)))
        return total

    @property
    def friction(self) -> float:
        """N/m; where a supply is the film is full, without a slope of the pressure."""
        upto, line = self.integrals.upto, self.lines[0]
        held = [
            float(np.diff(upto(np.array(pair))[0])[0]) * line.law.viscosity(p)
            for pair, p in zip(self.ends, self.P, strict=True)
        ]
        return sum(one.friction for one in self.lines) + line.mu * line.U * float(sum(held))

    @property
    def cavitated(self) -> float:
        """Length of the cavities, m."""
        return sum(line.cavitated for line in self.lines)

    @property
    def largest(self) -> tuple[float, float]:
        """The largest pressure, Pa above p_c, and its x, m."""
        top, x = max((line.largest for line in self.lines), key=lambda found: found[0])
        return top, float(x - self.integrals.turned_back(np.array(x)))

    @property
    def fronts(self) -> tuple[list[float], list[float]]:
        """x of all ruptures and reformations, m: a cavity that reaches a supply at p_c ends there."""
        found: tuple[list[float], list[float]] = [], []
        for span, line in zip(self.spans, self.lines, strict=True):
            ends = [line.integrals.points[-1]] if span.east != SIDE and not line.full[-1] else []
            found[0].extend(line.fronts[0])
            found[1].extend([*line.fronts[1], *ends])
        ruptures, reformations = (sorted(float(x - self.integrals.turned_back(np.array(x))) for x in some) for some in found)
        return ruptures, reformations


@dataclass(frozen=True)
class Known:
    """A line as its film has it, and the discrete solution on the owned points (p in Pa).

    P : pressures of the supplies by the discrete equations, Pa above p_c. more_Q : by how much more flows than in the
    discrete solution, of each span, m2/s.
    """

    line: Fed
    p_pa: Array
    r: Array
    P: Array
    more_Q: Array

    @property
    def more(self) -> dict[str, Array]:
        """By how much more each supply has and gives than by the discrete equations."""
        return {"supply_p": self.line.P - self.P, "supply_flow": 0.5 * _given(self.line.spans, self.more_Q, self.P.size)}

    @property
    def side_flows(self) -> dict[str, float]:
        """What flows out of the sides, m2/s: of those that a film reaches."""
        spans, lines = self.line.spans, self.line.lines
        ends = ("west", spans[0].west, -0.5 * lines[0].Q), ("east", spans[-1].east, 0.5 * lines[-1].Q)
        return {side: flow for side, end, flow in ends if end == SIDE}

    def ambient(self, problem: LubricationProblem) -> float:
        """As `forces.ambient`, with the pressures of the supplies as the film has them, Pa above p_c."""
        opens = [p for p, kind in zip(problem.p_sides, problem.grid.ends[0], strict=False) if kind == "open"]
        return min(opens or self.line.P.tolist())


def known_of(problem: LubricationProblem) -> Known | None:
    """None for 2D, a film without `integrals`, other ends, supplies that are no lines' (`spans.supplied`), other equations."""
    grid, line, oil = problem.grid, problem.integrals, problem.oil
    if line is None or not (problem.plain or oil) or problem.U < 0:
        return None
    supplies = problem.held.supplies if problem.held is not None else ()
    spans = line.spans if supplies else whole(line)
    if not spans or not ((supplies and grid.periodic[0]) or {*grid.ends[0]} <= KINDS):
        return None
    if any(one.open for one in supplies) and len(spans) < len(supplies) + (not grid.periodic[0]):
        return None  # what flows from a supply to the side that it reaches is the grid's alone
    oil = oil or Oil(problem.mu, ISOVISCOUS)
    if oil.effects and "closed" in grid.ends[0]:
        return None
    data: Any = (oil.mu, problem.U, problem.p_sides[:2], problem.r_in, supplies, oil.law, tuple(map(id, oil.effects)))
    with np.errstate(all="ignore"):
        if data not in line.known:
            line.known[data] = [_film(problem, line, spans, supplies, oil), oil.effects, None]  # which keep their ids
        fed, _, found = line.known[data]
        if fed is not None and (found is None or oil.effects):  # which make other faces of other answers
            found = line.known[data][2] = _points(problem, spans, supplies, oil)
    if fed is None or found is None:
        return None
    p, r, P, flows = found
    more_Q = np.array([one.Q for one in fed.lines]) - flows
    p, r = (field[grid.x_start : grid.x_end].copy() for field in (p, r))
    if problem.held is not None:
        p = np.where(problem.held.mask.ravel(), np.append(P, 0.0)[problem.held.owner].ravel(), p)
    return Known(fed, p, r, P, more_Q)


def _ends(problem: LubricationProblem, oil: Oil, span: Span, P: Array) -> tuple[float, float, float, bool]:
    """q at both ends, the void that enters, whether nothing flows; P : pressures of the supplies."""
    ends, kinds = (span.west, span.east), problem.grid.ends[0]
    given = [problem.p_sides[k] if end == SIDE else P[end] for k, end in enumerate(ends)]
    p = [float(oil.law.reduced(np.asarray(one))) for one in given]
    shut = [kind == "closed" and end == SIDE for kind, end in zip(kinds, ends, strict=True)]
    if shut[1]:  # what the wall brings is pressed back: full, with the slope 6 mu U/h^2 all the way
        p[1] = p[0] + 6.0 * oil.mu * problem.U * float(np.sum(span.line.parts[1]))
    return p[0], p[1], problem.r_in if span.west == SIDE else 0.0, any(shut)


def _film(
    problem: LubricationProblem, line: LineIntegrals, spans: Sequence[Span], supplies: Sequence[Supply], oil: Oil
) -> Fed | None:
    """The line as its film has it; None where it has no answer, or its oil does not settle."""

    def ends(span: Span, P: Array) -> tuple[float, float, float, bool]:
        return _ends(problem, oil, span, P)

    begin, films, last = np.array([one.p for one in supplies]), list(spans), np.inf
    settling = [Settling(span.line) for span in spans]
    for _ in range(MOST):
        P = _balanced(supplies, films, begin, oil.law, lambda span, P: line_flow(span.line, oil.mu, problem.U, *ends(span, P)))
        if P is None:
            return None
        lines = tuple(solve_line(span.line, oil.mu, problem.U, *ends(span, P), oil.law) for span in films)
        if not all(np.isfinite(one.Q) and np.isfinite(one.p).all() for one in lines):
            return None
        off = 0.0
        if oil.law.dowson_higginson or oil.effects:
            for one, found in zip(settling, lines, strict=True):
                one.take(found, oil, problem.reduce)
            off = max(one.off for one in settling)
            films = [replace(span, line=one.line) for span, one in zip(spans, settling, strict=True)]
        if _ends_at(off, last, SETTLED):
            held = tuple((one.region.x - one.region.half_x, one.region.x + one.region.half_x) for one in supplies)  # type: ignore[union-attr]
            return Fed(lines, tuple(spans), line, held, P)
        last = off
    return None


def _points(
    problem: LubricationProblem, spans: Sequence[Span], supplies: Sequence[Supply], oil: Oil
) -> tuple[Array, Array, Array, Array] | None:
    """The discrete solution: p and r at all points, pressures of the supplies, flows of the spans; None as of `_film`."""

    def solved(span: Span, P: Array) -> tuple[Array, Array, Flow]:
        return solve_points(span.parts, oil.mu, problem.U, *_ends(problem, oil, span, P))

    begin, last, law = np.array([one.p for one in supplies]), np.inf, oil.law
    (p, r), flows = np.zeros((2, problem.grid.shape[0])), np.zeros(len(spans))
    if oil.effects:  # with what they have made of the faces; of a line alone, without supplies
        every = [np.concatenate(problem.grid.comm.allgather(a)) for a in oil.faces]
        pushed, dragged = (np.append(west[:1], east) for west, east in zip(every[:2], every[2:], strict=True))
        parts = spans[0].parts * np.stack([np.ones(pushed.size), dragged / pushed, 1.0 / pushed])
        spans = [replace(spans[0], parts=parts)]
    points = list(spans)
    for _ in range(MOST):
        P = _balanced(supplies, points, begin, law, lambda span, P: solved(span, P)[2])
        if P is None:
            return None
        off = 0.0
        for k, span in enumerate(spans):
            q, r[span.owned], flow = solved(points[k], P)
            p[span.owned], flows[k] = law.pressure(q), flow.Q
            if law.dowson_higginson and not oil.effects:
                at_ends = law.pressure(np.array(_ends(problem, oil, span, P)[:2]))
                parts = with_densities(span.parts, np.array([at_ends[0], *p[span.owned], at_ends[1]]), law)
                off = max(off, np.abs(parts[2] / points[k].parts[2] - 1.0).max())
                points[k] = replace(span, parts=parts)
        if not np.isfinite(p).all():
            return None
        if _ends_at(off, last, SETTLED):
            return p, r, P, flows
        last = off
    return None


def _ends_at(change: float, last: float, least: float) -> bool:
    """Whether steps have come to their end: by so small a relative change, or by one that grows as rounding does."""
    return change <= least or last <= change <= NEAR


def _given(spans: Sequence[Span], flows: Array, count: int) -> Array:
    """Sums over each supply's ends of what flows away from it."""
    out = np.zeros(count)
    for span, flow in zip(spans, flows, strict=True):
        for end, sign in ((span.west, 1.0), (span.east, -1.0)):
            if end != SIDE:
                out[end] += sign * flow
    return out


def _balanced(
    supplies: Sequence[Supply], spans: Sequence[Span], begin: Array, law: Law, flow_of: Callable[[Span, Array], Flow]
) -> Array | None:
    """Pressures of the supplies at which each source gives what its films take, by Newton's method; None if it ends nowhere."""
    P, free, last = begin, np.array([one.open for one in supplies], dtype=bool), np.inf
    for _ in range(MOST if free.any() else 0):
        flows = [flow_of(span, P) for span in spans]
        Q = 0.5 * _given(spans, np.array([flow.Q for flow in flows]), P.size)
        slopes = np.zeros((P.size, P.size))
        for span, flow in zip(spans, flows, strict=True):
            for end, by in ((span.west, flow.by_a), (span.east, flow.by_b)):
                if end != SIDE:
                    slopes[:, end] += 0.5 * by * _given([span], np.ones(1), P.size) / law.viscosity(P[end])
        off = np.array([one.sought(*at) if one.open else (0.0, 1.0, 0.0) for one, *at in zip(supplies, P, Q, strict=True)])
        try:
            step = np.linalg.solve(np.diag(off[:, 1]) + off[:, 2:] * slopes, -off[:, 0])
        except np.linalg.LinAlgError:
            return None
        P = np.maximum(P + step, 0.0)
        size = float(np.max(np.abs(step)) / (np.max(P) or 1.0))
        if _ends_at(size, last, DIGITS):
            return P
        last = size
    return P if not free.any() else None


def known_fields(problem: LubricationProblem) -> Fields | None:
    """The discrete solution where no solver is needed for it; None for the films that `known_of` leaves out. Collective."""
    known = known_of(problem.moving)
    return None if known is None else problem.here({"p": known.p_pa / problem.p_unit, "r": known.r})
