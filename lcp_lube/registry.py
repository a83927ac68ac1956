"""The one place where a name is bound to code: methods, systems, scene families, film shapes, drivers, charts, recipes.

Imports no PETSc. A package from outside adds lines by an entry point of the group 'lcp_lube' (docs/architecture.md).
"""

import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from math import inf
from pathlib import Path
from types import MappingProxyType
from typing import Any

from .errors import InputError, nearest

PACKAGE = Path(__file__).parent
SCENE_DIR = PACKAGE / "scenes"
# A wheel carries the recipes inside the package; in a checkout they stand at top level.
RECIPE_DIR = next((d for d in (PACKAGE / "options", PACKAGE.parent / "options") if d.is_dir()), PACKAGE / "options")
SMALL = 20_000  # points up to which one grid and a direct solver cost less than setting up anything better
ELIMINATED = 230  # points of multigrid's coarsest grid: elimination takes less time than the calls of coarser ones
SMALL_BOX = 5_000  # the same where a contact area has to move by a cell a step


@dataclass(frozen=True)
class Entry:
    """A name's code, imported when it is used, and a line that says what it is.

    about : modules of what it is for; while none of them is loaded there is nothing for it to do, and it need not be either.
    table : of the scenes that it is for; of another one it has nothing to do either.
    """

    target: str
    line: str
    about: tuple[str, ...] = ()
    table: str = ""

    def idle(self, scene: Any) -> bool:
        if self.table and getattr(scene, self.table, None) is None:
            return True
        return bool(self.about) and not any(module in sys.modules for module in self.about)

    def load(self) -> Any:
        module, _, name = self.target.partition(":")
        found = sys.modules.get(module) or import_module(module)
        return getattr(found, name) if name else found


@dataclass(frozen=True)
class MethodEntry(Entry):
    """A method: `target` makes one of a solvers.job.Job: its class.

    kinds are the problems it solves (`Problem.kind`), systems the matrices it can use, its default first, none if it solves no
    linear systems; nested: it can start from a coarser grid's answer, which must lie strictly inside p, r > 0 if it is an
    interior method, and does so by default on grids of more than `nested_above` points; eps: its default tolerances of ||F||
    and ||alpha d||; fallback: the methods that take over in turn where it fails; at_most: the points that it can do;
    variants: the same idea for other kinds of problems.
    """

    kinds: tuple[str, ...] = ("lubrication",)
    systems: tuple[str, ...] = ("full", "reduced")
    nested: bool = False
    nested_above: float = inf
    interior: bool = True
    eps: tuple[float, float] = (1e-8, 1e-8)
    fallback: tuple[str, ...] = ()
    at_most: float = inf
    variants: dict[str, "MethodEntry"] = field(default_factory=dict)

    def of(self, kind: str) -> "MethodEntry":
        """The entry for one kind of problem."""
        return self.variants.get(kind, self)


METHODS: dict[str, MethodEntry] = {
    "din": MethodEntry("lcp_lube.solvers.din:DIN", "damped inexact Newton of Mezzadri and Galligani (interior)", nested=True),
    "din-pc": MethodEntry(
        "lcp_lube.solvers.din_pc:DinPc",
        "DIN with a predictor-corrector step: fewer iterations",
        systems=("reduced", "full"),
        nested=True,
        nested_above=500,
    ),
    "active-set": MethodEntry(
        "lcp_lube.solvers.active_set:ActiveSet",
        "semismooth Newton in z = p or -r: finitely many steps to the exact discrete solution",
        kinds=("lubrication", "box", "mixed", "user"),
        systems=("reduced", "full", "cavity"),
        nested=True,
        nested_above=SMALL,
        interior=False,
        fallback=("pivoting", "monotone", "din-pc"),
        variants={
            "box": MethodEntry(
                "lcp_lube.solvers.box_active_set:BoxActiveSet",
                "semismooth Newton: points in contact held, a Newton step at the others",
                kinds=("box",),
                systems=("jacobian",),
                nested=True,
                nested_above=SMALL_BOX,
                interior=False,
                eps=(1e-8, inf),
            ),
            **dict.fromkeys(
                ("mixed", "user"),
                MethodEntry(
                    "lcp_lube.solvers.box_active_set:BoxActiveSet",
                    "semismooth Newton: unknowns at a bound held, a Newton step for the others",
                    kinds=("mixed", "user"),
                    systems=("jacobian",),
                    interior=False,
                    eps=(1e-10, inf),
                    fallback=("semismooth",),
                ),
            ),
        },
    ),
    "interior": MethodEntry(
        "lcp_lube.solvers.interior:Interior",
        "inexact interior point of Bergamaschi and Zilli for box-constrained problems",
        kinds=("box", "mixed", "user"),
        systems=("jacobian",),
        eps=(8e-8, inf),
        variants=dict.fromkeys(
            ("mixed", "user"),
            MethodEntry(
                "lcp_lube.solvers.interior:MixedInterior",
                "inexact interior point of Bergamaschi and Zilli, free unknowns among the bounded ones",
                kinds=("mixed", "user"),
                systems=("jacobian",),
                eps=(1e-10, 1e-4),
                fallback=("semismooth",),
            ),
        ),
    ),
    "semismooth": MethodEntry(
        "lcp_lube.solvers.semismooth:Semismooth",
        "Fischer-Burmeister Newton for bounds of any kind, with proximal steps where it stalls",
        kinds=("user", "mixed", "box"),
        systems=("jacobian",),
        interior=False,
        eps=(1e-10, inf),
    ),
    "fas": MethodEntry(
        "lcp_lube.solvers.fas.driver:Fas",
        "nonlinear multigrid: full multigrid and a few cycles of sweeps, no matrix at all",
        kinds=("lubrication", "box"),
        systems=(),
        interior=False,
        eps=(1e-11, inf),
        fallback=("active-set", "pivoting", "monotone", "din-pc"),
        variants={
            "box": MethodEntry(
                "lcp_lube.solvers.fas.box:BoxFas",
                "nonlinear multigrid between two obstacles: projected sweeps, coarse grids that know the bounds",
                kinds=("box",),
                systems=(),
                interior=False,
                eps=(1e-8, inf),
                fallback=("active-set",),
            )
        },
    ),
    "monotone": MethodEntry(
        "lcp_lube.solvers.monotone:Monotone",
        "policy iteration from above: slow on hard films, but proved to end on every one",
        systems=("reduced",),
        nested=True,
        nested_above=200,
        interior=False,
    ),
    "pivoting": MethodEntry(
        "lcp_lube.solvers.pivoting:Pivoting", "small films of any ratio of heights", systems=(), interior=False, at_most=SMALL
    ),
    "fbn-a": MethodEntry("lcp_lube.solvers.fischer:ArmijoNewton", "Fischer-Burmeister Newton, Armijo rule on ||F||^2/2"),
    "fbn-i": MethodEntry("lcp_lube.solvers.fischer:FischerNewton", "Fischer-Burmeister Newton, inexact decrease of ||F||"),
    "newton": MethodEntry(
        "lcp_lube.solvers.plain_newton:PlainNewton",
        "Newton or inexact Newton for equations without complementarity",
        kinds=("equations",),
        systems=("jacobian",),
    ),
}

# What 'auto' takes for a kind of problem.
DEFAULT_METHOD = {
    "lubrication": "active-set",
    "box": "active-set",
    "equations": "newton",
    "mixed": "interior",
    "user": "semismooth",
}

SYSTEMS: dict[str, Entry] = {
    "full": Entry("lcp_lube.linear.full:FullSystem", "the 2n-by-2n matrix [A B; R P] of the papers"),
    "reduced": Entry("lcp_lube.linear.reduced:ReducedSystem", "the n-by-n M-matrix A diag(theta) - B diag(1 - theta)"),
    "cavity": Entry("lcp_lube.linear.cavity:CavitySystem", "full-film cells alone, the cavitated ones eliminated exactly"),
}

# A scene file's `family` names the model that validates it and builds its problem.
FAMILIES: dict[str, Entry] = {
    "slider": Entry("lcp_lube.scenes.published:SliderScene", "slider with one wave of the film (the published problems)"),
    "textured": Entry("lcp_lube.scenes.published:TexturedScene", "flat slider with square dimples"),
    "journal": Entry("lcp_lube.scenes.journal:JournalScene", "journal bearing with an axial groove at the widest gap"),
    "grooved_journal": Entry("lcp_lube.scenes.grooved:GroovedJournalScene", "journal with axial grooves under a vertical load"),
    "tilting_pad": Entry("lcp_lube.scenes.tilting:TiltingPadScene", "journal in separate pads, fixed or tilting about pivots"),
    "thrust": Entry("lcp_lube.scenes.thrust:ThrustScene", "thrust bearing: equal sectors with tapered lands, steps or spirals"),
    "rough": Entry("lcp_lube.scenes.published:RoughScene", "slider with one wave and a random surface"),
    "bearing": Entry("lcp_lube.scenes.bearing:BearingScene", "a bearing of any kind: film shapes added up, a condition a side"),
    "squeeze": Entry("lcp_lube.scenes.squeeze:SqueezeScene", "parallel plates that approach and part, in time"),
    "bratu": Entry("lcp_lube.scenes.semilinear:BratuScene", "Bratu's equation on the unit square"),
    "obstacle": Entry("lcp_lube.scenes.obstacle:ObstacleScene", "Bratu's equation between two obstacles"),
    "ehl_line": Entry("lcp_lube.scenes.ehl:EhlLineScene", "elastohydrodynamic line contact"),
    "poisson_cubic": Entry("lcp_lube.scenes.semilinear:PoissonCubicScene", "equation (9) of Bergamaschi and Zilli"),
    "manufactured_cubic": Entry("lcp_lube.scenes.semilinear:ManufacturedCubicScene", "a cubic term, the answer known"),
}

# What the tables [[film]] of a bearing may have as their `shape`.
SHAPES: dict[str, Entry] = {
    "constant": Entry("lcp_lube.scenes.film:Constant", "the same height everywhere"),
    "linear": Entry("lcp_lube.scenes.film:Linear", "a straight line: a wedge"),
    "wedge": Entry("lcp_lube.scenes.film:Linear", "another name of linear"),
    "parabola": Entry("lcp_lube.scenes.film:Parabola", "h_min in the middle, h_max at both ends"),
    "sinusoid": Entry("lcp_lube.scenes.film:Sinusoid", "full waves between h_max and h_min"),
    "step": Entry("lcp_lube.scenes.film:StepPart", "one height before a place, another behind it"),
    "pocket": Entry("lcp_lube.scenes.film:Pocket", "a rectangular recess"),
    "dimples": Entry("lcp_lube.scenes.film:Dimples", "an array of equal recesses: square, round, domes"),
    "herringbone": Entry("lcp_lube.scenes.film:HerringbonePart", "inclined grooves that pump towards the middle of the width"),
    "journal": Entry("lcp_lube.scenes.film:JournalPart", "the gap of a journal in its bush, unwrapped"),
    "roughness": Entry("lcp_lube.scenes.film:Roughness", "a random surface, the same for a seed on every grid"),
    "formula": Entry("lcp_lube.scenes.film:FormulaPart", "a formula in x and y"),
    "profile": Entry("lcp_lube.scenes.film:ProfilePart", "a measured profile from a file"),
}

# Effects beyond the rigid, isoviscous film: by the name of their data in a scene, in the order in which they act.
RUNGS: dict[str, Entry] = {
    "barus": Entry("lcp_lube.scenes.bearing:Fluid", "viscosity with pressure"),
    "density": Entry("lcp_lube.scenes.bearing:Fluid", "density"),
    "viscosity": Entry("lcp_lube.scenes.effects.viscosity:ViscosityMap", "viscosity by place"),
    "asperity": Entry("lcp_lube.scenes.effects.asperity:Asperity", "asperity contact"),
    "temperature": Entry("lcp_lube.scenes.effects.temperature:Temperature", "temperature"),
    "roelands": Entry("lcp_lube.scenes.effects.roelands:RoelandsTable", "viscosity with pressure (Roelands)"),
    "shear": Entry("lcp_lube.scenes.effects.shear:Shear", "shear thinning"),
    "elastic": Entry("lcp_lube.scenes.effects.elastic:Elastic", "elasticity"),
    "half_space": Entry("lcp_lube.scenes.effects.half_space:HalfSpace", "elasticity (half space)"),
    "roughness": Entry("lcp_lube.scenes.effects.roughness:SurfaceRoughness", "roughness"),
}

PADS, JOURNALS = ("lcp_lube.scenes.thrust", "lcp_lube.scenes.tilting"), ("lcp_lube.scenes.grooved",)

# A scene's way to an answer, outermost first; `drivers.compose` says what each of these modules offers.
DRIVERS: dict[str, Entry] = {
    "decision": Entry("lcp_lube.drivers.effects.decision", "effects that do not count are left out"),
    "accuracy": Entry("lcp_lube.drivers.accuracy.accuracy", "finer and finer grids until a quantity is as good as asked for"),
    "anew": Entry("lcp_lube.drivers.warm:anew", "what is sought from a neighbour's answer, or anew where that leads nowhere"),
    "pads": Entry("lcp_lube.drivers.loads.pads", "pads that tilt, and the place of what they carry, by Newton's method", PADS),
    "position": Entry("lcp_lube.drivers.loads.position", "where a journal lies under a load, by Newton's method", JOURNALS),
    "balance": Entry("lcp_lube.drivers.loads.balance", "the film that carries the load asked for"),
    "attitude": Entry("lcp_lube.drivers.loads.attitude", "the attitude that follows from the load's direction", JOURNALS),
    "time": Entry("lcp_lube.drivers.marches.time", "step by step, where the film moves", table="motion"),
    "turned": Entry("lcp_lube.drivers.turned", "a wall that moves to smaller x, by the mirror image"),
    "rims": Entry("lcp_lube.drivers.rims", "films with round edges, once more with faces made for their cavities"),
    "supplies": Entry("lcp_lube.drivers.supplies", "pressures of supplies behind restrictors, or of given flow"),
    "warm": Entry("lcp_lube.drivers.warm", "from a neighbour's answer, or anew where that leads nowhere"),
    "coupling": Entry("lcp_lube.drivers.effects.coupling", "effects: coefficients that depend on the answer, in one loop"),
    "grooves": Entry("lcp_lube.drivers.grooves", "films between axial grooves, one by one"),
    "symmetry": Entry("lcp_lube.drivers.symmetry", "no more than symmetry leaves"),
    "direct": Entry("lcp_lube.drivers.direct", "one problem: nested grids, and methods that take over where one fails"),
}

# What a Solution shows of itself; each takes the solution, `summary` its record.
OUTPUT: dict[str, Entry] = {
    "record": Entry("lcp_lube.output.results:as_dict", "the dictionary that --json prints"),
    "summary": Entry("lcp_lube.output.results:summary", "a few lines for people"),
    "plot": Entry("lcp_lube.output.plot:plot", "pictures"),
    "save": Entry("lcp_lube.output.files:save", "fields in files"),
    "coefficients": Entry("lcp_lube.drivers.motions.coefficients:coefficients_of", "stiffness and damping"),
    "gradient": Entry("lcp_lube.drivers.derivatives.gradient:gradient_of", "derivatives of a number by those of the scene"),
    "film_gradient": Entry("lcp_lube.drivers.derivatives.gradient:film_gradient_of", "derivative by the film at every point"),
    "xarray": Entry("lcp_lube.output.dataset:to_xarray", "fields as an xarray.Dataset"),
}

# The maps of `chart stability`: each makes its runs and draws them.
STABILITY: dict[str, Entry] = {
    "starts": Entry("lcp_lube.studies.starts:chart", "starting vectors p0, r0 from 1e-15 to 1e3 by rule for mu (DIN)"),
    "conditions": Entry("lcp_lube.studies.conditions:chart", "all subsets of the step-length conditions F, R, C, B (DIN)"),
    "film_ratio": Entry("lcp_lube.studies.film_ratio:chart", "film ratio 1.1 to 1e4 by grid, every method"),
    "supply_speed": Entry("lcp_lube.studies.supply_speed:chart", "supply pressure by speed, every method"),
    "inner_tolerance": Entry("lcp_lube.studies.inner_tolerance:chart", "loose inner solves by recipe, and what (31) says"),
    "roughness": Entry("lcp_lube.studies.roughness:chart", "amplitude of a random surface by grid, every method"),
    "turning_point": Entry("lcp_lube.studies.turning_point:chart", "lambda around the turning point of Bratu's equation"),
}


def scene_names() -> list[str]:
    return sorted(path.stem for path in SCENE_DIR.glob("*.toml"))


def recipe_names() -> list[str]:
    return sorted(path.stem for path in RECIPE_DIR.glob("*.opts"))


def is_scene(name: str) -> bool:
    """Whether it is a built-in scene's name."""
    return Path(name).name == name and (SCENE_DIR / f"{name}.toml").is_file()


def recipe_line(name: str) -> str:
    """First line of a recipe: what it is and when to use it."""
    return (RECIPE_DIR / f"{name}.opts").read_text().partition("\n")[0].lstrip("# ")


@cache  # the package's own files
def read_recipe(name: str) -> Mapping[str, str]:
    """Options of options/NAME.opts: lines '-name value', comments from '#'.

    Raises
    ------
    InputError : no such recipe.
    """
    if Path(name).name != name or not (RECIPE_DIR / f"{name}.opts").is_file():
        raise InputError(f"--recipe {name}: no such recipe{nearest(name, recipe_names())}; see 'lcp-lube list'")
    options = {}
    for line in own_text(RECIPE_DIR / f"{name}.opts").splitlines():
        words = line.partition("#")[0].split(maxsplit=1)
        if words:
            options[words[0].lstrip("-")] = words[1].strip() if len(words) > 1 else ""
    return MappingProxyType(options)


@cache
def own_text(path: Path) -> str:
    """What a file of the package says: it is read once."""
    return path.read_text(encoding="utf-8")


# First a search for the name: the module that parses these files takes longer to import than all the rest.
_files = (file for folder in sys.path for file in Path(folder).glob("*-info/entry_points.txt"))
if any(os.access(file, os.R_OK) and b"[lcp_lube]" in file.read_bytes() for file in _files):
    for _point in import_module("importlib.metadata").entry_points(group="lcp_lube"):
        _point.load()(sys.modules[__name__])
