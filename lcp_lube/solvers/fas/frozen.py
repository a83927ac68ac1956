"""J z = b and J' l = b of a film in the plane, J its Jacobian at the signs of a solution, by multigrid, two sides at once.

The cycle is that of the film itself with its signs held, for J' transposed: the same grids and conductances, the signs at the
coarse points for the coarse grids' signs. Full points alone are corrected, as void follows from the sweeps, which go along the
flow. Of J' a full point's residual goes where its pressure is interpolated from, nothing of a cavitated one's, and corrections
are interpolated as the film's residuals are restricted. GMRES removes what the fronts leave, preconditioned from the left, so
that the residual's norm is near the answer's error. That residual is what one more cycle would change: it is added at the end,
and what it leaves told from what cycles have made of the basis. How near the answer is is seen for J' by what l is for:
l' (J z) = b' z of the solution z, and it is improved until that holds. Of the void that cells store a motion exp(i nu t) makes
a part leave them, with another phase: a complex number.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...base.parallel import Array
from . import frozen_kernels
from .frozen_cycles import Cycles

# Of J' less is asked: a derivative's error is at most about lambda's relative one, and 1e-6 is promised of it.
RTOL, TRANSPOSED, MOST = 1e-9, 2e-7, 60
FEW = 15  # cycles in single precision
DROP = 1e-5  # down to which part of its start's error a basis in single precision is trusted
AGREES, LEAST = 1e-7, 1e-13  # l' (J z) and b' z, relative: cycles go on until they do, down to the least residual
FINEST = 1e-4  # a quantity that is a small part of the sizes of b' z asks for as much less of both: down to this part


class Frozen(Cycles):
    """Solves with J, J + i nu M or J' of one problem. Collective, as its methods."""

    _keen = 1.0

    def solve(
        self,
        rows: Sequence[Array],
        transposed: bool = False,
        nu: float = 0.0,
        z: Array | None = None,
        sizes: Sequence[float] = (),
    ) -> Any:
        """(J + i nu M)^-1 b, complex, or J^-1 b, J'^-1 b for each b; None where cycles stall. Collective.

        z : of J', the solution, p where the film is full and -r where it is not, by which its answers are checked.
        sizes : of the quantities b' z, which may be small against what they are made of; default as large.
        """
        if nu and self.stored is None:
            return None
        found: list[Array] = []
        self.terms: list[float] = []  # |b|' |z| of each
        for start in range(0, len(rows), 1 if nu else 2):
            some = [rows[start].real, rows[start].imag] if nu else rows[start : start + 2]
            answers = self._pair(some, transposed, nu, z, sizes[start : start + 2])
            if answers is None:
                return None
            found += [answers] if nu else list(answers)
        return found

    def _pair(self, rows: Sequence[Array], transposed: bool, nu: float, z: Array | None, sizes: Sequence[float]) -> Any:
        given, over = self.held, self._over
        self.of(len(rows), transposed, nu, single=transposed)
        self.at, self.asked = (self.bare(np.empty((len(rows), *self.levels[0].z.shape))) for _ in range(2))
        if transposed:
            return self._transposed(rows, z, sizes)
        scale: Any = np.where(self.cavity, self.leaves + (1j * nu * self.stored if nu else 0.0), 1.0)  # type: ignore[operator]
        b = np.array(rows)
        pressed = None if over is None else over * b
        self.put(self.asked, b if pressed is None else np.where(given, 0.0, self.rest_of(b, pressed)))  # type: ignore[arg-type]
        if not self._solved(None):
            return None
        x = self._found()
        x = x if pressed is None else np.where(given, pressed, x)  # type: ignore[arg-type]
        return (x[0] + 1j * x[1]) / scale if nu else x / scale

    def _transposed(self, rows: Sequence[Array], z: Array | None, sizes: Sequence[float]) -> Any:
        given, box = self.held, self.grid.box
        self._keen = 1.0
        leaves, cavity = self.leaves.reshape(box), self.cavity.reshape(box)

        def put(into: Array, values: Array, units: bool) -> None:
            frozen_kernels.in_units(values.reshape(box), cavity, leaves, units, self.own(into))

        for into, row in zip(self.asked, rows, strict=True):
            put(into, row, True)
        seen = None if z is None else np.empty_like(self.asked[0])
        if z is not None and seen is not None:
            put(self.bare(seen), z, False)
            parts = self.products(seen)
            self.terms += map(float, parts)
            some = [min(1.0, max(size / (part or 1.0), FINEST)) for size, part in zip(sizes, parts, strict=False)]
            self._keen = min(some, default=1.0)
        if given is not None:
            free = ~given.reshape(box)
            for one in (*self.asked, *(() if seen is None else (seen,))):
                self.own(one)[:] *= free
        self._known(self.asked)
        self._made = np.zeros(len(rows)) if seen is None else parts if given is None else self.products(seen)
        if not self._solved(seen):
            return None
        x = self._found()
        if given is not None and self._over is not None:
            b = np.array([np.where(self.cavity, row / self.leaves, row) for row in rows])
            x = np.asarray(np.where(given, self._over * self.rest_of(b, x), x))
        return x

    def _found(self) -> Array:
        return self.own(self.at).reshape(self.several, -1)

    def _solved(self, z: Array | None) -> bool:
        if self._gmres(z):
            return True
        if self.single:  # conductances that differ by many powers of ten
            self.of(self.several, self.transposed)
            return self._gmres(z)
        return False

    def _norms(self, a: Array) -> Array:
        return np.array([self.grid.reduce.norm(self.own(one)) for one in a])

    def _gmres(self, z: Array | None) -> bool:
        """Of the free points, which z is zero beside; of J' until x' (J z) = b' z. False where cycles stall."""
        most = self.work + self.several * (FEW if self.single else MOST + 1)
        asked = self._norms(self.asked)
        sizes = asked = np.where(asked == 0.0, 1.0, asked)
        if self.transposed:
            for into, one, unit in zip(self.c[0], self.asked, asked, strict=True):  # single precision has few powers of ten
                np.multiply(one, 1.0 / unit, out=into, casting="same_kind")
            for into, one, unit in zip(self.at, self.nested(), asked, strict=True):
                np.multiply(one, unit, out=into, dtype=float)
            norms = self._norms(self.at)
            if not np.isfinite(norms).all():
                self.at[:], norms = 0.0, 0.0 * asked
            sizes = np.where(norms > 0.0, norms, asked)
        else:
            self.at[:] = 0.0
        if self.passed[0][1] is not None:
            sizes = np.full_like(sizes, np.hypot.reduce(sizes))
        settled: bool | None = False  # with answers of one size, that both be as good
        while settled is False:
            if self.transposed:
                self.left(1.0 / sizes, self.c[0])
            else:
                np.multiply(self.asked, (1.0 / sizes).reshape(-1, 1, 1), out=self.c[0])
            settled = self._improved(sizes, z, most)
        return bool(settled)

    def _improved(self, sizes: Array, z: Array | None, most: int) -> bool | None:
        """Add to `at`, in parts of `sizes`, what its rest, which c is, asks for; whether it is good enough, None: cycles stall.

        In single precision it is at best so good that a part DROP of the start's error is left.
        """
        rtol, drop = self._keen * TRANSPOSED if self.transposed else RTOL, DROP if self.single else 0.0
        norm, total = self.grid.reduce.norm, self.grid.comm.allreduce
        V, H = [self.z[0]], np.zeros((MOST + 2, MOST + 1))  # vectors apart: large pages are waited for
        V[0][:] = 0.0
        self.cycle(V[0])
        self.c[0][:] = 0.0
        first, y = norm(V[0].ravel()), np.zeros(0)
        if not np.isfinite(first):
            return None
        size = np.hypot.reduce(self._norms(self.at) / sizes) or first  # of the answer
        left_over = np.array([first])  # the residual in the basis V
        V[0] /= first or 1.0
        for k in range(MOST + 1):
            # One more cycle takes x to x + rest; what it leaves of `rest` is taken to be what it leaves of the basis at most.
            left = np.linalg.norm(left_over) * min(1.0, np.linalg.norm(np.eye(k + 1, k) - H[: k + 1, :k], 2) if k else 1.0)
            if left <= max(rtol * size, drop * first):
                change = np.append(y, 0.0) + left_over
                self._add(V, change, sizes)
                size = min(size, np.hypot.reduce(self._norms(self.at) / sizes))
                if left <= rtol * size and (z is None or self._agrees(z)):
                    return True
                if left <= LEAST * size:
                    return None
                if left <= drop * first:
                    return False
                self._add(V, -change, sizes)
            if self.work >= most:
                return None
            V.append(V[k].copy())
            self.cycle(V[k + 1])
            w = V[k + 1].ravel()
            np.subtract(V[k].ravel(), w, out=w)
            for _ in range(2 if k > 8 else 1):  # rounding has left long bases less orthogonal
                part = total(np.array([np.dot(v.ravel(), w) for v in V[: k + 1]]))
                for v, one in zip(V, part, strict=False):
                    frozen_kernels.add(V[k + 1], v, np.full(self.several, -one))
                H[: k + 1, k] += part
            H[k + 1, k] = norm(w)
            if not np.isfinite(H[k + 1, k]):
                return None
            w /= H[k + 1, k] or 1.0
            target = np.append(first, np.zeros(k + 1))
            y = np.linalg.lstsq(H[: k + 2, : k + 1], target, rcond=None)[0]
            left_over = target - H[: k + 2, : k + 1] @ y
        return None

    def _add(self, V: Sequence[Array], parts: Array, sizes: Array) -> None:
        for v, part in zip(V, parts, strict=True):
            frozen_kernels.add(self.at, v, part * sizes)

    def _agrees(self, z: Array) -> bool:
        """Whether x' (J z) = b' z, each."""
        return bool((np.abs(self.misfits(z)) <= self._keen * AGREES * self._made).all())
