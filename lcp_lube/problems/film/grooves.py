"""A film that closes on itself, with axial grooves that hold a pressure: films between the grooves, each a problem of its own.

The points in a groove have its pressure and no void. They are Dirichlet points of the films on both sides, so those are
solved one by one; this file has the whole: its certificate, what leaves the grooves, its quantities.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.parallel import Array
from ..certificate import Certificate, certificate_tol
from ..solution import Fields
from .flows import volume_unit
from .lubrication import LubricationProblem


@dataclass(frozen=True)
class Groove:
    """From x = start on, counted round as far as x = end (m), the film holds the pressure p (Pa above p_c).

    Lines of points lie on its edges (`Model.lines`); of other lines, even ones of a march say, the nearest stand for them.
    """

    start: float
    end: float
    p: float

    def columns(self, x: Array, period: float) -> tuple[int, int]:
        """The first of its columns, of those at x (m) round a ring, and how many it has."""
        beside = [np.abs(np.remainder(x - at + 0.5 * period, period) - 0.5 * period) for at in (self.start, self.end)]
        first, last = (int(np.argmin(away)) for away in beside)
        return first, (last - first) % x.size + 1


@dataclass(frozen=True)
class Pad:
    """The film between two grooves: n columns from `first` on, and the pressures at its west and east side.

    around : x of its points and of the grooves' points beside them, m; it ascends beyond the ring's end.
    """

    first: int
    n: int
    west: float
    east: float
    around: Array


def pads_between(x: Array, period: float, grooves: tuple[Groove, ...]) -> list[Pad]:
    """The films between the grooves of a ring with columns at x, one behind the other; ValueError where none is left."""
    ordered = sorted((*groove.columns(x, period), groove.p) for groove in grooves)
    pads, nx = [], x.size
    for k, (first, count, p) in enumerate(ordered):
        behind, _, p_behind = ordered[(k + 1) % len(ordered)]
        start = first + count
        n = (behind - start) % nx if len(ordered) > 1 else nx - count
        if n < 1 or sum(count for _, count, _ in ordered) >= nx:
            raise ValueError("grooves that overlap, or leave no point of the grid between them")
        columns = np.arange(start - 1, start + n + 1)
        pads.append(Pad(start % nx, n, p, p_behind, x[columns % nx] + period * (columns // nx)))
    return pads


class GroovedProblem(LubricationProblem):
    """The whole ring; solved by way of its pads (`drivers.grooves`), never as it stands here."""

    grooves: tuple[Groove, ...] = ()

    @property
    def columns(self) -> list[NDArray[np.bool_]]:
        """For each groove, whether an owned point lies in it."""
        grid = self.grid
        number = np.broadcast_to(np.arange(grid.x_start, grid.x_end)[None, :], grid.box).ravel()
        each = (groove.columns(grid.lines[0], grid.lengths[0]) for groove in self.grooves)
        return [(number - first) % grid.shape[0] < count for first, count in each]

    def groove_flows(self, p: Array, r: Array) -> list[float]:
        """Volume flow that each groove gives to the film, m3/s (1D: m2/s). Collective."""
        balance, unit = self.face_flows(p, r), volume_unit(self)
        return [unit * self.reduce.sum(np.where(inside, balance, 0.0)) for inside in self.columns]

    def certify(self, fields: Fields, eps1: float, closely: bool = True) -> Certificate:
        """As for any film, over the points outside the grooves; inside, that they hold their pressure. Collective."""
        red, p, r = self.reduce, fields["p"], fields["r"]
        columns = self.columns
        free = ~np.logical_or.reduce(columns)
        Ap, Br = (
            np.where(free, self._product(*pair), 0.0)
            for pair in ((self.scheme.pressure_entries(), p), (self.scheme.void_entries(), r))
        )
        c = np.where(free, self.c, 0.0)
        F = Ap + Br - c
        scale = red.norm(Ap) + red.norm(Br) + red.norm(c)
        p_max = red.max(np.abs(p))
        off = sum(
            red.max(np.where(inside, np.abs(p - groove.p / self.p_unit) / (p_max or 1.0) + r, 0.0))
            for inside, groove in zip(columns, self.grooves, strict=True)
        )
        gaps = red.max(np.abs(np.minimum(p / p_max if p_max > 0 else p, r)))
        # What the wall drags round is the scale of all that flows.
        dragged = red.sum(np.where(free, np.abs(self.scheme.b_C.ravel()), 0.0)) / self.grid.shape[0]
        return Certificate(
            measures={
                "residual": red.norm(F) / scale if scale != 0 else 0.0,
                "complementarity": max(gaps, off),
                "mass_defect": abs(red.sum(F)) / dragged if dragged > 0 else 0.0,
                **self.more_measures,
            },
            tol=certificate_tol(eps1),
            extremes={"min_p": red.min(p) * self.p_unit, "min_r": red.min(r)},
        )

    def _product(self, entries: Sequence[tuple[int, int, Array]], values: Array) -> Array:
        """A p or B r without a matrix, which nothing else here asks for. Collective."""
        (ny, nx), framed = self.grid.box, self.grid.ghosted(values, 0.0)
        parts = (value * framed[1 + dj : 1 + dj + ny, 1 + di : 1 + di + nx] for dj, di, value in entries)
        out: Array = sum(parts, np.zeros((ny, nx)))
        return out.ravel()

    def quantities(self, fields: Fields) -> dict[str, Any]:
        """Those of any film, and `groove_flow`: what each groove gives, m3/s. Collective."""
        return {**super().quantities(fields), "groove_flow": self.groove_flows(fields["p"], fields["r"])}
