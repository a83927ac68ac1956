"""Speed against accuracy: errors of load, largest pressure and rupture, and what they cost, for every method.

A method joins by its line in the registry, with each of its systems and each recipe that makes sense for the system.
Two errors of every run are told apart: that of the grid (the same grid solved to rounding, against the known answer), and that
which the iteration leaves (against the same grid solved to rounding).
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median
from typing import Any

from mpi4py import MPI

from ..base.progress import Line
from ..base.resumable import ResumableCsv, Row
from ..errors import InputError
from ..output.console import say
from ..problems.solution import Outcome
from ..registry import METHODS
from ..scenes.film_scene import RectangleScene
from ..scenes.scene import Scene, load_scene
from ..solvers.newton import Stopping
from .compare import errors
from .experiment import KRYLOV_LIMIT, TIME_LIMIT, open_store, run, scene_key
from .known import Known, dimple_cells, known_answer, on_grid
from .log import write_log
from .precision_picture import draw_all, seconds
from .precision_words import cheapest, sentence, which

SCENES = (
    "problem1",
    "problem2",
    "problem3",
    "parabolic_slider",
    "journal",
    "problem4",
    "textured_slider",
    "dimpled_pad",
    "dimpled_pad_round",
    "textured_slider_face",
)
VARIANTS: dict[str, tuple[str, dict[str, Any]]] = {  # scenes of this chart alone
    "dimpled_pad_round": ("dimpled_pad", {"film.dimples.form": "round"}),
    "textured_slider_face": ("textured_slider", {"scheme": "face"}),  # the benchmark's own scheme is of first order
}
SIZES = {1: (50, 100, 200, 500, 1000, 2000, 5000), 2: (31, 63, 127, 255, 511)}  # points a side by dimension
QUICK_SIZES = {1: (50, 100), 2: (15, 31)}
TOLERANCES = (1e-4, 1e-8)  # eps1 = eps2
ALL = 10**9
SLOW = {"monotone": 1000}  # points a side at most, for methods whose steps grow with them
FINAL = {"active-set", "monotone"}  # end in an exact step whatever the tolerance: the smaller one only

# Recipes by dimension and system, and the most points a side that each is run on; for another system its default one.
RECIPES: dict[int, dict[str, dict[str | None, int]]] = {
    1: {"full": {"superlu": ALL, "gmres_ilu": 2000}, "reduced": {"banded": ALL, "bcgs_ilu": ALL}, "cavity": {}},
    2: {
        "full": {"umfpack": 127, "gmres_ilu": 63, "augmentation_amg": 63},
        "reduced": {"umfpack": 127, "bcgs_amg": 255},
        "cavity": {"bcgs_amg": ALL},
    },
}
# The paper's other inner solvers, for its own method; dense LU in small sizes, where minutes begin with n = 1000 (table 8).
PAPER: dict[int, dict[str | None, int]] = {
    1: {"lu": 200, "mumps": 1000, "bjacobi": 200},
    2: {"lu": 31, "mumps": 63, "bjacobi": 63},
}
ACCURACIES = {1: (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6), 2: (1e-1, 1e-2, 1e-3, 1e-4)}  # of auto --accuracy
FINEST = {1: (100_000,), 2: (1500, 1500)}  # grids that it may go to

REPEATS = 3  # of which the median counts
LONG = 0.3  # seconds; a longer run is not repeated: its clock is steady enough
KRYLOV_MOST = 20_000  # iterations
CPU_MOST = 10.0  # seconds of a run; it is left after the step that passes them
ENOUGH = 3.0  # seconds; after such a run a configuration is not tried on larger grids

MARKS = (
    "`-`: no run is known to, by a reference that is as sure. `not run`: none did on the grids run, and larger ones, which "
    f"others have, would take minutes. A run is left after {CPU_MOST:g} s of the processor, and counts as failed."
)

KEY = ("scene", "data", "n", "method", "nested", "system", "recipe", "eps", "ranks")
CLOCKS = ("wall_s", "cpu_s")
PARTS = ("error", "grid", "iteration")
ERRORS = tuple(f"{name}_{part}" for name in ("load", "p_max", "rupture") for part in PARTS)
COLUMNS = (*CLOCKS, "runs", "points", "krylov", *ERRORS, "p_max", "known", "load_unsure", "p_max_unsure", "rupture_unsure")


@dataclass(frozen=True)
class Configuration:
    """What is run on every grid up to `most` points a side. recipe: None is the system's default one."""

    method: str
    nested: bool
    system: str
    recipe: str | None
    eps: float
    most: int = ALL


def configurations(dimension: int, quick: bool = False) -> Iterator[Configuration]:
    """All that make sense; nested iteration with a method's first recipe of each system. quick: one recipe a system."""
    for method, entry in METHODS.items():
        if "lubrication" not in entry.kinds:
            continue
        tolerances = TOLERANCES[-1:] if method in FINAL else TOLERANCES
        for system in entry.systems or ("auto",):
            recipes = [*RECIPES[dimension].get(system, {None: ALL}).items()]
            more = [*PAPER[dimension].items()] if (method, system) == ("din", "full") else []
            for recipe, most in recipes[:1] if quick else [*recipes, *more]:
                first = recipe == (recipes[-1] if dimension == 2 else recipes[0])[0]  # the one for large grids
                for nested in (False, True) if entry.nested and first else (False,):
                    for eps in tolerances:
                        yield Configuration(method, nested, system, recipe, eps, min(most, SLOW.get(method, ALL)))


def chart(sources: Sequence[str], quick: bool, results: Path) -> int:
    """Make the runs that are not in the csv yet, then draw; a run that fails is a point of the chart. Collective.

    sources : scenes of films, by name or file, or of VARIANTS; none: SCENES.
    quick : two small grids, one recipe a system, each run made once; kept apart from the full chart.
    """
    scenes = [film(source) for source in sources or SCENES]
    stem = "precision_quick" if quick else "precision"
    store = open_store(results / f"{stem}.csv", KEY, COLUMNS)
    jobs: list[tuple[int, Configuration | float]] = []
    for k, scene in enumerate(scenes):
        jobs += [(k, configuration) for configuration in configurations(len(scene.shape), quick)]
        jobs += [(k, tol) for tol in ACCURACIES[len(scene.shape)][: 2 if quick else None]]
    benches: list[Bench] = []
    with Line() as line:
        for k, job in line.over(jobs, lambda job: f"{scenes[job[0]].name}, configuration"):
            if k == len(benches):
                known = known_answer(scenes[k], results / f"{stem}_references.csv", quick)
                benches.append(Bench(scenes[k], known, 1 if quick else REPEATS))
            if isinstance(job, Configuration):
                benches[k].fill(store, job, grids(scenes[k], quick))
            else:
                benches[k].accuracy(store, job)
    wanted = [scene_key(scene) for scene in scenes]
    rows = [row for row in store.rows if (row["scene"], row["data"]) in wanted and row["ranks"] == str(store.comm.size)]
    table = "\n".join(cheapest(rows))
    say(table)
    pictures = draw_all(rows, results / stem, store.comm)
    if not quick:
        text = "\n".join([sentence(rows, "load"), "", *which(rows), "", MARKS, "", "```text", table, "```"])
        write_log(results, "precision", rows, text, pictures)
    say(f"{', '.join(map(str, pictures))}: {len(rows)} runs, {store.said}")
    return 0


def grids(scene: Scene, quick: bool) -> tuple[int, ...]:
    """Points a side of the grids that a scene is run on; dimples on multiples of their own grid, and two coarser ones."""
    cells = dimple_cells(scene)
    if cells and not quick:
        return (cells // 4, cells // 2, cells - 1, 2 * cells - 1, 4 * cells - 1)
    return (QUICK_SIZES if quick else SIZES)[len(scene.shape)]


def film(source: str) -> RectangleScene:
    """The scene of a name or file, or of VARIANTS, if it has a load; else InputError."""
    name, changes = VARIANTS.get(source, (source, {}))
    scene = load_scene(name, **changes, **({"name": source} if changes else {}))
    if not isinstance(scene, RectangleScene):
        raise InputError(f"scene {scene.name}: it has no load; a film with cavitation is needed, as {', '.join(SCENES)} are")
    return scene


class Bench:
    """Runs on one scene. known: what its errors are measured against; repeats: of short runs."""

    def __init__(self, scene: RectangleScene, known: Known, repeats: int):
        self.scene, self.known, self.repeats = scene, known, repeats
        self._discrete: dict[tuple[int, ...], Mapping[str, float | None]] = {}
        self._warm: set[str] = set()

    def fill(self, store: ResumableCsv, configuration: Configuration, sizes: Sequence[int]) -> None:
        """Make a configuration's runs on all its grids, from small to large, until one reaches a limit. Collective."""
        choices = asdict(configuration)
        eps, most = choices.pop("eps"), choices.pop("most")
        for n in sizes:
            if n > most:
                return
            scene = self.scene.with_shape((n,) * len(self.scene.shape))
            key = {**choices, "recipe": configuration.recipe or "default", "eps": eps, "n": n}
            row = self.row(store, key, scene, **choices, stopping=Stopping(eps, eps))
            limits = (KRYLOV_LIMIT, TIME_LIMIT, Outcome.MAX_ITERATIONS)
            if row is None or row["outcome"] in limits or float(row["cpu_s"]) > ENOUGH:
                return

    def accuracy(self, store: ResumableCsv, tol: float) -> None:
        """What `auto --accuracy TOL` takes, all its grids together. Collective."""
        key = {"method": "auto --accuracy", "nested": True, "system": "auto", "recipe": "auto", "eps": tol, "n": "auto"}
        self.row(store, key, self.scene, accuracy=tol, quantity="pressure_integral", finest=FINEST[len(self.scene.shape)])

    def row(self, store: ResumableCsv, key: dict[str, Any], scene: Scene, **choices: Any) -> Row | None:
        """One run's row, from the csv or made now; None if it was refused. Collective."""
        name, data = scene_key(self.scene)
        key = {"scene": name, "data": data, **key, "ranks": store.comm.size}
        if (row := store.find(**key)) is not None:
            return row
        told = ", ".join(map(str, key.values()))
        try:
            row = store.add({**self.measure(scene, choices), **key})
        except InputError as error:
            say(f"{told}: left out: {error}")
            return None
        say(f"{told}: {row['outcome']}, {row['iterations']} iterations, {seconds(row):.3g} s")
        return row

    def measure(self, scene: Scene, choices: dict[str, Any]) -> dict[str, Any]:
        """A run, its errors and the medians of the repeats' seconds. Collective."""
        kind = f"{choices.get('method')} {choices.get('system')} {choices.get('recipe')}"
        if self.repeats > 1 and kind not in self._warm:  # what is compiled and loaded at first use is so before a clock runs
            self._warm.add(kind)
            small = QUICK_SIZES[len(scene.shape)][0]
            run(scene.with_shape((small,) * len(scene.shape)), KRYLOV_MOST, cpu_limit=CPU_MOST, **choices)
        runs = [run(scene, KRYLOV_MOST, cpu_limit=CPU_MOST, **choices)]
        while len(runs) < (self.repeats if MPI.COMM_WORLD.bcast(runs[0]["wall_s"]) < LONG else 1):
            runs.append(run(scene, KRYLOV_MOST, cpu_limit=CPU_MOST, **choices))
        clocks = {clock: f"{median(a_run[clock] for a_run in runs):.6f}" for clock in CLOCKS}
        found = runs[0].get("read_off")
        shape = tuple(runs[0][side] for side in ("nx", "ny") if runs[0].get(side))
        return {**runs[0], **clocks, "runs": len(runs), **(self.errors(found, shape) if found else {})}

    def errors(self, found: Mapping[str, float | None], shape: tuple[int, ...]) -> dict[str, Any]:
        """The columns ERRORS of a run on a grid, and how sure they are. Collective."""
        if shape not in self._discrete:
            self._discrete[shape] = on_grid(self.scene.with_shape(shape))
        discrete, known, L = self._discrete[shape], self.known, self.scene.L
        out = errors(found, known.values, L)
        out |= {name.replace("_error", "_grid"): value for name, value in errors(discrete, known.values, L).items()}
        out |= {name.replace("_error", "_iteration"): value for name, value in errors(found, discrete, L).items()}
        unsure = {f"{name}_unsure": value for name, value in known.unsure.items()}
        return {**{name: f"{value:.4e}" for name, value in out.items()}, **unsure, "known": known.how}
