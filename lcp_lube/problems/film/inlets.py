"""The first faces of a film that ruptures at the side it comes in by, or in its first cell.

There a full film has one flow up to a place x where p = 0, Q(x) = (p_west/(6 mu U) + Int h^-2)/Int h^-3, and the front is
where that is least: at a side without pressure that the film opens from, what enters is what the film at the side carries. A
face with the film half-way to the first points lets in more, an error of first order. As in domes (`rims`) the answer tells
where, and the film is solved once more with faces made for it: positive conductances and Couette flows of one form, so that
its solution is unique, certificate and bands hold as ever (docs/accuracy.md).
"""

from collections.abc import Callable

import numpy as np

from ...base.parallel import Array
from .cavity import Inlet

LOOKS = 32  # between the side and the first points
SAME = 1e-9  # of a flow: least flows that differ by less are one


def made_at_inlet(
    film: Callable[[Array, Array], Array], nodes: Array, lines: Array, inlet: Inlet, cubes: Array, films: Array
) -> tuple[Array, Array]:
    """C and H of all x faces, the first ones of these lines up to their fronts.

    Parameters
    ----------
    nodes : x of the side and of the first points, m. lines : y of the lines, m. inlet : of these lines.
    cubes, films : C and H, shape (lines, faces) or what broadcasts to it.
    """
    rows, driven = inlet
    if not rows.any():
        return cubes, films
    shape, some = (lines.size, cubes.shape[1]), np.flatnonzero(rows)
    start, d = nodes[0], nodes[1] - nodes[0]
    places = start + d * np.append(0.0, (np.arange(LOOKS) + 0.5) / LOOKS)
    h = np.broadcast_to(film(places[None, :], lines[some][:, None]), (some.size, places.size))
    inverse = 1.0 / h[:, 1:]
    drag, resistance = np.cumsum(inverse**2, axis=1), np.cumsum(inverse**3, axis=1)
    flow = np.real((driven * LOOKS / d + drag) / resistance)
    last = LOOKS - 1 - np.argmax((flow <= (1.0 + SAME) * flow.min(axis=1, keepdims=True))[:, ::-1], axis=1)  # of equals
    at = np.arange(some.size), last
    cubes, films = (np.array(np.broadcast_to(a, shape)) for a in (cubes, films))
    cubes[some, 0] = LOOKS / resistance[at]
    films[some, 0] = np.where(last > 0, drag[at] / resistance[at], h[:, 0])
    return cubes, films
