"""Integrals of 1/h, 1/h^2, 1/h^3 along a line: they make the fluxes between its points exact, whatever the film between them.

Where a film is full and one Q flows, p' = 6 mu (U h - Q)/h^3, so that between two points a distance d apart

    Q = U H - C (p_2 - p_1)/(6 mu d),    C = d / Int h^-3,    H = Int h^-2 / Int h^-3 :

resistances in series. The line is cut into panels, at the points and at the film's edges, and each panel halved until Gauss'
rule and its halves agree: a kink, a ramp, a ridge between two points counts as what it is. What no edge tells of is looked for
on some thousands of places, however coarse the grid.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from copy import copy
from functools import cached_property
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.polynomial.polynomial import polyint, polyval
from numpy.typing import NDArray

from ...base.parallel import Array
from ...errors import InputError
from ..grid import Grid
from .edges import marks_of

_XI, _WEIGHT = np.polynomial.legendre.leggauss(8)
TO_POWERS = np.linalg.inv(np.vander(_XI, increasing=True))  # of what has values at Gauss points
_UPTO = polyval(_XI, polyint(TO_POWERS, lbnd=-1.0))  # its integrals up to them
# The last three of its coefficients in Legendre's polynomials: a kink's are as large as what Gauss' rule errs by there.
_TAIL = _WEIGHT[:, None] * np.polynomial.legendre.legvander(_XI, 7)[:, 5:] * (np.arange(5, 8) + 0.5)
TOL = 1e-11  # of a panel's Int h^-3; less would chase the rounding of h
FIRST = 512  # panels at least before any is halved: a ridge of a thousandth of the line meets a Gauss point
PANELS = 200_000  # beyond the first ones, about the most
HALVINGS = 42  # a jump that no edge tells of is then as near as the rounding of x
SAME = 1e-13  # of the line: points so near one another are one


class LineIntegrals:
    """Int h^-1, h^-2 and h^-3 along a line.

    Parameters
    ----------
    film : h(x, y) in m for arrays that broadcast. points : x of two points and more, ascending, m. edges : x of the film's
        jumps and kinks, m; those outside are not heeded. fine : the points are ends of panels that need no halving.
    along : mu/mu_0 and rho_0/rho at places (`oil_along`), by which h^-2 and h^-3 are multiplied where they are integrated.

    Attributes
    ----------
    parts : the three integrals between neighbouring points, shape (3, points - 1), in 1, 1/m, 1/m2.
    thicker, swollen : mu/mu_0 and rho_0/rho at the panels' Gauss points.

    Raises
    ------
    InputError : a film that is not positive somewhere between the points.
    """

    def __init__(
        self,
        film: Callable[[Array, Array], Array],
        points: Array,
        edges: Iterable[float] = (),
        fine: bool = False,
        along: Callable[[Array], Array] | None = None,
    ):
        self.film, self.points, self.along = film, points, along
        self.known: dict[tuple[float, ...], Any] = {}  # `known.known_of` by what else it needs
        self.spans: tuple[Any, ...] | None = None  # between supplies (`known.Span`)
        self.ring: tuple[float, float] | None = None  # where a turn begins, and its length, m
        self.edges = np.asarray(list(edges), dtype=float)
        self.ends, h = (points, None) if fine else self._panels(self.edges)
        self.at_gauss = _gauss_points(self.ends[:-1], self.ends[1:])  # shape (panels, 8)
        self.h = self.film_at(self.at_gauss) if h is None else h
        self.thicker, self.swollen = self.along_at(self.at_gauss)
        self.first = np.searchsorted(self.ends, points)  # the panel behind each point
        self._of_panels = self._integrals(self.ends[:-1], self.ends[1:], self.h, self.thicker, self.swollen)
        self.parts = np.add.reduceat(self._of_panels, self.first[:-1], axis=1)

    def film_at(self, x: Array) -> Array:
        """h at places of the line, m."""
        return np.broadcast_to(self.film(x, np.zeros(1)), x.shape)

    def along_at(self, x: Array) -> Any:
        """mu/mu_0 and rho_0/rho at places of the line."""
        return (1.0, 1.0) if self.along is None else self.along(x)

    def carries(self, x: Array) -> Array:
        """What a wall drags through places where the film is full, over its speed: h rho/rho_0, m."""
        return self.film_at(x) / self.along_at(x)[1]

    def _panels(self, edges: Array) -> tuple[Array, Array | None]:
        """Ends of the panels, each point among them, to the bit; and the film at their Gauss points, if that is known by then.

        Of a film that tells all its edges a panel is good where h^-3 is a polynomial to TOL; else its halves are looked at.
        """
        points = self.points
        length = points[-1] - points[0]
        edges = np.unique(edges[(edges > points[0]) & (edges < points[-1])])
        nearest = np.clip(np.searchsorted(points, edges), 1, points.size - 1)
        apart = np.minimum(edges - points[nearest - 1], points[nearest] - edges)
        ends = np.sort(np.concatenate([points, edges[apart > SAME * length]]))
        if (parts := -(-FIRST // points.size)) > 1:
            inner = ends[:-1, None] + np.diff(ends)[:, None] * (np.arange(1, parts) / parts)
            ends = np.sort(np.concatenate([ends, inner.ravel()]))
        found, a, b = [ends], ends[:-1], ends[1:]
        h, cubes = self._cubes(a, b)
        if getattr(self.film, "smooth_between", False):
            doubtful = ~(np.abs(cubes @ _TAIL).sum(axis=1) <= TOL * (cubes @ _WEIGHT))
            a, b = a[doubtful], b[doubtful]
        total = 0
        for _ in range(HALVINGS if a.size else 0):
            middle = 0.5 * (a + b)
            whole, left, right = (
                0.5 * (end - start) * (self._cubes(start, end)[1] @ _WEIGHT)
                for start, end in ((a, b), (a, middle), (middle, b))
            )
            bad = ~(np.abs(whole - left - right) <= TOL * (left + right)) & (b - a > SAME * length)
            total += int(np.count_nonzero(bad))
            if not bad.any() or total > PANELS:
                break
            found.append(middle[bad])
            a, b = np.concatenate([a[bad], middle[bad]]), np.concatenate([middle[bad], b[bad]])
        return (ends, h) if len(found) == 1 else (np.sort(np.concatenate(found)), None)

    def _cubes(self, a: Array, b: Array) -> tuple[Array, Array]:
        """h and h^-3 at the panels' Gauss points."""
        x = _gauss_points(a, b)
        h = self.film_at(x)
        if not np.all(h > 0):
            at = np.unravel_index(np.argmin(np.nan_to_num(h, nan=-np.inf)), h.shape)
            found = f"{h[at]:g} m" if np.isfinite(h[at]) else "no number"
            raise InputError(f"film {found} at x = {x[at]:g} m: it must be positive everywhere")
        return h, h**-3.0

    @staticmethod
    def _integrals(a: Array, b: Array, h: Array, thicker: Any = 1.0, swollen: Any = 1.0) -> Array:
        inverse = 1.0 / h
        two, three = thicker * inverse**2, thicker * swollen * inverse**3
        return 0.5 * (b - a) * np.stack([inverse @ _WEIGHT, two @ _WEIGHT, three @ _WEIGHT])

    def lifted(self, by: complex) -> LineIntegrals:
        """Those of the film with a number added."""
        out = copy(self)
        out.known = {}
        h: Any = self.h + by
        out.parts = np.add.reduceat(self._integrals(self.ends[:-1], self.ends[1:], h), self.first[:-1], axis=1)
        out.part(None if self.spans is None else tuple(span.lifted(by) for span in self.spans))
        return out

    def part(self, spans: tuple[Any, ...] | None) -> None:
        """Let supplies part the line: the faces beside them end at their edges. Round a ring the last face is the first one."""
        self.spans = spans
        for span in spans or ():
            self.parts[:, span.faces] = span.parts
        if self.ring is not None:
            self.parts[:, -1] = self.parts[:, 0]

    def turned_back(self, x: Array) -> Array:
        """By how much places (m) lie beyond the turn of a ring that begins at its start; 0 where there is no ring."""
        return np.zeros_like(x) if self.ring is None else self.ring[1] * np.floor((x - self.ring[0]) / self.ring[1])

    @cached_property
    def looks(self) -> tuple[Array, Array]:
        """Places in every panel, its ends from within among them, and what they `carries`, shape (panels, 10)."""
        low, high = np.nextafter(self.ends[:-1], np.inf), np.nextafter(self.ends[1:], -np.inf)
        ends = self.carries(np.stack([low, high], axis=1))
        within = [ends[:, :1], self.h / self.swollen, ends[:, 1:]]
        return np.concatenate([low[:, None], self.at_gauss, high[:, None]], axis=1), np.concatenate(within, axis=1)

    @property
    def films(self) -> Array:
        """H between neighbouring points, m."""
        return self.parts[1] / self.parts[2]

    @cached_property
    def _sums(self) -> Array:
        return np.concatenate([np.zeros((3, 1)), np.cumsum(self._of_panels, axis=1)], axis=1)

    def upto(self, x: Array) -> Array:
        """The three integrals from the first point up to each x, shape (3, x.size)."""
        k = np.clip(np.searchsorted(self.ends, x, side="right") - 1, 0, self.ends.size - 1)
        a, at = self.ends[k], np.array(self._sums[:, k])
        inside = x > a  # at an end nothing is added: the film beyond is not asked for
        if inside.any():
            a, x = a[inside], x[inside]
            within = _gauss_points(a, x)
            at[:, inside] += self._integrals(a, x, self.film_at(within), *self.along_at(within))
        return at

    @property
    def interval(self) -> NDArray[np.int64]:
        """For each panel the number of the point before it."""
        return np.searchsorted(self.first, np.arange(self.ends.size - 1), side="right") - 1

    def within(self, at_gauss: Array) -> Array:
        """Integrals from the start of every panel to its Gauss points of what has these values there, shape (panels, 8)."""
        return 0.5 * np.diff(self.ends)[:, None] * (at_gauss @ _UPTO)

    def weigh(self, at_gauss: Array) -> Array:
        """Integrals over the panels of what has these values at the Gauss points, shape (panels, 8)."""
        return 0.5 * np.diff(self.ends) * (at_gauss @ _WEIGHT)


def line_integrals(grid: Grid, film: Any, checked: bool = False) -> LineIntegrals:
    """Those between all points of a line, from the place beside the first to that beside the last: a side, or round the ring.

    Every rank has all of them. checked : whether the film is known to be positive at the points.

    Raises
    ------
    InputError : a film that is not positive, at a point or between them.
    """
    if not checked:
        with np.errstate(all="ignore"):
            check_film(grid, film)
    (x,), start, length = grid.lines, grid.origin[0], grid.lengths[0]
    edges = np.array(marks_of(film))
    if not grid.periodic[0]:
        return LineIntegrals(film, np.concatenate([[start], x, [start + length]]), edges)
    points = np.concatenate([[x[-1] - length], x, [x[0] + length]])
    found = LineIntegrals(film, points, np.concatenate([edges - length, edges, edges + length]))
    found.ring = start, length
    found.part(None)
    return found


def check_film(grid: Grid, film: Callable[[Array, Array], Array]) -> None:
    """Raise InputError with the place where the film is thinnest, unless it is positive on all nodes and faces. Collective."""
    h_min, at_x, at_y = thinnest(grid, film)
    if not h_min > 0:
        where = f"x = {at_x:g}" + (f", y = {at_y:g}" if grid.dim == 2 else "")
        found = f"{h_min:g} m" if np.isfinite(h_min) else "no number"
        raise InputError(f"film {found} at {where} m: it must be positive everywhere")


def thinnest(grid: Grid, film: Callable[[Array, Array], Array]) -> tuple[float, float, float]:
    """The thinnest film on all nodes and faces, and its x and y, m. Collective."""
    x_nodes, x_faces = grid.nodes_and_faces(0)
    places = [(np.concatenate([x_nodes, x_faces]), np.zeros(1))]
    if grid.dim == 2:
        y_nodes, y_faces = grid.nodes_and_faces(1)
        places = [(x_nodes, y_nodes), (x_faces, y_nodes), (x_nodes, y_faces)]
    lowest = (np.inf, 0.0, 0.0)
    for x, y in places:
        x, y = x[None, :], y[:, None]
        h = np.broadcast_to(film(x, y), (y.size, x.size))
        h = np.where(np.isfinite(h), h, -np.inf)
        j, i = np.unravel_index(np.argmin(h), h.shape)
        lowest = min(lowest, (float(h[j, i]), float(x[0, i]), float(y[j, 0])))
    return grid.comm.allreduce(lowest, MPI.MIN)


def _gauss_points(a: Array, b: Array) -> Array:
    return (0.5 * (a + b))[:, None] + (0.5 * (b - a))[:, None] * _XI
