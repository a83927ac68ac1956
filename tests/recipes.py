"""What each recipe is tried on: a command line a recipe, and what came of it."""

import argparse
from typing import Any

import pytest

from lcp_lube.cli.arguments import parse
from lcp_lube.registry import read_recipe, recipe_line

# Those that do not suit the problem which their first line leads to.
SUITED = {
    "fsai": "bratu --n 12",
    "bcgs_jacobi": "bratu --n 12",
    "multigrid": "obstacle_bratu --n 31",
    "dense_lu": "ehl_line --n 40",
    "redundant_lu": "ehl_line --n 40",
}


def example(name: str, max_it: int) -> argparse.Namespace:
    """Arguments of `solve` on a small problem for this recipe, as its first line says what it is for."""
    line = recipe_line(name)
    system = next((word for word in ("reduced", "cavity") if f"{word} system" in line), "full")
    method = "active-set" if system == "cavity" else "din"
    scene = "problem4 --nx 9 --ny 8" if "2D" in line or system == "cavity" else "problem1 --n 13"
    words = SUITED.get(name, f"{scene} --method {method} --system {system} --no-nested").split()
    return parse(["solve", *words, "--recipe", name, "--max-it", str(max_it), "--eps1", "1e-4", "--eps2", "1e-4"])


def one_rank(name: str) -> bool:
    return "one rank" in recipe_line(name)


def lacking(name: str) -> str:
    """The solver package that a recipe asks for and this PETSc was built without; empty if there is none."""
    from petsc4py import PETSc

    packages = {"hypre", "ml", "mumps", "superlu", "superlu_dist", "umfpack", "klu"} & set(read_recipe(name).values())
    names = {"umfpack": ("umfpack", "suitesparse"), "klu": ("klu", "suitesparse")}
    has = PETSc.Sys.hasExternalPackage
    return ", ".join(sorted(p for p in packages if not any(map(has, names.get(p, (p,))))))


def attempt(name: str, max_it: int = 60) -> dict[str, Any]:
    """Outcome of a recipe's example and the options that nobody had read by its last step. Collective."""
    from lcp_lube.base.options import unread
    from lcp_lube.cli.asked import solution_of

    if package := lacking(name):
        return {"lacks": package}
    left: list[list[str]] = []
    solution = solution_of(example(name, max_it), lambda k, step: left.append(unread()))
    result = {
        "outcome": str(solution.outcome),
        "message": solution.message,
        "unread": left[-1] if left else ["no step was made"],
        "recipe": solution.settings["recipe"],
    }
    solution.destroy()
    return result


def faults(name: str, result: dict[str, Any], outcomes: tuple[str, ...] = ("converged",)) -> list[str]:
    """What is wrong with a result; a recipe whose first line says that it fails may fail."""
    if "lacks" in result:
        pytest.skip(f"this PETSc has no {result['lacks']}")
    wrong = [f"option -{option} goes unread" for option in result["unread"]]
    if result["recipe"] != name:
        wrong.append(f"ran as {result['recipe']}")
    if result["outcome"] not in outcomes and "fails" not in recipe_line(name):
        wrong.append(f"{result['outcome']}: {result['message']}")
    return wrong
