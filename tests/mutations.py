"""Damaged command lines: case(k) is the k-th of them, the same in every run."""

import os
import random
from dataclasses import dataclass, field
from pathlib import Path

from lcp_lube.registry import METHODS, SCENE_DIR, SYSTEMS, recipe_names, scene_names

# Small enough to solve in a blink whatever else is damaged.
SIZES = {
    "journal": "--nx 24 --ny 7",
    "textured_slider": "--set K=1",
    "rough": "--n 12",
    "problem4": "--n 10",
    "ehl_line": "--n 20",
    "bratu": "--n 8",
    "poisson_cubic": "--n 8",
    "manufactured_cubic": "--n 8",
    "obstacle_ball": "--n 9",
    "obstacle_bratu": "--n 9",
}
TOML = r"""
-1|0|-0.0|1|2|7.5|nan|-nan|inf|-inf|1e308|-1e308|1e-308|5e-324|1e400|999999999999999999999|true|false|"text"|""|"1e-5"|[]
[1, 2]|[nan]|[[1], [2]]|{}|{a = 1}|1979-05-27|07:32:00|0x1F|0b1|1_000|.5|1.|'é'|"\u202e"|"a\nb"|\"\"\"|"open|[1, 2|{a|=|1 2|#
1e-12|1e12|-1e-6|1e-5|1e5|3|"x"|"sinusoid"|"parabola"|"nodal"|"face"|"upwind"|"exp(710)"|"1/0"|"x**1e9"|"__import__('os')"|"("
""".strip()
VALUES = [value for line in TOML.splitlines() for value in line.split("|")]
LONG = ["[" * 3000 + "]" * 3000, '"' + "a" * 20000 + '"', "9" * 5000, "{a = " * 400 + "1" + "}" * 400]
WORDS = """nan inf -inf -1 0 1 2 1e400 -1e-400 0x10 1_0 1e5 0.5 1e-300 1e-12 99999999999999999999 true none [] {} = == -- - a=b
x,y problem1 .. . / /no/such é ١٢ \u202e""".split()  # noqa: SIM905
WORDS += ["", " ", "\n", "a\nb", "a" * 5000, "\udcff", "\x00", "%s", "{}", "'", '"', "\x1b[31m"]
NUMBERS = "--n --nx --ny --eps1 --eps2 --max-it --p0 --r0 --every --accuracy".split()  # noqa: SIM905
NAMES = """--film --set --system --mu --conditions --method --recipe --quantity --checkpoint --resume --output
--plot""".split()  # noqa: SIM905
FLAGS = ["--nested", "--no-nested", "--certify", "--explain", "--json=1", "--nestd", "--", "-", "---n"]
PLACES = """folder folder.npz file file/x.npz file/x.png no/x.npz no/x.png gone.npz loop.npz .npz x.npz x.png x.xyz bytes.toml
empty.toml folder.toml long.toml /proc/x.npz pipe pipe.npz pipe.png""".split()  # noqa: SIM905
PLACES += ["", " ", "\x00.npz", "x" * 300 + ".npz"]
PETSC = """ksp_rtol ksp_atol ksp_divtol ksp_max_it ksp_gmres_restart ksp_norm_type ksp_pc_side ksp_initial_guess_nonzero
pc_factor_levels pc_factor_fill pc_factor_shift_type pc_factor_mat_ordering_type pc_sor_omega pc_sor_its ksp_typ pc_typ
ksp_richardson_scale mat_type pc_factor_zeropivot ksp_type""".split()  # noqa: SIM905
PETSC_TYPES = """cg gmres fgmres bcgs preonly richardson chebyshev tfqmr cr lsqr python none jacobi bjacobi sor lu ilu cholesky
icc asm gamg hypre ml fieldsplit composite ksp galerkin mg redundant svd shell mat telescope kaczmarz""".split()  # noqa: SIM905
START = ["-log_view", "-options_left", "-info", "-history", "-malloc_debug", "-options_view", "-help", "-ksp_view"]


@dataclass
class Case:
    """A command line; `same` says that nothing in it changes the answer to the undamaged `base`, which is solved too."""

    words: list[str]
    kind: str
    base: list[str] = field(default_factory=list)
    same: bool = False
    petsc: dict[str, str] = field(default_factory=dict)
    separate: bool = False  # in a process of its own


def size(scene: str) -> list[str]:
    return SIZES.get(scene, "--n 30").split()


def case(k: int, folder: Path) -> Case:
    """The k-th case; its files are written into the folder, which `furnish` has prepared."""
    rng = random.Random(k)
    kind = rng.choices([_scene, _options, _files, _petsc, _process], [45, 30, 10, 10, 5])[0]
    return kind(rng, folder)


def furnish(folder: Path) -> None:
    """Files that are not what their names say."""
    for name in ("folder", "folder.npz", "folder.toml"):
        (folder / name).mkdir()
    (folder / "file").write_text("x")
    for name in ("pipe", "pipe.npz", "pipe.png"):
        os.mkfifo(folder / name)
    (folder / "gone.npz").symlink_to(folder / "nowhere" / "x.npz")
    (folder / "loop.npz").symlink_to(folder / "loop.npz")
    (folder / "gone.toml").symlink_to(folder / "nowhere" / "x.toml")
    (folder / "loop.toml").symlink_to(folder / "loop.toml")
    (folder / "bytes.toml").write_bytes(bytes(range(256)))
    (folder / "empty.toml").write_text("")
    (folder / "long.toml").write_text("family = 'slider'\nh_min = 1e-5\n" + "# " + "long " * 100_000)


def _scene(rng: random.Random, folder: Path) -> Case:
    """A built-in scene file with one to three faults."""
    name = rng.choice(scene_names())
    lines = (SCENE_DIR / f"{name}.toml").read_text(encoding="utf-8").splitlines()
    others = [
        line for other in scene_names() for line in (SCENE_DIR / f"{other}.toml").read_text().splitlines() if " = " in line
    ]
    data = b""
    for _ in range(rng.choice([1, 1, 2, 3])):
        place = rng.randrange(len(lines)) if lines else 0
        value = rng.choice(LONG) if rng.random() < 0.02 else rng.choice(VALUES)
        fault = rng.choice(["value", "value", "value", "add", "unknown", "drop", "double", "table"])
        settings = [i for i, line in enumerate(lines) if " = " in line and not line.startswith("#")]
        if fault == "value" and settings:
            place = rng.choice(settings)
            lines[place] = f"{lines[place].partition(' = ')[0]} = {value}"
        elif fault == "add":
            lines.insert(place, rng.choice(others).partition(" = ")[0] + f" = {value}")
        elif fault == "unknown":
            lines.insert(place, f"{rng.choice(['hmin', 'colour', 'n_', 'x.y.z', '', 'é', 'family.name'])} = {value}")
        elif fault == "drop" and lines:
            del lines[place]
        elif fault == "double" and lines:
            lines.insert(place, lines[place])
        else:
            lines.insert(place, rng.choice(["[film]", "[[film]]", "[fluid]", "[a.b.c]", "[]", "[[x]", "[h_min]"]))
    data = "\n".join(lines).encode()
    if rng.random() < 0.15:
        damaged = bytearray(data)
        for _ in range(rng.randint(1, 4)):
            if damaged:
                damaged[rng.randrange(len(damaged))] = rng.randrange(256)
        data = bytes(damaged[: rng.randint(0, len(damaged))] if rng.random() < 0.3 else damaged)
    (folder / "case.toml").write_bytes(data)
    return Case(["solve", "case.toml", *size(name)], "scene")


def _options(rng: random.Random, folder: Path) -> Case:
    scene = rng.choice(["problem1", "problem2", "problem3", "problem4", "obstacle_bratu", "long_journal"])
    base = ["solve", scene, *size(scene)]
    words, same = list(base), True
    for _ in range(rng.choice([1, 1, 2])):
        fault = rng.random()
        if fault < 0.3:
            option = rng.choice(NUMBERS)
            words += [option, rng.choice(WORDS)]
            same &= option not in ("--n", "--nx", "--ny", "--accuracy", "--eps1")
        elif fault < 0.6:
            option = rng.choice(NAMES)
            good = {
                "--system": [*SYSTEMS],
                "--method": [*METHODS],
                "--recipe": recipe_names(),
                "--conditions": ["F", "FRCB", "B"],
            }
            words += [option, rng.choice([*WORDS, *good.get(option, [])])]
            same &= option not in ("--set", "--film")
        elif fault < 0.75:
            key = rng.choice(
                ["h_min", "h_max", "U", "mu", "p_a", "n", "din.gamma", "din.p0", "active-set.sweeps", "a.b", "", "film.x"]
            )
            words += ["--set", f"{key}={rng.choice([*VALUES, *WORDS])}"]
            same = False
        elif fault < 0.85:
            words += [rng.choice(FLAGS)]
        elif fault < 0.93:
            words = [
                "compare",
                scene,
                *size(scene),
                "--methods",
                rng.choice([*WORDS, "din,active-set", "din,,", ",", "fbn-a,x"]),
            ]
            words += ["--recipes", rng.choice([*WORDS, "superlu", "mumps,lu", "superlu,superlu_dist", ",,"])]
            base, same = [], False
        else:
            vary = [
                f"h_min={value}"
                for value in ("1e-5:2e-5:2", "0:1:0", "1:2", "nan:1:2", "1:1:1", "1e-5,x", "", "1e-5:2e-5:2:log")
            ]
            vary += [
                "x=1:2:2",
                "=1:2:2",
                "-1:1:3",
                "h_min=1e-5:2e-5:-1",
                "n=1:2:2.5",
                "U=inf:1:3",
                "film=a,b",
                "h_min=-1:1:3:log",
            ]
            words = ["sweep", scene, *size(scene), "--vary", rng.choice([*vary, *WORDS])]
            base, same = [], False
    if rng.random() < 0.05:
        words[rng.randrange(len(words))] = rng.choice(WORDS)
        same = False
    return Case(words, "options", base, same)


def _files(rng: random.Random, folder: Path) -> Case:
    base = ["solve", "problem1", "--n", "30"]
    option = rng.choice(["--output", "--plot", "--checkpoint", "--resume", "-options_file", "SCENE", "new", "sweep"])
    place = rng.choice(PLACES)
    if option == "new":
        place = rng.choice(
            [place, "new.toml", "no/new.toml", "file/new.toml", "gone.toml", "loop.toml", "\x00.toml", "y" * 300 + ".toml"]
        )
        return Case(
            ["new", place, "--from", rng.choice([*scene_names(), *WORDS, "case.toml", "folder.toml", "bytes.toml"])], "new"
        )
    if option == "sweep":
        return Case(["sweep", "problem1", "--n", "20", "--vary", "h_min=1e-5,2e-5", "--output", place], "sweep")
    words = ["solve", place or "none.toml", "--n", "30"] if option == "SCENE" else [*base, option, place]
    return Case(words, "files", base, same=option != "SCENE")


def _petsc(rng: random.Random, folder: Path) -> Case:
    """PETSc options that are numbers or names of few, on an iterative solver."""
    base = ["solve", rng.choice(["problem1", "problem2"]), "--n", "30", "--method", "din"]
    options = {
        rng.choice(PETSC): rng.choice([*WORDS[:26], "left", "right", "symmetric", "natural", "nd", "dense", "baij", "1e-2"])
    }
    return Case([*base, "--recipe", rng.choice(["gmres_ilu", "superlu", "bcgs_ilu"])], "petsc", base, True, options)


def _process(rng: random.Random, folder: Path) -> Case:
    """What could end the process itself: PETSc's types and what PETSc reads at its start and end."""
    base = ["solve", rng.choice(["problem1", "problem4"]), "--n", "10", "--method", rng.choice(["din", "active-set"])]
    good = [word for word in WORDS if "\x00" not in word and "\udcff" not in word]
    words = [*base, "--max-it", "40"]  # a poor preconditioner may take all 10,000 iterations in each
    if rng.random() < 0.6:
        words += ["-ksp_type", rng.choice(PETSC_TYPES), "-pc_type", rng.choice(PETSC_TYPES)]
    else:
        words += [rng.choice(START), rng.choice([*good, ":/no/such/x", ":x:ascii_xml", ":x:nonsense", "draw", "foo", ":"])]
    return Case([*words, *(["--json"] if rng.random() < 0.5 else [])], "process", base, False, separate=True)
