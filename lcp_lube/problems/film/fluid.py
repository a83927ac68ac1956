"""Fluids whose viscosity and density depend on the pressure.

p is the pressure above the cavitation pressure, at which the viscosity is mu and the density rho_0.

    Barus             mu(p) = mu exp(b p)
    Dowson-Higginson  rho(p)/rho_0 = (C + 1.66 p)/(C + p),  C = 2.22e9 Pa

Barus' law needs no iteration: (1/mu(p)) dp/dx = (1/mu) dq/dx with q = (1 - exp(-b p))/b, which has the sign of p, so q solves
the complementarity problem of a fluid of constant viscosity. Where b q reaches 1 no pressure carries the flow. Density
multiplies the flow through every face, by the mean of its two points' values; `drivers.coupling` iterates on it.
"""

from dataclasses import dataclass

import numpy as np

from ...base.parallel import Array

BULK, SLOPE = 2.22e9, 1.66  # C in Pa and the factor of p above


@dataclass(frozen=True)
class Law:
    """barus : b, 1/Pa; 0: constant viscosity. dowson_higginson : whether density depends on p."""

    barus: float = 0.0
    dowson_higginson: bool = False

    def reduced(self, p: Array) -> Array:
        """q of p, Pa."""
        return -np.expm1(-self.barus * p) / self.barus if self.barus else p

    def pressure(self, q: Array) -> Array:
        """p of q, Pa; inf or NaN where there is none."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return -np.log1p(-self.barus * q) / self.barus if self.barus else q

    def viscosity(self, p: Array) -> Array:
        """mu(p)/mu."""
        return np.exp(self.barus * p)

    def density(self, p: Array) -> Array:
        """rho(p)/rho_0."""
        return (BULK + SLOPE * p) / (BULK + p) if self.dowson_higginson else np.ones_like(p)

    def density_slope(self, p: Array) -> Array:
        """d(rho/rho_0)/dp, 1/Pa."""
        return (SLOPE - 1.0) * BULK / (BULK + p) ** 2 if self.dowson_higginson else np.zeros_like(p)

    def mobility(self, a: Array, b: Array) -> Array:
        """(q(b) - q(a))/(b - a): mu over the viscosity that acts between the pressures a and b."""
        step = self.barus * (b - a)
        safe = np.where(np.abs(step) > 1e-12, step, 1.0)
        return np.exp(-self.barus * a) * np.where(np.abs(step) > 1e-12, -np.expm1(-safe) / safe, 1.0)
