"""Sums of a film's balances times weights as sums over the faces: what another film there makes of them, without a problem.

With G_i the balance of a point (`reynolds`), w' G is linear in the conductances and films C, H of the faces (`edges`):

    w' G = sum of C k (w_i - w_j)(p_i - p_j)/(6 mu)  +  U sum of H s (w_i - w_j)(1 - r_i),

k and s being products of what a column and what a line of the grid has; a fluid's density multiplies both at each face, as the
mean of its points'. Where a film is the same along y from edge to edge, the lines between two edges are added up once, and
another film costs its values on one of them. The drag at the wall (`flows.drag`) is such a sum too, of h and 1/h at the faces,
and so are the flows through the sides (`flows.side_flows`).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ...base.parallel import Array
from ..grid import Grid
from ..strips import STRIP, ghosted, in_strips
from .borne import by_coefficients
from .edges import Around, level, pairs
from .effects import framed_by
from .face_lines import FaceLines, Rows, line_factors
from .flows import SIDES, line_shares
from .fluid import Law
from .lubrication import LubricationProblem
from .made_faces import MadeFaces
from .reynolds import sides
from .rims import across_flow, frame_of, made_along
from .strip import line_weights

EQUAL = 1e-12  # relative: widths of lines of one run, from places that are rounded


@dataclass(frozen=True)
class Laid(FaceLines):
    """With the sums' parts of those that are alike."""

    widths: Array
    ends: Array
    of_lines: list[Any]
    of_faces: Any
    of_drags: list[Any]
    of_flows: Array


class ByFaces:
    """w' G of the films that a problem could have, at its fields. Collective, as its methods.

    Parameters
    ----------
    problem : of a fluid of constant viscosity and density. law : of its own fluid.
    p : owned points, Pa above p_c, r : owned points. p_sides : Pa above p_c. rows : the weights w.
    drags : of them `friction` and `friction_torque`, which follow the rows' sums. flows : sides, whose flows follow those.
    shares : what `supplies.shares_of` says of a film with supplies. layers : `flows.layers` of this one, which all films have.
    by_borne : of a film whose integrals know fronts (`borne`): by what they are counted in the numbers that the first of these
        sums are taken from. As these change with what moves fronts, so do the sums the other way; here they stay as they are.
    """

    def __init__(
        self, problem: LubricationProblem, scheme: str, law: Law, p: Array, r: Array, p_sides: Sequence[float],
        rows: Sequence[Array], drags: Sequence[str] = (), flows: Sequence[str] = (), shares: Array | None = None,
        layers: Array | None = None, by_borne: Sequence[Array] = (),
    ):  # fmt: skip
        from .cell_loops import loop_by_faces

        q = law.reduced(p)
        self.grid = grid = problem.grid
        (ny, nx), self.count = grid.box, len(rows)
        at_face, before = scheme != "upwind", scheme != "face"  # where the wall's film is taken, and where the void's
        along, wall = (np.empty((self.count, ny, nx + 1)) for _ in range(2))
        across, w = np.empty((self.count, ny + 1, nx)), [np.ascontiguousarray(row.reshape(grid.box)) for row in rows]
        void = wall if at_face != before else np.empty_like(wall)
        enters = problem.r_in if grid.ends[0][0] == "open" else 0.0
        frames = ghosted(grid, q, 0.0), ghosted(grid, r, enters)
        for lines in in_strips(grid):
            faces = slice(lines.start, lines.stop + 1)
            near_p, near_r = (frame(lines) for frame in frames)
            for k in range(self.count):
                of_void = None if void is wall else void[k, lines]
                loop_by_faces(w[k], lines.start, near_p, near_r, along[k, lines], across[k, faces], wall[k, lines], of_void)
        for end, owned in ((0, grid.y_start == 0), (-1, grid.y_end == grid.shape[1])):
            if owned and grid.ends[1][end] in ("closed", "mirror"):
                across[:, end] = 0.0
        west, east, south, north = (float(mask.any()) for mask in sides(grid))
        columns, rims = np.outer([west, east], np.ones(ny)), np.outer([south, north], np.ones(nx))  # of the faces at the sides
        if law.dowson_higginson:
            dense = framed_by(grid, law.density(p), [float(law.density(np.array(P))) for P in p_sides])
            by_x, by_y = (0.5 * (a[..., 1:] + a[..., :-1]) for a in (dense[1:-1], dense[:, 1:-1].T))
            for part in (along, wall, *([] if void is wall else [void])):
                part *= by_x
            across *= by_y.T
            columns, rims = columns * by_x[:, [0, -1]].T, rims * by_y[:, [0, -1]].T
        for k, by in enumerate(by_borne):  # both parts of a face, which are of degree 0 in C and H, make nothing together
            by_k, by_b = by_coefficients(problem, p, r, by)
            along[k, :, :-1] -= by_k * problem.p_unit
            wall[k, :, :-1] -= by_b
        if shares is not None:
            ways = 1.0 / np.broadcast_to(shares, (4, ny, nx))
            along *= np.concatenate([ways[0], ways[1][:, -1:]], axis=1)
            across *= np.concatenate([ways[2], ways[3][-1:]])
        self._along, self._across = along, across
        self._at_face, self._before = wall if at_face else None, void if before else None
        self._beside = [-np.array([a[:, [at]] * columns[at, :, None] for a in w]) for at in (0, -1)]
        self._ends = [-np.array([a[at] * rims[at] for a in w]) for at in (0, -1)]
        self.drags, self.flows, self._nodal = drags, flows, scheme == "nodal"
        if drags:
            own = np.append(west, np.ones(nx))  # the first face is the neighbour's, but at a side
            thick: Any = 1.0
            if law.barus:  # the viscosity of an east face; the first point's west face has that of its other one
                framed = framed_by(grid, p, p_sides)[1:-1, 1:]
                thick = np.insert(law.viscosity(0.5 * (framed[:, :-1] + framed[:, 1:])), 0, 0.0, axis=1)
                thick[:, 0] = thick[:, 1]
            self._pull = own * np.diff(grid.ghosted(p, 0.0)[1:-1])[None]
            self._void = -np.insert(r.reshape(grid.box), 0, 0.0, axis=1)[None]
            self._whole, self._less = np.broadcast_to(own * thick, self._pull.shape), self._void * thick
            self._layers = None if layers is None else np.insert(layers, 0, 0, axis=1)
            self._outer = [np.full((1, ny, 1), side) for side in (-west, east)]
        if flows:  # of what the wall drags, and of what the pressure drives, through the faces at the sides
            q, r = q.reshape(grid.box), r.reshape(grid.box)
            self._through = columns, -columns * np.array([np.full(ny, enters), r[:, -1]]), columns * q[:, [0, -1]].T
            self._off = rims, rims * q[[0, -1]]
        self._state = frame_of(grid, problem.dry) if problem.remade else None  # where round edges cut faces
        self._made = partial(MadeFaces.of, problem)
        self._known: dict[tuple[int, bytes], tuple[Array, Array]] = {}
        self._own: dict[tuple[Any, ...], Laid] = {}

    def sums(self, gap: Any, grid: Grid) -> Array | None:
        """What the pressures (m2/s Pa s) and the wall (m) make of each, and by what it grows with each side's pressure: shape
        (weights, 6); None for a film that is not positive. Of drags what the pressures (N) and mu U (m) make, of flows
        twice what leaves per mean spacing in y. grid : the problem's, or the same points elsewhere."""
        film = Around(gap, grid)
        cut = [film.edges(side) for side in range(2)]
        first = self.count + len(self.drags)
        out, positive = np.zeros((first + len(self.flows), 6)), True
        made = self._made(film)
        balances, at = out[: self.count], self._laid(grid, level(film), tuple(cut[1]), made.apart)
        for some, rows in _strips(at.lines, grid.box[1]):
            C, H, before = at.along(film, rows, cut)
            if self._state is not None and film.rims:
                C, H = np.array(C), np.array(H)
                widths = 0.5 * at.across[:, rows].sum(axis=0)
                made_along(film, at.x_places[0], at.y[rows], widths, self._state[1:-1][rows], (C, H), film.period(0))
            C, H = made.along(at, rows, C, H)
            positive = positive and all(bool((a > 0.0).all()) for a in (C, H, before))
            if self.drags and positive:
                films = self._sheared(film, at, rows, before / H)
                for k, parts in enumerate(at.of_drags, start=self.count):
                    for column, part, of in zip((0, 1, 1, 2, 3), parts, films, strict=True):
                        out[k, column] += _total(part, some, of)[0]
            C = C / at.steps
            for k, part, values in zip((0, 1, 1, 2, 3), at.of_lines, (C, H, before, C[:, :1], C[:, -1:]), strict=True):
                if part is not None:
                    balances[:, k] += _total(part, some, values)
            if self.flows:
                wall, void = (H if self._at_face is not None else before), (H if self._before is None else before)
                outer = np.array([a[:, end] for a in (C, wall, void) for end in (0, -1)])
                out[first:, :4] += np.einsum("fkal,al->fk", at.of_flows[:, :, :, some], outer)
        for some, rows in _strips(at.faces, grid.box[1]):
            C = np.array(at.over(film, rows, cut))
            if self._state is not None and film.rims:
                ends = slice(rows[0], rows[-1] + 2)
                state = across_flow(grid, self._state[ends])
                widths = 0.5 * pairs(at.steps).sum(axis=0)
                made_along(film, at.y_places[0][ends], at.x_places[0][1:-1], widths, state, (C.T,), film.period(1), across=True)
            C = made.over(rows, C) * at.widths
            positive = positive and bool((C > 0.0).all())
            balances[:, 0] += _total(at.of_faces, some, C)
            for k, end, here in ((4, 0, some.start == 0), (5, -1, some.stop == at.faces.size)):
                balances[:, k] += here * at.ends[end] * (self._ends[end] @ C[end])
                if SIDES[k - 2] in self.flows:
                    by_side, own = (here * at.ends[end] * (of[end] @ C[end]) for of in self._off)
                    out[first + self.flows.index(SIDES[k - 2]), [k, 0]] += -by_side, own
        total = grid.comm.allreduce(np.append(out, float(not positive)))
        return None if total[-1] else total[:-1].reshape(out.shape)

    def _laid(self, grid: Grid, level: bool, cut: tuple[float, ...], apart: Sequence[Rows]) -> Laid:
        """Its lines, those of the problem's own grid made once for films that jump along the same ones."""
        key = level, cut, *(one.tobytes() for one in apart)
        if grid is self.grid and key in self._own:
            return self._own[key]
        places = FaceLines.of(grid, level, cut, apart)
        lines, faces = places.lines, places.faces
        pressed, ends, dragged = line_factors(grid)
        of_lines = [(self._along, pressed), (self._at_face, dragged), (self._before, dragged)]
        of_lines += [(one, pressed) for one in self._beside]
        found = Laid(
            **vars(places), widths=grid.widths(0), ends=ends,
            of_lines=[None if a is None else self._added(a, b, lines) for a, b in of_lines],
            of_faces=self._added(self._across, ends, faces),
            of_drags=self._drag_parts(grid, lines) if self.drags else [],
            of_flows=self._flow_parts(grid, lines, pressed, dragged) if self.flows else np.zeros(0),
        )  # fmt: skip
        if grid is self.grid:
            self._own[key] = found
        return found

    def _drag_parts(self, grid: Grid, lines: Rows) -> list[Any]:
        """The same of the drags'."""
        shears, pulls = (share[:, 0] for share in np.broadcast_arrays(*line_shares(grid)))
        levers = [grid.polar[0] + grid.y[:, 0] if name == "friction_torque" and grid.polar else 1.0 for name in self.drags]
        of = [(self._pull, pulls), (self._whole, shears), (self._less, shears), *((one, pulls) for one in self._outer)]
        return [[self._added(a, b * lever, lines) for a, b in of] for lever in levers]

    def _flow_parts(self, grid: Grid, first: Rows, pressed: Array, dragged: Array) -> Array:
        """By what flows out of sides count on the conductances and the wall's and void's films of first and last x faces, as
        `sums` has its columns: shape (flows, 4, 6, runs of lines)."""
        (there, void, driven), found = self._through, np.zeros((len(self.flows), 4, 6, dragged.size))
        ends = [0.5 * rim * at[:, 0] for rim, at in zip(grid.rims(1), sides(grid)[2:], strict=True)]
        strips = {side: dragged / line_weights(grid)[:, 0] * end for side, end in zip(SIDES[2:], ends, strict=True)}
        for part, side in zip(found, self.flows, strict=True):
            if side in strips:
                enters, leaves = strips[side], -strips[side]
            else:
                all_lines, k = dragged + sum(strips.values()), SIDES.index(side)
                enters, leaves = -all_lines * (k == 0), all_lines * (k == 1)
                part[0, k], part[2 + k, k] = pressed * driven[k], -pressed * there[k]
            part[1, 2:] = [a * b for of in (there, void) for a, b in zip((enters, leaves), of, strict=True)]
        return np.add.reduceat(found, first, axis=3)

    def _sheared(self, film: Around, at: Laid, rows: Rows, void: Array) -> list[Array]:
        """By what `_drag_parts` count on the x faces of some lines. void : the film of the void, in parts of the wall's."""
        void = void if self._nodal else np.ones(1)
        layers = None if self._layers is None else self._layers[rows]
        h, resting, moving = at.sheared(film, rows, 1.0 + void * self._void[0][rows], layers)
        pull, full = 0.5 * h, at.steps / moving
        return [pull, at.steps * resting + full, full * void, pull[:, :1], pull[:, -1:]]

    def _added(self, a: Array, weights: Array, first: Rows) -> tuple[Array, Array]:
        """Runs of rows added up with their weights, shape (weights, runs, columns), which are kept, and by what each run's
        weights are others, where its lines have only moved apart. Rows that are all apart stay as they are."""
        if first.size == weights.size:
            return a, weights
        added, of = self._known.get((id(a), first.tobytes()), (a, np.nan * weights))
        ends = np.append(first, weights.size)
        ratio = np.add.reduceat(weights, first) / np.add.reduceat(of, first)
        if not (np.abs(weights - of * np.repeat(ratio, np.diff(ends))) <= EQUAL * np.abs(weights)).all():
            runs, ratio = [slice(*one) for one in pairs(ends).T], np.ones(first.size)
            added = np.array([[np.einsum("j,ji->i", weights[run], one[run]) for run in runs] for one in a])
            self._known[id(a), first.tobytes()] = added, weights
        return added, ratio


def _strips(rows: Rows, columns: int) -> Iterator[tuple[slice, Rows]]:
    """Some of the rows at a time."""
    many = max(1, STRIP // columns)
    return ((slice(k, min(k + many, rows.size)), rows[k : k + many]) for k in range(0, rows.size, many))


def _total(part: tuple[Array, Array], some: slice, films: Array) -> Array:
    a, weights = part
    return np.array([weights[some] @ np.einsum("ji,ji->j", one[some], films) for one in a])
