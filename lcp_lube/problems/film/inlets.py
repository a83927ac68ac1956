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
from .rims import LOOKS, before_front


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
    h = np.broadcast_to(film(places[None, :], lines[some][:, None]), (some.size, places.size)).T
    resists = before_front(np.real(h[1:]), driven * LOOKS / d)
    inverse = np.where(resists, 1.0 / h[1:], 0.0)
    resistance = np.sum(inverse**3, axis=0)
    cubes, films = (np.array(np.broadcast_to(a, shape)) for a in (cubes, films))
    cubes[some, 0] = LOOKS / resistance
    films[some, 0] = np.where(np.sum(resists, axis=0) > 1, np.sum(inverse**2, axis=0) / resistance, h[0])  # or at the side
    return cubes, films
