"""Elastohydrodynamic line contact: pressure between two rollers that flatten elastically, dimensionless.

The gap h depends on all of the pressure, and a free unknown k shifts it until the pressure carries the load. On
[a, b] with x_i = a + i dx, dx = (b - a)/n, unknowns p_1 ... p_{n-1} (p_0 = p_n = 0) and k:

    h_j = x_{j+1/2}^2 + k + 1 + (1/pi) sum_i w_i d ln|d| (p_{i+1} - p_{i-1}),   d = (i - j - 1/2) dx,   w_0 = w_n = 1/2,
    q_j = lambda h_j - h_j^3 exp(-alpha (p_j + p_{j+1})/2) (p_{j+1} - p_j)/dx,
    0 <= p_i  and  q_i - q_{i-1} >= 0, complementary;      1 - (2 dx/pi) sum_i w_i p_i = 0,  k free

(Kostreva, Int. J. Numer. Methods Fluids 4 (1984) 377; Bergamaschi and Zilli, section 4, where p is missing under an
integral). Where p > 0 the flow q is constant; behind x_b, the end of the contact, p = 0 and the gap opens.
"""

from typing import Any

import numpy as np
from petsc4py import PETSc

from ..base.owned import made
from ..base.parallel import Array
from .box import BoxProblem
from .certificate import Certificate, certificate_tol
from .grid import Grid
from .solution import Fields

BLOCK = 16  # columns


class EhlProblem(BoxProblem):
    """Line contact as a box problem of n equations with a dense Jacobian; the last unknown, k, is free, in p_n = 0's place.

    Parameters
    ----------
    grid : x_1 ... x_n; its last point is the end b of the interval.
    alpha, lam : viscosity's exponent and the speed parameter.
    k0 : where k starts; p starts from the positive part of 1 - x^2/4.
    row_scale : factor of the flow equations q_i - q_{i-1}; 1/dx makes them the published divergence.
    """

    kind = "mixed"
    dense = True

    def __init__(self, grid: Grid, alpha: float, lam: float, k0: float, row_scale: float = 1.0):
        self.alpha, self.lam, self.row_scale, self._k0 = alpha, lam, row_scale, k0
        self.dx = grid.spacing[0]
        self.has_k = grid.x_end == grid.size
        n, first, count = grid.size, grid.x_start, grid.local_size
        # Faces j = first to first + count, one before each own point and one behind the last.
        self.x_faces = grid.origin[0] + (np.arange(first, first + count + 1) + 0.5) * self.dx
        # d ln|d|/pi for i - j from -(first + count) to n - first: row j of the kernel is a stretch of n + 1 of them.
        d = (np.arange(-(first + count), n - first + 1) - 0.5) * self.dx
        self._kernel = d * np.log(np.abs(d)) / np.pi
        # dh_j/dp_m but for the ends' weights: column m of the own faces is a stretch of these, from the end.
        self._differences = (self._kernel[:-2] - self._kernel[2:])[::-1].copy()
        self._rows = np.arange(count - self.has_k)
        lower, upper = np.zeros(count), np.full(count, np.inf)
        v0 = np.maximum(1.0 - grid.x[0] ** 2 / 4.0, 0.0)
        if self.has_k:
            lower[-1], v0[-1] = -np.inf, k0
        super().__init__(grid, lower, upper, v0)

    def __reduce__(self) -> tuple[Any, ...]:
        return EhlProblem, (self.grid, self.alpha, self.lam, self._k0, self.row_scale)

    @made
    def mat(self) -> PETSc.Mat:
        size = (self.grid.local_size, self.grid.size)
        mat = PETSc.Mat().createDense((size, size), comm=self.grid.petsc_comm)
        mat.setUp()
        return mat

    def split(self, v: Array) -> tuple[Array, float]:
        """All of p, p_0 and p_n included, and k, on every rank: a dense problem needs no less. Collective."""
        parts = np.concatenate([[0.0], *self.grid.comm.allgather(v)])
        k = float(parts[-1])
        parts[-1] = 0.0
        return parts, k

    def gap(self, p: Array, k: float) -> Array:
        """h at the own faces, from the whole of p."""
        slope = np.zeros(p.size)
        slope[1:-1] = p[2:] - p[:-2]
        slope[0], slope[-1] = 0.5 * p[1], -0.5 * p[-2]
        # 'valid' correlation runs through the rows from the last face to the first.
        return self.x_faces**2 + k + 1.0 + np.correlate(self._kernel, slope, "valid")[::-1]

    def flow(self, p: Array, h: Array) -> tuple[Array, Array, Array]:
        """q at the own faces, h^3 exp(-alpha p) there, and dp/dx. Behind x_n, where there is no face, p stays 0."""
        first, count = self.grid.x_start, self.grid.local_size
        left, right = p[first : first + count + 1], np.append(p, 0.0)[first + 1 : first + count + 2]
        with np.errstate(over="ignore", invalid="ignore"):  # inf and NaN are what the outer loop then reports
            slope = (right - left) / self.dx
            mobility = h**3 * np.exp(-0.5 * self.alpha * (left + right))
            return self.lam * h - mobility * slope, mobility, slope

    def load_defect(self, p: Array) -> float:
        """1 - (2 dx/pi) sum p_i, from the whole of p."""
        return float(1.0 - 2.0 * self.dx / np.pi * np.sum(p))

    def residual(self, v: Array) -> Array:
        """The flow equations times scale, and the load balance as the last row. Collective."""
        p, k = self.split(v)
        with np.errstate(invalid="ignore"):
            F = self.row_scale * np.diff(self.flow(p, self.gap(p, k))[0])
        if self.has_k:
            F[-1] = self.load_defect(p)
        return F

    def jacobian(self, v: Array) -> PETSc.Mat:
        """dF/dv, dense. Collective.

        dq_j/dp_m = (lambda - 3 q^_j/h_j) dh_j/dp_m + (what p_j and p_{j+1} add), q^ = h^3 exp(-alpha p) dp/dx, where
        dh_j/dp_m = w_{m-1} K_{m-1-j} - w_{m+1} K_{m+1-j} is constant along diagonals, so it needs no matrix of its own.
        """
        p, k = self.split(v)
        h = self.gap(p, k)
        _, mobility, slope = self.flow(p, h)
        by_h = self.row_scale * (self.lam - 3.0 * mobility * slope / h)
        by_left = self.row_scale * mobility * (1.0 / self.dx + 0.5 * self.alpha * slope)
        by_right = self.row_scale * mobility * (-1.0 / self.dx + 0.5 * self.alpha * slope)
        n, first, rows = self.grid.size, self.grid.x_start, self._rows
        J = self.mat.getDenseArray()  # column-major: its transpose is filled along memory
        columns = np.lib.stride_tricks.sliding_window_view(self._differences, by_h.size)[::-1]
        for block in np.split(np.arange(n - 1), range(BLOCK, n - 1, BLOCK)):  # a few columns at a time stay in the cache
            part = slice(block[0], block[-1] + 1)
            np.multiply(columns[part, 1:], by_h[1:], out=J.T[part])
            J.T[part] -= columns[part, :-1] * by_h[:-1]
        J[:, 0] -= 0.5 * np.diff(by_h * self._kernel[by_h.size - 1 :: -1])
        J[:, n - 2] += 0.5 * np.diff(by_h * self._kernel[n:][::-1])
        J[:, n - 1] = np.diff(by_h)
        at = first + rows  # column of p_i in row i, for the own pressures
        J[rows, at] += by_left[1:][rows] - by_right[:-1][rows]
        inner = rows[at < n - 2]
        J[inner, first + inner + 1] += by_right[1:][inner]
        inner = rows[at > 0]
        J[inner, first + inner - 1] -= by_left[:-1][inner]
        if self.has_k:
            J[-1, : n - 1], J[-1, n - 1] = -2.0 * self.dx / np.pi, 0.0
        del J
        self.mat.assemble()
        return self.mat

    def scale(self, v: Array) -> float:
        """Largest flow that the walls drag into a cell, lambda |h_i - h_{i-1}|. Collective."""
        p, k = self.split(v)
        return self.row_scale * self.lam * self.reduce.max(np.abs(np.diff(self.gap(p, k))))

    def certify(self, fields: Fields, eps1: float) -> Certificate:
        """Certificate of p and k, from the data alone. Collective.

        residual: largest natural residual |min(p_i/p_max, F_i/s)|, s the largest flow that the walls drag into a cell;
        balance: |1 - (2 dx/pi) sum p|, the part of the load that p does not carry.
        """
        v = fields["v"]
        natural = np.minimum(*self.scaled(v))
        defect = self.load_defect(self.split(v)[0])
        return Certificate(
            measures={"residual": self.reduce.max(np.abs(natural)), "balance": abs(defect)},
            tol=certificate_tol(eps1),
        )

    def scaled(self, v: Array) -> tuple[Array, Array]:
        """p_i/p_max and F_i/s at this rank's points, both about 1 at most; the larger one holds. Collective."""
        own = slice(v.size - self.has_k)
        p_max = self.reduce.max(np.abs(v[own])) or 1.0
        return v[own] / p_max, self.residual(v)[own] / (self.scale(v) or 1.0)

    def quantities(self, fields: Fields) -> dict[str, Any]:
        """k, x_b, h_min, p_max, dimensionless. Collective."""
        p, k = self.split(fields["v"])
        return {
            "k": k,
            "x_b": self.end_of_contact(p, fields),
            "h_min": self.reduce.min(self.gap(p, k)[: -1 if self.has_k else None]),
            "p_max": float(np.max(p)),
        }

    def end_of_contact(self, p: Array, fields: Fields) -> float | None:
        """x_b: where p = p' = 0, so that sqrt(p) falls linearly to zero; None with too few points or an overflow. Collective.

        From the last four points with p > 0 but one, by least squares: the last one has the discrete front's error. First
        order in dx.
        """
        force, opening = self.scaled(fields["v"])
        in_contact = np.flatnonzero(force > opening)
        last = self.reduce.max(self.grid.first + in_contact + 1.0)  # numbers of points, from 1
        if last < 5 or not np.all(np.isfinite(p)):
            return None
        at = int(last) - np.arange(4, 0, -1)
        t, y = at - last, np.sqrt(np.maximum(p[at], 0.0))
        rate, value = np.polyfit(t, y, 1)
        return float(self.grid.origin[0] + self.dx * (last - value / rate)) if rate < 0 else None

    def physical(self, fields: Fields) -> dict[str, tuple[Array, str]]:
        """p and h at the points; they have no unit. Collective."""
        p, k = self.split(fields["v"])
        h = self.gap(p, k)
        first = self.grid.first
        return {"p": (p[first + 1 : first + 1 + self.grid.local_size].copy(), ""), "h": (0.5 * (h[1:] + h[:-1]), "")}
