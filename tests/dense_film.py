"""A film solved without the package's discretisation, matrices or methods: what `wild_films` are compared with.

Faces are listed one by one, flows through them and the balances of the cells computed in extended precision, so that they
telescope whatever the film ratio; steps are semismooth Newton steps by dense elimination. A wall that moves to smaller x is
discretised as it stands, upwind from the east. The answer of a Newton step that changes no sign is the discrete solution,
which is unique; where steps cycle, they start again from the package's answer, and have to end there all the same.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.linalg import lu_factor, lu_solve

LONG = np.longdouble
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


def places(n: int, length: float, first: str, last: str) -> tuple[np.ndarray, np.ndarray, float]:
    """Coordinates of the points with a neighbour before and behind, of the faces, and the spacing."""
    offset = {"open": 1.0, "closed": 0.5, "periodic": 0.5}
    meshes = n + offset[first] + offset[last] - 1.0
    points, faces = np.arange(-1, n + 1), np.arange(0, n + 1)
    if first == "periodic":
        points, faces = points % n, faces % n
    lines = (np.clip(points + offset[first], 0, meshes), np.clip(faces + offset[first] - 0.5, 0, meshes))
    return lines[0] * (length / meshes), lines[1] * (length / meshes), length / meshes


def inside(jumps: Any, a: float, b: float) -> list[float]:
    return [t for t in sorted(set(jumps)) if a + 1e-9 * (b - a) <= t < b - 1e-9 * (b - a)] if b > a else []


def resistance(
    film: Any, a: float, b: float, plain: float, s: float, width: float, jumps: Any, across: Any
) -> tuple[float, float]:
    """C and H of the face between points a and b on the line s: in series along t, side by side across it.

    plain : film at the face, for a face without jumps.
    """
    cuts, found = inside(across, s - 0.5 * width, s + 0.5 * width), inside(jumps, a, b)
    if not cuts and not found:
        return plain**3, plain
    ends = [s - 0.5 * width, *cuts, s + 0.5 * width]
    C = H = 0.0
    for low, high in pairwise(ends):
        middle, share = (0.5 * (low + high), (high - low) / width) if cuts else (s, 1.0)
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


def discretise(scene: Any) -> tuple[Faces, int, np.ndarray]:
    """Faces, number of cells, and the cells with a wall downstream, whose own void goes nowhere."""
    model, shape = scene.model, scene.shape
    nx, ny = (*shape, 1)[:2]
    kinds = [side.kind for side in model.sides]
    p_side = [side.p if side.kind == "open" else 0.0 for side in model.sides]
    mu, U, scheme = model.mu, model.U, model.scheme
    jumps = getattr(model.gap, "jumps", lambda axis: ())
    ways = kinds[:2] if U >= 0 else kinds[1::-1]
    xs, xf, dx = places(nx, model.lengths[0], *ways)
    if U < 0:  # counted from the inlet: where the film jumps, the last bit of x decides which side of it is meant
        xs, xf = model.lengths[0] - xs[::-1], model.lengths[0] - xf[::-1]
    plane = len(shape) == 2
    ys, yf, dy = places(ny, model.lengths[1], *kinds[2:]) if plane else (np.zeros(3), np.zeros(2), 1.0)
    jx, jy = jumps("x"), jumps("y")

    def film(x: Any, y: Any) -> np.ndarray:
        x, y = np.atleast_1d(x), np.atleast_1d(y)
        return np.broadcast_to(model.gap(x[None, :], y[:, None]), (y.size, x.size))

    at_points, at_x_faces = film(xs, ys[1:-1]), film(xf, ys[1:-1])
    faces = Faces(*([] for _ in range(10)))
    dead = np.zeros(nx * ny, dtype=bool)
    for m in range(ny):
        y = float(ys[m + 1])
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
            along = lambda t, s, f=f: film(xf[f] if t is None else t, s)[0, 0]  # noqa: E731
            C, H = resistance(along, float(xs[f]), float(xs[f + 1]), float(at_x_faces[m, f]), y, dy, jx, jy)
            i, j = m * nx + (f - 1) % nx, m * nx + f % nx
            h_up = h[f] if U >= 0 else h[f + 1]
            u, b = {"face": (U * H, U * H), "nodal": (U * H, U * h_up), "upwind": (U * h_up, U * h_up)}[scheme]
            word = {"b_i": b} if U >= 0 else {"b_j": -b}
            if ends[0] and kinds[0] == "open":
                faces.add(-1, j, C / (6 * mu * dx), u=u, p_i=p_side[0], r_i=model.sides[0].r, **word)
            elif ends[1]:
                faces.add(i, -1, C / (6 * mu * dx), u=u, p_j=p_side[1], r_j=model.sides[1].r, **word)
            else:
                faces.add(i, j, C / (6 * mu * dx), u=u, **word)
    if plane:
        at_y_faces = film(xs[1:-1], yf)
        for f in range(ny + 1):
            side = 2 if f == 0 else 3
            if (f in (0, ny) and kinds[side] == "closed") or (f == ny and kinds[3] == "periodic"):
                continue
            for l in range(nx):
                a, b = float(ys[f]), float(ys[f + 1])
                across = lambda t, s, f=f: film(s, yf[f] if t is None else t)[0, 0]  # noqa: E731
                C, _ = resistance(across, a, b, float(at_y_faces[f, l]), float(xs[l + 1]), dx, jy, jx)
                k = C * dx / (6 * mu * dy**2)
                i, j = (f - 1) % ny * nx + l, f % ny * nx + l
                if f == 0 and kinds[2] == "open":
                    faces.add(-1, j, k, p_i=p_side[2])
                elif f == ny:
                    faces.add(i, -1, k, p_j=p_side[3])
                else:
                    faces.add(i, j, k)
    return faces, nx * ny, dead


class Dense:
    """Balances G(y) of the cells, p = max(y, 0)/a and r = max(-y, 0)/b, and Newton's method on them."""

    def __init__(self, scene: Any):
        faces, self.n, dead = discretise(scene)
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

    def step(self, y: np.ndarray) -> np.ndarray:
        full = y >= 0
        if self.ring:  # one that is empty all round has no steady flow
            lines, values = full.reshape(-1, self.ring), y.reshape(-1, self.ring)
            empty = np.flatnonzero(~lines.any(axis=1))
            lines[empty, np.argmax(values[empty], axis=1)] = True
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

    def solve(self, start: tuple[np.ndarray, np.ndarray] | None = None) -> tuple[np.ndarray, np.ndarray]:
        """p (Pa above p_c) and r; ArithmeticError where no sign pattern is its own."""
        y = np.ones(self.n, dtype=LONG) if start is None else start[0] * self.a.astype(LONG) - start[1] * self.b
        for _ in range(60):
            new = self.step(y)
            if not np.all(np.isfinite(new)):
                break
            pressed = np.max(np.abs(new / self.a), initial=0)
            flips = (new >= 0) != (y >= 0)
            tiny = (np.abs(new) / self.a <= max(1e-12 * pressed, self.rounding)) & (np.abs(new) / self.b <= 1e-12)
            if not np.any(flips & ~tiny):
                return self.fields(new)
            y = new
        raise ArithmeticError("the signs do not settle")
