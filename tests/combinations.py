"""Every recipe by method, system, kind of sides and number of ranks on small films, and what may come of each.

As a script: runs a list of them on the ranks that it is started on; before and after each, rank 0 writes a line.
"""

import json
import os
import random
import sys
from dataclasses import asdict, dataclass
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from lcp_lube import InputError, load_scene, solve
from lcp_lube.output.files import gather
from lcp_lube.problems.film.rims import state_of
from lcp_lube.registry import METHODS, recipe_names

SHAPES = ((23, 17), (7, 5), (41, 3), (3, 41), (9, 1), (1, 9), (1, 1))  # nx, ny
SIDES: dict[str, dict[str, Any]] = {
    "open": {},
    "pressures": {"west": 3e5, "north": 5e5},
    "west closed": {"west": "closed"},
    "east closed": {"east": "closed"},
    "corner closed": {"west": "closed", "south": "closed"},
    "mirror": {"south": "symmetry"},
    "ring": {"west": "periodic", "east": "periodic", "north": 3e5},
    "ring, mirror": {"west": "periodic", "east": "periodic", "north": "symmetry", "south": 2e5},
    "tube": {"south": "periodic", "north": "periodic"},
    "tube, dead end": {"south": "periodic", "north": "periodic", "east": "closed"},
}
FILMS = 3  # for each of the sides and shapes
LOOSE, LOOSEST = 1e-8, 1e-6  # of the largest p, and of r; between them a certificate must say what was reached
STEP = 0.1 * LOOSE  # the last one at most: answers of inexact steps are as far off as these are long
STEPS, INNER = 60, 200  # outer and inner iterations: what needs more may fail
LEAVE = 400  # inner iterations in all after which a run on several ranks is left, as each waits for messages


@dataclass(frozen=True)
class Combination:
    """One run; film is the seed of its surface."""

    recipe: str
    method: str
    system: str
    sides: str
    ranks: int
    shape: tuple[int, int]
    film: int

    def scene(self) -> dict[str, Any]:
        rng = np.random.default_rng(self.film)
        start, end = rng.uniform(5, 20, 2)
        return {
            "family": "bearing",
            "dimension": 2,
            "L": 0.01,
            "width": 0.006,
            "U": float(rng.uniform(0.5, 3)),
            "nx": self.shape[0],
            "ny": self.shape[1],
            "h_floor": 2e-6,
            "fluid": {"mu": 0.02, "p_supply": float(rng.choice([0.0, 1e5]))},
            "film": [
                {"shape": "linear", "h_start_um": float(start), "h_end_um": float(end)},
                {"shape": "roughness", "sigma_um": float(rng.uniform(0, 3)), "cells": 17, "seed": self.film},
            ],
            "sides": SIDES[self.sides],
        }


def pairs() -> list[tuple[str, str]]:
    """Methods for films, and the systems of each."""
    return [(m, system) for m, e in METHODS.items() if "lubrication" in e.kinds for system in e.systems or ("auto",)]


def everything(seed: int) -> list[Combination]:
    """All of them in an order of chance; shapes and films are drawn."""
    rng = random.Random(seed)
    rows = [
        Combination(recipe, method, system, sides, ranks, rng.choice(SHAPES), rng.randrange(FILMS))
        for recipe, (method, system), sides, ranks in product(recipe_names(), pairs(), SIDES, (1, 2, 3))
    ]
    rng.shuffle(rows)
    return rows


def tenth(seed: int) -> list[Combination]:
    """A tenth of all recipes by methods, systems and ranks, each with sides by chance."""
    drawn = {(case.recipe, case.method, case.system, case.ranks): case for case in everything(seed)}
    return [*drawn.values()][: len(drawn) // 10]


@cache
def reference(sides: str, shape: tuple[int, int], film: int, revised: bool = True) -> tuple[np.ndarray, np.ndarray]:
    """p and r on this process alone, by dense policy iteration, checked against the conditions themselves.

    revised : whether the first faces at a side where the film ruptures are made for that.
    """
    scene = load_scene(Combination("", "", "", sides, 1, shape, film).scene())
    problem = scene.build(MPI.COMM_SELF)
    p, r = by_policies(problem, f"{sides}, {shape}, film {film}")
    open_west = revised and problem.grid.ends[0][0] == "open" and not problem.p_sides[0] and scene.scheme == "face"
    if open_west and (r.reshape(problem.grid.box)[:, 0] > 0).any():
        p, r = by_policies(problem.revised(state_of(problem, p, r)), f"{sides}, {shape}, film {film}, once more")
    problem.destroy()
    return p, r


def by_policies(problem: Any, name: str) -> tuple[np.ndarray, np.ndarray]:
    A, B = (dense(mat) for mat in (problem.A, problem.B))
    c, rng = problem.c, np.random.default_rng(0)
    full, k = np.ones(c.size, dtype=bool), 0
    while True:
        z = np.linalg.solve(np.where(full, A, -B), c)
        wrong = (z > 0) != full
        wrong &= np.abs(z) > 1e-13 * np.where(full, np.abs(z).max(), 1.0)
        if not wrong.any():
            break
        k += 1
        full ^= wrong & (rng.random(c.size) < (1.0 if k < 30 else 0.5))  # by chance where all at once goes round in circles
        assert k < 1000, f"no reference for {name}"
    p, r = np.where(full, np.maximum(z, 0.0), 0.0), np.where(full, 0.0, np.maximum(-z, 0.0))
    terms = np.abs(A) @ p + np.abs(B) @ r + np.abs(c)
    assert np.all(np.abs(A @ p + B @ r - c) <= 1e-9 * terms.max())
    problem.free_matrices()
    return p, r


def dense(mat: Any) -> np.ndarray:
    pointers, columns, values = mat.getValuesCSR()
    out = np.zeros(mat.getSize())
    out[np.repeat(np.arange(len(pointers) - 1), np.diff(pointers)), columns] = values
    return out


class LeftError(Exception):
    """Ends a run from within its monitor."""


def attempt(case: Combination) -> str:
    """'converged', 'refused: ...', 'left' or another outcome; 'WRONG: ...', 'ERROR: ...' are what must not be. Collective."""
    inner = 0

    def monitor(_: int, step: Any) -> None:
        nonlocal inner
        inner += step.linear_iterations
        if case.ranks > 1 and inner > LEAVE:
            raise LeftError

    try:
        solution = solve(
            load_scene(case.scene()),
            method=case.method,
            system=case.system,
            recipe=case.recipe,
            stopping={"eps1": 1e-11, "eps2": STEP, "max_it": STEPS},
            memory_check=False,
            monitor=monitor,
        )
    except LeftError:
        return "left"
    except InputError as refusal:
        return f"refused: {refusal}" if str(refusal).strip() else "ERROR: refused without a reason"
    except Exception as error:
        return f"ERROR: {type(error).__name__}: {error}"
    outcome = str(solution.outcome)
    p, r = (gather(solution.problem.grid, solution.fields[name]).ravel() for name in "pr")
    if outcome == "converged" and MPI.COMM_WORLD.rank == 0:
        kept = any(one.startswith("faces are those of a full film") for one in solution.settings["why"])  # and it says so
        expected = reference(case.sides, case.shape, case.film, not kept)
        p_off = np.abs(p - expected[0]).max() / (expected[0].max() or 1.0)
        r_off = np.abs(r - expected[1]).max()
        said = min(4 * max(solution.certificate.measures.values()), LOOSEST)
        if not max(p_off, r_off) <= max(LOOSE, said):
            outcome = f"WRONG: p by {p_off:.1e} of the largest, r by {r_off:.1e}"
    elif outcome != "converged" and not solution.message:
        outcome = f"ERROR: {outcome} without a sentence"
    solution.destroy()
    return outcome


def main(file: Path, record: Path) -> None:
    from petsc4py import PETSc

    PETSc.Options().setValue("ksp_max_it", str(INNER))
    with (record if MPI.COMM_WORLD.rank == 0 else Path(os.devnull)).open("w") as out:
        for row in json.loads(file.read_text()):
            case = Combination(**{**row, "shape": tuple(row["shape"])})
            for say in (lambda case: asdict(case), attempt):
                words = say(case)
                out.write(json.dumps(words) + "\n")
                out.flush()


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
