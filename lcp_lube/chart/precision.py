"""Speed against accuracy: error against the exact solution, and what it costs, for every method that solves a scene.

A method joins by its line in the registry, with each of its systems and each recipe that makes sense for the system.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from statistics import median
from typing import Any

from mpi4py import MPI

from ..cli import say
from ..errors import InputError
from ..output.resumable import ResumableCsv
from ..problems.exact import ExactSolution
from ..problems.solution import Outcome
from ..registry import METHODS
from ..scene import LubricationScene, Scene, load_scene
from ..solvers.newton import Stopping
from .experiment import KRYLOV_LIMIT, open_store, run
from .precision_picture import cheapest, draw, seconds

SCENES = ("problem1", "problem2", "problem3")
SIZES = (50, 100, 200, 500, 1000, 2000, 5000, 10_000)
QUICK_SIZES = (50, 100)
TOLERANCES = (1e-4, 1e-8)  # eps1 = eps2

# The recipes that make sense in 1D by system; for another system its default one (`auto.default_recipe`).
RECIPES: dict[str, tuple[str | None, ...]] = {
    "full": ("superlu", "umfpack", "mumps", "gmres_ilu", "bcgs_ilu"),
    "reduced": ("banded", "superlu", "umfpack", "mumps", "gmres_ilu", "bcgs_ilu"),
}

REPEATS = 3  # of which the median counts
LONG = 2.0  # seconds; a longer run is not repeated: its clock is steady enough
KRYLOV_MOST = 100_000  # iterations; the paper's longest run takes 28,000

KEY = ("scene", "data", "n", "method", "nested", "system", "recipe", "eps", "ranks")
CLOCKS = ("wall_s", "cpu_s")
COLUMNS = (*CLOCKS, "runs", "load_error", "iteration_error", "rupture_error")


@dataclass(frozen=True)
class Configuration:
    """What is run on every grid. recipe: None is the system's default one."""

    method: str
    nested: bool
    system: str
    recipe: str | None
    eps: float

    def __str__(self) -> str:
        nested = " nested" * self.nested
        return f"{self.method}{nested}, {self.system} system, recipe {self.recipe or 'default'}, eps {self.eps:g}"


def configurations(quick: bool = False) -> Iterator[Configuration]:
    """All that make sense in 1D; nested iteration with a method's first system and recipe. quick: one recipe a system."""
    for method, entry in METHODS.items():
        if "lubrication" not in entry.kinds:
            continue
        systems = entry.systems or ("auto",)
        for system in systems:
            recipes = RECIPES.get(system, (None,))
            for recipe in recipes[:1] if quick else recipes:
                first = (system, recipe) == (systems[0], recipes[0])
                for nested in (False, True) if entry.nested and first else (False,):
                    for eps in TOLERANCES:
                        yield Configuration(method, nested, system, recipe, eps)


def chart(sources: Sequence[str], quick: bool = False, results: Path = Path("lcp_lube_results")) -> int:
    """Make the runs that are not in the csv yet, then draw the picture from it. Collective.

    Parameters
    ----------
    sources : scenes with an exact solution, by name or file; none: SCENES.
    quick : two small grids, one recipe a system, each run made once; kept apart from the full chart.
    results : folder of precision.csv and precision_load.png, precision_rupture.png (precision_quick...).

    Returns
    -------
    int : exit status 0; a run that fails is a point of the chart.

    Raises
    ------
    InputError : a scene without an exact solution; see also `open_store`.
    """
    scenes = [with_exact(load_scene(source)) for source in sources or SCENES]
    stem = "precision_quick" if quick else "precision"
    store = open_store(results / f"{stem}.csv", KEY, COLUMNS)
    known = len(store.rows)
    for scene, exact in scenes:
        for configuration in configurations(quick):
            fill(store, scene, exact, configuration, QUICK_SIZES if quick else SIZES, 1 if quick else REPEATS)
    wanted = [scene_key(scene) for scene, _ in scenes]
    rows = [row for row in store.rows if (row["scene"], row["data"]) in wanted and row["ranks"] == str(store.comm.size)]
    say("\n".join(cheapest(rows)))
    for quantity in ("load", "rupture"):
        draw(rows, quantity, results / f"{stem}_{quantity}.png", store.comm)
    say(
        f"{results / stem}_load.png, {stem}_rupture.png: {len(rows)} runs, {len(store.rows) - known} of them new; the others "
        f"stood in {store.path} (remove it to run them again)."
    )
    return 0


def scene_key(scene: Scene) -> tuple[str, str]:
    """A scene's name, and a digest of its data but for the grid: a scene file that was edited is run again."""
    data = scene.model_dump_json(exclude={"name", "n", "nx", "ny"}, exclude_defaults=True)
    return scene.name, sha256(data.encode()).hexdigest()[:8]


def with_exact(scene: Scene) -> tuple[LubricationScene, ExactSolution]:
    """A scene and its exact solution.

    Raises
    ------
    InputError : there is none, or none with a load.
    """
    if isinstance(scene, LubricationScene):
        exact = scene.exact()
        if exact is not None and exact.load > 0:
            return scene, exact
    raise InputError(f"scene {scene.name}: an exact solution with a load is needed, as {', '.join(SCENES)} have it")


def fill(
    store: ResumableCsv,
    scene: LubricationScene,
    exact: ExactSolution,
    configuration: Configuration,
    sizes: Sequence[int],
    repeats: int,
) -> None:
    """Make a configuration's runs on all grids, from small to large, up to one that passes the Krylov limit. Collective."""
    name, data = scene_key(scene)
    settings = {**vars(configuration), "recipe": configuration.recipe or "default"}
    for n in sizes:
        key = {"scene": name, "data": data, "n": n, **settings, "ranks": store.comm.size}
        row = store.find(**key)
        if row is None:
            try:
                values = measure(scene.model_copy(update={"nx": n}), exact, configuration, repeats)
            except InputError as error:
                say(f"{name}: {configuration}: left out: {error}")
                return
            row = store.add({**values, **key})
            say(f"{name} n = {n}: {configuration}: {row['outcome']}, {row['iterations']} iterations, {seconds(row):.3g} s")
        if row["outcome"] == KRYLOV_LIMIT:
            return


def measure(scene: LubricationScene, exact: ExactSolution, configuration: Configuration, repeats: int) -> dict[str, Any]:
    """The row of one run: errors relative to the exact load and to the length L, medians of the repeats' seconds. Collective.

    iteration_error is the part of the load's error that the iteration leaves: against the active set on the same grid, whose
    answer is exact but for rounding.
    """
    choices: dict[str, Any] = {
        "method": configuration.method,
        "system": configuration.system,
        "recipe_name": configuration.recipe,
        "nested": configuration.nested,
        "stopping": Stopping(configuration.eps, configuration.eps),
    }
    runs = [run(scene, KRYLOV_MOST, **choices)]
    while len(runs) < (repeats if MPI.COMM_WORLD.bcast(runs[0]["wall_s"]) < LONG else 1):
        runs.append(run(scene, KRYLOV_MOST, **choices))
    values = {**runs[0], **{clock: f"{median(a_run[clock] for a_run in runs):.6f}" for clock in CLOCKS}, "runs": len(runs)}
    if values.get("load") is not None:
        discrete = run(scene, method="active-set")
        if discrete["outcome"] == Outcome.CONVERGED:
            values["iteration_error"] = abs(values["load"] - discrete["load"]) / exact.load
    return {name: f"{value:.4e}" if name.endswith("_error") else value for name, value in values.items()}
