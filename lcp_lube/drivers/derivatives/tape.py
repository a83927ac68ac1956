"""What in an evaluation every point has of all others, set apart from what it has of its neighbours.

A film's equations with effects are of a stencil's points but for a few steps: sums and extrema over the film, and fields that
are solved for or convolved, as heat that flows and half spaces. The evaluation asks its `Reduce` for these; a `Tape` in its
place gives what they were the first time, whatever has changed since, and keeps what they would have been made of now: with
these values g beside the fields as inputs, and that beside the equations as outputs, all derivatives are local.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.parallel import Array, Reduce

TIE = 1e-9  # relative: points so near the largest one share its part


class Tape(Reduce):
    """Of evaluations of one state and of others near it, which ask for the same in the same order. Collective.

    Attributes
    ----------
    known : by place in the order what was given the first time, and is again; to be changed for derivatives by it.
    back : transposes of the maps that make a field of what it is made of, None for sums.
    first : whether it is the first evaluation.
    made : of the last evaluation, what each of them is made of at the owned points; None where that is not known.
    """

    def __init__(self, reduce: Reduce, size: int):
        super().__init__(reduce.comm)
        self.size = size
        self.known: list[Any] = []
        self.back: list[Callable[[Array], Array] | None] = []
        self.made: list[Array | None] = []
        self.first = True
        self._chosen: dict[int, tuple[Array, float]] = {}
        self._kept: list[Any] = []

    def _next(self, value: Callable[[], Any], made: Array | None, back: Any = None) -> Any:
        if self.first:
            self.known.append(value())
            self.back.append(back)
        self.made.append(made)
        return self.known[len(self.made) - 1]

    def _points(self, a: NDArray) -> Array | None:
        return np.asarray(a, dtype=float).ravel() if a.size == self.size else None

    def sum(self, a: NDArray) -> float:
        return float(self._next(lambda: super(Tape, self).sum(a), self._points(a)))

    def dot(self, a: Array, b: Array) -> float:
        return float(self._next(lambda: super(Tape, self).dot(a, b), self._points(a * b)))

    def summed(self, own: float, terms: Callable[[], Array]) -> float:
        return float(self._next(lambda: super(Tape, self).summed(own, terms), self._points(terms())))

    def of_some(self, values: NDArray, at: Any, box: tuple[int, int]) -> float:
        whole = np.zeros(box)
        whole[at] = values
        return self.sum(whole)

    def norm(self, *arrays: Array) -> float:
        return float(self._next(lambda: super(Tape, self).norm(*arrays), None))

    def min(self, a: Array) -> float:
        return -self.max(-a)

    def max(self, a: Array) -> float:
        """That of the points that have it the first time."""
        place = len(self.made)
        if self.first:
            largest = super().max(a)
            mine = np.ravel(a >= largest - TIE * abs(largest))
            self._chosen[place] = mine / max(self.comm.allreduce(int(mine.sum())), 1), largest
        share, largest = self._chosen[place]
        with np.errstate(invalid="ignore"):
            made = None if a.size != self.size else np.where(share > 0.0, share * np.ravel(a), 0.0)
        return float(self._next(lambda: largest, made))

    def through(self, field: Any) -> Any:
        if not hasattr(field, "mat"):  # symmetric
            return lambda a: self._next(lambda: field(a), a, field)
        if self.first:
            self._kept.append(field.copy())
        kept = self._kept[-1]

        def solved(heat: Array) -> tuple[Array, float]:
            """By the equations mat T = heat: how far they are from holding, T held."""
            x, b = field.mat.createVecs()
            T = self._next(lambda: field(heat)[0], None, lambda w: -kept(w, transposed=True)[0])
            x.setArray(T)
            field.mat.mult(x, b)
            self.made[-1] = b.array_r - heat
            for obj in (x, b):
                obj.destroy()
            return T, 0.0

        return solved

    def destroy(self) -> None:
        for solver in self._kept:
            solver.destroy()
