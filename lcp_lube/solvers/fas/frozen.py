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
from .frozen_cycles import Cycles

# Of J' less is asked: a derivative's error is at most about lambda's relative one, and 1e-6 is promised of it.
RTOL, TRANSPOSED, MOST = 1e-9, 2e-7, 60
FEW, MANY = 15, 10  # cycles in single precision, and vectors of a basis that is not a long one
DROP = 1e-5  # down to which part of its start's error a basis in single precision is trusted
AGREES, LEAST = 1e-7, 1e-13  # l' (J z) and b' z, relative: cycles go on until they do, down to the least residual
FINEST = 1e-4  # a quantity that is a small part of the sizes of b' z asks for as much less of both: down to this part


class Frozen(Cycles):
    """Solves with J, J + i nu M or J' of one problem. Collective, as its methods."""

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
        for start in range(0, len(rows), 1 if nu else 2):
            some = np.array([rows[start].real, rows[start].imag] if nu else rows[start : start + 2])
            answers = self._pair(some, transposed, nu, z, sizes[start : start + 2])
            if answers is None:
                return None
            found += [answers] if nu else list(answers)
        return found

    def _pair(self, b: Array, transposed: bool, nu: float, z: Array | None, sizes: Sequence[float]) -> Any:
        self._keen = 1.0
        if z is not None and sizes:
            parts = [self.grid.reduce.dot(np.abs(row), np.abs(z)) for row in b]
            self._keen = min(min(1.0, max(size / (part or 1.0), FINEST)) for size, part in zip(sizes, parts, strict=True))
        given, over = self.held, self._over
        self.of(len(b), transposed, nu, single=transposed)
        scale: Any = np.where(self.cavity, self.leaves + (1j * nu * self.stored if nu else 0.0), 1.0)  # type: ignore[operator]
        b = b / scale if transposed else b
        at = scale * z if transposed and z is not None else None
        if given is None or over is None:
            x = self._solved(b, at)
        elif transposed:
            x = self._solved(np.where(given, 0.0, b), None if at is None else np.where(given, 0.0, at))
            x = None if x is None else np.where(given, over * self._rest(b, x, None), x)
        else:
            pressed = over * b
            x = self._solved(np.where(given, 0.0, self._rest(b, pressed, None)))
            x = None if x is None else np.where(given, pressed, x)
        if x is None or transposed:
            return x
        return (x[0] + 1j * x[1]) / scale if nu else x / scale

    def _solved(self, b: Array, z: Array | None = None) -> Array | None:
        x = self._gmres(b, z)
        if x is None and self.single:  # conductances that differ by many powers of ten
            self.of(self.several, self.transposed)
            x = self._gmres(b, z)
        return x

    def _gmres(self, b: Array, z: Array | None = None) -> Array | None:
        """Of the free points, which z is zero beside; of J' until x' (J z) = b' z. None where cycles stall."""
        norm, x, most = self.grid.reduce.norm, np.zeros_like(b), self.work + self.several * (FEW if self.single else MOST + 1)
        if self.transposed:
            units = np.array([norm(asked) or 1.0 for asked in b]).reshape(-1, 1)  # single precision has few powers of ten
            nested = self.nested(b / units).reshape(b.shape) * units
            x = nested if np.isfinite(self.grid.comm.allreduce(float(np.sum(nested)))) else x
        sizes: Any = np.array([norm(one) or norm(asked) or 1.0 for one, asked in zip(x, b, strict=True)])
        sizes = sizes.reshape(-1, 1) if self.passed[0][1] is None else np.hypot(*sizes)
        b, x = b / sizes, x / sizes  # answers of one size, that both be as good
        settled = False
        while not settled:
            rest = self._rest(b, x, self.free[0]) if self.transposed else b
            found = self._improved(x, rest, b, z, most)
            if found is None:
                return None
            x, settled = found
        return x * sizes

    def _improved(self, start: Array, rest: Array, b: Array, z: Array | None, most: int) -> tuple[Array, bool] | None:
        """A better answer than one that leaves `rest`, and whether it is good enough; None where cycles stall.

        In single precision it is at best so good that a part DROP of the start's error is left.
        """
        rtol, drop = self._keen * TRANSPOSED if self.transposed else RTOL, DROP if self.single else 0.0
        norm, total = self.grid.reduce.norm, self.grid.comm.allreduce
        self._put(self.c[0], rest)
        V, H = np.empty((MANY, rest.size), self.z[0].dtype), np.zeros((MOST + 2, MOST + 1))
        self.change(None, V[0])
        self.c[0][:] = 0.0
        first, y = norm(V[0]), np.zeros(0)
        size, left_over = norm(start) or first, np.array([first])  # of the answer; the residual in the basis V
        if not np.isfinite(first):
            return None
        V[0] /= first or 1.0
        for k in range(MOST + 1):
            # One more cycle takes x to x + rest; what it leaves of `rest` is taken to be what it leaves of the basis at most.
            left = np.linalg.norm(left_over) * min(1.0, np.linalg.norm(np.eye(k + 1, k) - H[: k + 1, :k], 2) if k else 1.0)
            if left <= max(rtol * size, drop * first):
                x = start + ((np.append(y, 0.0) + left_over).astype(V.dtype) @ V[: k + 1]).reshape(start.shape)
                size = min(size, norm(x))
                if left <= rtol * size and (z is None or self._agree(x, b, z)):
                    return x, True
                if left <= LEAST * size:
                    return None
                if left <= drop * first:
                    return x, False
            if self.work >= most:
                return None
            if k + 1 == len(V):
                V = np.concatenate([V, np.empty_like(V)])
            w = V[k + 1]
            np.negative(self.change(V[k], w), out=w)
            for _ in range(2 if k > 8 else 1):  # rounding has left long bases less orthogonal
                part = total(V[: k + 1] @ w)
                w -= part @ V[: k + 1]
                H[: k + 1, k] += part
            H[k + 1, k] = norm(w)
            if not np.isfinite(H[k + 1, k]):
                return None
            w /= H[k + 1, k] or 1.0
            target = np.append(first, np.zeros(k + 1))
            y = np.linalg.lstsq(H[: k + 2, : k + 1], target, rcond=None)[0]
            left_over = target - H[: k + 2, : k + 1] @ y
        return None

    def _agree(self, found: Array, b: Array, z: Array) -> bool:
        """Whether x' (J z) = b' z, each."""
        dot, rest = self.grid.reduce.dot, self._rest(b, found, self.free[0])
        return all(
            abs(dot(left, z)) <= self._keen * AGREES * dot(np.abs(asked), np.abs(z))
            for left, asked in zip(rest, b, strict=True)
        )
