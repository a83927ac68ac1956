"""What flows through the sides of a film, and what drags at its wall."""

from __future__ import annotations

from copy import copy
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.compiled import has_numba
from ...base.parallel import Array, once
from ..grid import Grid
from ..strips import apart, each_strip, places_of
from .cavity import cavitated
from .edges import Around, pairs, strips
from .reynolds import BoxScheme, sides
from .strip import by_lines, line_weights, stream_weights

if TYPE_CHECKING:
    from .lubrication import LubricationProblem

SIDES = ("west", "east", "south", "north")
SAME = 1.0 + 1e-12  # of what is equal but for rounding
NEVER = 1e-9  # of a length, by which it is the one that is not chosen


def point_weights(grid: Grid) -> Array:
    """What belongs to each owned point, in mean cells: 1, and 1/2 on a mirror line; of uneven lines its cell's own size."""
    return np.broadcast_to(stream_weights(grid) * grid.widths(0), grid.box).ravel()


def volume_unit(problem: LubricationProblem) -> float:
    """Volume flow, m3/s (1D: m2/s), of one of the scheme's units: its equations have twice the volume's flows."""
    return 0.5 * problem.scheme.flow_unit * (problem.grid.spacing[1] if problem.grid.dim == 2 else 1.0)


def side_flows(problem: LubricationProblem, p: Array, r: Array) -> dict[str, float]:
    """Volume flow out of the film through each side, m3/s (1D: m2/s); their sum is zero. Collective.

    Half of the equation's terms, (U h (1 - r) - h^3/(6 mu) dp/dx)/2: one wall moves. The box scheme balances the cells around
    the points, whose outer faces stand half a spacing inside the sides: exact for west and east, where the flow of a line does
    not change on the way. Along a side y = const of constant pressure, the strip between the outer faces and the side carries
    Couette flow alone, U h (1 - r)/2 of the line of points beside it; what it loses between west and east leaves by the side.
    """
    if problem.moving is not problem:
        flow = side_flows(problem.moving, *problem.there({"p": p, "r": r}).values())
        return {**flow, "west": flow["east"], "east": flow["west"]}
    grid, s, lines = problem.grid, problem.scheme, line_weights(problem.grid)
    west, east, south, north = problem.boundary_flows(p, r)
    if grid.dim == 1:
        return {"west": -0.5 * west, "east": 0.5 * east}
    at_west, at_east, *at_ends = sides(grid)
    leaving = problem.leaving(r)
    first, last = (slice(None), slice(0, 1)), (slice(None), slice(-1, None))
    total = lambda at, flows: s.flow_unit * problem.reduce.of_some(flows, at, grid.box)  # noqa: E731
    strips = [  # enters at the west, leaves at the east
        (
            0.5 * rim * total(first, np.where(at_west[:, :1] & end, s.couette_W[:, :1] / lines, 0.0)),
            0.5 * rim * total(last, np.where(at_east[:, -1:] & end, leaving / lines, 0.0)),
        )
        for end, rim in zip(at_ends, grid.rims(1), strict=True)
    ]
    half = 0.5 * grid.spacing[1]
    return {
        "west": -half * (west + sum(enters for enters, _ in strips)),
        "east": half * (east + sum(leaves for _, leaves in strips)),
        "south": half * (strips[0][0] - strips[0][1] - south),
        "north": half * (strips[1][0] - strips[1][1] + north),
    }


def friction(problem: LubricationProblem, p_pa: Array, r: Array, lever: Array | float = 1.0) -> float:
    """Drag on the moving wall, N (1D: N/m): integral of mu U (1 - r)/h + (h/2) dp/dx, the void carrying no shear. Collective.

    By the midpoint rule over the x faces, where the box scheme knows the liquid's share of the film: it is that of the Couette
    flow, in the cavity Q/(U h_face). In 2D the strips along open sides y = const have the shear of the lines beside them, and
    no pressure term, p being constant there. The half cells at closed sides have no flow, so h^2 dp/dx = 6 mu U where full.

    Parameters
    ----------
    p_pa : pressure in Pa above the cavitation pressure, r : void fraction; owned points. lever : of each line, for a torque, m.
    """
    grid, s = problem.grid, problem.scheme
    p_pa, r = p_pa.reshape(grid.box), r.reshape(grid.box)
    alone = _alone(problem)

    def add_up(rows: slice) -> float:
        part = copy(problem)
        if alone:
            part.grid, part.scheme, part.layers = places_of(grid, rows), s.rows(rows), _rows(problem.layers, rows)
        along = lever[rows] if isinstance(lever, np.ndarray) else lever
        return float(np.sum(sum(drag(part, part.scheme, p_pa[rows].ravel(), r[rows].ravel())) * along))

    if runs(problem, problem.many):
        of_film = drag_sum(problem, *apart(p_pa), r, lever)
    else:
        of_film = sum(each_strip(grid, add_up)) if alone else add_up(slice(0, grid.box[0]))
    of_film = problem.reduce.summed(float(of_film), lambda: np.add(*drag(problem, s, p_pa.ravel(), r.ravel())) * lever)
    return of_film if problem.contact is None else of_film + problem.contact.drag(problem, lever)


def _alone(problem: LubricationProblem) -> bool:
    """Whether what happens in a line of one rank is its own business: no walls ask what is cavitated, no effects have been."""
    return problem.grid.comm.size == 1 and "closed" not in problem.grid.ends[0] and problem.plain


def runs(problem: LubricationProblem, least: int) -> bool:
    """Whether `drag_sum` knows the film, and it is so large that compiled loops pay."""
    return _alone(problem) and problem.grid.size >= least and has_numba()


def drag_sum(
    problem: LubricationProblem, p: Array, unit: float, r: Array, lever: Array | float, by: Array | None = None
) -> float:
    """The sum of `drag` times the lever, of a film that it `runs` over. p in units of `unit` Pa; by : its derivatives by p
    and r are written there."""
    from .cell_loops import loop_drag

    grid, (columns, lines, scale) = problem.grid, _shares(problem)
    first, last = sides(grid)[:2]
    beyond = np.full(p.shape[0], problem.p_sides[1] / unit) if last.any() else p[:, 0].copy()
    shears, pulls = (lines * lever).ravel(), (unit * scale * lever).ravel()

    def add_up(rows: slice) -> float:
        part, s = copy(problem), problem.scheme.rows(rows)
        part.grid, part.layers = places_of(grid, rows), _rows(problem.layers, rows)
        found = (*_east_faces(part), s.couette_E)
        # Numbers side by side: else no vector instructions are made. Most films are the same where a, b and c ask for them.
        lying = {id(one): np.ascontiguousarray(once(one)) for one in found}
        h, a, b, c, couette = (lying[id(one)] for one in found)
        fields, of_lines = (r[rows], p[rows], beyond[rows]), (columns, shears[rows], pulls[rows])
        into: Any = (None, None) if by is None else by[:, rows]
        leaving = by_lines(s, "b_C") if s.storage is None else (s.b_E, 0, np.ones(len(s.b_E)), s.b_E[:, -1].copy())
        return loop_drag(h, a, b, c, couette, leaving, *fields, *of_lines, into[0], into[1], float(grid.periodic[0]))

    total = sum(each_strip(grid, add_up))
    if first.any():
        before, half = _before_first(problem, 0.0)
        pull = half * pulls[:, None]
        total += float(np.sum(lever * columns[0] * lines * before + pull * (p[:, :1] - problem.p_sides[0] / unit)))
        if by is not None:
            by[0][:, :1] += pull
    return total


def _shares(problem: LubricationProblem) -> tuple[Array, Array, Array]:
    """What shears a face counts by the product of the first two, of its column and of its line, pressure by the third."""
    return problem.mu * problem.U * problem.grid.steps(0)[1:], *line_shares(problem.grid)


def line_shares(grid: Grid) -> tuple[Array, Array]:
    """By what the faces of a line count: what shears them, and pressure."""
    weight, rims = line_weights(grid), grid.rims(1) if grid.dim == 2 else (0.0, 0.0)
    *_, south, north = sides(grid)
    scale = weight * (grid.spacing[1] if grid.dim == 2 else 1.0)
    lines = scale * grid.stretch(grid.y) ** 2 * (1.0 + 0.5 * (rims[0] * south + rims[1] * north) / weight)
    return lines, scale


def _before_first(problem: LubricationProblem, lifted: complex) -> tuple[Array, Array]:
    """`face_drag` of the faces before the first points, as parts of the faces behind these; of the pull half the film."""
    grid = problem.grid
    before, behind = grid.steps(0)[:2]
    h, resting, moving, _ = sheared_faces(problem, grid.x[:, :1] - before / 2, lifted)
    return before / behind * (resting + 1.0 / moving), 0.5 * h


def drag(problem: LubricationProblem, scheme: BoxScheme, p_pa: Array, r: Array, lifted: complex = 0.0) -> tuple[Array, Array]:
    """What `friction` is the sum of: the parts at each point's east face, and those at the point or before it. Collective.

    Parameters
    ----------
    lifted : added to the film, of which `scheme` has the coefficients then.
    """
    grid, s = problem.grid, scheme
    before, behind = grid.steps(0)[:-1], grid.steps(0)[1:]
    p, r = p_pa.reshape(grid.box), r.reshape(grid.box)
    first, last, *_ = sides(grid)
    p_east = beside(grid, p)
    if last.any():
        p_east[:, -1] = problem.p_sides[1]
    walls = sides(grid, ("closed",))[:2]
    if walls[1].any():
        p_east[:, -1] = p[:, -1]
    east, push, _ = face_drag(np.where, linear, *_east_faces(problem, lifted), s.couette_E, s.b_E, r, p, p_east)
    if walls[1].any():  # its faces have neither
        east[:, -1] = 0.0
    own, push_own = np.zeros_like(east), np.zeros_like(east[:, :1])
    if first.any():
        own[:, :1], half = _before_first(problem, lifted)
        push_own[:] = half * (p[:, :1] - problem.p_sides[0])
    dry = cavitated(problem.reduce, p_pa, r.ravel()).reshape(grid.box) if "closed" in grid.ends[0] else None
    for at, wall, share in zip((0, -1), walls, (0.5 * before[0] / behind[0], 0.5), strict=True):
        if dry is not None and wall.any():
            own[:, at] += share * np.where(dry[:, at], 1.0 - r[:, at], 4.0) / s.h[:, at]
    columns, lines, scale = _shares(problem)
    per_row = np.broadcast_to(columns * lines, grid.box)
    for at in {0, grid.box[1] - 1}:  # there is nothing between
        own[:, at] *= per_row[:, at]
    own[:, :1] += push_own * scale
    return np.asarray(per_row * east + push * scale), own


def linear(where: Any, liquid: Any, resting: Any, moving: Any, first: Any) -> tuple[Any, Any]:
    """a and b of `sheared_faces` with c where that is less, or as much; what shears the face is then a + liquid/b."""
    layer = (liquid / first).real < SAME * (resting + liquid / moving).real
    return where(layer, 0.0, resting), where(layer, first, moving)


def layers(problem: LubricationProblem, r: Array) -> Array | None:
    """Which of its two `linear` takes at each east face: 1 the layer's, -1 the other, 0 where they are one; None: at all.

    Behind a land without pressure the layer is as thick as the thinnest strip, and stays so whatever the scene's numbers are:
    with r held it would not. Either one's derivative is the film's, if that by r is of the same one.
    """
    grid, s = problem.grid, problem.scheme
    if grid.dim == 1 or not (problem.edged and Around(problem.film, grid).jumps("y")):
        return None
    liquid = 1.0 + s.b_E * r.reshape(grid.box) / np.where(s.couette_E == 0.0, np.inf, s.couette_E)
    _, resting, moving, first = _east_faces(problem)
    chosen = linear(np.where, liquid, resting, moving, first)[1]
    return np.where(moving == first, 0, np.where(chosen == first, 1, -1)).astype(np.int8)


def held(layers: Array | None, resting: Array, moving: Array, first: Array) -> tuple[Array, Array, Array]:
    """These, but that `linear` takes what `layers` says."""
    if layers is None:
        return resting, moving, first
    return resting, np.where(layers > 0, NEVER * moving, moving), np.where(layers < 0, NEVER * first, first)


def _rows(layers: Array | None, rows: slice) -> Array | None:
    return None if layers is None else layers[rows]


def _east_faces(problem: LubricationProblem, lifted: complex = 0.0) -> tuple[Array, Array, Array, Array]:
    """`sheared_faces` of the east faces, with the layers that the problem has."""
    h, *lengths = sheared_faces(problem, problem.grid.x + problem.grid.steps(0)[1:] / 2, lifted)
    return h, *held(problem.layers, *lengths)


def face_drag(
    where: Any, linear: Any, h: Any, resting: Any, moving: Any, first: Any, couette: Any, b: Any, r: Any, p: Any, p_east: Any
) -> tuple[Any, Any, Any]:
    """Of arrays, or in `cell_loops` of one face: what shears it per mu U (1/m), the pull of the pressure (N/m), and by what
    the liquid counts in the first (m)."""
    liquid = 1.0 + b * r / where(couette == 0.0, np.inf, couette)
    a, b_liquid = linear(where, liquid, resting, moving, first)
    return a + liquid / b_liquid, 0.5 * h * (p_east - p), b_liquid


def beside(grid: Grid, p: Array) -> Array:
    """The value east of each owned point, NaN where there is none; p has the shape `grid.box`. Collective."""
    if grid.box[1] < grid.shape[0]:
        return grid.ghosted(p.ravel())[1:-1, 2:]
    out: Array = np.empty_like(p)
    out[:, :-1], out[:, -1] = p[:, 1:], p[:, 0] if grid.periodic[0] else np.nan
    return out


def sheared_faces(problem: LubricationProblem, x: Array, lifted: complex = 0.0) -> tuple[Array, Array, Array, Array]:
    """The film h of a face of each owned point, at x, m, and what shears it per mu U: the less of a + liquid/b and liquid/c, as
    a (1/m), b and c (m).

    liquid is the part of the whole film's flow that there is. Where no edge along the flow divides the cell, a = 0, b = c = h.
    In the strips on both sides of an edge a cavity carries a layer of one thickness t, or the whole film where that is thinner:
    t/h^2, and 1/h. That is linear in what flows up to a film that is full in the thinnest strip alone (c), and taken as linear
    from there to one that is full (a, b). Without liquid, which would carry the heat away, nothing shears a face.
    """
    grid, film = problem.grid, Around(problem.film, problem.grid)
    if problem.edged:
        return sheared_lines(film, x, grid.y, pairs(grid.steps(1)) if grid.dim == 2 else None, lifted)
    at, d = (lambda x: film(x, grid.y) + lifted), 1e-6 * grid.spacing[0]
    h: Any = 2.0 / (1.0 / at(x - d) + 1.0 / at(x + d))  # an edge may lie on the face
    h = np.broadcast_to(h, (grid.box[0], x.shape[1]))
    return h, np.broadcast_to(h.dtype.type(0.0), h.shape), h, h


def sheared_lines(
    film: Around, x: Array, y: Array, across: Array | None, lifted: complex = 0.0
) -> tuple[Array, Array, Array, Array]:
    """`sheared_faces` of some lines, y a column of them, with what lies before and behind each; None: of a film in 1D."""
    h: Any = np.broadcast_to(film(x, y) + lifted, (y.shape[0], x.shape[1]))
    resting, moving, first = np.broadcast_to(h.dtype.type(0.0), h.shape), h, h
    jumps = film.jumps("y") if across is not None else ()
    if across is not None and jumps:
        rows, in_strips, shares = strips(film, x[0], y[:, 0], across, jumps)
        if rows.size:
            thinnest, uneven = in_strips.min(axis=0) + lifted, np.ptp(in_strips, axis=0) > 1e-9 * in_strips.max(axis=0)
            parts = in_strips + lifted
            over = parts - thinnest  # of which the difference of both is made: they may agree in all digits
            sums = (parts, 1.0 / parts, parts**-2.0, over / parts**2, over)
            mean, full, thin, more, above = (np.sum(shares * part, axis=0) for part in sums)
            slope = np.where(uneven, mean * more / np.where(uneven, above, 1.0), full)
            h, resting, moving, first = np.array(h), np.array(resting), np.array(h), np.array(h)
            h[rows], resting[rows], moving[rows] = mean, full - slope, 1.0 / slope
            first[rows] = 1.0 / np.where(uneven, mean * thin, slope)
    return h, resting, moving, first
