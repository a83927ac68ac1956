"""What the errors of a chart are measured against: the exact solution, or one on far finer grids, made once and kept."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import log2
from pathlib import Path
from time import process_time

import numpy as np

from ..api import solve
from ..base.resumable import ResumableCsv
from ..output.results import as_dict, machine
from ..scenes.film_scene import RectangleScene
from ..scenes.moving import film_of
from ..scenes.published import TexturedScene
from ..scenes.scene import Scene
from .compare import read_off
from .experiment import scene_key

QUANTITIES = ("load", "p_max", "rupture")
SIDES: tuple[int, ...] = (1023, 2047, 4095)  # spacings halve
QUICK_SIDES = (31, 63, 127)
ROUND, QUICK_ROUND = (700, 8450, 72), (31, 127, 8)  # the first, the last and how many, where round edges cut faces
SCATTER = 1.3  # power of the spacing by which values vary with where such edges lie on a grid
KEY = ("scene", "data", "sides")
COLUMNS = (*QUANTITIES, *(f"{name}_unsure" for name in QUANTITIES), "how", "cpu_s", "machine")


@dataclass(frozen=True)
class Known:
    """The three numbers of `compare.read_off`, their doubts (load, p_max: relative; rupture: of L), and how they are known."""

    values: Mapping[str, float | None]
    unsure: Mapping[str, float]
    how: str


def known_answer(scene: RectangleScene, path: Path, quick: bool = False) -> Known:
    """The exact solution; else the limit of some grids (`fine`), from the csv at `path` or computed now. Collective."""
    exact = scene.exact()
    if exact is not None:
        return Known({"load": exact.load, "p_max": exact.p_max, "rupture": exact.rupture}, {}, "exact")
    sides = QUICK_SIDES if quick else SIDES
    if len(scene.shape) == 1:
        sides = tuple(16 * n for n in sides)
    if cells := dimple_cells(scene):
        sides = tuple(k * cells - 1 for k in ((1, 2, 4) if quick else (8, 16, 32)))
    if getattr(film_of(scene), "cut", False):
        sides = tuple(np.geomspace(*(QUICK_ROUND if quick else ROUND)).round().astype(int).tolist())
    store = ResumableCsv(path, [*KEY, *COLUMNS], KEY)
    name, data = scene_key(scene)
    key = {"scene": name, "data": data, "sides": told(sides)}
    row = store.row(key, lambda: {**fine(scene, sides), "machine": machine()})
    return Known(
        {name: float(row[name]) if row[name] else None for name in QUANTITIES},
        {name: float(row[f"{name}_unsure"]) for name in QUANTITIES if row[f"{name}_unsure"]},
        row["how"],
    )


def dimple_cells(scene: Scene) -> int:
    """Meshes along a side of the grid that dimples are made for, 0 without dimples: on its multiples alone does an error fall
    smoothly."""
    return 30 * scene.K + 1 if isinstance(scene, TexturedScene) and scene.K <= 4 else 0


def fine(scene: RectangleScene, sides: tuple[int, ...]) -> dict[str, object]:
    """Limits of the three numbers and their doubts: Richardson's of three grids, least squares of more. Collective."""
    begin = process_time()
    found = [on_grid(scene.with_shape((n,) * len(scene.shape))) for n in sides]
    out: dict[str, object] = {}
    for name in QUANTITIES:
        values = [value for numbers in found if (value := numbers[name]) is not None]
        if len(values) == len(sides):
            limit, doubt = extrapolated(*values) if len(sides) == 3 else fitted(sides, values)
            size = scene.L if name == "rupture" else abs(limit)
            out |= {name: repr(limit), f"{name}_unsure": f"{doubt / size:.2e}"}
    by = "Richardson's limit of" if len(sides) == 3 else "limit by least squares of"
    how = f"{by} {told(sides)} points a side"
    return out | {"how": how, "cpu_s": f"{process_time() - begin:.1f}"}


def extrapolated(coarse: float, middle: float, best: float) -> tuple[float, float]:
    """Richardson's limit, by the order that is seen, 1 to 2, and the distance to it from the finest grid's value."""
    first, last = abs(middle - coarse), abs(best - middle)
    order = min(2.0, max(1.0, log2(first / last))) if first > 0 and last > 0 else 1.0
    limit = best + (best - middle) / (2.0**order - 1.0)
    return limit, abs(limit - best)


def fitted(sides: Sequence[int], values: Sequence[float]) -> tuple[float, float]:
    """The limit a of a + b h + c h**2 by least squares, and of that with h**1.5 for h**2: their mean, and as its doubt two
    standard errors and half their distance.

    Where round edges cut faces, errors of first order remain, and values vary with where these lie on a grid: three of them
    tell little, many tell both.
    """
    h = 1.0 / (np.asarray(sides) + 1.0)
    limits, doubts = [], []
    for power in (2.0, 1.5):
        terms = np.stack([np.ones_like(h), h, h**power], axis=1) / h[:, None] ** SCATTER
        wanted = np.asarray(values) / h**SCATTER
        found = np.linalg.lstsq(terms / (size := np.linalg.norm(terms, axis=0)), wanted, rcond=None)[0] / size
        left = np.sum((wanted - terms @ found) ** 2) / max(len(h) - 3, 1)
        limits.append(float(found[0]))
        doubts.append(2.0 * float(np.sqrt(left * np.linalg.pinv(terms.T @ terms)[0, 0])))
    return 0.5 * sum(limits), max(doubts) + 0.5 * abs(limits[1] - limits[0])


def told(sides: Sequence[int]) -> str:
    """Which grids these are."""
    return " ".join(map(str, sides)) if len(sides) == 3 else f"{sides[0]} to {sides[-1]}, {len(sides)} of them"


def on_grid(scene: Scene) -> dict[str, float | None]:
    """The three numbers of this grid's own solution, to rounding. Collective."""
    with solve(scene, stopping={"eps1": 1e-12}) as solution:
        return read_off(solution.problem, as_dict(solution)) if solution.converged else dict.fromkeys(QUANTITIES)
