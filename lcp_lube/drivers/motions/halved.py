"""Linearised films that are symmetric about the middle of their width, solved on half of it where what is asked is so too.

With P the symmetric extension, J of half the film is P' J P/2, the lines on the mirror having half cells: J z = b with b
symmetric is J_half u = P' b/2 with z = P u, and J' alike.
"""

from collections.abc import Callable, Sequence
from copy import copy
from functools import cached_property
from typing import Any

import numpy as np

from ...base.parallel import Array
from ...problems.film.lubrication import LubricationProblem
from ...problems.film.reynolds import sides
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
        j, i = numbers(half.grid)
        self._take, self._spread = Pick(grid, half.grid, j, i), Pick(half.grid, grid, *part.places(grid))
        self._beyond = Pick(grid, half.grid, grid.shape[1] - 1 - j, i)
        self.half = half.revised(None if problem.dry is None else self._take(problem.dry))
        self._share = np.broadcast_to(np.where(sides(half.grid, ("mirror",))[3], 0.5, 1.0), half.grid.box).ravel()
        of_half = None if M is None else self._share * self._take(M)
        self._small = Linear(self.half, self._take(cavity.astype(float)) > 0.5, M=of_half, least=least)

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
        some |= {"b_C": lambda: share * s.b_C, "b_W": lambda: share * s.b_W}  # whole, and mostly the first alone
        half.scheme, half.held, half.shares_grid = s.changed(**some), None, False
        return half

    @cached_property
    def _whole(self) -> Linear:
        return Linear(self.problem, self.cavity, M=self.M, least=self.least)

    def _of(self, change: Callable[[Array], Array], a: Any) -> Any:
        return change(a.real) + 1j * change(a.imag) if np.iscomplexobj(a) else change(a)

    def _solved(self, ask: Callable[[Linear, list[Any], Callable[[Any], Any]], list[Any]], rows: Sequence[Any]) -> list[Any]:
        halves = [self._of(self._take, b) for b in rows]
        largest = lambda a: self.problem.reduce.largest(a.view(float))  # noqa: E731
        even = all(
            largest(self._of(self._beyond, b) - half) <= EVEN * largest(half) for b, half in zip(rows, halves, strict=True)
        )
        if not even or self.half.scheme.flow_unit != self.problem.scheme.flow_unit:
            return ask(self._whole, list(rows), lambda a: a)
        found = ask(self._small, [self._share * half for half in halves], self._take)
        return [self._of(self._spread, one) for one in found]

    def solve(self, rows: Sequence[Array]) -> list[Array]:
        return self._solved(lambda linear, some, _: linear.solve(some), rows)

    def solve_transposed(self, rows: Sequence[Array], z: Array, sizes: Sequence[float] = ()) -> list[Array]:
        def ask(linear: Linear, some: list[Any], on: Callable[[Any], Any]) -> list[Any]:
            share = 1.0 if linear.problem is self.problem else 0.5
            return linear.solve_transposed(some, on(z), [share * size for size in sizes])

        return self._solved(ask, rows)

    def at(self, nu: float, rows: Sequence[Any], stored: bool = True) -> list[Any]:
        return self._solved(lambda linear, some, _: linear.at(nu, some, stored), rows)

    def destroy(self) -> None:
        if "_whole" in self.__dict__:
            self._whole.destroy()
        for one in (self._small, self._take, self._beyond, self._spread, self.half):
            one.destroy()
