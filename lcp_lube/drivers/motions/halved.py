"""Linearised films that are symmetric about the middle of their width, solved on half of it where what is asked is so too.

With P the symmetric extension, J of half the film is P' J P/2, the lines on the mirror having half cells: J z = b with b
symmetric is J_half u = P' b/2 with z = P u, and J' alike.
"""

from collections.abc import Callable, Sequence
from copy import copy
from functools import cached_property, partial
from typing import Any

import numpy as np

from ...base.parallel import Array
from ...problems.film.lubrication import LubricationProblem
from ...problems.film.reynolds import sides
from ...problems.grid import Grid
from ...problems.strips import STRIP
from ...problems.transfer import Pick, numbers
from ...scenes.scene import Solvable
from ..film_part import Part
from .linearised import Linear

EVEN = 1e-9  # relative difference that rounding leaves between both halves of what is symmetric


class Halved:
    """As `linearised.Linear`, of a problem whose scene is symmetric. Collective, as its methods."""

    def __init__(self, problem: LubricationProblem, cavity: Any, film: Solvable, M: Array | None = None, least: int = 0):
        grid, part = problem.grid, Part(film, "mirror")
        self.problem, self.cavity, self.M, self.least = problem, cavity, M, least
        half = self._cut(part) or part.build(grid.petsc_comm)
        self._lines: Lines | Picks = Lines(grid, half.grid) if grid.comm.size == 1 else Picks(grid, half.grid, part)
        take = self._lines.take
        self.half = half.revised(None if problem.dry is None else take(problem.dry))
        self._on_mirror = np.broadcast_to(sides(half.grid, ("mirror",))[3], half.grid.box)[:, 0]
        self.terms: list[float] = []
        of_half = None if M is None else self._shared(take(M))
        self._small = Linear(
            self.half, take(cavity.astype(float)) > 0.5 if grid.comm.size > 1 else take(cavity), M=of_half, least=least
        )

    def _cut(self, part: Part) -> LubricationProblem | None:
        """Half of the problem's own coefficients, on one rank."""
        whole, s = self.problem, self.problem.scheme
        if whole.grid.comm.size > 1 or whole.dry is not None or s.storage is not None or s.held is not None:
            return None
        half = copy(whole)
        half.grid = part.grid(whole.grid.petsc_comm)
        half.__dict__.pop("_at_sides", None)  # the whole's
        n, nx = half.grid.box
        s = s.rows(slice(0, n))
        kx, ky = np.zeros((n + 2, nx + 3)), np.zeros((n + 3, nx + 2))  # as `reynolds` makes them, which are not copied again
        k_S, k_N = ky[1 : n + 1, 1:-1], ky[2 : n + 2, 1:-1]
        k_W, k_E = kx[1:-1, 1:-2], kx[1:-1, 2:-1]
        k_S[:], k_N[-1] = s.k_S, 0.0
        k_W[:], k_E[:, -1] = s.k_W, s.k_E[:, -1]
        share = np.ones((n, 1))
        if whole.grid.shape[1] % 2:  # the line on the mirror
            kx[-2] *= 0.5
            share[-1] = 0.5
        some: dict[str, Any] = {"k_W": k_W, "k_E": k_E, "k_S": k_S, "k_N": k_N}
        some |= {name: partial(_times, share, vars(s)[name]) for name in ("b_C", "b_W")}  # whole, and mostly the first alone
        half.scheme, half.held, half.shares_grid = s.changed(**some), None, False
        return half

    @cached_property
    def _whole(self) -> Linear:
        return Linear(self.problem, self.cavity, M=self.M, least=self.least)

    def _shared(self, half: Any) -> Any:
        """Half of what a line on the mirror has, as its cells are halved."""
        out = half.copy()
        out.reshape(self.half.grid.box)[self._on_mirror] *= 0.5
        return out

    def _solved(self, ask: Callable[[Linear, list[Any], Callable[[Any], Any]], list[Any]], rows: Sequence[Any]) -> list[Any]:
        even = all(off <= EVEN * size for off, size in map(self._lines.compared, rows))
        if not even or self.half.scheme.flow_unit != self.problem.scheme.flow_unit:
            return ask(self._whole, list(rows), lambda a: a)
        found = ask(self._small, [self._shared(self._lines.take(row)) for row in rows], self._lines.take)
        return [self._lines.spread(one) for one in found]

    def solve(self, rows: Sequence[Array]) -> list[Array]:
        return self._solved(lambda linear, some, _: linear.solve(some), rows)

    def solve_transposed(self, rows: Sequence[Array], z: Array, sizes: Sequence[float] = ()) -> list[Array]:
        def ask(linear: Linear, some: list[Any], on: Callable[[Any], Any]) -> list[Any]:
            share = 1.0 if linear.problem is self.problem else 0.5
            found = linear.solve_transposed(some, on(z), [share * size for size in sizes])
            self.terms = [size / share for size in linear.terms]
            return found

        return self._solved(ask, rows)

    def at(self, nu: float, rows: Sequence[Any], stored: bool = True) -> list[Any]:
        return self._solved(lambda linear, some, _: linear.at(nu, some, stored), rows)

    def destroy(self) -> None:
        if "_whole" in self.__dict__:
            self._whole.destroy()
        for one in (self._small, self._lines, self.half):
            one.destroy()


def _times(share: Array, made: Any) -> Array:
    return np.asarray(share * (made() if callable(made) else made))


class Lines:
    """Fields on half of the lines, and on all, of one rank."""

    def __init__(self, whole: Grid, half: Grid):
        self.shape, self.size = whole.shape, half.size

    def take(self, field: Any) -> Any:
        """The half's values, no copy."""
        return field[: self.size]

    def compared(self, field: Any) -> tuple[float, float]:
        """By how much a field is another beyond the mirror, at most, and the largest value."""
        nx, ny = self.shape
        first, beyond = field.reshape(ny, nx)[: ny // 2], field.reshape(ny, nx)[::-1][: ny // 2]
        most, lines = [[0.0], [0.0]], max(1, STRIP // nx)
        for some in (slice(j, j + lines) for j in range(0, ny // 2, lines)):  # what lies between stays in the cache
            most[0].append(np.abs(first[some] - beyond[some]).max())
            most[1].append(np.abs(first[some]).max())
        return float(np.max(most[0])), float(np.max(most[1]))

    def spread(self, half: Any) -> Any:
        """The half's values on all lines."""
        nx, ny = self.shape
        whole = np.empty(ny * nx, half.dtype)
        whole[: half.size] = half
        whole[half.size :] = half.reshape(-1, nx)[: ny // 2][::-1].ravel()
        return whole

    def destroy(self) -> None:
        """Nothing to do."""


class Picks:
    """As `Lines`, dealt to several ranks. Collective, as its methods."""

    def __init__(self, whole: Grid, half: Grid, part: Part):
        j, i = numbers(half)
        self._take, self._spread = Pick(whole, half, j, i), Pick(half, whole, *part.places(whole))
        self._beyond, self._largest = Pick(whole, half, whole.shape[1] - 1 - j, i), whole.reduce.largest

    def _of(self, change: Callable[[Array], Array], a: Any) -> Any:
        return change(a.real) + 1j * change(a.imag) if np.iscomplexobj(a) else change(a)

    def take(self, field: Any) -> Any:
        return self._of(self._take, field)

    def compared(self, field: Any) -> tuple[float, float]:
        half = self.take(field)
        off = self._of(self._beyond, field) - half
        return self._largest(off.view(float)), self._largest(half.view(float))

    def spread(self, half: Any) -> Any:
        return self._of(self._spread, half)

    def destroy(self) -> None:
        for one in (self._take, self._beyond, self._spread):
            one.destroy()
