"""The box scheme's coefficients on some lines of a grid, and those of the void, which are not stored (`reynolds`)."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from ...base.parallel import Array, once
from ..grid import Grid
from .cavity import Inlet
from .edges import Around, face_film, pairs
from .integrals import LineIntegrals

Line = tuple[Array, Array]
Faces = tuple[tuple[int, int], Array, Array | None]


def coefficients_of(
    grid: Grid,
    film: Around,
    k: float,
    U: float,
    scheme: str,
    mean_cubes: bool,
    rims: Sequence[Any],
    cavity: Array | None,
    inlet: Inlet | None,
    integrals: LineIntegrals | None,
) -> tuple[Line, Line, Line, Line]:
    """Of some lines: conductances of x and y faces, h at the points and the one before, and what the wall drags through x
    faces, each as what it is made of, one line where all are the same, and what of each line multiplies that (`put`).

    scheme : 'nodal', where the film at the faces is dragged, or as `reynolds.coefficients` has it; U : of the wall.
    inlet : of the lines (`inlets`), where they may rupture behind the west side."""
    dx, (ny, nx) = grid.steps(0), grid.box
    x_share, y_share = grid.widths(0), line_weights(grid)
    x_nodes, x_faces = grid.nodes_and_faces(0)
    x, y = x_nodes[None, 1:-1], grid.y
    period = film.period(0), film.period(1)
    h_x, h_face = (film(at[None, :], y) for at in (x_nodes, x_faces))  # one line, where all are the same

    def cubes(at_faces: Array, at_nodes: Array) -> Array:
        """h^3 at the faces, which come first to last along axis 0."""
        if not mean_cubes:
            return at_faces * at_faces * at_faces  # several times as fast as a power, and the same on any processor
        nodal = at_nodes * at_nodes * at_nodes
        return 0.5 * (nodal[:-1] + nodal[1:])

    x_jumps, y_jumps = ((), ()) if mean_cubes else map(film.edges, range(2))
    across = grid.steps(1) if grid.dim == 2 else np.ones(2)
    if integrals is not None:
        own = slice(grid.x_start, grid.x_end + 1)
        cubes_x, h_face = dx / integrals.parts[2][None, own], integrals.films[None, own]
    elif x_jumps or y_jumps:
        cubes_x, h_face = face_film(film, pairs(x_nodes), x_faces, y[:, 0], x_jumps, y_jumps, pairs(across), period[0])
    else:
        cubes_x = cubes(h_face.T, h_x.T).T
    if rims:
        from .rims import rims_across_x, rims_across_y  # here: few films have round edges

        cubes_x, h_face = rims_across_x(grid, film, rims, cavity, cubes_x, h_face, period[0])
    if inlet is not None:
        from .inlets import made_at_inlet  # here: few films rupture there

        cubes_x, h_face = made_at_inlet(film, x_nodes, y[:, 0], inlet, cubes_x, h_face)
    m = grid.stretch(y)
    k_y: Line = np.zeros((1, 1)), np.ones((1, 1))
    if grid.dim == 2:
        y_nodes, y_faces = grid.nodes_and_faces(1)
        if x_jumps or y_jumps:
            nodes, steps = pairs(y_nodes), pairs(dx)
            turned = face_film(lambda t, s: film(s, t), nodes, y_faces, x[0], y_jumps, x_jumps, steps, period[1])
            cubes_y = turned[0].T
        else:
            h_y = np.broadcast_to(film(x, y_nodes[:, None]), (ny + 2, nx)) if mean_cubes else h_x
            cubes_y = cubes(film(x, y_faces[:, None]), h_y)
        if rims:
            cubes_y = rims_across_y(grid, film, rims, cavity, cubes_y, period[1])
        arcs = k * cubes_y * (grid.spacing[0] * x_share)
        k_y = arcs, (grid.stretch(y_faces) / (grid.steps(1) * grid.spacing[1]))[:, None]
    films = h_x[:, :-1], np.ones((1, 1))
    return (k * cubes_x / dx, y_share / m), k_y, films, (films[0] if scheme == "upwind" else h_face, y_share * m * U)


def put(out: Array, parts: Line) -> None:
    """The product of the parts; what all lines share the memory of one for, once."""
    made, lines = parts
    if out.strides[0] == 0:
        made, lines, out = made[:1], lines[:1], out[:1]
    np.multiply(made, lines, out=out)


def line_weights(grid: Grid) -> Array:
    """Widths of the owned lines of cells, in mean spacings, shape (ny_local, 1); 1 in 1D."""
    return grid.widths(1)[:, None] if grid.dim == 2 else np.ones((1, 1))


def stream_weights(grid: Grid) -> Array:
    """What the wall of the owned lines carries, in parts of U h on a mean line: their widths, in a sector times the stretch."""
    return line_weights(grid) * grid.stretch(grid.y)


def room(grid: Grid, film: Around, cut: bool, kind: Any) -> tuple[list[Array], list[Array]]:
    """Room for the conductances of x and y faces and for c, with a frame of zeros, as sweeps want them (`solvers.fas.levels`);
    and for h at the points and the one before, and for what the wall drags through x faces.

    What all lines have in common takes the memory of one, of which each is a view. cut : by round edges, which lines differ in.
    """
    (ny, nx), framed, out = grid.box, [], []
    for more, beside in ((2, 3), (3, 2), (2, 2)):
        framed.append(np.empty((ny + more, nx + beside), dtype=kind))  # its inside is to be filled
        framed[-1][[0, -1]] = framed[-1][:, [0, -1]] = 0.0
    for even in (True, np.ptp(stream_weights(grid)) == 0.0):
        own = np.zeros((1 if even and film.one_line and not cut else ny, nx + 1), dtype=kind)
        out.append(own if len(own) == ny else np.ndarray((ny, nx + 1), kind, own, 0, (0, own.itemsize)))
    return framed, out


def dragged(void: Array, weight: Array | None, U: float) -> Array:
    """What goes through x faces if all is void: given as it is, or as films that are dragged."""
    return void if weight is None else (weight * U) * void


def frames(*coefficients: Array) -> tuple[Array, ...]:
    """Conductances of all x faces, of all y faces, and c, each in a frame: as `reynolds` made them, or made here.

    coefficients : k_W, k_E, k_S, k_N, c.
    """
    return tuple(in_frame(*one) if (found := frame_of(*one)) is None else found for one in faces_of(*coefficients))


def faces_of(k_W: Array, k_E: Array, k_S: Array, k_N: Array, c: Array) -> tuple[Faces, ...]:
    """Of all x faces, all y faces and c: the shape of their frame, an array, and that of what lies one face further."""
    ny, nx = k_W.shape
    return ((ny + 2, nx + 3), k_W, k_E), ((ny + 3, nx + 2), k_S, k_N), ((ny + 2, nx + 2), c, None)


def in_frame(shape: tuple[int, int], a: Array, behind: Array | None) -> Array:
    """A copy of them in a frame of zeros."""
    (ny, nx), out = a.shape, np.zeros(shape)
    if behind is not None:
        out[shape[0] - ny - 1 : -1, shape[1] - nx - 1 : -1] = behind
    out[1 : ny + 1, 1 : nx + 1] = a
    return out


def frame_of(shape: tuple[int, int], a: Array, behind: Array | None) -> Array | None:
    """The array with a frame of which they are parts; None if there is none."""
    base = a.base
    if not isinstance(base, np.ndarray) or base.shape != shape or base.dtype != float or not base.flags.c_contiguous:
        return None
    places = [base[1:, 1:], base[1:, 2:] if shape[1] > a.shape[1] + 2 else base[2:, 1:]]
    for part, place in zip((a, behind), places, strict=True):
        if part is not None and (part.ctypes.data, part.strides) != (place.ctypes.data, base.strides):
            return None
    return base


def leaving(void: Array, last: Array | None, weight: Array | None, U: float) -> Array:
    """b_C; last: through the last face, where that is closed."""
    b_C = -void[:, 1:] if weight is None else dragged(void[:, 1:], weight, -U)
    if last is not None:
        b_C[:, -1] = -last
    return b_C


def leaving_at(row: Any, i: Any, void: Array, last: Array | None, weight: Array | None, U: float) -> Array:
    """b_C of some cells."""
    inside = -dragged(void[row, i + 1], None if weight is None else weight[row, 0], U)
    return inside if last is None else np.where(i == void.shape[1] - 2, -last[row], inside)


def entering(void: Array, first: bool, weight: Array | None, U: float) -> Array:
    """b_W; first: whether anything enters the first column."""
    b_W = void[:, :-1].copy() if weight is None else dragged(void[:, :-1], weight, U)
    if not first:
        b_W[:, 0] = 0.0
    return b_W


def entering_at(row: Any, i: Any, void: Array, first: bool, weight: Array | None, U: float) -> Array:
    """b_W of some cells."""
    inside = dragged(void[row, i], None if weight is None else weight[row, 0], U)
    return inside if first else np.where(i == 0, 0.0, inside)


def by_lines(scheme: Any, name: str) -> tuple[Array, int, Array, Array]:
    """b_C or b_W for compiled loops, which make it: of an array, or the one line of all, from this column on what each line
    multiplies, and what stands in the last column of b_C, in the first one of b_W."""
    made, last = vars(scheme)[name], name == "b_C"
    if not isinstance(made, partial):
        return made, 0, np.ones(len(made)), np.ascontiguousarray(made[:, -1 if last else 0])
    void, other, weight, U = made.args
    lines = np.ones(len(void)) if weight is None else (weight * U)[:, 0]
    void = once(void)
    if last:
        return void, 1, -lines, -lines * void[:, -1] if other is None else -other
    return void, 0, lines, lines * void[:, 0] * float(other)


def most_leaving(scheme: Any) -> Array:
    """The largest |b_C| of each line, without an array of all."""
    void, shift, lines, last = by_lines(scheme, "b_C")
    inside = void[:, shift : shift + scheme.h.shape[1] - 1]
    most = np.maximum(inside.max(axis=1, initial=0.0), -inside.min(axis=1, initial=0.0))
    return np.maximum(np.abs(lines) * most, np.abs(last))
