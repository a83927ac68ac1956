"""A film's Jacobian factored without subtraction: right are also pressures that hang on 1e-16 of the flows beside them."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...base.compiled import has_numba
from ...base.elimination import Elimination
from ...base.parallel import Array
from ..grid import Grid

if TYPE_CHECKING:
    from .lubrication import LubricationProblem

WORK = {True: 4e8, False: 2e5}  # multiplications of a factorisation, compiled or not: some 0.3 s
UNIT = 2.0**-53
LONG = np.longdouble  # what is left of a balance is summed in it: pressures beside ones 1e9 times theirs have signs, too
REFINEMENTS = 10  # at most: each gains several digits, or ends them
HALVES = 200  # steps of half the wrong cells that may fail to make fewer of them
PATIENCE = HALVES + 250  # and of all of them before: what is wrong on a ring may have to go round it many times


def within_reach(grid: Grid) -> bool:
    """Whether a factorisation is a matter of less than a second, and its band one of 100 MB."""
    return grid.size * _bands(grid)[1] ** 2 <= WORK[has_numba()]


class GradedJacobian:
    """J of G(z) = A max(z, 0) + B s max(-z, 0) - c: the columns of A for full cells, those of -B for the others. Collective.

    Every rank has the whole of it: it is for small films.

    Parameters
    ----------
    full : of this rank's points.
    """

    def __init__(self, problem: "LubricationProblem", full: NDArray[np.bool_]):
        s, self.grid = problem.scheme, problem.grid
        self._at, b = _order(self.grid)
        k_W, k_E, k_S, k_N, b_C, theta = whole(self.grid, s.k_W, s.k_E, s.k_S, s.k_N, s.b_C, full.astype(float))
        W, E, S, N, b_W = whole(self.grid, *s.coupling, s.entering)  # what a cell takes from its neighbours
        is_full, none = theta > 0, np.zeros_like(b_C)
        handed, loss = np.zeros((self.grid.size, 2 * b + 1)), np.zeros(self.grid.size)
        round_x, round_y = (*self.grid.periodic, False)[:2]
        # What a cell gives to the west the cell there gets from its east, and so on. Void goes to the east alone.
        for k, beside_k, carried, beside_b, axis, step, around in (
            (k_W, E, none, none, 1, -1, round_x),
            (k_E, W, -b_C, b_W, 1, 1, round_x),
            (k_S, N, none, none, 0, -1, round_y),
            (k_N, S, none, none, 0, 1, round_y),
        ):
            inside: NDArray[np.bool_] = np.ones(theta.shape, dtype=bool)
            if not around:
                np.moveaxis(inside, axis, 0)[0 if step < 0 else -1] = False
            given = np.where(is_full, k, carried)
            taken = np.where(inside, np.where(is_full, np.roll(beside_k, -step, axis), np.roll(beside_b, -step, axis)), 0.0)
            apart = np.roll(self._at, -step, axis) - self._at
            np.add.at(handed, (self._at[inside], apart[inside] + b), taken[inside])
            loss[self._at.ravel()] += np.maximum(given - taken, 0.0).ravel()
        self._factors = Elimination(handed, loss)

    @property
    def singular(self) -> bool:
        return self._factors.singular >= 0

    def solve(self, f: Array) -> Array:
        """y with J y = f, of this rank's points. Collective."""
        (flow,), grid = whole(self.grid, f), self.grid
        ordered = np.empty(grid.size)
        ordered[self._at] = flow
        y = self._factors.solve(ordered)[self._at]
        return y[grid.y_start : grid.y_end, grid.x_start : grid.x_end].ravel()


class Pivots:
    """Principal pivoting on the full cells (Judice and Pires; Murty), its systems solved without subtraction.

    Every blend of A's and -B's columns is an M-matrix, so exactly one set of full cells has p >= 0 in it and r >= 0 outside.
    All cells of the wrong sign change sides at once, until a set of full cells comes twice; then half of the wrong ones by
    chance, and at last the last one alone, and of such steps no set comes twice. On closed and periodic lines, where a blend
    may be singular, that is no proof. Collective.

    Parameters
    ----------
    noisy : what the wall drags is known to one rounding, and a pressure whose sign hangs on that is none that is wrong: with
        what the rounding makes of it, it is the answer to data that are as good (`noise`).

    Attributes
    ----------
    p, r : complementary but for signs; wrong : number of cells whose sign is wrong, beyond rounding of what flows there.
    noise : pressures that one rounding of the wall's flow makes in the full cells of the last step, if `noisy`; else 0.
    """

    def __init__(self, problem: "LubricationProblem", p: Array, r: Array, noisy: bool = False):
        s, self.problem, self._noisy, self.noise = problem.scheme, problem, noisy, np.zeros_like(p)
        self._a, self._b = s.diagonal.ravel(), -s.b_C.ravel()
        self.full = self._a * p >= self._b * r
        self.p, self.r = np.maximum(p, 0.0), np.maximum(r, 0.0)
        self._driven = problem.reduce.norm(problem.c) > 0  # or else all is zero, and signs are rounding
        self._fewest, self._patience = np.inf, PATIENCE
        self._seen: set[float] = set()  # a number for every set of full cells
        self._part()

    def step(self) -> float:
        """Solve for the present full cells, and let the wrong ones change sides; returns the change in p. Collective.

        Raises
        ------
        ZeroDivisionError : a part of the film has no way out, whatever the reason.
        """
        reduce, before = self.problem.reduce, self.p
        jacobian = GradedJacobian(self.problem, self.full)
        if jacobian.singular:
            raise ZeroDivisionError("a part of the film has no way out")
        last, unit = np.inf, float(np.finfo(LONG).eps) / 2
        p, r = self.p.astype(LONG), self.r.astype(LONG)
        for _ in range(REFINEMENTS):
            y = jacobian.solve(-self.problem.balance(p, r).astype(float))
            p, r = p + np.where(self.full, y, 0.0), r - np.where(self.full, 0.0, y)
            pairs = ((np.where(self.full, y, 0.0), p.astype(float)), (np.where(self.full, 0.0, y), r.astype(float)))
            size = max(reduce.max(np.abs(moved)) / (reduce.max(np.abs(whole)) or 1.0) for moved, whole in pairs)
            if size <= unit or not size < 0.5 * last:  # done, or rounding, or NaN
                break
            last = size
        p_max, self.wrong = reduce.max(np.abs(p.astype(float))), 0
        if self._noisy:
            self.noise = np.where(self.full, jacobian.solve(self._rounded()), 0.0)
        for least in (UNIT, unit) if self._driven else ():  # what is surely wrong, and only then what may be
            bad = np.where(self.full, p < -np.maximum(8 * least * p_max, self.noise), r < -8 * least)
            self.wrong = int(reduce.sum(bad.astype(float)))
            if self.wrong:
                break
        self.p, self.r = (np.maximum(a, 0.0).astype(float) for a in (p, r))
        if self.wrong:
            if self.wrong < self._fewest:
                self._fewest, self._patience = self.wrong, PATIENCE
            else:
                self._patience -= 1
            numbers = self.problem.grid.first + np.arange(bad.size)
            if (this := reduce.sum(np.where(self.full, np.sin(numbers), 0.0))) in self._seen:
                self._patience = min(self._patience, HALVES)
            self._seen.add(this)
            number = np.where(bad, numbers, -1)
            if self._patience <= 0:
                bad = number == reduce.max(number.astype(float))
            elif self._patience <= HALVES:
                chance = np.random.default_rng(self._patience).random(self.problem.size)
                bad &= chance[np.maximum(number, 0)] < 0.5
            self.full = self.full ^ bad
            self._part()
        return reduce.max(np.abs(self.p - before))

    def _rounded(self) -> Array:
        """What one rounding of all that the wall drags through a cell's faces, oil and void, adds up to."""
        scheme, void = self.problem.scheme, ~self.full * 1.0
        from_west = self.problem.grid.ghosted(void, outside=0.0)[1:-1, :-2]
        carried = self._b * void + (scheme.entering * from_west).ravel()
        return 4 * UNIT * (2 * carried + (np.abs(scheme.couette_W) + np.abs(scheme.couette_E)).ravel())

    def _part(self) -> None:
        """No void in the full cells, no pressure in the others.

        A ring that is empty all round, which no steady film is and whose matrix is singular, is full where it is least empty.
        """
        grid = self.problem.grid
        if grid.periodic[0] and self.problem.scheme.storage is None:
            full, void = whole(grid, self.full.astype(float), self.r)
            empty = np.flatnonzero(~(full > 0).any(axis=1))
            full[empty, np.argmin(void[empty], axis=1)] = 1.0
            self.full = (full > 0)[grid.y_start : grid.y_end, grid.x_start : grid.x_end].ravel()
        self.p, self.r = np.where(self.full, self.p, 0.0), np.where(self.full, 0.0, self.r)


def whole(grid: Grid, *fields: Array) -> list[Array]:
    """Fields of this rank's points as those of the whole grid, of shape (ny, nx), on every rank. Collective."""
    boxes = [np.reshape(field, grid.box) for field in fields]
    if grid.comm.size == 1:
        return boxes
    out = [np.empty((*grid.shape, 1)[1::-1]) for _ in fields]
    own = (slice(grid.y_start, grid.y_end), slice(grid.x_start, grid.x_end))
    for place, parts in grid.comm.allgather((own, boxes)):
        for field, part in zip(out, parts, strict=True):
            field[place] = part
    return out


def _order(grid: Grid) -> tuple[NDArray[np.int64], int]:
    """Each point's place in the elimination, shape (ny, nx), and the band that this makes: lines across the shorter way."""
    (nx, ny), (round_x, round_y) = (*grid.shape, 1)[:2], (*grid.periodic, False)[:2]
    x, y, (by_lines, band) = _places(nx, round_x), _places(ny, round_y), _bands(grid)
    return y[:, None] * nx + x if by_lines else x * ny + y[:, None], band


def _bands(grid: Grid) -> tuple[bool, int]:
    """Whether lines along the flow, one after the other, make the narrower band; and that band."""
    (nx, ny), (round_x, round_y) = (*grid.shape, 1)[:2], (*grid.periodic, False)[:2]
    along, across = _band(nx, round_x, ny, round_y), _band(ny, round_y, nx, round_x)
    return along <= across, min(along, across)


def _places(n: int, around: bool) -> NDArray[np.int64]:
    """0, 1, 2 ... along a line; round a ring 0, 2, 4 ... 3, 1, so that neighbours are two apart at most."""
    m = np.arange(n)
    return np.where(2 * m < n, 2 * m, 2 * (n - m) - 1) if around else m


def _band(fast: int, fast_around: bool, slow: int, slow_around: bool) -> int:
    return max((1 + slow_around) * fast if slow > 1 else 0, (1 + fast_around) if fast > 1 else 0)
