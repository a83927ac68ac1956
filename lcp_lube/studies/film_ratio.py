"""Stability against the film ratio: h_max/h_min from 1.1 to 1e4 on coarse to fine grids, by every method."""

from collections.abc import Iterator
from functools import partial

from .map_picture import Axis, Panels
from .outcome_map import Case, OutcomeMap, methods, tallies

RATIOS = (1.1, 2, 5, 10, 30, 100, 1000, 10_000)
H_MIN = {"problem1": 15e-6, "textured_slider": 15e-6}  # m; the textured slider's depth is what the ratio leaves
SIZES = {"problem1": (20, 50, 100, 200, 500, 1000, 2000), "textured_slider": (12, 30, 60)}

X, Y = Axis("n", "points a side", "n"), Axis("ratio", "film ratio h_max/h_min", "ratio")


def cases(quick: bool) -> Iterator[Case]:
    """A smooth film on a line and square dimples on a square (K = 2); quick: two by two on the line."""
    for scene, sizes in [*SIZES.items()][: 1 if quick else None]:
        for method in methods():
            for n in sizes[:2] if quick else sizes:
                for ratio in (2, 1000) if quick else RATIOS:
                    key = {"scene": scene, "method": method, "n": n, "ratio": ratio}
                    yield Case(key, scene, {**film(scene, ratio), "n": n}, {"method": method})


def film(scene: str, ratio: float) -> dict[str, float]:
    """The scene's keys for a film ratio."""
    low = H_MIN[scene]
    if scene == "problem1":
        return {"h_min": low, "h_max": float(f"{ratio * low:.6g}")}
    return {"K": 2, "h": low, "depth": float(f"{(ratio - 1) * low:.6g}")}


sentence = partial(tallies, by=("method",), axes=(Y, X))
chart = OutcomeMap("film_ratio", cases, Panels("method", "scene"), X, Y, sentence).chart
