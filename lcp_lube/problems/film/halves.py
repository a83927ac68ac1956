"""Coefficients of half of a film that mirrors itself about the middle of its width, from the whole one's, and back."""

from functools import partial
from typing import Any

import numpy as np

from ...base.parallel import Array
from .reynolds import BoxScheme
from .strip import framed


def half(whole: BoxScheme, lines: int, on_line: bool, ring: bool) -> BoxScheme:
    """Those of the first lines, with a closed side behind them: on the last one, of which half cells are left, or past it.

    ring : the lines before the first are the last ones, which are left out.
    """
    (kx, ky, c), scheme = framed((lines, whole.h.shape[1])), whole.rows(slice(0, lines))
    kx[1:-1, 1:-2], kx[1:-1, -2], ky[1:-2, 1:-1], c[1:-1, 1:-1] = scheme.k_W, scheme.k_E[:, -1], scheme.k_S, scheme.c
    ky[-2] = 0.0
    if ring:
        ky[1] = 0.0
    if on_line:
        kx[-2], c[-2] = 0.5 * kx[-2], 0.5 * c[-2]
    return _assembled(scheme, kx, ky, c, lambda a, kept=False: _last_line(np.array(a), 0.5) if on_line and not kept else a)


def doubled(part: BoxScheme, lines: int) -> BoxScheme:
    """Those of the whole film from its half's, which ends on the middle one of an odd number of lines."""
    (kx, ky, c), n = framed((lines, part.h.shape[1])), len(part.h)

    def mirrored(a: Array, kept: bool = False) -> Array:
        own = _last_line(np.array(a), 1.0 if kept else 2.0)
        return np.concatenate([own, own[-2::-1]])

    kx[1:-1, 1:-2], kx[1:-1, -2], c[1:-1, 1:-1] = mirrored(part.k_W), mirrored(part.k_E[:, -1:])[:, 0], mirrored(part.c)
    ky[1 : n + 1, 1:-1] = part.k_S
    ky[n + 1 : -1, 1:-1] = part.k_S[::-1]
    return _assembled(part, kx, ky, c, mirrored)


def _last_line(a: Array, times: float) -> Array:
    a[-1] *= times
    return a


def _assembled(scheme: BoxScheme, kx: Array, ky: Array, c: Array, of: Any) -> BoxScheme:
    """With these conductances and c, in their frames; what else there is by `of`, a film, which is no flow, as it is kept."""
    wall = of(np.concatenate([scheme.couette_W, scheme.couette_E[:, -1:]], axis=1))
    h = of(scheme.h, True)

    def made(name: str) -> Any:
        own = vars(scheme)[name]
        if not isinstance(own, partial):
            return of(own)
        void, other, weight, U = own.args
        void = wall if void.ctypes.data == scheme.couette_W.ctypes.data else of(void, weight is not None)
        weight = None if weight is None else of(weight)
        return partial(own.func, void, of(other) if isinstance(other, np.ndarray) else other, weight, U)

    more = {name: of(getattr(scheme, name)) for name in ("storage", "kept", "gives") if getattr(scheme, name) is not None}
    k = {"k_W": kx[1:-1, 1:-2], "k_E": kx[1:-1, 2:-1], "k_S": ky[1:-2, 1:-1], "k_N": ky[2:-1, 1:-1], "c": c[1:-1, 1:-1]}
    drag = {"couette_W": wall[:, :-1], "couette_E": wall[:, 1:], "b_C": made("b_C"), "b_W": made("b_W")}
    return scheme.changed(**k, **drag, h=h, **more)
