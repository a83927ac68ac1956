"""Numbers with units as people write them, '15um', '1 MPa', '3000 rpm', '40 mPa s', '75%', in SI."""

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction

from ..errors import InputError, nearest

Dimension = tuple[int, int, int, int, int]  # powers of m, kg, s, rad, K
BASE = ("m", "kg", "s", "rad", "K")
CELSIUS = 273.15  # K; of a temperature alone, never of a difference or inside another unit
NUMBER: Dimension = (0, 0, 0, 0, 0)
WORDS = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*)", re.ASCII)
FACTOR = re.compile(r"(1|%|[^\W\d_]+)(?:\^?([+-]?\d))?")
PREFIXES = {"n": -9, "u": -6, "\u00b5": -6, "\u03bc": -6, "m": -3, "c": -2, "k": 3, "M": 6, "G": 9}
PASCAL: Dimension = (-1, 1, -2, 0, 0)
KELVIN: Dimension = (0, 0, 0, 0, 1)
# Symbol: factor to SI, dimension. Those of the first table take prefixes.
SYMBOLS: dict[str, tuple[Fraction, Dimension]] = {
    "m": (Fraction(1), (1, 0, 0, 0, 0)),
    "g": (Fraction(1, 1000), (0, 1, 0, 0, 0)),
    "s": (Fraction(1), (0, 0, 1, 0, 0)),
    "rad": (Fraction(1), (0, 0, 0, 1, 0)),
    "N": (Fraction(1), (1, 1, -2, 0, 0)),
    "Pa": (Fraction(1), PASCAL),
    "Pas": (Fraction(1), (-1, 1, -1, 0, 0)),
    "P": (Fraction(1, 10), (-1, 1, -1, 0, 0)),
    "bar": (Fraction(100_000), PASCAL),
    "l": (Fraction(1, 1000), (3, 0, 0, 0, 0)),
    "J": (Fraction(1), (2, 1, -2, 0, 0)),
    "K": (Fraction(1), (0, 0, 0, 0, 1)),
    "W": (Fraction(1), (2, 1, -3, 0, 0)),
}
PLAIN: dict[str, tuple[Fraction, Dimension]] = {
    "1": (Fraction(1), NUMBER),
    "%": (Fraction(1, 100), NUMBER),
    "min": (Fraction(60), (0, 0, 1, 0, 0)),
    "h": (Fraction(3600), (0, 0, 1, 0, 0)),
    "rpm": (Fraction(math.pi) / 30, (0, 0, -1, 1, 0)),
    "rev": (Fraction(math.pi) * 2, (0, 0, 0, 1, 0)),
    "deg": (Fraction(math.pi) / 180, (0, 0, 0, 1, 0)),
    "atm": (Fraction(101_325), PASCAL),
    "psi": (Fraction("6894.757293168361"), PASCAL),
    "in": (Fraction(254, 10_000), (1, 0, 0, 0, 0)),
}
OWN = ("rpm", "deg")  # as the last word of a key: its number is in them
# What a dimension is called, and what one may write for it.
NAMES: dict[Dimension, tuple[str, str]] = {
    NUMBER: ("a number without a unit", ""),
    (1, 0, 0, 0, 0): ("a length", "m, mm, um, nm"),
    PASCAL: ("a pressure", "Pa, kPa, MPa, GPa, bar"),
    (-1, 1, -1, 0, 0): ("a viscosity", "Pa s, mPa s, cP"),
    (1, 0, -1, 0, 0): ("a speed", "m/s, mm/s, km/h"),
    (0, 0, -1, 1, 0): ("an angular velocity", "rad/s, rpm"),
    (0, 0, 0, 1, 0): ("an angle", "rad, deg"),
    (1, -1, 2, 0, 0): ("an inverse pressure", "1/Pa, 1/GPa"),
    (1, 1, -2, 0, 0): ("a force", "N, kN"),
    (0, 1, -2, 0, 0): ("a force per width", "N/m, kN/m"),
    (0, 0, 1, 0, 0): ("a time", "s, ms, min"),
    KELVIN: ("a temperature", "K, degC"),
    (-3, 1, 0, 0, 0): ("a density", "kg/m^3"),
    (2, 0, -2, 0, -1): ("a specific heat", "J/kg/K, kJ/kg/K"),
    (0, 1, -3, 0, -1): ("a heat transfer coefficient", "W/m^2/K"),
}


@dataclass(frozen=True)
class Quantity:
    """A value in SI and its dimension; `unit` is whether one was written."""

    value: float
    dimension: Dimension
    unit: bool

    @property
    def text(self) -> str:
        """The same in SI base units, for `quantity` to read again."""
        parts = (f"{name}^{power}" for name, power in zip(BASE, self.dimension, strict=True) if power)
        return " ".join([repr(self.value), *parts])


def quantity(text: str) -> Quantity | None:
    """What a text says; None if it does not begin with a number.

    Rounded once, so that '15um' is 15e-6.

    Raises
    ------
    InputError : a unit that is none.
    """
    words = WORDS.fullmatch(text.strip())
    if words is None:
        return None
    if words[2] in ("degC", "\u00b0C"):
        return Quantity(float(Decimal(words[1]) + Decimal(str(CELSIUS))), KELVIN, True)
    factor, dimension = _unit(words[2]) if words[2] else (Fraction(1), NUMBER)
    value = float(words[1])
    if value and math.isfinite(value):  # else its exact value may fill the memory
        try:
            value = float(Fraction(Decimal(words[1])) * factor)
        except OverflowError:
            value = math.copysign(math.inf, value)
    return Quantity(value, dimension, bool(words[2]) and words[2] != "%")


def in_si(text: str, units: str) -> float | None:
    """The number in SI that a text says, where `units` are wanted ('Pa s', 'N or N/m', '' for none); None if it says none.

    A number without a unit is in SI.

    Raises
    ------
    InputError : a unit that is none, or of another dimension.
    """
    found = quantity(text)
    if found is None:
        return None
    wanted = [_unit(unit)[1] if unit else NUMBER for unit in units.split(" or ")]
    if found.dimension not in wanted if found.unit else (text.strip().endswith("%") and NUMBER not in wanted):
        other = NAMES.get(found.dimension) if found.dimension != NUMBER else None
        raise InputError(f"{_named(wanted)} is needed{f', not {other[0]}' if other else ''}")
    return found.value


def in_own(text: str, key: str) -> float | None:
    """The number that a text says in the unit that its key's name ends with (speed_rpm = '3000 rpm'); None if it does not."""
    words, found, own = WORDS.fullmatch(text.strip()), quantity(text), key.rpartition("_")[2]
    if own not in OWN or words is None or found is None or not found.unit or found.dimension != _unit(own)[1]:
        return None
    return float(Fraction(Decimal(words[1])) * _unit(words[2])[0] / _unit(own)[0]) if math.isfinite(found.value) else None


def _named(wanted: Iterable[Dimension]) -> str:
    """'a length (m, mm, um, nm)'."""
    words = [NAMES.get(dimension, (f"a value in {Quantity(1.0, dimension, True).text[4:]}", "")) for dimension in wanted]
    return " or ".join(f"{name} ({units})" if units else name for name, units in words)


def _unit(text: str) -> tuple[Fraction, Dimension]:
    """Factor to SI and dimension of a product such as 'N/mm^2' or 'kg m-1 s-1'; what follows a / is divided by, one factor."""
    factor, powers = Fraction(1), [0] * len(BASE)
    for k, part in enumerate(text.split("/")):
        for j, word in enumerate(re.split(r"[\s*\u00b7.]+", part.strip())):
            match = FACTOR.fullmatch(word.replace("\u00b2", "2").replace("\u00b3", "3"))
            if match is None:
                raise InputError(f"{text!r} is no unit")
            power = int(match[2] or 1) * (-1 if k and j == 0 else 1)
            size, dimension = _symbol(match[1])
            factor *= size**power
            powers = [old + power * part for old, part in zip(powers, dimension, strict=True)]
    return factor, tuple(powers)  # type: ignore[return-value]


def _symbol(word: str) -> tuple[Fraction, Dimension]:
    if word in PLAIN or word in SYMBOLS:
        return PLAIN.get(word) or SYMBOLS[word]
    if word[0] in PREFIXES and word[1:] in SYMBOLS:
        size, dimension = SYMBOLS[word[1:]]
        return size * Fraction(10) ** PREFIXES[word[0]], dimension
    usual = [symbol for _, units in NAMES.values() for symbol in re.findall(r"[^\W\d_]+", units)]
    raise InputError(f"{word!r} is no unit{nearest(word, [*usual, *PLAIN, *SYMBOLS])}")
