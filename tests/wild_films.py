"""Films that nobody tuned for: extreme in every number, sides of every kind in every combination, from a seed each.

`scene_of(seed, folder)` is a bearing with 1 to 40 points a side, in 1D or 2D: speeds 1e-12 to 1e9 m/s, of either sign, and 0,
film ratios to 1e4, viscosities, sizes and pressures over many decades, all shapes of [[film]], added up. It may have no unique
solution, and then it must be refused. `judge` solves it by `auto` and compares with `dense_film`.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from dense_film import Dense

from lcp_lube.api import solve
from lcp_lube.errors import InputError
from lcp_lube.problems.film.graded import whole
from lcp_lube.scenes.bearing import BearingScene

WRONG = 1e-6  # of the largest pressure
SHAPES = (
    "constant",
    "linear",
    "parabola",
    "sinusoid",
    "step",
    "pocket",
    "dimples",
    "journal",
    "roughness",
    "formula",
    "profile",
)
FORMULAS = (
    "1 + 0.5*sin({a}*x/{L}) + 0.3*cos({b}*y/{W})",
    "exp(2*sin({a}*x/{L} + {b}*y/{W}))",
    "1 + {a}*abs(x/{L} - 0.5)**1.5 + 0.1*(y/{W})**2",
    "({a} if x < 0.37*{L} else 1) + ({b} if y > 0.61*{W} else 0)",
    "1 + sqrt(x/{L})*{a}",
)


def part_of(rng: np.random.Generator, seed: int, size: float, L: float, W: float, plane: bool, folder: Path) -> dict[str, Any]:
    """One [[film]] table whose heights lie between 0 and about `size` metres."""
    low = size * float(10 ** rng.uniform(-4, 0))
    pair = dict(zip(("h_min", "h_max"), (low, size), strict=True))
    shape = str(rng.choice(SHAPES))
    table: dict[str, Any] = {"shape": shape}
    along = "y" if plane and rng.random() < 0.3 else "x"
    length = W if along == "y" else L
    a, b = sorted(float(v) for v in rng.uniform(0.02, 0.98, 2))
    if shape in ("linear", "parabola", "sinusoid", "step"):
        table["along"] = along
    if shape == "constant":
        table["h"] = size
    elif shape == "linear":
        first, second = (size, low) if rng.random() < 0.5 else (low, size)
        table |= {"h_start": first, "h_end": second}
    elif shape in ("parabola", "sinusoid"):
        table |= pair
        if shape == "sinusoid":
            table["waves"] = float(10 ** rng.uniform(-0.3, 1))
        if rng.random() < 0.4:
            table["between"] = [a * length, (b + 1e-3) * length]
    elif shape == "step":
        table |= {"height": size, "at": a * length}
    elif shape == "pocket":
        table |= {"depth": size, "x": [a * L, (b + 1e-3) * L]}
        if plane and rng.random() < 0.8:
            c, d = sorted(float(v) for v in rng.uniform(0.02, 0.98, 2))
            table["y"] = [c * W, (d + 1e-3) * W]
    elif shape == "dimples":
        columns, rows = int(rng.integers(1, 6)), int(rng.integers(1, 6)) if plane else 1
        cell = min(L / columns, W / rows if plane else L / columns)
        table |= {"depth": size, "columns": columns, "size": float(rng.uniform(0.2, 0.9)) * cell}
        table |= {"form": str(rng.choice(["square", "round", "dome"])) if plane else "square"}
        if plane:
            table["rows"] = rows
    elif shape == "journal":
        table |= {"c": size, "eccentricity": float(1 - 10 ** rng.uniform(-3, -0.01)), "widest": float(rng.uniform(0, L))}
    elif shape == "roughness":
        table |= {"sigma": size, "seed": int(rng.integers(0, 1000)), "cells": int(rng.integers(1, 30))}
    elif shape == "formula":
        words = {"a": f"{rng.uniform(0.1, 9):.3f}", "b": f"{rng.uniform(0.1, 9):.3f}", "L": repr(L), "W": repr(W)}
        table["h"] = f"{size!r}*(" + str(rng.choice(FORMULAS)).format(**words) + ")"
    else:
        points = int(rng.integers(2, 30))
        knots = size * 10 ** rng.uniform(-3, 0, points)
        path = folder / f"profile{seed}_{rng.integers(1 << 30)}.csv"
        np.savetxt(path, np.column_stack([np.linspace(0, L, points), knots]), delimiter=",", fmt="%.17g")
        kind = str(rng.choice(["linear", "nearest"]))
        table |= {"file": path.name, "unit": "m", "unit_x": "m", "interpolation": kind, "uneven": True}
    return table


def scene_of(seed: int, folder: Path) -> BearingScene:
    """The film of a seed; InputError where the package refuses it."""
    rng = np.random.default_rng([seed, 13])
    plane = bool(rng.random() < 0.6)
    points = [int(np.floor(10 ** rng.uniform(0, np.log10(41)))) for _ in range(2)]
    L = float(10 ** rng.uniform(-5, 1))
    W = L * float(10 ** rng.uniform(-3, 3)) if plane else L
    thin = L * float(10 ** rng.uniform(-6, -2)) if rng.random() < 0.8 else float(10 ** rng.uniform(-9, -2))
    sizes = thin * 10 ** rng.uniform(0, rng.choice([0.5, 2, 4]), int(rng.integers(1, 4)))
    films = [part_of(rng, seed, float(size), L, W, plane, folder) for size in sizes]
    mu = float(10 ** rng.uniform(-6, 3))
    U = 0.0 if rng.random() < 0.06 else float(10 ** rng.uniform(*((-12, 9) if rng.random() < 0.5 else (-3, 3))))
    U = -U if rng.random() < 0.3 else U
    p_c = float(rng.choice([0.0, 0.0, -3e4, 1e5]))
    natural = max(6 * mu * abs(U) * L / thin**2, 1e-30)

    def pressure() -> float:
        kind = rng.random()
        if kind < 0.35:
            return p_c
        return p_c + float(min(natural * 10 ** rng.uniform(-6, 2), 1e80) if kind < 0.7 else 10 ** rng.uniform(-3, 9))

    supply = pressure()
    sides: dict[str, Any] = {}
    for name in ("west", "east", "south", "north")[: 4 if plane else 2]:
        kind = rng.random()
        sides[name] = (supply if kind < 0.4 else pressure()) if kind < 0.65 else str(rng.choice(["closed", "symmetry"]))
    for first, second in (("west", "east"), ("south", "north"))[: 2 if plane else 1]:
        if rng.random() < 0.2:
            sides[first] = sides[second] = "periodic"
            at = 0 if first == "west" else 1
            points[at] = max(points[at], 3)
    if sides["west"] == p_c and U > 0 and rng.random() < 0.3:
        sides["west"] = {"p": p_c, "r": float(rng.choice([0.0, rng.uniform(0, 1), 0.999]))}
    data: dict[str, Any] = {"family": "bearing", "name": f"wild{seed}", "dimension": 2 if plane else 1, "L": L, "U": U}
    data |= {"nx": points[0], "film": films, "h_floor": thin, "sides": sides, "fluid": {"mu": mu, "p_c": p_c}}
    scheme = str(rng.choice(["face", "face", "face", "nodal", "upwind"]))
    if scheme == "nodal" and {"closed", "symmetry"} & {
        sides["west"] if isinstance(sides["west"], str) else "",
        str(sides["east"]),
    }:
        scheme = "upwind"  # nodal does not conserve mass at a wall where the film is not full, and is told so (mass_defect)
    data |= {"scheme": scheme}
    data |= {"ny": points[1], "width": W} if plane else {}
    scene = BearingScene(**data)
    scene._folder = folder
    return scene


@dataclass(frozen=True)
class Verdict:
    """What became of a film: refused, converged or another outcome; and how far from the dense answer it is.

    error : of p, in parts of the largest. ratio : largest over smallest conductance of the film's faces, for the record.
    """

    seed: int
    what: str
    message: str
    method: str = ""
    error: float = float("nan")
    ratio: float = 0.0
    said: float = 0.0  # the largest measure of its certificate

    @property
    def wrong(self) -> bool:
        return self.what == "converged" and not self.error <= WRONG

    @property
    def good(self) -> bool:
        """Refused, or right."""
        return self.what == "refused" or (self.what == "converged" and self.error <= WRONG)


def judge(seed: int, folder: Path, **how_to: Any) -> Verdict:
    """Solve by `auto`, or as `solve`'s keywords say, and compare."""
    scene = scene_of(seed, folder)
    # Faces made for the cavities found, or by quadrature in 1D, have tests of their own: here it is solvers that are judged.
    own = scene.scheme == "face" and (bool(getattr(scene.gap, "rims", None)) or len(scene.shape) == 1)
    return judged(scene, seed, own, **how_to)


def judged(scene: BearingScene, seed: int, own_faces: bool, **how_to: Any) -> Verdict:
    """The verdict on a scene, its faces taken from the package or made anew. Collective."""
    try:
        solution = solve(scene, **how_to)
    except InputError as refusal:
        return Verdict(seed, "refused", str(refusal))
    problem: Any = solution.problem
    how: Any = {"message": solution.message, "method": str(solution.settings["method"])}
    if not solution.converged:
        outcome = str(solution.outcome)
        solution.destroy()
        return Verdict(seed, outcome, **how)
    p, r = whole(problem.grid, solution.fields["p"] * problem.p_unit, solution.fields["r"])
    p_sides, p_unit = problem.p_sides, problem.p_unit
    own_faces = own_faces or problem.moving.remade  # as where the film ruptures at the side it comes in by
    if own_faces and problem.moving is not problem:  # the mirror image is what is solved
        p, r = p[:, ::-1], r[:, ::-1]
    p, r = p.ravel(), r.ravel()
    how["said"] = max(solution.certificate.measures.values())
    dense = Dense(scene, problem.moving if own_faces else None)
    solution.destroy()
    ratio = float(dense.k.max() / dense.k.min())
    try:
        expected, _ = dense.solve()
    except ArithmeticError:
        try:
            expected, _ = dense.solve((p, r))
        except ArithmeticError:
            return Verdict(seed, "no reference", **how, ratio=ratio)
    scale = max(float(expected.max()), *p_sides) or p_unit
    error = max(float(np.max(np.abs(expected - p))) - dense.rounding, 0.0) / scale
    if error > WRONG:  # whose digits are they?
        expected, _ = dense.solve((p, r), exactly=True)
        error = max(float(np.max(np.abs(expected - p))) - dense.rounding, 0.0) / scale
    return Verdict(seed, "converged", **how, error=error, ratio=ratio)
