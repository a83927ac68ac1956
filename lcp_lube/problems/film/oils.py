"""Viscosity by temperature: exponential law, Vogel's, Walther's (ASTM D341), and oils by their ISO grade.

    exponential  mu = mu_1 exp(-beta (T - T_1))
    Vogel        mu = a exp(b/(T - c))
    Walther      log10 log10(nu + 0.7) = A - B log10 T,  nu = mu/rho in mm2/s (ASTM D341)
    Roelands     log(mu) + 9.67 = a (T - 138)^-s,  mu in Pa s (the part of T in Roelands' equation)

Kinematic viscosities at 40 degrees C are the middles of ISO 3448's grades (6.8 mm2/s of grade 7); those at 100 belong to a
viscosity index of 100, by the equations of ASTM D2270, which begin at 2 mm2/s there, 6.394 at 40: for grades 2, 3 and 5 (2.2,
3.2 and 4.6) they say nothing, and one viscosity alone is no law. Density and specific heat of a mineral oil are typical values,
not the grade's.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp, log, log10

import numpy as np

from ...base.parallel import Array
from ...errors import InputError, nearest

LOWEST, HIGHEST = 200.0, 600.0  # K: no oil is one outside
WALTHER = 0.7  # mm2/s
ROELANDS_T, ROELANDS_MU, ROELANDS_P = 138.0, 9.67, 1.96e8  # K, of log(mu/(Pa s)), Pa
DENSITY, SPECIFIC_HEAT = 870.0, 2000.0  # kg/m3, J/(kg K): typical of mineral oils
# Grade: mm2/s at 40 and at 100 degrees C.
GRADES = {
    7: (6.8, 2.081),
    10: (10.0, 2.659),
    15: (15.0, 3.410),
    22: (22.0, 4.294),
    32: (32.0, 5.362),
    46: (46.0, 6.770),
    68: (68.0, 8.729),
    100: (100.0, 11.381),
    150: (150.0, 15.022),
    220: (220.0, 19.437),
    320: (320.0, 24.951),
    460: (460.0, 31.769),
    680: (680.0, 41.134),
    1000: (1000.0, 52.765),
    1500: (1500.0, 68.333),
    2200: (2200.0, 86.792),
    3200: (3200.0, 109.094),
}
THIN = (2, 3, 5)  # grades of ISO 3448 without a viscosity index
NAMES = [f"ISO VG {grade}" for grade in GRADES]


@dataclass(frozen=True)
class Exponential:
    """mu_1 (Pa s) at T_1 (K), beta in 1/K."""

    mu_1: float
    T_1: float
    beta: float

    def __call__(self, T: Array) -> Array:
        return self.mu_1 * np.exp(-self.beta * (np.asarray(T) - self.T_1))

    def T(self, mu: Array) -> Array:
        return self.T_1 - np.log(mu / self.mu_1) / np.float64(self.beta)

    @classmethod
    def through(cls, T: Sequence[float], mu: Sequence[float]) -> "Exponential":
        return cls(mu[0], T[0], log(mu[0] / mu[1]) / (T[1] - T[0]))


@dataclass(frozen=True)
class Vogel:
    """a in Pa s, b and c in K; c lies below all temperatures."""

    a: float
    b: float
    c: float

    def __call__(self, T: Array) -> Array:
        return self.a * np.exp(self.b / (np.asarray(T) - self.c))

    def T(self, mu: Array) -> Array:
        return self.c + self.b / np.log(np.maximum(mu / self.a, 1.0))

    @classmethod
    def through(cls, T: Sequence[float], mu: Sequence[float]) -> "Vogel":
        """From three points: with y = log mu, the ratio of the slopes gives c.

        Raises
        ------
        InputError : points that no such law passes through.
        """
        first, second = (log(mu[k] / mu[k + 1]) / (T[k + 1] - T[k]) for k in (0, 1))
        # log(mu_1/mu_2) = b (T_2 - T_1)/((T_1 - c)(T_2 - c)): first/second = (T_3 - c)/(T_1 - c).
        ratio = first / second
        if not ratio > 1.0 + 1e-9:
            raise InputError("three points whose log(mu) does not bend upwards: no law of Vogel's passes through them")
        c = (ratio * T[0] - T[2]) / (ratio - 1.0)
        b = first * (T[0] - c) * (T[1] - c)
        if not c < LOWEST:
            raise InputError(f"Vogel's law through these points has its pole at {c:.4g} K: below {LOWEST:g} K is needed")
        return cls(mu[0] * exp(-b / (T[0] - c)), b, c)


@dataclass(frozen=True)
class Walther:
    """A, B of ASTM D341, rho in kg/m3."""

    A: float
    B: float
    rho: float

    def __call__(self, T: Array) -> Array:
        with np.errstate(over="ignore"):
            nu = 10.0 ** (10.0 ** (self.A - self.B * np.log10(np.asarray(T)))) - WALTHER
        return np.maximum(nu, 1e-3) * 1e-6 * self.rho

    def T(self, mu: Array) -> Array:
        return 10.0 ** ((self.A - np.log10(np.log10(mu / (1e-6 * self.rho) + WALTHER))) / self.B)

    @classmethod
    def through(cls, T: Sequence[float], nu: Sequence[float], rho: float) -> "Walther":
        """From kinematic viscosities in mm2/s at two temperatures. Raises InputError for those below the law's least."""
        if not min(nu) > 1.0 - WALTHER:
            raise InputError(f"{min(nu):.4g} mm2/s: Walther's law is for kinematic viscosities above {1.0 - WALTHER:g} mm2/s")
        y = [log10(log10(one + WALTHER)) for one in nu]
        B = (y[0] - y[1]) / (log10(T[1]) - log10(T[0]))
        return cls(y[0] + B * log10(T[0]), B, rho)


@dataclass(frozen=True)
class Roelands:
    """a, s of Roelands' equation."""

    a: float
    s: float

    def __call__(self, T: Array) -> Array:
        return np.exp(self.a * (np.asarray(T) - ROELANDS_T) ** -self.s - ROELANDS_MU)

    def T(self, mu: Array) -> Array:
        return ROELANDS_T + (self.a / (np.log(mu) + ROELANDS_MU)) ** (1.0 / self.s)

    @classmethod
    def through(cls, T: Sequence[float], mu: Sequence[float]) -> "Roelands":
        """Raises InputError for viscosities below the law's least."""
        y = [log(one) + ROELANDS_MU for one in mu]
        if not min(y) > 0:
            raise InputError(f"mu = {min(mu):g}: Roelands' law is for viscosities above {exp(-ROELANDS_MU):.3g} Pa s")
        s = log(y[0] / y[1]) / log((T[1] - ROELANDS_T) / (T[0] - ROELANDS_T))
        return cls(y[0] * (T[0] - ROELANDS_T) ** s, s)


# mu(T), Pa s, of temperatures in K; T(mu) the other way round, inf or NaN where none is so hot.
Viscosity = Exponential | Vogel | Walther | Roelands


def named(name: str, rho: float = DENSITY) -> Walther:
    """An oil by its grade, 'ISO VG 32'.

    Raises
    ------
    InputError : no such grade.
    """
    words = name.upper().replace("ISO", "").replace("VG", "").replace("-", " ").split()
    grade = int(words[0]) if len(words) == 1 and words[0].isdigit() and "VG" in name.upper() else -1
    if grade not in GRADES:
        if grade in THIN:
            raise InputError(
                f"{name}: a viscosity index begins at 2 mm2/s at 100 degrees C, which it has not; give law, T and mu, "
                f"or one of {', '.join(NAMES)}"
            )
        close = min(GRADES, key=lambda one: abs(log(one / grade))) if grade > 0 else None
        near = f" (did you mean ISO VG {close}?)" if close else nearest(name, NAMES)
        raise InputError(f"{name}: no oil of that name{near}; allowed are {', '.join(NAMES)}")
    return Walther.through((313.15, 373.15), GRADES[grade], rho)
