"""The one place where a name is bound to code: methods, systems, recipes. Imports no PETSc."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from .errors import InputError, nearest

PACKAGE = Path(__file__).parent
# A wheel carries the recipes inside the package; in a checkout they stand at top level.
RECIPE_DIR = next((d for d in (PACKAGE / "options", PACKAGE.parent / "options") if d.is_dir()), PACKAGE / "options")


@dataclass(frozen=True)
class Entry:
    """A name's code, imported when it is used, and a line that says what it is."""

    target: str
    line: str

    def load(self) -> Callable[..., Any]:
        module, _, name = self.target.partition(":")
        return getattr(import_module(module), name)


METHODS: dict[str, Entry] = {
    "din": Entry("lcp_lube.solvers.din:build", "damped inexact Newton of Mezzadri and Galligani (interior method)"),
}

SYSTEMS: dict[str, Entry] = {
    "full": Entry("lcp_lube.linear.newton_matrix:FullSystem", "the 2n-by-2n matrix [A B; R P] of the papers"),
}


def recipe_names() -> list[str]:
    return sorted(path.stem for path in RECIPE_DIR.glob("*.opts"))


def recipe_line(name: str) -> str:
    """First line of a recipe: what it is and when to use it."""
    return (RECIPE_DIR / f"{name}.opts").read_text().partition("\n")[0].lstrip("# ")


def read_recipe(name: str) -> dict[str, str]:
    """Options of options/NAME.opts: lines '-name value', comments from '#'.

    Raises
    ------
    InputError : no such recipe.
    """
    if name not in recipe_names():
        raise InputError(f"--recipe {name}: no such recipe{nearest(name, recipe_names())}; see 'lcp-lube list'")
    options = {}
    for line in (RECIPE_DIR / f"{name}.opts").read_text().splitlines():
        words = line.partition("#")[0].split(maxsplit=1)
        if words:
            options[words[0].lstrip("-")] = words[1].strip() if len(words) > 1 else ""
    return options
