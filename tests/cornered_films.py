"""Drawn films whose recesses have corners, and by how much what near films say without problems is off what problems say.

mpiexec -n 2 python tests/cornered_films.py     prints that of some of them as JSON
"""

import json
from typing import Any

import numpy as np
from mpi4py import MPI

from lcp_lube import load_scene, solve
from lcp_lube.drivers.derivatives import film_gradient, near_films
from lcp_lube.drivers.derivatives.adjoint import Adjoint
from lcp_lube.drivers.derivatives.film_gradient import FilmGradient
from lcp_lube.scenes.values import values_of, with_values

STEP = 1e-5
KINDS = ("pad", "pad", "pad", "ring", "journal", "sector")
OPEN = ("west", "east", "south", "north")


def own_derivatives(monkeypatch: Any, scene: Any, solution: Any, names: list[str]) -> list[list[Any]]:
    """By the film at all points, of the numbers: in one pass, and of arrays."""
    fields = []
    for least in (1, 10**9):
        monkeypatch.setattr(film_gradient, "SMALL", least)
        adjoint = Adjoint(scene, solution, names)
        fields.append([FilmGradient(adjoint).field(name) for name in names])
        adjoint.destroy()
    return fields


def recess_of(rng: np.random.Generator, depth: float, L: float, W: float) -> dict[str, Any]:
    """A pocket, or square dimples."""
    if rng.random() < 0.5:
        x, y = (sorted(map(float, rng.uniform(0.05, 0.95, 2) * extent)) for extent in (L, W))
        return {"shape": "pocket", "depth": depth, "x": x, "y": y}
    columns, rows = (int(n) for n in rng.integers(1, 5, 2))
    size = float(rng.uniform(0.1, 0.9)) * min(L / columns, W / rows)
    return {"shape": "dimples", "form": "square", "columns": columns, "rows": rows, "size": size, "depth": depth}


def drawn(seed: int) -> Any:
    """A scene of 1 to 30 points a side: depths of 1e-2 to 1e2 films, sides of every kind, full and cavitated."""
    rng = np.random.default_rng(seed)
    kind, h, ratio = KINDS[seed % len(KINDS)], float(10 ** rng.uniform(-5.5, -4.5)), float(10 ** rng.uniform(-2, 2))
    n, m = (int(k) for k in rng.integers(1, 31, 2))
    if kind == "sector":
        pad = load_scene("tapered_land")
        parts = [recess_of(rng, ratio * h, *pad.side_lengths)]
        return load_scene("tapered_land", {"film": parts, "nx": max(n, 3), "ny": max(m, 3)})
    L, W = (float(length) for length in rng.uniform(0.005, 0.05, 2))
    sides: dict[str, Any] = {side: {"p": float(rng.choice([0.0, 0.0, 1e5, 3e5]))} for side in OPEN}
    around = {side: {"kind": "periodic"} for side in OPEN[:2]}
    film = [{"shape": "linear", "h_start": h * float(rng.uniform(1, 3)), "h_end": h}]
    if kind in ("ring", "journal"):
        n, m, sides = max(n, 6), max(m, 2), sides | around | {"south": {"p": 1e5}}
    if kind == "journal":  # round a tilted shaft
        film = [{"shape": "journal", "c": h, "eccentricity": float(rng.uniform(0.1, 0.9))}]
        film.append({"shape": "linear", "along": "y", "h_start": 0.0, "h_end": 0.2 * h})
    if kind == "pad" and rng.random() < 0.4:
        kind_y, m = str(rng.choice(["periodic", "closed"])), max(m, 3)
        sides |= {side: {"kind": kind_y} for side in OPEN[2:]}
    film += [recess_of(rng, ratio * h, L, W) for _ in range(1 + (rng.random() < 0.3))]
    fluid: dict[str, Any] = {"mu": float(rng.choice([0.01, 0.2]))}
    supply: list[dict[str, Any]] = []
    if rng.random() < 0.2:
        given = {"p": 4e5} if rng.random() < 0.5 else {"flow": 1e-6}
        supply = [{"shape": "rectangle", "x": [0.3 * L, 0.5 * L], "y": [0.3 * W, 0.45 * W], **given}]
    elif rng.random() < 0.3:
        fluid |= {"barus": 1e-8, "density": str(rng.choice(["constant", "dowson-higginson"]))}
    data = {"family": "bearing", "dimension": 2, "L": L, "width": W, "U": float(rng.choice([1.0, -2.0, 0.01, 10.0]))}
    return load_scene(data | {"fluid": fluid, "film": film, "nx": n, "ny": m, "sides": sides, "supply": supply})


def off(scene: Any) -> tuple[float, int]:
    """Of all numbers what their changes by two near films differ by at most, in parts of the terms that they are made of; and
    by how many of the scene's numbers. NaN: no film with corners, or no answer. Collective."""
    if not scene.model.cornered:
        return np.nan, 0
    with solve(scene) as solution:
        if not solution.converged:
            return np.nan, 0
        names = ["pressure_integral", "p_max", "friction", "flow_south"]
        names += ["load", "moment_x"] if solution.numbers["load"] > 0.0 else []
        names = [name for name in names if name != "flow_south" or scene.model.sides[2].kind == "open"]
        adjoint = Adjoint(scene, solution, names)
        sizes, worst, found = np.array(list(adjoint.sizes.values())), 0.0, 0
        for key, value in values_of(adjoint.scene).items():
            others = [with_values(adjoint.scene, {key: value * (1.0 + part)}) for part in (STEP, -STEP)] if value else []
            quick: list[Any] = [adjoint.near.lagrangians(other) for other in others]
            if quick and all(one is not None for one in quick):
                slow = [adjoint.lagrangians(other) for other in others]
                gap = np.abs((quick[0] - quick[1]) - (slow[0] - slow[1]))
                worst = max(worst, *np.divide(gap, sizes, out=gap, where=sizes > 0.0))
                found += 1
        adjoint.destroy()
    return worst, found


if __name__ == "__main__":
    near_films.SMALL = 1
    told = [off(drawn(seed)) for seed in (2, 3, 4)]
    if MPI.COMM_WORLD.rank == 0:
        print(json.dumps(told))
