"""Every picture of README.md, docs/ and benchmarks/ drawn anew: `make pictures` draws those that are stale, ALL=1 all of them.

A picture is stale when what it is drawn from has changed: tools/pictures.json keeps a digest of that for each group, and
tests/docs/test_shown_pictures.py compares. Charts are drawn from their csv; no run is made again.

    python tools/pictures.py [--all] [GROUP ...]
"""

import argparse
import hashlib
import json
import os
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parent.parent
STORED = ROOT / "tools" / "pictures.json"
RESULTS = "benchmarks/results"
DRAWING = [
    f"lcp_lube/output/{name}.py" for name in ("journal", "liquid", "maps", "panels", "picture", "plot", "style", "units")
]
STUDY = ["lcp_lube/output/style.py", "lcp_lube/studies/drawing.py"]
MAPS = ("conditions", "film_ratio", "inner_tolerance", "roughness", "supply_speed", "turning_point")
PRECISION = f"""
import csv
from pathlib import Path
from mpi4py import MPI
from lcp_lube.studies.precision_picture import draw_all
with open("{RESULTS}/precision.csv", newline="", encoding="utf-8") as file:
    draw_all(list(csv.DictReader(file)), Path("{RESULTS}/precision"), MPI.COMM_WORLD)
"""


@dataclass(frozen=True)
class Group:
    """Pictures that one command draws.

    Attributes
    ----------
    command : words behind the interpreter, run in the root of the checkout.
    pictures : what it draws, a pattern.
    inputs : files that decide how they look; of a page its shell and TOML blocks alone.
    """

    command: list[str]
    pictures: str
    inputs: list[str]

    def digest(self) -> str:
        """Of the command and of what the pictures are drawn from."""
        found = [" ".join(self.command)]
        for name in self.inputs:
            text = (ROOT / name).read_text(encoding="utf-8")
            if name.endswith(".md"):
                text = "\0".join(re.findall(r"^```(?:sh|toml)\n(.*?)^```", text, re.M | re.S))
            found.append(text)
        return hashlib.sha256("\0".join(found).encode()).hexdigest()[:16]


def chart(*words: str) -> list[str]:
    return ["-m", "lcp_lube", "chart", *words, "--results", RESULTS]


def study(name: str) -> list[str]:
    return [*STUDY, f"lcp_lube/studies/{name}.py"]


GROUPS: dict[str, Group] = {
    "first": Group(
        ["-m", "lcp_lube", "solve", "problem4", "--n", "100", "--plot", f"{RESULTS}/problem4.png"],
        f"{RESULTS}/problem4.png",
        [*DRAWING, "lcp_lube/scenes/problem4.toml"],
    ),
    "examples": Group(["tests/docs/test_examples.py"], "docs/pictures/*.png", ["docs/examples.md", *DRAWING]),
    "model": Group(
        ["-m", "lcp_lube", "solve", "lined_pad", "--plot-model", "docs/pictures/model_lined_pad.png"],
        "docs/pictures/model_lined_pad.png",
        ["lcp_lube/output/model_picture.py", "lcp_lube/output/style.py", "lcp_lube/scenes/lined_pad.toml"],
    ),
    "grid_error": Group(
        [
            "-m",
            "lcp_lube",
            *["sensitivity", "dimpled_pad", "--nx", "79", "--ny", "79", "--errors", "docs/pictures/grid_error.png"],
        ],
        "docs/pictures/grid_error.png",
        ["lcp_lube/output/style.py", "lcp_lube/drivers/derivatives/goal_error.py", "lcp_lube/scenes/dimpled_pad.toml"],
    ),
    "dynamics": Group(["tools/dynamics_pictures.py"], "docs/pictures/stored_void.png", ["tools/dynamics_pictures.py"]),
    "explorer": Group(
        ["tools/explorer_picture.py", "docs/images/explore.png"],
        "docs/images/explore.png",
        ["tools/explorer_picture.py", *(f"lcp_lube/cli/explore/page.{kind}" for kind in ("html", "css", "js"))],
    ),
    "precision": Group(
        ["-c", PRECISION],
        f"{RESULTS}/precision_*.png",
        [*study("precision_picture"), "lcp_lube/studies/precision_words.py", f"{RESULTS}/precision.csv"],
    ),
    "rungs": Group(chart("rungs"), f"{RESULTS}/rungs.png", [*study("rungs"), f"{RESULTS}/rungs.csv"]),
    "scaling": Group(chart("scaling"), f"{RESULTS}/scaling.png", [*study("scaling"), f"{RESULTS}/scaling.csv"]),
    "starts": Group(
        chart("stability", "starts"),
        f"{RESULTS}/starts_*.png",
        [*study("starts"), "lcp_lube/studies/map_picture.py", f"{RESULTS}/starts.csv"],
    ),
    **{
        name: Group(
            chart("stability", name),
            f"{RESULTS}/stability_{name}.png",
            [*study("map_picture"), f"lcp_lube/studies/{name}.py", f"{RESULTS}/stability_{name}.csv"],
        )
        for name in MAPS
    },
    "mezzadri": Group(
        ["benchmarks/mezzadri_galligani_figures.py"],
        f"{RESULTS}/mezzadri_galligani_figure*.png",
        ["benchmarks/mezzadri_galligani_figures.py", *DRAWING],
    ),
    "bergamaschi": Group(
        ["benchmarks/bergamaschi_zilli_figures.py"],
        f"{RESULTS}/bergamaschi_zilli_figure*.png",
        ["benchmarks/bergamaschi_zilli_figures.py", "lcp_lube/output/style.py"],
    ),
}


def stored() -> dict[str, str]:
    """The digests that the pictures were drawn from, by group."""
    return json.loads(STORED.read_text(encoding="utf-8")) if STORED.is_file() else {}


def stale() -> list[str]:
    """Groups of pictures that are drawn from something else than is there now."""
    known = stored()
    return [name for name, group in GROUPS.items() if known.get(name) != group.digest()]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--all", action="store_true", help="also those that are not stale")
    parser.add_argument("groups", nargs="*", metavar="GROUP", help=f"any of {', '.join(GROUPS)}; default: those that are stale")
    args = parser.parse_args()
    if unknown := [name for name in args.groups if name not in GROUPS]:
        parser.error(f"no group {unknown[0]}; there are {', '.join(GROUPS)}")
    environment = {**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{ROOT / 'tests'}", "OMP_NUM_THREADS": "1"}
    failed = []
    for name in args.groups or ([*GROUPS] if args.all else stale()):
        print(f"pictures: {name}", flush=True)
        if subprocess.run([sys.executable, *GROUPS[name].command], cwd=ROOT, env=environment).returncode:
            failed.append(name)
            continue
        STORED.write_text(json.dumps({**stored(), name: GROUPS[name].digest()}, indent=1, sort_keys=True) + "\n")
    print(f"pictures: failed: {', '.join(failed)}" if failed else "pictures: all are as they should be", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
