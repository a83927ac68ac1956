"""How much of the gap is filled, where a picture shows it: at the faces, from what passes there, and between them."""

import numpy as np

from ..base.parallel import Array
from ..problems.film.lubrication import LubricationProblem
from ..problems.film.strip import stream_weights

NOISE = 1e-9  # of a field's scale: less is rounding and is not drawn


def ahead(problem: LubricationProblem) -> Array:
    """How far (m) from the points of a line to where the scheme knows the void: half a spacing, or 0 (scheme 'upwind').

    Of all columns, on every rank. Collective.
    """
    s, weight = problem.scheme, stream_weights(problem.grid)
    apart = np.where(s.couette_E == 0.0, 0.0, s.couette_E / weight - problem.U / s.flow_unit * s.h)
    around = problem.grid.with_neighbours(0)
    half = 0.5 * np.diff(around)
    way = (half[1:] if problem.U >= 0 else -half[:-1]) * float(np.sign(problem.U) ** 2)
    return way if problem.reduce.max(np.abs(apart)) > 0.0 else 0.0 * way


def void_at_faces(problem: LubricationProblem, r: Array, sign: Array) -> Array:
    """Void fraction at the face downstream of each owned point. Collective.

    A full cell carries couette_E, and b_C r less where there is void: their ratio is the void's share, also where the film
    jumps inside the cell and couette_E / U is not the film at the face. Between two points of the cavity nothing but the
    wall moves the liquid, so that its thickness is what passes over U, whatever the film does there.

    Parameters
    ----------
    r : void fraction at the owned points. sign : `cavity.cavity_sign` there.
    """
    grid, s = problem.grid, problem.scheme
    r, sign = r.reshape(grid.box), sign.reshape(grid.box)
    moves = np.abs(s.couette_E) > 0.0  # nothing passes a closed side or a wall at rest
    full = np.where(moves, s.couette_E, 1.0)
    void = np.where(moves, -s.b_E * r / full, r)
    way = ahead(problem)
    at, downstream = way[grid.x_start : grid.x_end], way.max() > 0.0
    h = np.broadcast_to(problem.film(grid.x + at, grid.y), grid.box)
    speed = problem.U / s.flow_unit * stream_weights(grid) * h
    layer = (s.couette_E + s.b_E * r) / np.where(moves, speed, 1.0)
    framed = grid.ghosted(sign.ravel())[1:-1]
    beyond = (framed[:, 2:] if downstream else framed[:, :-2]) if way.any() else sign
    inside = moves & (sign < 0.0) & (beyond < 0.0)
    return np.where(inside, 1.0 - np.minimum(layer, 1.0), void).ravel()
