"""Reductions over arrays that each rank holds its own part of."""

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar, cast

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from .crew import FEWEST, by_rows

Array = NDArray[np.float64]
Function = TypeVar("Function", bound=Callable[..., Any])


def overflow_is_no_warning(function: Function) -> Function:
    """The function, without NumPy's warnings about overflow and NaN: its results show both.

    Not `np.errstate` as a decorator: calls inside one another would leave NumPy's settings changed.
    """

    @wraps(function)
    def quiet(*args: Any, **kwargs: Any) -> Any:
        with np.errstate(over="ignore", invalid="ignore"):
            return function(*args, **kwargs)

    return cast(Function, quiet)


class Reduce:
    """Sums, norms and extrema of distributed arrays; every method is collective.

    Parameters
    ----------
    comm : the communicator that the arrays are spread over.
    """

    def __init__(self, comm: MPI.Comm):
        self.comm = comm

    def __deepcopy__(self, memo: dict[int, Any]) -> "Reduce":
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickled on one rank it is one rank's, else that of all."""
        return _over, (self.comm.size == 1,)

    def sum(self, a: NDArray) -> float:
        return self._total(float(np.add.reduce(a, axis=None)))  # what np.sum calls, sooner

    def summed(self, own: float, terms: Callable[[], Array]) -> float:
        """The sum of all ranks' own numbers; terms : the share of each of its points, which `drivers.tape` records."""
        return self._total(own)

    def of_some(self, values: NDArray, at: Any, box: tuple[int, int]) -> float:
        """The sum over some points: at, in an array of shape box of all."""
        return self.sum(values)

    def through(self, field: Any) -> Any:
        """What makes a field of a field, every point's of those of all: a symmetric map, or a solver with its `mat`."""
        return field

    def dot(self, a: Array, b: Array) -> float:
        return self._total(float(np.dot(a, b)))

    def norm(self, *arrays: Array) -> float:
        """Euclidean norm of the arrays laid end to end."""
        square = lambda a: float(np.dot(a, a) if a.ndim == 1 else np.einsum("ij,ij->", a, a))  # noqa: E731
        return float(np.sqrt(self._total(sum(sum(_of_parts(square, a)) for a in arrays))))

    def _total(self, own: float) -> float:
        return own if self.comm.size == 1 else self.comm.allreduce(own)

    def min(self, a: Array) -> float:
        """Smallest entry, inf where there is none; NaN if any entry is NaN (MPI.MIN alone may drop it)."""
        return self._extremum(a, np.inf, MPI.MIN)

    def max(self, a: Array) -> float:
        """Largest entry, -inf where there is none; NaN if any entry is NaN."""
        return self._extremum(a, -np.inf, MPI.MAX)

    def largest(self, a: Array) -> float:
        """Largest |entry|, as `max`, without an array of them."""
        low, high = self.extremes(a)
        return float(np.maximum(-low, high))  # NaN stays NaN

    def extremes(self, a: Array) -> tuple[float, float]:
        """`min` and `max`; large arrays are read once."""
        if not a.size:
            return self.min(a), self.max(a)
        ends = _of_parts(lambda part: (float(part.min(axis=0).min()), float(part.max(axis=0).max())), once(a))
        if self.comm.size == 1 and len(ends) == 1:
            return ends[0]
        low, high = np.transpose(ends)
        return self.min(low), self.max(high)

    def _extremum(self, a: Array, empty: float, op: MPI.Op) -> float:
        reduced = (np.minimum if op == MPI.MIN else np.maximum).reduce
        parts = _of_parts(lambda part: reduced(part, axis=None), once(a)) if a.size else [empty]
        value = float(parts[0] if len(parts) == 1 else reduced(parts))
        if self.comm.size == 1:
            return value
        bad = self.comm.allreduce(bool(np.isnan(value)), MPI.LOR)
        return float("nan") if bad else self.comm.allreduce(value, op)


def once(a: NDArray) -> NDArray:
    """The one line of an array whose lines are all in one place."""
    return a[:1] if a.ndim == 2 and a.strides[0] == 0 else a


def _of_parts(task: Callable[[NDArray], Any], a: NDArray) -> list[Any]:
    """The task's result for an array, or by several threads those for the parts of a large one."""
    return [task(a)] if a.size < FEWEST else by_rows(lambda start, end: task(a[start:end]), len(a), a.size)


def _over(one: bool) -> Reduce:
    return Reduce(MPI.COMM_SELF if one else MPI.COMM_WORLD)
