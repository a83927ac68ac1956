"""Lines of a fluid whose density follows the pressure, by quadrature: what the density changes of them.

With rho in units of rho_0, Q = rho (U h - h^3 p'/(6 mu)), so that a full film has

    p' = 6 mu (U/h^2 - Q/(rho h^3)):

all of `line` holds with h^-3/rho in the place of h^-3, and h rho in that of h where it is compared with Q/U. A face of the
discrete equations has its two points' mean density, and Int h^-3 over that. rho is that of the pressures found, again and
again: each time it changes by some hundredths of what it changed by before.
"""

from __future__ import annotations

import numpy as np

from ...base.parallel import Array
from .fluid import Law
from .integrals import TO_POWERS, LineIntegrals
from .line import Line


class Swell:
    """1/rho along a line, a polynomial in every panel.

    Parameters
    ----------
    ends : of the panels, m. values : at their Gauss points, shape (panels, 8).
    """

    def __init__(self, ends: Array, values: Array):
        self._ends, self._parts = ends, TO_POWERS @ values.T

    def __call__(self, x: Array) -> Array:
        k = np.clip(np.searchsorted(self._ends, x, side="right") - 1, 0, self._ends.size - 2)
        a, b = self._ends[k], self._ends[k + 1]
        at, out = np.clip((2.0 * x - a - b) / (b - a), -1.0, 1.0), self._parts[-1][k]
        for part in self._parts[-2::-1]:
            out = out * at + part[k]
        return out


def swollen(line: LineIntegrals, found: Line, law: Law) -> LineIntegrals:
    """A line with the densities that a film on it has."""
    swell = Swell(found.integrals.ends, 1.0 / law.density(law.pressure(found.q_within)))
    out = LineIntegrals(line.film, np.union1d(line.ends, np.concatenate(found.fronts)), fine=True, swell=swell)
    out.ring = line.ring
    return out


def swollen_parts(parts: Array, p: Array, law: Law) -> Array:
    """`LineIntegrals.parts` with the mean densities of the points around; p : Pa above p_c, at both ends too."""
    rho = law.density(p)
    return parts / np.stack([np.ones(p.size - 1)] * 2 + [0.5 * (rho[1:] + rho[:-1])])
