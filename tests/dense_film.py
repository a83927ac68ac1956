"""A film solved without the package's discretisation, matrices or methods: what `wild_films` are compared with.

Faces are listed one by one, flows through them and the balances of the cells computed in extended precision, so that they
telescope whatever the film ratio; steps are semismooth Newton steps by dense elimination, or by
sparse elimination with 100 digits where conductances differ by more than double precision can factor. A wall that moves to
smaller x is discretised as it stands, upwind from the east. The answer of a Newton step that changes no sign is the discrete
solution, which is unique; where steps cycle, they start again from the package's answer, and have to end there all the same.
"""

from dataclasses import dataclass
from decimal import Decimal, localcontext
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.linalg import lu_factor, lu_solve

from lcp_lube.problems.film.edges import jumps_of
from lcp_lube.problems.film.graded import whole

LONG = np.longdouble
BEYOND_LU = 1e12  # ratio of conductances at which factors in double precision are no longer to be trusted
COLUMNS = ("i", "j", "k", "u", "b_i", "b_j", "p_i", "p_j", "r_i", "r_j")
GAUSS = 0.5 / np.sqrt(3.0)


@dataclass
class Faces:
    """Flow k (p_i - p_j) + (u - b_i r_i + b_j r_j), p_i = p_side where i < 0 and so on; one entry a face."""

    i: list
    j: list
    k: list
    u: list
    b_i: list
    b_j: list
    p_i: list
    p_j: list
    r_i: list
    r_j: list

    def add(self, i: int, j: int, k: float, **more: float) -> None:
        row = {"i": i, "j": j, "k": k, **more}
        for name in COLUMNS:
            getattr(self, name).append(row.get(name, 0.0))


@dataclass
class Line:
    """Points with a neighbour before and behind and the faces between, m; distances of the points; the cells' ends."""

    points: np.ndarray
    faces: np.ndarray
    gaps: np.ndarray
    starts: np.ndarray
    ends: np.ndarray

    @property
    def widths(self) -> np.ndarray:
        return self.ends - self.starts

    def turned(self, length: float) -> "Line":
        points, faces, starts, ends = (length - a[::-1] for a in (self.points, self.faces, self.ends, self.starts))
        return Line(points, faces, self.gaps[::-1], starts, ends)


def line_of(n: int, length: float, first: str, last: str, chosen: np.ndarray | None) -> Line:
    """n points between two sides, evenly spaced or where they were chosen to lie; a cell ends half-way between two points."""
    if chosen is not None:
        before = {"open": 0.0, "closed": -chosen[0], "periodic": chosen[-1] - length}[first]
        behind = {"open": length, "closed": 2.0 * length - chosen[-1], "periodic": chosen[0] + length}[last]
        around = np.concatenate([[before], chosen, [behind]])
        gaps, faces, points = np.diff(around), 0.5 * (around[1:] + around[:-1]), np.clip(around, 0, length)
        starts, ends = chosen - 0.5 * gaps[:-1], chosen + 0.5 * gaps[1:]
        if first == "periodic":  # one face, seen from both ends
            points[[0, -1]], faces = chosen[[-1, 0]], np.mod(faces, length)
            faces[-1], gaps[-1] = faces[0], gaps[0]
        return Line(points, faces, gaps, starts, ends)
    offset = {"open": 1.0, "closed": 0.5, "periodic": 0.5}
    meshes = n + offset[first] + offset[last] - 1.0
    points, faces = np.arange(-1, n + 1), np.arange(0, n + 1)
    if first == "periodic":
        points, faces = points % n, faces % n
    d = length / meshes
    at, between = np.clip(points + offset[first], 0, meshes) * d, np.clip(faces + offset[first] - 0.5, 0, meshes) * d
    return Line(at, between, np.full(n + 1, d), at[1:-1] - 0.5 * d, at[1:-1] + 0.5 * d)


def inside(jumps: Any, a: float, b: float) -> list[float]:
    return [t for t in sorted(set(jumps)) if a + 1e-9 * (b - a) <= t < b - 1e-9 * (b - a)] if b > a else []


def resistance(
    film: Any, a: float, b: float, plain: float, s: float, strip: tuple[float, float], jumps: Any, across: Any
) -> tuple[float, float]:
    """C and H of the face between points a and b on the line s: in series along t, side by side across it, over the strip.

    plain : film at the face, for a face without jumps.
    """
    cuts, found = inside(across, *strip), inside(jumps, a, b)
    if not cuts and not found:
        return plain**3, plain
    ends = [strip[0], *cuts, strip[1]]
    C = H = 0.0
    for low, high in pairwise(ends):
        middle, share = (0.5 * (low + high), (high - low) / (strip[1] - strip[0])) if cuts else (s, 1.0)
        if found:
            series = drag = 0.0
            marks = [a, *found, b]
            for start, end in pairwise(marks):
                for part in (0.5 - GAUSS, 0.5 + GAUSS):
                    h = float(film(start + part * (end - start), middle))
                    series += 0.5 * (end - start) / h**3
                    drag += 0.5 * (end - start) / h**2
            C, H = C + share * (b - a) / series, H + share * drag / series
        else:
            h = float(film(None, middle))
            C, H = C + share * h**3, H + share * h
    return C, H


XI, WEIGHT = np.polynomial.legendre.leggauss(12)


def in_series(film: Any, a: float, b: float, jumps: Any) -> tuple[float, float]:
    """C and H of a line's full film between a and b, from integrals by a rule that halves itself."""
    marks = np.unique(np.concatenate([[a], inside(jumps, a, b), [b], np.linspace(a, b, 129)]))
    I3, I2 = (
        sum(
            halved(lambda t, power=power: film(t) ** -power, low, high, 1e-12 * (high - low), 45)
            for low, high in pairwise(marks)
        )
        for power in (3.0, 2.0)
    )
    return (b - a) / I3, I2 / I3


def halved(f: Any, a: float, b: float, least: float, depth: int) -> float:
    """Integral; halves that differ by 1e-12 of the whole's share, or are next to nothing long, are taken."""
    middle = 0.5 * (a + b)
    sums = [
        0.5 * (d - c) * float(f(0.5 * (c + d) + 0.5 * (d - c) * XI) @ WEIGHT) for c, d in ((a, b), (a, middle), (middle, b))
    ]
    if not depth or b - a < least or abs(sums[0] - sums[1] - sums[2]) <= 1e-11 * (sums[1] + sums[2]):
        return sums[1] + sums[2]
    return halved(f, a, middle, least, depth - 1) + halved(f, middle, b, least, depth - 1)


def discretise(scene: Any) -> tuple[Faces, int, np.ndarray]:
    """Faces, number of cells, and the cells with a wall downstream, whose own void goes nowhere."""
    model, shape = scene.model, scene.shape
    nx, ny = (*shape, 1)[:2]
    kinds = [side.kind for side in model.sides]
    p_side = [side.p if side.kind == "open" else 0.0 for side in model.sides]
    mu, U, scheme = model.mu, model.U, model.scheme
    jumps = partial(jumps_of, model.gap)
    # Where lines lie is a choice; U < 0: counted from the inlet, as the last bit of x decides which side of a jump is meant.
    chosen_x, chosen_y = (model if U >= 0 else model.mirrored).lines(shape)
    inlet, outlet = kinds[:2] if U >= 0 else kinds[1::-1]
    x = line_of(nx, model.lengths[0], inlet, outlet, chosen_x)
    if U < 0:
        x = x.turned(model.lengths[0])
    plane = len(shape) == 2
    y = (
        line_of(ny, model.lengths[1], kinds[2], kinds[3], chosen_y)
        if plane
        else Line(*map(np.array, ([0.0] * 3, [0.0] * 2, [1.0] * 2, [0.0], [1.0])))
    )
    around = kinds[0] == "periodic", plane and kinds[2] == "periodic"

    def film(x: Any, y: Any) -> np.ndarray:
        x, y = np.atleast_1d(x), np.atleast_1d(y)
        x, y = (
            np.where((t < -1e-9 * length) | (t > (1 + 1e-9) * length), t % length, np.clip(t, 0, length)) if ring else t
            for t, ring, length in zip((x, y), around, (*model.lengths, 1.0), strict=False)
        )
        return np.broadcast_to(model.gap(x[None, :], y[:, None]), (y.size, x.size))

    def edges(axis: int) -> list[float]:
        """The film's, and where a ring's ends differ the seam, as often as a face or cell may meet them."""
        length, found = (*model.lengths, 0.0)[axis], list(jumps("xy"[axis]))
        if not around[axis]:
            return found
        beside = np.linspace(0.0, (*model.lengths, 0.0)[1 - axis], 65)
        first, last = (film(*((t, beside) if axis == 0 else (beside, t))).ravel() for t in (0.0, (1 - 1e-12) * length))
        found += [0.0] if np.max(np.abs(last - first)) > 1e-9 * np.max(np.abs(first)) else []
        return [t + k * length for t in found for k in (-1, 0, 1)]

    jx, jy = edges(0), edges(1) if plane else []
    at_points, at_x_faces = film(x.points, y.points[1:-1]), film(x.faces, y.points[1:-1])
    faces = Faces(*([] for _ in range(10)))
    dead = np.zeros(nx * ny, dtype=bool)
    for m in range(ny):
        place, strip, width = float(y.points[m + 1]), (float(y.starts[m]), float(y.ends[m])), float(y.widths[m])
        h = at_points[m]
        for f in range(nx + 1):
            ends = (f == 0, f == nx)
            side = 0 if f == 0 else 1
            if any(ends) and kinds[side] == "closed":
                if (U >= 0) == ends[1]:
                    dead[m * nx + (nx - 1 if ends[1] else 0)] = True
                continue
            if f == nx and kinds[1] == "periodic":
                continue  # the face at 0
            along = lambda t, s, f=f: film(x.faces[f] if t is None else t, s)[0, 0]  # noqa: E731
            a, b = float(x.points[f]), float(x.points[f + 1])
            a = b - float(x.gaps[f]) if around[0] else a
            if not plane and scheme == "face":
                C, H = in_series(lambda t: film(t, 0.0)[0], a, b, jx)
            else:
                C, H = resistance(along, a, b, float(at_x_faces[m, f]), place, strip, jx, jy)
            k = C * width / (6 * mu * float(x.gaps[f]))
            i, j = m * nx + (f - 1) % nx, m * nx + f % nx
            h_up = h[f] if U >= 0 else h[f + 1]
            u, carried = {"face": (H, H), "nodal": (H, h_up), "upwind": (h_up, h_up)}[scheme]
            u, carried = U * width * u, U * width * carried
            word = {"b_i": carried} if U >= 0 else {"b_j": -carried}
            if ends[0] and kinds[0] == "open":
                faces.add(-1, j, k, u=u, p_i=p_side[0], r_i=model.sides[0].r, **word)
            elif ends[1]:
                faces.add(i, -1, k, u=u, p_j=p_side[1], r_j=model.sides[1].r, **word)
            else:
                faces.add(i, j, k, u=u, **word)
    if plane:
        at_y_faces = film(x.points[1:-1], y.faces)
        for f in range(ny + 1):
            side = 2 if f == 0 else 3
            if (f in (0, ny) and kinds[side] == "closed") or (f == ny and kinds[3] == "periodic"):
                continue
            for l in range(nx):
                a, b = float(y.points[f]), float(y.points[f + 1])
                a = b - float(y.gaps[f]) if around[1] else a
                strip = (float(x.starts[l]), float(x.ends[l]))
                across = lambda t, s, f=f: film(s, y.faces[f] if t is None else t)[0, 0]  # noqa: E731
                C, _ = resistance(across, a, b, float(at_y_faces[f, l]), float(x.points[l + 1]), strip, jy, jx)
                k = C * float(x.widths[l]) / (6 * mu * float(y.gaps[f]))
                i, j = (f - 1) % ny * nx + l, f % ny * nx + l
                if f == 0 and kinds[2] == "open":
                    faces.add(-1, j, k, p_i=p_side[2])
                elif f == ny:
                    faces.add(i, -1, k, p_j=p_side[3])
                else:
                    faces.add(i, j, k)
    return faces, nx * ny, dead


def faces_of(problem: Any) -> tuple[Faces, int, np.ndarray]:
    """What `discretise` returns, from the package's own coefficients, for a film whose faces depend on its cavities (rims).

    Cells that supplies hold are sides to those around them. Collective.
    """
    s, grid, held = problem.scheme, problem.grid, problem.held
    around = (*grid.periodic, False)[:2]
    unit, p_side = LONG(problem.p_unit), problem.p_sides
    names = ("k_W", "k_E", "k_S", "k_N", "couette_W", "couette_E", "b_C")
    k_W, k_E, k_S, k_N, u_W, u_E, b_C = whole(grid, *(getattr(s, name) for name in names))
    none = np.zeros(grid.box)
    is_held, P = whole(grid, *((none, none) if held is None else (held.mask.astype(float), held.pressures(1.0))))
    ny, nx = k_W.shape
    faces, dead = Faces(*([] for _ in range(10))), np.zeros(nx * ny, dtype=bool)

    def between(i: tuple[int, int], j: tuple[int, int], k: float, **flow: Any) -> None:
        """A face of two cells, of a cell and a supply, or of none."""
        ends, number = (is_held[i] > 0, is_held[j] > 0), [m * nx + l for m, l in (i, j)]
        if all(ends):
            return
        if ends[0]:
            number[0], flow["p_i"], flow["b_i"] = -1, P[i], 0.0
        if ends[1]:
            number[1], flow["p_j"] = -1, P[j]
        faces.add(number[0], number[1], k, **flow)

    for m in range(ny):
        for l in range(nx):
            i = m * nx + l
            if is_held[m, l]:
                faces.add(i, -1, (k_W + k_E + k_S + k_N)[m, l] / unit, p_j=P[m, l])
            elif l == 0 and not around[0] and k_W[m, l] > 0:
                faces.add(-1, i, k_W[m, l] / unit, u=u_W[m, l], p_i=p_side[0])
            flow = {"u": u_E[m, l], "b_i": -b_C[m, l]}
            if l < nx - 1 or around[0]:
                between((m, l), (m, (l + 1) % nx), k_E[m, l] / unit, **flow)
            elif not is_held[m, l] and k_E[m, l] > 0:
                faces.add(i, -1, k_E[m, l] / unit, p_j=p_side[1], **flow)
            else:
                dead[i] = True
            if m == 0 and not around[1] and k_S[m, l] > 0 and not is_held[m, l]:
                faces.add(-1, i, k_S[m, l] / unit, p_i=p_side[2])
            if m < ny - 1 or around[1]:
                between((m, l), ((m + 1) % ny, l), k_N[m, l] / unit)
            elif k_N[m, l] > 0 and not is_held[m, l]:
                faces.add(i, -1, k_N[m, l] / unit, p_j=p_side[3])
    return faces, nx * ny, dead


class Dense:
    """Balances G(y) of the cells, p = max(y, 0)/a and r = max(-y, 0)/b, and Newton's method on them."""

    def __init__(self, scene: Any, problem: Any = None):
        faces, self.n, dead = discretise(scene) if problem is None else faces_of(problem)
        nx, ny = (*scene.shape, 1)[:2]
        numbers = np.arange(nx * ny).reshape(ny, nx)
        self.order = (numbers if nx <= ny else numbers.T).ravel().tolist()
        self.ring = scene.shape[0] if scene.model.sides[0].kind == "periodic" else 0
        self.i, self.j = np.array(faces.i), np.array(faces.j)
        self.k, self.u, self.b_i, self.b_j, self.p_i, self.p_j, self.r_i, self.r_j = (
            np.array(getattr(faces, name), dtype=LONG) for name in COLUMNS[2:]
        )
        unit = max(float(np.max(self.k)), 1e-290)
        self.a = np.zeros(self.n + 1)
        np.add.at(self.a, self.i, self.k.astype(float) / unit)
        np.add.at(self.a, self.j, self.k.astype(float) / unit)
        self.a = self.a[:-1] * unit
        self.b = np.zeros(self.n + 1)
        np.add.at(self.b, self.i, self.b_i.astype(float))
        np.add.at(self.b, self.j, self.b_j.astype(float))
        self.b = self.b[:-1]
        self.virtual = np.where(dead | (self.b == 0.0), 1.0, 0.0)  # of any size: void there is none
        self.b = np.where(self.virtual > 0, self.a, self.b)
        self.A, self.B = self._matrices()
        # What one rounding of r does to p: the flow of one cell pressed to an open side, through the thinnest film. No p that
        # comes with an r in double precision knows more.
        along = (self.b_i != 0) | (self.b_j != 0)
        way = along if {side.kind for side in scene.model.sides[:2]} & {"open"} and np.any(along) else ~along
        weakest = float(np.min(self.k[way if np.any(way) else along | ~along]))
        self.rounding = 8 * 2.0**-53 * self.n * float(np.max(np.abs(self.b_i) + np.abs(self.b_j))) / weakest

    def _matrices(self) -> tuple[np.ndarray, np.ndarray]:
        A, B = np.zeros((self.n + 1, self.n + 1)), np.zeros((self.n + 1, self.n + 1))
        for at, sign in ((self.i, 1.0), (self.j, -1.0)):
            np.add.at(A, (at, self.i), sign * self.k.astype(float))
            np.add.at(A, (at, self.j), -sign * self.k.astype(float))
            np.add.at(B, (at, self.i), -sign * self.b_i.astype(float))
            np.add.at(B, (at, self.j), sign * self.b_j.astype(float))
        A, B = A[:-1, :-1], B[:-1, :-1]
        return A, B - np.diag(self.virtual * self.a)

    def fields(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.maximum(y, 0) / self.a, np.maximum(-y, 0) / self.b

    def balance(self, p: np.ndarray, r: np.ndarray) -> np.ndarray:
        p, r = (np.append(field, 0).astype(LONG) for field in (p, r))
        p_i, r_i = np.where(self.i < 0, self.p_i, p[self.i]), np.where(self.i < 0, self.r_i, r[self.i])
        p_j, r_j = np.where(self.j < 0, self.p_j, p[self.j]), np.where(self.j < 0, self.r_j, r[self.j])
        flow = self.k * (p_i - p_j) + (self.u - self.b_i * r_i + self.b_j * r_j)
        out = np.zeros(self.n + 1, dtype=LONG)
        np.add.at(out, self.i, flow)
        np.add.at(out, self.j, -flow)
        return out[:-1] - self.virtual * self.a * r[:-1]

    def branch(self, y: np.ndarray) -> np.ndarray:
        full = y >= 0
        if self.ring:  # one that is empty all round has no steady flow
            lines, values = full.reshape(-1, self.ring), y.reshape(-1, self.ring)
            empty = np.flatnonzero(~lines.any(axis=1))
            lines[empty, np.argmax(values[empty], axis=1)] = True
        return full

    def exact_step(self, y: np.ndarray) -> np.ndarray:
        """`step` in arithmetic of 100 digits, by sparse elimination without pivoting: no ratio of conductances is too much."""
        full = self.branch(y)
        with localcontext(prec=100):
            rows: list[dict[int, Decimal]] = [{} for _ in range(self.n)]
            rhs = [Decimal(0)] * self.n
            faces = [[exact(v) for v in getattr(self, name)] for name in COLUMNS[2:]]
            for i, j, k, u, b_i, b_j, p_i, p_j, r_i, r_j in zip(self.i, self.j, *faces, strict=True):
                for cell, sign in ((i, 1), (j, -1)):
                    if cell < 0:
                        continue
                    flow = u
                    for other, of_p, of_r, p, r in ((i, k, -b_i, p_i, r_i), (j, -k, b_j, p_j, r_j)):
                        if other < 0:
                            flow += of_p * p + of_r * r
                        else:
                            value = sign * (of_p if full[other] else -of_r)
                            rows[cell][other] = rows[cell].get(other, Decimal(0)) + value
                    rhs[cell] -= sign * flow
            for cell in np.flatnonzero((self.virtual > 0) & ~full):
                rows[cell][cell] = rows[cell].get(cell, Decimal(0)) + exact(self.a[cell])
            x = eliminate(rows, rhs, self.order)
            return np.array([LONG(str(v)) * LONG(a if f else b) for v, f, a, b in zip(x, full, self.a, self.b, strict=True)])

    def step(self, y: np.ndarray) -> np.ndarray:
        full = self.branch(y)
        J = np.where(full[None, :], self.A / self.a, -self.B / self.b)
        factors, z = lu_factor(J, check_finite=False), np.zeros(self.n, dtype=LONG)
        for _ in range(20):  # refinement: the equations of this sign pattern, their flows in extended precision
            G = self.balance(np.where(full, z, 0) / self.a, np.where(full, 0, -z) / self.b)
            size = float(np.max(np.abs(G))) or 1.0
            correction = lu_solve(factors, (-G / size).astype(float), check_finite=False) * LONG(size)
            z = z + correction
            if np.max(np.abs(correction)) <= 1e-15 * np.max(np.abs(z)):
                break
        return z

    def solve(self, start: tuple[np.ndarray, np.ndarray] | None = None, exactly: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """p (Pa above p_c) and r; ArithmeticError where no sign pattern is its own. exactly: with 100 digits from the first."""
        y = np.ones(self.n, dtype=LONG) if start is None else start[0] * self.a.astype(LONG) - start[1] * self.b
        for step, many in ((self.step, 60), (self.exact_step, 20)):
            if step == self.step and (exactly or float(self.k.max() / self.k.min()) > BEYOND_LU):
                continue
            for _ in range(many):
                new = step(y)
                if not np.all(np.isfinite(new)):
                    break
                pressed = np.max(np.abs(new / self.a), initial=0)
                flips = (new >= 0) != (y >= 0)
                tiny = (np.abs(new) / self.a <= max(1e-12 * pressed, self.rounding)) & (np.abs(new) / self.b <= 1e-12)
                if step == self.exact_step:  # a pressure that is 0 comes out as 1e-75
                    tiny = (np.abs(new) / self.a <= 1e-50 * pressed) | (np.abs(new) / np.minimum(self.a, self.b) <= 1e-50)
                if not np.any(flips & ~tiny):
                    return self.fields(new)
                y = new
            if not np.all(np.isfinite(y)):
                y = np.ones(self.n, dtype=LONG)
        raise ArithmeticError("the signs do not settle")


def exact(value: Any) -> Decimal:
    """A number of extended precision as it stands."""
    high = float(value)
    return Decimal(high) + Decimal(float(LONG(value) - LONG(high)))


def eliminate(rows: list[dict[int, Decimal]], rhs: list[Decimal], order: list[int]) -> list[Decimal]:
    """Gauss without pivoting, in an order that keeps the band short; consumes what it is given."""
    place = {cell: at for at, cell in enumerate(order)}
    below: list[set[int]] = [set() for _ in order]  # cells whose rows have an entry in this column, and come later
    for i, row in enumerate(rows):
        for j in row:
            if place[i] > place[j]:
                below[j].add(i)
    for k in order:
        if not rows[k].get(k):
            raise ArithmeticError("singular")
        later = {j: v for j, v in rows[k].items() if place[j] > place[k] and v}
        for i in below[k]:
            factor = rows[i].pop(k, Decimal(0)) / rows[k][k]
            if not factor:
                continue
            for j, v in later.items():
                rows[i][j] = rows[i].get(j, Decimal(0)) - factor * v
                if place[i] > place[j]:
                    below[j].add(i)
            rhs[i] -= factor * rhs[k]
    x = [Decimal(0)] * len(rows)
    for k in reversed(order):
        x[k] = (rhs[k] - sum((v * x[j] for j, v in rows[k].items() if place[j] > place[k]), Decimal(0))) / rows[k][k]
    return x
