"""Solutions that were destroyed, and those that were dropped, leave nothing: counted by PETSc, by Python and in bytes."""

import gc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lcp_lube import Complementarity, solve
from lcp_lube.registry import METHODS

ROUNDS, WARM = 20, 4  # solves of each kind; those before memory is measured: caches fill, compiled code is loaded
LEAK = 3e6  # bytes: without finalisers the 190 dropped solutions hold thrice as much

SCENES: dict[str, dict[str, Any]] = {
    "lubrication": {"scene": "problem4", "n": 36},
    "box": {"scene": "obstacle_bratu", "n": 36},
    "equations": {"scene": "bratu", "n": 36},
    "mixed": {"scene": "ehl_line", "n": 40},
}


def user() -> Complementarity:
    n = 100
    A = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    return Complementarity(lambda v: A @ v - 1.0, lambda v: A, lower=np.zeros(n), upper=np.full(n, 5.0), x0=np.zeros(n))


def resident() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096


def runs() -> list[Callable[[], Any]]:
    """Solves by every method, of every kind of problem, and on every matrix."""
    how = [
        {**SCENES[kind], "method": name, "stopping": {"max_it": 2}, "rescue": False}
        for name in METHODS
        for kind in SCENES
        if kind in METHODS[name].kinds
    ]
    how += [{"scene": "problem4", "n": 36, "method": "active-set", "system": system} for system in ("full", "cavity")]
    return [*(lambda one=one: solve(**one) for one in how), lambda: solve(user(), method="semismooth")]


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="memory is read from /proc")
def test_400_solves_do_not_grow() -> None:
    def rounds(count: int) -> None:
        for k in range(count):
            for run in runs():
                solution = run()
                if k % 2:
                    solution.destroy()
                    solution.destroy()
        gc.collect()

    rounds(WARM)
    before = resident()
    rounds(ROUNDS)
    assert resident() - before < LEAK


@pytest.mark.parametrize("ranks", [1, 2])
def test_nothing_is_left_when_petsc_ends(script, ranks: int) -> None:
    """Every method and driver, derivatives too: no object of PETSc's, and no solution that something still refers to."""
    done = script("mpi_leaks.py", ranks=ranks, timeout=400)
    assert done.status == 0 and done.out.split("\n")[0] == "all made and dropped", done.err
    assert "never freed" not in done.out + done.err
