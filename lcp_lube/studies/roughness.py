"""Stability against roughness: height of a random surface on coarse to fine grids, several surfaces a cell."""

from collections.abc import Iterator, Sequence

from ..base.resumable import Row
from .map_picture import Axis, Panels
from .outcome_map import Case, OutcomeMap, methods, tallies

# um, of the random numbers: the surface's is 0.479 of it; on a film of 15 to 25 um; 1 um is left everywhere
AMPLITUDES = (0, 1, 2, 4, 6, 10, 20)
SIZES = (16, 32, 64)
SEEDS = (1, 2, 3)

X, Y = Axis("n", "points a side", "n"), Axis("um", "amplitude in um (standard deviation: 0.479 of it)", "amplitude in um")


def cases(quick: bool) -> Iterator[Case]:
    """quick: two by two, one surface."""
    for method in methods():
        for n in SIZES[:2] if quick else SIZES:
            for um in (1, 4) if quick else AMPLITUDES:
                for seed in SEEDS[:1] if quick or not um else SEEDS:
                    changes = {"n": n, "amplitude": float(f"{um * 1e-6:.6g}"), "seed": seed}
                    yield Case({"method": method, "n": n, "um": um, "seed": seed}, "rough", changes, {"method": method})


def sentence(rows: Sequence[Row]) -> str:
    return f"{len(SEEDS)} surfaces a cell, the most steps of them. {tallies(rows, ('method',), (Y, X))}"


chart = OutcomeMap("roughness", cases, Panels("method"), X, Y, sentence).chart
