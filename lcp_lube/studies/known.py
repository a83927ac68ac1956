"""What the errors of a chart are measured against: the exact solution, or one on far finer grids, made once and kept."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import log2
from pathlib import Path
from time import process_time

from ..api import solve
from ..base.resumable import ResumableCsv
from ..output.results import as_dict, machine
from ..scenes.film_scene import RectangleScene
from ..scenes.published import TexturedScene
from ..scenes.scene import Scene
from .compare import read_off
from .experiment import scene_key

QUANTITIES = ("load", "p_max", "rupture")
SIDES: tuple[int, ...] = (1023, 2047, 4095)  # spacings halve
QUICK_SIDES = (31, 63, 127)
KEY = ("scene", "data", "sides")
COLUMNS = (*QUANTITIES, *(f"{name}_unsure" for name in QUANTITIES), "how", "cpu_s", "machine")


@dataclass(frozen=True)
class Known:
    """The three numbers of `compare.read_off`, their doubts (load, p_max: relative; rupture: of L), and how they are known."""

    values: Mapping[str, float | None]
    unsure: Mapping[str, float]
    how: str


def known_answer(scene: RectangleScene, path: Path, quick: bool = False) -> Known:
    """The exact solution; else Richardson's limit of three grids, from the csv at `path` or computed now. Collective."""
    exact = scene.exact()
    if exact is not None:
        return Known({"load": exact.load, "p_max": exact.p_max, "rupture": exact.rupture}, {}, "exact")
    sides = QUICK_SIDES if quick else SIDES
    if len(scene.shape) == 1:
        sides = tuple(16 * n for n in sides)
    if cells := dimple_cells(scene):
        sides = tuple(k * cells - 1 for k in ((1, 2, 4) if quick else (8, 16, 32)))
    store = ResumableCsv(path, [*KEY, *COLUMNS], KEY)
    name, data = scene_key(scene)
    key = {"scene": name, "data": data, "sides": " ".join(map(str, sides))}
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
    """Limits of the three numbers and their doubt, the distance from the finest grid's value to the limit. Collective."""
    begin = process_time()
    found = [on_grid(scene.with_shape((n,) * len(scene.shape))) for n in sides]
    out: dict[str, object] = {}
    for name in QUANTITIES:
        values = [numbers[name] for numbers in found]
        if any(value is None for value in values):
            continue
        coarse, middle, best = (value or 0.0 for value in values)
        first, last = abs(middle - coarse), abs(best - middle)
        order = min(2.0, max(1.0, log2(first / last))) if first > 0 and last > 0 else 1.0
        limit = best + (best - middle) / (2.0**order - 1.0)
        size = scene.L if name == "rupture" else abs(limit)
        out |= {name: repr(limit), f"{name}_unsure": f"{abs(limit - best) / size:.2e}"}
    how = f"Richardson's limit of {', '.join(map(str, sides))} points a side"
    return out | {"how": how, "cpu_s": f"{process_time() - begin:.1f}"}


def on_grid(scene: Scene) -> dict[str, float | None]:
    """The three numbers of this grid's own solution, to rounding. Collective."""
    with solve(scene, method="fas", stopping={"eps1": 1e-12}) as solution:
        return read_off(solution.problem, as_dict(solution)) if solution.converged else dict.fromkeys(QUANTITIES)
