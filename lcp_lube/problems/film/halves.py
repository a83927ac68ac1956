"""Films that mirror themselves about the middle of their width: a scheme's half, and the whole's from a half's."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import as_strided

from ...base.parallel import Array
from .strip import faces_of, frame_of, frames, in_frame


class Lent:
    """Parts of memory that have other values while somebody else uses it: from `take` to `give_back`.

    Parameters
    ----------
    changes : places, and what stands there then. None: nothing is lent.
    scheme : what its user makes of it, if anything.
    """

    def __init__(self, changes: Sequence[tuple[Array, Any]] = (), scheme: Any = None):
        self.scheme = scheme
        self._places, self._values = [place for place, _ in changes], [value for _, value in changes]
        self._taken = False

    def take(self) -> None:
        """From here on it is the other's."""
        self._swap(not self._taken)

    def give_back(self) -> None:
        """From here on it is its owner's."""
        self._swap(self._taken)

    @contextmanager
    def returned(self) -> Iterator[None]:
        """It is its owner's in between."""
        taken = self._taken
        self._swap(taken)
        yield
        self._swap(taken)

    def _swap(self, change: bool) -> None:
        if change:
            kept = [np.array(place) for place in self._places]
            for place, value in zip(self._places, self._values, strict=True):
                place[:] = value
            self._values, self._taken = kept, not self._taken


def half(whole: Any, lines: int, on_line: bool, ring: bool) -> Lent:
    """A scheme's first lines, with a closed side behind them: on the last one, of which half cells are left, or past it.

    They lie in the whole's own memory, in which a few lines differ: those are to be taken before the half is used. (A strided
    view is the base of its own views, as `strip.frame_of` looks for it.)

    Parameters
    ----------
    lines : so many. ring : the lines before the first are the last ones, which are left out.
    """
    some = whole.rows(slice(0, lines))
    given, own = (faces_of(one.k_W, one.k_E, one.k_S, one.k_N, one.c) for one in (whole, some))
    found = [frame_of(*one) for one in given]  # none of some in films with supplies, and in time
    kx, ky, c = (in_frame(*one) if a is None else as_strided(a, one[0]) for a, one in zip(found, own, strict=True))
    changes: list[tuple[Array, Any]] = [(ky[lines + 1 : lines + 3], 0.0), (kx[lines + 1], 0.0), (c[lines + 1], 0.0)]
    if ring:
        changes.append((ky[1], 0.0))
    if on_line:
        changes += [(kx[lines], 0.5 * kx[lines]), (c[lines], 0.5 * c[lines])]
    share = np.ones((lines, 1))
    share[-1] = 0.5
    return Lent(changes, some.changed(**_inside(kx, ky, c), **(_shared(some, share) if on_line else {})))


def _inside(kx: Array, ky: Array, c: Array) -> dict[str, Array]:
    """What stands in these frames."""
    k = {"k_W": kx[1:-1, 1:-2], "k_E": kx[1:-1, 2:-1], "k_S": ky[1:-2, 1:-1], "k_N": ky[2:-1, 1:-1]}
    return k | {"c": c[1:-1, 1:-1]}


def _shared(scheme: Any, share: Array) -> dict[str, Any]:
    """What else is a flow, in parts that differ from line to line; of arrays as large as the film none is made before it is
    asked for."""

    def made(name: str) -> Any:
        own = vars(scheme)[name]
        if not isinstance(own, partial):
            return own * share
        void, other, weight, U = own.args
        other = share[:, 0] * other if isinstance(other, np.ndarray) else other
        weight, U = (share, 1.0) if weight is None else (weight * share, U)
        return partial(own.func, void, other, weight, U)

    walls = {name: partial(np.multiply, getattr(scheme, name), share) for name in ("couette_W", "couette_E")}
    stored = {name: a * share for name in ("storage", "kept", "gives") if (a := getattr(scheme, name)) is not None}
    return walls | stored | {name: made(name) for name in ("b_C", "b_W")}


def doubled(part: Any) -> Any:
    """The whole film's scheme from its half's, which ends on the middle one of an odd number of lines."""

    def mirrored(a: Array, times: float = 2.0) -> Array:
        own = np.array(a)
        own[-1] *= times
        return np.concatenate([own, own[-2::-1]])

    across = np.concatenate([part.k_S, part.k_S[::-1]])
    k_W, k_E, c = (mirrored(a) for a in (part.k_W, part.k_E, part.c))
    wall = mirrored(np.concatenate([part.couette_W, part.couette_E[:, -1:]], axis=1))

    def made(name: str) -> Any:
        own = vars(part)[name]
        if not isinstance(own, partial):
            return mirrored(own)
        void, other, weight, U = own.args
        void = wall if void.ctypes.data == part.couette_W.ctypes.data else mirrored(void, 2.0 if weight is None else 1.0)
        weight = None if weight is None else mirrored(weight)
        return partial(own.func, void, mirrored(other) if isinstance(other, np.ndarray) else other, weight, U)

    drag = {"couette_W": wall[:, :-1], "couette_E": wall[:, 1:], "b_C": made("b_C"), "b_W": made("b_W")}
    inside = _inside(*frames(k_W, k_E, across[:-1], across[1:], c))
    return part.changed(**inside, **drag, h=mirrored(part.h, 1.0))
