"""Where the fronts of the cavity lie, from the discrete fields."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...base.parallel import Array
from ..grid import Grid
from ..strips import each_strip, ghosted, places_of
from .edges import jumps_of
from .reynolds import Film, sides
from .strip import line_weights, stream_weights

if TYPE_CHECKING:
    from .lubrication import LubricationProblem

MANY = 200  # places that are looked for together
NEAR, ON_EDGE = 1e-13, 4e-12  # parts of the distances from x = 0, so near a place is to be known, and one at a jump
SECANTS = 4  # looks at the film by which its place is foreseen


def counted(problem: LubricationProblem, p_pa: Any, r: Array) -> Any:
    """The pressure as integrals count it, `borne` where they know fronts. Collective."""
    if not problem.cornered:
        return p_pa
    from .borne import borne  # here: few films have corners

    return borne(problem, p_pa, r)


@dataclass(frozen=True)
class Fronts:
    """Ends of the cavities along the flow, in all lines of this rank's points.

    Attributes
    ----------
    ruptures, reformations : numbers of the rank's lines and of the rank's points behind the front (the number of these at the
        east side), and x, m. shift : by how much longer the cavities of each line are than the cells of their points, m, shape
        (ny_local,).
    """

    ruptures: tuple[NDArray[np.int64], NDArray[np.int64], Array]
    reformations: tuple[NDArray[np.int64], NDArray[np.int64], Array]
    shift: Array


def line_fronts(problem: LubricationProblem, p: Array, r: Array, dry: NDArray[np.bool_]) -> Fronts:
    """Where cavities begin and end along the flow, placed inside the cells in which they do. Collective.

    Rupture: where U h = Q, Q being the flow along the line (p = p' = 0 there; in 1D the one flow of the discrete solution, in
    2D what leaves the first cell of the cavity), within the cell or one beside it: the discrete front may be late. Reformation:
    the face between cavity and full film lacks the flow U h r + k p of a full one, k p if the film were full from the last
    point of the cavity on; begun a part k p/(k p + U h r) of the way upstream the film presses back as much. dry : where the
    film is `cavitated`.
    """
    grid, film, s = problem.grid, problem.film, problem.scheme
    start, steps = grid.origin[0], grid.steps(0)
    behind, ahead = steps[:-1], steps[1:]
    framed, opens = ghosted(grid, dry, 0.0), [kind == "open" for kind in grid.ends[0]]
    if grid.dim == 1 and opens[0]:
        Q = problem.boundary_flows(p, r)[0]

    def turns(rows: slice) -> tuple[NDArray, ...]:
        cavity = framed(rows)[1:-1].astype(bool, copy=False)
        if grid.x_start == 0 and opens[0]:
            cavity[:, 0] = problem.r_in > 0
        (begun, here), (ceased, there) = _turns(cavity[:, :-2], cavity[:, 1:-1])
        return begun + rows.start, here, ceased + rows.start, there

    *begins, ended, there = (np.concatenate(parts) for parts in zip(*each_strip(grid, turns), strict=True))
    row, i = begins
    if not (grid.dim == 1 and opens[0]):
        Q = s.flow_unit * (s.couette_E[row, i] + s.b_E_at(row, i) * r.reshape(grid.box)[row, i]) / stream_weights(grid)[row, 0]
    x, y = grid.x[0], grid.y[:, 0]
    before = (x - 2.0 * behind)[i]
    before = before if grid.periodic[0] else np.maximum(before, start)
    ruptures = _rises_through(film, np.broadcast_to(Q, i.shape) / problem.U, before, (x + ahead)[i], y[row])
    shift = np.zeros(grid.box[0])
    np.add.at(shift, row, (x - 0.5 * behind)[i] - ruptures)
    starts = row, i, ruptures
    row, i = ended, there
    pressed = s.k_W[row, i] * p.reshape(grid.box)[row, i]
    whole = grid.box[1] == grid.shape[0]  # nothing enters the first point of a whole line that is open
    lacking = s.b_W_at(row, i) * (r.reshape(grid.box)[row, i - 1] if whole else grid.ghosted(r, outside=0.0)[row + 1, i])
    known = pressed + lacking > 0.0
    back = np.where(known & (lacking > 0.0), pressed / np.where(known, pressed + lacking, 1.0), 0.5)
    np.add.at(shift, row, ((0.5 - back) * behind[i]))
    closes, ends, places = row, i, (x[i] - back * behind[i])
    if grid.x_end == grid.shape[0] and opens[1]:
        row = np.flatnonzero(dry.reshape(grid.box)[:, -1])
        if problem.p_sides[1] > 0:  # before a side above the cavitation pressure: it is the full point
            pressed = s.k_E[row, -1] * (problem.p_sides[1] / problem.p_unit)
            lacking = -s.b_E_at(row, grid.box[1] - 1) * r.reshape(grid.box)[row, -1]
            back = np.where(lacking > 0.0, pressed / (pressed + lacking), 0.5)
            closes, ends = np.append(closes, row), np.append(ends, np.full(row.size, x.size))
            places = np.append(places, start + grid.lengths[0] - back * steps[-1])
            shift[row] += (0.5 - back) * steps[-1]
        else:
            shift[row] += 0.5 * steps[-1]
    return Fronts(starts, (closes, ends, places), shift)


Places = tuple[NDArray[np.int64], NDArray[np.int64]]


def _turns(before: NDArray[np.bool_], here: NDArray[np.bool_]) -> tuple[Places, Places]:
    """Rows and columns where a matrix is true and the one before it is not, and where it is the other way round."""
    row, i = np.divmod(np.flatnonzero(before != here), here.shape[1])  # several times as fast as `numpy.nonzero`
    on = here[row, i]
    return (row[on], i[on]), (row[~on], i[~on])


def fronts(problem: LubricationProblem, found: Fronts | None) -> tuple[list[float], list[float]]:
    """x of all ruptures and of all reformations, m, in ascending order, in 2D along `middle_row`. Collective.

    A cavity that begins with the void that enters at the west has no rupture. found : `line_fronts`; None: the film is at rest,
    and does not cavitate.
    """
    if found is None:
        return [], []
    grid = problem.grid
    start, L = grid.origin[0], grid.lengths[0]
    here = middle_row(problem) - grid.y_start
    own = [places[rows == here].tolist() for rows, _, places in (found.ruptures, found.reformations)]
    parts = grid.comm.allgather(own)
    all_of = ([place for part in parts for place in part[k]] for k in (0, 1))
    if grid.periodic[0]:
        all_of = ([start + (place - start) % L for place in places] for places in all_of)
    first, second = (sorted(places) for places in all_of)
    return first, second


def cavitated_area(problem: LubricationProblem, found: Fronts | None, p: Array, dry: NDArray[np.bool_]) -> float:
    """Area of the cavities, m2 (1D: length, m): cells of their points, and what lies between these and the fronts. Collective.

    Across the flow a front lies where the pressure beside it, followed by its slope, is zero; beside a side as `before_side`
    says. dry : as in `line_fronts`.
    """
    grid = problem.grid
    cavity = dry.reshape(grid.box)
    frames = [ghosted(grid, field, 0.0) for field in (cavity, p)] if found is not None and grid.dim == 2 else []

    def add_up(rows: slice) -> tuple[float, float]:
        part = places_of(grid, rows)
        area, more = float(np.einsum("i,ij->j", stream_weights(part)[:, 0], cavity[rows].astype(float)) @ part.widths(0)), 0.0
        if found is None:
            return area, more
        stretch, dy = part.stretch(part.y), grid.spacing[1] if grid.dim == 2 else 1.0
        more += float(np.sum(found.shift[rows, None] * line_weights(part) * stretch)) * dy
        if grid.dim == 2:
            width, steps = part.widths(0) * grid.spacing[0], part.steps(1)[:, None]
            fronts_across = _across(frames[0](rows), frames[1](rows), steps)
            for (j, i, back), step in zip(fronts_across, (steps[:-1, 0], steps[1:, 0]), strict=True):
                more += float(np.sum((0.5 * step[j] - back) * width[i] * stretch[j, 0]))
            for side, (end, rim) in enumerate(zip(sides(part)[2:], grid.rims(1), strict=True)):
                if (line := np.flatnonzero(end)).size:
                    up_to = 0.5 - before_side(problem, side)
                    more += float(np.sum(up_to * rim * dy * width * stretch[line] * cavity[rows][line]))
        return area, more

    area, more = (sum(parts) for parts in zip(*each_strip(grid, add_up), strict=True))
    area, more = (problem.reduce.sum(np.array([part])) for part in (area * grid.cell, more))
    return area if found is None else max(area + more, 0.0)  # of a cavity of one point the two fronts may cross


def before_side(problem: LubricationProblem, side: int) -> Array:
    """How far the front before an open side across the flow (0 south, 1 north) lies from it where the line of points beside it
    is cavitated, in parts of their distance.

    From the side on p falls to p = p' = 0 with p'' = 6 mu U h_x/h^3, in a length s, s^2 = 2 p_side/p''.
    """
    s, row = problem.scheme, -side
    pressed = (s.k_S, s.k_N)[side][row] * (problem.p_sides[2 + side] / problem.p_unit)
    spread = s.couette_E[row] - s.couette_W[row]  # what the wall takes away from a full cell
    part = np.divide(2.0 * pressed, spread, out=np.full_like(spread, 0.25), where=spread > 0.0)
    return np.sqrt(np.minimum(part, 1.0)) if problem.p_sides[2 + side] > 0.0 else np.zeros_like(part)


Across = list[tuple[NDArray[np.int64], NDArray[np.int64], Array]]


def across(grid: Grid, p: Array, cavity: NDArray[np.bool_]) -> Across:
    """Full points beside a cavity to the south, and to the north: j, i, and how far from each its front lies, m. Collective."""
    dry, pressures = (grid.ghosted(field, outside=0.0) for field in (cavity.astype(float), p))
    return _across(dry, pressures, grid.steps(1)[:, None])


def _across(cavity: Array, frame: Array, steps: Array) -> Across:
    """The same of framed lines."""
    dry, out = cavity.astype(bool, copy=False), []
    to_north, to_south = _turns(dry[:-1, 1:-1], dry[1:, 1:-1])  # rows of the frame, counted from a point's southern neighbour
    for (row, at), beside, beyond in ((to_south, 0, 2), (to_north, 2, 0)):
        own = (row >= beside // 2) & (row < len(dry) - 2 + beside // 2)
        j, i = row[own] - beside // 2, at[own]
        step, far = steps[j + beside // 2, 0], steps[j + beyond // 2, 0]
        here = frame[j + 1, i + 1]
        rise = (frame[j + beyond, i + 1] - here) / far * step
        # In parts of `here`: what falls as steeply reaches zero before the cavity's point, at the latest there; a ridge of
        # pressure one line wide ends half-way. Between them no jump: beside a supply the slope is rounding.
        part = np.divide(rise, here, out=np.full_like(rise, np.inf), where=here > 0.0)
        back = step * np.where(part > 1.0, 1.0 / np.maximum(part, 1.0), np.clip(1.0 + 0.5 * part, 0.5, 1.0))
        out.append((j, i, back))
    return out


def first_cavity(grid: Grid, ruptures: list[float], reformations: list[float]) -> tuple[float | None, float | None]:
    """The first rupture, and the first reformation behind it; without a rupture the first reformation. None where absent."""
    if not ruptures:
        return None, min(reformations, default=None)
    rupture = ruptures[0]
    if grid.periodic[0]:
        return rupture, min(reformations, key=lambda x: (x - rupture) % grid.lengths[0], default=None)
    return rupture, min((x for x in reformations if x > rupture), default=None)


def _rises_through(film: Film, level: Array, a: Array, b: Array, y: Array) -> Array:
    """Where the film first grows to a level between a and b: at a jump too; a or b where it does not.

    Once known to a sixteenth the place is at the jump that the film tells there, or where secants lead to; looks on either side
    of it say whether it is. Where it is not, bisection goes on, to 50 bits.
    """
    far, places, first, end = np.abs(b).max(initial=0.0), (level, y), a, b
    for _ in range(2):
        a, b = _narrowed(film, *places, a, b, 4)
    jumps = np.unique([*jumps_of(film, "x"), np.inf])
    jump = jumps[np.searchsorted(jumps, a)]
    last, x, high = b, a, film(b, y)
    before = film(a, y) >= level
    with np.errstate(all="ignore"):
        for _ in range(SECANTS):
            here = film(x, y)
            ahead = x - (here - level) * (last - x) / (high - here)
            # A film that is level there leads nowhere, and none need be known beyond the two ends.
            last, x, high = x, np.where(np.isfinite(ahead), np.clip(ahead, a, b), a), here
    jumps_there = jump <= b + ON_EDGE * far
    near = far * np.where(jumps_there, ON_EDGE, NEAR)
    x = np.where(before, a, np.where(jumps_there, jump, x))
    west, east = (film(np.clip(x + shift, first, end), y) >= level for shift in (-near, near))
    rest = ~(before | ((a < x) & (x <= b + near) & ~west & east))
    if rest.any():
        a, b, places = a[rest], b[rest], (level[rest], y[rest])
        n = 16 if a.size < MANY else 4  # fewer calls, or fewer places
        for _ in range(48 // (n.bit_length() - 1)):
            a, b = _narrowed(film, *places, a, b, n)
        x[rest] = b
    return x


def _narrowed(film: Film, level: Array, y: Array, a: Array, b: Array, n: int) -> tuple[Array, Array]:
    """The first of n parts of a to b at whose end the film has grown to the level; the last one if there is none."""
    width = b - a
    thick = film(a[:, None] + width[:, None] * (np.arange(1, n) / n), y[:, None]) >= level[:, None]
    first = np.where(thick.any(axis=1), thick.argmax(axis=1), n - 1)
    return a + width * (first / n), np.where(first < n - 1, a + width * ((first + 1) / n), b)


def middle_row(problem: LubricationProblem) -> int:
    """Number of the line of points on y = width/2, or next below it, or on a mirror line; 0 in 1D."""
    grid = problem.grid
    if grid.dim == 1:
        return 0
    return grid.shape[1] - 1 if "mirror" in grid.ends[1] else (grid.shape[1] - 1) // 2
