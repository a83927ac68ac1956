"""Films that nobody tuned for, of another kind than `wild_films`: few points, supplies, recesses on and over edges, ranks.

`data_of(seed)` is a plate, wedge or journal with recesses of any depth, from 1e-9 to 1e4 of the film's, whose edges lie
anywhere, on grid lines, on each other and on sides; supplies of all kinds; 1 to 3 points a side in half of them; all sides;
speeds of 1e-12 to 1e9 m/s and 0. As a script, on any number of ranks: `wilder_films.py FIRST COUNT` solves so many, half of
them by `auto`, and prints the verdicts that are not good.
"""

import sys
from typing import Any

import numpy as np
from mpi4py import MPI
from wild_films import WRONG, Verdict, judged

from lcp_lube.registry import METHODS
from lcp_lube.scenes.bearing import BearingScene

NAMED = [name for name, entry in METHODS.items() if "lubrication" in entry.kinds]
KINDS = ("open", "open", "open", "closed", "symmetry", "periodic")


def log(rng: np.random.Generator, low: float, high: float) -> float:
    return float(10 ** rng.uniform(low, high))


def span(rng: np.random.Generator, length: float, points: int) -> list[float]:
    """Start and end of a recess: anywhere, on lines of points or faces, on the sides, next to nothing wide, or nearly all."""
    kind = rng.integers(5)
    if kind == 0:
        ends = sorted(float(v) for v in rng.uniform(0, length, 2))
    elif kind == 1:
        lines = np.arange(2 * points + 3) * (0.5 * length / (points + 1))
        ends = sorted(float(v) for v in rng.choice(lines, 2, replace=False))
    elif kind == 2:
        ends = [0.0, float(rng.uniform(0, length))]
    elif kind == 3:
        start = float(rng.uniform(0, length))
        ends = [start, start + log(rng, -8, -1) * length]
    else:
        ends = [log(rng, -10, -1) * length, length * (1 - log(rng, -10, -1))]
    return [ends[0], min(max(ends[1], ends[0] * (1 + 1e-9) + 1e-9 * length), length)]


def data_of(seed: int) -> dict[str, Any]:
    """The scene file of a seed, as a dictionary."""
    rng = np.random.default_rng([seed, 313])
    plane = bool(rng.random() < 0.65)
    few = rng.random() < 0.5
    nx, ny = (int(rng.integers(1, 4)) if few else int(rng.integers(1, 31)) for _ in range(2))
    L = log(rng, -4, 0)
    W = L * log(rng, -2, 2)
    h, U, mu = L * log(rng, -6, -2), log(rng, -12, 9) if rng.random() < 0.3 else log(rng, -2, 2), log(rng, -5, 1)
    U = float(rng.choice([U, U, U, -U, 0.0], p=[0.3, 0.3, 0.2, 0.15, 0.05]))
    p_c = float(rng.choice([0.0, 1e5]))
    natural = max(6 * mu * abs(U) * L / h**2, 1e-3)

    def pressure(least: float = 0.0) -> float:
        return p_c + least + float(rng.choice([0.0, 1e5, natural * log(rng, -8, 3), log(rng, -6, 8)]))

    sides: dict[str, Any] = {}
    for first, second, n in (("west", "east", nx), ("south", "north", ny))[: 2 if plane else 1]:
        kinds = [str(kind) for kind in rng.choice(KINDS, 2)]
        if "periodic" in kinds and n >= 3:
            kinds = ["periodic", "periodic"]
        for name, kind in zip((first, second), kinds, strict=True):
            sides[name] = pressure() if kind == "open" or (kind == "periodic" and n < 3) else kind
    base = rng.integers(4)
    films: list[dict[str, Any]] = [{"shape": "constant", "h": h}]
    if base == 1:
        films = [{"shape": "linear", "along": "x", "h_start": h * log(rng, 0, 4), "h_end": h}]
    elif base == 2:
        films = [{"shape": "journal", "c": h, "eccentricity": 1 - log(rng, -5, -0.05), "widest": float(rng.uniform(0, L))}]
    elif base == 3 and plane:
        films.append({"shape": "linear", "along": "y", "h_start": h * log(rng, -3, 3), "h_end": h})
    for _ in range(int(rng.integers(0, 5))):
        table: dict[str, Any] = {"shape": "pocket", "depth": log(rng, -4, -2) if rng.random() < 0.3 else h * log(rng, -9, 4)}
        table["x"] = span(rng, L, nx)
        if plane and rng.random() < 0.8:
            table["y"] = span(rng, W, ny)
        films.append(table)
    data: dict[str, Any] = {"family": "bearing", "name": f"wilder{seed}", "dimension": 2 if plane else 1, "L": L, "U": U}
    data |= {"nx": nx, "film": films, "sides": sides, "fluid": {"mu": mu, "p_c": p_c}}
    data |= {"width": W, "ny": ny} if plane else {}
    supplies: list[dict[str, Any]] = []
    for _ in range(int(rng.choice([0, 0, 1, 1, 2, 3]))):
        table = dict({"x": span(rng, L, nx)} | ({"y": span(rng, W, ny)} if plane else {}))
        if plane and rng.random() < 0.3:
            d = min(L, W) * log(rng, -3, -0.1)
            at = [float(rng.uniform(0.5 * d, size - 0.5 * d)) for size in (L, W)]
            table = {"shape": "hole", "at": at, "diameter": d}
        source = rng.integers(4)
        k = h**3 / (6 * mu) * (W / L if plane else 1 / L)  # of the film's size
        if source == 0:
            table["flow"] = float(rng.choice([0.0, k * natural * log(rng, -4, 3)]))
        elif source == 1:
            table |= {"restrictor": "capillary", "K": k * log(rng, -4, 4), "p_s": pressure(natural), "backflow": True}
        elif source == 2:
            K = k * float(np.sqrt(natural)) * log(rng, -4, 4)
            table |= {"restrictor": "orifice", "K": K, "p_s": pressure(natural), "backflow": True}
        else:
            table["p"] = pressure()
        supplies.append(table)
    return data | ({"supply": supplies} if supplies else {})


def way_of(seed: int) -> dict[str, Any]:
    """How to solve it: half by `auto`, half by a named method alone or with those that take over."""
    rng = np.random.default_rng([seed, 314])
    if rng.random() < 0.5:
        return {}
    return {"method": str(rng.choice(NAMED)), "rescue": bool(rng.random() < 0.5)}


def judge(seed: int, **how_to: Any) -> Verdict:
    """The verdict on the film of a seed. Collective."""
    try:
        scene = BearingScene(**data_of(seed))
    except ValueError as refusal:
        return Verdict(seed, "refused", str(refusal))
    return judged(scene, seed, own_faces=True, **how_to)


def fault(verdict: Verdict, how_to: dict[str, Any]) -> bool:
    """A wrong answer that is called converged; or none, by `auto`, to what has one. A named method may fail with a sentence."""
    if verdict.what == "converged":
        return not verdict.error <= (max(WRONG, 4 * verdict.said) if how_to else WRONG)
    # A source's flow may be less than one digit of the pressure moves beside a recess that is 100 times as deep as the film,
    # or where nothing has a way out but through restrictors.
    told = verdict.what in ("refused", "no_solution") or ("film and source differ" in verdict.message and _hard(verdict.seed))
    return not (told or (how_to and verdict.message and verdict.what != "error"))


def _hard(seed: int) -> bool:
    data = data_of(seed)
    sizes = [max(part.get(key, 0.0) for key in ("h", "c", "depth", "h_start", "h_end")) for part in data["film"]]
    return max(sizes) > 100 * sizes[0] or all(isinstance(side, str) for side in data["sides"].values())


def main(first: int, count: int) -> None:
    kinds: dict[str, int] = {}
    for seed in range(first, first + count):
        how_to = way_of(seed)
        try:
            verdict = judge(seed, **how_to)
        except Exception as error:
            verdict = Verdict(seed, "error", f"{type(error).__name__}: {error}")
        what = f"{'named' if how_to else 'auto'} {verdict.what}"
        kinds[what] = kinds.get(what, 0) + 1
        if MPI.COMM_WORLD.rank == 0 and fault(verdict, how_to):
            print(how_to, verdict, flush=True)
    if MPI.COMM_WORLD.rank == 0:
        print(f"{MPI.COMM_WORLD.size} ranks, seeds {first} to {first + count - 1}: {kinds}", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
