"""Numbers with SI prefixes, for summaries and pictures."""

import math


def prefix(size: float, unit: str) -> tuple[float, str]:
    """(factor, unit): what takes SI values up to `size` to numbers from 1 to 1000, and their unit.

    Powers of units (m2/s, m3/s) have no prefix: theirs would be raised with them.
    """
    if not unit or "2" in unit or "3" in unit or not 0 < size < math.inf:
        return 1.0, unit
    power = min(max(3 * math.floor(math.log10(size) / 3 + 1e-12), -9), 9)
    return 10.0**-power, {-9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}[power] + unit


def with_unit(value: float, unit: str, digits: int = 4) -> str:
    """'6.624 MPa' from 6.624e6 and 'Pa'."""
    factor, unit = prefix(abs(value), unit)
    return f"{value * factor:.{digits}g} {unit}"


def axis(name: str, size: float, unit: str = "m") -> tuple[float, str]:
    """(factor, label) of an axis along which a length is drawn, in a unit that suits its size."""
    factor, unit = prefix(size, unit)
    return factor, f"{name} ({unit})" if unit else name


def around(L: float) -> tuple[float, str]:
    """(factor, label) of an axis round a shaft, on which x goes from 0 to L."""
    return 360.0 / L, "angle from x = 0 (°)"


def place(at: list[float] | None, unit: str = "m") -> str:
    """'x = 43.5 mm, y = 50 mm' from [0.0435, 0.05]; empty for None."""
    return ", ".join(f"{name} = {with_unit(value, unit)}" for name, value in zip("xy", at or [], strict=False))
