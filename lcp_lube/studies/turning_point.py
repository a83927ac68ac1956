"""Stability around a turning point: -Lap v = lambda e^v, two solutions below the grid's own largest lambda, none beyond it.

That lambda and both solutions come from `Branch`, which follows the curve of solutions by the mean of v instead of by lambda:
code apart from the methods that it judges.
"""

from collections.abc import Iterator, Sequence
from functools import lru_cache, partial

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI
from scipy.optimize import brentq, minimize_scalar
from scipy.sparse.linalg import splu

from ..base.parallel import Array
from ..base.resumable import Row
from ..problems.solution import Outcome
from ..scenes.scene import Scene
from ..scenes.semilinear import BratuScene
from .map_picture import Axis, Panels
from .outcome_map import Case, OutcomeMap, tallies
from .reference import Reference

PARTS = (0.1, 0.01, 1e-3, 1e-4, 1e-6, 1e-8)  # of the turning point, below it and beyond it
SIZES = (8, 16, 32, 64)
MEANS = (1e-3, 1.4)  # of v: near zero, and well beyond the turning point on the upper branch

# What is tried: the scene, its start, and the arguments of `solve`.
WAYS = {
    "auto": ("bratu", 0.0, {}),
    "newton from 0, direct": ("bratu", 0.0, {"method": "newton", "recipe": "umfpack"}),
    "newton from 0, BiCGStab": ("bratu", 0.0, {"method": "newton", "recipe": "bcgs_ilu"}),
    "newton from 1, direct": ("bratu", 1.0, {"method": "newton", "recipe": "umfpack"}),
    "obstacle, auto": ("obstacle_bratu", None, {}),
    "obstacle, interior": ("obstacle_bratu", None, {"method": "interior"}),
}

X, Y = Axis("part", "lambda/turning point - 1", "part"), Axis("n", "points a side", "n")


class Branch:
    """The discrete solutions on n x n points as a curve over the mean of v, by Newton on (v, lambda)."""

    def __init__(self, n: int):
        line = sp.diags([-np.ones(n - 1), 2.0 * np.ones(n), -np.ones(n - 1)], [-1, 0, 1])
        self.A = (sp.kronsum(line, line) * (n + 1) ** 2).tocsc()
        self.size = n * n
        self._bump = splu(self.A).solve(np.ones(self.size))
        top = minimize_scalar(lambda s: -self.at(s)[1], bounds=MEANS, method="bounded", options={"xatol": 1e-9})
        self.mean, self.turning = float(top.x), float(-top.fun)

    def at(self, mean: float) -> tuple[Array, float]:
        """v with this mean, and its lambda."""
        v = self._bump * (mean / self._bump.mean())
        lam = float((self.A @ v).sum() / np.exp(v).sum())
        for _ in range(50):
            source = np.exp(v)
            solve = splu((self.A - sp.diags(lam * source)).tocsc()).solve
            a, b = solve(lam * source - self.A @ v), solve(source)
            change = (mean - v.mean() - a.mean()) / b.mean()
            step = a + change * b
            v, lam = v + step, lam + change
            if np.abs(step).max() < 1e-12 * np.abs(v).max() + 1e-13:
                break
        return v, lam

    def solutions(self, lam: float) -> tuple[Array, ...]:
        """Lower and upper solution, for lambda from 4.7 on; none beyond the turning point."""
        if lam >= self.turning:
            return ()
        means = [brentq(lambda s: self.at(s)[1] - lam, side, self.mean, xtol=1e-11) for side in MEANS]
        return tuple(self.at(mean)[0] for mean in means)


@lru_cache(maxsize=len(SIZES))
def branch(n: int) -> Branch:
    """One for each grid; its curve takes longer than the runs that it judges."""
    return Branch(n)


def cases(quick: bool) -> Iterator[Case]:
    """quick: Newton on the coarsest grid, a hundredth beside the turning point."""
    for way, (scene, v0, choices) in [*WAYS.items()][: 2 if quick else None]:
        for n in SIZES[:1] if quick else SIZES:
            for part in (-0.01, 0.01) if quick else (*(-p for p in PARTS), *reversed(PARTS)):
                changes = {"n": n, **({} if v0 is None else {"v0": v0})}
                key = {"way": way, "method": choices.get("method", "auto"), "n": n, "part": part}
                yield Case(key, scene, changes, choices, partial(beside, n, part))


def beside(n: int, part: float) -> dict[str, float]:
    """lambda beside the grid's turning point."""
    return {"lambda": branch(n).turning * (1.0 + part)}


def reference(scene: Scene) -> Reference:
    """Both solutions of Bratu's equation on this rank; between obstacles there are others, and the certificate alone judges."""
    if not isinstance(scene, BratuScene):
        return Reference()
    known = branch(scene.n)
    if scene.lam >= known.turning:
        return Reference(how="none: beyond the turning point", solvable=False)
    grid = scene.build().grid
    if MPI.COMM_WORLD.size > 1:
        return Reference(how="not on several ranks")
    assert grid.shape == (scene.n, scene.n)
    return Reference(tuple({"v": v} for v in known.solutions(scene.lam)), "curve of solutions by the mean of v")


def right(row: Row) -> bool:
    """Solved where there is a solution; proved to have none where Bratu's equation has none."""
    impossible = float(row["part"]) > 0 and not row["way"].startswith("obstacle")
    return row["outcome"] == (Outcome.NO_SOLUTION if impossible else Outcome.CONVERGED)


def sentence(rows: Sequence[Row]) -> str:
    told = tallies(rows, ("way",), (X, Y), right)
    return f"Right beyond the turning point: 'no solution' (between obstacles: one in contact). {told}"


chart = OutcomeMap("turning_point", cases, Panels("way", columns=3), X, Y, sentence, reference=reference, right=right).chart
